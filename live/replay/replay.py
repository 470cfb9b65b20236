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
from typing import Any, cast

from acquire.errors import ConfigError, DataError
from acquire.events import EventKind
from acquire.frame import Burst
from acquire.session import Session
from live.measure import History, averaged, kinds_of, measure, prepare
from live.outputs import About, Outputs, make_outputs
from live.replay.material import Material, ReplayRequest, Work, check_window
from live.replay.pictures import picture_material, picture_of
from live.replay.session import session_config, session_material, session_path
from live.setup import (
    AUTO,
    Config,
    compile_ahead,
    correction,
    gauges_for,
    grid_for,
    kernel_settings,
    load_config,
    make_folder,
    open_rig,
    read_mask,
    with_mask,
)
from live.specimen import Look, is_sought, placed_on
from live.tell import Books, Journal, Ledger, Screen


@dataclass(frozen=True, slots=True, eq=False)
class Replayed:
    """What a replay leaves behind."""

    folder: Path
    books: Books
    config: Config
    exit_code: int


def replay(request: ReplayRequest, screen: Screen, stopping: threading.Event) -> Replayed:
    """Replay ``request.source``; setting ``stopping`` ends it early and cleanly.

    Raises
    ------
    ConfigError, DataError
        As for a run; also where --as-measured finds frames missing.
    """
    path = session_path(request.source)
    check_window(request)
    if path is None:
        return _replay_pictures(request, screen, stopping)
    with Session.open(path) as session:
        if session.recovered:
            screen.say(f"note: {session.recovered}")
        if session.mode.every > 1:
            screen.say(f"note: one frame in {session.mode.every} was recorded; measured as a slower camera")
        overrides = {"camera.address": f"session:{path}", "load.address": f"session:{path}"}
        config = session_config(session, request, overrides, path)
        if request.overrides.get("measure.roi") == AUTO and "measure.mask" not in request.overrides:
            config = replace(config, measure=replace(config.measure, mask=None))  # the one it found then
        material = session_material(session, request, config, path)
        return _run(material, config, request, screen, stopping)


# -- pictures -----------------------------------------------------------------------------------


def _replay_pictures(request: ReplayRequest, screen: Screen, stopping: threading.Event) -> Replayed:
    if request.as_measured:
        raise ConfigError(f"{request.source}: --as-measured needs a session; pictures have none")
    config = load_config(request.config_file, {"camera.address": request.source, **request.overrides})
    region = AUTO if is_sought(config) else config.measure.roi
    config = replace(
        config,
        load=replace(config.load, address="none:"),
        measure=replace(config.measure, roi=region),
    )
    rig = open_rig(config.camera.address, "none:", crop=config.camera.crop)
    try:
        with rig.camera as camera:
            return _run(picture_material(camera, request, config), config, request, screen, stopping)
    finally:
        rig.close()


# -- the run ------------------------------------------------------------------------------------


def _run(
    material: Material, config: Config, request: ReplayRequest, screen: Screen, stopping: threading.Event
) -> Replayed:
    camera = material.camera
    mask = read_mask(config.measure.mask, camera.width, camera.height)
    if AUTO in (config.measure.roi, config.measure.gauges):
        seen = Look(material.reference.mean, _noise_of(material.reference), camera)
        config, mask = placed_on(config, seen, screen.say)
    grid = grid_for(config, camera.width, camera.height, mask)
    correct, gauges = correction(config, camera), gauges_for(config, grid)
    settings, stated = kernel_settings(config), config.measure.noise_GL
    compile_ahead(kinds_of(camera), phase=settings.estimator == "phase", say=screen.status)
    what = f"the reference of {request.source}"
    kernel, noise_GL = prepare(material.reference, grid, settings, stated, correct, what)
    bursts = _not_empty(material.bursts, request.source)
    folder = make_folder(config.output.dir, datetime.datetime.now(datetime.UTC))
    config = with_mask(config, mask, folder)
    books = Books(Journal(), Ledger(), material.loads, History())
    screen.say(f"replaying {request.source} into {folder}")
    outputs = make_outputs(About(config, folder, camera, grid, material.start), books, screen)
    began = time.perf_counter()
    try:
        _give_past(material, outputs)
        for m in measure(
            bursts,
            kernel,
            material.loads,
            noise_GL=noise_GL,
            correct=correct,
            gauges=gauges,
            renew_at=config.measure.renew_at,
            strain=cast(Any, config.measure.strain),
            on_event=books.journal,
            timer=time.perf_counter,
        ):
            books.ledger.add(measured=m.burst.n, grabbed=m.burst.n)
            outputs.frame(picture_of(m.burst))
            screen.progress(outputs.add(m), m.number + 1, material.expected, time.perf_counter() - began)
            if stopping.is_set():
                break
    finally:
        outputs.end()
    lossy = outputs.failed or not books.history.told_something
    return Replayed(folder, books, config, 130 if stopping.is_set() else 5 if lossy else 0)


def _noise_of(reference: Burst) -> float | None:
    """Of the mean, GL; None where one frame tells nothing."""
    return averaged(reference.noise, reference.n) if reference.noise > 0 else None


def _not_empty(bursts: Iterable[Work], source: str) -> Iterator[Work]:
    """The same; nothing is written where there is nothing to measure."""
    rest = iter(bursts)
    first = next(rest, None)
    if first is None:
        raise DataError(
            f"{source}: no whole burst after the reference, nothing to measure; give a smaller --burst"
        )
    return itertools.chain([first], rest)


def _give_past(material: Material, outputs: Outputs) -> None:
    """What was recorded beside the pictures: events and loads."""
    for event in material.events:
        if event.kind is not EventKind.MEASURED:
            outputs.event(event)
    for sample in material.samples:
        outputs.load(sample)
