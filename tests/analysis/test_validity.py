"""Who is rejected: the pictures of tests/accuracy at one noise and size, and the rule itself."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.strain_field import Status
from analysis.validity import bends, has_pattern, judge, stretch_of
from tests.accuracy import rejection


def verdict(left=1.0, expected=1.0, signal=900.0, gain=1.0, converged=True, outside=False, known=True) -> int:
    one = np.ones(1)
    return int(
        judge(
            one * converged > 0, one * outside > 0, one * left, one * expected, one * signal, one * gain, one * 350,
            known,
        )[0]
    )  # fmt: skip


def test_verdicts() -> None:
    assert verdict() == Status.OK
    assert verdict(left=8.0) == Status.POOR_MATCH
    assert verdict(left=4.5, known=False) == Status.OK
    assert verdict(gain=0.05) == Status.POOR_MATCH
    assert verdict(converged=False) == Status.NOT_CONVERGED
    assert verdict(left=800.0) == Status.LOST
    assert verdict(outside=True) == Status.OUTSIDE
    assert verdict(left=np.nan) != Status.OK


def test_bending_beyond_its_noise_and_the_limit() -> None:
    unit, noise = np.array([[1e-4, 1e-4], [1e-4, 1e-4], [1e-8, 1e-8], [1e-8, 1e-8]]), np.array([1.5, 0.5])
    found = np.array([0.002, 0.02, 0.048**2, 0.052**2])
    assert bends(found, unit, noise, np.zeros(4), 0.05).tolist() == [False, True, False, True]
    assert bends(np.array([np.nan]), unit[:1], noise, np.zeros(1), 0.05).tolist() == [True]
    assert bends(found, unit, noise, np.full(4, 1.0), 0.05).tolist() == [False] * 4
    assert bends(found, unit, noise, np.zeros(4), np.inf).tolist() == [False] * 4


def test_the_stretch_of_a_strain_is_free_of_rotation() -> None:
    c, s, stretched = np.cos(0.5), np.sin(0.5), 1.1
    turned = np.array([[3.0, stretched * c - 1, -s, -2.0, stretched * s, c - 1]])
    assert stretch_of(turned, 5.0) == pytest.approx(5.0 * (stretched**2 - 1) / 2)


def test_a_zoi_of_noise_has_no_pattern() -> None:
    energy, variance = np.array([[100.0, 100.0], [0.3, 0.3], [100.0, 0.3]]), np.full((3, 2), 1e-4)
    assert has_pattern(energy, variance, 1.0, 0.2).tolist() == [True, False, False]


@pytest.mark.slow
@pytest.mark.parametrize("case", [c for c in rejection.CASES if c != "hole"])
def test_wrong_zois_are_flagged_and_good_ones_kept(case: str) -> None:
    found = rejection.count(case, radius=2.0, size=32, noise=0.01, step=16)
    assert found.accepted <= 0.03 * (found.accepted + found.flagged)
    assert found.good_rejected <= 0.01 * found.good
