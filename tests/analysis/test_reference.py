"""A reference is made once: whole from the start, and not changed by what is measured or renewed.

Lost ZOIs are found from their neighbours; what is found better before is kept.
"""

from __future__ import annotations

from dataclasses import FrozenInstanceError, fields

import numpy as np
import pytest

import analysis
from analysis import KernelSettings, PatternError, PhaseKernel, Roi, Status, ZoiGrid
from analysis.kernel.images import as_model
from analysis.kernel.prepared import PatternError as Raised
from analysis.kernel.reference import ReferencePicture
from analysis.kernel.solve import Solution, rescue
from tests.analysis.speckle import SHAPE, picture

GRID = ZoiGrid.cover(Roi(8, 8, 160, 128), size=32, step=16)
HOLED = GRID.subset(active=np.arange(GRID.active.size).reshape(GRID.shape) % 5 > 0)


def reference(grid: ZoiGrid = GRID, order: int = 1) -> ReferencePicture:
    return ReferencePicture.first(picture().astype(np.float32), grid, KernelSettings(order=order), 1.0, None)


def test_it_cannot_be_changed() -> None:
    made = reference()
    for field in fields(made):
        with pytest.raises(FrozenInstanceError):
            setattr(made, field.name, None)


def test_nothing_that_is_measured_changes_it() -> None:
    kernel = PhaseKernel(picture(), GRID, noise=1.0)
    status, unit = kernel.reference.prepared.status.copy(), kernel.reference.unit_covariance.copy()
    field = kernel.measure(np.where(np.arange(SHAPE[1]) < 100, 2000, picture(u=0.3)), noise=1.0)
    assert not field.ok.all()
    renewed = kernel.renewed(picture(u=0.3), field)
    assert np.array_equal(kernel.reference.prepared.status, status)
    assert np.array_equal(kernel.reference.unit_covariance, unit)
    assert kernel.reference.placement is None
    assert renewed.reference.placement is not None
    assert np.array_equal(renewed.reference.prepared.status == Status.OK, field.ok.ravel())


@pytest.mark.parametrize("order", [1, 2])
def test_affine_parameters_stand_among_all(order: int) -> None:
    made = reference(order=order)
    affine = np.arange(6.0) + 1 + np.zeros((len(made.index), 1))
    whole = made.all_modes(affine)
    assert whole.shape == (len(made.index), made.modes) == (GRID.n_active, 6 * order)
    assert np.array_equal(whole[:, made.affine], affine)
    assert whole.sum() == affine.sum()


@pytest.mark.parametrize("grid", [GRID, HOLED], ids=["all", "some"])
def test_values_are_spread_over_the_grid(grid: ZoiGrid) -> None:
    made = reference(grid)
    values = np.arange(2.0 * grid.n_active).reshape(-1, 2)
    spread = made.spread(values)
    assert spread.shape == (2, *grid.shape)
    assert np.array_equal(spread[:, grid.active].T, values)
    assert np.isnan(spread[:, ~grid.active]).all()


def test_the_tolerance_grows_with_the_noise_from_a_floor_on() -> None:
    made, settings = reference(), KernelSettings()
    quiet, loud = made.tolerance(0.0), made.tolerance(100.0)
    assert quiet.length.min() >= settings.tolerance_px and quiet.slope.min() >= settings.tolerance_strain
    assert np.all(loud.length > quiet.length) and np.all(loud.slope > quiet.slope)
    assert np.all(quiet.trust == 0) and np.all(loud.trust > 0)
    assert loud.max_iterations == settings.max_iterations


def test_there_is_one_error_for_a_reference_without_a_pattern() -> None:
    assert analysis.PatternError is Raised and issubclass(PatternError, ValueError)
    with pytest.raises(PatternError, match="focus, exposure and speckle"):
        ReferencePicture.first(np.full(SHAPE, 100, np.float32), GRID, KernelSettings(), None, None)


def test_the_pattern_is_kept_once() -> None:
    ready = reference().prepared
    for k, image in enumerate((ready.pattern.grad_x, ready.pattern.grad_y, ready.pattern.level)):
        assert image.shape == SHAPE
        assert np.shares_memory(image, ready.images[k])
        assert np.array_equal(image, ready.images[k, : SHAPE[0], : SHAPE[1]])


GRID_RESCUE = ZoiGrid.cover(Roi(8, 8, 208, 168), size=32, step=16)
MOTION = {"u": 4.3, "v": -1.2, "du_dx": 0.004}


@pytest.fixture
def reference_rescue() -> ReferencePicture:
    return ReferencePicture.first(picture().astype(np.float32), GRID_RESCUE, KernelSettings(), 1.0, None)


def attempt(reference_rescue: ReferencePicture, guess: np.ndarray) -> Solution:
    return Solution(reference_rescue, picture(**MOTION), as_model(1.0), guess)


def test_neighbours_lend_their_shape_round_by_round(reference_rescue: ReferencePicture) -> None:
    image = picture(**MOTION)
    good = reference_rescue.searched(image)
    guess = good.copy()
    guess[len(guess) // 8 :, 0] += 15  # one row or so knows where it is
    made = attempt(reference_rescue, guess)
    assert np.mean(made.status == Status.OK) < 0.5
    rescue(made, guess)
    assert (made.status == Status.OK).all()
    assert np.max(np.abs(made.found.p - attempt(reference_rescue, good).found.p)[:, :2]) < 1e-3


def test_a_zoi_without_a_guess_is_lost_until_a_neighbour_lends_it_one(
    reference_rescue: ReferencePicture,
) -> None:
    guess = reference_rescue.searched(picture(**MOTION))
    guess[7] = np.nan
    made = attempt(reference_rescue, guess)
    assert np.flatnonzero(made.status != Status.OK).tolist() == [7]
    assert made.status[7] == Status.LOST and np.isnan(made.found.p[7]).all()
    kept = made.found.p[8].copy()
    rescue(made, guess)
    assert made.status[7] == Status.OK
    assert np.array_equal(made.found.p[8], kept)


def test_a_worse_outcome_does_not_replace_what_there_is(reference_rescue: ReferencePicture) -> None:
    image = np.where(np.arange(240) < 80, np.uint16(2000), picture(**MOTION))
    made = Solution(reference_rescue, image, as_model(1.0), reference_rescue.searched(picture(**MOTION)))
    lost = made.status != Status.OK
    assert 0 < lost.sum() < len(lost)
    before = made.status.copy(), made.found.p.copy()
    rescue(made, None)
    assert np.array_equal(made.status[~lost], before[0][~lost])
    assert np.array_equal(made.found.p[~lost], before[1][~lost])
    still = made.status != Status.OK
    assert still.any()
    assert np.array_equal(made.found.p[still], before[1][still], equal_nan=True)
