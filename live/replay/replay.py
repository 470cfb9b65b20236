"""Replay: a recorded session, or any folder of pictures, through the measuring path of a live run.

``replay`` measures every burst; ``--as-measured`` measures the bursts that the live run measured,
with the references it took, and is then bit-equal to it on the same machine.
"""

from __future__ import annotations

import datetime
import itertools
import math
import threading
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from acquire.addresses import parse_address
from acquire.camera import with_scheme
from acquire.errors import EXIT_INTERRUPTED, LOSS, ConfigError, DataError
from acquire.events import Event, EventKind, EventSink
from acquire.frame import Burst, Frame
from acquire.hdf5 import FolderWatch
from acquire.load_sample import LoadSample
from acquire.opencv.images import picture_times
from acquire.text import Amount, Message, about, counts, joined
from acquire.text.message import counted
from analysis.compiled.interruption import abandoned_when
from live.config.effect import without_forces
from live.config.loading import Config, load_config
from live.config.values import AUTO
from live.pipeline.consumer import Compose, RunInfo, Screen
from live.pipeline.event_log import EventLog
from live.pipeline.history import History
from live.pipeline.measurement import Measurement
from live.pipeline.run_state import FrameCounts, RunState
from live.pipeline.timed.force_watch import with_force_watch
from live.replay.forces import read_forces
from live.replay.opening import open_session_source, prepare_replay, session_path
from live.replay.parts import StoredResults
from live.replay.pictures import picture_of, picture_source, with_reference, write_names
from live.replay.source import (
    PictureCount,
    ReplayRequest,
    ReplaySource,
    Work,
    check_window,
    prefetch,
    until_stopped,
)
from live.results.finished.figures_file import finished
from live.results.finished.finished_test import FinishedTest
from live.results.folder import LOG, BurstFailures, check_folder, make_folder
from live.results.place_response import check_channel
from live.results.writer import write_results
from live.setup.pictures import camera_of, with_film, with_mask
from live.setup.region import is_auto_region
from live.stream.adapted import Outputs
from live.stream.stream import StateKeeper, Stream

_MOST_TOLD = 5  # pictures that were left out, in the summary


@dataclass(frozen=True, slots=True, eq=False)
class Replayed:
    """The result of a replay.

    Attributes
    ----------
    folder : Path
    run_state : RunState
    config : Config
    exit_code : int
    lines : tuple of str
        A summary for a person: pictures that were left out, speed, the kernel's share of the time.
    test : FinishedTest
    left_out : int
        Pictures that could not be read or are not like the first.
    """

    folder: Path
    run_state: RunState
    config: Config
    exit_code: int
    test: FinishedTest
    lines: tuple[str, ...] = ()
    left_out: int = 0


def replay(
    request: ReplayRequest, screen: Screen, stopping: threading.Event, consumers: Compose = write_results
) -> Replayed:
    """Replay ``request.source`` into ``consumers``; setting ``stopping`` ends it early but cleanly.

    Raises
    ------
    ConfigError, DataError
        As for a run; also where --as-measured finds frames missing.
    """
    path = session_path(request.source)
    check_window(request)
    if path is None:
        return _replay_pictures(request, screen, stopping, consumers)
    with open_session_source(path, request, screen) as (found, config):
        source = _with_forces(found, request, config, screen)
        return _run(source, config, request, screen, stopping, EventLog(), consumers)


# -- pictures -----------------------------------------------------------------------------------


def _replay_pictures(
    request: ReplayRequest, screen: Screen, stopping: threading.Event, consumers: Compose
) -> Replayed:
    if request.as_measured:
        raise ConfigError("{source}: --as-measured needs a session; pictures have none", request.source)
    request = with_reference(request)
    config = load_config(request.config_file, {"camera.address": request.source, **request.overrides})
    region = AUTO if is_auto_region(config) else config.measure.roi
    config = replace(
        config, load=replace(config.load, address="none:"), measure=replace(config.measure, roi=region)
    )
    event_log = EventLog()
    into = _in_test_time(event_log)
    with camera_of(config.camera.address, into, crop=config.camera.crop, resting=False) as camera, camera:
        found = picture_source(camera, request, config)
        screen.print(found.words)
        for warning in camera.info.warnings:
            screen.print(Message("warning: {what}", warning))
        source = _with_forces(found, request, config, screen)
        return _run(source, config, request, screen, stopping, event_log, consumers)


def _with_forces(
    source: ReplaySource, request: ReplayRequest, config: Config, screen: Screen
) -> ReplaySource:
    """The same source with the forces of the given file, after a line on what was taken from it."""
    if request.forces is None:
        for note in () if len(source.loads) else without_forces(request.overrides):
            screen.print(note)
        return source
    table = read_forces(request.forces, config.load)
    named = table.export.times is None
    pictures = _picture_times(request.source, named=named)
    placed = table.placed(pictures, source.start, recorded=source.count is None)
    times = source.times if pictures is None else np.array([*pictures.values()])
    placed = placed.at_pictures(str(request.forces), config.load, times)
    assumed = [] if named else _assumed_times(request.source)
    screen.print(joined("; ", (about(request.forces.name, table.export.taken), *placed.remarks, *assumed)))
    return replace(source, samples=placed.samples(), loads=placed.log(config.load), doubts=placed.doubts)


