"""A pattern that is hard to find again: large steps, a block that leaps, patterns that repeat; what is missing then."""

from __future__ import annotations

import numpy as np
import pytest

from analysis import PhaseKernel, Roi, Status, StrainField, ZoiGrid
from analysis.field import area_share, in_blocks
from analysis.follow.features import feature_motions, motion_at
from analysis.follow.repetition import side_peaks
from analysis.follow.search import match
from analysis.kernel import retry
from live.pipeline.reference import repetition_text
from tests.accuracy import finding
from tests.accuracy.finding import NOISE_GL, PATTERNS, PERIOD, SHAPE, SPECKLE, Found
from tests.accuracy.truth import affine, pixels

WHOLE = Roi(0, 0, SHAPE[1], SHAPE[0])


@pytest.mark.parametrize("name", finding.JUMPS)
def test_a_large_step_is_found(name: str) -> None:
    motion, least = finding.JUMPS[name]
    found = finding.jump(motion, 48, 32)
    assert found.zois > 50 and found.right >= least and found.wrong == 0


def test_without_features_a_half_turn_is_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(retry, "_retry_from_features", lambda solution: None)
    assert finding.jump(finding.turned(170), 48, 32).right < 0.05


def test_unrelated_pictures_have_no_value() -> None:
    assert finding.unrelated(32, 32, 1) == 0


def test_the_motion_of_features_is_the_motion_of_the_picture() -> None:
    motion = {"u": 12.0, "v": -7.0, **finding.turned(70)}
    first, moved = (
        finding.picture(SPECKLE.at(*affine(SHAPE, **m)), 1).astype(np.float32) for m in ({}, motion)
    )
    matrix = next(feature_motions(first, moved, WHOLE))
    centre = (np.array([(SHAPE[1] - 1) / 2]), np.array([(SHAPE[0] - 1) / 2]))
    wanted = [motion[name] for name in ("u", "du_dx", "du_dy", "v", "dv_dx", "dv_dy")]
    assert motion_at(matrix, *centre)[0] == pytest.approx(wanted, abs=1.0)
    assert motion_at(matrix, *centre)[0, [1, 2, 4, 5]] == pytest.approx(
        np.array(wanted)[[1, 2, 4, 5]], abs=2e-3
    )


def test_a_mirrored_picture_and_a_blank_one_share_no_motion() -> None:
    first = finding.picture(SPECKLE.at(*pixels(SHAPE)), 0).astype(np.float32)
    for other in (first[:, ::-1], np.full_like(first, 7)):
        assert not list(feature_motions(first, np.ascontiguousarray(other), WHOLE))


def test_what_lies_beside_the_region_moves_nothing() -> None:
    """The left part moves, and only the right one is asked for."""
    reference = finding.picture(SPECKLE.at(*pixels(SHAPE)), 0).astype(np.float32)
    later, half = reference.copy(), SHAPE[1] // 2
    later[:, :half] = np.roll(reference, 12, axis=1)[:, :half]
    region = Roi(half + 8, 0, SHAPE[1] - half - 8, SHAPE[0])
    motions = [m[:, 2] for m in feature_motions(reference, later, region)]
    assert motions and all(np.abs(m).max() < 1 for m in motions)


@pytest.mark.parametrize("leap_px", [10.0, 60.0])
def test_a_block_that_leaps_is_found_in_the_same_picture(leap_px: float) -> None:
    found = finding.leaping(leap_px, 32, 16)
    assert found.right >= 0.99 and found.wrong == 0


# -- patterns that repeat ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("pattern", PATTERNS)
@pytest.mark.parametrize("motion", finding.MOTIONS)
def test_no_value_is_wrong_by_a_period(pattern: str, motion: str) -> None:
    shown = finding.cornered(PATTERNS[pattern]) if "corner" in motion else PATTERNS[pattern]
    for found in finding.repeated(shown, finding.MOTIONS[motion], 48, 48):
        assert found.wrong == 0
        assert found.right >= 0.95


def measured(shift: float) -> StrainField:
    x, y = pixels(SHAPE)
    kernel = PhaseKernel(finding.picture(finding.crossed(x, y), 0), finding.grid(48, 48), noise=NOISE_GL)
    return kernel.measure(finding.picture(finding.crossed(x - shift * PERIOD, y), 7), noise=NOISE_GL)


def test_half_a_period_is_ambiguous_and_less_is_not() -> None:
    assert measured(0.35).ok[:, :-1].all()  # the last column leaves the picture
    half = measured(0.5)
    assert (half.status[:, :-1] == Status.AMBIGUOUS).all()
    assert np.isnan(half.u).all()


