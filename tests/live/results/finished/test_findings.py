"""Mistakes of a set-up that the data of a test show: made tests with one mistake each, and tests without one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from acquire.load_sample import LoadSample
from acquire.text.quantity import Amount
from analysis.evaluate import Figure
from analysis.evaluate.seen import leap, leap_alike
from live.config.sections import SpecimenConfig
from live.pipeline.run_state import RunState
from live.results.finished.findings import SHOWN, doubts, findings
from live.results.finished.finished_test import FinishedTest
from live.results.stored_fields import Readings
from tests.live.made_run import finished
from tests.live.made_up import in_ascii, make_measurement

E_PA, NU, YIELD = 70e9, 0.3, 0.003
FLAT = SpecimenConfig(width_mm=10.0, thickness_mm=2.0, axis="y")
STRAINS = np.r_[np.zeros(20), np.linspace(0, 0.003, 80), np.linspace(0.0031, 0.02, 40)]
FPS = 10.0


def stress_of(strain: np.ndarray) -> np.ndarray:
    return E_PA * np.clip(strain, -YIELD, YIELD) + 1e9 * np.where(
        np.abs(strain) > YIELD, strain - np.sign(strain) * YIELD, 0
    )


def test_of(
    strains: np.ndarray = STRAINS,
    force: np.ndarray | None = None,
    *,
    specimen: SpecimenConfig = FLAT,
    nu: float = NU,
    turned: float = 0.0,
    moved: np.ndarray | float = 0.0,
    times: Sequence[float] | None = None,
    reference_N: float = 0.0,
) -> FinishedTest:
    """A test with these strains along a load that is turned by rad from y, and these forces, N, at ``times``, s.

    ``moved`` is the false strain of a motion along the line of sight.
    """
    rng, moved = np.random.default_rng(4), np.broadcast_to(moved, strains.shape)
    state = RunState.new(0.5, specimen=specimen)
    if force is None:
        force = stress_of(strains) * 20e-6
    c, s = math.cos(turned), math.sin(turned)
    for k, strain in enumerate(strains):
        m, across = make_measurement(k), -nu * strain
        one = {
            "exx": strain * s * s + across * c * c + moved[k],
            "eyy": strain * c * c + across * s * s + moved[k],
            "exy": (strain - across) * s * c,
        }
        noisy = {name: value + rng.normal(0, 2e-6) for name, value in one.items()}
        sigma = {f"sigma_{name}": 2e-6 for name in one}
        lengths = {"extension_y": noisy["eyy"], "extension_x": noisy["exx"]}
        step = replace(m.time_step, t=k / FPS, **noisy, **sigma, **lengths, misfit=1.0)
        state.history.add(step)
    scatter = 1e-4 * float(np.nanmax(np.abs(force))) if np.isfinite(force).any() else 0.0
    for k, value in enumerate(force):
        t = k / FPS if times is None else times[k]
        state.loads.append(LoadSample(t, float(value + rng.normal(0, scatter))))
    state.loads.close()
    return finished(state, specimen, reference_N)


test_of.__test__ = False  # type: ignore[attr-defined]


def outcomes(test: FinishedTest) -> dict[str, str]:
    return {one.name: one.outcome for one in findings(test)}


def first_doubt(test: FinishedTest) -> str:
    return doubts(findings(test))[0]


def test_a_test_without_a_mistake_has_no_doubt() -> None:
    found = findings(test_of())
    assert doubts(found) == []
    assert [one.name for one in found] == [
        "sign of the force",
        "modulus",
        "forces and pictures",
        "renewal of the force",
        "leaps of the force",
        "leaps of the strain",
        "lag",
        "alignment",
        "out of plane",
        "reference under load",
    ]
    assert {one.outcome for one in found if one.name != "lag"} == {"good"}


def test_a_force_of_the_wrong_sign_comes_first() -> None:
    text = first_doubt(test_of(force=-stress_of(STRAINS) * 20e-6))
    assert (
        text.startswith("the force is negative where the specimen gets longer") and "--load-sign -1" in text
    )
    text = first_doubt(test_of(-STRAINS, force=stress_of(STRAINS) * 20e-6))
    assert text.startswith("the force is positive where the specimen gets shorter")


def test_a_zero_that_moves_in_the_test_is_named_and_is_no_lag() -> None:
    whole = stress_of(STRAINS) * 20e-6
    test = test_of(force=whole + np.where(np.arange(len(whole)) >= 60, 400.0, 0.0))
    found = {one.name: one for one in findings(test)}
    assert in_ascii(found["leaps of the force"].text).startswith(
        "the force leaps by 399 N at 6 s and the strain does"
    )
    assert found["lag"].outcome == "not checked"


@pytest.mark.parametrize("left", [0.8, 0.9])
def test_a_force_that_leaps_in_the_elastic_part_of_few_pictures_is_named(left: float) -> None:
    """The grips or the load cell slip: E of all points was a quarter low, and called good."""
    strains = np.r_[np.arange(21) * 0.0125, 0.4, 1.0, 2.0, 3.0, 4.0] * YIELD
    force = stress_of(strains) * 20e-6
    assert outcomes(test_of(strains, force=force))["leaps of the force"] == "not checked"
    test = test_of(strains, force=np.where(np.arange(26) < 12, force, left * force))
    found = {one.name: one for one in findings(test)}["leaps of the force"]
    assert test.figures.E.known and found.outcome == "doubt" and "the force leaps by" in found.text


def test_a_display_that_is_renewed_slowly_is_named() -> None:
    t, rng = np.arange(0, 14, 1 / 80), np.random.default_rng(5)
    values = stress_of(np.interp(np.arange(0, 14, 0.4), np.arange(len(STRAINS)) / FPS, STRAINS)) * 20e-6
    shown = np.round(values + rng.normal(0, 1, len(values)), 1)[np.floor(t / 0.4 + 1e-9).astype(int)]
    found = {one.name: one for one in findings(replace(test_of(), samples=Readings.of(t, shown)))}
    words = in_ascii(found["renewal of the force"].text)
    assert "a new one every 0.4 s: forces are of up to 210 N before" in words
    live = replace(test_of(), samples=Readings.of(t, np.interp(t, np.arange(0, 14, 0.4), values)))
    assert outcomes(live)["renewal of the force"] == "good"


@pytest.mark.parametrize("per_s", [40.0, -40.0])
def test_a_zero_that_drifts_is_named(per_s: float) -> None:
    whole, t = stress_of(STRAINS) * 20e-6, np.arange(len(STRAINS)) / FPS
    found = {one.name: one for one in findings(test_of(force=whole + per_s * t))}["leaps of the force"]
    assert found.outcome == "doubt" and "of rest at first, and the strain does not" in found.text
    real = test_of(force=whole + per_s * t)
    off = real.figures.E.value / test_of(force=whole).figures.E.value - 1
    named = float(found.text.partition("changes E by ")[2].partition("%")[0].replace("\u2212", "-"))
    assert abs(off) > 0.05 and named == pytest.approx(100 * off, abs=1.5)
    assert outcomes(test_of(force=whole + 0.05 * per_s * t))["leaps of the force"] == "good", "less than 1 %"


def test_a_force_that_strains_the_specimen_before_the_pull_is_no_drift() -> None:
    """Grips that are closed, or a specimen that warms up between them."""
    strains = np.r_[np.linspace(0, 8e-6, 20), 8e-6 + STRAINS[20:]]
    assert outcomes(test_of(strains, force=stress_of(strains) * 20e-6))["leaps of the force"] == "good"


@pytest.mark.parametrize("at", [40, 60])
@pytest.mark.parametrize("tared", [False, True])
def test_a_force_that_is_tared_or_gets_another_unit_in_the_test_is_named_without_e(
    at: int, tared: bool
) -> None:
    """Its highest is no strength."""
    whole, k = stress_of(STRAINS) * 20e-6, np.arange(len(STRAINS))
    test = test_of(force=np.where(k >= at, whole - whole[at] if tared else whole / 9.80665, whole))
    found = {one.name: one for one in findings(test)}["leaps of the force"]
    assert not test.figures.E.known and test.figures.Rm.value < 0.8 * stress_of(STRAINS).max()
    assert found.outcome == "doubt" and "leaps by \u2212" in found.text


def test_a_specimen_that_breaks_or_yields_is_no_leap_of_the_force() -> None:
    strains = np.r_[np.zeros(20), np.linspace(0, 0.02, 100), np.linspace(0.02, 0.08, 10), np.full(10, 0.08)]
    stress = np.r_[np.minimum(E_PA * strains[:120], 2e8), 2e8 * np.linspace(1, 0.55, 10), np.zeros(10)]
    yielding = np.where(strains < 0.0015, E_PA * strains, 0.75 * 105e6)
    for one in (stress, yielding):
        test = test_of(strains, force=one * 20e-6)
        assert not test.figures.E.known and outcomes(test)["leaps of the force"] == "not checked"


def test_an_elastic_part_of_few_pictures_is_no_leap_of_the_force() -> None:
    strains = 0.06 * np.maximum(np.linspace(-0.4, 1, 100), 0)
    test = test_of(strains, force=np.interp(strains, (0, 2.5e-3, 0.06), (0, 3500, 6000)))
    assert leap(test.curve) and not test.figures.E.known, "seen from outside it looks like one"
    assert outcomes(test)["leaps of the force"] == "not checked"


def test_a_force_that_falls_out_is_no_lag() -> None:
    whole = stress_of(STRAINS) * 20e-6
    test = test_of(force=np.where(np.arange(len(whole)) >= 60, 1e-3, 1.0) * whole)
    lagging = replace(test, lag=Figure(0.2, 0.19, 0.21))
    assert outcomes(replace(test_of(), lag=lagging.lag))["lag"] == "doubt"
    assert "they fall to nothing" in test.figures.notes[0] and outcomes(lagging)["lag"] == "not checked"


@pytest.mark.parametrize(("at", "size"), [(30, -3e-4), (30, 3e-4), (60, -3e-4), (60, 2e-3), (120, 2e-3)])
def test_a_camera_that_is_knocked_or_focused_in_the_test_is_named(at: int, size: float) -> None:
    moved = np.where(np.arange(len(STRAINS)) >= at, size, 0.0)
    test = test_of(moved=moved)
    found, leaps = {one.name: one for one in findings(test)}["leaps of the strain"], leap_alike(test.curve)
    assert "moved along the line of sight" in found.text and leaps is not None
    assert leaps[0] == pytest.approx(at / FPS, abs=0.11)
    assert leaps[1:] == pytest.approx((size, size), rel=0.2)


def test_a_motion_that_is_slow_is_no_leap() -> None:
    found = outcomes(test_of(moved=np.linspace(0, 5e-4, len(STRAINS))))
    assert found["leaps of the strain"] == "good"


def test_a_test_in_compression_is_named() -> None:
    assert "in compression" in first_doubt(test_of(-STRAINS))


def test_a_cyclic_test_is_neither() -> None:
    strains = 0.002 * np.sin(np.linspace(0, 6 * math.pi, 200))
    assert outcomes(test_of(strains))["sign of the force"] == "good"


@pytest.mark.parametrize(
    ("factor", "expected", "words"),
    [
        (1e-3, None, "MPa is soft for a line that ends at"),
        (1e3, None, "GPa is not that of a solid: is the section of 10 mm x 2 mm"),
        (0.7, 70.0, "where specimen.modulus_GPa is 70"),
        (1.25, 70.0, "where specimen.modulus_GPa is 70"),
        (0.85, 70.0, ""),
        (1.0, 70.0, ""),
    ],
)
def test_a_modulus_of_no_solid_or_not_that_expected(
    factor: float, expected: float | None, words: str
) -> None:
    specimen = replace(FLAT, modulus_GPa=expected)
    found = doubts(findings(test_of(force=factor * stress_of(STRAINS) * 20e-6, specimen=specimen)))
    assert bool(found) == bool(words) and (not words or (words in found[0] and "N" in found[0]))


def test_a_soft_solid_that_is_strained_far_is_none_of_a_wrong_section() -> None:
    strains = np.r_[np.zeros(20), np.linspace(0, 0.4, 120)]
    test = test_of(strains, force=1e6 * strains * 20e-6)
    assert test.figures.E.value == pytest.approx(1e6, rel=0.01) and outcomes(test)["modulus"] == "good"


def test_a_stress_that_no_solid_bears_is_named_without_an_elastic_line() -> None:
    strains = 0.06 * np.maximum(np.linspace(-0.4, 1, 100), 0)
    force = np.interp(strains, (0, 2.5e-3, 0.06), (0, 3500, 6000))
    specimen = replace(FLAT, width_mm=0.02, thickness_mm=0.002)
    test = test_of(strains, force=force, specimen=specimen)
    assert not test.figures.E.known and "at a strain of 6" in first_doubt(test)
    assert "is the section of 0.02 mm x 0.002 mm that of the specimen" in first_doubt(test)
    assert outcomes(test_of(strains, force=force))["modulus"] == "not checked"


def test_a_force_without_a_section_has_no_modulus() -> None:
    assert outcomes(test_of(specimen=SpecimenConfig(axis="y")))["modulus"] == "not checked"


def test_forces_that_do_not_cover_the_pictures() -> None:
    whole = stress_of(STRAINS) * 20e-6
    text = first_doubt(test_of(force=whole[:100]))
    assert text.startswith("the forces end 4.0 s before the pictures (") and "of 140 bursts" in text
    text = first_doubt(test_of(force=whole[50:], times=[(50 + k) / FPS for k in range(90)]))
    assert text.startswith("the forces begin 5.0 s after the pictures (")
    longer = np.r_[whole, np.linspace(whole[-1], 2 * whole[-1], 50)]
    text = first_doubt(test_of(force=longer))
    most = in_ascii(str(Amount.rough("force", 2 * whole[-1], 4).printed()))
    words = f"the pictures end 5.0 s before the forces, which go on to {most}; no picture shows that"
    assert in_ascii(text) == words
    assert doubts(findings(test_of(force=np.r_[whole, whole[-1] * np.ones(10)]))) == []


def test_a_force_that_comes_late() -> None:
    """At ten a second, 0.3 s late: three samples."""
    whole = stress_of(STRAINS) * 20e-6
    found = findings(test_of(force=np.r_[np.zeros(3), whole]))
    lag = next(one for one in found if one.name == "lag")
    assert lag.outcome == "doubt" and "behind the pictures: --lag 0.3" in lag.text


@pytest.mark.parametrize(("degrees", "odd"), [(4.0, False), (14.0, True), (-14.0, True)])
def test_an_axis_off_the_largest_strain(degrees: float, odd: bool) -> None:
    found = outcomes(test_of(turned=math.radians(degrees)))
    assert (found["alignment"] == "doubt") == odd


@pytest.mark.parametrize(("end", "odd"), [((100.0, 200.0), False), ((160.0, 200.0), True)])
def test_a_gauge_off_the_largest_strain(end: tuple[float, float], odd: bool) -> None:
    test = replace(test_of(), gauge={"kind": "line", "start": (100.0, 20.0), "end": end})
    text = next(one.text for one in findings(test) if one.name == "alignment")
    assert bool(text) == odd and (not odd or "the gauge axial is 18 degrees off" in text)


@pytest.mark.parametrize(("nu", "odd"), [(0.3, False), (0.49, False), (0.7, True), (-0.2, True)])
def test_a_poisson_ratio_that_shows_motion_off_the_plane(nu: float, odd: bool) -> None:
    found = {one.name: one for one in findings(test_of(nu=nu))}["out of plane"]
    assert (found.outcome == "doubt") == odd
    assert not odd or float(in_ascii(found.text).removeprefix("nu = ").split()[0]) == pytest.approx(
        nu, abs=0.01
    )


@pytest.mark.parametrize(("force", "odd"), [(107.0, True), (-107.0, True), (0.4, False), (2.0, False)])
def test_a_reference_under_load(force: float, odd: bool) -> None:
    found = {one.name: one for one in findings(test_of(reference_N=force))}["reference under load"]
    assert (found.outcome == "doubt") == odd
    assert not odd or in_ascii(f"strains count from {force:.1f} N") in in_ascii(found.text)


def test_the_reference_is_not_judged_where_its_force_is_not_known() -> None:
    assert outcomes(test_of(reference_N=math.nan))["reference under load"] == "not checked"


def test_at_most_three_are_shown_in_their_order() -> None:
    wrong = test_of(force=1e-3 * stress_of(STRAINS[:100]) * 20e-6, turned=0.3, nu=0.8, reference_N=1.0)
    found = findings(wrong)
    assert sum(one.outcome == "doubt" for one in found) > SHOWN == len(doubts(found))
    assert [text.split()[0] for text in doubts(found)] == ["E", "the", "the"]
    assert "forces end" in doubts(found)[1] and "the axis y" in doubts(found)[2]


def test_without_a_force_only_what_needs_none_is_checked() -> None:
    found = findings(test_of(force=np.full(len(STRAINS), math.nan)))
    checked = [one.name for one in found if one.outcome != "not checked"]
    assert checked == ["leaps of the strain", "alignment"]
    assert {one.text for one in found if one.name not in checked} == {"no force is known"}
