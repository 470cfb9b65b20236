"""Each line of a check for made-up figures: its limit, its number and what it advises."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.quality.pattern import Depth, Exposure
from analysis.quality.steadiness import Steadiness
from live.setup.check.lines import CheckLine, advice, motion_lines
from live.setup.check.noise_floor import GaugeNoise, StrainNoise, ZoiFloor
from live.setup.check.sample import MIN_FRAMES
from live.setup.check.verdict import (
    _bits,
    _camera,
    _floor,
    _gauges,
    _light,
    _load,
    _pattern,
    _sharpness,
    _sssig,
    check_lines,
)

CALM = Steadiness(0.0, 0.0, 0.0, None, 4.0, 30.0)


def made(**given: Any) -> Any:
    """Figures of a good picture of 8 bits, except for what is given."""
    grid = SimpleNamespace(n_active=200)
    ones = np.ones((2, 2))
    zois = SimpleNamespace(
        contrast=25.5 * ones, sssig=4e4 * ones, sharpness=0.3 * ones, sigma=1e-4 * ones, without_pattern=0.0,
        grid=grid,
    )  # fmt: skip
    camera = SimpleNamespace(warnings=(), saturation=255)
    figures = {
        "stack": Stack(camera=camera, lost=0, few=False, count_text="1 picture"),
        "automatic": (), "removed": None, "blocks": False, "picture": "", "repetition": "", "lens": "",
        "exposure": Exposure(0.1, 0.4, 0.8, 0.0, 0.0, 0.0), "depth": Depth(8, 0, 0), "noise": 1.0,
        "noise_stated": False, "radius": 2.0, "zois": zois, "load": None, "gauges": (), "floors": (),
        "floor": None, "zoi": 64, "order": 1, "burst": 4, "sharpness": 0.3,
        "still": SimpleNamespace(
            light=CALM, u=CALM, v=CALM, exx=CALM, eyy=CALM, drift_px=0.0, dilatation=0.0, keystone=(0.0, 0.0),
            worse=CALM, worse_strain=CALM,
        ),
    }  # fmt: skip
    for name, value in given.items():
        part, _, key = name.partition("__")
        if key:
            setattr(figures[part], key, value)
        else:
            figures[part] = value
    return SimpleNamespace(**figures)


class Stack(SimpleNamespace):
    """Of 64 frames."""

    def __len__(self) -> int:
        return 64


def exposed(**values: float) -> Exposure:
    return Exposure(
        **{"low": 0.1, "mean": 0.4, "high": 0.8, "saturated": 0.0, "dark": 0.0, "piled": 0.0} | values
    )


def found(lines: Any) -> dict[str, CheckLine]:
    return {line.what: line for line in lines}


def test_a_good_picture_has_no_line_to_look_at() -> None:
    figures = made()
    for part in (_camera, _light, _pattern):
        assert [line.text() for line in part(figures) if not line.good or not line.measured] == []
    assert all(line.good for line in motion_lines(figures, 0.05))
    assert found(_camera(figures))["automatic controls"].value == "none"


@pytest.mark.parametrize(
    ("given", "what", "shown"),
    [
        ({"dark": 0.0101}, "black pixels", "1.0% at zero"),
        ({"dark": 0.0100}, "", ""),
        ({"piled": 0.0011}, "clipped below the top", "0.1% at one highest level"),
        ({"piled": 0.0010}, "", ""),
    ],
)
def test_pixels_at_zero_and_at_one_level_below_the_top_are_told(
    given: dict[str, float], what: str, shown: str
) -> None:
    bad = [line for line in _light(made(exposure=exposed(**given))) if not line.good]
    assert [(line.what, line.value) for line in bad] == ([(what, shown)] if what else [])


def test_the_light_is_given_in_parts_of_full_scale() -> None:
    lines = found(_light(made(exposure=exposed(low=0.07, high=0.3, saturated=1e-4))))
    assert lines["light"].value == "1 % to 99 % of the pixels from 7% to 30% of full scale"
    assert lines["light"].good and lines["saturated pixels"].good
    lines = found(_light(made(exposure=exposed(high=0.29, saturated=1.1e-4))))
    assert not lines["light"].good and not lines["saturated pixels"].good
    assert lines["noise"].value == "1.00 GL of one frame, 0.39% of full scale"
    assert not found(_light(made(noise=0.0)))["noise"].good


@pytest.mark.parametrize(
    ("depth", "value", "words"),
    [
        (Depth(12, 0, 0), "12 of 12 change", ""),
        (Depth(12, 1, 0), "11 of 12 change", ""),
        (Depth(12, 2, 0), "10 of 12 change", "the highest 2 are never used: "),
        (Depth(12, 0, 1), "11 of 12 change", "the lowest 1 never change: "),
        (Depth(12, 2, 1), "9 of 12 change", "the highest 2 are never used: "),
    ],
)
def test_bits_that_never_change_are_counted(depth: Depth, value: str, words: str) -> None:
    line = _bits(made(depth=depth))
    assert (line.value, line.good) == (value, not words) and line.advice.startswith(words)


@pytest.mark.parametrize(
    ("radius", "good", "advice_words"),
    [
        (1.49, False, "coarser speckle"), (1.5, True, ""), (4.0, True, ""), (4.01, False, "finer speckle"),
        (math.nan, False, "coarser speckle"),
    ],
)  # fmt: skip
def test_the_radius_of_the_speckle(radius: float, good: bool, advice_words: str) -> None:
    line = found(_pattern(made(radius=radius)))["speckle radius"]
    assert line.good == good and (good or line.advice.startswith(advice_words))
    shown = "none is visible" if math.isnan(radius) else f"{radius:.2f} px"
    assert line.value == f"{shown} (from 1.5 to 4)"


@pytest.mark.parametrize(("share", "good"), [(0.02, True), (0.021, False), (1.0, False)])
def test_the_share_of_zois_without_pattern(share: float, good: bool) -> None:
    line = found(_pattern(made(zois__without_pattern=share)))["ZOIs without pattern"]
    assert line.good == good
    assert line.value == ("all" if share == 1 else f"{share:.1%} of 200")
    assert ("spray" in line.advice) == (share == 1)


def test_contrast_is_the_median_over_full_scale() -> None:
    contrast = np.array([[25.5, 51.0, np.nan], [25.5, 255.0, 12.75]])
    assert found(_pattern(made(zois__contrast=contrast)))["contrast (std)"].value == "10.0% of full scale"
    for value, good in ((12.75, False), (13.0, True)):  # the limit itself is too little
        assert found(_pattern(made(zois__contrast=np.full((2, 2), value))))["contrast (std)"].good == good


def test_without_any_pattern_sharpness_and_gradients_are_none() -> None:
    nothing = np.full((2, 2), np.nan)
    assert _sharpness(made(zois__sharpness=nothing)).value == "no pattern is visible"
    for values in (nothing, np.zeros((2, 2))):
        line = _sssig(made(zois__sssig=values))
        assert (line.value, line.good) == ("none", False)


def test_the_weakest_gradients_give_the_noise_of_a_place() -> None:
    """sqrt(2) times 2 GL over the square root of 400 GL^2/px^2 are 0.141 px."""
    values = np.r_[np.full(10, 400.0), np.full(90, 1e4)].reshape(10, 10)
    line = _sssig(made(zois__sssig=values, noise=2.0))
    assert (
        line.value == "median 10\u202f000, weakest 5 % 400 GL^2/px^2 (0.1414 px in one frame)"
        and not line.good
    )
    for noise_px, good in ((0.049, True), (0.051, False)):
        assert _sssig(made(zois__sssig=np.full((2, 2), 2 / noise_px**2))).good == good


@pytest.mark.parametrize(
    ("name", "value", "what", "good", "shown"),
    [
        ("keystone", (4.9e-5, 0.0), "tilt", True, "strain drifts by 49 µm/m from left to right"),
        ("keystone", (-5.1e-5, 0.0), "tilt", False, "strain drifts by −51 µm/m from left to right"),
        ("keystone", (0.0, -4.9e-5), "tilt", True, "strain drifts by −49 µm/m from top to bottom"),
        ("keystone", (0.0, 5.1e-5), "tilt", False, "strain drifts by 51 µm/m from top to bottom"),
        ("dilatation", -5.1e-5, "distance", False, "exx and eyy drift alike, −51 µm/m: it changes by 5.1e-05"),
        ("dilatation", 4.9e-5, "distance", True, "exx and eyy drift alike, 49 µm/m: it changes by 4.9e-05"),
        ("drift_px", 0.0501, "drift", False, "0.0501 px and 0 µm/m in 4 s"),
        ("drift_px", 0.05, "drift", True, "0.0500 px and 0 µm/m in 4 s"),
        ("exx", Steadiness(-3e-5, 0, 0, None, 4.0, None), "drift", True, "0.0000 px and −30 µm/m in 4 s"),
        ("eyy", Steadiness(4e-5, 0, 0, None, 4.0, None), "drift", True, "0.0000 px and 40 µm/m in 4 s"),
        ("exx", Steadiness(-1.9e-5, 0, 0, None, 4.0, None, 1e-6), "drift", True, "0.0000 px and −19 µm/m in 4 s"),
        ("exx", Steadiness(-2.1e-5, 0, 0, None, 4.0, None, 4e-6), "drift", False, "0.0000 px and −21 µm/m in 4 s"),
        ("eyy", Steadiness(9.75e-4, 0, 0, None, 4.0, None, 2e-4), "drift", True, "0.0000 px and 975 µm/m in 4 s"),
        ("eyy", Steadiness(9.75e-4, 0, 0, None, 4.0, None, 1.9e-4), "drift", False, "0.0000 px and 975 µm/m in 4 s"),
        ("worse", Steadiness(0, 0.0501, 0, None, 4.0, None), "vibration", False, "0.0501 px rms"),
        ("worse", Steadiness(0, 0.05, 0, None, 4.0, None), "vibration", True, "0.0500 px rms"),
        ("worse_strain", Steadiness(0, 2e-5, 0, None, 4.0, None), "vibration", True,
         "less than 0.0000 px, 20 µm/m rms"),
    ],
)  # fmt: skip
def test_motion_has_its_numbers_and_limits(name: str, value: Any, what: str, good: bool, shown: str) -> None:
    line = found(motion_lines(made(**{f"still__{name}": value}), 0.05))[what]
    assert line.good == good and line.value.startswith(shown)


def test_what_does_not_drift_has_no_line_of_its_own() -> None:
    assert list(found(motion_lines(made(), 0.05))) == ["drift", "vibration"]
    assert list(found(motion_lines(made(lens="a lens"), 0.05))) == ["lens", "drift", "vibration"]
    both = found(motion_lines(made(still__keystone=(1e-5, 1e-5)), 0.05))
    assert list(both) == ["drift", "tilt", "vibration"]


@pytest.mark.parametrize(("share", "good"), [(0.99, True), (1.0, False)])
def test_motion_that_is_not_known_is_bad_only_without_any_pattern(share: float, good: bool) -> None:
    (line,) = motion_lines(made(still__drift_px=math.nan, zois__without_pattern=share), 0.05)
    assert (line.what, line.value, line.good) == ("drift", "not measured", good)


def test_the_largest_accepted_motion_is_that_of_the_test() -> None:
    figures = made(still__drift_px=0.08, region=SimpleNamespace(words="all"))
    for limit, good in ((0.07, False), (0.09, True)):
        assert found(check_lines(figures, None, limit))["drift"].good == good
    assert not found(check_lines(figures))["drift"].good, "0.05 px where nothing is given"


def test_a_load_cell_that_is_not_ready_is_told_with_its_remarks() -> None:
    for ready in (True, False):
        load = SimpleNamespace(
            rate=49.876, noise_N=0.1234, mean_text="12.5", ready=ready, remarks=("slow", "it drifts")
        )
        (line,) = _load(made(load=load))
        assert (line.what, line.good, line.advice) == ("load cell", ready, "slow; it drifts")
        assert line.value == "49.88 1/s, noise 0.123 N, mean 12.5 N"
    assert list(_load(made())) == []


def test_the_noise_of_gauges_is_in_microstrain_and_one_without_zois_is_bad() -> None:
    gauges = (
        GaugeNoise("", 2.34e-6),
        GaugeNoise("axial", 5e-6),
        GaugeNoise("hole", math.nan, "no ZOI is there"),
        GaugeNoise("edge", 6e-6, part="gauge edge: half of it is off"),
    )
    assert [(line.what, line.value, line.good) for line in _gauges(made(gauges=gauges))] == [
        ("noise of the region", "2.3 µm/m predicted (burst of 4)", True),
        ("noise of axial", "5.0 µm/m predicted (burst of 4)", True),
        ("noise of hole", "no ZOI is there", False),
        ("noise of edge", "6.0 µm/m predicted (burst of 4)", True),
        ("gauge", "gauge edge: half of it is off", False),
    ]


def floor_of(predicted: float, measured: float) -> ZoiFloor:
    return ZoiFloor(64, 1, 140.0, 45.0, 50, (StrainNoise(4, predicted, measured),), 32)


@pytest.mark.parametrize(
    ("floor", "target", "good", "words"),
    [
        (
            floor_of(1e-4, 1.5e-4),
            1.5e-4,
            True,
            "150 µm/m measured, 100 µm/m predicted (one ZOI of 64 px, burst of 4)",
        ),
        (floor_of(1e-4, 1.51e-4), 1e-3, False, "151 µm/m measured, 100 µm/m predicted"),
        (floor_of(1e-4, math.nan), 1e-4, True, "100 µm/m measured, 100 µm/m predicted"),
        (floor_of(2e-4, 1.2e-4), 1.1e-4, False, "120 µm/m measured, 200 µm/m predicted"),
        (floor_of(1e-3, 1e-3), None, True, "1\u202f000 µm/m measured"),
        (floor_of(1.01e-3, 1.01e-3), None, False, "1\u202f010 µm/m measured"),
        (None, 1e-4, True, "100 µm/m predicted (one ZOI"),
        (None, 0.9e-4, False, "100 µm/m predicted (one ZOI"),
        (floor_of(1e-4, 1.6e-4), 1e-3, False, "160 µm/m measured, 100 µm/m predicted"),
    ],
)
def test_the_strain_noise_is_that_of_the_test_against_its_limit(
    floor: ZoiFloor | None, target: float | None, good: bool, words: str
) -> None:
    line = _floor(made(floor=floor), target)
    assert line.good == good and line.value.startswith(words)


def test_without_any_noise_the_zois_are_too_few() -> None:
    line = _floor(made(zois__sigma=np.full((2, 2), np.nan)), None)
    assert (line.value, line.good) == ("not measured: too few ZOIs of 64 px", False)


def test_pictures_that_are_few_leave_open_what_changes_in_time() -> None:
    figures = made(stack__few=True)
    open_lines = [line for line in (*_light(figures), *motion_lines(figures, 0.05)) if not line.measured]
    assert [line.what for line in open_lines] == ["flicker", "noise in time", "drift", "vibration"]
    assert all(
        line.good and line.value.endswith(f"it takes {MIN_FRAMES} of the still specimen")
        for line in open_lines
    )
    assert found(_light(figures))["noise"].value.endswith("of full scale, from the spectrum of the picture")
    assert found(_light(made(stack__few=True, noise_stated=True)))["noise"].value.endswith(", as given")


def test_what_a_camera_and_its_corrections_show() -> None:
    figures = made(
        stack__lost=3, automatic=("gain_auto", "focus_auto"), removed=1.234, picture="bands", blocks=True
    )
    lines = found(_camera(figures))
    assert (lines["frames lost"].value, lines["frames lost"].good) == ("3 between the 64 looked at", False)
    assert (lines["automatic controls"].value, lines["automatic controls"].good) == (
        "gain_auto, focus_auto",
        False,
    )
    assert lines["automatic controls"].advice == "put on manual: gain_auto, focus_auto"
    assert lines["fixed pattern"].value.startswith("dark and flat corrected 1.23 GL;")
    assert "compression" in lines and "picture" not in lines
    told = found(
        _camera(made(stack__camera=SimpleNamespace(warnings=("its gain is automatic",), saturation=255)))
    )
    assert told["camera"].text() == "?     camera                 its gain is automatic"


def advised(target: float, noise: float, high: float, *, floors: bool = True) -> str:
    """Of one size of ZOI with a burst of 4 and a reference of 32."""
    floor = ZoiFloor(64, 1, 140.0, 45.0, 50, (StrainNoise(4, noise, noise),), 32)
    return advice(made(floor=floor, floors=(floor,) if floors else (), exposure=exposed(high=high)), target)


def test_a_burst_beyond_the_table_counts_the_noise_of_the_reference() -> None:
    """One frame: sigma^2 / (1/32 + 1/4); the target 2 of 3: 1/n = 4/9 * (9/32) - 1/32 = 3/32."""
    assert advised(2e-4, 3e-4, 0.95).startswith("burst 11 with ZOI 64, or ")
    # Below the noise of the reference alone, 1/3 of 3: 2 * 9 / (9/32) = 64 frames in both.
    assert advised(1e-4, 3e-4, 0.95).startswith("burst 64 and a reference of 64 with ZOI 64, or ")
    assert advised(2e-5, 3e-4, 0.95).startswith("15.0 times the contrast"), "1600 frames in both are too many"
    assert advised(2e-4, 3e-4, 0.95, floors=False).startswith("burst 11")


@pytest.mark.parametrize(
    ("target", "high", "words"),
    [
        (50, 0.2, "burst 16, or ZOI 96, or 4.0 times the light or exposure"),
        (71, 0.4, "burst 8, or ZOI 96, or twice the light or exposure"),
        (
            50,
            0.9,
            "burst 16, or ZOI 96, or 1.9 times the contrast (light helps 1.1 times, then it saturates)",
        ),
        (30, 0.5, "ZOI 96 and burst 16, or burst 80 and a reference of 80 with ZOI 64"),
    ],
)
def test_what_reaches_a_target_is_the_least_of_each_kind(target: float, high: float, words: str) -> None:
    floors = tuple(
        ZoiFloor(
            zoi, 1, 2.2 * zoi, 0.7 * zoi, 50, tuple(StrainNoise(n, v * 1e-6, v * 1e-6) for n, v in noises), 32
        )
        for zoi, *noises in (
            (32, (1, 800), (2, 560), (4, 400), (8, 290), (16, 220)),
            (64, (1, 200), (2, 140), (4, 100), (8, 70), (16, 49)),
            (96, (1, 90), (2, 64), (4, 45), (8, 33), (16, 24)),
        )
    )
    figures = made(floors=floors, floor=floors[1], exposure=exposed(high=high))
    assert advice(figures, target * 1e-6).startswith(words)


def test_light_helps_until_it_saturates() -> None:
    words = advised(2e-4, 3.1e-4, 0.39).rpartition(", or ")[2]
    assert words == "2.4 times the light or exposure", "(3.1/2)^2 of 2.44"
    words = advised(2e-4, 3.1e-4, 0.4).rpartition(", or ")[2]
    assert words == "1.0 times the contrast (light helps 2.4 times, then it saturates)"
    words = advised(1e-4, 3e-4, 1.0).rpartition(", or ")[2]
    assert words == "3.0 times the contrast (light helps 0.9 times, then it saturates)"
    assert advised(2e-4, 2e-4 * 1.45, 0.3).endswith("twice the light or exposure")


def test_where_nothing_is_known_of_the_burst_of_the_test_the_table_is_named() -> None:
    assert advice(made(), 1e-5) == "the table of phasedic check shows what reaches it"
    other = ZoiFloor(32, 1, 70.0, 22.0, 50, (StrainNoise(4, 1e-4, 1e-4),), 32)
    assert advice(made(floors=(other,)), 1e-5).startswith("nothing here reaches it: ")
    assert advice(made(floors=(other,)), 2e-4) == "ZOI 32"


def test_a_strain_that_is_clear_is_told_before_a_larger_one_of_noise() -> None:
    clear, noise = (
        Steadiness(3e-5, 0, 0, None, 4.0, None, 1e-6),
        Steadiness(5e-5, 0, 0, None, 4.0, None, 2e-5),
    )
    line = found(motion_lines(made(still__exx=clear, still__eyy=noise), 0.05))["drift"]
    assert (
        not line.good
        and "30 µm/m" in line.value
        and line.advice.startswith("strain changes: stop the machine")
    )
