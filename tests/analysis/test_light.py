"""What the grey levels show of light and bits, against numpy's percentiles."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.quality.exposure import depth, exposure


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
