"""Parts of the examination of a picture, by value: repeats, lines, wild pixels and grey levels."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from analysis.field import Roi
from analysis.follow.repetition import side_peaks
from analysis.kernel.lines import APART, _profile, apart
from analysis.picture.impulses import without_impulses
from analysis.picture.pattern import BLOCKS, blockiness
from analysis.quality.pattern import depth, exposure
from tests.analysis.speckle import picture


def test_a_picture_of_whole_periods_has_the_nearest_of_them() -> None:
    tile = np.random.default_rng(1).normal(0, 100, (100, 100))
    image = np.tile(tile, (7, 9)).astype(np.float32)
    none = np.zeros(0)
    found = {place for place, _ in side_peaks(image, Roi(0, 0, 900, 700), none, none)}
    assert {(100, 0), (0, 100)} <= found


@pytest.mark.parametrize("sigma", [1.0, 2.0])
def test_odd_periods_are_seen_in_a_picture_that_is_halved(sigma: float) -> None:
    """To a pixel or two, from where each ZOI is brought to its own place."""
    tile = gaussian_filter(np.random.default_rng(1).normal(0, 100, (283, 301)), sigma, mode="wrap")
    image = np.tile(tile, (4, 4))[:1001, :1201].astype(np.float32)
    none = np.zeros(0)
    found = {place for place, _ in side_peaks(image, Roi(40, 40, 1121, 921), none, none)}
    for period in ((301, 0), (0, 283)):
        assert min(math.dist(period, place) for place in found) <= 2


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


RNG = np.random.default_rng(2)


@pytest.mark.parametrize("wild", [0, 4095])
def test_hot_and_dead_pixels_get_the_median_of_their_neighbours(wild: int) -> None:
    image = picture().copy()
    rows, columns = np.meshgrid(np.arange(9, image.shape[0] - 9, 9), np.arange(9, image.shape[1] - 9, 9))
    clean = image.copy()
    image[rows, columns] = wild
    out = without_impulses(image)
    assert out is not None
    changed = np.argwhere(out != image)
    assert len(changed) > 0.9 * rows.size
    for y, x in changed[:40]:
        around = np.delete(clean[y - 1 : y + 2, x - 1 : x + 2].ravel().astype(float), 4)
        assert out[y, x] == np.rint(np.median(around))


@pytest.mark.parametrize(("down", "across", "wild"), [(6, 6, True), (4, 7, False)])
def test_up_to_three_pixels_in_a_hundred_are_wild(down: int, across: int, wild: bool) -> None:
    image = np.random.default_rng(3).normal(1000, 5, (200, 240)).round().astype(np.uint16)
    image[3::down, 4::across] = 4095  # 2.8 or 3.6 %
    assert (without_impulses(image) is not None) is wild


def test_two_wild_pixels_that_touch_are_both_mended() -> None:
    image = np.random.default_rng(3).normal(1000, 5, (200, 240)).round().astype(np.uint16)
    image[5::12, 4::12] = image[5::12, 5::12] = 4095
    out = without_impulses(image)
    assert out is not None and out[4:-4, 4:-4].max() < 1100


@pytest.mark.parametrize(("period", "found"), [(8, 1.25), (16, 1.125)])
def test_blockiness_is_that_of_third_differences_at_the_borders_of_blocks(period: int, found: float) -> None:
    """They are 8 GL, up and down, and a quarter more at every border."""
    steps = 8.0 * (-1.0) ** np.arange(61)
    steps[::period] *= 1.25
    line = np.zeros(64)
    line[1:] = np.cumsum(np.concatenate([[0.0], np.cumsum(np.concatenate([[0.0], np.cumsum(steps)]))]))
    image = np.repeat(line[:, None], 40, axis=1).astype(np.float32)
    for one in (image, image.T):
        assert blockiness(one) == pytest.approx(found, rel=1e-3)
    assert 1.25 < BLOCKS < 1.35 and blockiness(image[:31]) == 1.0


@pytest.mark.parametrize(("bits", "kind"), [(8, np.uint8), (12, np.uint16)])
def test_percentiles_and_mean(bits: int, kind: type) -> None:
    top = 2**bits - 1
    pixels = np.random.default_rng(0).beta(2, 5, (3, 1001)) * top
    pixels = pixels.astype(kind)
    found = exposure(pixels, top)
    low, high = np.percentile(pixels, [1, 99]) / top
    assert (found.low, found.high) == (pytest.approx(low, abs=1e-12), pytest.approx(high, abs=1e-12))
    assert found.mean == pytest.approx(pixels.mean() / top)


def test_percentiles_lie_between_values() -> None:
    pixels = np.array([[0, 10, 20, 40, 200]], np.uint8)
    low, high = np.percentile(pixels, [1, 99]) / 255
    found = exposure(pixels, 255)
    assert (found.low, found.high) == (pytest.approx(low), pytest.approx(high))


def test_saturated_and_dark_in_any_frame() -> None:
    pixels = np.full((2, 10), 100, np.uint8)
    pixels[0, 0] = pixels[1, 1] = pixels[0, 2] = pixels[1, 2] = 255
    pixels[1, 9] = 0
    found = exposure(pixels, 255)
    assert (found.saturated, found.dark, found.piled) == (0.3, 0.1, 0.0)


def test_values_piled_up_below_the_top() -> None:
    pixels = np.array([[10, 235, 235, 235], [20, 30, 40, 50]], np.uint8)
    assert exposure(pixels, 255).piled == 3 / 8


def test_bits_that_change() -> None:
    found = depth(np.array([[0b0000_0100, 0b0010_0100], [0b0001_1000, 0b0000_0000]], np.uint8), 8)
    assert (found.unused_above, found.unused_below, found.changing) == (2, 2, 4)
    assert depth(np.full((2, 3), 7, np.uint8), 8).changing == 0
