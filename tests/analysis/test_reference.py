"""A reference is made once and never changed; lost ZOIs are measured from the values of their neighbours."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, fields

import numpy as np
import pytest

import analysis
from analysis import KernelSettings, PatternError, PhaseKernel, Roi, Status, ZoiGrid
from analysis.kernel import retry
from analysis.kernel.images import as_model
from analysis.kernel.prepared import PatternError as Raised
from analysis.kernel.reference import ReferencePicture
from analysis.kernel.retry import retry_lost
from analysis.kernel.solve import Solution
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
    with pytest.raises(PatternError, match="focus, exposure, speckle"):
        ReferencePicture.first(np.full(SHAPE, 100, np.float32), GRID, KernelSettings(), None, None)


def test_the_pattern_is_kept_once() -> None:
    ready = reference().prepared
    for k, image in enumerate((ready.pattern.grad_x, ready.pattern.grad_y, ready.pattern.level)):
        assert image.shape == SHAPE
        assert np.shares_memory(image, ready.images[k])
        assert np.array_equal(image, ready.images[k, : SHAPE[0], : SHAPE[1]])


WIDE_GRID = ZoiGrid.cover(Roi(8, 8, 208, 168), size=32, step=16)
MOTION = {"u": 4.3, "v": -1.2, "du_dx": 0.004}


@pytest.fixture
def wide() -> ReferencePicture:
    return ReferencePicture.first(picture().astype(np.float32), WIDE_GRID, KernelSettings(), 1.0, None)


def solved(wide: ReferencePicture, guess: np.ndarray) -> Solution:
    return Solution(wide, picture(**MOTION), as_model(1.0), guess)


def test_neighbours_lend_their_shape_round_by_round(wide: ReferencePicture) -> None:
    image = picture(**MOTION)
    good = wide.searched(image)
    guess = good.copy()
    guess[len(guess) // 8 :, 0] += 15  # one row or so has a good guess
    solution = solved(wide, guess)
    assert np.mean(solution.status == Status.OK) < 0.5
    retry_lost(solution, guess)
    assert (solution.status == Status.OK).all()
    assert np.max(np.abs(solution.found.p - solved(wide, good).found.p)[:, :2]) < 1e-3


def test_a_zoi_without_a_guess_is_lost_until_a_neighbour_lends_it_one(
    wide: ReferencePicture,
) -> None:
    guess = wide.searched(picture(**MOTION))
    guess[7] = np.nan
    solution = solved(wide, guess)
    assert np.flatnonzero(solution.status != Status.OK).tolist() == [7]
    assert solution.status[7] == Status.LOST and np.isnan(solution.found.p[7]).all()
    kept = solution.found.p[8].copy()
    retry_lost(solution, guess)
    assert solution.status[7] == Status.OK
    assert np.array_equal(solution.found.p[8], kept)


def test_a_worse_outcome_does_not_replace_what_there_is(wide: ReferencePicture) -> None:
    image = np.where(np.arange(240) < 80, np.uint16(2000), picture(**MOTION))
    solution = Solution(wide, image, as_model(1.0), wide.searched(picture(**MOTION)))
    lost = solution.status != Status.OK
    assert 0 < lost.sum() < len(lost)
    before = solution.status.copy(), solution.found.p.copy()
    retry_lost(solution, None)
    assert np.array_equal(solution.status[~lost], before[0][~lost])
    assert np.array_equal(solution.found.p[~lost], before[1][~lost])
    still = solution.status != Status.OK
    assert still.any()
    assert np.array_equal(solution.found.p[still], before[1][still], equal_nan=True)


@pytest.mark.parametrize(("u", "v"), [(5.0, -37.0), (-37.0, 5.0)])
def test_a_lost_block_is_searched_for_a_hundred_pixels_farther_than_it_had_moved(
    wide: ReferencePicture, monkeypatch: pytest.MonkeyPatch, u: float, v: float
) -> None:
    solution = solved(wide, wide.searched(picture(**MOTION)))
    before, block = np.zeros_like(solution.guess), np.zeros(WIDE_GRID.shape, bool)
    before[:, 0], before[:, 3] = u, v
    block[2:5, 3:6] = True
    solution.status[block.ravel()] = Status.LOST
    asked = []

    def near(
        self: ReferencePicture, image: np.ndarray, which: np.ndarray, reach: float
    ) -> np.ndarray:  # as it has been
        asked.append((which.tolist(), reach))
        return before[which]

    monkeypatch.setattr(ReferencePicture, "searched_near", near)
    retry._search_again(solution, before)
    assert asked == [(np.flatnonzero(block).tolist(), 137.0)]


@pytest.mark.parametrize(("u", "v"), [(15.0, -13.0), (-14.0, 16.0)])
def test_a_block_is_searched_for_around_the_place_where_it_was(u: float, v: float) -> None:
    """Far from the edges of the picture; all else of it has another motion."""
    made, image = reference(), picture().astype(np.float32)
    later = np.roll(image, (-30, 25), (0, 1))
    place = np.s_[60:140, 70:150]
    later[place] = np.roll(image, (int(v), int(u)), (0, 1))[place]
    y, x = (made.prepared.origins + (made.grid.size - 1) / 2).T
    which = np.flatnonzero((abs(x - 110) < 14) & (abs(y - 100) < 14))
    found = made.searched_near(later, which, 20.0)[:, [0, made.modes // 2]]
    assert len(which) >= 2
    assert found == pytest.approx(np.tile((u, v), (len(which), 1)))
