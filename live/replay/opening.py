"""Opening the source of a replay, and preparing the kernel on its reference."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from acquire.errors import ConfigError, DataError
from acquire.events import ignore_event
from acquire.frame import Burst, CameraInfo
from acquire.session import Session
from acquire.text import Message
from live.config.gauges import gauges_for
from live.config.loading import AUTO_GAUGES, Config, load_config, settings_in
from live.config.values import AUTO
from live.pipeline.consumer import Screen
from live.pipeline.reference import averaged
from live.replay.pictures import picture_source, with_reference
from live.replay.session import session_config, session_path, session_source
from live.replay.source import ReplayRequest, ReplaySource, check_window
from live.results.folder import differing_versions
from live.setup.compiling import Stopping
from live.setup.frames import camera_of
from live.setup.grid import grid_for
from live.setup.pictures import read_mask
from live.setup.prepared import MeasurePlan, PreparedKernel
from live.setup.region import FirstLook, located_on

if TYPE_CHECKING:
    from analysis.field import StrainField

_FORMER_AUTO_GAUGES = ("axial", "transverse")  # of recordings made before November 2026


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
