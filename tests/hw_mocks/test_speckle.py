"""The renderer: its two roads against each other, what the pattern promises; noise and rounding of the sensor."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hw_mocks.deformation import Affine, Deformation, Wave
from hw_mocks.scene import Exposer, Scene, Sensor, normal_quantiles
from hw_mocks.specimen import VirtualSpecimen
from hw_mocks.speckle import Hole, Speckle, taken_back

SHAPE = (160, 200)


@pytest.fixture(scope="module")
def speckle() -> Speckle:
    return Speckle(SHAPE, radius=2.0, seed=3)


@pytest.mark.parametrize("radius", [1.5, 2.0, 4.0])
def test_contrast_and_scale(radius: float) -> None:
    image = Speckle((256, 256), radius).reference()
    assert image.std() == pytest.approx(0.18, rel=1e-3)
    assert image.mean() == pytest.approx(0.5, abs=0.02)
    assert image.min() >= 0.039 and image.max() <= 0.961


def test_gradient_of_the_pattern_is_that_of_its_blobs(speckle: Speckle) -> None:
    """A sum of many blobs of radius r and standard deviation s has gradients of s / (r sqrt 2)."""
    rng = np.random.default_rng(0)
    x, y, h = rng.uniform(10, 190, 20000), rng.uniform(10, 150, 20000), 1e-3
    slope = (speckle.at(x + h, y) - speckle.at(x - h, y)) / (2 * h)
    assert slope.std() == pytest.approx(0.18 / (2.0 * math.sqrt(2)), rel=0.05)


def test_seed_decides(speckle: Speckle) -> None:
    assert np.array_equal(speckle.reference(), Speckle(SHAPE, seed=3).reference())
    assert not np.array_equal(speckle.reference(), Speckle(SHAPE, seed=4).reference())


AFFINE = {
    "identity": Affine(),
    "shift": Affine(0.3, -0.7),
    "strain": Affine(0, 0, 0.02, 0, 0, -0.01, 100, 80),
    "shear": Affine(0, 0, 0, 0.05, 0, 0, 100, 80),
    "rotation": Affine.rotation(0.3, 100, 80),
    "all": Affine(5.2, -3.1, 0.02, 0.01, -0.03, 0.1, 100, 80),
}


@pytest.mark.parametrize("deformation", AFFINE.values(), ids=AFFINE.keys())
def test_roads_agree_for_affine_deformations(speckle: Speckle, deformation: Affine) -> None:
    miss = speckle.fast(deformation) - speckle.exact(deformation)
    assert np.abs(miss).max() < 5e-6
    assert miss.std() < 1e-6


CURVED: dict[str, tuple[Deformation, float, float]] = {
    "sine of the paper": (Wave(0.02, 128), 8e-5, 2e-5),
    "strong sine": (Wave(0.5, 64), 8e-3, 2e-3),
    "woven": (VirtualSpecimen("woven", width=200, height=160).at(20.0), 5e-4, 1e-4),
}


@pytest.mark.parametrize(("deformation", "most", "rms"), CURVED.values(), ids=CURVED.keys())
def test_roads_agree_where_the_gradient_varies(
    speckle: Speckle, deformation: Deformation, most: float, rms: float
) -> None:
    miss = speckle.fast(deformation) - speckle.exact(deformation)
    assert np.abs(miss).max() < most
    assert miss.std() < rms


def test_exact_is_the_reference_carried_along(speckle: Speckle) -> None:
    """deformed(x + u, y + v) = reference(x, y), without going through the inverse."""
    deformation = Affine(3.0, -2.0)
    moved = speckle.exact(deformation)
    np.testing.assert_allclose(moved[10:140, 10:190], speckle.exact(Affine())[12:142, 7:187], atol=1e-7)


def test_taken_back_inverts() -> None:
    motion = VirtualSpecimen("hole", rotation_rad=0.2, drift_px=(5, 3)).at(20.0)
    y, x = np.mgrid[0:512:37, 0:640:37].astype(float).reshape(2, -1)
    back_x, back_y = taken_back(motion, x, y)
    u, v = motion.displacement(back_x, back_y)
    np.testing.assert_allclose(back_x + u, x, atol=1e-9)
    np.testing.assert_allclose(back_y + v, y, atol=1e-9)


def test_folding_deformation_is_refused() -> None:
    with pytest.raises(ValueError, match="inverted"):
        taken_back(Wave(50.0, 20.0), *np.mgrid[0:40, 0:40].astype(float).reshape(2, -1))


def test_hole_moves_with_the_specimen() -> None:
    specimen = VirtualSpecimen("hole", width=200, height=160, hole_radius_px=40, drift_px=(6.0, 4.0))
    scene = Scene(specimen)
    image, exact = scene.render(20.0), scene.exact(20.0)
    assert np.abs(image - exact).max() < 2e-3
    assert image[84, 106] == pytest.approx(0.12)
    assert np.all(np.abs(scene.render(0.0)[70:90, 90:110] - 0.12) < 1e-6)


def test_hole_without_motion_is_a_disc() -> None:
    speckle = Speckle(SHAPE, hole=Hole(99.5, 79.5, 30))
    plain = Speckle(SHAPE)
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    far = np.hypot(x - 99.5, y - 79.5) > 34
    np.testing.assert_allclose(speckle.reference()[far], plain.reference()[far], atol=2e-4)


def test_scene_is_the_specimen(speckle: Speckle) -> None:
    specimen = VirtualSpecimen("woven", width=200, height=160)
    scene = Scene(specimen)
    expected = scene.speckle.fast(specimen.at(9.0))
    np.testing.assert_array_equal(scene.render(9.0), expected)
    assert not np.array_equal(scene.render(9.0), scene.render(15.0))


def test_pattern_goes_on_where_the_test_moves_it_into_view() -> None:
    specimen = VirtualSpecimen(width=200, height=160, drift_px=(40.0, 0.0))
    left = Scene(specimen).render(20.0)[:, :30]
    assert left.std() > 0.1


def test_impossible_contrast_is_refused() -> None:
    with pytest.raises(ValueError, match="contrast"):
        Speckle((64, 64), contrast=0.6)


PIXELS = (200, 250)


def frames(sensor: Sensor, level: float, n: int = 20, seed: int = 0) -> np.ndarray:
    exposer = Exposer(sensor, PIXELS, seed)
    light = np.full(PIXELS, level, np.float32)
    return np.array([exposer.expose(light) for _ in range(n)], np.float64)


@pytest.mark.parametrize("bits", [8, 10, 12, 16])
def test_without_noise_only_rounding_is_left(bits: int) -> None:
    rng = np.random.default_rng(1)
    light = rng.uniform(0, 1, PIXELS).astype(np.float32)
    image = Exposer(Sensor.with_noise(bits, 0.0), PIXELS).expose(light)
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
