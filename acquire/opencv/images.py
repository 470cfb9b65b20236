"""A folder, a glob or a single image as a camera: ``files:shots/*.tif?fps=5&gray=luma&bits=12``.

Pictures are read when they are asked for, in natural order (2 before 10), pages of a multi-page
TIFF one after the other. Nobody stamped them: ``clock`` is "nominal", or times come from a CSV. A picture
that cannot be read, or is not like the first, is a damaged frame and an event; the others come all the same.
``white=4080`` is the grey level of saturation, where that is not the highest of the bits.
"""

from __future__ import annotations

import glob
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.addresses import Address, Options, expanded
from acquire.camera import CameraBase
from acquire.errors import ConfigError, DataError, PhasedicError
from acquire.events import EventSink, device_event, ignore_event
from acquire.files.picture import LOSSY, Source, check_regular, picture_source, read_picture_page
from acquire.frame import CameraInfo, Frame, frozen
from acquire.opencv.gray import GRAYS, to_gray
from acquire.opencv.image_metadata import count_pages, read_stamps

SUFFIXES = (".tif", ".tiff", ".png", ".bmp", ".jpg", ".jpeg", ".pgm")
MAX_REPORTED = 20  # pictures that are left out, one by one
_DIGITS = re.compile(r"(\d+)")


def natural_key(path: Path) -> list[tuple[int, str]]:
    """Sort key under which shot_2 comes before shot_10."""
    parts = _DIGITS.split(str(path))
    return [(int(part), "") if part.isdecimal() else (0, part.lower()) for part in parts]


def find_images(target: str) -> list[Path]:
    """The images a folder, glob or file name stands for, in natural order.

    Raises
    ------
    DataError
        There is none, or one is no regular file.
    """
    path = expanded(target)
    if path.is_dir():
        found = [item for item in path.iterdir() if item.suffix.lower() in SUFFIXES]
    elif path.exists():
        found = [path]
    else:
        names = glob.glob(str(path), recursive=True)  # noqa: PTH207 (absolute patterns too)
        found = [Path(name) for name in names if not Path(name).is_dir()]
    if not found:
        raise DataError(f"files:{target}: no image there; looked in {Path.cwd()} for {', '.join(SUFFIXES)}")
    for item in found:
        check_regular(item)
    return sorted(found, key=natural_key)


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


@dataclass(frozen=True, slots=True)
class FileSettings:
    """The settings in an address of image files.

    Attributes
    ----------
    fps : float, 1/s
    gray : str or None
    bits : int or None
        Significant bits; None: those of the file's samples.
    white : int or None, GL
        Where a sample is saturated; None: at the highest of its bits.
    stamps : str or None
        CSV with the time of each picture.
    """

    fps: float = 1.0
    gray: str | None = None
    bits: int | None = None
    white: int | None = None
    stamps: str | None = None


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
        self._stamps = read_stamps(Path(settings.stamps), paths) if settings.stamps else None
        first = read_image(paths[0], settings.gray)
        self._bits = settings.bits or 8 * first.itemsize
        self._check_range(first, paths[0])
        self._shape, self._dtype = first.shape, first.dtype
        self.info = CameraInfo(
            address=address,
            name=f"{len(paths)} image file{'s' * (len(paths) > 1)}, {paths[0].name} ...",
            width=first.shape[1],
            height=first.shape[0],
            bits=self._bits,
            live=False,
            clock="nominal",
            fps=None if self._stamps else settings.fps,
            pixel_format=paths[0].suffix.lstrip(".").upper(),
            controls={"files": len(paths), "gray": settings.gray, "stamps": settings.stamps},
            warnings=tuple(self._warnings(first)),
            white_level=settings.white,
        )

    def __iter__(self) -> Iterator[Frame]:
        self._left_out = 0
        for index, (path, read) in enumerate(self._pages()):
            if self.stopped.is_set():
                return
            yield self._frame(index, path, read)
        if self._left_out > MAX_REPORTED:
            self._report(f"{self._left_out} pictures were left out in all", self._time(index))

    def _pages(self) -> Iterator[tuple[Path, Callable[[], NDArray[Any]]]]:
        for path in self._paths:
            source = cache(partial(picture_source, path))
            for page in range(_count(path)):
                yield path, partial(_read_page, path, source, page)

    def _frame(self, index: int, path: Path, read: Callable[[], NDArray[Any]]) -> Frame:
        t = self._time(index)
        try:
            image = self._checked(read(), path)
        except PhasedicError as error:
            self._leave_out(path, t, str(error))
            black = frozen(np.zeros(self._shape, self._dtype))
            return Frame(black, index, t, "nominal", 0, self._bits, t, damaged=True)
        return Frame(image, index, t, "nominal", 0, self._bits, t, white_level=self._settings.white)

    def _leave_out(self, path: Path, t: float, why: str) -> None:
        self._left_out += 1
        if self._left_out <= MAX_REPORTED:
            self._report(f"{why}; this picture is left out", t, file=path.name)

    def _report(self, text: str, t: float, **data: Any) -> None:
        device_event(self._on_event, self.info.address, text, t=t, **data)

    def _time(self, index: int) -> float:
        if self._stamps is None:
            return index / self._settings.fps
        if index >= len(self._stamps):
            raise DataError(
                f"{self._settings.stamps}: {len(self._stamps)} times, but there are more pictures"
            )
        return self._stamps[index]

    def _checked(self, picture: NDArray[Any], path: Path) -> NDArray[Any]:
        image = to_gray(picture, self._settings.gray, str(path))
        if image.shape != self._shape or image.dtype != self._dtype:
            raise DataError(
                f"{path} is {_size(image.shape)} {image.dtype}, but {self._paths[0]} is "
                f"{_size(self._shape)} {self._dtype}; all images of one test must be alike"
            )
        self._check_range(image, path)
        return frozen(image)

    def _check_range(self, image: NDArray[Any], path: Path) -> None:
        if self._bits > 8 * image.itemsize:
            raise ConfigError(f"{path}: bits={self._bits}, but its samples have {8 * image.itemsize}")
        if self._bits < 8 * image.itemsize and image.max() >= 2**self._bits:
            raise DataError(
                f"{path}: a value of {image.max()} does not fit into bits={self._bits}; give the camera's bits"
            )

    def _warnings(self, first: NDArray[Any]) -> Iterator[str]:
        if any(path.suffix.lower() in LOSSY for path in self._paths):
            yield "JPEG is lossy: its artefacts (0.6 to 1.7 GL) do not average out; TIFF or PNG measure better"
        for bits in (10, 12, 14):
            if self._settings.bits is None and first.itemsize == 2 and 2**8 <= first.max() < 2**bits:
                yield (
                    f"16-bit files whose largest value is {first.max()}: if the camera has {bits} bits say "
                    f"bits={bits}, so that clipped pixels are seen"
                )
                return


