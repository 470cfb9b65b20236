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

from acquire.addresses import parse_address
from acquire.camera import with_scheme
from acquire.errors import ConfigError, DataError
from acquire.events import Event, EventKind, EventSink
from acquire.frame import Burst
from acquire.opencv import picture_times
from acquire.session import Session
from live.measure import History, averaged, kinds_of, measure, prepare
from live.outputs import About, Outputs, make_outputs
from live.replay.ahead import ahead
from live.replay.forces import read_forces
from live.replay.material import Material, ReplayRequest, Work, check_window
from live.replay.pictures import picture_material, picture_of, write_names
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
    other_digits,
    read_mask,
    with_mask,
)
from live.specimen import Look, is_sought, placed_on
from live.tell import Books, Journal, Ledger, Screen

_MOST_TOLD = 5  # pictures that were left out, in the summary


@dataclass(frozen=True, slots=True, eq=False)
class Replayed:
    """What a replay leaves behind.

    Attributes
    ----------
    folder : Path
    books : Books
    config : Config
    exit_code : int
    lines : tuple of str
        How it went, for a person: pictures that were left out, pace, the kernel's share of the time.
    left_out : int
        Pictures that could not be read or are not like the first.
    """

    folder: Path
    books: Books
    config: Config
    exit_code: int
    lines: tuple[str, ...] = ()
    left_out: int = 0


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
        if request.as_measured and (otherwise := other_digits(session.versions)):
            screen.say(
                f"note: recorded with {', '.join(otherwise)}; the last digits of the results may differ"
            )
        overrides = {"camera.address": f"session:{path}", "load.address": f"session:{path}"}
        config = session_config(session, request, overrides, path)
        if request.overrides.get("measure.roi") == AUTO and "measure.mask" not in request.overrides:
            config = replace(config, measure=replace(config.measure, mask=None))  # the one it found then
        material = _with_forces(session_material(session, request, config, path), request, config)
        return _run(material, config, request, screen, stopping, Journal())


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
    journal = Journal()
    rig = open_rig(config.camera.address, "none:", _in_test_time(journal), crop=config.camera.crop)
    try:
        with rig.camera as camera:
            material = _with_forces(picture_material(camera, request, config), request, config)
            return _run(material, config, request, screen, stopping, journal)
    finally:
        rig.close()


def _with_forces(material: Material, request: ReplayRequest, config: Config) -> Material:
    """The same with the forces of the CSV that was given."""
    if request.forces is None:
        return material
    address, table = parse_address(with_scheme(request.source)), read_forces(request.forces)
    names = picture_times(address) if table.names and address.scheme == "files" else None
    samples = table.samples(names, material.start.monotonic)
    return replace(
        material, samples=tuple(samples), loads=table.log(samples, config.load.max_gap_s, config.load.lag_s)
    )


def _in_test_time(journal: Journal) -> EventSink:
    """Events of a picture have its time, which is data of theirs."""

    def record(event: Event) -> None:
        journal.record(replace(event, t=float(event.data.get("t", 0.0))))

    return record


# -- the run ------------------------------------------------------------------------------------


def _run(
    material: Material,
    config: Config,
    request: ReplayRequest,
    screen: Screen,
    stopping: threading.Event,
    journal: Journal,
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
    config = _settled(with_mask(config, mask, folder), request.settled)
    books = Books(journal, Ledger(), material.loads, History())
    write_names(request.source, folder / "pictures.csv")
    screen.say(f"replaying {request.source} into {request.settled or folder}")
    outputs = make_outputs(About(config, folder, camera, grid, material.start), books, screen)
    began, work = time.perf_counter(), ahead(bursts)
    try:
        _give_past(material, outputs)
        for m in measure(
            work,
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
            books.ledger.add(measured=m.burst.n, grabbed=m.burst.n, lost=m.burst.lost)
            outputs.frame(picture_of(m.burst))
            screen.progress(outputs.add(m), m.number + 1, material.expected, time.perf_counter() - began)
            if stopping.is_set():
                break
        took = time.perf_counter() - began
    finally:
        work.close()
        outputs.end()
    lines = [*_account(material, books), pace_line(books.history, took)]
    left_out = material.seen.left_out if material.seen else 0
    lossy = outputs.failed or not books.history.told_something or left_out > 0
    code = 130 if stopping.is_set() else 5 if lossy else 0
    return Replayed(folder, books, config, code, tuple(lines), left_out)


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


def _account(material: Material, books: Books) -> list[str]:
    """The fate of every picture, and why some were left out."""
    seen = material.seen
    if seen is None or not seen.left_out:
        return []
    why = [event.text for event in books.journal.events("warning") if event.kind is EventKind.DEVICE]
    more = [f"... and {len(why) - _MOST_TOLD} more; the log (-v) has all"] if len(why) > _MOST_TOLD else []
    measured = books.ledger.measured
    words = (
        f"{seen.pictures} pictures: reference {seen.reference}, measured {measured}, left out {seen.left_out}"
    )
    rest = seen.pictures - seen.reference - measured - seen.left_out
    words += f", of no whole burst {rest}" * (rest > 0)
    return [words, *(f"  {text}" for text in [*why[:_MOST_TOLD], *more])]


def pace_line(history: History, seconds: float) -> str:
    """How fast it went, and how much of the time the kernel took."""
    n, zois = len(history.instants), history.column("n_zoi").sum()
    share = history.column("measure_s").sum() / seconds
    return (
        f"{n} bursts in {seconds:.3g} s: {n / seconds:.3g} bursts/s, {zois / seconds:,.0f} ZOI/s, of that time"
        f" {share:.0%} in the kernel"
    )


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
