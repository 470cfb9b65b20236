"""Opening the source of a replay, a recorded session or pictures, and preparing the kernel on its reference."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from acquire.addresses import expanded, parse_address
from acquire.camera import CAMERAS, with_scheme
from acquire.clock import ClockPair
from acquire.errors import ConfigError, DataError
from acquire.events import Event, EventKind, ignore_event
from acquire.frame import Burst, CameraInfo
from acquire.load_cell import LoadLog
from acquire.load_sample import LoadSample
from acquire.session import Session
from acquire.text import Message
from analysis.evaluate import AUTO_GAUGES
from live.config.gauges import gauges_for
from live.config.loading import Config, from_dict, laid_over, load_config, settings_in, two_sections
from live.config.values import AUTO
from live.pipeline.consumer import Screen
from live.pipeline.measure import NewReference
from live.pipeline.reference import averaged
from live.replay.burst_index import BurstStore, open_store
from live.replay.pictures import picture_source, reference_from, reference_words, with_reference
from live.replay.source import ReplayRequest, ReplaySource, Window, Work, check_window
from live.results.folder import differing_versions
from live.setup.compiling import Stopping
from live.setup.grid import grid_for
from live.setup.pictures import camera_of, read_mask
from live.setup.prepared import MeasurePlan, PreparedKernel
from live.setup.region import FirstLook, located_on

if TYPE_CHECKING:
    from analysis.field import StrainField

LIVE_ONLY = ("output", "record", "operate", "strain_out", "alarm")
"""Sections of the configuration that a replay leaves out."""
BESIDE_S = 10.0
"""Load samples so long after the last that is measured are read: a burst may reach beyond it."""


_FORMER_AUTO_GAUGES = ("axial", "transverse")  # of recordings made before November 2026


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
        config = from_dict(stored, laid_over({**file, **extra}, request.overrides), str(path))
    except ConfigError:
        _check_stored(stored, str(path))
        raise
    if ways := two_sections(asdict(config.specimen)):
        raise DataError(
            "{path}: {one} and {other} are two sections (stored so in the session); say which: --section W,T, or one"
            " of them in the file of --config",
            path,
            *ways,
        )
    return config


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


@contextmanager
def open_session_source(
    path: Path, request: ReplayRequest, screen: Screen
) -> Iterator[tuple[ReplaySource, Config]]:
    """Open a session for a replay and show the notes on it; raises as ``replay``."""
    with Session.open(path) as session:
        overrides = {"camera.address": f"session:{path}", "load.address": f"session:{path}"}
        config = session_config(session, request, overrides, path)
        if request.overrides.get("measure.roi") == AUTO and "measure.mask" not in request.overrides:
            config = replace(config, measure=replace(config.measure, mask=None))  # found again
        source = session_source(session, request, config, path)
        screen.print(source.words)
        for note in _notes(session, request):
            screen.print(Message("note: {what}", note))
        yield source, _with_fitting_gauges(config, session.camera, request, screen)


def _with_fitting_gauges(
    config: Config, camera: CameraInfo, request: ReplayRequest, screen: Screen
) -> Config:
    """Without automatic gauges of the run that have no ZOI in the grid of the replay; raises ConfigError for others."""
    if config.measure.roi == AUTO:
        return config
    mask = read_mask(config.measure.mask, camera.width, camera.height)
    grid, axis = grid_for(config, camera.width, camera.height, mask), config.specimen.first_axis
    given = settings_in(request.config_file) if request.config_file else {}
    gauges = dict(config.gauges)
    for name in (*AUTO_GAUGES, *_FORMER_AUTO_GAUGES):
        if name not in gauges or f"gauges.{name}" in given:
            continue
        try:
            gauges_for({name: gauges[name]}, axis, grid)
        except ConfigError:
            del gauges[name]
            screen.print(
                Message(
                    "note: the automatic gauge {name} of the run has no ZOI in this grid, and is left out",
                    name,
                )
            )
    return replace(config, gauges=gauges)


def _notes(session: Session, request: ReplayRequest) -> Iterator[str]:
    if session.recovered:
        yield session.recovered
    if session.mode.every > 1:
        yield Message("one frame in {every} was recorded; measured as a slower camera", session.mode.every)
    elif session.mode.kind == "all" and not request.as_measured and _were_shortened(session):
        yield Message(
            "the run shortened its bursts while the picture moved; here they have one length (as in the run:"
            " --as-measured)"
        )
    if request.as_measured and (otherwise := differing_versions(session.versions)):
        versions = ", ".join(otherwise)
        yield Message("recorded with {versions}; the last digits of the results may differ", versions)


def _were_shortened(session: Session) -> bool:
    """Whether the version that recorded it matched the length of bursts to the motion (``shorten_bursts``)."""
    measure = session.config.get("measure")
    return isinstance(measure, dict) and measure.get("shorten_bursts") is True


@contextmanager
def open_source(request: ReplayRequest) -> Iterator[tuple[ReplaySource, Config]]:
    """The source of a replay and its configuration, without forces of a file; raises as ``replay``."""
    check_window(request)
    path = session_path(request.source)
    if path is not None:
        with Session.open(path) as session:
            config = session_config(session, request, {"camera.address": f"session:{path}"}, path)
            yield session_source(session, request, config, path), config
        return
    request = with_reference(request)
    config = load_config(request.config_file, {"camera.address": request.source, **request.overrides})
    config = replace(config, load=replace(config.load, address="none:"))
    with camera_of(config.camera.address, crop=config.camera.crop, resting=False) as camera, camera:
        yield picture_source(camera, request, config), config


def prepare_replay(
    source: ReplaySource,
    config: Config,
    name: str,
    screen: Screen,
    stopping: Stopping | None = None,
) -> PreparedKernel:
    """Find the specimen where configured, and prepare the kernel; raises as ``replay``. ``name`` is for messages."""
    camera = source.camera
    mask = read_mask(config.measure.mask, camera.width, camera.height)
    if AUTO in (config.measure.roi, config.measure.gauges):
        look = FirstLook(source.reference.mean, _noise_of(source.reference), camera)
        config, mask = located_on(config, look, screen)
    plan = MeasurePlan.of(config, camera, mask)
    plan.compile(camera, screen, stopping)
    try:
        return plan.on(source.reference, f"the reference of {name}")
    except DataError as error:
        raise DataError(
            "{why}; where the first pictures are blank choose another: --reference NAME, of a film 'NAME?first=5'",
            error,
        ) from error


def fields_of(
    source: ReplaySource, config: Config, name: str, screen: Screen
) -> Iterator[tuple[float, StrainField]]:
    """Time (s, monotonic) and field of each burst, with the progress on the screen; raises as ``replay``."""
    ready = prepare_replay(source, config, name, screen)
    for m in ready.measurements(source.bursts, source.loads, ignore_event):
        yield m.t, m.field
        screen.progress(m.time_step, m.number + 1, source.expected, 0.0)


def _noise_of(reference: Burst) -> float | None:
    """Noise of the mean, GL; None for a single frame."""
    return averaged(reference.noise, reference.n) if reference.noise > 0 else None
