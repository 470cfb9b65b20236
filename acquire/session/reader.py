"""Reading a recorded test, and the set of files of a long one.

A long recording is a set: ``session.h5``, ``session.001.h5``, ``session.002.h5`` ... Each file is whole in itself
(camera, configuration, start); ``Session.open`` on any of them opens the set as one, ``RotatingWriter`` writes it.
docs/session-format.md describes the file for other programs. Results of measurements are never stored here: they
are another file that can be made again.
"""

from __future__ import annotations

import dataclasses
import math
import os
import re
import uuid
from bisect import bisect_right
from collections.abc import Iterator, Mapping
from datetime import datetime
from itertools import accumulate
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from acquire.addresses import session_file
from acquire.clock import ClockPair
from acquire.errors import DataError
from acquire.events import Event
from acquire.frame import Burst, CameraInfo, Frame
from acquire.load_sample import LoadCellInfo, LoadSample
from acquire.opening import Closing
from acquire.record_mode import RecordMode
from acquire.session.layout import SessionInfo
from acquire.session.part import SessionPart
from acquire.session.writer import SessionWriter
from acquire.text import Message, about, word

_NUMBERED = re.compile(r"^(?P<stem>.+)\.(?P<number>\d{3,})$")


def part_path(first: Path, part: int) -> Path:
    """The file of a part; part 0 is ``first``."""
    return first if part == 0 else first.with_name(f"{first.stem}.{part:03d}{first.suffix}")


def first_path(any_part: Path) -> Path:
    """The first file of the set that ``any_part`` belongs to by its name."""
    found = _NUMBERED.match(any_part.stem)
    return any_part.with_name(found["stem"] + any_part.suffix) if found else any_part


class RotatingWriter(Closing):
    """Writes as ``SessionWriter`` does, and goes on in a new file after every ``rotate_bytes``.

    Parameters
    ----------
    path : path
        Of the first file.
    info : SessionInfo
        ``set_id`` and ``part`` are given here.
    rotate_bytes : int, bytes

    Raises
    ------
    DataError
        As ``SessionWriter``, also from any write that begins a new file.
    """

    def __init__(self, path: str | os.PathLike[str], info: SessionInfo, rotate_bytes: int) -> None:
        self._first, self._limit = Path(path), rotate_bytes
        self._info = dataclasses.replace(info, set_id=uuid.uuid4().hex, part=0)
        self._frames = self._bursts = self._finished_bytes = 0
        self._writer = SessionWriter(self._first, self._info)

    @property
    def path(self) -> Path:
        """The file written now."""
        return self._writer.path

    @property
    def bytes_written(self) -> int:
        """Bytes written to all files."""
        return self._finished_bytes + self._writer.bytes_written

    def free_bytes(self) -> int:
        """Room left on the disk."""
        return self._writer.free_bytes()

    def write_frame(self, frame: Frame) -> int:
        """See ``SessionWriter``; the number counts through all files."""
        self._rotate_when_full()
        self._writer.write_frame(frame)
        self._frames += 1
        return self._frames - 1

    def write_burst(self, burst: Burst) -> int:
        """See ``SessionWriter``; the number counts through all files."""
        self._rotate_when_full()
        self._writer.write_burst(burst)
        self._bursts += 1
        return self._bursts - 1

    def _rotate_when_full(self) -> None:
        if self._writer.bytes_written < self._limit:
            return
        self._info = dataclasses.replace(self._info, part=self._info.part + 1)
        first = self._writer.folder / self._first.name
        following = SessionWriter(part_path(first, self._info.part), self._info)
        self._finished_bytes += self._writer.bytes_written
        full, self._writer = self._writer, following
        full.close()

    def write_load(self, sample: LoadSample) -> None:
        """See ``SessionWriter``."""
        self._writer.write_load(sample)

    def write_event(self, event: Event) -> None:
        """See ``SessionWriter``."""
        self._writer.write_event(event)

    def write_clock(self, pair: ClockPair) -> None:
        """See ``SessionWriter``."""
        self._writer.write_clock(pair)

    def write_ledger(self, frame_counts: Mapping[str, Any]) -> None:
        """See ``SessionWriter``; it stands in the last file."""
        self._writer.write_ledger(frame_counts)

    def flush_when_due(self) -> float:
        """See ``SessionWriter``."""
        return self._writer.flush_when_due()

    def flush(self) -> None:
        """See ``SessionWriter``."""
        self._writer.flush()

    @property
    def unflushed_frames(self) -> int:
        """See ``SessionWriter``."""
        return self._writer.unflushed_frames

    def close(self) -> None:
        """See ``SessionWriter``."""
        self._writer.close()


