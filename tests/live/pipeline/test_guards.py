"""Guards: from which blur, strain, tilt and picture on they speak, and their words."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from acquire.events import Event
from analysis import StrainField
from analysis.field.uncertainty import PictureError
from live.pipeline.guards import (
    BlurGuard,
    DilatationGuard,
    PictureGuard,
    StrainGuard,
    TiltGuard,
    _usual_sigma,
    picture_words,
)
from tests.live.made_up import in_ascii, make_measurement
from tests.live.pipeline.test_reference import GRID, seen


def field(sigma_xx: float = 30e-6, sigma_yy: float = 40e-6, **values: float) -> StrainField:
    return StrainField.from_values(GRID, {"u": 0.0, **values}, {"du_dx": sigma_xx, "dv_dy": sigma_yy})


def test_the_cost_of_a_picture_is_of_both_directions() -> None:
    assert _usual_sigma(field()) == pytest.approx(50e-6 / math.sqrt(2))
    costly = replace(field(), picture=PictureError(2.0, (1.0, 4.0), "bands"))
    assert picture_words(costly).endswith("uncertain by 35 µm/m, usually 9 µm/m")
    cheap = replace(field(), picture=PictureError(1.0, (1.0, 1.0), "filter"))
    assert picture_words(cheap).endswith("strain of a ZOI is uncertain by 35 µm/m")
    assert (
        picture_words(replace(field(), picture=PictureError(1.0, (1.0, 1.0)))) == picture_words(field()) == ""
    )


@pytest.mark.parametrize(("factor", "well"), [(1.27, True), (1.28, False)])
def test_a_picture_is_well_again_below_85_hundredths_of_the_limit(factor: float, well: bool) -> None:
    told: list[Event] = []
    guard, step = PictureGuard(told.append), make_measurement(0).time_step
    guard.check(replace(field(), picture=PictureError(3.0, (1.0, 1.0), "noise")), step)
    guard.check(replace(field(), picture=PictureError(3.0, (1.0, 1.0), "bands")), step)
    guard.check(replace(field(), picture=PictureError(factor, (1.0, 1.0), "")), step)
    guard.check(replace(field(), picture=PictureError(factor, (1.0, 1.0), "")), step)
    assert [event.level for event in told] == ["warning", "info"][: 1 + well]
    assert told[0].data == {"cause": "noise", "factor": 3.0, "over_noise": 3.0}


def test_of_a_field_without_zois_a_picture_guard_says_nothing() -> None:
    told: list[Event] = []
    lost = replace(seen(0.0, 0.0, 0), picture=PictureError(3.0, (1.0, 1.0), "noise"))
    PictureGuard(told.append).check(lost, make_measurement(0).time_step)
    assert told == []


@pytest.mark.parametrize(
    ("blur", "sigma", "told"),
    [(0.56, 0.02, False), (0.57, 0.02, True), (-0.57, 0.02, True), (0.501, 0.0, True), (0.5, 0.0, False)],
)
def test_a_blur_is_told_where_it_is_beyond_half_a_pixel_for_certain(
    blur: float, sigma: float, told: bool
) -> None:
    events: list[Event] = []
    step = replace(make_measurement(0).time_step, blur=blur, sigma_blur=sigma)
    BlurGuard(events.append).check(field(), step)
    assert bool(events) == told


def test_a_blur_names_its_cost_where_that_exceeds_the_limit_alone() -> None:
    step = replace(make_measurement(0).time_step, blur=0.8, sigma_blur=0.01)
    for factor, costs in ((1.5, False), (1.51, True)):
        events: list[Event] = []
        BlurGuard(events.append).check(
            replace(field(), picture=PictureError(factor, (1.0, 1.0), "blur")), step
        )
        assert ("is uncertain by" in events[0].text) == costs


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"du_dy": -math.radians(0.51), "dv_dx": math.radians(0.51)}, True),
        ({"du_dy": math.radians(0.49), "dv_dx": -math.radians(0.49)}, False),
        ({"du_dx": -0.0201}, True),
        ({"du_dx": -0.0199, "dv_dy": 0.0199}, False),
    ],
)
def test_small_strains_are_valid_up_to_half_a_degree_and_two_percent(
    values: dict[str, float], told: bool
) -> None:
    events: list[Event] = []
    StrainGuard("small", events.append).check(field(**values), make_measurement(0).time_step)
    assert bool(events) == told


def test_the_error_of_small_strains_is_half_the_squares_of_turn_and_strain() -> None:
    events: list[Event] = []
    StrainGuard("small", events.append).check(
        field(du_dy=-0.02, dv_dx=0.02, dv_dy=0.01), make_measurement(0).time_step
    )
    assert (
        "turned by 1.1 degrees, strained by 1.0%: small strains are off by about 248 µm/m" in events[0].text
    )
    assert events[0].data == {"rotation": pytest.approx(0.0199, rel=1e-3), "strain": pytest.approx(0.01)}


def test_small_strains_are_told_again_where_they_are_off_by_twice_as_much() -> None:
    events: list[Event] = []
    guard = StrainGuard("small", events.append)
    for turn in (0.035 * k / 19 for k in range(20)):
        guard.check(field(du_dy=-turn, dv_dx=turn), make_measurement(0).time_step)
    turns = [event.data["rotation"] for event in events]
    assert len(turns) == 4 and turns[-1] == pytest.approx(0.03, abs=0.005)


def step_of(exx: float, eyy: float, sigma: float = 0.0) -> Any:
    return replace(make_measurement(0).time_step, exx=exx, eyy=eyy, sigma_exx=sigma, sigma_eyy=sigma)


@pytest.mark.parametrize(
    ("false", "axial", "sigma", "told"),
    [
        (21e-6, 0.0, 0.0, True), (19e-6, 0.0, 0.0, False),
        (37e-6, 0.9e-3, 0.0, False), (40e-6, 0.9e-3, 0.0, True),  # 2 % of the strain added
        (40e-6, 0.0, 6.2e-6, False), (41e-6, 0.0, 6.2e-6, True),  # 4 of 5.0 um/m
        (-60e-6, 0.5e-3, 0.0, True), (60e-6, 1.1e-3, 0.0, False),
    ],
)  # fmt: skip
def test_a_false_strain_is_told_beyond_its_limit(
    false: float, axial: float, sigma: float, told: bool
) -> None:
    """sigma of it: 6.2 um/m * sqrt(1 + 0.3^2) / 1.3 are 4.98 um/m."""
    events: list[Event] = []
    step = step_of(-0.3 * axial + false, axial + false, sigma)
    DilatationGuard(0.3, None, events.append).check(field(), step)
    assert bool(events) == told
    if told:
        assert events[0].data["strain"] == pytest.approx(false)
        assert events[0].data["sigma"] == pytest.approx(sigma * math.hypot(1, 0.3) / 1.3)


@pytest.mark.parametrize(
    ("exx", "eyy", "sigma", "told"),
    [(21e-6, 21e-6, 0.0, True), (19e-6, 19e-6, 0.0, False), (49e-6, 49e-6, 1e-5, False), (51e-6, 51e-6, 1e-5, True),
     (2e-3, 2e-3, 0.0, True), (-30e-6, -30e-6, 0.0, True)],
)  # fmt: skip
def test_strains_that_are_alike_are_told_beyond_their_noise(
    exx: float, eyy: float, sigma: float, told: bool
) -> None:
    events: list[Event] = []
    TiltGuard(None, events.append).check(field(), step_of(exx, eyy, sigma))
    assert [event.data["strain"] for event in events] == ([pytest.approx(exx)] if told else [])
    assert (
        not told
        or f"exx and eyy are alike, {exx * 1e6:.0f} um/m: as from motion by {abs(exx):.1e}"
        in in_ascii(events[0].text)
    )
    silent: list[Event] = []
    TiltGuard(None, silent.append, dilatation=False).check(field(), step_of(exx, eyy, sigma))
    assert silent == []