def _picture_times(source: str, *, named: bool) -> dict[str, float] | None:
    """Times of pictures by name; None where the source has none, or where they are pages and not ``named``."""
    address = parse_address(with_scheme(source))
    if address.scheme != "files":
        return None
    try:
        return picture_times(address)
    except ConfigError:
        if named:
            raise
        return None


def _assumed_times(source: str) -> list[str]:
    """A remark where the pictures have no times that those of the forces could fit."""
    address = parse_address(with_scheme(source))
    if address.scheme != "files" or {"fps", "stamps"} & dict(address.settings).keys():
        return []
    words = Message(
        "the pictures have no times and are taken as 1 s apart; if they are not, give fps= or stamps=, as in "
        "{example}",
        f"'files:{address.target}?fps=2'",
    )
    return [words]


def _in_test_time(event_log: EventLog) -> EventSink:
    """A sink that stamps events of pictures with the time of the picture, which is in their data."""

    def record(event: Event) -> None:
        event_log.record(replace(event, t=float(event.data.get("t", 0.0))))

    return record


# -- the run ------------------------------------------------------------------------------------


def _run(
    source: ReplaySource,
    config: Config,
    request: ReplayRequest,
    screen: Screen,
    stopping: threading.Event,
    event_log: EventLog,
    consumers: Compose,
) -> Replayed:
    check_folder(config.output.dir)
    config = with_film(config, source.camera)
    with abandoned_when(stopping.is_set):
        ready = prepare_replay(source, config, request.source, screen, stopping)
    if stopping.is_set():
        raise KeyboardInterrupt
    stored, with_load = StoredResults.of(request.parts, ready), len(source.loads) > 0
    bursts = _not_empty(stored.bursts() if stored else source.bursts, request, source.count)
    check_channel(ready.plan.config, forces=with_load)
    folder = make_folder(ready.plan.config.output.dir, datetime.datetime.now(datetime.UTC))
    config = _with_final_folder(with_mask(ready.plan.config, ready.plan.mask, folder), request.final_folder)
    history = History(config.specimen.axis)
    run_state = RunState(
        event_log, FrameCounts(), source.loads, history, specimen=config.specimen, with_load=with_load
    )
    write_names(request.source, folder / "pictures.csv")
    screen.print(Message("replaying {source} into {folder}", request.source, request.final_folder or folder))
    deferred = request.final_folder is not None
    about = RunInfo(config, folder, source.camera, ready.plan.grid, source.start, deferred=deferred)
    made = with_force_watch(consumers(about, run_state), run_state)
    stream = Stream()
    stream.add(StateKeeper(run_state, ""))
    outputs = Outputs(made, run_state.loads, event_log, stream)
    event_log.add_listener(stream.publish)
    failures, held = BurstFailures(run_state, folder), FolderWatch(folder)
    run = _Run(source, request, screen, stopping, run_state, outputs, failures)
    work = prefetch(bursts)
    measured = (stored or ready).measurements(
        _counted(work, run_state.frame_counts), source.loads, event_log, failures
    )
    try:
        took = run.measure(measured, stream)
    finally:
        work.close()
        run_state.health.ended = True
        outputs.end()
        folder = held.end()
    return run.replayed(config, folder, took)


