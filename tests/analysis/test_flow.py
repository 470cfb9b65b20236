"""r-value, n-value and Poisson's ratio of plastics, on simulated materials where they are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from analysis.evaluate import STANDARDS, Curve, TensileOptions, evaluate_test, neck, true_at_top
from analysis.field import Roi, StrainField, ZoiGrid
from hw_mocks.machine import FlowCurve, PowerLaw

NOISE, NOISE_PA = 2e-6, 2e4


def pulled(material: PowerLaw | FlowCurve, end: float, seed: int = 0, noise: float = NOISE) -> Curve:
    """To a strain ``end``: slowly through the elastic part, faster beyond it, with noise."""
    rng = np.random.default_rng(seed)
    strain = np.concatenate([np.zeros(40), np.linspace(0, 3e-3, 300), np.linspace(3e-3, end, 800)[1:]])
    n = len(strain)
    across = material.transverse(strain) + rng.normal(0, noise, n)
    stress = material.stress(strain) + rng.normal(0, NOISE_PA, n)
    return Curve(np.arange(n) / 20, strain + rng.normal(0, noise, n), stress, across)


@pytest.mark.parametrize(("n", "r"), [(0.2, 1.0), (0.25, 1.8), (0.15, 0.6)])
def test_r_and_n_of_a_power_law(n: float, r: float) -> None:
    found = evaluate_test(pulled(PowerLaw(n, r), 0.3))
    assert found.r.low < r < found.r.high or found.r.value == pytest.approx(r, rel=2e-3)
    assert found.n.value == pytest.approx(n, rel=5e-3)
    assert found.r.high - found.r.low < 0.02 * r and found.n.high - found.n.low < 0.02 * n
    assert found.Ag.value == pytest.approx(np.expm1(n), abs=0.01), "the highest force of a power law"
    assert found.n.why.startswith("plastic strains 10 to ")
    assert found.r.why == f"plastic strains 2 to {100 * min(0.2, np.expm1(n)):.3g} %" or n < 0.19


def test_r_and_n_are_of_elongations_whatever_the_measure_of_the_other_strains() -> None:
    plain = pulled(PowerLaw(0.2, 1.5), 0.3)
    assert plain.transverse is not None
    hencky = replace(
        plain,
        elastic=np.log1p(plain.strain),
        transverse=np.log1p(plain.transverse),
        narrowing=plain.transverse,
    )
    found = evaluate_test(hencky)
    assert found.r.value == pytest.approx(1.5, rel=2e-3) and found.n.value == pytest.approx(0.2, rel=5e-3)


def test_true_stress_and_strain_at_the_highest_force() -> None:
    metal = PowerLaw(0.2, 1.5)
    found = evaluate_test(pulled(metal, 0.3))
    stress, strain = true_at_top(found.Rm, found.Agt)
    top = metal.uniform_strain
    assert stress.low <= float(metal.stress(top)) * (1 + top) <= stress.high
    assert strain.low <= np.log1p(top) <= strain.high and strain.high - strain.low < 0.02


def test_intervals_hold_the_truth_as_often_as_they_promise() -> None:
    inside = []
    for seed in range(40):
        found = evaluate_test(pulled(PowerLaw(0.22, 1.4), 0.3, seed, 1e-4))
        inside += [found.r.low <= 1.4 <= found.r.high]
    assert np.mean(inside) >= 0.8


def test_a_short_uniform_part_begins_early_for_n() -> None:
    found = evaluate_test(pulled(PowerLaw(0.08, 1.0), 0.12))
    assert found.n.value == pytest.approx(0.08, rel=0.01) and found.n.why.startswith("plastic strains 2 to ")


def test_not_known_where_the_data_do_not_tell() -> None:
    found = evaluate_test(pulled(FlowCurve(), 8e-3))
    assert found.r.why == "the plastic strain reaches 0.52 %, 2 % is needed"
    assert found.n.why == "the plastic strain reaches 0.52 %, 4 % is needed"
    without = evaluate_test(replace(pulled(PowerLaw(0.2), 0.3), transverse=None))
    assert not without.r.known and without.n.known
    plastics = evaluate_test(pulled(PowerLaw(0.2), 0.3), TensileOptions(STANDARDS["iso527"]))
    assert plastics.r.why == plastics.n.why == "not a figure of iso527"


def test_poissons_ratio_of_plastics_is_taken_from_0_3_percent_on() -> None:
    """Below, the specimen has another ratio: it would be the answer of the modulus' interval."""
    strain = np.linspace(0, 0.02, 800)
    across = np.where(strain < 0.003, -0.30 * strain, -0.0009 - 0.40 * (strain - 0.003))
    rng = np.random.default_rng(1)
    curve = Curve(np.arange(800) / 20, strain, 3e9 * strain, across + rng.normal(0, 1e-6, 800))
    found = evaluate_test(curve, TensileOptions(STANDARDS["iso527"]))
    assert found.nu.value == pytest.approx(0.40, abs=1e-3) and found.nu.why == "strains 0.3 to 1.5 %"
    short = evaluate_test(
        Curve(curve.t[:110], strain[:110], curve.stress[:110], across[:110]),
        TensileOptions(STANDARDS["iso527"]),
    )
    assert "the strain reaches 0.27 %" in short.nu.why


def strained(rows: dict[int, float], *, sigma: float = 1e-4) -> StrainField:
    """eyy of 12 sections of a specimen, 0.2 where ``rows`` has none."""
    zois = ZoiGrid.cover(Roi(10, 20, 32 + 8 * 7, 32 + 8 * 11), 32, 8)
    strain = np.full((12, 1), 0.2)
    for row, value in rows.items():
        strain[row] = value
    return StrainField.from_values(zois, {"dv_dy": strain}, sigma)


def test_a_neck_is_found_where_strain_grows_while_the_rest_rests() -> None:
    before = strained({})
    found = neck(before, strained({7: 0.35, 8: 0.41, 9: 0.33}), "y")
    assert found is not None and found.growth == pytest.approx(0.21)
    place = (found.x, found.y)
    lost = replace(before, status=np.where(np.arange(8) < 3, np.uint8(5), before.status))
    seen = neck(lost, strained({7: 0.35, 8: 0.41, 9: 0.33}), "y")
    assert seen is not None and (seen.x, seen.y) == place, (
        "the middle of the section, whichever ZOIs are lost"
    )
    assert place == (10 + 15.5 + 4 * 7, 20 + 15.5 + 8 * 8) and abs(found.elsewhere) < 1e-12
    assert neck(before, strained(dict.fromkeys(range(12), 0.25)), "y") is None, "an even strain is no neck"
    assert neck(before, strained({8: 0.201}, sigma=1e-2), "y") is None, "nor is noise"
    assert neck(before, strained({8: 0.41}), "x") is None


@pytest.mark.parametrize(("sigma", "clear"), [(3.5e-3, True), (4.5e-3, False)])
def test_a_neck_is_clear_beyond_five_sigmas_of_the_mean_of_its_section(sigma: float, clear: bool) -> None:
    """A section has 8 ZOIs, each with the noise of two fields: half of ``sigma`` in the mean."""
    before, after = (strained(rows, sigma=sigma) for rows in ({}, {8: 0.21}))
    assert float(before.sigma("eyy")[0, 0]) == pytest.approx(sigma)
    assert (neck(before, after, "y") is not None) is clear
