"""Writing a session: HDF5 in SWMR mode, one chunk a frame, flushed twenty times a second.

A process that is killed loses at most what was written in its last ``FLUSH_S``, a power cut what came in the last
second or so (docs/session-format.md has the figures). Not thread-safe: one recorder thread owns the writer. What
is not recorded is the caller's to count; the writer never drops anything.
"""

from __future__ import annotations

import dataclasses
import logging
import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from acquire.clock import Clock, ClockPair
from acquire.errors import DataError
from acquire.events import Event
from acquire.frame import Burst, Frame
from acquire.hdf5 import (
    DiskSync,
    FileWatch,
    FlushTimer,
    GrowingDataset,
    PictureStack,
    RowTable,
    abandon_file,
    create_file,
    free_bytes,
    reason,
    to_json,
)
from acquire.load_sample import LoadSample
from acquire.opening import Closing
from acquire.session import layout
from acquire.session.layout import SessionInfo
from acquire.session.rows import BurstTable
from acquire.text import Message

log = logging.getLogger(__name__)

FLUSH_S = 0.05  # what was written is flushed no later and no more often than this


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
    now : callable
        Gives seconds; paces the flushes.

    Attributes
    ----------
    unflushed_frames : int
        Frames, those of bursts among them, that were taken and are not flushed yet; after a failure, those
        that are lost by it.
    is_gone : bool
        Somebody else has removed, cut or renamed the file.

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
        now: Clock = time.monotonic,
    ) -> None:
        recorded = info if cut_already else info.cropped()
        self.path = Path(path)
        self._camera, self._start = recorded.camera, info.start.monotonic
        self._mode = dataclasses.replace(info.mode, crop=None) if cut_already else info.mode
        self._pace = FlushTimer(FLUSH_S, now)
        self._held_lines: list[bytes] = []
        self._held_events: list[np.ndarray[Any, Any]] = []
        self._line_end = 0
        self.unflushed_frames = 0
        self._written_bytes, self._taken, self.is_gone = 0, 0, False
        self._file: h5py.File | None = _create(
            self.path, lambda file: layout.create(file, recorded, checksum)
        )
        self._to_disk = DiskSync(self.path)
        self._watch = FileWatch(self.path)
        try:
            with self._guarded() as file:
                self._find_datasets(file["entry"])
            self.write_clock(info.start)
            self.flush()
        except BaseException:
            self._abandon()
            raise

    def _find_datasets(self, entry: h5py.Group) -> None:
        self._images = PictureStack(entry["frames/image"])
        self._frames = RowTable(entry["frames"], list(layout.FRAME_COLUMNS))
        self._load = RowTable(entry["load"], list(layout.LOAD_COLUMNS))
        self._lines = GrowingDataset(entry["load/lines"])
        self._events = GrowingDataset(entry["events"])
        self._clock = RowTable(entry["clock"], list(layout.CLOCK_COLUMNS))
        self._frame_counts: h5py.Dataset = entry["ledger"]
        self._bursts = BurstTable(entry["bursts"], self._mode)

    def write_frame(self, frame: Frame) -> int:
        """Append a frame.

        Returns
        -------
        int
            The number of the frame in the session.

        Raises
        ------
        DataError
            The picture does not fit the camera's description, or the disk takes no more. All
            frames that were flushed before stay readable.
        OverflowError
            Its index or its count of lost frames is beyond sense.
        """
        image, row = self._fitting(frame), self._frames.row(_frame_row(frame, self._start))
        with self._guarded(keep_rows=True):
            self._images.append(image)
        self._frames.hold(row)
        self._written(image.nbytes, frames=1)
        return self._frames.length - 1

    def _fitting(self, frame: Frame) -> np.ndarray[Any, Any]:
        expected = (self._camera.height, self._camera.width)
        image = self._mode.cut(frame.image)
        if image.shape != expected or image.dtype != self._images.dtype:
            raise DataError(
                "{path}: frame {index} is {shape} {dtype}, but the camera {name} was described as {expected} "
                "{dtype2}; start a new session for another picture format",
                self.path,
                frame.index,
                image.shape,
                image.dtype,
                self._camera.name,
                expected,
                self._images.dtype,
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
        with self._guarded(keep_rows=True):
            number = self._bursts.append(burst, self._start)
        self._written(self._bursts.row_bytes, frames=burst.n)
        return number

    def write_load(self, sample: LoadSample) -> None:
        """Append a load sample; raises as ``write_frame``."""
        self._line_end += len(sample.raw) + 1
        self._held_lines.append(sample.raw + b"\n")
        self._load.hold(self._load.row(_load_row(sample, self._start, self._line_end)))
        self._written(len(sample.raw) + 1)

    def write_event(self, event: Event) -> None:
        """Append an event, of any length; raises as ``write_frame``."""
        self._held_events.append(layout.event_rows(event, self._start))
        self._written(0)

    def write_clock(self, pair: ClockPair) -> None:
        """Append a pair of clock readings (at the start, each minute and at the end)."""
        self._clock.hold(self._clock.row({"monotonic_s": pair.monotonic, "utc": pair.iso().encode()}))
        self._written(0)

    def write_ledger(self, frame_counts: Mapping[str, Any]) -> None:
        """Store the final counts."""
        text = to_json(frame_counts).encode()
        if len(text) > layout.LEDGER_BYTES:
            raise ValueError(f"a ledger of {len(text)} bytes; at most {layout.LEDGER_BYTES} fit")
        with self._guarded():
            self._frame_counts[0] = text
        self._written(0)

    def _written(self, size: int, frames: int = 0) -> None:
        self._open_file()
        self._written_bytes += size
        self.unflushed_frames += frames
        self._taken += frames
        self._pace.wrote()
        try:
            self.flush_when_due()
        except DataError:
            self.unflushed_frames -= frames  # refused, not lost
            raise

    def flush_when_due(self) -> float:
        """Flush where something has waited for ``FLUSH_S``; every write does that too.

        Returns
        -------
        float, s
            Time after which this must be called again if nothing is written until then; infinite
            where nothing waits.
        """
        if self._pace.left_s() == 0:
            self.flush()
        return self._pace.left_s()

    def flush(self) -> None:
        """Bring everything to the file now, so that it outlives a kill of this process."""
        with self._guarded() as file:
            self._bring(file)

    def _bring(self, file: h5py.File) -> None:
        if self._to_disk.failure is not None:
            raise self._to_disk.failure
        self._pace.began()
        for table in (self._frames, self._load, self._clock):
            table.write()
        self._bursts.write_rows()
        if self._held_lines:
            self._lines.append(np.frombuffer(b"".join(self._held_lines), np.uint8))
        if self._held_events:
            self._events.append(np.concatenate(self._held_events))
        self._held_lines, self._held_events = [], []
        file.flush()
        self._pace.done()
        self.unflushed_frames = 0

    @property
    def bytes_written(self) -> int:
        """Bytes of pictures and lines so far."""
        return self._written_bytes

    def free_bytes(self) -> int:
        """Room left on the disk."""
        return free_bytes(self.path)

    @property
    def folder(self) -> Path:
        """Where the file is now."""
        return self._watch.path.parent

    def close(self) -> None:
        """Write what is held and close the file; idempotent.

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
            self._to_disk.close()
            self._watch.close()
            if self._to_disk.failure is not None:
                raise self._to_disk.failure

    def _abandon(self) -> None:
        file, self._file = self._file, None
        if file is not None:
            abandon_file(file)
            self._watch.close()
        self._to_disk.close()

    def _open_file(self) -> h5py.File:
        if self._file is None:
            raise DataError("{path}: the session is closed; start a new one to record on", self.path)
        return self._file

    @contextmanager
    def _guarded(self, *, keep_rows: bool = False) -> Iterator[h5py.File]:
        file = self._open_file()
        try:
            self._watch_file()
            yield file
            if self._file is not None:
                self._watch.wrote()
        except (OSError, RuntimeError) as error:
            if (
                keep_rows and not self.is_gone
            ):  # a disk that is full for a picture may still take the rows before it
                with suppress(OSError, RuntimeError):
                    self._bring(file)
            # Datasets may now differ in length; going on would put rows beside the wrong frames.
            self._abandon()
            words = Message(
                "{path}: {reason}; start a new test, and keep other programs from its folder",
                self.path,
                reason(error),
            )
            raise DataError(words if self.is_gone else _write_failure(self.path, error)) from error

    def _watch_file(self) -> None:
        """Raise OSError where somebody else has removed, cut or renamed the file; a renamed one has its frames."""
        try:
            self._watch.check()
        except OSError as error:
            self.is_gone = True
            if not isinstance(error, FileNotFoundError):
                self.unflushed_frames = self._taken
            raise


def _create(path: Path, declare: Callable[[h5py.File], object]) -> h5py.File:
    try:
        return create_file(path, declare)
    except FileExistsError as error:
        raise DataError("{path} exists already and is not overwritten; choose another name", path) from error
    except OSError as error:
        raise DataError(
            "{path} cannot be created ({reason}); choose a folder that exists, is writable and has room",
            path,
            reason(error),
        ) from error


def _load_row(sample: LoadSample, start: float, line_end: int) -> dict[str, Any]:
    return {
        "time_s": sample.t - start,
        "monotonic_s": sample.t,
        "force": sample.force,
        "flags": sample.flags.value,
        "stable": layout.STABLE[sample.stable],
        "device_ms": np.nan if sample.device_ms is None else sample.device_ms,
        "unit": sample.unit.encode("ascii", "replace"),
        "line_end": line_end,
    }


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
    kept = Message("everything complete so far stays readable")
    try:
        free = free_bytes(path)
    except OSError:
        return Message(
            "{path}: its disk is gone ({reason}); check the disk and cable; {kept}", path, reason(error), kept
        )
    if free < 16 << 20:
        return Message(
            "{path}: disk full ({free} bytes free); free some space and start a new session; {kept}",
            path,
            free,
            kept,
        )
    return Message("{path}: writing failed ({reason}); check the disk; {kept}", path, reason(error), kept)