@dataclass(frozen=True, slots=True, eq=False)
class _Run:
    """A replay that goes on, and what there is to say of it at its end."""

    source: ReplaySource
    request: ReplayRequest
    screen: Screen
    stopping: threading.Event
    run_state: RunState
    outputs: Outputs
    failures: BurstFailures

    def measure(self, measured: Iterable[Measurement], stream: Stream) -> float:
        """Publish what was recorded and all that is measured; returns the time that it took, s."""
        began = time.perf_counter()
        # Publish the recorded events and load samples.
        for event in self.source.events:
            if event.kind is not EventKind.MEASURED:
                stream.publish(event)
        for sample in self.source.samples if stream.wants(LoadSample) else ():
            stream.publish(sample)
        for m in until_stopped(measured, self.stopping):
            self.run_state.frame_counts.add(measured=m.burst.n)
            if stream.wants(Frame):
                stream.publish(picture_of(m.burst))
            stream.publish(m)
            self.screen.progress(m.time_step, m.number + 1, self.source.expected, time.perf_counter() - began)
            del m  # frees its pictures before the next burst is measured
        done = len(self.run_state.history.time_steps)
        if self.stopping.is_set() and done != self.source.expected:
            text = Message("interrupted after {bursts}; the others are not measured", counted(done, "burst"))
            self.run_state.event_log.emit(EventKind.STOP, "phasedic", text, "warning")
        return time.perf_counter() - began

    def replayed(self, config: Config, folder: Path, took: float) -> Replayed:
        """The result, once the files in ``folder`` are closed."""
        source, code, lines = self.source, self.exit_code(), self.lines(took, folder)
        at_reference = math.nan if self.request.reference else source.loads.force_at(source.reference.t)
        test = finished(folder, config, self.run_state, code, at_reference, source.start.monotonic, lines)
        left_out = source.count.left_out if source.count else 0
        return Replayed(folder, self.run_state, config, code, test, tuple(lines), left_out)

    def lines(self, took: float, folder: Path) -> list[str]:
        """What there is to say at the end: what failed and what was lost first, then counts and speed."""
        source, chunks = self.source, len(self.request.parts)
        failed = Message(
            "{bursts} could not be measured; {log} has the details",
            counted(self.failures.count, "burst"),
            folder / LOG,
        )
        stopped = [
            Message("{name} stopped: {why}", one.name, one.failed)
            for one in self.outputs.reports
            if one.failed
        ]
        speed = (
            Message("joined of {chunks} chunks", chunks)
            if chunks
            else speed_line(self.run_state.history, took)
        )
        return [
            *[failed] * (self.failures.count > 0),
            *self._cut_off(),
            *(source.count.repeats if source.count else ()),
            *source.doubts,
            *stopped,
            *_account(source, self.run_state),
            speed,
        ]

    def _cut_off(self) -> list[str]:
        """Where the recording ends before its test did, or the replay was stopped."""
        warnings, stopped = self.run_state.event_log.events("warning"), self.stopping.is_set()
        return [e.text for e in warnings if (e.kind is EventKind.STOP if stopped else "missing" in e.data)]

    def exit_code(self) -> int:
        """That of an interrupted replay, of one that lost something, or 0."""
        source = self.source
        lossy = (
            self.outputs.failed
            or source.doubts
            or not self.run_state.history.ends_with_values
            or (source.count and source.count.left_out)
            or self._cut_off()
            or self.failures.count
        )
        return EXIT_INTERRUPTED if self.stopping.is_set() else LOSS if lossy else 0


def _counted(work: Iterable[Work], frame_counts: FrameCounts) -> Iterator[Work]:
    """The same bursts, their frames counted."""
    for item in work:
        if isinstance(item, Burst):
            frame_counts.add(grabbed=item.n, lost=item.lost)
        yield item


def _with_final_folder(config: Config, folder: Path | None) -> Config:
    """The configuration for the results, with the folder where they will be."""
    if folder is None:
        return config
    mask = config.measure.mask and str(folder / "mask.png")
    return replace(
        config, measure=replace(config.measure, mask=mask), output=replace(config.output, dir=str(folder))
    )


def _account(source: ReplaySource, run_state: RunState) -> list[str]:
    """The counts of pictures, and why some were left out."""
    count = source.count
    if count is None or not count.left_out:
        return []
    why = [event.text for event in run_state.event_log.events("warning") if event.kind is EventKind.DEVICE]
    left = len(why) - _MOST_TOLD
    more = [Message("... and {left} more; the log (-v) has all", left)] if left > 0 else []
    measured = run_state.frame_counts.measured
    words = Message(
        "{pictures} pictures: reference {reference}, measured {measured}, left out {left_out}",
        *counts(count.pictures, count.reference, measured, count.left_out),
    )  # fmt: skip
    rest = count.pictures - count.reference - measured - count.left_out
    words += Message(", of no whole burst {rest}", *counts(rest)) * (rest > 0)
    return [words, *(Message("  {text}", text) for text in [*why[:_MOST_TOLD], *more])]


def speed_line(history: History, seconds: float) -> str:
    """The speed, and the kernel's share of the time."""
    n, zois = len(history.time_steps), history.column("n_zoi").sum()
    share = history.column("measure_s").sum() / seconds
    return Message(
        "{bursts} in {seconds:.3g} s: {rate:.3g} bursts/s, {zois} ZOI/s, of that time {share:.0%} in the kernel",
        counted(n, "burst"), seconds, n / seconds, Amount("count", zois / seconds), share,
    )  # fmt: skip


def _not_empty(bursts: Iterable[Work], request: ReplayRequest, count: PictureCount | None) -> Iterator[Work]:
    """The same bursts; raises DataError before anything is written where there are none."""
    rest = iter(bursts)
    first = [*itertools.islice(rest, 1)]
    if not first and count and count.pictures - count.left_out == max(count.reference, 1) == 1:
        raise DataError(
            "{source}: one picture alone has no strain; give the folder that the others are in, or the picture before"
            " the test as --reference FILE",
            request.source,
        )
    if not first:
        raise DataError(
            "{source}: the first pictures are the reference, and no whole burst follows; give a smaller --burst",
            request.source,
        )
    return _after(first, rest)


def _after(first: list[Work], rest: Iterator[Work]) -> Iterator[Work]:
    """``first``, without keeping a reference, and the rest."""
    while first:
        yield first.pop()
    yield from rest
