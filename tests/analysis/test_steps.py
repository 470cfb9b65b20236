"""Steps by value: uphill, predicted for the next frame, and the end of the iteration."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from analysis.field import Motion
from analysis.fit.iteration import _converged, within_image
from analysis.fit.kernel_args import PictureArgs
from analysis.follow.hill_climb import climbed
from analysis.follow.prediction import motion_after
from analysis.picture.splines import Box

SIZE = 20
SMOOTH = gaussian_filter(np.random.default_rng(3).normal(0, 1, (90, 110)), 4).astype(np.float32) * 1000


def climb(
    deformed: np.ndarray, origin: tuple[int, int], candidates: list[tuple[int, int]], moves: int
) -> tuple[list[int], float]:
    found, score = climbed(
        SMOOTH,
        deformed,
        np.float32(5),
        np.array([origin], np.int64),
        SIZE,
        np.array([candidates], np.int64),
        moves,
    )
    return found[0].tolist(), float(score[0])


def correlation(deformed: np.ndarray, origin: tuple[int, int], x: int, y: int) -> float:
    top, left = origin
    here = SMOOTH[top : top + SIZE, left : left + SIZE].astype(float)
    there = deformed[top + y : top + y + SIZE, left + x : left + x + SIZE].astype(float)
    return float(np.corrcoef(here.ravel(), there.ravel())[0, 1])


@pytest.mark.parametrize("way", [1, -1])
def test_uphill_from_the_best_candidate_by_so_many_moves(way: int) -> None:
    """Brighter, with more contrast, and moved by 6 px along x and 4 px against y, or the other way."""
    deformed = 3 * np.roll(SMOOTH, (-4 * way, 6 * way), axis=(0, 1)) + 40
    origin, candidates = (40, 50), [(-9, 9), (3, -2), (3, -2), (0, 0)]
    for moves, x, y in ((0, 3, -2), (1, 4, -3), (2, 5, -4), (9, 6, -4)):
        found, score = climb(deformed, origin, [(way * a, way * b) for a, b in candidates], moves)
        assert found == [way * x, way * y]
        assert score == pytest.approx(correlation(deformed, origin, way * x, way * y), abs=1e-4)


@pytest.mark.parametrize(("x", "y"), [(40, 0), (-50, 0), (0, 30), (0, -40)])
def test_a_zoi_is_found_up_to_the_very_edge(x: int, y: int) -> None:
    """From row 40 and column 50 of 90 x 110 px to the last ones; one pixel further there is nothing."""
    deformed = np.roll(SMOOTH, (y, x), axis=(0, 1))
    found, score = climb(deformed, (40, 50), [(x, y)], 0)
    assert found == [x, y] and score == pytest.approx(1, abs=1e-4)
    beyond = (x + int(np.sign(x)), y + int(np.sign(y)))
    assert climb(deformed, (40, 50), [beyond], 0) == (list(beyond), -2.0)
    assert climb(np.full_like(SMOOTH, 7), (40, 50), [(0, 0)], 3)[1] == -1.0


def predicted(age: int, news: float, mode: int = 0, sigma: float = 0.01) -> tuple[float, float, int]:
    """Change, step ahead and age of a mode that changed by 1 a frame and is ``news`` beside its prediction."""
    before = Motion(np.arange(1), np.ones((1, 6)), np.ones((1, 6)), np.full(1, age, np.uint8))
    values = np.zeros((1, 6))
    values[0, mode] = news
    after = motion_after(before, values, np.zeros((1, 6)), np.full(1, sigma), 5.0)
    return float(after.change[0, mode]), float(after.ahead[0, mode]), int(after.age[0])


@pytest.mark.parametrize("age", [1, 2, 3, 7, 8, 19, 20, 200])
def test_the_gains_are_those_of_a_line_through_the_frames_so_far(age: int) -> None:
    """Position and slope at the last of n points, of its own value; a floor of 0.4 and 0.1."""
    n = min(age + 1, 20)
    design = np.stack([np.ones(n), np.arange(n) - (n - 1.0)], axis=1)
    alpha, beta = (np.linalg.pinv(design)[:, -1]).tolist()
    alpha, beta = max(alpha, 0.4), max(beta, 0.1)
    change, ahead, now = predicted(age, 0.02)
    assert (change, now) == (pytest.approx(1 + beta * 0.02), n)
    assert ahead == pytest.approx(1 + beta * 0.02 - (1 - alpha) * 0.02)


@pytest.mark.parametrize(("mode", "unit"), [(0, 1.0), (3, 1.0), (1, 0.2), (2, 0.2), (5, 0.2)])
def test_news_beyond_four_sigmas_are_motion(mode: int, unit: float) -> None:
    """A gradient counts by a lever of 5 px; of three frames or fewer noise is not known from motion."""
    noise, motion = predicted(9, 0.039 * unit, mode), predicted(9, 0.041 * unit, mode)
    assert noise[2] == 10 and motion[2] == 3
    assert motion[:2] == pytest.approx((1 + 0.4 * 0.041 * unit,) * 2)
    assert predicted(2, 0.041 * unit, mode)[::2] == (pytest.approx(1 + 0.5 * 0.041 * unit), 3)
    assert predicted(3, 0.041 * unit, mode)[0] == pytest.approx(1 + 0.4 * 0.041 * unit)


@pytest.mark.parametrize("age", [1, 3, 9])
def test_after_a_leap_the_motion_is_the_last_difference(age: int) -> None:
    """Of a picture far away and back nothing is left after two frames: it was no motion that goes on."""
    assert predicted(age, 40.0)[:2] == pytest.approx((41.0, 41.0))
    assert predicted(9, 1.01)[0] == pytest.approx(2.01)
    assert predicted(9, 0.99)[0] == pytest.approx(1 + 0.4 * 0.99)
    motion, guess = Motion.none(np.arange(1), 6), np.zeros((1, 6))
    for frame in range(12):
        values = np.zeros((1, 6))
        values[0, 0] = 40.0 if frame == 5 else 0.05 * frame
        motion = motion_after(motion, values, guess, np.full(1, 0.01), 5.0)
        guess = values + motion.ahead
        if frame in (8, 9, 10):
            assert guess[0, 0] == pytest.approx(0.05 * (frame + 1), abs=1e-6)


@pytest.mark.parametrize(
    ("step", "length"),
    [((0.02, 0, 0, 0.01, 0, 0), 0.02), ((0, 0, 0, -0.03, 0, 0), 0.03), ((0, 0.002, 0, 0, 0, -0.004), 0.02)],
)
def test_an_iteration_ends_by_what_a_step_leaves(step: tuple[float, ...], length: float) -> None:
    """0.3 % of it, 1.15 of the noise of one image, 3 % of its square; of a gradient by a lever of 5 px."""
    for trust in (0.0, 0.02):
        left = length * (0.003 + 1.15 * trust + 0.03 * length)
        moved = np.array(step)
        assert _converged(moved, 3, 5.0, 1.01 * left, 1.01 * left / 5, trust)
        assert not _converged(moved, 3, 5.0, 0.99 * left, 1.01 * left / 5, trust)
        assert not _converged(moved, 3, 5.0, 1.01 * left, 0.99 * left / 5, trust)
    assert not _converged(np.array([math.nan, 0, 0, 0, 0, 0]), 3, 5.0, 1.0, 1.0, 0.0)


@pytest.mark.parametrize(("u", "v", "du_dx", "inside"), [
    (29.0, 0.0, 0.0, True), (32.0, 0.0, 0.0, False), (-49.0, 0.0, 0.0, True), (-52.0, 0.0, 0.0, False),
    (0.0, 29.0, 0.0, True), (0.0, 32.0, 0.0, False), (0.0, -39.0, 0.0, True), (0.0, -42.0, 0.0, False),
    (29.0, 0.0, 0.4, False), (29.0, 0.0, -0.4, True),
])  # fmt: skip
def test_a_zoi_leaves_the_image_by_its_corners(u: float, v: float, du_dx: float, inside: bool) -> None:
    """Of 20 px from row 40 and column 50 on, in an image of 90 x 100 px."""
    box, out = Box(0, 90, 0, 100), np.zeros(1, bool)
    picture = PictureArgs.within(np.zeros(4, np.float32), (90, 100), box, 0.5)
    parameters = np.array([[u, du_dx, 0.0, v, 0.0, 0.0]])
    within_image(picture, np.array([[40, 50]], np.int64), SIZE, parameters, out)
    assert out[0] == inside
