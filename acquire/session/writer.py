"""Writing a session: HDF5 in SWMR mode, one chunk a frame, flushed at every frame.

A process that is killed loses no finished frame (docs/session-format.md has the figures).
Not thread-safe: one recorder thread owns the writer. What is not recorded is the caller's to
count; the writer never drops anything.
"""

from __future__ import annotations

import dataclasses
import logging
import math
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from acquire.clock import ClockPair
from acquire.closing import Closing
from acquire.errors import DataError
from acquire.events import Event
from acquire.frame import Burst, Frame
from acquire.hdf5 import GrowingDataset, Table, free_bytes, let_go, to_json
from acquire.load_sample import LoadSample
from acquire.session import layout
from acquire.session.bursts import BurstTable
from acquire.session.info import SessionInfo

log = logging.getLogger(__name__)

LOAD_HOLD_S = 0.02  # load samples are flushed no more often than this


class SessionWriter(Closing):
    """A new session file.

    Parameters
    ----------
    path : path
        Must not exist.
    info : SessionInfo
    checksum : bool
        Fletcher-32 on everything that grows.
    cut_already : bool
        Pictures and camera are those of ``info.mode.crop`` already (a copy of a session).

    Raises
    ------
    DataError
        The file exists already, or cannot be created.
    ConfigError
        The part of the picture leaves it.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        info: SessionInfo,
        *,
        checksum: bool = True,
        cut_already: bool = False,
    ) -> None:
        recorded = info if cut_already else info.cropped()
        self.path = Path(path)
        self._camera, self._start = recorded.camera, info.start.monotonic
        self._mode = dataclasses.replace(info.mode, crop=None) if cut_already else info.mode
        self._held: list[LoadSample] = []
        self._last_load_t = -math.inf  # of the last sample that was flushed for its own sake
        self._line_end = 0
        self._written_bytes = 0
        self._file: h5py.File | None = _create(self.path)
        try:
            with self._guarded() as file:
                layout.create(file, recorded, checksum)
                self._find_datasets(file["entry"])
                file.swmr_mode = True
            self.write_clock(info.start)
            self.flush()
        except BaseException:
            self._abandon()
            raise

    def _find_datasets(self, entry: h5py.Group) -> None:
        self._images = GrowingDataset(entry["frames/image"])
        self._frames = Table(entry["frames"], list(layout.FRAME_COLUMNS))
        self._load = Table(entry["load"], list(layout.LOAD_COLUMNS))
        self._lines = GrowingDataset(entry["load/lines"])
        self._events = GrowingDataset(entry["events"])
        self._clock = Table(entry["clock"], list(layout.CLOCK_COLUMNS))
        self._ledger: h5py.Dataset = entry["ledger"]
        self._bursts = BurstTable(entry["bursts"], self._mode)

    def write_frame(self, frame: Frame) -> int:
        """Append a frame, and the load samples held, and bring both to the file.

        Returns
        -------
        int
            The number of the frame in the session.

        Raises
        ------
        DataError
            The picture does not fit the camera's description, or the disk takes no more. All
            frames before stay readable.
        """
        image = self._fitting(frame)
        with self._guarded():
            self._images.append(image[np.newaxis])
            self._frames.append([_frame_row(frame, self._start)])
            self._written_bytes += image.nbytes
        self.flush()
        return self._frames.length - 1

    def _fitting(self, frame: Frame) -> np.ndarray[Any, Any]:
        expected = (self._camera.height, self._camera.width)
        image = self._mode.cut(frame.image)
        if image.shape != expected or image.dtype != self._images.dtype:
            raise DataError(
                f"{self.path}: frame {frame.index} is {image.shape} {image.dtype}, but the camera"
                f" {self._camera.name} was described as {expected} {self._images.dtype};"
                " start a new session for another picture format"
            )
        return image

    def write_burst(self, burst: Burst) -> int:
        """Append a burst as the exact sum of its frames; its number among the bursts.

        Raises
        ------
        DataError
            The disk takes no more.
        ValueError
            It has more frames than the session was made for.
        """
        with self._guarded():
            number = self._bursts.append(burst, self._start)
            self._written_bytes += self._bursts.row_bytes
        self.flush()
        return number

    def write_load(self, sample: LoadSample) -> None:
        """Append a load sample; it reaches the file at once, or where one just did, with the next flush.

        Call ``flush`` when nothing more comes for a while.
        """
        self._held.append(sample)
        if sample.t - self._last_load_t >= LOAD_HOLD_S:
            self._last_load_t = sample.t
            self.flush()

    def write_event(self, event: Event) -> None:
        """Append an event, of any length."""
        with self._guarded():
            self._events.append(layout.event_rows(event, self._start))

    def write_clock(self, pair: ClockPair) -> None:
        """Append a pair of clock readings (at the start, each minute and at the end)."""
        with self._guarded():
            self._clock.append([{"monotonic_s": pair.monotonic, "utc": pair.iso().encode()}])

    def write_ledger(self, ledger: Mapping[str, Any]) -> None:
        """Store the final counts."""
        text = to_json(ledger).encode()
        if len(text) > layout.LEDGER_BYTES:
            raise ValueError(f"a ledger of {len(text)} bytes; there is room for {layout.LEDGER_BYTES}")
        with self._guarded():
            self._ledger[0] = text

    def flush(self) -> None:
        """Bring everything to the file, so that it outlives a kill of this process."""
        with self._guarded() as file:
            self._write_held()
            file.flush()

    def _write_held(self) -> None:
        held, self._held = self._held, []
        if not held:
            return
        lines = b"".join(sample.raw + b"\n" for sample in held)
        self._lines.append(np.frombuffer(lines, np.uint8))
        self._load.append([self._load_row(sample) for sample in held])
        self._written_bytes += len(lines)

    def _load_row(self, sample: LoadSample) -> dict[str, Any]:
        self._line_end += len(sample.raw) + 1
        return {
            "time_s": sample.t - self._start,
            "monotonic_s": sample.t,
            "force": sample.force,
            "flags": sample.flags.value,
            "stable": layout.STABLE[sample.stable],
            "device_ms": np.nan if sample.device_ms is None else sample.device_ms,
            "unit": sample.unit.encode("ascii", "replace"),
            "line_end": self._line_end,
        }

    @property
    def bytes_written(self) -> int:
        """Bytes of pictures and lines so far."""
        return self._written_bytes

    def free_bytes(self) -> int:
        """Room left on the disk."""
        return free_bytes(self.path)

    def close(self) -> None:
        """Write what is held and close the file; may be called again without effect.

        Raises
        ------
        DataError
            The disk takes no more; what was complete before stays readable.
        """
        if self._file is None:
            return
        self.flush()
        with self._guarded() as file:
            self._file = None
            file.close()

    def _abandon(self) -> None:
        file, self._file = self._file, None
        if file is not None:
            let_go(file)

    @contextmanager
    def _guarded(self) -> Iterator[h5py.File]:
        if self._file is None:
            raise DataError(f"{self.path}: the session is closed; start a new one to record on")
        try:
            yield self._file
        except (OSError, RuntimeError) as error:
            # Datasets may now differ in length; going on would put rows beside the wrong frames.
            self._abandon()
            raise DataError(_write_failure(self.path, error)) from error


def _create(path: Path) -> h5py.File:
    try:
        return h5py.File(path, "x", libver=("v110", "v110"))
    except FileExistsError as error:
        raise DataError(f"{path} exists already and is not overwritten; choose another name") from error
    except OSError as error:
        if path.exists() and path.stat().st_size > 0:
            raise DataError(f"{path} exists already and is not overwritten; choose another name") from error
        raise DataError(
            f"{path} cannot be created ({_reason(error)}); choose a folder that exists and is writable"
        ) from error


def _frame_row(frame: Frame, start: float) -> dict[str, Any]:
    return {
        "time_s": frame.t - start,
        "monotonic_s": frame.t,
        "raw_monotonic_s": frame.raw_t,
        "index": frame.index,
        "lost_before": frame.lost_before,
        "damaged": frame.damaged,
        "clock": layout.CLOCKS.index(frame.clock),
    }


def _write_failure(path: Path, error: Exception) -> str:
    kept = "everything complete so far stays readable"
    try:
        free = free_bytes(path)
    except OSError:
        return f"{path}: its disk is gone ({_reason(error)}); check the disk and cable; {kept}"
    if free < 16 << 20:
        return f"{path}: disk full ({free} bytes free); free some space and start a new session; {kept}"
    return f"{path}: writing failed ({_reason(error)}); check the disk; {kept}"


def _reason(error: Exception) -> str:
    """HDF5's own words, shortened to the part a person can use."""
    text = " ".join(str(error).split())
    _, _, words = text.partition("error message = '")
    return words.partition("'")[0] or text[:200]
