"""One warp for the ZOIs of a tile, by value: against truth, and against ZOIs that each have a warp of their own."""

from __future__ import annotations

from collections.abc import Callable

import numba
import numpy as np
import pytest

from analysis import KernelSettings, PhaseKernel, Roi, StrainField, ZoiGrid
from analysis.fit import shared
from analysis.fit.kernel_args import CONVERGED
from analysis.fit.shapes import shapes_of
from analysis.fit.tiles import Tiles, within_zoi
from tests.accuracy.truth import Speckle, digitise, pixels

SHAPE = (260, 320)
NOISE = 0.01
NAMES = ("u", "v", "du_dx", "du_dy", "dv_dx", "dv_dy")
Motion = dict[str, float]
STRAIN = {"u": 0.31, "v": -0.22, "du_dx": 4e-3, "du_dy": -6e-3, "dv_dx": 6e-3, "dv_dy": -1e-3}
GRID = ZoiGrid.cover(Roi(20, 20, 280, 220), size=32, step=8)
Y, X = np.indices(GRID.shape)
CHOSEN = {
    "all": None,
    "every third": (Y % 3 == 0) & (X % 3 == 0),
    "every second column": X % 2 == 0,
    "a ring": ((Y - 12) ** 2 + (X - 16) ** 2 > 30) & ((Y - 12) ** 2 + (X - 16) ** 2 < 130),
    "two of three, in any order": np.random.default_rng(4).random(GRID.shape) < 0.67,
    "the right half": X > 15,
    "a row": Y == 7,
}


def scaled(motion: Motion, t: float) -> Motion:
    return {name: t * value for name, value in motion.items()}


