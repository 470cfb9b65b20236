"""The rendered world and its noise limit, against closed forms and against the kernel's own figures."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.field.grid import Roi, ZoiGrid
from analysis.picture.pattern import predicted_sigma
from hw_mocks.deformation import Affine, Wave
from tests.paper.truth import (
    SensorModel,
    TiledStrain,
    Tiles,
    TrueScene,
    limit,
    ours,
    papers,
)


@pytest.fixture(scope="module")
def scene() -> TrueScene:
    return TrueScene((200, 260), 2.0, seed=4)


def test_every_zoi_sits_in_the_middle_of_its_tile() -> None:
    tiles = Tiles(48, 3, 2)
    for size in (16, 32, 44):
        grid = tiles.grid(size)
        assert grid.shape == (2, 3)
        assert np.allclose(grid.x, 23.5 + 48 * np.arange(3))
        assert np.allclose(grid.y, 23.5 + 48 * np.arange(2))
    assert tiles.shape == (96, 144)


def test_tiled_strain_leaves_every_centre_where_it_is() -> None:
    strain = TiledStrain(48, du_dx=1e-2, dv_dx=2e-2)
    grid = Tiles(48, 3, 2).grid(32)
    u, v = strain.displacement(grid.x, grid.y[0])
    assert np.allclose([u, v], 0)
    u, v = strain.displacement(grid.x + 5, grid.y[0])
    assert np.allclose(u, 0.05)
    assert np.allclose(v, 0.1)
    assert np.allclose(strain.gradient(grid.x, grid.y[0])[2], 2e-2)


def test_a_strained_tile_is_measured(scene: TrueScene) -> None:
    tiles = Tiles(84, 2, 2)
    own = TrueScene(tiles.shape, 2.0, seed=5)
    pair = own.pair(TiledStrain(84, du_dx=1e-3), SensorModel(16))
    field = ours(pair, tiles.grid(64), 0.3)
    assert np.allclose(field.exx, 1e-3, atol=2e-6)
    assert np.allclose(field.u, 0, atol=1e-4)
    assert np.allclose(papers(pair, tiles.grid(64)).exx, 1e-3, rtol=0.2)


def test_camera_rounds_and_adds_noise(scene: TrueScene) -> None:
    rng = np.random.default_rng(0)
    clean = SensorModel(12).picture(scene.reference, rng)
    assert clean.dtype == np.uint16
    assert np.array_equal(clean, np.rint(scene.reference * np.float32(4095)))
    noisy = SensorModel(8, 2.0).picture(scene.reference, rng)
    assert noisy.dtype == np.uint8
    difference = noisy - scene.reference * np.float32(255)
    assert np.std(difference) == pytest.approx(SensorModel(8, 2.0).sigma, rel=0.02)


def test_limit_agrees_with_the_closed_form(scene: TrueScene) -> None:
    grid = ZoiGrid.cover(Roi(10, 10, 240, 180), 48, 32)
    found = limit(scene.slopes, grid, 8.0).sigma
    u, strain = predicted_sigma(48, 1.0, float(np.sqrt(np.mean(np.square(scene.slopes)))))
    assert np.mean(found[[0, 3]]) == pytest.approx(u, rel=0.08)
    assert np.mean(found[[1, 2, 4, 5]]) == pytest.approx(strain, rel=0.08)


def test_response_of_the_window(scene: TrueScene) -> None:
    grid = ZoiGrid.cover(Roi(10, 10, 240, 180), 48, 16)
    y, x = np.mgrid[:200, :260]
    affine = limit(scene.slopes, grid, 8.0, Affine(0.3, -0.2, 1e-3).displacement(x, y)).response
    assert affine is not None
    assert np.allclose(affine[0], 0.3 + 1e-3 * grid.x)
    assert np.allclose(affine[1], 1e-3)
    assert np.allclose(affine[3], -0.2)
    wave = limit(scene.slopes, grid, 8.0, Wave(0.1, 96).displacement(x, y)).response
    assert wave is not None
    kept = (
        np.linalg.lstsq(np.sin(2 * np.pi * grid.x / 96)[:, None], wave[0].mean(axis=0), rcond=None)[0][0]
        / 0.1
    )
    assert kept == pytest.approx(np.exp(-2 * np.pi**2 * 64 / 96**2), abs=0.04)
