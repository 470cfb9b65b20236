"""The strain of an area: exact for affine fields, its sigma by the scatter of noise, and how uneven it is."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.evaluate import AreaGauge, AreaStrain, ExtensionGauge, extension_of, load_axis
from analysis.evaluate.affine import Places, affine_weights, covariance_of
from analysis.field import Roi, StrainField, ZoiGrid, profile

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


def test_covariance_and_sigma_are_those_of_noise_under_the_windows() -> None:
    zois, rng = grid(), np.random.default_rng(2)
    places = Places.of(zois, "gaussian")
    everywhere = np.ones(zois.shape, bool)
    weights = affine_weights(places, everywhere, everywhere)
    shape = (zois.roi.height, zois.roi.width)
    drawn = (moments(zois, rng.standard_normal(shape)) for _ in range(3000))
    found = [np.einsum("ajyx,jyx->a", weights.weights, one) for one in drawn]
    predicted = np.sqrt(weights.noise.sum(axis=(1, 2)) * covariance_of(places).displacement)
    np.testing.assert_allclose(np.std(found, axis=0) / predicted, 1, atol=0.05)


def test_it_is_never_noisier_than_a_plane_or_the_mean_gradient() -> None:
    for rows in (2, 4, 9, 20):
        zois, everywhere = grid(rows, rows), np.ones((rows, rows), bool)
        places = Places.of(zois, "gaussian")
        best = affine_weights(places, everywhere, everywhere).noise[2].sum()
        y = zois.y - zois.y.mean()
        plane = np.zeros((3, rows, rows))
        plane[0] = y[:, None] / (rows * (y @ y))
        mean = np.zeros_like(plane)
        mean[2] = 1 / rows**2
        model = covariance_of(places)
        for other in (plane, mean):
            assert best <= 1.02 * np.sum(other * model.times(other)) / model.displacement


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


def test_strips_and_areas_are_gauges() -> None:
    field = affine(grid(12, 7))
    assert extension_of(field, "y").value == pytest.approx(1e-3, rel=1e-4)
    assert extension_of(field, "x").value == pytest.approx(-3e-4, rel=1e-3)
    box = (10.0, 13.0, 30.0, 49.0)
    assert ExtensionGauge("s", box, "y").measure(field).value == pytest.approx(1e-3, rel=1e-4)
    assert AreaGauge("a", box).measure(field).value == pytest.approx(1e-3, abs=1e-12)
    assert AreaGauge("a", box, statistic="mean").measure(field).value == pytest.approx(1e-3, abs=1e-12)


def test_few_pictures_show_the_axis_where_the_ratio_is_clear() -> None:
    def axis(exx: float, eyy: float, sigma: float = 1e-6) -> tuple[str, bool, bool]:
        found = load_axis(np.array([exx]), np.array([eyy]), np.zeros(1), sigma=np.array([sigma]))
        return found.axis, found.found, found.assumed

    assert axis(24_812e-6, -7_236e-6) == ("x", True, False)
    assert axis(-3e-4, 1e-3) == ("y", True, False)
    assert axis(1.2e-3, -1e-3) == ("y", False, True)
    assert axis(24e-3, -7e-3, sigma=2e-3) == ("y", False, True)
