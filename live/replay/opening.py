"""A source opened, and the kernel prepared on its reference."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from acquire.events import ignore_event
from acquire.frame import Burst
from acquire.session import Session
from live.config.loading import Config, load_config
from live.config.values import AUTO
from live.pipeline.reference import averaged
from live.pipeline.screen import Screen
from live.replay.pictures import picture_material
from live.replay.session import session_config, session_material, session_path
from live.replay.source import ReplayRequest, ReplaySource, check_window
from live.results.folder import differing_versions
from live.setup.devices import open_rig
from live.setup.pictures import read_mask
from live.setup.prepared import MeasurePlan, PreparedKernel
from live.setup.region import FirstLook, placed_on


@contextmanager
def opened_session(
    path: Path, request: ReplayRequest, screen: Screen
) -> Iterator[tuple[ReplaySource, Config]]:
    """A session for a replay, with what is to be said of it; raises as ``replay``."""
    with Session.open(path) as session:
        for note in _notes(session, request):
            screen.say(f"note: {note}")
        overrides = {"camera.address": f"session:{path}", "load.address": f"session:{path}"}
        config = session_config(session, request, overrides, path)
        if request.overrides.get("measure.roi") == AUTO and "measure.mask" not in request.overrides:
            config = replace(config, measure=replace(config.measure, mask=None))  # the one it found then
        yield session_material(session, request, config, path), config


def _notes(session: Session, request: ReplayRequest) -> Iterator[str]:
    if session.recovered:
        yield session.recovered
    if session.mode.every > 1:
        yield f"one frame in {session.mode.every} was recorded; measured as a slower camera"
    elif session.mode.kind == "all" and not request.as_measured and _were_shortened(session):
        yield (
            "the run shortened its bursts while the picture moved; here they have one length, with --as-measured"
            " they are those of the run"
        )
    if request.as_measured and (otherwise := differing_versions(session.versions)):
        yield f"recorded with {', '.join(otherwise)}; the last digits of the results may differ"


def _were_shortened(session: Session) -> bool:
    """Whether the version that recorded it fitted the length of bursts to the motion (``shorten_bursts``)."""
    measure = session.config.get("measure")
    return isinstance(measure, dict) and measure.get("shorten_bursts") is True


@contextmanager
def open_material(request: ReplayRequest) -> Iterator[tuple[ReplaySource, Config]]:
    """The material of a replay and its configuration; raises as ``replay``. Forces of a file are left out."""
    check_window(request)
    path = session_path(request.source)
    if path is not None:
        with Session.open(path) as session:
            config = session_config(session, request, {"camera.address": f"session:{path}"}, path)
            yield session_material(session, request, config, path), config
        return
    config = load_config(request.config_file, {"camera.address": request.source, **request.overrides})
    config = replace(config, load=replace(config.load, address="none:"))
    rig = open_rig(config.camera.address, "none:", ignore_event, crop=config.camera.crop)
    try:
        with rig.camera as camera:
            yield picture_material(camera, request, config), config
    finally:
        rig.close()


def prepared(
    source_of_bursts: ReplaySource,
    config: Config,
    source: str,
    screen: Screen,
    stopped: Callable[[], bool] = lambda: False,
) -> PreparedKernel:
    """Look for the specimen where that is asked for, and prepare the kernel; raises as ``replay``."""
    camera = source_of_bursts.camera
    mask = read_mask(config.measure.mask, camera.width, camera.height)
    if AUTO in (config.measure.roi, config.measure.gauges):
        seen = FirstLook(source_of_bursts.reference.mean, _noise_of(source_of_bursts.reference), camera)
        config, mask = placed_on(config, seen, screen.say)
    plan = MeasurePlan.of(config, camera, mask)
    plan.compile(camera, screen.status, stopped)
    return plan.on(source_of_bursts.reference, f"the reference of {source}")


def _noise_of(reference: Burst) -> float | None:
    """Of the mean, GL; None where one frame tells nothing."""
    return averaged(reference.noise, reference.n) if reference.noise > 0 else None
