"""A verdict by value: slow fits, nothing to fit, noise, patterns, and displacements that bend."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from analysis.field import Status, profile
from analysis.fit.kernel_args import NUISANCES, RUNNING, PooledError
from analysis.fit.validity import has_pattern, information, least_information
from tests.analysis.one_zoi import EXPECTED, FORGIVING, PIXELS, SIGNAL, verdict

SPREAD = math.sqrt(2 / PIXELS)


@pytest.mark.parametrize(
    ("iterations", "centre", "unit", "status"),
    [
        (7, 0.033, 1e-3, Status.OK),  # times the root of the noise: 0.066 px
        (8, 0.033, 1e-3, Status.NOT_CONVERGED),
        (8, 0.032, 1e-3, Status.OK),
        (5, 0.0033, 1e-6, Status.OK),  # eleven times the variance of a ZOI with nothing else to find
        (6, 0.0033, 1e-6, Status.NOT_CONVERGED),
        (6, 0.0031, 1e-6, Status.OK),
        (6, 0.051, 2e-4, Status.OK),  # less certain than a tenth of a pixel
        (6, 0.049, 2e-4, Status.NOT_CONVERGED),
    ],
)
def test_a_slow_fit_is_uncertain_or_on_a_corner(
    iterations: int, centre: float, unit: float, status: Status
) -> None:
    found = verdict(iterations=iterations, centre=[centre], unit=[[unit, unit / 2]])
    assert found == status


@pytest.mark.parametrize(
    ("share", "sigma", "empty"),
    [(0.09, 0.06, False), (0.11, 0.06, True), (0.39, 0.051, True), (0.41, 0.06, False), (0.2, 0.049, False)],
)
def test_a_fit_that_leaves_a_tenth_to_four_of_the_noise_had_nothing_to_fit(
    share: float, sigma: float, empty: bool
) -> None:
    unit = sigma**2 / EXPECTED
    assert (verdict(share * EXPECTED, unit=[[unit / 3, unit]]) == Status.NO_PATTERN) is empty


@pytest.mark.parametrize(
    ("over_noise", "left", "noise"),
    [(1.41, 1.0, False), (1.39, 1.0, True), (1.39, 0.80, True), (1.39, 0.79, False)],
)
def test_a_gradient_that_noise_pretends_is_no_pattern(over_noise: float, left: float, noise: bool) -> None:
    """Unless the ZOI leaves so little that its noise is less: 1.25 times that are two standard deviations and 5 %."""
    found = verdict(left * EXPECTED, information=[over_noise])
    assert found == (Status.NO_PATTERN if noise else Status.OK)


@pytest.mark.parametrize(
    ("scatter", "ratio", "factor"), [(0.0, 1.0, 5.0), (0.2, 1.0, 3.5), (0.0, 2.0, 5.0), (0.2, 0.6, 2.1)]
)
def test_noise_that_nobody_gave_may_be_several_times_as_much(
    scatter: float, ratio: float, factor: float
) -> None:
    """Five times; 3.5 where the ZOIs together show that it is not, and less where they leave less."""
    common = PooledError.none(1)._replace(scatter=scatter, ratio=np.array([ratio]))
    edge = (factor + 0.002 * SIGNAL / EXPECTED) * EXPECTED
    assert verdict(0.99 * edge, known=False, common=common) == Status.OK
    assert verdict(1.01 * edge, known=False, common=common) == Status.POOR_MATCH


@pytest.mark.parametrize(("scatter", "spread"), [(0.0, SPREAD), (0.3, 0.3)])
def test_what_all_leave_is_forgiven_with_its_scatter(scatter: float, spread: float) -> None:
    """Ten times the noise as stated, in common."""
    common = PooledError.none(1)._replace(forgiven=np.array([10.0]), scatter=scatter)
    edge = 10 * EXPECTED * (1.05 + 4 * spread) + 0.002 * SIGNAL
    assert verdict(0.99 * edge, common=common) == Status.OK
    assert verdict(1.01 * edge, common=common) == Status.POOR_MATCH


@pytest.mark.parametrize(("gain", "share"), [(0.5, 0.25), (2.0, 1.0)])
def test_a_pattern_of_less_contrast_excuses_less(gain: float, share: float) -> None:
    edge = FORGIVING * EXPECTED + 0.5 * SIGNAL * share
    assert verdict(0.99 * edge, gain=gain) == Status.POOR_MATCH
    assert verdict(1.01 * edge, gain=gain) == Status.LOST


@pytest.mark.parametrize(("colour", "status"), [(1.49, Status.UNEVEN), (1.51, Status.OK)])
def test_coloured_noise_bends_more_where_all_leave_more(colour: float, status: Status) -> None:
    """White noise of 4 GL^2 bends by 8 units, with deviations of the root of 2 times the squares."""
    unit = 1e-3
    white, spread = 2 * EXPECTED * unit, math.sqrt(4) * EXPECTED * unit
    bending = 1.3 * (white + 6 * spread) + 0.05**2
    common = PooledError.none(1)._replace(forgiven=np.array([1.0001]), colour=np.array([1.0, colour]))
    assert verdict(bending=bending, unit=[[unit, unit]], common=common) == status


@pytest.mark.parametrize(
    ("energy", "sigma", "noise", "pattern"),
    [
        ((3.1, 9.0), 0.29, 1.0, True),
        ((2.9, 9.0), 0.29, 1.0, False),
        ((9.0, 2.9), 0.29, 1.0, False),
        ((9.0, 9.0), 0.31, 1.0, False),
        ((9.0, 9.0), 2.9, 0.0, True),  # there is a tenth of a grey level at least
        ((9.0, 9.0), 3.1, 0.0, False),
    ],
)
def test_a_pattern_has_three_times_the_gradients_of_noise_and_a_sigma_of_three_tenths(
    energy: tuple[float, float], sigma: float, noise: float, pattern: bool
) -> None:
    variance = np.array([[sigma**2, 1e-6], [1e-6, sigma**2]])
    assert has_pattern(np.array([energy] * 2), variance, noise, 1.0).tolist() == [pattern] * 2
    assert not has_pattern(np.array([energy]), np.zeros((1, 2)), noise, 1.0)[0]


@pytest.mark.parametrize("order", [1, 2])
def test_the_information_of_an_even_pattern_is_one(order: int) -> None:
    """Normal matrices of gradients alike everywhere: of the worst value, over both."""
    line = profile("gaussian", 30)
    x = (np.arange(30) - 14.5) / 15
    moments = line.sum() * np.array([line.sum(), line @ x**2, line @ x**2])
    half = 3 * order
    count, energy = 2 * half + NUISANCES, np.array([[4.0, 9.0]])
    diagonal = np.ones(count)
    diagonal[:3], diagonal[half : half + 3] = 4.0 * moments, 9.0 * moments
    for k, share in ((half + 2, 1.0), (half + 2, 0.25), (1, 0.5)):
        worse = diagonal.copy()
        worse[k] *= share
        inverse = np.diag(1 / worse)[None].astype(np.float32)
        over_even, over_noise = information(inverse, energy, 0.5, line)
        assert over_even[0] == pytest.approx(share, rel=1e-5)
        assert over_noise[0] == pytest.approx(min(4.0, (4.0, 9.0)[k > 2] * share) / 0.5, rel=1e-5)


@pytest.mark.parametrize(
    ("size", "order", "least"),
    [(40, 1, 0.04), (20, 1, 0.04), (10, 1, 0.04 * 0.5**4.3), (28, 2, 0.04), (14, 2, 0.04 * 0.5**4.3)],
)
def test_small_zois_need_less_information(size: int, order: int, least: float) -> None:
    assert least_information(size, order) == pytest.approx(least)


def bent(left: float = 1.0, *, unit: float = 1e-4, beyond: float = 1.0, **given: Any) -> Status:
    """Of a ZOI whose displacement may bend; its centre is ``beyond`` as uncertain, squared, as by its pattern alone."""
    pattern = {"signal": [900.0], "pixels": [350.0], "bends": 1.5, "unit": [[unit, unit]]}
    return verdict(
        left, expected=1.0, noise=(1.5, 0.5), centre=[math.sqrt(unit * beyond)], **pattern, **given
    )


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
    assert (bent(bending=bending, unit=unit) == Status.UNEVEN) == uneven
    assert bent(bending=bending, unit=unit, state=RUNNING) == Status.NOT_CONVERGED
    if np.isfinite(bending):
        strained = np.array([[0.0, 0.3, 0.0, 0.0, 0.0, 0.0]])
        assert bent(bending=bending, unit=unit, values=strained) == Status.OK
        assert bent(bending=bending, unit=unit, limit=np.inf) == Status.OK


def test_bending_counts_in_the_contrast_of_the_picture_and_beside_its_like() -> None:
    """Noise of 1 GL makes 1.5 * 2 * unit of it, 1 of its deviations 1.41 * unit."""
    unit = 1e-3
    noise, spread = 3 * unit, 2**0.5 * unit
    edge = noise + 6 * spread + 0.05**2
    assert bent(bending=0.98 * edge, unit=unit) == Status.OK
    assert bent(bending=1.02 * edge, unit=unit) == Status.UNEVEN
    dim = 4 * (noise + 6 * spread) + 0.05**2  # at half of the contrast
    assert bent(bending=0.98 * dim, unit=unit, gain=0.5) == Status.OK
    assert bent(bending=1.02 * dim, unit=unit, gain=0.5) == Status.UNEVEN
    like = PooledError.none(1)._replace(bent=1.5)
    alike = 1.5 * (noise + 6 * spread) + 0.05**2
    assert bent(bending=0.98 * alike, unit=unit, common=like) == Status.OK
    assert bent(bending=1.02 * alike, unit=unit, common=like) == Status.UNEVEN
    # No more of what all bend is forgiven than the limit itself.
    most, all_bend = 1 + 0.05**2 / noise, PooledError.none(1)._replace(bent=50.0)
    beyond = most * (noise + 6 * spread) + 0.05**2
    assert bent(bending=0.98 * beyond, unit=unit, common=all_bend) == Status.OK
    assert bent(bending=1.02 * beyond, unit=unit, common=all_bend) == Status.UNEVEN


def test_a_little_in_both_residual_and_bending_is_too_much() -> None:
    half_left, more_left, half_bent, more_bent = 2.0, 2.6, 0.0015, 0.0018
    assert bent(left=half_left) == bent(bending=more_bent, unit=1e-8) == Status.OK
    assert bent(left=half_left, bending=0.001, unit=1e-8) == Status.OK
    assert bent(left=half_left, bending=more_bent, unit=1e-8) == Status.UNEVEN
    assert bent(left=more_left, bending=half_bent, unit=1e-8) == Status.POOR_MATCH
    assert bent(left=half_left, bending=more_bent, unit=1e-8, limit=np.inf) == Status.OK
    assert bent(left=4.5, bending=more_bent, unit=1e-8, known=False) == Status.OK
    assert bent(left=6.5, bending=more_bent, unit=1e-8, known=False) != Status.OK


def test_a_centre_beyond_the_pattern_shows_in_its_uncertainty() -> None:
    doubtful = {"left": 1.0, "bending": 0.0015, "unit": 1e-8}
    assert bent(**doubtful, beyond=3.9) == Status.OK
    assert bent(**doubtful, beyond=8.0) == Status.UNEVEN
    assert bent(beyond=8.0) == Status.OK
