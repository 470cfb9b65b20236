"""Large motion from nothing, and through a sequence."""

from __future__ import annotations

import numpy as np
import pytest

from analysis import PhaseKernel, Roi, ZoiGrid
from analysis.follow.start import find_blocks, global_shift
from tests.analysis.speckle import SHAPE, picture

GRID = ZoiGrid.cover(Roi(4, 4, 232, 192), size=32, step=20)


def truth(m: dict) -> tuple[np.ndarray, np.ndarray]:
    x, y = np.meshgrid(GRID.x - (SHAPE[1] - 1) / 2, GRID.y - (SHAPE[0] - 1) / 2)
    u = m.get("u", 0) + m.get("du_dx", 0) * x + m.get("du_dy", 0) * y
    v = m.get("v", 0) + m.get("dv_dx", 0) * x + m.get("dv_dy", 0) * y
    return u, v


def turned(degrees: float) -> dict:
    a = np.deg2rad(degrees)
    return {"du_dx": np.cos(a) - 1, "dv_dy": np.cos(a) - 1, "du_dy": -np.sin(a), "dv_dx": np.sin(a)}


@pytest.mark.parametrize("shift", [(110, 0), (-70, 60), (3, -95)])
def test_half_the_image_is_found(shift: tuple) -> None:
    motion = {"u": float(shift[0]), "v": float(shift[1])}
    reference, deformed = (picture(**m).astype(np.float32) for m in ({}, motion))
    assert global_shift(reference, deformed, GRID.roi) == shift
    field = PhaseKernel(picture(), GRID).measure(picture(**motion))
    assert field.n_valid > 10
    assert np.nanmax(np.hypot(field.u - shift[0], field.v - shift[1])) < 0.01


@pytest.mark.parametrize("motion", [turned(5), turned(10), {"du_dx": 0.1, "dv_dy": -0.03}])
def test_rotation_and_strain_from_nothing(motion: dict) -> None:
    field = PhaseKernel(picture(), GRID).measure(picture(**motion))
    u, v = truth(motion)
    inside = (np.abs(GRID.x + u - 119.5) < 98) & (np.abs(GRID.y[:, None] + v - 99.5) < 78)
    assert field.ok[inside].mean() > 0.99
    assert np.nanmax(np.hypot(field.u - u, field.v - v)) < 0.01


@pytest.mark.parametrize("end", [turned(30), {"du_dx": 0.3, "dv_dy": -0.09}])
def test_large_deformation_through_a_sequence(end: dict) -> None:
    kernel, field = PhaseKernel(picture(), GRID), None
    steps = 10
    for i in range(1, steps + 1):
        motion = turned(3 * i) if "du_dy" in end else {k: v * i / steps for k, v in end.items()}
        field = kernel.measure(picture(**motion), start=field)
    u, v = truth(end)
    inside = (np.abs(GRID.x + u - 119.5) < 92) & (np.abs(GRID.y[:, None] + v - 99.5) < 72)
    assert field is not None and field.ok[inside].mean() > 0.99
    assert np.nanmax(np.hypot(field.u - u, field.v - v)) < 0.02


def test_a_jump_within_a_sequence_is_caught() -> None:
    kernel = PhaseKernel(picture(), GRID)
    field = kernel.measure(picture(u=40.0, v=25.0), start=kernel.measure(picture(u=0.2)))
    assert field.n_valid > 20
    assert np.nanmax(np.abs(field.u - 40)) < 0.01


def test_blocks_know_nothing_of_zois() -> None:
    reference, deformed = picture().astype(np.float32), picture(u=7.0).astype(np.float32)
    blocks = find_blocks(reference, deformed, GRID.roi)
    assert np.all(np.abs(blocks.shift[..., 0] - 7) <= 1.5)
    assert np.median(np.abs(blocks.planes()[..., 1:3])) < 0.01
