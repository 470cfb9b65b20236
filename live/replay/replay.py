"""Replay: a recorded session, or any folder of pictures, through the very same measuring path.

``replay`` measures every burst; ``--as-measured`` measures the bursts that the live run measured,
with the references it took, and is then bit-equal to it on the same machine.
"""

from __future__ import annotations

import datetime
import itertools
import threading
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from acquire.addresses import parse_address
from acquire.camera import with_scheme
from acquire.errors import ConfigError, DataError
from acquire.events import Event, EventKind, EventSink
from acquire.opencv.images import picture_times
from live.config.loading import Config, load_config
from live.config.values import AUTO
from live.pipeline.consumer import Compose, RunInfo
from live.pipeline.consumer_thread import Outputs
from live.pipeline.event_log import EventLog
from live.pipeline.frame_counts import FrameCounts
from live.pipeline.history import History
from live.pipeline.run_state import RunState
from live.pipeline.screen import Screen
from live.replay.forces import read_forces
from live.replay.opening import opened_session, prepared
from live.replay.parts import StoredResults
from live.replay.pictures import picture_material, picture_of, write_names
from live.replay.session import session_path
from live.replay.source import ReplayRequest, ReplaySource, Work, ahead, check_window
from live.results.folder import make_folder
from live.results.writer import write_results
from live.setup.devices import open_rig
from live.setup.pictures import with_mask
from live.setup.region import is_auto_region

_MOST_TOLD = 5  # pictures that were left out, in the summary


@dataclass(frozen=True, slots=True, eq=False)
class Replayed:
    """What a replay leaves behind.

    Attributes
    ----------
    folder : Path
    run_state : RunState
    config : Config
    exit_code : int
    lines : tuple of str
        How it went, for a person: pictures that were left out, pace, the kernel's share of the time.
    left_out : int
        Pictures that could not be read or are not like the first.
    """

    folder: Path
    run_state: RunState
    config: Config
    exit_code: int
    lines: tuple[str, ...] = ()
    left_out: int = 0


def replay(
    request: ReplayRequest, screen: Screen, stopping: threading.Event, consumers: Compose = write_results
) -> Replayed:
    """Replay ``request.source`` into ``consumers``; setting ``stopping`` ends it early and cleanly.

    Raises
    ------
    ConfigError, DataError
        As for a run; also where --as-measured finds frames missing.
    """
    path = session_path(request.source)
    check_window(request)
    if path is None:
        return _replay_pictures(request, screen, stopping, consumers)
    with opened_session(path, request, screen) as (found, config):
        source_of_bursts = _with_forces(found, request, config)
        return _run(source_of_bursts, config, request, screen, stopping, EventLog(), consumers)


# -- pictures -----------------------------------------------------------------------------------


def _replay_pictures(
    request: ReplayRequest, screen: Screen, stopping: threading.Event, consumers: Compose
) -> Replayed:
    if request.as_measured:
        raise ConfigError(f"{request.source}: --as-measured needs a session; pictures have none")
    config = load_config(request.config_file, {"camera.address": request.source, **request.overrides})
    region = AUTO if is_auto_region(config) else config.measure.roi
    config = replace(
        config,
        load=replace(config.load, address="none:"),
        measure=replace(config.measure, roi=region),
    )
    event_log = EventLog()
    rig = open_rig(config.camera.address, "none:", _in_test_time(event_log), crop=config.camera.crop)
    try:
        with rig.camera as camera:
            source_of_bursts = _with_forces(picture_material(camera, request, config), request, config)
            return _run(source_of_bursts, config, request, screen, stopping, event_log, consumers)
    finally:
        rig.close()


def _with_forces(source_of_bursts: ReplaySource, request: ReplayRequest, config: Config) -> ReplaySource:
    """The same with the forces of the CSV that was given."""
    if request.forces is None:
        return source_of_bursts
    address, table = parse_address(with_scheme(request.source)), read_forces(request.forces)
    names = picture_times(address) if table.names and address.scheme == "files" else None
    samples = table.samples(names, source_of_bursts.start.monotonic)
    return replace(
        source_of_bursts,
        samples=tuple(samples),
        loads=table.log(samples, config.load.max_gap_s, config.load.lag_s),
    )


def _in_test_time(event_log: EventLog) -> EventSink:
    """Events of a picture have its time, which is data of theirs."""

    def record(event: Event) -> None:
        event_log.record(replace(event, t=float(event.data.get("t", 0.0))))

    return record


# -- the run ------------------------------------------------------------------------------------


