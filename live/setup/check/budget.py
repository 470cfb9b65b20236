"""The budget of E before a test: what is given, the noise of the pictures, and what is not stated."""

from __future__ import annotations

import math

from acquire.text import Message
from acquire.text.message import joined
from live.config.loading import Config
from live.pipeline.measurement import AXIAL
from live.results.budget import CameraView, budget_cells, budget_rows
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
    expected = config.specimen.modulus_GPa or math.nan
    rows = budget_rows(shares, strain, expected, view, stresses=config.specimen.area_m2 is not None)
    head = Message(
        "budget of E, standard uncertainties, at a strain of {strain:.2%} (scatter: of one value)", strain
    )
    return [head, *(_line(*cells) for cells in budget_cells(rows, "GPa", 1.0))]


def _line(cause: str, *cells: str) -> str:
    if not cells[1]:
        return Message("  {cause:<22} {words}", cause, cells[0])
    return joined(" ", (Message("  {cause:<22}", cause), *(Message("{cell:>8}", cell) for cell in cells)))


def _noise(figures: CheckFigures) -> float:
    """Of the gauge along the load, else of the mean of the region."""
    known = {gauge.name: gauge.sigma for gauge in figures.gauges}
    return known.get(AXIAL, known.get("", math.nan))
