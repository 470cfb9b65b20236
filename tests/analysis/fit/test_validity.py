"""Who is rejected: the pictures of tests/accuracy at one noise and size, and the rule itself."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.field.status import Status
from analysis.fit.bundles import Known, Out, Rule
from analysis.fit.iteration import CONVERGED, LEFT_IMAGE, RUNNING
from analysis.fit.validity import has_pattern
from analysis.fit.verdict import judge, stretch_of
from tests.accuracy import rejection


def verdict(
    left=1.0, expected=1.0, signal=900.0, gain=1.0, state=CONVERGED, known=True, bending=0.0, unit=1e-4, values=None,
    limit=0.05, beyond=1.0,
) -> int:  # fmt: skip
    one, out = np.ones(1), np.zeros(1, np.uint8)
    found = Out.starting(np.zeros((1, 6)) if values is None else values)
    found.state[0], found.bending[0], found.nuisance[0, 0] = state, bending, gain
    zoi, rule = (
        Known(one * signal, one * 350, np.full((1, 2), unit), one * np.sqrt(unit * beyond)),
        Rule(known, np.array([1.5, 0.5]), 5.0, limit, 4.0),
    )
    judge(found, one * left, one * expected, zoi, rule, out)
    return int(out[0])


def test_verdicts() -> None:
    assert verdict() == Status.OK
    assert verdict(left=8.0) == Status.POOR_MATCH
    assert verdict(left=4.5, known=False) == Status.OK
    assert verdict(gain=0.05) == Status.POOR_MATCH
    assert verdict(state=RUNNING) == Status.NOT_CONVERGED
    assert verdict(left=800.0) == Status.LOST
    assert verdict(left=800.0, state=LEFT_IMAGE) == Status.OUTSIDE
    assert verdict(left=np.nan) != Status.OK


@pytest.mark.parametrize(
    ("bending", "unit", "uneven"),
    [
        (0.002, 1e-4, False),
        (0.02, 1e-4, True),
        (0.048**2, 1e-8, False),
        (0.052**2, 1e-8, True),
        (np.nan, 1e-4, True),
    ],
)
def test_bending_beyond_its_noise_and_the_limit(bending: float, unit: float, uneven: bool) -> None:
    assert (verdict(bending=bending, unit=unit) == Status.UNEVEN) == uneven
    assert verdict(bending=bending, unit=unit, state=RUNNING) == Status.NOT_CONVERGED
    if np.isfinite(bending):
        strained = np.array([[0.0, 0.3, 0.0, 0.0, 0.0, 0.0]])
        assert verdict(bending=bending, unit=unit, values=strained) == Status.OK
        assert verdict(bending=bending, unit=unit, limit=np.inf) == Status.OK


def test_a_little_in_both_residual_and_bending_is_too_much() -> None:
    half_left, more_left, half_bent, more_bent = 2.0, 2.6, 0.0015, 0.0018
    assert verdict(left=half_left) == verdict(bending=more_bent, unit=1e-8) == Status.OK
    assert verdict(left=half_left, bending=0.001, unit=1e-8) == Status.OK
    assert verdict(left=half_left, bending=more_bent, unit=1e-8) == Status.UNEVEN
    assert verdict(left=more_left, bending=half_bent, unit=1e-8) == Status.POOR_MATCH
    assert verdict(left=half_left, bending=more_bent, unit=1e-8, limit=np.inf) == Status.OK
    assert verdict(left=4.5, bending=more_bent, unit=1e-8, known=False) == Status.OK
    assert verdict(left=6.5, bending=more_bent, unit=1e-8, known=False) != Status.OK


def test_a_centre_beyond_the_pattern_is_told_by_its_uncertainty() -> None:
    doubtful = {"left": 1.0, "bending": 0.0015, "unit": 1e-8}
    assert verdict(**doubtful, beyond=3.9) == Status.OK
    assert verdict(**doubtful, beyond=8.0) == Status.UNEVEN
    assert verdict(beyond=8.0) == Status.OK


def test_the_stretch_of_a_strain_is_free_of_rotation() -> None:
    c, s, stretched = np.cos(0.5), np.sin(0.5), 1.1
    turned = np.array([[3.0, stretched * c - 1, -s, -2.0, stretched * s, c - 1]])
    assert stretch_of(turned, 0, 5.0) == pytest.approx(5.0 * (stretched**2 - 1) / 2)


def test_a_zoi_of_noise_has_no_pattern() -> None:
    energy, variance = np.array([[100.0, 100.0], [0.3, 0.3], [100.0, 0.3]]), np.full((3, 2), 1e-4)
    assert has_pattern(energy, variance, 1.0, 0.2).tolist() == [True, False, False]


@pytest.mark.slow
@pytest.mark.parametrize("case", [c for c in rejection.CASES if c != "hole"])
def test_wrong_zois_are_flagged_and_good_ones_kept(case: str) -> None:
    found = rejection.count(case, radius=2.0, size=32, noise=0.01, step=16)
    assert found.accepted <= 0.03 * (found.accepted + found.flagged)
    assert found.good_rejected <= 0.01 * found.good


def test_a_glare_that_shifts_the_pattern_a_little_is_seen() -> None:
    found = rejection.count("glare", radius=3.0, size=64, noise=0.01)  # 19 by either limit alone
    assert found.accepted <= 6
    assert found.good_rejected == 0