def _count(path: Path) -> int:
    """Pages; one where the file is broken: reading it raises."""
    try:
        return count_pages(path)
    except PhasedicError:
        return 1


def _read_page(path: Path, source: Callable[[], Source], page: int) -> NDArray[Any]:
    return read_picture_page(path, source(), page)


def _size(shape: tuple[int, ...]) -> str:
    return f"{shape[1]}x{shape[0]}"


def picture_names(address: Address) -> list[tuple[str, int]]:
    """File and page of each picture of ``files:...``, in their order; raises as ``find_images``."""
    return [(path.name, page) for path in find_images(address.target) for page in range(_count(path))]


def picture_times(address: Address) -> dict[str, float]:
    """Name -> time (s) of each picture of ``files:...``, as ``open_files`` would stamp them.

    Raises
    ------
    ConfigError
        Two have the same name, or one has several pages.
    DataError
        No picture, or stamps that do not fit.
    """
    paths, settings = find_images(address.target), _settings(address)
    stamps = read_stamps(Path(settings.stamps), paths) if settings.stamps else None
    times = {path.name: stamps[k] if stamps else k / settings.fps for k, path in enumerate(paths)}
    if len(times) < len(paths) or any(_count(path) > 1 for path in paths):
        raise ConfigError(
            f"{address.text}: two pictures share a name, or one has several pages; give times in place of names"
        )
    return times


def open_files(address: Address, on_event: EventSink) -> ImageFiles:
    """Open ``files:folder|glob|name?fps=&gray=&bits=&white=&stamps=``.

    Raises
    ------
    ConfigError, DataError
        See ``acquire.camera.open_camera``.
    """
    return ImageFiles(address.text, find_images(address.target), _settings(address), on_event)


def _settings(address: Address) -> FileSettings:
    options = Options(address)
    gray = options.text("gray")
    if gray is not None and gray not in GRAYS:
        raise ConfigError(f"{address.text}: gray={gray} is not possible; allowed: {', '.join(GRAYS)}")
    settings = FileSettings(
        fps=options.number("fps", 1.0, minimum=1e-6, maximum=1e6),
        gray=gray,
        bits=options.integer("bits", minimum=1, maximum=16),
        white=options.integer("white", minimum=1, maximum=65535),
        stamps=options.text("stamps"),
    )
    options.done()
    return settings
