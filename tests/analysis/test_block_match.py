"""Small blocks found in another picture, to a whole pixel."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.follow.block_match import match

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
