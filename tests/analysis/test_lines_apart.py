"""Lines that cross or fall on one another: bands are taken off all the same, within their size."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.kernel.lines import APART, _profile, apart

SIZE, ROWS = 32, 200


def profile(v: Any, stretch: float = 0.0, axis: int = 0, across: float = 0.0) -> np.ndarray:
    """What is taken off each line of 200, of ZOIs every 16 px with bands of amplitude 3 that moved by ``v`` px.

    ``axis`` 0: rows, and v is the displacement along y; 1: columns, along x. ``across`` is the other displacement.
    """
    starts = np.arange(0, ROWS - 2 * SIZE, 16)
    n = len(starts)
    p = np.zeros((n, 6))
    own, other = (3, 0) if axis == 0 else (0, 3)
    p[:, own], p[:, own + 2 - axis], p[:, other], p[:, other + 1 + axis] = v, stretch, across, across / 50
    moved = starts[:, None] + np.arange(SIZE) + np.broadcast_to(v, n)[:, None]
    left = 3.0 * np.sin(2 * np.pi * moved / 12)
    origins = np.zeros((n, 2), int)
    origins[:, axis] = starts
    ready = SimpleNamespace(origins=origins, shape=(ROWS, 64) if axis == 0 else (64, ROWS))
    reference = SimpleNamespace(prepared=ready, grid=SimpleNamespace(size=SIZE), affine=slice(None))
    solution: Any = SimpleNamespace(reference=reference, found=SimpleNamespace(p=p))
    return _profile(solution, np.arange(n), left, axis)


@pytest.mark.parametrize("axis", [0, 1])
def test_bands_move_with_the_displacement_across_them_alone(axis: int) -> None:
    """Of rows with v and dv_dy, of columns with u and du_dx."""
    found, lines = profile(5.3, axis=axis, across=-9.0), np.arange(ROWS)
    inside = (lines > 8) & (lines < 130)
    np.testing.assert_allclose(found[inside], 3 * np.sin(2 * np.pi * lines[inside] / 12), atol=0.05)


def test_bands_of_a_whole_field_are_found() -> None:
    found, rows = profile(5.3), np.arange(ROWS)
    inside = (rows > 8) & (rows < 130)
    np.testing.assert_allclose(found[inside], 3 * np.sin(2 * np.pi * rows[inside] / 12), atol=0.05)


@pytest.mark.parametrize("v", [
    np.array([0, 0, 0, 0, 0, 0, 0, 0, -70.0]), np.array([40.0, 30, 20, 10, 0, -10, -20, -30, -40]),
    np.array([0, 0, 0, 0, -16.0, -16, -16, -16, -16]), np.linspace(0, -128, 9), np.array([0.0, 60] * 4 + [0]),
])  # fmt: skip
def test_lines_that_cross_give_no_error_and_nothing_beyond_their_size(v: np.ndarray) -> None:
    found = profile(v)
    assert np.isfinite(found).all() and np.abs(found).max() < 12.0


def test_a_field_pressed_into_one_line_takes_nothing_off() -> None:
    assert not profile(-np.arange(0, ROWS - 2 * SIZE, 16.0), stretch=-1.0).any()


def test_places_are_taken_in_order_and_apart() -> None:
    assert apart(np.array([3.0, 1.0, 1.4, 2.0, 2.0 + APART, 9.0])) == [1, 3, 4, 0, 5]
    assert apart(np.arange(5.0)) == [0, 1, 2, 3, 4]