class Session(Closing):
    """A recorded session, open for reading; a context manager. A rotated set of files is one session.

    Attributes
    ----------
    path : Path
    recovered : str or None
        Says so where a file was not closed by its writer, one of a set is missing, or what it holds is odd.
    camera : CameraInfo
        Of the pictures as they are recorded: with ``mode.crop``, that part of the camera's.
    load_cell : LoadCellInfo or None
    config, metadata, versions : dict
    mode : RecordMode
        Of mode "bursts" it is ``bursts`` that hold the pictures, not ``frames``.
    start_utc : datetime
    start_monotonic : float, s
    """

    def __init__(self, parts: list[SessionPart], missing: str | None = None) -> None:
        self._parts = parts
        first = parts[0]
        self.path: Path = first.path
        words = [Message("{path} {recovered}", part.path, part.recovered) for part in parts if part.recovered]
        words += [about(part.path, trouble) for part in parts for trouble in part.troubles]
        self.recovered: str | None = "; ".join([*words, missing] if missing else words) or None
        self.camera: CameraInfo = first.camera
        self.load_cell: LoadCellInfo | None = first.load_cell
        self.config: dict[str, Any] = first.config
        self.metadata: dict[str, Any] = first.metadata
        self.versions: dict[str, Any] = first.versions
        self.mode: RecordMode = first.mode
        self.start_utc: datetime = first.start.utc
        self.start_monotonic: float = first.start.monotonic

    @classmethod
    def open(cls, path: str | os.PathLike[str]) -> Self:
        """Open a session file (or the folder of a run that has one), or the whole set that it belongs to.

        Raises
        ------
        DataError
            Not there, not a session, newer than this program, or damaged; says what to do.
        """
        part = SessionPart(session_file(Path(path)))
        if not part.set_id:
            return cls([part])
        parts, missing = _whole_set(part)
        return cls(parts, missing)

    def __len__(self) -> int:
        """Frames recorded."""
        return sum(len(part) for part in self._parts)

    @property
    def indices(self) -> NDArray[np.int64]:
        """Sequence numbers of the frames, (N,)."""
        return self.frame_column("index")

    @property
    def times(self) -> NDArray[np.float64]:
        """Times of the frames, (N,) monotonic s."""
        return self.frame_column("monotonic_s")

    def frame_column(self, name: str) -> NDArray[Any]:
        """A column of the table of frames (``layout.FRAME_COLUMNS``), (N,); no picture is read."""
        return np.concatenate([part.columns[name] for part in self._parts])

    def burst_column(self, name: str) -> NDArray[Any]:
        """A column of the table of bursts (``layout.BURST_COLUMNS``), (burst_count,)."""
        return np.concatenate([part.bursts[name] for part in self._parts])

    def frame(self, number: int) -> Frame:
        """The frame recorded as ``number``, 0 .. len - 1.

        Raises
        ------
        DataError
            There is no such frame, or its bytes are damaged.
        """
        part, row = self._locate([len(part) for part in self._parts], number, "frame")
        return part.frame(row)

    def frames(self, start: int | None = None, stop: int | None = None) -> Iterator[Frame]:
        """The frames from number ``start`` up to, not including, ``stop``, one by one."""
        for number in range(*slice(start, stop).indices(len(self))):
            yield self.frame(number)

    @property
    def burst_count(self) -> int:
        """Bursts recorded as such (mode "bursts")."""
        return sum(len(part.bursts["n"]) for part in self._parts)

    def burst(self, number: int) -> Burst:
        """The burst recorded as ``number``; raises as ``frame``."""
        part, row = self._locate([len(part.bursts["n"]) for part in self._parts], number, "burst")
        return part.burst(row)

    def bursts(self) -> Iterator[Burst]:
        """The bursts that were recorded as such, one by one, bit-equal to what was measured."""
        for number in range(self.burst_count):
            yield self.burst(number)

    def _locate(self, lengths: list[int], number: int, what: str) -> tuple[SessionPart, int]:
        if not 0 <= number < sum(lengths):
            raise DataError(
                "{path}: no {what} {number}; there are {sum}, from 0",
                self.path,
                word(what),
                number,
                sum(lengths),
            )
        starts = [0, *accumulate(lengths)]
        at = bisect_right(starts, number) - 1
        return self._parts[at], number - starts[at]

    def load_samples(self) -> list[LoadSample]:
        """All load samples, with their raw lines; 280 bytes of memory each."""
        return list(self.each_load_sample())

    def each_load_sample(self, low: float = -math.inf, high: float = math.inf) -> Iterator[LoadSample]:
        """The load samples from ``low`` to ``high`` (monotonic s), one by one, read by the piece."""
        for part in self._parts:
            for piece in part.load_pieces(low, high):
                yield from piece.samples()

    def load_curve(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times (N,) in monotonic s and forces (N,) in N of all load samples."""
        times, forces = zip((np.empty(0), np.empty(0)), *self.load_curves(), strict=True)
        return np.concatenate(times), np.concatenate(forces)

    def load_curves(self) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """The same by the piece: a day at 1 kHz is larger than memory."""
        for part in self._parts:
            yield from part.load_curves()

    def events(self) -> list[Event]:
        """All events."""
        return [event for part in self._parts for event in part.events()]

    @property
    def frame_counts(self) -> dict[str, Any] | None:
        """The final counts; None where the run did not come to its end."""
        return self._parts[-1].frame_counts()

    @property
    def clock_pairs(self) -> list[ClockPair]:
        """The pairs of monotonic and UTC readings."""
        pairs = [pair for part in self._parts for pair in part.clock_pairs()]
        return list(dict.fromkeys(pairs))

    def refresh(self) -> None:
        """Look for what a writer still at work has added to the files that are open."""
        for part in self._parts:
            part.refresh()

    def close(self) -> None:
        """Close the files; idempotent."""
        for part in self._parts:
            part.close()


def _whole_set(opened: SessionPart) -> tuple[list[SessionPart], str | None]:
    """All parts of the set in order, and a sentence on those that are missing."""
    first = first_path(opened.path)
    parts: list[SessionPart] = []
    missing: list[str] = []
    for path in [part_path(first, number) for number in range(_last_part(first) + 1)]:
        if path == opened.path:
            parts.append(opened)
        elif (part := _same_set(path, opened.set_id)) is not None:
            parts.append(part)
        else:
            missing.append(path.name)
    if not missing:
        return parts, None
    return parts, Message("files of this session are missing or unreadable: {listed}", ", ".join(missing))


def _last_part(first: Path) -> int:
    numbers = [path.stem.rpartition(".")[2] for path in first.parent.glob(f"{first.stem}.*{first.suffix}")]
    return max((int(number) for number in numbers if number.isdecimal()), default=0)


def _same_set(path: Path, set_id: str) -> SessionPart | None:
    try:
        part = SessionPart(path)
    except DataError:
        return None
    if part.set_id == set_id:
        return part
    part.close()
    return None
