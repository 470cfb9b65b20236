"""The strain of an area: exact for affine fields, its sigma by the scatter of noise, and how uneven it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from analysis import PhaseKernel
from analysis.evaluate import AreaStrain
from analysis.evaluate.affine import Places, covariance_of
from analysis.field import CommonError, Roi, StrainField, ZoiGrid, profile
from tests.accuracy.truth import Speckle
from tests.accuracy.truth import pixels as pixel_grid

GRADIENT = {"du_dx": -3e-4, "du_dy": 2e-4, "dv_dx": -1e-4, "dv_dy": 1e-3}


def grid(rows: int = 9, columns: int = 7, size: int = 16, step: int = 4) -> ZoiGrid:
    return ZoiGrid.cover(Roi(5, 8, size + step * (columns - 1), size + step * (rows - 1)), size, step)


def affine(zois: ZoiGrid, **more: np.ndarray) -> StrainField:
    x, y = np.meshgrid(zois.x, zois.y)
    g = GRADIENT
    values = {"u": 0.3 + g["du_dx"] * x + g["du_dy"] * y, "v": -2 + g["dv_dx"] * x + g["dv_dy"] * y, **g}
    return StrainField.from_values(zois, values | more, 1e-3)


@pytest.mark.parametrize("lost", [0.0, 0.3, 0.8])
def test_an_affine_field_is_met_exactly_whichever_zois_are_valid(lost: float) -> None:
    zois = grid()
    status = np.where(np.random.default_rng(1).random(zois.shape) < lost, 5, 0)
    plain = affine(zois)
    values = {n: plain.value(n) for n in ("u", "v", *GRADIENT)}
    area = AreaStrain.of(StrainField.from_values(zois, values, 1e-3, status=status))
    assert area is not None
    for name, value in GRADIENT.items():
        assert area.value(name) == pytest.approx(value, abs=1e-12)
    assert area.value("gamma_xy") == pytest.approx(1e-4, abs=1e-12)


def test_one_zoi_is_its_own_gradient() -> None:
    zois = grid(1, 1)
    area = AreaStrain.of(affine(zois))
    assert area is not None and area.value("dv_dy") == pytest.approx(1e-3, abs=1e-12)
    nothing = StrainField.from_values(zois, {}, status=np.full((1, 1), 5))
    assert AreaStrain.of(nothing) is None


def moments(zois: ZoiGrid, noise: np.ndarray) -> np.ndarray:
    """Displacement and two gradients of each ZOI, (3, R, C), of one noise of the pixels."""
    n = zois.size
    line, x = profile("gaussian", n), np.arange(n) - (n - 1) / 2
    value, slope = line / line.sum(), line * x / (line @ x**2)
    views = np.lib.stride_tricks.sliding_window_view(noise, (n, n))[:: zois.step, :: zois.step]
    return np.stack(
        [np.einsum("rcyx,y,x->rc", views, a, b) for a, b in ((value, value), (value, slope), (slope, value))]
    )


def test_sigma_is_that_of_noise_under_the_windows() -> None:
    zois, rng = grid(), np.random.default_rng(2)
    sigma = float(np.sqrt(covariance_of(Places.of(zois, "gaussian")).displacement))
    shape, found = (zois.roi.height, zois.roi.width), []
    for _ in range(2000):
        (u, a, b), (v, c, d) = (moments(zois, rng.standard_normal(shape)) for _ in "uv")
        values = {"u": u, "du_dx": a, "du_dy": b, "v": v, "dv_dx": c, "dv_dy": d}
        area = AreaStrain.of(StrainField.from_values(zois, values, sigma))
        assert area is not None
        found.append([area.value(name) for name in ("exx", "eyy", "exy")])
    predicted = [area.sigma(name) for name in ("exx", "eyy", "exy")]
    np.testing.assert_allclose(np.std(found, axis=0) / predicted, 1, atol=0.06)


def test_it_is_never_noisier_than_a_plane_or_the_mean_gradient() -> None:
    for rows in (2, 4, 9, 20):
        zois = grid(rows, rows)
        model = covariance_of(Places.of(zois, "gaussian"))
        best = AreaStrain.of(StrainField.from_values(zois, {}, float(np.sqrt(model.displacement))))
        assert best is not None
        y = zois.y - zois.y.mean()
        plane = np.zeros((3, rows, rows))
        plane[0] = y[:, None] / (rows * (y @ y))
        mean = np.zeros_like(plane)
        mean[2] = 1 / rows**2
        for other in (plane, mean):
            assert best.sigma("eyy") ** 2 <= 1.02 * np.sum(other * model.times(other))


def fitted_pixels(slopes: np.ndarray, moved: np.ndarray) -> float:
    """eyy of one least-squares fit over all pixels (H, W), from the gradient (2, H, W) of the pattern."""
    y, x = np.mgrid[: moved.shape[0], : moved.shape[1]].astype(float)
    design = np.stack(
        [(s * m).ravel() for s in slopes for m in (np.ones_like(x), x - x.mean(), y - y.mean())]
    )
    return float(np.linalg.lstsq(design.T, moved.ravel(), rcond=None)[0][5])


def test_noise_of_a_region_is_that_of_one_fit_over_its_pixels() -> None:
    """By the kernel on a real pattern: the strain of small ZOIs scattered 1.35 times as much as that of one fit."""
    level, rng = 4095 * Speckle(2.0, 1, span=400).at(*pixel_grid((200, 240))), np.random.default_rng(4)
    slopes = np.stack([np.gradient(level, axis=1), np.gradient(level, axis=0)])
    zois = ZoiGrid.cover(Roi(8, 8, 224, 184), 24, 6)
    kernel = PhaseKernel(level.astype(np.float32), zois, noise=1e-3)
    inside = np.s_[8 : 8 + zois.step * (zois.shape[0] - 1) + 24, 8 : 8 + zois.step * (zois.shape[1] - 1) + 24]
    found, one_fit, sigmas = [], [], []
    for _ in range(60):
        noise = rng.normal(0, 20, level.shape)
        area = AreaStrain.of(kernel.measure((level + noise).astype(np.float32), noise=20.0))
        assert area is not None
        found.append(area.value("eyy"))
        sigmas.append(area.sigma("eyy"))
        one_fit.append(fitted_pixels(slopes[:, *inside], -noise[inside]))
    assert np.std(found) < 1.2 * np.std(one_fit)
    assert np.std(found) == pytest.approx(np.mean(sigmas), rel=0.25)


def test_where_most_zois_are_lost_each_counts_by_its_own_fit() -> None:
    zois = grid(12, 12)
    status = np.full(zois.shape, 5)
    status[3, 4] = status[4, 6] = 0
    plain = affine(zois)
    values = {n: plain.value(n) for n in ("u", "v", *GRADIENT)}
    few = AreaStrain.of(StrainField.from_values(zois, values, 1e-3, status=status))
    one = AreaStrain.of(StrainField.from_values(grid(1, 1), {}, 1e-3))
    assert few is not None and one is not None
    assert few.value("dv_dy") == pytest.approx(1e-3, abs=1e-12)
    assert 0.3 * one.sigma("eyy") < few.sigma("eyy") < one.sigma("eyy")


def test_unevenness_is_that_of_bending_and_about_one_sigma_of_noise() -> None:
    zois, rng = grid(), np.random.default_rng(3)
    x, y = np.meshgrid(zois.x, zois.y)
    bent = affine(zois, v=1e-3 * y + 1e-5 * (x - x.mean()) * (y - y.mean()))
    area = AreaStrain.of(bent)
    assert area is not None
    found = area.unevenness()
    assert found.eyy == pytest.approx(1e-5 * np.std(zois.x), rel=1e-6) and found.exx < 1e-12
    sigma = np.sqrt(covariance_of(Places.of(zois, "gaussian")).displacement)
    misfits = []
    for _ in range(100):
        noisy = [moments(zois, rng.standard_normal((zois.roi.height, zois.roi.width)))[0] for _ in "uv"]
        field = StrainField.from_values(zois, {"u": noisy[0], "v": noisy[1]}, float(sigma))
        one = AreaStrain.of(field)
        assert one is not None
        misfits.append(one.unevenness().misfit)
    assert np.sqrt(np.mean(np.square(misfits))) == pytest.approx(1, abs=0.15)


@pytest.mark.parametrize(
    ("rows", "columns", "off", "known"),
    [(4, 5, 0, True), (4, 5, 1, False), (1, 30, 0, False), (30, 1, 0, False), (2, 10, 0, True)],
)
def test_unevenness_needs_twenty_zois_that_are_no_line(
    rows: int, columns: int, off: int, known: bool
) -> None:
    zois = grid(rows, columns).subset(active=np.arange(rows * columns).reshape(rows, columns) >= off)
    area = AreaStrain.of(affine(zois), np.ones(zois.shape, bool))
    assert area is not None and np.array_equal(area.area, zois.active)
    found = area.unevenness()
    assert np.isfinite([found.exx, found.eyy, found.misfit]).all() == known


def test_lost_zois_of_a_uniform_strain_make_it_no_less_even() -> None:
    zois = grid()
    plain = affine(zois)
    status = np.where(np.random.default_rng(2).random(zois.shape) < 0.3, 5, 0)
    values = {name: plain.value(name) for name in ("u", "v", *GRADIENT)}
    area = AreaStrain.of(StrainField.from_values(zois, values, 1e-3, status=status))
    assert area is not None
    found = area.unevenness()
    assert max(found.exx, found.eyy, found.misfit) < 1e-9


def test_a_strain_of_the_second_degree_is_uneven() -> None:
    zois = grid()
    _, y = np.meshgrid(zois.x, zois.y)
    area = AreaStrain.of(affine(zois, v=1e-3 * y + 1e-6 * (y - y.mean()) ** 3))
    assert area is not None
    expected = 3e-6 * np.std((zois.y - zois.y.mean()) ** 2)
    assert area.unevenness().eyy == pytest.approx(expected, rel=1e-6)


def test_what_all_zois_have_in_common_counts_by_its_affine_part() -> None:
    zois = grid()
    shapes = np.zeros((1, 6, *zois.shape))
    shapes[0, 3], shapes[0, 5] = np.meshgrid(zois.x, zois.y)[1], 1.0  # all are longer along y by one share
    plain = affine(zois)
    alone, both = (
        AreaStrain.of(plain),
        AreaStrain.of(replace(plain, common=CommonError(shapes, np.array([[4e-8]])))),
    )
    assert alone is not None and both is not None
    assert both.sigma("eyy") == pytest.approx(np.hypot(alone.sigma("eyy"), 2e-4), rel=1e-9)
    assert both.sigma("exx") == pytest.approx(alone.sigma("exx"), rel=1e-9)
    assert both.sigma_by(both.field.common, "eyy") == pytest.approx(2e-4, rel=1e-9)


def test_shear_of_a_finite_strain() -> None:
    g = {name: 100 * value for name, value in GRADIENT.items()}
    zois = grid()
    x, y = np.meshgrid(zois.x, zois.y)
    values = {"u": g["du_dx"] * x + g["du_dy"] * y, "v": g["dv_dx"] * x + g["dv_dy"] * y, **g}
    area = AreaStrain.of(replace(StrainField.from_values(zois, values, 1e-3), measure="green"))
    assert area is not None
    expected = g["du_dy"] + g["dv_dx"] + g["du_dx"] * g["du_dy"] + g["dv_dx"] * g["dv_dy"]
    assert area.value("gamma_xy") == pytest.approx(expected, rel=1e-6)
    assert area.value("exy") == pytest.approx(expected / 2, rel=1e-6)