def test_a_strain_of_whole_periods_across_the_picture_is_ambiguous_without_more() -> None:
    """Every third place stands still in a motion of one to two periods: none is taken for that."""
    x, y = pixels(SHAPE)
    kernel = PhaseKernel(finding.picture(finding.crossed(x, y), 0), finding.grid(48, 48), noise=NOISE_GL)
    moved = finding.picture(finding.crossed(*affine(SHAPE, u=13.0, du_dx=0.03)), 1)
    field = kernel.measure(moved, noise=NOISE_GL)
    assert not field.ok.any() and (field.status[:, :-1] == Status.AMBIGUOUS).all()


def test_the_period_of_each_zoi_is_known() -> None:
    grid = finding.grid(48, 48)
    shown = finding.cornered(finding.crossed)(*pixels(SHAPE))
    period = PhaseKernel(finding.picture(shown, 0), grid, noise=NOISE_GL).period
    x, y = finding.centres(grid)
    random, regular = (x < -90 - 24) & (y < -70 - 24), (x > -90 + 24) | (y > -70 + 24)
    assert np.isinf(period[random]).all()
    assert np.allclose(period[regular], PERIOD, atol=0.02)


def test_side_peaks_are_those_of_the_lattice() -> None:
    level = finding.crossed(*pixels(SHAPE)).astype(np.float32)
    places = np.array([40.0, 300.0]), np.array([40.0, 300.0])
    found = dict(side_peaks(level, WHOLE, *places))
    assert set(found) == {(9, 0), (0, 9), (9, 9), (-9, 9)}
    assert all(near.all() for near in found.values())


