"""Everything that stands ready before the first frame of a test: devices, grid, settings, folder."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from acquire.clock import ClockPair
from acquire.hdf5 import compile_loops
from acquire.record_mode import RecordMode
from live.measure import Correction, Screen, kinds_of, rehearse
from live.run.stopping import Stop
from live.setup import (
    DEFAULT_BURST,
    DEFAULT_REFERENCE_BURST,
    Config,
    Rig,
    compile_ahead,
    correction,
    gauges_for,
    grid_for,
    kernel_settings,
    make_folder,
    read_mask,
    with_flat_field,
    with_mask,
)
from live.tell import Journal

if TYPE_CHECKING:
    from analysis import KernelSettings, ZoiGrid
    from analysis.evaluate import Gauge


@dataclass(frozen=True, slots=True, eq=False)
class Setting:
    """What a test is set up with.

    Attributes
    ----------
    config : Config
        In force; mask, dark and flat frame lie in ``folder``.
    rig : Rig
        Open, not yet entered.
    grid : ZoiGrid
    gauges : tuple of Gauge
    settings : KernelSettings
    correct : callable
        Takes the fixed pattern of the sensor out of a burst.
    bursts : (reference, measured)
        Frames in each.
    folder : Path
        Of the files.
    start : ClockPair
        Time zero of all files.
    """

    config: Config
    rig: Rig
    grid: ZoiGrid
    gauges: tuple[Gauge, ...]
    settings: KernelSettings
    correct: Correction
    bursts: tuple[int, int]
    folder: Path
    start: ClockPair


def set_up(config: Config, rig: Rig, journal: Journal, screen: Screen, stop: Stop) -> Setting:
    """Lay the grid, run everything once, and make the folder.

    Raises
    ------
    ConfigError, DataError
        Something does not fit, or cannot be read or made.
    Interrupted
        ``stop`` was asked while loops were compiled.
    """
    camera = rig.camera.info
    mask = _mask(config, rig)
    grid = grid_for(config, camera.width, camera.height, mask)
    gauges, settings = gauges_for(config.gauges, config.specimen.first_axis, grid), kernel_settings(config)
    correct = correction(config, camera)
    bursts = _burst_lengths(config, camera.live)
    _compile(kinds_of(camera), settings, screen, stop)
    rehearse(camera, grid, settings, bursts)
    folder = make_folder(config.output.dir, datetime.datetime.now(datetime.UTC))
    config = with_flat_field(with_mask(config, mask, folder), folder)
    return Setting(config, rig, grid, gauges, settings, correct, bursts, folder, _time_zero(rig, journal))


def _mask(config: Config, rig: Rig) -> NDArray[np.bool_] | None:
    """The mask that was given; a simulated specimen knows its own."""
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


def _compile(kinds: Sequence[str], settings: KernelSettings, screen: Screen, stop: Stop) -> None:
    phase = settings.estimator == "phase"
    took = compile_ahead(kinds, phase=phase, say=screen.status, stopped=lambda: stop.asked)
    if took > 0:
        screen.say(f"everything is compiled ({took:.0f} s)")
    compile_loops()


def _time_zero(rig: Rig, journal: Journal) -> ClockPair:
    """Now; pictures with nominal times begin at 0 whatever the clock says."""
    now = ClockPair.now()
    if rig.camera.info.clock != "nominal":
        return now
    journal.origin = now.monotonic
    return ClockPair(0.0, now.utc)
