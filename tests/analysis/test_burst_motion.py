"""What an uneven motion during a burst adds to the uncertainty of its strain."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.evaluate import AreaStrain
from analysis.field import StrainField
from analysis.optics import BurstMotion
from tests.live.made_up import START, make_grid

GRID, RATE, PERIOD = make_grid(), 2e-4, 0.4
SIGMA = 1e-8


def measured(strain: float, sigma: float = SIGMA, large: float = 3.0) -> StrainField:
    """Uniaxial, in one column of ZOIs ``large`` times as much, as beside a hole."""
    x, y = np.meshgrid(GRID.x, GRID.y)
    here = strain * np.where(np.arange(GRID.shape[1]) == 2, large, 1.0)
    values = {"u": -0.3 * here * x, "v": here * y, "du_dx": -0.3 * here, "dv_dy": here + 0 * y}
    return StrainField.from_values(GRID, values, sigma)


def sigmas(strains: list[float], duration: float, sigma: float = SIGMA, large: float = 1.0) -> list[float]:
    """Of eyy of the region, of bursts of these mean strains."""
    motion, found = BurstMotion(), []
    for k, strain in enumerate(strains):
        field = motion.apply(measured(strain, sigma, large), START + PERIOD * k, duration)
        area = AreaStrain.of(field)
        assert area is not None
        found.append(area.sigma("eyy"))
    return found


def of_frames(begins: float, k: int, frames: int = 4) -> tuple[float, float]:
    """The mean strain of the frames of the k-th burst, and that at its time; the pull begins at a time."""
    times = PERIOD * k + (np.arange(frames) - (frames - 1) / 2) * PERIOD / frames
    return float(RATE * np.maximum(times - begins, 0).mean()), RATE * max(PERIOD * k - begins, 0.0)


@pytest.mark.parametrize("begins", np.arange(1.05, 1.5, 0.05))
def test_where_a_pull_begins_the_error_is_within_the_uncertainty(begins: float) -> None:
    """Bursts of 0.4 s, in which the strain grows by 78 um/m: up to 8 um/m off, with a noise of hundredths of it."""
    pairs = [of_frames(float(begins), k) for k in range(8)]
    found = sigmas([mean for mean, _ in pairs], 0.3)
    for (mean, true), sigma in zip(pairs, found, strict=True):
        assert abs(mean - true) <= 1.05 * sigma + 1e-7
    alone = sigmas([0.0], 0.3)[0]
    assert found[:2] == pytest.approx([alone] * 2) and found[-2:] == pytest.approx([alone] * 2)


def test_without_it_the_interval_would_be_too_small() -> None:
    mean, true = of_frames(1.2, 3)
    assert mean - true > 5e-6 > 100 * sigmas([0.0], 0.3)[0]


def test_each_zoi_has_its_own_share_of_it() -> None:
    motion = BurstMotion()
    for k, strain in enumerate((0.0, 0.0, 1e-5)):
        field = motion.apply(measured(strain), START + PERIOD * k, 0.3)
    found = field.sigma("eyy")
    assert found[2, 2] == pytest.approx(3e-5, rel=0.01) and found[2, 1] == pytest.approx(1e-5, rel=0.01)


@pytest.mark.parametrize("duration", [0.0, 0.3])
def test_a_single_frame_and_a_steady_pull_have_nothing_added(duration: float) -> None:
    steady, alone = [RATE * PERIOD * k for k in range(6)], sigmas([0.0], duration)[0]
    assert sigmas(steady, duration) == pytest.approx([alone] * 6)
    begun = [0.0, 0.0, 0.0, *steady]
    assert (max(sigmas(begun, duration)) > 5 * alone) is (duration > 0)


def test_noise_is_no_motion() -> None:
    rng, sigma = np.random.default_rng(1), 1e-5
    area = sigmas([0.0], 0.3, sigma)[0]
    found = np.array(sigmas(list(area * rng.standard_normal(300)), 0.3, sigma))
    assert np.sqrt(np.mean(found**2)) < 1.05 * area and np.mean(found > 1.001 * area) < 0.02