def tiled(side: int, u: float = 0.0, v: float = 0.0, across: bool = True) -> np.ndarray:
    """One piece of ``side`` px again and again along y, and ``across`` along x too, moved by (u, v) without an edge."""
    shape = side, side if across else 900
    fy, fx = np.fft.fftfreq(shape[0])[:, None], np.fft.rfftfreq(shape[1])[None]
    blurred = np.exp(-2 * (np.pi * 2.5) ** 2 * (fy**2 + fx**2) - 2j * np.pi * (fx * u + fy * v))
    piece = np.fft.irfft2(np.fft.rfft2(np.random.default_rng(side).normal(0, 1, shape)) * blurred, shape)
    rows, columns = (-(-whole // part) for whole, part in zip(SHAPE, shape, strict=True))
    level = 0.5 + 0.18 * np.tile(piece / piece.std(), (rows, columns))[: SHAPE[0], : SHAPE[1]]
    return finding.picture(level, int(side + 10 * u))


@pytest.mark.parametrize("side", [20, 37, 65, 130, 200, 260])
@pytest.mark.parametrize(("motion", "in_periods"), [
    ((0.3, 0.2), False), ((2.1, -1.4), False), ((0.3, -0.47), True), ((0.45, 0.45), True),
])  # fmt: skip
def test_a_printed_tile_has_moved_to_the_nearest_place(
    side: int, motion: tuple[float, float], in_periods: bool
) -> None:
    u, v = (m * (side if in_periods else 1) for m in motion)
    zois = finding.grid(32, 32)
    kernel = PhaseKernel(tiled(side), zois, noise=NOISE_GL)
    assert np.nanmedian(kernel.period) == pytest.approx(side, abs=0.05)
    field = kernel.measure(tiled(side, u, v), noise=NOISE_GL)
    here = finding.centres(zois)
    found = finding.compared(field, (here[0] + u, here[1] + v), (u + 0 * here[0], v + 0 * here[0]))
    assert found.wrong == 0 and found.right >= 0.95


def test_a_pattern_that_repeats_one_way_alone_may_move_the_other_way() -> None:
    kernel = PhaseKernel(tiled(130, across=False), finding.grid(32, 32), noise=NOISE_GL)
    field = kernel.measure(tiled(130, 90.0, 50.0, across=False), noise=NOISE_GL)
    assert field.ok.mean() > 0.5
    assert np.nanmax(np.hypot(field.u - 90, field.v - 50)) < 0.2


def test_half_a_period_of_a_tile_is_ambiguous_and_what_it_may_move_by_is_said() -> None:
    kernel = PhaseKernel(tiled(130), finding.grid(32, 32), noise=NOISE_GL)
    field = kernel.measure(tiled(130, 65.0), noise=NOISE_GL)
    assert not field.ok.any() and (field.status == Status.AMBIGUOUS).mean() > 0.5
    assert "repeats every 130.0 px" in repetition_text(kernel.period)


# -- what is missing -----------------------------------------------------------------------------------------------

GRID = ZoiGrid.cover(Roi(0, 0, 160, 160), size=16, step=16)


def with_lost(rows: slice, columns: slice, status: Status = Status.LOST) -> StrainField:
    statuses = np.zeros(GRID.shape, np.uint8)
    statuses[rows, columns] = status
    return StrainField.from_values(GRID, {}, status=statuses)


def test_a_mean_over_a_map_that_lost_a_block_stands_for_the_rest() -> None:
    block = with_lost(np.s_[:5], np.s_[:4])
    assert area_share(block) == pytest.approx(0.8)
    left = np.arange(10) < 5
    assert area_share(block, np.broadcast_to(left, GRID.shape)) == pytest.approx(0.6)
    assert area_share(block, np.broadcast_to(~left, GRID.shape)) == 1.0


@pytest.mark.parametrize("field", [
    with_lost(np.s_[::2], np.s_[::2]),  # one here, one there
    with_lost(np.s_[:5], np.s_[:4], Status.NO_PATTERN),
    with_lost(np.s_[:5], np.s_[:4], Status.NOT_MEASURED),
    with_lost(np.s_[:2], np.s_[:4]),
])  # fmt: skip
def test_it_stands_for_all_where_no_block_was_lost(field: StrainField) -> None:
    assert area_share(field) == 1.0


def test_a_block_is_what_lies_side_by_side() -> None:
    where = np.zeros((6, 8), bool)
    where[:3, :3] = where[4, 4:] = True
    assert np.array_equal(in_blocks(where), where & (np.arange(6) < 3)[:, None])


def test_found_is_a_number_of_zois() -> None:
    field = StrainField.from_values(GRID, {"u": 3.0})
    here = (np.zeros(GRID.shape), np.zeros(GRID.shape))
    nowhere = np.zeros(GRID.shape)
    assert finding.compared(field, here, (nowhere + 3.0, nowhere)) == Found(100, 1.0, 0)
    assert finding.compared(field, here, (nowhere, nowhere)) == Found(100, 0.0, 100)


SIZE, REACH, MARGIN = 24, 3, 24 + 2 * 3


def matched(
    reference: np.ndarray, deformed: np.ndarray, firsts: np.ndarray, guesses: np.ndarray
) -> np.ndarray:
    padded = np.pad(deformed, MARGIN, mode="reflect")
    out = np.full((len(firsts), 2), np.nan)
    match(reference, padded, MARGIN, firsts, SIZE, guesses, REACH, out)
    return out


def pattern(seed: int, size: int = 120) -> np.ndarray:
    return np.random.default_rng(seed).normal(100, 20, (size, size)).astype(np.float32)


def plain(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.corrcoef(a.ravel().astype(float), b.ravel().astype(float))[0, 1])


def test_a_moved_block_is_found_from_the_better_of_its_guesses() -> None:
    reference = pattern(1)
    deformed = np.roll(reference, (5, -7), axis=(0, 1))
    firsts = np.array([[40, 40], [60, 33]], np.int64)
    guesses = np.array([[[0, 0], [-5, 4]], [[-9, 7], [-9, 7]]], np.int64)
    assert matched(reference, deformed, firsts, guesses).tolist() == [[-7, 5], [-7, 5]]


@pytest.mark.parametrize("seed", range(5))
def test_it_is_the_place_of_the_highest_correlation(seed: int) -> None:
    """Brighter and with more contrast, which correlation does not see."""
    reference, deformed = pattern(seed), 3 * pattern(seed + 50) + 500
    first = np.array([[50, 45]], np.int64)
    [(u, v)] = matched(reference, deformed, first, np.zeros((1, 1, 2), np.int64))
    block = reference[50 : 50 + SIZE, 45 : 45 + SIZE]
    scores = {
        (x, y): plain(block, deformed[50 + y : 50 + y + SIZE, 45 + x : 45 + x + SIZE])
        for x in range(-REACH, REACH + 1)
        for y in range(-REACH, REACH + 1)
    }
    assert max(scores, key=scores.__getitem__) == (u, v)


def test_a_block_without_contrast_stays_at_its_guess() -> None:
    flat, guesses = np.full((120, 120), 7, np.float32), np.array([[[2, -1]]], np.int64)
    first = np.array([[50, 45]], np.int64)
    assert matched(flat, pattern(1), first, guesses).tolist() == [[2, -1]]
    found = matched(pattern(1), flat, first, guesses)
    assert np.abs(found - (2, -1)).max() <= REACH


def test_a_guess_beyond_the_picture_is_moved_inside() -> None:
    reference = pattern(3)
    first = np.array([[90, 90], [0, 0]], np.int64)
    found = matched(reference, reference, first, np.array([[[500, 500]], [[-500, -500]]], np.int64))
    assert np.isfinite(found).all() and (np.abs(found) < 120).all()
