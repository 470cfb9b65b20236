"""Explicit vectors in compiled loops, and the moments that are made with them, against numpy."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.compiled.loops import helper
from analysis.compiled.vectors import LANES, load, spread, store, total, whole
from analysis.field.windows import profile
from analysis.fit.moments import (
    CHANNELS,
    DEGREES,
    DIFFERENCE_ROWS,
    PRODUCT,
    PRODUCT_ROWS,
    SQUARE_ROWS,
    add_difference_columns,
    difference_moments,
    product_moments,
)
from analysis.fit.sensitivity import square_rows
from analysis.fit.shapes import shapes_of

RNG = np.random.default_rng(7)
HEIGHT, PITCH = 90, 112


@helper
def every_operation(a: np.ndarray, at: np.uintp, factor: np.float32, out: np.ndarray) -> float:
    v = load(a, at)
    w = spread(factor)
    s = v * w - w
    s += v + w
    store(out, np.uintp(1), s)
    return total(s)


@helper
def of_the_difference(images, samples, at, pitch, g, line, size, rows, columns, out):
    for first in range(0, size, 16):
        count = min(16, size - first)
        add_difference_columns(
            images, samples, at + np.uintp(first) * pitch, pitch, g[first * line :], np.uintp(line), first,
            count, rows, columns,
        )  # fmt: skip
    return difference_moments(columns, rows, line, out)


def test_a_vector_does_what_is_said() -> None:
    a, out = RNG.normal(size=LANES + 5).astype(np.float32), np.zeros(LANES + 3, np.float32)
    found = every_operation(a, 3, np.float32(1.5), out)
    expected = a[3 : 3 + LANES] * 1.5 - 1.5 + a[3 : 3 + LANES] + 1.5
    assert out[1:-2] == pytest.approx(expected, rel=1e-6)
    assert (out[0], *out[-2:]) == (0, 0, 0)
    assert found == pytest.approx(expected.sum(), rel=1e-5)


def test_a_two_dimensional_array_is_flat_memory() -> None:
    a, out = RNG.normal(size=(3, LANES)).astype(np.float32), np.zeros(LANES + 3, np.float32)
    every_operation(a, LANES, np.float32(0), out)
    assert np.array_equal(out[1 : 1 + LANES], a[1])


@pytest.mark.parametrize(("size", "rounded"), [(LANES, LANES), (LANES + 1, 2 * LANES), (1, LANES)])
def test_whole_vectors(size: int, rounded: int) -> None:
    assert whole(size) == rounded


@pytest.mark.parametrize("size", [9, 32, 57])
def test_moments_of_the_difference(size: int) -> None:
    images = RNG.normal(size=(CHANNELS, HEIGHT, PITCH)).astype(np.float32)
    top, left, line = 5, 7, whole(size)
    g = np.full((size, line), 1e3, np.float32)  # what lies beyond the ZOI must not count
    g[:, :size] = RNG.normal(size=(size, size))
    shapes = shapes_of(profile("gaussian", size), line)
    out, columns = np.zeros((CHANNELS, DEGREES, DEGREES)), np.zeros((DIFFERENCE_ROWS, line), np.float32)
    energy = of_the_difference(
        images.ravel(), HEIGHT * PITCH, top * PITCH + left, PITCH, g.ravel(), line, size, shapes.rows, columns, out
    )  # fmt: skip
    fx, fy, f, raw = images[:, top : top + size, left : left + size].astype(float)
    d, rows = g[:, :size] - raw, shapes.rows[:, :size].astype(float)
    assert energy == pytest.approx(rows[0] @ d**2 @ rows[0], rel=1e-5)
    for channel, (image, degrees) in enumerate(((fx, 4), (fy, 4), (f, 2), (1.0, 2))):
        expected = rows @ (d * image) @ rows.T
        for j in range(degrees):
            for i in range(degrees - j):
                assert out[channel, j, i] == pytest.approx(expected[j, i], abs=1e-4 * size)


@pytest.mark.parametrize("order", [1, 2])
def test_moments_of_products(order: int) -> None:
    size = 25
    images = RNG.normal(size=(3, HEIGHT, PITCH)).astype(np.float32)
    top, left, line = 11, 3, whole(size)
    window = profile("gaussian", size)
    powers, squares = shapes_of(window, line).powers, square_rows(window, line)
    of_w, of_q = np.zeros((10, PRODUCT_ROWS, PRODUCT_ROWS)), np.zeros((10, PRODUCT_ROWS, PRODUCT_ROWS))
    one = np.ones(line, np.float32)
    columns = np.zeros((PRODUCT_ROWS + SQUARE_ROWS, line), np.float32)
    product_moments(
        images.ravel(), images.ravel(), one, 0, 0, one, HEIGHT * PITCH, top * PITCH + left, PITCH, size,
        powers, squares, order, columns, of_w, of_q,
    )  # fmt: skip
    parts = [*images[:, top : top + size, left : left + size].astype(float), np.ones((size, size))]
    w, q = powers[:, :size].astype(float), squares[:, :size].astype(float)
    for a in range(4):
        for b in range(a, 4):
            product = parts[a] * parts[b]
            for found, rows, most in ((of_w, w, 3 + order), (of_q, q, 2 * order)):
                expected = rows @ product @ rows.T
                for y in range(most + 1):
                    for x in range(most + 1 - y):
                        assert found[PRODUCT[a, b], y, x] == pytest.approx(expected[y, x], abs=1e-3)
