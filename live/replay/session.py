"""A recorded session as the source of a replay."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.addresses import expanded, parse_address
from acquire.camera import CAMERAS, with_scheme
from acquire.clock import ClockPair
from acquire.errors import ConfigError, DataError
from acquire.events import Event, EventKind
from acquire.load_cell import LoadLog
from acquire.load_sample import LoadSample
from acquire.session import Session
from live.config.loading import Config, from_dict, laid_over, settings_in
from live.pipeline.measure import NewReference
from live.replay.burst_index import BurstStore, open_store
from live.replay.pictures import reference_from, reference_words
from live.replay.source import ReplayRequest, ReplaySource, Window, Work

LIVE_ONLY = ("output", "record", "operate", "strain_out", "alarm")
"""Sections of the configuration that a replay leaves out."""
BESIDE_S = 10.0
"""Load samples so long after the last that is measured are read: a burst may reach beyond it."""


def session_path(source: str) -> Path | None:
    """The session's path, or None where ``source`` is an address of pictures."""
    address = parse_address(with_scheme(source))
    if address.scheme == "session":
        return expanded(address.target)
    if address.scheme and address.scheme in (*CAMERAS.schemes(), "sim"):
        return None
    raise DataError(
        "{source}: no such session; give a session.h5, or pictures as 'files:folder/*.tif' or 'video:file.mp4'",
        source,
    )


def session_config(session: Session, request: ReplayRequest, extra: Mapping[str, Any], path: Path) -> Config:
    """The configuration of the recorded run, overridden by file and command line."""
    stored = {k: v for k, v in session.config.items() if k not in LIVE_ONLY}
    stored["metadata"] = dict(session.metadata)
    stored["measure"] = {"strain": "small", **stored.get("measure", {})}  # older versions had no choice
    for section, keys in (("measure", ("mask",)), ("camera", ("dark", "flat"))):
        stored[section] = _beside(stored.get(section, {}), keys, path)
    file = {} if request.config_file is None else settings_in(request.config_file)
    try:
        return from_dict(stored, laid_over({**file, **extra}, request.overrides), str(path))
    except ConfigError:
        _check_stored(stored, str(path))
        raise


def _check_stored(stored: Mapping[str, Any], path: str) -> None:
    """Raises DataError where the error is in the session, and not in the overrides."""
    try:
        from_dict(stored, {}, path)
    except ConfigError as error:
        raise DataError(
            "{why} (stored so in the session; the command line can override it)", error
        ) from error


def _beside(section: Mapping[str, Any], keys: Iterable[str], path: Path) -> dict[str, Any]:
    """Where the folder was moved, mask, dark and flat frame are beside the session."""
    moved = {key: section[key] for key in keys if section.get(key) and not Path(section[key]).exists()}
    return {**section, **{key: str(path.with_name(Path(old).name)) for key, old in moved.items()}}


def session_source(session: Session, request: ReplayRequest, config: Config, path: Path) -> ReplaySource:
    if request.as_measured and session.mode.every > 1:
        raise ConfigError(
            "{path} holds only one frame in {every}, not the bursts that were measured; replay it without"
            " --as-measured",
            path,
            session.mode.every,
        )
    if request.as_measured and request.reference is not None:
        raise ConfigError(
            "--as-measured takes the references of the run; leave --reference out, or --as-measured"
        )
    loads = LoadLog(config.load.max_gap_s, config.load.lag_s)
    sign, window = config.load.sign, Window.of(request, session.start_monotonic)
    events = tuple(_turned(event) if sign < 0 else event for event in session.events())
    for event in events:
        loads.take_event(event)
    references = [e for e in events if e.kind is EventKind.REFERENCE and not e.data.get("renewed")]
    stored = open_store(session, path)
    if request.reference is not None:
        reference, after = reference_from(request.reference, session.camera), -1
    elif references and "measure.reference_burst" not in request.overrides:
        reference, after = stored.burst(references[-1].data), int(references[-1].data["last"])
    else:
        reference, after = stored.first_burst(config.measure.reference_burst or 1)
    last_t = max(window.high, reference.t) + config.load.max_gap_s + abs(config.load.lag_s) + BESIDE_S
    samples = _Loads(session, last_t, sign)
    for sample in samples:
        loads.append(sample)
    loads.close()
    if request.as_measured:
        found = _measured_then(stored, events, window)
    else:
        n = config.measure.burst if session.mode.kind == "all" else request.overrides.get("measure.burst")
        found = _all_after(stored, after, n, window, request.numbers)
    start = ClockPair(session.start_monotonic, session.start_utc)
    bursts = window.part(found.bursts)
    numbers = session.indices if len(session) else session.burst_column("last_index")
    words = reference_words(request, reference, len(numbers), last=int(numbers[-1]) if len(numbers) else None)
    return ReplaySource(
        session.camera,
        reference,
        bursts,
        loads,
        start,
        events,
        samples,
        found.expected,
        found.times,
        words=words,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Loads:
    """The load samples up to a time (monotonic s), read from the file each time."""

    session: Session
    last_t: float
    sign: int

    def __iter__(self) -> Iterator[LoadSample]:
        for sample in self.session.each_load_sample(high=self.last_t):
            yield replace(sample, force=-sample.force) if self.sign < 0 else sample


def _turned(event: Event) -> Event:
    """The event of a tare with its step in the other sign."""
    step = event.data.get("step_N")
    return event if step is None else replace(event, data={**event.data, "step_N": -step})


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    """The bursts to measure; how many at most and when, where that is known."""

    bursts: Iterable[Work]
    expected: int | None = None
    times: NDArray[np.float64] | None = None


def _all_after(
    stored: BurstStore, after: int, n: int | None, window: Window, numbers: range | None
) -> _Found:
    """Every burst in the window."""
    index = stored.index_after(after, n)
    found = window.numbers(index.t)
    if numbers is not None:
        found = found[numbers.start : numbers.stop]
    return _Found(stored.bursts_at(index, found), len(found), index.t[found.start : found.stop])


def _measured_then(stored: BurstStore, events: Iterable[Event], window: Window) -> _Found:
    """The bursts of the live run."""
    wanted = _measured_within(events, window)
    return _Found(_as_measured(stored, events, wanted), len(wanted) or None)


def _measured_within(events: Iterable[Event], window: Window) -> set[int]:
    """First frames of the bursts to read: those within, or the last where none is, for ``Window.part`` to report."""
    measured = [event for event in events if event.kind is EventKind.MEASURED]
    inside = [event for event in measured if window.holds(event.t)] or measured[-1:]
    return {int(event.data["first"]) for event in inside}


def _as_measured(stored: BurstStore, events: Iterable[Event], wanted: set[int]) -> Iterator[Work]:
    for event in events:
        renewed = event.kind is EventKind.REFERENCE and event.data.get("renewed")
        if renewed and not event.data.get("automatic"):  # the pipeline does those again by itself
            yield NewReference(stored.burst(event.data))
        elif event.kind is EventKind.MEASURED and int(event.data["first"]) in wanted:
            burst = stored.burst(event.data)
            # Sessions of older versions have no such value; the burst then has its own count.
            lost = event.data.get("lost")
            yield replace(burst, lost=lost) if isinstance(lost, int) else burst
