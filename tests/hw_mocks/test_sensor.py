"""The sensor: noise, rounding, saturation."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hw_mocks.scene import Exposer, Sensor, normal_quantiles

SHAPE = (200, 250)


def frames(sensor: Sensor, level: float, n: int = 20, seed: int = 0) -> np.ndarray:
    exposer = Exposer(sensor, SHAPE, seed)
    light = np.full(SHAPE, level, np.float32)
    return np.array([exposer.expose(light) for _ in range(n)], np.float64)


@pytest.mark.parametrize("bits", [8, 10, 12, 16])
def test_without_noise_only_rounding_is_left(bits: int) -> None:
    rng = np.random.default_rng(1)
    light = rng.uniform(0, 1, SHAPE).astype(np.float32)
    image = Exposer(Sensor.with_noise(bits, 0.0), SHAPE).expose(light)
    assert image.dtype == (np.uint8 if bits == 8 else np.uint16)
    assert not image.flags.writeable
    assert np.abs(image - light.astype(float) * (2**bits - 1)).max() <= 0.51


@pytest.mark.parametrize("level", [0.1, 0.5, 0.8])
@pytest.mark.parametrize("bits", [8, 12])
def test_temporal_noise_is_as_stated(bits: int, level: float) -> None:
    sensor = Sensor(bits, full_well_e=20_000, read_e=15)
    stack = frames(sensor, level)
    measured = math.sqrt(np.mean(np.var(stack, axis=0, ddof=1)))
    assert measured == pytest.approx(sensor.noise(level), rel=0.01)
    assert stack.mean() == pytest.approx(level * sensor.top, abs=0.02 * measured + 0.05)


def test_noise_asked_for_is_that_at_mid_grey() -> None:
    sensor = Sensor.with_noise(12, 0.01)
    assert sensor.noise() == pytest.approx(math.hypot(40.95, math.sqrt(1 / 12)), rel=1e-6)


def test_noise_is_fresh_and_white() -> None:
    stack = frames(Sensor(), 0.5, n=4)
    noise = stack - stack.mean()
    assert abs(np.corrcoef(noise[0].ravel(), noise[1].ravel())[0, 1]) < 0.02
    for one, other in ((noise[0][:, 1:], noise[0][:, :-1]), (noise[0][1:], noise[0][:-1])):
        assert abs(np.corrcoef(one.ravel(), other.ravel())[0, 1]) < 0.02


def test_same_seed_same_frames() -> None:
    assert np.array_equal(frames(Sensor(), 0.5, seed=5), frames(Sensor(), 0.5, seed=5))
    assert not np.array_equal(frames(Sensor(), 0.5, seed=5), frames(Sensor(), 0.5, seed=6))


def test_fixed_pattern_stays() -> None:
    mean = frames(Sensor.with_noise(12, 0.002, fixed_pattern=0.02), 0.5, n=50).mean(axis=0)
    assert mean.std() == pytest.approx(0.02 * 4095, rel=0.02)


def test_saturation() -> None:
    image = frames(Sensor(bits=10, brightness=3.0), 0.5, n=1)
    assert np.all(image == 1023)


def test_quantiles_are_normal() -> None:
    values = normal_quantiles().astype(float)
    assert values.size == 65536
    assert values.std() == pytest.approx(1, rel=1e-6)
    assert np.mean(values**4) == pytest.approx(3, abs=0.01)


def test_a_sensor_of_a_given_noise_has_four_hundredths_of_its_variance_from_reading() -> None:
    sensor = Sensor.with_noise(12, 0.01, fixed_pattern=0.02, brightness=1.5)
    assert (sensor.full_well_e, sensor.read_e) == pytest.approx((0.5 / 0.96e-4, 0.002 * 0.5 / 0.96e-4))
    assert (sensor.fixed_pattern, sensor.brightness, sensor.black) == (0.02, 1.5, 0.0)
    assert sensor.gain == pytest.approx(4095 / sensor.full_well_e)
    assert sensor.read_noise == pytest.approx(0.2 * 40.95)
    silent = Sensor.with_noise(8, 0.0)
    assert (silent.gain, silent.read_noise, silent.noise()) == (0, 0, pytest.approx(math.sqrt(1 / 12)))


def test_noise_grows_with_the_light() -> None:
    sensor = Sensor(12, 4095.0, 3.0)  # one grey level an electron
    assert sensor.noise(0.0) == pytest.approx(math.sqrt(9 + 1 / 12))
    assert sensor.noise(0.1) == pytest.approx(math.sqrt(409.5 + 9 + 1 / 12))


@pytest.mark.parametrize(("light", "level"), [(0.0, 51), (0.2, 102), (0.9, 255)])
def test_black_is_added_to_the_light(light: float, level: int) -> None:
    sensor = Sensor(8, math.inf, 0.0, black=0.2)
    image = Exposer(sensor, (3, 4)).expose(np.full((3, 4), light, np.float32))
    assert np.abs(image.astype(int) - level).max() <= 1
