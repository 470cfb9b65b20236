"""The budget of E before a test, from what is given and the predicted noise."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from live.config.loading import load_config
from live.results.budget import CameraView, budget_rows
from live.setup.check.budget import budget_lines
from live.setup.check.noise_floor import GaugeNoise


def lines(gauges: tuple[GaugeNoise, ...], **given: Any) -> dict[str, str]:
    """Cause to the rest of its line."""
    config = load_config(None, {key.replace("__", "."): value for key, value in given.items()})
    figures: Any = SimpleNamespace(gauges=gauges)
    return {line[2:24].strip(): line[24:].strip() for line in budget_lines(figures, config)[2:]}


def test_the_figures_by_value() -> None:
    gauges = GaugeNoise("axial", 5e-6), GaugeNoise("", 1e-6)
    found = lines(
        gauges, specimen__standard="iso527", specimen__area_mm2=10.0, specimen__force_error_percent=1.0,
        scale__stand_off_mm=400.0,
    )  # fmt: skip
    assert found["scatter"].split() == ["5", "0.2"]  # of 2500 um/m, and of E
    assert found["blur"] == "the test shows it"
    share = 1 / math.sqrt(3)
    assert [float(text) for text in found["load cell"].split()] == pytest.approx(
        [share * 25, share], rel=4e-3
    )
    assert found["section"] == "not stated: specimen.section_error_percent"
    assert found["motion off the plane"] == "not counted: 0.1 mm at 400 mm is 250 µm/m"
    assert float(found["combined"].split()[1]) == pytest.approx(math.hypot(0.2, share), rel=4e-3)


def test_in_gpa_where_a_modulus_is_expected() -> None:
    gauges = (GaugeNoise("axial", 5e-6),)
    found = lines(gauges, specimen__standard="iso527", specimen__modulus_GPa=70.0)
    assert found["scatter"].split() == ["5", "0.2", "0.14"]
    assert found["load cell"] == "not stated: specimen.force_error_percent"


def test_the_mean_of_the_region_without_a_gauge_along_the_load() -> None:
    found = lines((GaugeNoise("", 2e-6),), specimen__standard="iso6892")
    assert found["scatter"].split() == ["2", "0.2"]  # of 0.1 %
    assert "section" not in found
    assert found["strain"] == "not stated: specimen.strain_error_um_m"


def test_nothing_without_noise() -> None:
    assert lines(()) == {}


@pytest.mark.parametrize(
    ("readout_ms", "words"),
    [(None, "not stated: camera.readout_ms"), (0.0, "none"), (1.0, "removed"), (12.0, "removed")],
)
def test_the_rolling_shutter_is_removed_where_its_time_is_stated(
    readout_ms: float | None, words: str
) -> None:
    rows = budget_rows({"scatter": 0.01}, 1e-3, 100.0, CameraView(readout_ms=readout_ms), stresses=True)
    assert {row.cause: row.words for row in rows}["rolling shutter"] == words


def test_shares_combine_as_independent_ones_in_strain_and_in_the_modulus() -> None:
    shares = {"scatter": 0.03, "section": 0.04}
    found = {row.cause: row for row in budget_rows(shares, 2e-3, 70.0, CameraView(500.0), stresses=True)}
    assert (found["section"].strain, found["section"].modulus) == pytest.approx((8e-5, 2.8))
    assert (found["combined"].strain, found["combined"].modulus) == pytest.approx((1e-4, 3.5))
    assert found["motion off the plane"].words == "not counted: 0.1 mm at 500 mm is 200 µm/m"
