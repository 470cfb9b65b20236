"""Copying what can be read of a session into a clean file: after a kill, a full disk, a bad sector."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypeVar

from acquire.addresses import session_file
from acquire.clock import ClockPair
from acquire.errors import DataError
from acquire.events import Event, EventKind, Level
from acquire.session.layout import SessionInfo
from acquire.session.part import SessionPart
from acquire.session.writer import SessionWriter
from acquire.text import Message, counts
from acquire.text.message import counted

Item = TypeVar("Item")


@dataclass(frozen=True, slots=True)
class Recovered:
    """What ``recover`` saved.

    Attributes
    ----------
    path : Path
        The clean copy.
    frames, bursts, load_samples, events : int
        Copied.
    unreadable : tuple of str
        What could not be read, a sentence each.
    """

    path: Path
    frames: int
    bursts: int
    load_samples: int
    events: int
    unreadable: tuple[str, ...]

    def line(self) -> str:
        """One line for a person."""
        saved = Message(
            "{path}: {frames} frames, {bursts} bursts, {load_samples} load samples, {events} events",
            self.path,
            *counts(self.frames, self.bursts, self.load_samples, self.events),
        )
        if not self.unreadable:
            return saved
        return saved + Message("; {what} could not be read", counted(len(self.unreadable), "part"))


def recover(source: str | os.PathLike[str], target: str | os.PathLike[str] | None = None) -> Recovered:
    """Copy all that can be read of one session file into a new one; the old one is not touched.

    Parameters
    ----------
    source : path
        A session file, or the folder of a run that has one.
    target : path or None
        None: beside the source, ``session.recovered.h5``.

    Returns
    -------
    Recovered

    Raises
    ------
    DataError
        Nothing can be read, or the target exists or cannot be written.
    """
    path = session_file(Path(source))
    clean = Path(target) if target else path.with_name(f"{path.stem}.recovered{path.suffix}")
    with SessionPart(path, salvage=True) as part, _writer(clean, part) as writer:
        return _copy(part, writer)


def _writer(path: Path, part: SessionPart) -> SessionWriter:
    info = SessionInfo(
        camera=part.camera,
        load=part.load_cell,
        start=part.start,
        config=part.config,
        metadata=part.metadata,
        versions=part.versions,
        mode=part.mode,
        set_id=part.set_id,
        part=part.part,
    )
    return SessionWriter(path, info, cut_already=True)


def _copy(part: SessionPart, writer: SessionWriter) -> Recovered:
    unreadable = list(part.troubles)
    frames = _copy_frames(part, writer, unreadable)
    bursts = 0
    for number in range(len(part.bursts["n"])):
        burst = _try(partial(part.burst, number), unreadable)
        bursts += burst is not None and writer.write_burst(burst) >= 0
    samples = 0
    try:
        for piece in part.load_pieces():
            for sample in piece.samples():
                writer.write_load(sample)
                samples += 1
    except DataError as error:
        unreadable.append(str(error))
    events = _try(part.events, unreadable) or []
    for event in events:
        writer.write_event(event)
    for pair in _try(part.clock_pairs, unreadable) or []:
        if pair != part.start:
            writer.write_clock(pair)
    frame_counts = _try(part.frame_counts, unreadable)
    if frame_counts is not None:
        writer.write_ledger(frame_counts)
    done = Recovered(writer.path, frames, bursts, samples, len(events), tuple(unreadable))
    text = f"copied from {part.path.name}: {done.line()}"
    level: Level = "warning" if done.unreadable else "info"
    data = {"unreadable": list(done.unreadable[:20]), "frames": done.frames}
    writer.write_event(Event(ClockPair.now().monotonic, EventKind.RECORDER, "recover", text, level, data))
    return done


def _copy_frames(part: SessionPart, writer: SessionWriter, unreadable: list[str]) -> int:
    copied = skipped = 0
    lost: list[str] = []
    for number in range(len(part)):
        frame = _try(partial(part.frame, number), lost)
        if frame is None:
            skipped += 1
            continue
        writer.write_frame(dataclasses.replace(frame, lost_before=frame.lost_before + skipped))
        copied, skipped = copied + 1, 0
    if lost:
        unreadable.append(
            Message("{n} of {all} frames cannot be read, the first: {why}", len(lost), len(part), lost[0])
        )
    return copied


def _try(read: Callable[[], Item], unreadable: list[str]) -> Item | None:
    try:
        return read()
    except DataError as error:
        unreadable.append(error.text)
        return None
