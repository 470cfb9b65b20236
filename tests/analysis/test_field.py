"""Grids, strain measures and windows: where ZOIs lie, values and the uncertainty of their means, overlap."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from analysis import PhaseKernel, Roi, Status, StrainField, ZoiGrid
from analysis.field import VALUES
from analysis.field.grid import WINDOWS, overlap, profile
from analysis.field.uncertainty import fixed_sum
from tests.analysis.speckle import picture


def test_zois_are_left_and_top_aligned_and_lie_inside() -> None:
    grid = ZoiGrid.cover(Roi(10, 20, 100, 70), size=32, step=16)
    assert grid.shape == (3, 5)
    assert grid.x[0] == 10 + 15.5 and grid.y[0] == 20 + 15.5
    assert grid.first_x[-1] + 32 <= 110 and grid.first_y[-1] + 32 <= 90


def test_odd_sizes_have_their_centre_on_a_pixel() -> None:
    grid = ZoiGrid.cover(Roi(0, 0, 33, 33), size=33, step=1)
    assert grid.shape == (1, 1) and grid.x[0] == 16.0


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ((Roi(0, 0, 30, 100), 32, 8), "does not fit"),
        ((Roi(0, 0, 100, 100), 32, 0), "step"),
        ((Roi(0, 0, 100, 100), 2, 8), "size"),
    ],
)
def test_impossible_grids_are_refused(arguments: tuple, word: str) -> None:
    with pytest.raises(ValueError, match=word):
        ZoiGrid.cover(*arguments)


@pytest.mark.parametrize("roi", [(-1, 0, 10, 10), (0, -1, 10, 10), (0, 0, 0, 10), (0, 0, 10, -5)])
def test_impossible_regions_are_refused(roi: tuple) -> None:
    with pytest.raises(ValueError, match="region of interest"):
        Roi(*roi)


def test_subset_keeps_shape_and_only_takes_away() -> None:
    grid = ZoiGrid.cover(Roi(0, 0, 100, 100), 20, 20)
    half = grid.subset(every=2)
    assert half.shape == grid.shape and half.n_active == 9
    some = half.subset(active=np.eye(5, dtype=bool))
    assert some.n_active == 3
    with pytest.raises(ValueError, match="shape"):
        grid.subset(active=np.ones((2, 2), bool))


def test_description_survives_json() -> None:
    grid = ZoiGrid.cover(Roi(3, 4, 100, 90), 21, 7).subset(every=2)
    again = ZoiGrid.from_dict(json.loads(json.dumps(grid.to_dict())), grid.active)
    assert np.array_equal(again.active, grid.active)
    assert np.array_equal(again.x, grid.x) and np.array_equal(again.y, grid.y)


GRID = ZoiGrid.cover(Roi(0, 0, 64, 64), 32, 16)


def uniform(**values: float) -> StrainField:
    return StrainField.from_values(GRID, values, sigmas=1e-3)


def test_small_strain_is_the_symmetric_part() -> None:
    field = uniform(du_dx=0.01, du_dy=0.004, dv_dx=0.002, dv_dy=-0.003)
    assert np.allclose(field.exx, 0.01) and np.allclose(field.eyy, -0.003)
    assert np.allclose(field.exy, 0.003) and np.allclose(field.gamma_xy, 0.006)
    assert np.allclose(field.omega, -0.001)
    assert np.array_equal(field.principal, field.strain("small").principal)


@pytest.mark.parametrize("measure", ["engineering", "green", "hencky"])
def test_finite_measures_do_not_see_a_rotation(measure: str) -> None:
    c, s = np.cos(0.4), np.sin(0.4)
    field = uniform(du_dx=c - 1, du_dy=-s, dv_dx=s, dv_dy=c - 1)
    strain = field.strain(measure)  # type: ignore[arg-type]
    assert np.allclose([strain.exx, strain.eyy, strain.exy], 0, atol=1e-12)
    assert np.allclose(field.rotation, 0.4)
    in_it = replace(field, measure=measure)
    assert np.allclose([in_it.mean(name)[0] for name in ("exx", "eyy", "exy", "gamma_xy")], 0, atol=1e-12)
    assert np.allclose(in_it.du_dx, c - 1)


def test_the_engineering_strain_is_that_of_an_extensometer() -> None:
    """Gauge marks on lines along x and y, turned by 0.3 rad and sheared: lengths and angle as measured with a ruler."""
    turn = np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    F = turn @ np.array([[0.97, 0.02], [0.0, 1.1]])
    field = uniform(du_dx=F[0, 0] - 1, du_dy=F[0, 1], dv_dx=F[1, 0], dv_dy=F[1, 1] - 1)
    along_x, along_y = F @ [100, 0], F @ [0, 100]
    angle = np.arccos(along_x @ along_y / np.linalg.norm(along_x) / np.linalg.norm(along_y))
    strain = field.strain("engineering")
    assert np.allclose(strain.exx, np.linalg.norm(along_x) / 100 - 1)
    assert np.allclose(strain.eyy, np.linalg.norm(along_y) / 100 - 1)
    assert np.allclose(strain.exy, (np.pi / 2 - angle) / 2)


def test_an_unknown_measure_is_refused() -> None:
    with pytest.raises(ValueError, match="unknown strain measure"):
        uniform().strain("true")  # type: ignore[arg-type]


def test_mean_leaves_out_rejected_zois() -> None:
    status = np.zeros(GRID.shape, int)
    status[0, 0] = Status.LOST
    values = np.full(GRID.shape, 0.01)
    values[0, 0] = 5.0
    field = StrainField.from_values(GRID, {"du_dx": values}, 1e-3, status)
    assert field.mean("exx")[0] == pytest.approx(0.01)
    assert field.n_valid == GRID.active.size - 1
    assert np.isnan(field.exx[0, 0])


@pytest.mark.parametrize("name", ["u", "exx", "eyy", "exy", "omega"])
@pytest.mark.parametrize("step", [8, 40])
def test_sigma_of_a_mean_is_its_scatter(name: str, step: int) -> None:
    grid = ZoiGrid.cover(Roi(4, 4, 232, 192), 32, step)
    kernel = PhaseKernel(picture(), grid, noise=0.5)
    fields = [kernel.measure(picture(0.03, s), noise=0.03 * 4095) for s in range(24)]
    means = np.array([f.mean(name)[0] for f in fields])
    predicted = fields[0].mean(name)[1]
    assert np.sqrt(np.mean(means**2)) == pytest.approx(predicted, rel=0.45)
    assert np.nanstd([f.value(name) for f in fields]) == pytest.approx(
        np.nanmean(fields[0].sigma(name)), rel=0.1
    )


def test_statuses_have_words() -> None:
    assert all(s.text for s in Status)


def test_arrays_are_read_only() -> None:
    with pytest.raises(ValueError, match="read-only"):
        uniform(u=1.0).u[0, 0] = 3


def test_the_refused_are_counted_by_their_reasons() -> None:
    grid = ZoiGrid.cover(Roi(0, 0, 128, 32), 32, 32)
    status = [[Status.LOST, Status.OK, Status.LOST, Status.UNEVEN]]
    field = StrainField.from_values(grid, {}, status=status)
    assert field.refused == {Status.LOST: 2, Status.UNEVEN: 1}
    assert list(field.refused) == [Status.LOST, Status.UNEVEN]


def test_every_value_and_its_sigma_are_attributes() -> None:
    rng = np.random.default_rng(2)
    field = StrainField.from_values(GRID, {n: rng.normal(size=GRID.shape) for n in VALUES[:6]}, 1e-3)
    for name in VALUES:
        assert np.array_equal(getattr(field, name), field.value(name))
        assert np.array_equal(getattr(field, f"sigma_{name}"), field.sigma(name))
        assert getattr(StrainField, name).__doc__ and getattr(StrainField, f"sigma_{name}").__doc__
    assert np.allclose(field.sigma_exy, 1e-3 / np.sqrt(2)) and np.allclose(
        field.sigma_gamma_xy, 1e-3 * np.sqrt(2)
    )
    with pytest.raises(ValueError, match="unknown value 'ezz'"):
        field.value("ezz")


def test_the_parts_of_an_uncertainty_add_up() -> None:
    covariance, reference = np.zeros((2, 21, *GRID.shape), np.float32)
    covariance[:], reference[:] = 4e-6, 1e-6
    plain = uniform()
    field = StrainField(
        GRID, plain.parameters, covariance, reference, plain.residual, plain.status, plain.iterations, plain.gain
    )  # fmt: skip
    for name in VALUES:
        whole, first, second = (field.sigma(name, part) for part in ("all", "reference", "current"))
        assert np.allclose(whole**2, first**2 + second**2)


def test_the_numbers_of_a_status_are_those_in_files() -> None:
    names = [
        "OK",
        "NOT_MEASURED",
        "NO_PATTERN",
        "CLIPPED",
        "OUTSIDE",
        "LOST",
        "NOT_CONVERGED",
        "POOR_MATCH",
        "UNEVEN",
        "AMBIGUOUS",
    ]
    assert [(s.name, s.value) for s in Status] == [(n, k) for k, n in enumerate(names)]


def test_a_sum_has_the_same_bits_wherever_its_values_lie() -> None:
    rng = np.random.default_rng(0)
    values = rng.normal(1e-3, 1e-4, 945)
    room = np.zeros(len(values) + 8)
    found = set()
    for shift in range(8):
        room[shift : shift + len(values)] = values
        found.add(fixed_sum(room[shift : shift + len(values)]))
    assert found == {fixed_sum(values)}
    assert fixed_sum(values) == pytest.approx(values.sum(), rel=1e-12)
    assert fixed_sum(values[:0]) == 0.0


def test_a_field_and_a_grid_are_described_in_one_line() -> None:
    grid = ZoiGrid.cover(Roi(4, 8, 640, 480), size=32, step=16)
    status = np.zeros(grid.shape)
    status[3, :4] = Status.LOST
    field = StrainField.from_values(grid, {"dv_dy": 1.25e-3}, status=status)
    assert repr(field) == (
        "<StrainField 29 x 39 ZOIs, 1127 of 1131 with a value (4 LOST);"
        " mean exx +0, eyy +0.00125, exy +0 (small)>"
    )
    assert repr(grid) == "<ZoiGrid 29 x 39 ZOIs of 32 px, 16 px apart, in x,y,w,h = 4,8,640,480; 1131 active>"


@pytest.mark.parametrize("size", [40, 33])
def test_the_windows(size: int) -> None:
    x = np.abs(np.arange(size) - (size - 1) / 2)
    # Tukey's has two cosine flanks that take 30 % of the side together.
    flat, flank = 0.35 * size, 0.15 * size
    expected = {
        "gaussian": np.exp(-(x**2) / 2 / (size / 6) ** 2),
        "uniform": np.ones(size),
        "bi-triangular": 1 - x / ((size + 1) / 2),
        "tukey": np.where(x <= flat, 1, 0.5 + 0.5 * np.cos(np.pi * (x - flat) / flank)),
    }
    for window in WINDOWS:
        assert profile(window, size) == pytest.approx(expected[window]), window


def test_an_unknown_window_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ValueError, match="bi-triangular"):
        profile("round", 32)  # type: ignore[arg-type]


@pytest.mark.parametrize("moment", [0, 1])
def test_overlap_is_the_correlation_of_window_weighted_noise(moment: int) -> None:
    size, step = 16, 4
    x = np.arange(size) - (size - 1) / 2
    kernel = x**moment * profile("gaussian", size)
    noise = np.random.default_rng(0).normal(0, 1, (4000, 3 * size))
    values = [noise[:, k : k + size] @ kernel for k in range(0, 2 * size, step)]
    expected = [np.corrcoef(values[0], v)[0, 1] for v in values[:6]]
    assert np.allclose(overlap("gaussian", size, step, 6, moment), expected, atol=0.05)