def _run(
    source_of_bursts: ReplaySource,
    config: Config,
    request: ReplayRequest,
    screen: Screen,
    stopping: threading.Event,
    event_log: EventLog,
    consumers: Compose,
) -> Replayed:
    ready = prepared(source_of_bursts, config, request.source, screen, stopping.is_set)
    stored = StoredResults.of(request.parts, ready)
    measured = stored.measurements if stored else ready.measurements
    bursts = _not_empty(stored.bursts() if stored else source_of_bursts.bursts, request.source)
    folder = make_folder(ready.plan.config.output.dir, datetime.datetime.now(datetime.UTC))
    config = _settled(with_mask(ready.plan.config, ready.plan.mask, folder), request.settled)
    run_state = RunState(
        event_log,
        FrameCounts(),
        source_of_bursts.loads,
        History(config.specimen.axis),
        specimen=config.specimen,
    )
    write_names(request.source, folder / "pictures.csv")
    screen.say(f"replaying {request.source} into {request.settled or folder}")
    about = RunInfo(
        config,
        folder,
        source_of_bursts.camera,
        ready.plan.grid,
        source_of_bursts.start,
        aside=request.settled is not None,
    )
    outputs = Outputs(consumers(about, run_state), run_state.loads, event_log, run_state.history)
    began, work = time.perf_counter(), ahead(bursts)
    try:
        _give_past(source_of_bursts, outputs)
        for m in measured(work, source_of_bursts.loads, run_state.event_log):
            run_state.frame_counts.add(measured=m.burst.n, grabbed=m.burst.n, lost=m.burst.lost)
            if outputs.wants_frames:
                outputs.frame(picture_of(m.burst))
            screen.progress(
                outputs.add(m), m.number + 1, source_of_bursts.expected, time.perf_counter() - began
            )
            del m  # its pictures are not kept while the next burst is measured
            if stopping.is_set():
                break
        took = time.perf_counter() - began
    finally:
        work.close()
        outputs.end()
    pace = f"joined of {len(request.parts)} chunks" if request.parts else pace_line(run_state.history, took)
    lines = [*_account(source_of_bursts, run_state), pace]
    left_out = source_of_bursts.seen.left_out if source_of_bursts.seen else 0
    lossy = outputs.failed or not run_state.history.told_something or left_out > 0
    code = 130 if stopping.is_set() else 5 if lossy else 0
    return Replayed(folder, run_state, config, code, tuple(lines), left_out)


def _settled(config: Config, folder: Path | None) -> Config:
    """The configuration that the results hold, of where they will lie."""
    if folder is None:
        return config
    mask = config.measure.mask and str(folder / "mask.png")
    return replace(
        config,
        measure=replace(config.measure, mask=mask),
        output=replace(config.output, dir=str(folder)),
    )


def _account(source_of_bursts: ReplaySource, run_state: RunState) -> list[str]:
    """The fate of every picture, and why some were left out."""
    seen = source_of_bursts.seen
    if seen is None or not seen.left_out:
        return []
    why = [event.text for event in run_state.event_log.events("warning") if event.kind is EventKind.DEVICE]
    more = [f"... and {len(why) - _MOST_TOLD} more; the log (-v) has all"] if len(why) > _MOST_TOLD else []
    measured = run_state.frame_counts.measured
    words = (
        f"{seen.pictures} pictures: reference {seen.reference}, measured {measured}, left out {seen.left_out}"
    )
    rest = seen.pictures - seen.reference - measured - seen.left_out
    words += f", of no whole burst {rest}" * (rest > 0)
    return [words, *(f"  {text}" for text in [*why[:_MOST_TOLD], *more])]


def pace_line(history: History, seconds: float) -> str:
    """How fast it went, and how much of the time the kernel took."""
    n, zois = len(history.time_steps), history.column("n_zoi").sum()
    share = history.column("measure_s").sum() / seconds
    return (
        f"{n} bursts in {seconds:.3g} s: {n / seconds:.3g} bursts/s, {zois / seconds:,.0f} ZOI/s, of that time"
        f" {share:.0%} in the kernel"
    )


def _not_empty(bursts: Iterable[Work], source: str) -> Iterator[Work]:
    """The same; nothing is written where there is nothing to measure."""
    rest = iter(bursts)
    first = [*itertools.islice(rest, 1)]
    if not first:
        raise DataError(
            f"{source}: no whole burst after the reference, nothing to measure; give a smaller --burst"
        )
    return _after(first, rest)


def _after(first: list[Work], rest: Iterator[Work]) -> Iterator[Work]:
    """``first``, which is let go of, and the rest."""
    while first:
        yield first.pop()
    yield from rest


def _give_past(source_of_bursts: ReplaySource, outputs: Outputs) -> None:
    """What was recorded beside the pictures: events and loads."""
    for event in source_of_bursts.events:
        if event.kind is not EventKind.MEASURED:
            outputs.event(event)
    for sample in source_of_bursts.samples:
        outputs.load(sample)
