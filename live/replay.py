"""Replay: a recorded session, or any folder of pictures, through the very same measuring path.

``replay`` measures every burst; ``--as-measured`` measures the bursts that the live run measured,
with the references it took, and is then bit-equal to it on the same machine.
"""

from __future__ import annotations

import datetime
import math
import threading
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from acquire.addresses import parse_address
from acquire.burst import average_bursts, burst_of
from acquire.camera import Camera, open_camera
from acquire.errors import ConfigError, DataError
from acquire.events import Event, EventKind
from acquire.frame import Burst, CameraInfo, Frame, frozen
from acquire.load_log import LoadLog
from acquire.session import Session
from acquire.smear import LIMIT_PX
from live.config import Config, from_dict, load_config, settings_in
from live.journal import Journal
from live.ledger import Ledger
from live.outputs import Outputs, make_folder, open_view, usable
from live.pipeline import NewReference, measure, prepare
from live.setup import correction, grid_for, kernel_settings, make_outputs, read_mask
from live.status import Screen
from live.stored_bursts import Store, open_store


@dataclass(frozen=True, slots=True)
class ReplayRequest:
    """What is asked for.

    Attributes
    ----------
    source : str
        Path of a session, or an address of pictures (``files:shots/*.tif``, ``video:...``).
    as_measured : bool
    start_s, end_s : float or None, s
        Part of the session, in seconds since its start.
    reference : str or None
        An image file as the reference, where the source is a folder of pictures.
    config_file : Path or None
    overrides : mapping of "section.key" to value
    """

    source: str
    as_measured: bool
    start_s: float | None
    end_s: float | None
    reference: str | None
    config_file: Path | None
    overrides: Mapping[str, Any]


