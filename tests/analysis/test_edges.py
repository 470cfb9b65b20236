"""Pictures with an edge or a corner in place of a pattern: no ZOI has a value, and those beside keep theirs."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest

from analysis import KernelSettings, PhaseKernel, Roi, Status, ZoiGrid
from analysis.fit.kernel_args import CONVERGED, OutArgs, PooledError, ReferenceArgs, VerdictArgs
from analysis.fit.validity import information
from analysis.fit.verdict import judge
from analysis.kernel.prepared import PatternError
from tests.accuracy.edges import box, valid_on_box
from tests.accuracy.truth import Speckle, pixels

GRID = ZoiGrid.cover(Roi(8, 8, 304, 304), 32, 8)


@pytest.mark.parametrize("noise", [0.0, 0.5, 1.0, 2.0])
@pytest.mark.parametrize("blur", [0.0, 1.5])
def test_nothing_but_a_black_box_has_no_value(noise: float, blur: float) -> None:
    for motion in (0.0, 3.3):
        assert valid_on_box(GRID, noise, blur, motion) == 0


def test_a_pattern_beside_a_box_keeps_its_values() -> None:
    level = 255 * Speckle(2.0, 1).at(*pixels((320, 320)))
    level[100:240, 80:220] = 10
    first, second = (np.rint(level + np.random.default_rng(k).normal(0, 1, level.shape)) for k in (1, 2))
    field = PhaseKernel(first.clip(0, 255).astype(np.uint8), GRID).measure(
        second.clip(0, 255).astype(np.uint8)
    )
    x, y = np.meshgrid(GRID.x, GRID.y)
    apart = (np.abs(x - 149.5) > 70 + 8) | (np.abs(y - 169.5) > 70 + 8)
    assert field.ok[apart].all()
    within = (np.abs(x - 149.5) < 70 - 12) & (np.abs(y - 169.5) < 70 - 12)
    assert not field.ok[within].any()


def test_what_only_the_filter_spread_into_a_zoi_is_no_pattern() -> None:
    """Beside a sharp edge without noise the filtered picture swings where the picture itself is even."""
    picture = box(0.0, 0.0)
    y, x = 224, 200  # the corner is 20 px to the right and 16 px below
    assert np.ptp(picture[y - 16 : y + 16, x - 16 : x + 16]) == 0
    grid = ZoiGrid.cover(Roi(x - 16, y - 16, 32, 32), 32, 8)
    with pytest.raises(PatternError):
        PhaseKernel(np.rint(picture).astype(np.uint8), grid)


def test_information_of_a_full_pattern_and_of_one_known_badly() -> None:
    line = np.exp(-0.5 * (6 * (np.arange(32) - 15.5) / 32) ** 2)
    xi = (np.arange(32) - 15.5) / 16
    weight, second = line.sum() ** 2, line.sum() * (line @ xi**2)
    inverse = np.zeros((2, 15, 15), np.float32)
    energy = np.array([[9.0, 4.0], [9.0, 4.0]])
    for z, share in enumerate((1.0, 0.1)):
        for k, (of, unit) in enumerate(
            ((9, weight), (9, second), (9, second), (4, weight), (4, second), (4, second))
        ):
            inverse[z, k, k] = 1 / (of * unit * (share if k == 4 else 1))
    over_even, over_noise = information(inverse, energy, 0.5, line)
    assert over_even == pytest.approx([1.0, 0.1], rel=1e-5)
    assert over_noise == pytest.approx([4 / 0.5, 0.4 / 0.5], rel=1e-5)


@pytest.mark.parametrize(
    ("information_over_noise", "left", "status"),
    [
        (1.5, 1.0, Status.OK),
        (1.3, 1.0, Status.NO_PATTERN),
        (1.3, 0.8, Status.NO_PATTERN),  # by chance
        (1.3, 0.5, Status.OK),  # there is less noise than was said
    ],
)
def test_a_fit_that_follows_the_noise_of_the_reference(
    information_over_noise: float, left: float, status: Status
) -> None:
    found, out = OutArgs.starting(np.zeros((1, 6))), np.empty(1, np.uint8)
    found.left[:], found.bending[:], found.nuisance[:] = left, 0, (1, 0, 0)
    found.state[:], found.iterations[:] = CONVERGED, 3
    one = np.ones(1)
    known = ReferenceArgs(
        900 * one, 350 * one, np.full((1, 2), 1e-4), 0.01 * one, np.ones(2), 1.5, 1.0,
        information_over_noise * one, 0.5,
    )  # fmt: skip
    rule = VerdictArgs(True, np.array([1.5, 0.5]), 5.0, 0.05, 4.0, 6.0)
    judge(found, left * one, one, PooledError.none(1), known, rule, out)
    assert Status(int(out[0])) == status


@pytest.mark.parametrize("size", [12, 16, 20, 24])
@pytest.mark.parametrize("order", [1, 2])
def test_small_zois_on_a_sharp_box_are_right_or_have_no_value(size: int, order: Literal[1, 2]) -> None:
    """Beside an edge, only what the filter made has a gradient along it."""
    grid = ZoiGrid.cover(Roi(8, 8, 304, 304), size, 6)
    kernel = PhaseKernel(np.rint(box(0.0, 0.0)).astype(np.uint8), grid, KernelSettings(order=order))
    for motion in (0.0, 3.3):
        field = kernel.measure(np.rint(box(motion, 0.0)).astype(np.uint8))
        off = np.hypot(field.u - motion, field.v - motion / 2)
        assert not (field.ok & (off > 0.1)).any()


@pytest.mark.parametrize(
    ("steps", "sigma", "beyond", "status"),
    [
        (6, 0.05, 11.0, Status.NOT_CONVERGED),
        (5, 0.05, 11.0, Status.OK),
        (6, 0.05, 9.0, Status.OK),
        (6, 0.12, 11.0, Status.OK),  # a weak pattern takes its time
        (8, 0.12, 1.0, Status.NOT_CONVERGED),
    ],
)
def test_a_slow_fit_that_seems_certain_is_on_a_corner(
    steps: int, sigma: float, beyond: float, status: Status
) -> None:
    found, out, one = OutArgs.starting(np.zeros((1, 6))), np.empty(1, np.uint8), np.ones(1)
    found.left[:], found.bending[:], found.nuisance[:] = 1, 0, (1, 0, 0)
    found.state[:], found.iterations[:] = CONVERGED, steps
    unit = np.full((1, 2), sigma**2 / beyond)
    known = ReferenceArgs(900 * one, 350 * one, unit, sigma * one, np.ones(2), 1.5, 1.0, 100 * one, 0.5)
    rule = VerdictArgs(True, np.array([1.5, 0.5]), 5.0, 0.05, 2.5, 6.0)
    judge(found, one, one, PooledError.none(1), known, rule, out)
    assert Status(int(out[0])) == status
