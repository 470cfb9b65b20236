"""Angles, shears and gradients by value: against rotations, matrix logarithms and products of gradients."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import logm

from analysis.field import Roi, StrainField, ZoiGrid
from analysis.field.uncertainty import PAIR_INDEX, StrainTensor, products
from analysis.follow.renewal import Placement

GRID = ZoiGrid.cover(Roi(0, 0, 64, 48), size=16, step=16)
F = np.array([[1.07, 0.11], [-0.03, 0.94]])


def uniform(gradient: np.ndarray, measure: str = "small") -> StrainTensor:
    """The strain of a field of one displacement gradient."""
    names = ("du_dx", "du_dy", "dv_dx", "dv_dy")
    field = StrainField.from_values(GRID, dict(zip(names, gradient.ravel(), strict=True)), 1e-3)
    return field.strain(measure)  # type: ignore[arg-type]


def matrix(strain: StrainTensor) -> np.ndarray:
    """That of the first ZOI, (2, 2)."""
    return np.array([[strain.exx[0, 0], strain.exy[0, 0]], [strain.exy[0, 0], strain.eyy[0, 0]]])


@pytest.mark.parametrize("degrees", [-80.0, -45.0, -10.0, 0.0, 25.0, 45.0, 70.0])
def test_principal_strains_and_their_angle(degrees: float) -> None:
    """Of a tensor that is made of its principal strains, turned."""
    turn = np.radians(degrees)
    axes = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    made = axes @ np.diag([3e-3, -1e-3]) @ axes.T
    first, second, angle = uniform(made).principal
    assert first == pytest.approx(3e-3) and second == pytest.approx(-1e-3)
    assert np.degrees(angle) == pytest.approx(degrees)


def test_hencky_strain_is_half_the_logarithm_of_the_stretch() -> None:
    assert matrix(uniform(F - np.eye(2), "hencky")) == pytest.approx(logm(F.T @ F) / 2, abs=1e-12)


def test_green_strain_is_half_of_what_the_stretch_exceeds_one_by() -> None:
    assert matrix(uniform(F - np.eye(2), "green")) == pytest.approx((F.T @ F - np.eye(2)) / 2, abs=1e-12)


def test_the_rotation_is_that_of_the_polar_decomposition() -> None:
    """Positive turns x towards y; stretch before and rotation after."""
    turn = 0.2
    turned = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    gradient = turned @ np.array([[1.1, 0.03], [0.03, 0.9]]) - np.eye(2)
    names = ("du_dx", "du_dy", "dv_dx", "dv_dy")
    field = StrainField.from_values(GRID, dict(zip(names, gradient.ravel(), strict=True)), 1e-3)
    assert field.rotation == pytest.approx(turn)


def test_the_variance_of_a_value_is_that_of_its_combination() -> None:
    covariance = np.cov(np.random.default_rng(0).normal(size=(6, 50)))
    pairs = {k: pair for pair, k in PAIR_INDEX.items()}
    assert len(PAIR_INDEX) == 36 and len(pairs) == 21
    for name, weights in (
        ("exx", [0, 1, 0, 0, 0, 0]),
        ("exy", [0, 0, 0.5, 0, 0.5, 0]),
        ("omega", [0, 0, -0.5, 0, 0.5, 0]),
        ("gamma_xy", [0, 0, 1, 0, 1, 0]),
        ("v", [0, 0, 0, 1, 0, 0]),
    ):
        expected = np.array(weights) @ covariance @ np.array(weights)
        found = sum(factor * covariance[pairs[k]] for k, factor in products(name))
        assert found == pytest.approx(expected), name


HERE, BEFORE = (
    np.array([[0.05, 0.02], [-0.04, 0.01]]),
    np.array([[-0.03, 0.06], [0.07, 0.02]]),
)


def affine(displacement: tuple[float, float], gradient: np.ndarray) -> np.ndarray:
    """(1, 6) parameters."""
    return np.array([[displacement[0], *gradient[0], displacement[1], *gradient[1]]])


def placement(offset: tuple[float, float] = (0.3, -0.2)) -> Placement:
    """One ZOI that has moved by (4, -7) px with the gradient BEFORE."""
    rng = np.random.default_rng(1)
    covariance = np.cov(rng.normal(size=(6, 30)))
    packed = np.empty((1, 21))
    for pair, k in PAIR_INDEX.items():
        packed[0, k] = covariance[pair]
    return Placement(
        affine((4.0, -7.0), BEFORE),
        np.array([offset]),
        np.zeros((1, 2), np.int64),
        packed,
        np.zeros(1, np.uint8),
    )


def test_gradients_are_composed_in_the_order_of_the_motions() -> None:
    """First BEFORE, then HERE: the product of the deformation gradients has the later one on the left."""
    total = placement().compose(affine((0.5, 0.25), HERE))
    after = (np.eye(2) + HERE) @ (np.eye(2) + BEFORE) - np.eye(2)
    moved = np.array([4.5, -6.75]) + HERE @ [0.3, -0.2]
    assert total == pytest.approx(affine((moved[0], moved[1]), after), abs=1e-12)


def test_locate_is_the_inverse_of_compose() -> None:
    local = affine((0.5, 0.25), HERE)
    assert placement().locate(placement().compose(local)) == pytest.approx(local, abs=1e-12)


def test_covariances_go_with_the_parameters() -> None:
    """Of the composed parameters: by the derivatives of ``compose`` with respect to either measurement."""
    made, local = placement((0.0, 0.0)), affine((0.5, 0.25), HERE)
    by_local, by_base = np.empty((6, 6)), np.empty((6, 6))
    for k in range(6):
        step = np.zeros((1, 6))
        step[0, k] = 1e-6
        by_local[:, k] = (made.compose(local + step) - made.compose(local - step))[0] / 2e-6
        moved = [
            Placement(made.base + s * step, made.offset, made.origins, made.covariance, made.status).compose(
                local
            )
            for s in (1, -1)
        ]
        by_base[:, k] = (moved[0] - moved[1])[0] / 2e-6
    whole = np.empty((6, 6))
    for pair, k in PAIR_INDEX.items():
        whole[pair] = made.covariance[0, k]
    for found, derivative in (
        (made.spread(local, made.covariance.astype(np.float32)), by_local),
        (made.carried(local), by_base),
    ):
        expected = derivative @ whole @ derivative.T
        assert [found[0, k] for k in PAIR_INDEX.values()] == pytest.approx(
            [expected[pair] for pair in PAIR_INDEX], rel=1e-4, abs=1e-5
        )