@dataclass(frozen=True, slots=True, eq=False)
class Material:
    """A source taken apart: what the reference is, and the bursts to measure."""

    camera: CameraInfo
    reference: Burst
    bursts: Iterable[Burst | NewReference]
    loads: LoadLog
    start: tuple[float, datetime.datetime]
    events: tuple[Event, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Replayed:
    """What a replay leaves behind."""

    folder: Path
    outputs: Outputs
    loads: LoadLog
    ledger: Ledger
    config: Config
    exit_code: int


def replay(request: ReplayRequest, screen: Screen, stopping: threading.Event) -> Replayed:
    """Replay ``request.source``; setting ``stopping`` ends it early and cleanly.

    Raises
    ------
    ConfigError, DataError
        As for a run; also where --as-measured finds frames missing.
    """
    path = _session_path(request.source)
    if path is None:
        return _replay_pictures(request, screen, stopping)
    with Session.open(path) as session:
        if session.recovered:
            screen.say(f"note: {session.recovered}")
        overrides = {"camera.address": f"session:{path}", "load.address": f"session:{path}"}
        config = _session_config(session, request, overrides, path)
        material = _session_material(session, request, config, path)
        return _run(material, config, request, screen, stopping)


def _session_path(source: str) -> Path | None:
    """The session's path, or None where ``source`` is an address of pictures."""
    address = parse_address(source)
    if address.scheme == "session":
        return Path(address.target)
    if address.scheme and address.scheme in ("files", "video", "sim", "opencv"):
        return None
    if Path(source).suffix.lower() in (".h5", ".hdf5") or Path(source).is_file():
        return Path(source)
    raise DataError(
        f"{source}: no such session; give a session.h5, or pictures as 'files:folder/*.tif' or 'video:file.mp4'"
    )


def _session_config(session: Session, request: ReplayRequest, extra: Mapping[str, Any], path: Path) -> Config:
    """The configuration in force when the session was recorded, overridden by file and command line."""
    stored = {k: v for k, v in session.config.items() if k not in ("output", "record")}
    stored["metadata"] = dict(session.metadata)
    for section, keys in (("measure", ("mask",)), ("camera", ("dark", "flat"))):
        stored[section] = _beside(stored.get(section, {}), keys, path)
    file = {} if request.config_file is None else settings_in(request.config_file)
    return from_dict(stored, {**file, **extra, **request.overrides}, str(path))


def _beside(section: Mapping[str, Any], keys: Iterable[str], path: Path) -> dict[str, Any]:
    """A folder that was moved has its mask, dark and flat frame beside the session."""
    moved = {key: section[key] for key in keys if section.get(key) and not Path(section[key]).exists()}
    return {**section, **{key: str(path.with_name(Path(old).name)) for key, old in moved.items()}}


# -- a session ----------------------------------------------------------------------------------


def _session_material(session: Session, request: ReplayRequest, config: Config, path: Path) -> Material:
    loads = LoadLog(config.load.max_gap_s)
    for sample in session.load_samples():
        loads.append(sample)
    loads.close()
    events = tuple(session.events())
    told = [e for e in events if e.kind is EventKind.REFERENCE and not e.data.get("renewed")]
    stored = open_store(session, path)
    if told and "measure.reference_burst" not in request.overrides:
        reference, after = stored.burst(told[-1].data), int(told[-1].data["last"])
    else:
        reference, after = stored.first_burst(config.measure.reference_burst or 1)
    window = _window(request, session.start_monotonic)
    if request.as_measured:
        bursts = _as_measured(stored, events, window)
    else:
        whole = session.mode.kind == "all"
        n = config.measure.burst if whole else request.overrides.get("measure.burst")
        bursts = _within(
            stored.bursts_after(after, n, LIMIT_PX if config.measure.shorten_bursts else None), window
        )
    start = (session.start_monotonic, session.start_utc)
    return Material(session.camera, reference, bursts, loads, start, events)


def _window(request: ReplayRequest, origin: float) -> tuple[float, float]:
    low = -math.inf if request.start_s is None else origin + request.start_s
    high = math.inf if request.end_s is None else origin + request.end_s
    if low >= high:
        raise ConfigError("--from must be before --to")
    return low, high


def _within(bursts: Iterable[Burst], window: tuple[float, float]) -> Iterator[Burst]:
    return (burst for burst in bursts if window[0] <= burst.t <= window[1])


def _as_measured(
    stored: Store, events: Iterable[Event], window: tuple[float, float]
) -> Iterator[Burst | NewReference]:
    for event in events:
        renewed = event.kind is EventKind.REFERENCE and event.data.get("renewed")
        if renewed and not event.data.get("automatic"):  # the pipeline does those again by itself
            yield NewReference(stored.burst(event.data))
        elif event.kind is EventKind.MEASURED:
            burst = stored.burst(event.data)
            if window[0] <= burst.t <= window[1]:
                yield burst


# -- pictures -----------------------------------------------------------------------------------


def _replay_pictures(request: ReplayRequest, screen: Screen, stopping: threading.Event) -> Replayed:
    if request.as_measured:
        raise ConfigError(f"{request.source}: --as-measured needs a session; pictures have none")
    config = load_config(request.config_file, {"camera.address": request.source, **request.overrides})
    config = replace(config, load=replace(config.load, address="none:"))
    camera = open_camera(request.source)
    try:
        with camera:
            return _run(_picture_material(camera, request, config), config, request, screen, stopping)
    finally:
        camera.close()


def _picture_material(camera: Camera, request: ReplayRequest, config: Config) -> Material:
    frames = iter(camera)
    if request.reference is not None:
        reference = burst_of([_reference_frame(Path(request.reference), camera.info)])
    else:
        reference = _leading_burst(frames, config.measure.reference_burst or 1, request.source)
    loads = LoadLog(config.load.max_gap_s)
    loads.close()
    bursts = _within(average_bursts(frames, config.measure.burst or 1), _window(request, 0.0))
    return Material(camera.info, reference, bursts, loads, (0.0, datetime.datetime.now(datetime.UTC)))


def _leading_burst(frames: Iterator[Frame], n: int, source: str) -> Burst:
    for burst in average_bursts(frames, n):
        return burst
    raise DataError(f"{source}: fewer than {n} pictures for the reference; give a smaller --reference-burst")


def _reference_frame(path: Path, camera: CameraInfo) -> Frame:
    from acquire.image_files import read_image

    image = read_image(path)
    if image.shape != (camera.height, camera.width):
        raise DataError(
            f"{path}: the reference has {image.shape[1]} x {image.shape[0]} px,"
            f" the pictures {camera.width} x {camera.height}; they must be the same"
        )
    return Frame(image, 0, 0.0, "nominal", 0, camera.bits, 0.0)


# -- the run ------------------------------------------------------------------------------------


def _picture(burst: Burst) -> Frame:
    """What the view shows of a burst: its mean, rounded."""
    image = np.rint(burst.mean).astype(np.uint8 if burst.bits <= 8 else np.uint16)
    return Frame(frozen(image), burst.first_index, burst.t, burst.clock, 0, burst.bits, burst.t)


def _run(
    material: Material, config: Config, request: ReplayRequest, screen: Screen, stopping: threading.Event
) -> Replayed:
    camera = material.camera
    mask = read_mask(config.measure.mask, camera.width, camera.height)
    grid = grid_for(config, camera.width, camera.height, mask)
    correct = correction(config, camera)
    journal, ledger = Journal(), Ledger()
    try:
        kernel, noise_GL = prepare(
            material.reference, grid, kernel_settings(config), config.measure.noise_GL, correct
        )
    except ValueError as error:
        raise usable(error, f"the reference of {request.source}") from error
    folder = make_folder(config.output.dir, datetime.datetime.now(datetime.UTC))
    outputs = make_outputs(config, folder, camera, grid, material.loads, journal, ledger, material.start)
    screen.say(f"replaying {request.source} into {folder}")
    open_view(outputs, config, screen)
    for event in material.events:
        if outputs.view is not None and event.kind is not EventKind.MEASURED:
            outputs.view.event(event)
    if outputs.view is not None:
        for t, force in zip(*material.loads.arrays(), strict=True):
            outputs.view.load(float(t), float(force))
    try:
        for m in measure(
            material.bursts,
            kernel,
            material.loads,
            noise_GL=noise_GL,
            correct=correct,
            renew_at=config.measure.renew_at,
            on_event=journal,
            timer=time.perf_counter,
        ):
            ledger.add(measured=m.burst.n, grabbed=m.burst.n)
            outputs.picture(_picture(m.burst))
            screen.instant(outputs.add(m), ledger, 0.0)
            if stopping.is_set():
                break
    finally:
        outputs.close()
    code = 130 if stopping.is_set() else 5 if outputs.failed else 0
    return Replayed(folder, outputs, material.loads, ledger, config, code)
