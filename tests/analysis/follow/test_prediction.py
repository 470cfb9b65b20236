"""The start of each ZOI in the next frame: averages noise away, follows what moves, survives a lost ZOI."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.field.motion import Motion
from analysis.follow.alpha_beta import AGE_MOVED, OLDEST
from analysis.follow.prediction import motion_after

SIGMA, LEVER, A = 0.01, 5.0, 4000
UNIT = np.array([1, 1 / LEVER, 1 / LEVER] * 2) * SIGMA


def follow(truth: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, Motion]:
    """Rms of what was not predicted, in standard deviations, frame by frame; truth (frames, modes)."""
    motion = Motion.none(np.arange(A), 6)
    values = truth[0] + UNIT * rng.standard_normal((A, 6))
    missed = []
    for now in truth[1:]:
        guess = values + motion.ahead
        values = now + UNIT * rng.standard_normal((A, 6))
        missed.append(float(np.sqrt(np.mean(((values - guess) / UNIT) ** 2))))
        motion = motion_after(motion, values, guess, np.full(A, SIGMA), LEVER)
    return np.array(missed), motion


def test_a_steady_motion_is_predicted_better_than_from_the_last_frame() -> None:
    frames = np.arange(40)[:, None]
    velocity = np.array([0.2, 1e-4, 0, -0.1, 0, 2e-4])
    missed, motion = follow(frames * velocity, np.random.default_rng(1))
    # An alpha-beta filter of 0.4 and 0.1: sqrt(1.45); the difference of two frames alone: sqrt(6).
    assert missed[-1] == pytest.approx(np.sqrt(1.45), rel=0.03)
    assert np.all(np.diff(missed[1:6]) < 0)
    assert motion.change.mean(axis=0) == pytest.approx(velocity, abs=1e-4)
    assert np.median(motion.age) == OLDEST


def test_after_a_jolt_it_starts_from_what_was_measured() -> None:
    truth = np.zeros((30, 6))
    truth[20:, 0] = 1.0
    missed, motion = follow(truth, np.random.default_rng(2))
    assert missed[19] > 30
    assert missed[20] < 20  # a part of the jolt is taken for motion
    assert missed[-1] < 2
    assert motion.age.max() < OLDEST


def test_a_lost_zoi_is_forgotten_and_begins_anew() -> None:
    motion = Motion(np.arange(2), np.ones((2, 6)), np.ones((2, 6)), np.full(2, 9, np.uint8))
    values = np.ones((2, 6))
    values[0, 4] = np.nan
    after = motion_after(motion, values, np.ones((2, 6)), np.full(2, SIGMA), LEVER)
    assert after.age.tolist() == [1, 10]
    assert not after.change[0].any() and not after.ahead[0].any()
    assert np.array_equal(after.change[1], np.ones(6))


def test_news_beyond_noise_reset_the_age() -> None:
    motion = Motion(np.arange(1), np.zeros((1, 6)), np.zeros((1, 6)), np.full(1, 9, np.uint8))
    values = np.zeros((1, 6))
    values[0, 5] = 10 * SIGMA / LEVER
    after = motion_after(motion, values, np.zeros((1, 6)), np.full(1, SIGMA), LEVER)
    assert after.age[0] == AGE_MOVED
    assert after.ahead[0, 5] == after.change[0, 5] == pytest.approx(0.4 * values[0, 5])


def test_it_is_of_the_same_zois_or_of_none() -> None:
    motion = Motion.none(np.array([0, 2, 3]), 6)
    assert motion.fits(np.array([0, 2, 3]), 6)
    assert not motion.fits(np.array([0, 1, 3]), 6)
    assert not motion.fits(np.array([0, 2]), 6)
    assert not motion.fits(np.array([0, 2, 3]), 12)
