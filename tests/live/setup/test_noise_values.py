"""The figures of the noise of a check by value, from made-up frames and fields."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from acquire.errors import DataError
from analysis import StrainField
from analysis.field import Blur
from analysis.quality.steadiness import Steadiness
from live.config.loading import load_config
from live.setup.check import noise_floor, quick_check
from live.setup.check.check_list import median
from live.setup.check.noise_floor import (
    BURSTS,
    MAX_ZOIS,
    ORDERS,
    SIZES,
    StrainNoise,
    ZoiFloor,
    _bursts,
    _filled,
    _floor,
    _gauges,
    _grid,
    _noise,
    _scatter,
    _share,
    noise_floors,
    predict_noise,
)
from live.setup.check.quick_check import NOT_KNOWN, SharpestPicture
from live.setup.check.stillness import PictureStillness, light
from tests.live.made_up import make_grid


class Sample:
    """A sample of so many frames; its bursts are pairs of first frame and length."""

    def __init__(self, frames: int = 32, *, few: bool = False, inside: np.ndarray | None = None) -> None:
        self.stack: Any = Stack(frames, few)
        self.half, self.reference, self.burst, self.noise = frames // 2, 8, 4, 2.0
        self.settings: Any = Settings()
        self.check_region = SimpleNamespace(inside=np.ones((200, 300), bool) if inside is None else inside)

    def mean(self, first: int, count: int) -> tuple[int, int]:
        return first, count


class Stack(SimpleNamespace):
    """Of so many frames."""

    def __init__(self, frames: int, few: bool) -> None:
        super().__init__(frames=frames, few=few)

    def __len__(self) -> int:
        return int(self.frames)


def test_bursts_are_spread_over_the_second_half() -> None:
    def of(n: int, **how: Any) -> list[tuple[int, int]]:
        return list(_bursts(Sample(**how), n))  # type: ignore[arg-type]

    assert of(1) == [(16, 1), (20, 1), (24, 1), (28, 1)]
    assert of(4) == [(16, 4), (20, 4), (24, 4), (28, 4)]
    assert of(5) == [(16, 5), (21, 5), (26, 5)]
    assert of(16) == [(16, 16)] and of(17) == []
    assert of(1, few=True, frames=5) == [(0, 1)] and of(2, few=True, frames=5) == []


def test_the_zois_of_the_table_are_over_the_region_and_not_too_many() -> None:
    grid = _grid(Sample(), 32)  # type: ignore[arg-type]
    assert grid is not None and (grid.size, grid.step) == (32, 16) and grid.n_active == 17 * 11
    inside = np.zeros((700, 900), bool)
    inside[100:600, 200:800] = True
    many = _grid(Sample(inside=inside), 32)  # type: ignore[arg-type]
    assert many is not None and many.step == math.ceil(16 * math.sqrt(30 * 36 / 200)) == 38
    assert many.n_active <= MAX_ZOIS == 200 and many.first_x.min() >= 200 and many.first_y.min() >= 100
    assert many.first_x.max() + 32 <= 800 and many.first_y.max() + 32 <= 600
    small = np.zeros((200, 300), bool)
    small[10:42, 10:74] = True
    assert _grid(Sample(inside=small), 32).n_active == 3  # type: ignore[arg-type, union-attr]
    small[:, 73:] = False
    assert _grid(Sample(inside=small), 32) is None, "two are too few"  # type: ignore[arg-type]
    assert _grid(Sample(), 201) is None  # type: ignore[arg-type]


def fields(count: int, scatter: float, sigma: float) -> list[StrainField]:
    """Of strains that scatter over ZOIs."""
    grid, rng = make_grid(400, 400), np.random.default_rng(1)
    made = []
    for _ in range(count):
        values = {name: rng.normal(0, scatter, grid.shape) for name in ("du_dx", "dv_dy")}
        made.append(StrainField.from_values(grid, values, sigma))
    return made


def test_the_noise_is_scaled_from_half_of_the_frames_to_the_reference_of_the_test() -> None:
    """16 frames against 4, for 8 against 4."""
    factor = math.sqrt((1 / 8 + 1 / 4) / (1 / 16 + 1 / 4))
    found = _noise(fields(4, 3e-4, 2e-4), 4, Sample())  # type: ignore[arg-type]
    assert found.burst == 4 and found.predicted == pytest.approx(factor * 2e-4)
    assert found.measured == pytest.approx(factor * 3e-4, rel=0.05)
    few = _noise(fields(1, 3e-4, 2e-4), 1, Sample(few=True))  # type: ignore[arg-type]
    assert math.isnan(few.measured) and few.predicted > 0
    none = _noise([], 4, Sample())  # type: ignore[arg-type]
    assert math.isnan(none.predicted) and math.isnan(none.measured)


def test_the_scatter_counts_the_uncertainty_of_the_mean() -> None:
    (one,) = fields(1, 3e-4, 2e-4)
    values = one.exx[one.ok]
    assert _scatter(one, "exx") == pytest.approx(float(values.var()) + one.mean("exx")[1] ** 2)


class Settings(SimpleNamespace):
    """Of a kernel."""

    def __init__(self, **more: Any) -> None:
        super().__init__(**{"window": "gaussian", "estimator": "spectral", "order": 1} | more)


def test_a_row_of_the_table_has_its_lengths_and_the_noise_of_each_burst(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    order: list[Any] = []

    def changed(one: Any, **more: Any) -> Any:
        if "order" not in more:
            return replace(one, **more)
        order.append(more)
        return one

    def measured(kernel: Any, burst: tuple[int, int], noise: float, start: Any) -> StrainField:
        return fields(1, 3e-4, 2e-4 / burst[1])[0]

    monkeypatch.setattr(noise_floor, "replace", changed)
    monkeypatch.setattr(noise_floor, "prepare", lambda *given: ("kernel", None))
    monkeypatch.setattr(noise_floor, "_measured", measured)
    sample: Any = Sample()
    taken = {n: list(_bursts(sample, n)) for n in (1, 16, 32)}
    found = _floor(sample, 48, 2, None, taken)  # type: ignore[arg-type]
    assert (found.zoi, found.order, found.reference) == (48, 2, 8) and order == [{"order": 2}]
    assert (round(found.l10), round(found.vsg)) == (105, 33) and found.zois > 100
    assert [noise.burst for noise in found.noises] == [1, 16, 32]
    one, longest, filled = found.noises
    assert one.predicted == pytest.approx(2e-4 * math.sqrt((1 / 8 + 1) / (1 / 16 + 1)))
    assert filled.predicted == pytest.approx(
        longest.predicted * math.sqrt((1 / 8 + 1 / 32) / (1 / 8 + 1 / 16))
    )
    assert math.isnan(filled.measured)


def test_a_size_without_pattern_has_an_empty_row(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*given: Any) -> Any:
        raise DataError("no pattern")

    monkeypatch.setattr(noise_floor, "prepare", fails)
    monkeypatch.setattr(noise_floor, "replace", lambda one, **more: one)
    found = _floor(Sample(), 48, 1, None, {})  # type: ignore[arg-type]
    assert (found.zois, found.noises) == (0, ())


def test_the_table_is_ordered_and_the_phase_estimator_has_order_one_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[Any] = []

    def floor(sample: Any, size: int, order: int, reference: Any, bursts: dict[int, Any]) -> None:
        asked.append((size, order, reference, list(bursts)))

    monkeypatch.setattr(noise_floor, "_floor", floor)
    sample: Any = Sample()
    noise_floors(sample, (64, 32, 64), (2, 1), (4, 1))
    assert asked == [(size, order, (0, 16), [1, 4]) for size in (32, 64) for order in (1, 2)]
    asked.clear()
    sample.settings = Settings(estimator="phase")
    noise_floors(sample, (32,), (1, 2), (1,))
    assert [order for _, order, *_ in asked] == [1]


def test_the_noise_of_a_zoi_is_of_both_directions_scaled_to_the_test(monkeypatch: pytest.MonkeyPatch) -> None:
    """16 frames against 16, for a reference of 8 and a burst of 4."""
    grid = make_grid()
    status = np.where(grid.active, 0, 1)
    status[1, 2] = 7
    field = StrainField.from_values(grid, {"u": 0.0}, {"du_dx": 3e-5, "dv_dy": 4e-5}, status=status)
    monkeypatch.setattr(noise_floor, "_half_on_half", lambda sample: (field, "it repeats"))
    sample: Any = Sample()
    sample.check_region = SimpleNamespace(grid=grid, config=load_config(None, {}))
    found = predict_noise(sample)
    factor = math.sqrt((1 / 8 + 1 / 4) / (2 / 16))
    assert found.sigma[1, 1] == pytest.approx(factor * math.sqrt((3e-5**2 + 4e-5**2) / 2))
    assert np.array_equal(found.measurable, status == 0) and found.repetition == "it repeats"
    assert [one.name for one in found.gauges] == [""] and found.picture == ""
    monkeypatch.setattr(noise_floor, "_half_on_half", lambda sample: (None, ""))
    nothing = predict_noise(sample)
    assert np.isnan(nothing.sigma).all() and nothing.sigma.shape == grid.shape and nothing.gauges == ()


@pytest.mark.parametrize("axis", ["x", "y"])
def test_the_noise_of_the_region_is_along_the_load(axis: str) -> None:
    grid = make_grid()
    field = StrainField.from_values(grid, {"u": 0.0}, {"du_dx": 1e-5, "dv_dy": 4e-5, "u": 1e-3, "v": 4e-3})
    found = list(_gauges(load_config(None, {"specimen.axis": axis, "measure.gauges": "auto"}), field, 2.0))
    assert [one.name for one in found] == ["", "extension", "width", "area"]
    other = list(_gauges(load_config(None, {"specimen.axis": axis}), field, 1.0))
    assert found[0].sigma == pytest.approx(2 * other[0].sigma)
    turned = list(_gauges(load_config(None, {"specimen.axis": "x" if axis == "y" else "y"}), field, 1.0))
    assert (other[0].sigma > turned[0].sigma) is (axis == "y")
    lost = StrainField.from_values(grid, {"u": np.nan}, status=np.where(grid.active, 7, 1))
    assert list(_gauges(load_config(None, {}), lost, 1.0)) == []


def test_the_light_is_relative_to_its_mean_and_its_noise_that_of_all_pixels() -> None:
    pixels = np.tile(np.array([[90.0], [100.0], [110.0], [100.0]] * 8), (1, 400))
    sample: Any = SimpleNamespace(pixels=pixels, noise=4.0, stack=SimpleNamespace(times=np.arange(32) / 30))
    found = light(sample)
    assert found.rms == pytest.approx(math.sqrt(0.005), rel=0.05) and found.noise == pytest.approx(
        4 / 20 / 100
    )
    assert abs(found.drift) < 0.02


def series(drift: float = 0.0, rms: float = 0.0, noise: float = 0.0) -> Steadiness:
    return Steadiness(drift, rms, noise, None, 1.0, 30.0)


def test_the_drift_of_a_picture_is_along_both_and_the_worse_vibration_counts() -> None:
    none = series()
    found = PictureStillness(
        series(drift=0.3, rms=0.1), series(drift=-0.4, rms=0.2), series(rms=2e-5), series(rms=1e-5),
        ((series(drift=2e-5, rms=1e-5), series(drift=2e-5, rms=0.5e-5)), (none, none)), none,
    )  # fmt: skip
    assert found.drift_px == pytest.approx(0.5)
    assert found.worse is found.v and found.worse_strain is found.exx
    assert found.keystone[0] == pytest.approx(2e-5) and found.keystone[1] == 0.0
    noisy = replace(found, rises=((series(2e-5, 1e-5), series(2e-5, 1.4e-5)), (none, none)))
    assert noisy.keystone[0] == 0.0, "one and a half times the noisier one is more"


class Kernel:
    """Measures blurs, one after the other."""

    def __init__(self, made: list[Any], blurs: list[Blur]) -> None:
        self._blurs = blurs
        self.grid, self.reference = make_grid(), SimpleNamespace(prepared=np.zeros((8, 8)))
        made.append(self)

    def measure(self, image: Any, *, noise: float) -> Blur:
        return self._blurs.pop(0)


@pytest.mark.parametrize(
    ("blur", "sharp", "taken"),
    [(Blur(-0.31, 0.1), 1.0, True), (Blur(-0.3, 0.1), 1.0, False), (Blur(0.5, 0.1), 2.0, False),
     (Blur(math.nan, math.nan), 1.1, True), (Blur(math.nan, math.nan), 0.9, False)],
)  # fmt: skip
def test_a_picture_that_is_sharper_for_certain_is_the_next_reference(
    monkeypatch: pytest.MonkeyPatch, blur: Blur, sharp: float, taken: bool
) -> None:
    made: list[Any] = []
    blurs = [Blur(0.0, 0.01), blur]
    monkeypatch.setattr(quick_check, "prepare", lambda *given: (Kernel(made, blurs), None))
    monkeypatch.setattr(quick_check, "mean_blur", lambda found: found)
    monkeypatch.setattr(quick_check, "correction", lambda *given: lambda burst: burst)
    burst = SimpleNamespace(mean=np.zeros((8, 8)), n=4)
    stack = SimpleNamespace(cut=lambda *cut: SimpleNamespace(mean=lambda: burst))
    region = SimpleNamespace(grid=make_grid(), at_zois=np.zeros((96, 128), bool), config=None, camera=None)
    sample: Any = SimpleNamespace(check_region=region, stack=stack, settings=None, noise=1.0)
    measurable = np.ones(region.grid.shape, bool)
    picture = SharpestPicture()
    assert picture.compare(sample, np.zeros_like(measurable), 1.0) is NOT_KNOWN and made == []
    assert picture.compare(sample, measurable, 1.0) == Blur(0.0, 0.01) and len(made) == 1
    found = picture.compare(sample, measurable, sharp)
    assert found == blur or math.isnan(found.px)
    assert len(made) == 1 + taken and picture._peak == (sharp if taken else 1.0)


def test_bursts_that_are_longer_than_what_was_taken_are_predicted_from_the_longest() -> None:
    sample: Any = SimpleNamespace(reference=32)
    noises = [StrainNoise(1, 3e-4, 2e-4), StrainNoise(4, 2e-4, 1e-4), StrainNoise(8, math.nan, math.nan)]
    found = list(_filled(noises, sample))
    assert found[:2] == noises[:2]
    assert found[2].predicted == pytest.approx(2e-4 * math.sqrt((1 / 32 + 1 / 8) / (1 / 32 + 1 / 4)))
    assert math.isnan(found[2].measured) and found[2].known == found[2].predicted
    assert list(_filled(noises[2:], sample)) == []
    assert _share(4, 8) == 0.375 and (SIZES, ORDERS, BURSTS) == ((32, 48, 64, 96), (1, 2), (1, 2, 4, 8, 16))
    floor = ZoiFloor(32, 1, 1.0, 1.0, 9, tuple(noises), 32)
    assert floor.of(4) == noises[1] and floor.of(3) is None
    assert noises[0].known == 2e-4
    assert math.isnan(median(np.array([np.nan]))) and median(np.array([np.nan, 1.0, 3.0])) == 2.0
