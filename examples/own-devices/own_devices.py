"""A camera and a load cell of your own: raw frame dumps (``raw:``) and forces from a CSV (``csv:``).

Copy this file, keep its structure, and call your device where the files are read.
"""

from __future__ import annotations

import csv
import itertools
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from phasedic import (
    Address,
    CameraInfo,
    CameraListing,
    CameraSetting,
    Closing,
    DataError,
    Event,
    EventKind,
    EventSink,
    Frame,
    LoadCellInfo,
    LoadSample,
    Options,
    device_event,
    frozen,
)

LOWEST_FPS, HIGHEST_FPS = 1e-3, 1e7


class _Source(Closing):
    """The common part of camera and load cell: ``stop`` from any thread, ``close`` any number of times."""

    def __init__(self) -> None:
        self._stopped = threading.Event()

    def stop(self) -> None:
        """End the iteration; from any thread."""
        self._stopped.set()

    def close(self) -> None:
        """Release the device; nothing here, since files are open only during the iteration."""
        self._stopped.set()


@dataclass(frozen=True, slots=True)
class Layout:
    """The format of the frames in the file."""

    width: int
    height: int
    bits: int
    skip: int
    white: int | None = None

    @property
    def dtype(self) -> np.dtype[np.uint8] | np.dtype[np.uint16]:
        return np.dtype(np.uint8) if self.bits <= 8 else np.dtype("<u2")

    @property
    def frame_bytes(self) -> int:
        return self.width * self.height * self.dtype.itemsize


class RawDump(_Source):
    """A file of frames without a header between them; see ``acquire.camera.Camera``."""

    def __init__(self, address: str, path: Path, layout: Layout, fps: float, on_event: EventSink) -> None:
        super().__init__()
        self._path, self._layout, self._fps, self._on_event = path, layout, fps, on_event
        if not path.is_file():
            raise DataError(f"{address}: there is no file {path}")
        if path.stat().st_size < layout.skip + layout.frame_bytes:
            raise DataError(
                f"{path}: not one frame of {layout.width}x{layout.height} fits into it; check width, height, bits"
            )
        self.info = CameraInfo(
            address=address,
            name=path.name,
            width=layout.width,
            height=layout.height,
            bits=layout.bits,
            live=False,
            clock="nominal",
            fps=fps,
            pixel_format="raw",
            white_level=layout.white,
            settings=(CameraSetting("fps", fps, LOWEST_FPS, HIGHEST_FPS, log=True),),
        )

    def __iter__(self) -> Iterator[Frame]:
        size = self._layout.frame_bytes
        with self._path.open("rb") as file:
            file.seek(self._layout.skip)
            index = 0
            while not self._stopped.is_set() and (content := file.read(size)):
                if len(content) < size:
                    text = f"{self._path}: the last frame is cut off and left out"
                    device_event(self._on_event, self.info.address, text)
                    return
                yield self._frame(content, index)
                index += 1

    def _frame(self, content: bytes, index: int) -> Frame:
        shape = (self._layout.height, self._layout.width)
        native = np.uint8 if self._layout.bits <= 8 else np.uint16
        image = np.frombuffer(content, self._layout.dtype).reshape(shape).astype(native)
        t = index / self._fps
        layout = self._layout
        return Frame(frozen(image), index, t, "nominal", 0, layout.bits, t, white_level=layout.white)


def open_raw(address: Address, on_event: EventSink) -> RawDump:
    """Open ``raw:FILE?width=&height=&bits=&fps=&skip=&white=``; raises ConfigError or DataError."""
    options = Options(address)
    layout = Layout(
        width=options.integer("width", 640, minimum=1),
        height=options.integer("height", 480, minimum=1),
        bits=options.integer("bits", 8, minimum=1, maximum=16),
        skip=options.integer("skip", 0, minimum=0),
        white=options.integer("white", minimum=1, maximum=65535),
    )
    fps = options.number("fps", 1.0, minimum=LOWEST_FPS, maximum=HIGHEST_FPS)
    options.done()
    return RawDump(address.text, Path(address.target), layout, fps, on_event)


def list_raw() -> list[CameraListing]:
    """The dumps in this folder; the library of a camera has a call that finds connected ones."""
    layout = Layout(640, 480, 8, 0)
    return [
        CameraListing(
            f"raw:{path}",
            "raw dump",
            trouble=""
            if path.stat().st_size % layout.frame_bytes == 0
            else "not 640x480 of 8 bits: give its width, height and bits",
            details=(f"{path.stat().st_size} bytes",),
        )
        for path in sorted(Path().glob("*.raw"))
        if path.stat().st_size
    ]


class CsvForces(_Source):
    """Forces from a table; see ``acquire.load_cell.LoadCell``."""

    def __init__(self, address: str, path: Path, on_event: EventSink) -> None:
        super().__init__()
        self._on_event, self._offset, self._last = on_event, 0.0, 0.0
        self._before: list[float] = []
        self._rows = _read(path)
        self.info = LoadCellInfo(address=address, name=path.name, protocol="csv", clock="nominal")

    def __iter__(self) -> Iterator[LoadSample]:
        for t, force, raw in self._rows:
            if self._stopped.is_set():
                return
            self._last = force
            yield LoadSample(t, force - self._offset, raw=raw.encode())

    def tare(self, *, force: bool = False) -> None:
        """Set the zero to the present force."""
        self._before.append(self._offset)
        self._move(self._last)

    def undo_tare(self) -> None:
        """Restore the zero before the last tare, if there was one."""
        if self._before:
            self._move(self._before.pop())

    def _move(self, offset: float) -> None:
        data = {"offset_N": offset, "step_N": offset - self._offset}
        self._offset, text = offset, f"zero is now at {offset:g} N"
        self._on_event(Event(time.monotonic(), EventKind.TARE, self.info.address, text, "info", data))


def _read(path: Path) -> list[tuple[float, float, str]]:
    try:
        with path.open(newline="", encoding="utf-8") as file:
            lines = list(csv.reader(file))[1:]
        rows = [(float(line[0]), float(line[1]), ",".join(line)) for line in lines if line]
    except (OSError, ValueError, IndexError, csv.Error) as error:
        raise DataError(f"{path}: not a table of time (s) and force (N): {error}") from error
    if any(later[0] < earlier[0] for earlier, later in itertools.pairwise(rows)):
        raise DataError(f"{path}: the times run backwards; sort the table")
    return rows


def open_csv(address: Address, on_event: EventSink) -> CsvForces:
    """Open ``csv:FILE``; raises ConfigError or DataError."""
    Options(address).done()
    return CsvForces(address.text, Path(address.target), on_event)
