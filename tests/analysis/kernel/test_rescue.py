"""Lost ZOIs are found from their neighbours; what is found better before is kept."""

from __future__ import annotations

import numpy as np
import pytest

from analysis import KernelSettings, Roi, Status, ZoiGrid
from analysis.kernel.attempt import Attempt
from analysis.kernel.noise import as_model
from analysis.kernel.reference import Reference
from analysis.kernel.rescue import rescue
from tests.analysis.speckle import picture

GRID = ZoiGrid.cover(Roi(8, 8, 208, 168), size=32, step=16)
MOTION = {"u": 4.3, "v": -1.2, "du_dx": 0.004}


@pytest.fixture
def reference() -> Reference:
    return Reference.first(picture().astype(np.float32), GRID, KernelSettings(), 1.0, None)


def attempt(reference: Reference, guess: np.ndarray) -> Attempt:
    return Attempt(reference, picture(**MOTION), as_model(1.0), guess)


def test_neighbours_lend_their_shape_round_by_round(reference: Reference) -> None:
    image = picture(**MOTION)
    good = reference.searched(image)
    guess = good.copy()
    guess[len(guess) // 8 :, 0] += 15  # one row or so knows where it is
    made = attempt(reference, guess)
    assert np.mean(made.status == Status.OK) < 0.5
    rescue(made, guess)
    assert (made.status == Status.OK).all()
    assert np.max(np.abs(made.found.p - attempt(reference, good).found.p)[:, :2]) < 1e-3


def test_a_zoi_without_a_guess_is_lost_until_a_neighbour_lends_it_one(reference: Reference) -> None:
    guess = reference.searched(picture(**MOTION))
    guess[7] = np.nan
    made = attempt(reference, guess)
    assert np.flatnonzero(made.status != Status.OK).tolist() == [7]
    assert made.status[7] == Status.LOST and np.isnan(made.found.p[7]).all()
    kept = made.found.p[8].copy()
    rescue(made, guess)
    assert made.status[7] == Status.OK
    assert np.array_equal(made.found.p[8], kept)


def test_a_worse_outcome_does_not_replace_what_there_is(reference: Reference) -> None:
    image = np.where(np.arange(240) < 80, np.uint16(2000), picture(**MOTION))
    made = Attempt(reference, image, as_model(1.0), reference.searched(picture(**MOTION)))
    lost = made.status != Status.OK
    assert 0 < lost.sum() < len(lost)
    before = made.status.copy(), made.found.p.copy()
    rescue(made, None)
    assert np.array_equal(made.status[~lost], before[0][~lost])
    assert np.array_equal(made.found.p[~lost], before[1][~lost])
    still = made.status != Status.OK
    assert still.any()
    assert np.array_equal(made.found.p[still], before[1][still], equal_nan=True)
