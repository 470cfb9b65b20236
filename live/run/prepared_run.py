"""A prepared run: devices, grid, settings and folder before the first frame of a test."""

from __future__ import annotations

import datetime
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquire.clock import ClockPair
from acquire.errors import ConfigError
from acquire.hdf5 import compile_loops
from acquire.record_mode import RecordMode
from acquire.text import Message
from live.config.loading import Config
from live.config.sections import DEFAULT_BURST, DEFAULT_REFERENCE_BURST
from live.pipeline.consumer import Screen
from live.pipeline.event_log import EventLog
from live.pipeline.run_state import RunState
from live.results.folder import make_folder
from live.results.place_response import check_channel
from live.run.alarms import check_alarms
from live.run.outcome import StopSignal
from live.setup.devices import Rig
from live.setup.dry_run import dry_run
from live.setup.pictures import read_mask, with_flat_field, with_mask
from live.setup.prepared import MeasurePlan


@dataclass(frozen=True, slots=True, eq=False)
class PreparedRun:
    """All that a test needs before its first frame.

    Attributes
    ----------
    rig : Rig
        Open, not yet entered.
    plan : MeasurePlan
        With the final configuration; mask, dark and flat frame are in ``folder``.
    bursts : (reference, measured)
        Frames in each.
    folder : Path
        Of the files.
    start : ClockPair
        Time zero of all files.
    """

    rig: Rig
    plan: MeasurePlan
    bursts: tuple[int, int]
    folder: Path
    start: ClockPair

    @property
    def config(self) -> Config:
        """The final configuration."""
        return self.plan.config

    def announcement(self) -> Iterator[str]:
        """The lines on the devices, their warnings, and the folder of the files."""
        c, cell = self.rig.camera.info, self.rig.load.info
        fps = Message(", {fps:g} frames/s", c.fps) if c.fps else ""
        yield Message(
            "camera: {name}, {width} x {height} px, {bits} bits{fps}", c.name, c.width, c.height, c.bits, fps
        )
        yield Message("load cell: {name}", cell.name)
        yield from (Message("warning: {what}", warning) for warning in (*c.warnings, *cell.warnings))
        yield Message("files: {folder}", self.folder)


def new_run_state(config: Config, screen: Screen, *, both_sides: bool = False) -> RunState:
    """The state of a test, or of one side of it (``both_sides``), whose devices are opened next.

    Raises
    ------
    ConfigError
        No camera is given, or an alarm is not possible.
    """
    if not config.camera.address:
        raise ConfigError("no camera is given; use --camera ADDRESS (phasedic devices lists what is there)")
    check_alarms(config, both_sides=both_sides)
    with_load = config.load.address != "none:"
    run_state = RunState.new(config.load.max_gap_s, config.load.lag_s, config.specimen, with_load=with_load)
    run_state.event_log.names |= _device_names(config)
    screen.print(Message("opening {address}", config.camera.address))
    return run_state


def _device_names(config: Config) -> dict[str, str]:
    """Names of camera and load cell on the screen, by address; none where both have the same address."""
    names: dict[str, str] = {
        config.load.address: Message("load cell"),
        config.camera.address: Message("camera"),
    }
    return names if len(names) == 2 else {}


def set_up(config: Config, rig: Rig, event_log: EventLog, screen: Screen, stop: StopSignal) -> PreparedRun:
    """Make the grid, compile, run everything once, and make the folder.

    Raises
    ------
    ConfigError, DataError
        A setting does not fit, or a file cannot be read or made.
    Interrupted
        ``stop`` was requested while loops were compiled.
    """
    camera = rig.camera.info
    plan = MeasurePlan.of(config, camera, _mask(config, rig))
    check_channel(plan.config, forces=config.load.address != "none:")
    bursts = _burst_lengths(config, camera.live)
    took = plan.compile(camera, screen, stop)
    if took > 0:
        screen.print(Message("everything is compiled ({took:.0f} s)", took))
    compile_loops()
    dry_run(camera, plan.kernel_grid, plan.settings, bursts)
    folder = make_folder(config.output.dir, datetime.datetime.now(datetime.UTC))
    in_force = with_flat_field(with_mask(config, plan.mask, folder), folder)
    return PreparedRun(rig, replace(plan, config=in_force), bursts, folder, _time_zero(rig, event_log))


def _mask(config: Config, rig: Rig) -> NDArray[np.bool_] | None:
    """The configured mask, or that of a simulated specimen."""
    path = config.measure.mask
    if path is None and rig.specimen is not None:
        mask = RecordMode(crop=config.camera.crop).cut(rig.specimen.mask())
        return None if mask.all() else mask
    return read_mask(path, rig.camera.info.width, rig.camera.info.height)


def _burst_lengths(config: Config, live: bool) -> tuple[int, int]:
    """Frames in the reference and in a measured burst."""
    m = config.measure
    reference = m.reference_burst or (DEFAULT_REFERENCE_BURST if live else 1)
    return reference, m.burst or (DEFAULT_BURST if live else 1)


def _time_zero(rig: Rig, event_log: EventLog) -> ClockPair:
    """Now; pictures with nominal times begin at 0 whatever the clock says."""
    now = ClockPair.now()
    if rig.camera.info.clock != "nominal":
        return now
    event_log.origin = now.monotonic
    return ClockPair(0.0, now.utc)