def displaced(
    x: np.ndarray, y: np.ndarray, motion: Motion, wave: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """(u, v) at places about the middle of the picture; with a ``wave`` of that amplitude, px, along both axes."""
    m = {name: motion.get(name, 0.0) for name in NAMES}
    u = m["u"] + m["du_dx"] * x + m["du_dy"] * y + wave * np.sin(2 * np.pi * (x + y / 3) / 190)
    v = m["v"] + m["dv_dx"] * x + m["dv_dy"] * y + wave * np.cos(2 * np.pi * (y - x / 4) / 210)
    return u, v


def picture(seed: int, motion: Motion | None = None, wave: float = 0.0, noise: float = NOISE) -> np.ndarray:
    x, y = pixels(SHAPE)
    a, b = x, y
    for _ in range(30):
        u, v = displaced(a, b, motion or {}, wave)
        a, b = x - u, y - v
    return digitise(Speckle(2.0, 1, span=400).at(a, b), 12, noise, np.random.default_rng(seed))


def truth(grid: ZoiGrid, motion: Motion, wave: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    x, y = np.meshgrid(grid.x - (SHAPE[1] - 1) / 2, grid.y - (SHAPE[0] - 1) / 2)
    return displaced(x, y, motion, wave)


@pytest.fixture
def done(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The share of the ZOIs that each pass over the tiles has done."""
    seen: list[float] = []
    real = shared.share_warps

    def spy(*arguments: object) -> None:
        real(*arguments)
        seen.append(float(np.mean(arguments[4].state == CONVERGED)))  # type: ignore[attr-defined]

    monkeypatch.setattr(shared, "share_warps", spy)
    return seen


def alone(measure: Callable[[], StrainField]) -> StrainField:
    """The same with a warp for each ZOI."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(shared, "share_warps", lambda *_: None)
        return measure()


def tracked(kernel: PhaseKernel, motion: Motion, wave: float = 0.0) -> StrainField:
    """The third frame of a track."""
    field = None
    for seed, t in enumerate((0.9, 0.95, 1.0)):
        field = kernel.measure(picture(10 + seed, scaled(motion, t), t * wave), start=field)
    assert field is not None
    return field


def departures(field: StrainField, other: StrainField) -> np.ndarray:
    """Differences of the six values in units of their uncertainties, of all ZOIs that have a value."""
    ok = field.ok & other.ok
    return np.stack([((getattr(field, n) - getattr(other, n)) / other.sigma(n))[ok] for n in NAMES])


def right(field: StrainField, motion: Motion, wave: float = 0.0) -> bool:
    """Whether every value lies within 5.5 of its uncertainties, and 0.01 px, of the truth."""
    u, v = truth(field.grid, motion, wave)
    off = np.maximum(np.abs(field.u - u) / field.sigma_u, np.abs(field.v - v) / field.sigma_v)[field.ok]
    far = np.maximum(np.abs(field.u - u), np.abs(field.v - v))[field.ok]
    return bool((off < 5.5).all() and (far < 0.05).all())


@pytest.mark.parametrize("chosen", CHOSEN)
def test_values_of_any_subset_are_right(chosen: str, done: list[float]) -> None:
    """The spacing of active ZOIs is not the step of the grid, and rows have gaps."""
    kernel = PhaseKernel(picture(1), GRID.subset(active=CHOSEN[chosen]))
    field = tracked(kernel, STRAIN)
    assert done[-1] > 0.5
    other = alone(lambda: tracked(kernel, STRAIN))
    off = departures(field, other)
    assert right(field, STRAIN) and field.n_valid == kernel.grid.n_active
    assert np.sqrt(np.mean(off**2)) < 0.03 and np.max(np.abs(off)) < 0.2
    assert np.array_equal(field.status, other.status)
    assert np.allclose(field.residual[field.ok], other.residual[field.ok], rtol=0.03)


@pytest.mark.parametrize("chosen", ["all", "every third", "a ring"])
def test_values_after_a_renewal_are_right(chosen: str, done: list[float]) -> None:
    """Each ZOI has moved by whole pixels of its own: they lie on no lattice, and yet share warps."""
    grid = GRID.subset(active=CHOSEN[chosen])
    far = {"u": 7.3, "v": -4.2, "du_dx": 0.03, "du_dy": -0.045, "dv_dx": 0.045, "dv_dy": -0.01}
    further = {name: value + STRAIN[name] for name, value in far.items()}
    first = PhaseKernel(picture(1), grid)
    moved = picture(2, far)
    kernel = first.renewed(moved, first.measure(moved))
    start = kernel.measure(picture(3, {n: far[n] + 0.9 * STRAIN[n] for n in far}))
    start = kernel.measure(picture(4, {n: far[n] + 0.95 * STRAIN[n] for n in far}), start=start)
    last = picture(5, further)
    field, other = kernel.measure(last, start=start), alone(lambda: kernel.measure(last, start=start))
    assert done[-1] > 0.5 or chosen == "every third"
    off = departures(field, other)
    assert field.n_valid > 0.9 * grid.n_active and right(field, further)
    assert np.sqrt(np.mean(off**2)) < 0.03 and np.max(np.abs(off)) < 0.2


def test_a_field_that_bends_has_no_bias_of_the_shared_motion(done: list[float]) -> None:
    """What the motion has beyond an affine one around each ZOI is taken out: the truth is as near, the shapes alike."""
    kernel, wave = PhaseKernel(picture(1), GRID), 0.25
    field, other = tracked(kernel, STRAIN, wave), alone(lambda: tracked(kernel, STRAIN, wave))
    assert done[-1] > 0.3
    off = departures(field, other)
    assert np.sqrt(np.mean(off**2)) < 0.03 and np.max(np.abs(off)) < 0.3
    assert np.abs(np.mean(off, axis=1)).max() < 0.005
    assert np.mean(field.status != other.status) < 0.005
    assert np.allclose(field.gain[field.ok], other.gain[field.ok], atol=2e-3)


def test_a_replay_and_other_threads_have_the_same_bits(done: list[float]) -> None:
    kernel = PhaseKernel(picture(1), GRID)
    start, last = tracked(kernel, STRAIN), picture(20, scaled(STRAIN, 1.05))
    field = kernel.measure(last, start=start)
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        of_one = PhaseKernel(picture(1), GRID).measure(last, start=start)
    finally:
        numba.set_num_threads(threads)
    assert done[-1] > 0.5
    for other in (of_one, kernel.measure(last, start=start)):
        assert np.array_equal(field.parameters, other.parameters)
        assert np.array_equal(field.covariance, other.covariance)
        assert np.array_equal(field.residual, other.residual)


def test_one_that_is_predicted_elsewhere_does_not_spoil_its_tile(done: list[float]) -> None:
    kernel = PhaseKernel(picture(1), GRID)
    start = tracked(kernel, STRAIN)
    wrong = start.parameters.copy()
    wrong[0, 5, 7] += 6.0
    wrong[3, 11, 3] = np.nan
    field = kernel.measure(picture(20, STRAIN), start=StrainField.from_values(GRID, _values(wrong), 0.1))
    assert done[-1] > 0.5
    assert right(field, STRAIN) and field.ok[5, 7]


def _values(parameters: np.ndarray) -> dict[str, np.ndarray]:
    return dict(zip(("u", "du_dx", "du_dy", "v", "dv_dx", "dv_dy"), parameters, strict=True))


def test_tiles_that_do_not_move_as_one_are_left_to_each_zoi(done: list[float]) -> None:
    """From starts that are whole pixels, and where ZOIs share no pixels."""
    kernel = PhaseKernel(picture(1), GRID)
    last = picture(20, STRAIN)
    rough = truth(GRID, STRAIN)
    start = StrainField.from_values(GRID, {"u": np.rint(rough[0]), "v": np.rint(rough[1])}, 0.1)
    assert right(kernel.measure(last, start=start), STRAIN)
    apart = PhaseKernel(picture(1), ZoiGrid.cover(Roi(20, 20, 280, 220), size=32, step=32))
    field = tracked(apart, STRAIN)
    assert done[-1] == 0 and right(field, STRAIN)
    assert np.array_equal(field.parameters, alone(lambda: tracked(apart, STRAIN)).parameters)


@pytest.mark.parametrize("settings", [KernelSettings(order=2), KernelSettings(estimator="phase")])
def test_order_2_and_phases_have_a_warp_for_each_zoi(settings: KernelSettings, done: list[float]) -> None:
    kernel = PhaseKernel(picture(1), ZoiGrid.cover(Roi(90, 60, 64, 64), size=32, step=8), settings)
    assert right(tracked(kernel, STRAIN), STRAIN) and not done


def test_zois_that_leave_the_picture_do_not_take_others_with_them() -> None:
    kernel = PhaseKernel(picture(1), ZoiGrid.cover(Roi(0, 0, 320, 260), size=32, step=8))
    motion = {"u": 9.0, "du_dx": 2e-3}
    field, other = tracked(kernel, motion), alone(lambda: tracked(kernel, motion))
    assert np.array_equal(field.status, other.status)
    assert 0.8 < field.n_valid / field.grid.n_active < 1 and right(field, motion)


def test_tiles_hold_each_zoi_once_and_depend_on_places_alone() -> None:
    rng = np.random.default_rng(2)
    origins = rng.integers(0, 900, (2000, 2))
    tiles = Tiles.of(origins, 32, 8)
    assert np.array_equal(np.sort(tiles.order), np.arange(2000))
    parts = [tiles.order[a:b] for a, b in zip(tiles.ends[:-1], tiles.ends[1:], strict=True)]
    assert sum(map(len, parts)) == 2000 and max(map(len, parts)) == tiles.most
    for part in parts:
        assert (np.ptp(origins[part], axis=0) + 32 <= (tiles.height, tiles.width)).all()
        assert (np.diff(origins[part, 0]) >= 0).all()
    assert Tiles.of(np.empty((0, 2), np.int64), 32, 8).most == 0


def test_the_motion_around_a_zoi_is_its_affine_part_and_seven_shapes() -> None:
    """Together they are the polynomial of the tile, at any place in the ZOI; along the axes of the deformed picture."""
    rng, half, unit = np.random.default_rng(3), 16.0, 70.0
    t = rng.normal(0, 1, (2, 10))
    t[:, 1:3] *= 5
    window = np.hanning(34)[1:-1]
    mix = shapes_of(window, 32).mix
    q, known = np.empty(6), np.zeros(14, np.float32)
    x0, y0 = 0.3, -0.4
    within_zoi(t, x0, y0, unit, half, mix, q, known)
    for xi, eta in rng.uniform(-1, 1, (5, 2)):
        x, y = x0 + xi * half / unit, y0 + eta * half / unit
        powers = np.array([1, x, y, x * x, x * y, y * y, x**3, x * x * y, x * y * y, y**3])
        px, py = (mix @ a ** np.arange(4) for a in (xi, eta))
        shapes = np.array([px[2], py[2], px[1] * py[1], px[3], px[2] * py[1], px[1] * py[2], py[3]])
        beyond = (np.eye(2) + q.reshape(2, 3)[:, 1:]) @ (known.reshape(2, 7) @ shapes)
        affine = q.reshape(2, 3) @ [1, xi * half, eta * half]
        assert t @ powers == pytest.approx(affine + beyond, abs=1e-5)
