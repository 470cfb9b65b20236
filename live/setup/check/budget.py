"""The budget of E before a test: what is given, the noise of the pictures, and what is not stated."""

from __future__ import annotations

import math

from live.config.loading import Config
from live.pipeline.measurement import AXIAL
from live.results.budget import CameraView, budget_rows
from live.results.figures import tensile_options
from live.setup.check.check_list import CheckFigures

ELASTIC = 1e-3
"""End of the elastic interval where the standard takes it from the yield strength, which the test finds."""


def budget_lines(figures: CheckFigures, config: Config) -> list[str]:
    """The table as text; nothing where no noise is known. Scatter is of one value: a line through many has less."""
    noise = _noise(figures)
    if math.isnan(noise):
        return []
    options = tensile_options(config.specimen)
    interval = options.standard.interval
    strain = interval.high if interval.by == "strain" else ELASTIC
    shares = {"scatter": noise / strain, **options.limits.shares(strain)}
    view = CameraView.of(config.camera, config.scale, plates=bool(config.plate))
    rows = budget_rows(shares, strain, 100.0, view, stresses=config.specimen.area_m2 is not None)
    head = f"budget of E, standard uncertainties, at a strain of {strain:.2%} (scatter: of one value)"
    found = [head, f"  {'':<22} {'µm/m':>8} {'% of E':>8}"]
    for row in rows:
        figure = row.words or f"{row.strain * 1e6:>8.3g} {row.modulus:>8.3g}"
        found.append(f"  {row.cause:<22} {figure}")
    return found


def _noise(figures: CheckFigures) -> float:
    """Of the gauge along the load, else of the mean of the region."""
    known = {gauge.name: gauge.sigma for gauge in figures.gauges}
    return known.get(AXIAL, known.get("", math.nan))
