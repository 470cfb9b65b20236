"""A folder, a glob or a single image as a camera: ``files:shots/*.tif?fps=5&gray=luma&bits=12``.

Pictures are read when they are asked for, in the order of ``acquire.files.order`` (``order=time``, ``first=NAME`` where
names do not say it), pages of a multi-page TIFF one after the other. Nobody stamped them: ``clock`` is "nominal", or
times come from a CSV. A picture that cannot be read, is a mask by its name or not like most, is a damaged frame and an
event; the others come all the same. ``white=4080`` is the grey level of saturation, where that is not the highest of
the bits.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.addresses import Address
from acquire.camera import CameraBase
from acquire.errors import ConfigError, DataError, PhasedicError
from acquire.events import EventSink, device_event, ignore_event
from acquire.files.headers import full_pages, quantisation, tiff_pages
from acquire.files.order import AUTO, BY, in_order, listed, masks
from acquire.files.picture import (
    GRAYS,
    LOSSY,
    Source,
    check_regular,
    picture_source,
    read_bytes,
    read_picture_page,
    to_gray,
)
from acquire.frame import QUANTISATION, CameraInfo, Frame, frozen
from acquire.opencv.image_metadata import read_stamps, taken_times
from acquire.settings import choice, number, read_settings, setting, whole
from acquire.text import Message
from acquire.text.message import counted

MAX_REPORTED = 20  # pictures that are left out, one by one
_SAMPLE = 3  # pictures whose format is compared


def find_images(target: str, by: str = AUTO, first: str | None = None) -> list[Path]:
    """The images a folder, glob or file name stands for, in the order of the test; masks come last.

    Parameters
    ----------
    target : str
    by, first
        As for ``acquire.files.order.in_order``.

    Raises
    ------
    DataError
        There is none, or one is no regular file.
    ConfigError
        The order is not clear.
    """
    found = listed(target)
    for item in found:
        if item.exists():  # a link to nothing is a picture that cannot be read
            check_regular(item)
    ends = masks([path.name for path in found])
    used, last = ([path for path in found if (path.name in ends) is end] for end in (False, True))
    common = os.path.commonpath([path.parent for path in used])
    names = [os.path.relpath(path, common) for path in used]
    chosen = next((name for name, path in zip(names, used, strict=True) if first in (name, path.name)), None)
    order = in_order(names, lambda: taken_times(used), by, chosen if first else None)
    return [used[k] for k in order] + sorted(last)


def read_image(path: str | Path, gray: str | None = None, page: int = 0) -> NDArray[Any]:
    """One grey picture, (H, W) uint8 or uint16, GL.

    Parameters
    ----------
    path : str or Path
    gray : "luma" | "r" | "g" | "b" | None
        What is grey in a colour picture.
    page : int
        Of a multi-page TIFF.

    Raises
    ------
    DataError
        Missing, no regular file, truncated, damaged, not an image, or not of 8 or 16 bits.
    ConfigError
        A colour picture without ``gray``.
    """
    path = Path(path)
    return to_gray(read_picture_page(path, picture_source(path), page), gray, str(path))


# fmt: off
@dataclass(frozen=True, slots=True)
class FileSettings:
    """Settings of ``files:shots/*.tif``."""

    fps: float = setting(number(1e-6, 1e6), 1.0, "pictures a second", "1/s")
    gray: str | None = setting(choice(*GRAYS), None, "what is grey in a colour picture")
    bits: int | None = setting(whole(1, 16), None, "significant bits; default those of the file's samples")
    white: int | None = setting(whole(1, 65535), None, "grey level of saturation, where it is not the highest", "GL")
    stamps: str | None = setting(str, None, "CSV with the time of each picture")
    order: str = setting(choice(*BY), AUTO, "of the pictures")
    first: str | None = setting(str, None, "name of the first one")
# fmt: on


class ImageFiles(CameraBase):
    """Image files as a camera; see ``acquire.camera.Camera``.

    Each picture that is left out gives an event whose data names the ``file`` and the time ``t`` of the
    picture, s; after ``MAX_REPORTED`` only their number.

    Raises
    ------
    DataError, ConfigError
        No image, an unreadable first one, or stamps that do not fit.
    """

    def __init__(
        self, address: str, paths: list[Path], settings: FileSettings, on_event: EventSink = ignore_event
    ) -> None:
        super().__init__()
        self._paths, self._settings, self._on_event = paths, settings, on_event
        self._left_out = 0
        self._stamps = _stamps(settings, paths)
        self._masks = masks([path.name for path in paths])
        self._usual = _usual([path for path in paths if path.name not in self._masks])
        first = read_image(self._usual, settings.gray, _pages_of(self._usual)[0])
        self._bits = settings.bits or 8 * first.itemsize
        self._check_range(first, self._usual)
        self._shape, self._dtype = first.shape, first.dtype
        self.info = CameraInfo(
            address=address,
            name=Message("{counted}, {first} ...", counted(len(paths), "image file"), paths[0].name),
            width=first.shape[1],
            height=first.shape[0],
            bits=self._bits,
            live=False,
            clock="nominal",
            fps=None if self._stamps else settings.fps,
            pixel_format=paths[0].suffix.lstrip(".").upper(),
            controls={"files": len(paths), "gray": settings.gray, "stamps": settings.stamps} | self._steps(),
            warnings=tuple(self._warnings(first)),
            white_level=settings.white,
        )

    def __iter__(self) -> Iterator[Frame]:
        self._left_out = 0
        for index, (path, source, page) in enumerate(self._pages()):
            if self.stopped.is_set():
                return
            yield self._frame(index, path, source, page)
        if self._left_out > MAX_REPORTED:
            self._report(
                Message("{left_out} pictures were left out in all", self._left_out), self._time(index)
            )

    def _pages(self) -> Iterator[tuple[Path, Callable[[], Source], int]]:
        for path in self._paths:
            source = cache(partial(picture_source, path))
            for page in _pages_of(path):
                yield path, source, page

    def _frame(self, index: int, path: Path, source: Callable[[], Source], page: int) -> Frame:
        t = self._time(index)
        try:
            if path.name in self._masks:
                raise DataError("{path} is a mask by its name (--mask {path} uses it)", path)
            image = self._checked(read_picture_page(path, source(), page), path)
        except PhasedicError as error:
            self._leave_out(path, t, error.text)
            black = frozen(np.zeros(self._shape, self._dtype))
            return Frame(black, index, t, "nominal", 0, self._bits, t, damaged=True)
        return Frame(image, index, t, "nominal", 0, self._bits, t, white_level=self._settings.white)

    def _leave_out(self, path: Path, t: float, why: str) -> None:
        self._left_out += 1
        if self._left_out <= MAX_REPORTED:
            self._report(Message("{why}; this picture is left out", why), t, file=path.name)

    def _report(self, text: str, t: float, **data: Any) -> None:
        device_event(self._on_event, self.info.address, text, t=t, **data)

    def _time(self, index: int) -> float:
        if self._stamps is None:
            return index / self._settings.fps
        if index >= len(self._stamps):
            raise DataError(
                "{stamps}: {count} times, but there are more pictures",
                self._settings.stamps,
                len(self._stamps),
            )
        return self._stamps[index]

    def _checked(self, picture: NDArray[Any], path: Path) -> NDArray[Any]:
        if picture.shape[:2] != self._shape or picture.dtype != self._dtype:
            raise DataError(
                "{path} is {size} {dtype}, but {usual} is {size2} {dtype2}; all images of one test must be alike",
                path,
                _size(picture.shape),
                picture.dtype,
                self._usual,
                _size(self._shape),
                self._dtype,
            )
        image = to_gray(picture, self._settings.gray, str(path))
        self._check_range(image, path)
        return frozen(image)

    def _check_range(self, image: NDArray[Any], path: Path) -> None:
        if self._bits > 8 * image.itemsize:
            raise ConfigError(
                "{path}: bits={bits}, but its samples have {itemsize}", path, self._bits, 8 * image.itemsize
            )
        if self._bits < 8 * image.itemsize and image.max() >= 2**self._bits:
            raise DataError(
                "{path}: a value of {most} does not fit into bits={bits}; give the camera's bits",
                path,
                image.max(),
                self._bits,
            )

    def _steps(self) -> dict[str, Any]:
        if self._usual.suffix.lower() not in LOSSY:
            return {}
        steps = quantisation(read_bytes(self._usual))
        return {} if steps is None else {QUANTISATION: steps}

    def _warnings(self, first: NDArray[Any]) -> Iterator[str]:
        pages, taken = tiff_pages(self._usual), _pages_of(self._usual)
        if len(taken) < len(pages):
            yield Message(
                "{name}: {count} of {len2} pages are taken, the others are smaller (thumbnails)",
                self._usual.name,
                len(taken),
                len(pages),
            )
        if any(path.suffix.lower() in LOSSY for path in self._paths):
            yield Message(
                "JPEG is lossy: its artefacts (0.6 to 1.7 GL) do not average out; TIFF or PNG measure better"
            )
        zeros = int(np.bitwise_or.reduce(first, axis=None))
        low = (zeros & -zeros).bit_length() - 1  # bits that are 0 in all pixels
        if first.itemsize == 2 and first.max() >= 2**14 and 2 <= low <= 8 and self._settings.white is None:
            yield Message(
                "16-bit files whose values are multiples of {step}: if the camera has {bits} bits say white={white}, "
                "so that clipped pixels are seen",
                2**low,
                16 - low,
                65536 - 2**low,
            )
        for bits in (10, 12, 14):
            if self._settings.bits is None and first.itemsize == 2 and 2**8 <= first.max() < 2**bits:
                yield Message(
                    "16-bit files whose largest value is {most}: if the camera has {bits} bits say bits={bits}, so "
                    "that clipped pixels are seen",
                    first.max(),
                    bits,
                )
                return


def _usual(paths: list[Path]) -> Path:
    """The first picture of the size and depth that most of some have; raises where the first cannot be read."""
    formats = {paths[0]: _format(paths[0])}
    for path in paths[:: -(-len(paths) // _SAMPLE)]:
        with suppress(PhasedicError):
            formats[path] = _format(path)
    usual = Counter(formats.values()).most_common(1)[0][0]
    at = next(k for k, path in enumerate(paths) if formats.get(path) == usual)
    for path in paths[: at if usual != formats[paths[0]] else 0]:
        with suppress(PhasedicError):
            if _format(path) == usual:
                return path
    return paths[at]


def _format(path: Path) -> tuple[tuple[int, ...], Any]:
    picture = read_picture_page(path, picture_source(path), _pages_of(path)[0])
    return picture.shape[:2], picture.dtype


def _pages_of(path: Path) -> list[int]:
    """Pages of the size of its largest; one where the file is broken: reading it raises."""
    try:
        return full_pages(path)
    except PhasedicError:
        return [0]


def _size(shape: tuple[int, ...]) -> str:
    return f"{shape[1]}x{shape[0]}"


def picture_names(address: Address) -> list[tuple[str, int]]:
    """File and page of each picture of ``files:...``, in their order; raises as ``find_images``."""
    return [(path.name, page) for path in _found(address) for page in _pages_of(path)]


def picture_times(address: Address) -> dict[str, float]:
    """Name -> time (s) of each picture of ``files:...`` but masks, as ``open_files`` would stamp them.

    Raises
    ------
    ConfigError
        Two have the same name, or one has several pages.
    DataError
        No picture, or stamps that do not fit.
    """
    paths, settings = _found(address), read_settings(FileSettings, address)
    stamps = _stamps(settings, paths)
    ends = masks([path.name for path in paths])
    times = {path.name: stamps[k] if stamps else k / settings.fps for k, path in enumerate(paths)}
    if len(times) < len(paths) or any(len(_pages_of(path)) > 1 for path in paths):
        raise ConfigError(
            "{text}: two pictures share a name, or one has several pages; give times in place of names",
            address.text,
        )
    return {name: t for name, t in times.items() if name not in ends}


def open_files(address: Address, on_event: EventSink) -> ImageFiles:
    """Open ``files:folder|glob|name?fps=&gray=&bits=&white=&stamps=&order=&first=``.

    Raises
    ------
    ConfigError, DataError
        See ``acquire.camera.open_camera``.
    """
    return ImageFiles(address.text, _found(address), read_settings(FileSettings, address), on_event)


def _stamps(settings: FileSettings, paths: list[Path]) -> list[float] | None:
    """The times of a CSV, one a picture; masks, which come last, have that of the last."""
    if not settings.stamps:
        return None
    ends = masks([path.name for path in paths])
    stamps = read_stamps(Path(settings.stamps), [path for path in paths if path.name not in ends])
    return stamps + stamps[-1:] * len(ends)


def _found(address: Address) -> list[Path]:
    settings = read_settings(FileSettings, address)
    return find_images(address.target, settings.order, settings.first)
