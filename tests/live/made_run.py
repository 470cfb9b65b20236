"""Folders of finished runs, made up: real files, invented numbers."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from acquire.clock import ClockPair
from acquire.events import Event, EventKind
from acquire.load_sample import LoadCellInfo, LoadSample
from acquire.record_mode import RecordMode
from acquire.session import SessionInfo, SessionWriter
from analysis.evaluate import GaugeSet
from analysis.field.strain_field import StrainField
from live.config.gauges import gauges_for
from live.config.loading import from_dict
from live.config.sections import SpecimenConfig
from live.pipeline.measurement import Measurement
from live.pipeline.run_state import RunState
from live.results import Results, ResultsInfo
from live.results.finished.finished_test import FinishedTest
from tests.live.made_up import CAMERA, START, make_field, make_frame, make_grid, make_measurement

E_PA, YIELD, HARDENING_PA, WIDTH_MM, THICKNESS_MM = 70e9, 0.003, 1e8, 10.0, 2.0
UTC_START = datetime(2030, 1, 2, 3, 4, 5, tzinfo=UTC)
PULLED = tuple(float(e) for e in (*[0.0] * 8, *np.linspace(5e-5, 3.2e-3, 64), *np.linspace(3.4e-3, 8e-3, 24)))
"""Mean axial strain by instant: still at first, then pulled beyond yield."""
CONFIG: dict[str, Any] = {
    "camera": {"address": "sim:made-up"},
    "measure": {"zoi": 32, "step": 16, "order": 1, "window": "gaussian"},
    "specimen": {"width_mm": WIDTH_MM, "thickness_mm": THICKNESS_MM, "axis": "y"},
}

GAUGES: dict[str, Any] = {
    "axial": {"kind": "line", "start": [64, 20], "end": [64, 76]},
    "shear": {"kind": "area", "box": [40, 30, 50, 40], "value": "exy"},
}
"""Virtual gauges for ``config``: an extensometer and a shear."""

FieldOf = Callable[[int, float], StrainField]


def force_of(strain: float) -> float:
    """N; elastic, then all but flat."""
    stress = E_PA * min(strain, YIELD) + HARDENING_PA * max(strain - YIELD, 0.0)
    return stress * WIDTH_MM * THICKNESS_MM * 1e-6


def finished(
    run_state: RunState, specimen: SpecimenConfig | None = None, reference_N: float = math.nan
) -> FinishedTest:
    """The test of a run that has ended; without gauges."""
    return FinishedTest.of_run(run_state, specimen or run_state.specimen, {}, reference_N)


def make_run(
    folder: Path,
    strains: Sequence[float] = PULLED,
    *,
    session: bool = True,
    field_of: FieldOf | None = None,
    config: Mapping[str, Any] = CONFIG,
    metadata: Mapping[str, Any] | None = None,
) -> Path:
    """A folder with ``strain.h5``, ``strain.csv`` and ``session.h5``; returns it."""
    metadata = {"specimen": "S1", "operator": "Zoé"} if metadata is None else metadata
    _write_results(folder, strains, field_of or noisy, config, metadata)
    if session:
        _write_session(folder, strains, config, metadata)
    return folder


def noisy(number: int, strain: float, sigma: float = 1e-5, stated: float | None = None) -> StrainField:
    """Tension with noise ``sigma`` (px and strain) whose stored uncertainty is ``stated``."""
    grid, rng = make_grid(), np.random.default_rng(number)
    plain = make_field(grid, strain)
    names = ("u", "v", "du_dx", "du_dy", "dv_dx", "dv_dy")
    values = {n: np.nan_to_num(getattr(plain, n)) + rng.normal(0, sigma, grid.shape) for n in names}
    # The shear is the mean of two gradients that scatter independently.
    return StrainField.from_values(grid, values, sigma if stated is None else stated, status=plain.status)


def _write_results(
    folder: Path,
    strains: Sequence[float],
    field_of: FieldOf,
    config: Mapping[str, Any],
    metadata: Mapping[str, Any],
) -> None:
    area = WIDTH_MM * THICKNESS_MM * 1e-6 if config.get("specimen", {}).get("width_mm") else None
    info = ResultsInfo(
        START,
        UTC_START.isoformat(),
        config,
        metadata,
        {"phasedic": "0.1.0", "python": "3.11"},
        CAMERA,
        area_m2=area,
        gauges=config.get("gauges", {}),
    )
    gauges = gauges_for(
        from_dict({"gauges": config.get("gauges", {})}, {}, "made up").gauges, "y", make_grid()
    )
    with Results(folder, make_grid(), info) as results:
        for k, strain in enumerate(strains):
            burst, field = make_measurement(k, strain).burst, field_of(k, strain)
            values = GaugeSet(gauges).read(field)
            results.add(Measurement.of(k, burst, field, force_of(strain), gauges=values))


def session_writer(
    folder: Path,
    config: Mapping[str, Any],
    metadata: Mapping[str, Any],
    mode: RecordMode | None = None,
) -> SessionWriter:
    """A new ``session.h5``."""
    info = SessionInfo(
        camera=CAMERA,
        load=LoadCellInfo("/dev/ttyUSB0", "made-up cell", "ascii", capacity_N=5000.0),
        start=ClockPair(START, UTC_START),
        config=config,
        metadata=metadata,
        versions={"phasedic": "0.1.0"},
        mode=mode or RecordMode(),
    )
    return SessionWriter(folder / "session.h5", info)


def _write_session(
    folder: Path, strains: Sequence[float], config: Mapping[str, Any], metadata: Mapping[str, Any]
) -> None:
    with session_writer(folder, config, metadata) as writer:
        writer.write_event(Event(START, EventKind.START, "phasedic", "the test begins"))
        for k, strain in enumerate(strains):
            t = START + 0.1 * k
            for sub in (3, 4):  # of the eight, those in the middle
                # Grey levels identify the frame: its number, from 100.
                frame = make_frame(8 * k + sub, t + 0.01 * (sub - 3.5))
                image = np.full_like(frame.image, 100 + 8 * k + sub)
                image.flags.writeable = False
                writer.write_frame(dataclasses.replace(frame, image=image))
            writer.write_load(LoadSample(t, force_of(strain)))
        reference = {"first": 0, "last": 7, "n": 8, "force_N": 0.0}
        writer.write_event(
            Event(START, EventKind.REFERENCE, "measurement", "reference: 8 frames", data=reference)
        )
        text = "<script>alert('5 > 3 & so on')</script>"
        writer.write_event(Event(START + 1.5, EventKind.NOTE, "operator", text, "warning"))
        grabbed = 8 * len(strains)
        writer.write_ledger({"grabbed": grabbed, "recorded": grabbed, "measured": grabbed, "lost": 0})
