"""Long recordings as a set of files: ``session.h5``, ``session.001.h5``, ``session.002.h5`` ...

Each file is whole in itself (camera, configuration, start); ``Session.open`` on any of them
opens the set as one.
"""

from __future__ import annotations

import dataclasses
import os
import re
import uuid
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from acquire.clock import ClockPair
from acquire.closing import Closing
from acquire.events import Event
from acquire.frame import Burst, Frame
from acquire.load_sample import LoadSample
from acquire.session.info import SessionInfo
from acquire.session.writer import SessionWriter

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
        """Of all files."""
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
        following = SessionWriter(part_path(self._first, self._info.part), self._info)
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

    def write_ledger(self, ledger: Mapping[str, Any]) -> None:
        """See ``SessionWriter``; it stands in the last file."""
        self._writer.write_ledger(ledger)

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
