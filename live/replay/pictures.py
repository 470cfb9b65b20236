"""Pictures as the source of a replay: a folder, a video, any camera address."""

from __future__ import annotations

import csv
import datetime
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np

from acquire.addresses import parse_address, with_setting
from acquire.burst import average_bursts, burst_of
from acquire.camera import Camera, with_scheme
from acquire.clock import ClockPair
from acquire.errors import DataError
from acquire.files.order import listed, masks
from acquire.frame import Burst, CameraInfo, Frame, frozen
from acquire.load_cell import LoadLog
from acquire.opencv.images import picture_names
from acquire.text import Message
from acquire.text.message import counted
from live.config.loading import Config
from live.replay.source import PictureCount, ReplayRequest, ReplaySource, Window


def picture_source(camera: Camera, request: ReplayRequest, config: Config) -> ReplaySource:
    count = PictureCount()
    frames = count.passing(camera)
    if request.reference is not None:
        reference = reference_from(request.reference, camera.info)
    else:
        reference = _leading_burst(frames, config.measure.reference_burst or 1, request.source)
        count.reference = reference.n
    loads = LoadLog(config.load.max_gap_s, config.load.lag_s)
    loads.close()
    bursts = Window.of(request, 0.0).part(average_bursts(frames, config.measure.burst or 1))
    start = ClockPair(0.0, datetime.datetime.now(datetime.UTC))
    expected = _expected(camera.info, 0 if request.reference is not None else reference.n, config)
    words = _words(request, reference, camera.info)
    return ReplaySource(
        camera.info, reference, bursts, loads, start, expected=expected, count=count, words=words
    )


def _words(request: ReplayRequest, reference: Burst, camera: CameraInfo) -> str:
    address = parse_address(with_scheme(request.source))
    if address.scheme != "files":
        words = reference_words(request, reference, camera.controls.get("frames"))
        return (
            Message(
                "{words} at {fps:g} a second, as the film is played (of a camera that was faster: '{film}?fps=1000')",
                words,
                camera.fps,
                camera.name,
            )
            if address.scheme == "video" and "fps" not in dict(address.settings)
            else words
        )
    found = picture_names(address)
    ends = masks([name for name, _ in found])
    used = [(name, page) for name, page in found if name not in ends]
    pages = {name for name, page in used if page}
    names = [f"{name} page {page + 1}" if name in pages else name for name, page in used]
    return reference_words(request, reference, len(names), names)


def reference_words(
    request: ReplayRequest,
    reference: Burst,
    count: int | None,
    names: Sequence[str] = (),
    last: int | None = None,
) -> str:
    """The first line of a replay: the reference, the last picture (number ``last``) and how many there are."""

    def name(index: int) -> str:
        return names[index] if names else Message("frame {n}", index + 1)

    first = name(reference.first_index)
    if request.reference is not None:
        first = Message("{name} (as given)", Path(request.reference).name)
    elif reference.last_index > reference.first_index:
        first = Message("{first} to {last} (mean of {n})", first, name(reference.last_index), reference.n)
    if not count:
        return Message("reference {first}", first)
    newest = name(count - 1 if last is None else last)
    return Message("reference {first}, last {last}, {pictures}", first, newest, counted(count, "picture"))


def with_reference(request: ReplayRequest) -> ReplayRequest:
    """The request with the path of a reference that is one of its pictures, which come in an order that fits it."""
    if request.reference is None:
        return request
    path = _among(request.source, request.reference)
    if path is None:
        return request
    return replace(request, reference=str(path), source=with_setting(request.source, "first", path.name))


def reference_file(source: str, name: str | None) -> str | None:
    """The path of the picture of ``source`` that has this name or path; ``name`` where none has."""
    return name if name is None else str(_among(source, name) or name)


def _among(source: str, name: str) -> Path | None:
    address, given = parse_address(with_scheme(source)), Path(name)
    if address.scheme != "files":
        return None
    with suppress(DataError):
        for path in listed(address.target):
            if path.samefile(given) if given.exists() else path.name == given.name:
                return path
    return None


def _expected(camera: CameraInfo, taken: int, config: Config) -> int | None:
    """Number of bursts of the files or frames, without those ``taken`` for the reference."""
    there = camera.controls.get("files") or camera.controls.get("frames")
    return (
        (there - taken) // (config.measure.burst or 1) if isinstance(there, int) and there > taken else None
    )


def _leading_burst(frames: Iterator[Frame], n: int, source: str) -> Burst:
    for burst in average_bursts(frames, n):
        return burst
    raise DataError(
        "{source}: fewer than {n} pictures for the reference; give a smaller --reference-burst", source, n
    )


def reference_from(path: str, camera: CameraInfo) -> Burst:
    """A picture file as the reference of the pictures of ``camera``.

    Raises
    ------
    DataError
        Missing, not a picture, or not of the size and bits of the pictures.
    """
    from acquire.opencv.images import read_image

    image = read_image(path, camera.controls.get("gray"))
    if image.shape != (camera.height, camera.width):
        raise DataError(
            "{path}: the reference has {width} x {height} px, the pictures {their_width} x {their_height}; they must"
            " be the same",
            path,
            image.shape[1],
            image.shape[0],
            camera.width,
            camera.height,
        )
    if image.itemsize != (1 if camera.bits <= 8 else 2) or int(image.max()) >= 2**camera.bits:
        raise DataError(
            "{path}: the reference has {sample_bits}-bit samples up to {most}, the pictures have {bits} bits; they"
            " must be the same",
            path,
            8 * image.itemsize,
            image.max(),
            camera.bits,
        )
    return burst_of(
        [Frame(frozen(image), 0, 0.0, "nominal", 0, camera.bits, 0.0, white_level=camera.white_level)]
    )


def write_names(source: str, path: Path) -> None:
    """Write the file name of each frame of the results as a CSV; nothing where the source has no files.

    Raises
    ------
    DataError
        It exists, or cannot be written.
    """
    address = parse_address(with_scheme(source))
    if address.scheme != "files":
        return
    try:
        with path.open("x", encoding="utf-8", errors="surrogateescape", newline="") as file:
            rows = csv.writer(file, lineterminator="\n")
            rows.writerow(("frame", "file", "page"))
            rows.writerows((frame, *name) for frame, name in enumerate(picture_names(address)))
    except OSError as error:
        raise DataError("{path}: cannot be written ({why}); choose another --out", path, error) from None


def picture_of(burst: Burst) -> Frame:
    """The picture of a burst for the view: its mean, rounded."""
    kind = np.uint8 if burst.bits <= 8 else np.uint16
    image = burst.mean if burst.mean.dtype == kind else np.rint(burst.mean).astype(kind)
    return Frame(frozen(image), burst.first_index, burst.t, burst.clock, 0, burst.bits, burst.t)
