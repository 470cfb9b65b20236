"""A rolling shutter: its readout time against closed forms, and its strains removed by the measured velocity."""

from __future__ import annotations

import numpy as np
import pytest

from analysis import Roi, StrainField, ZoiGrid
from analysis.optics import ShutterCorrection, readout_of_bands, readout_of_motion
from hw_mocks.deformation import Affine
from hw_mocks.optics import Optics, RolledShutter

LINES = 240


def profiles(
    readout_s: float, seed: int, fps: float = 29.3, lamp: float = 100.0, flicker: float = 0.1
) -> np.ndarray:
    """Means of the lines of 96 pictures of an uneven scene."""
    rng = np.random.default_rng(seed)
    scene = 100 * (1 + 0.2 * np.clip(rng.standard_normal(LINES), -3, 3))
    optics = Optics(readout_s=readout_s, flicker=flicker, lamp_Hz=lamp)
    light = np.array([optics.light((k + 0.1) / fps, LINES)[:, 0] for k in range(96)])
    return np.asarray(scene * light + rng.normal(0, 0.1, light.shape))


@pytest.mark.parametrize(("readout_s", "lamp"), [(0.004, 100), (0.0166, 120), (0.033, 100), (0.12, 100)])
def test_bands_of_a_lamp_give_the_time(readout_s: float, lamp: float) -> None:
    found = [readout_of_bands(profiles(readout_s, seed, lamp=lamp), lamp) for seed in range(6)]
    errors = [(one.seconds - readout_s) / one.sigma for one in found]
    assert np.max(np.abs(errors)) < 3
    assert max(one.sigma for one in found) < 3e-3 * readout_s


@pytest.mark.parametrize(
    "seen",
    [profiles(0.0, 1), profiles(0.033, 1, fps=25.0), profiles(0.033, 1, flicker=0.0)],
    ids=["global shutter", "bands stand still", "even light"],
)
def test_pictures_without_moving_bands_are_refused(seen: np.ndarray) -> None:
    with pytest.raises(ValueError, match="no bands that move"):
        readout_of_bands(seen, 100.0)
    with pytest.raises(ValueError, match="15 pictures; it takes 16"):
        readout_of_bands(seen[:15], 100.0)


READOUT_S = 0.033


def moved(seed: int, amplitude: tuple[float, float]) -> tuple[np.ndarray, ...]:
    """t, u, v, du_dy, dv_dy of a specimen moved to and fro, nearer to the camera where it is lower, with noise."""
    rng, t = np.random.default_rng(seed), np.arange(90) / 30.0

    def at(when: float) -> Affine:
        x, y = amplitude[0] * np.sin(2.5 * when), amplitude[1] * np.sin(2 * when)
        scale = 2e-5 * y + 1e-6 * y**2
        return Affine(x, y, du_dx=scale, dv_dy=scale, x0=200, y0=LINES / 2)

    rows = []
    for when in t:
        seen = RolledShutter(at, when, READOUT_S, LINES)
        (u, v), gradient = seen.displacement(200.0, LINES / 2), seen.gradient(200.0, LINES / 2)
        rows.append((u, v, gradient[1], gradient[3]))
    u, v, du_dy, dv_dy = np.array(rows, float).T
    noise = rng.normal(0, 2e-5, (2, len(t)))
    return t, u, v, du_dy + noise[0], dv_dy + noise[1]


@pytest.mark.parametrize("amplitude", [(12.0, 0.0), (0.0, 12.0), (10.0, 8.0)])
def test_motion_gives_the_time_whatever_the_distance_does(amplitude: tuple[float, float]) -> None:
    errors = []
    for seed in range(30):
        t, u, v, du_dy, dv_dy = moved(seed, amplitude)
        found = readout_of_motion(t, (u, v), (du_dy, dv_dy), LINES)
        errors.append((found.seconds - READOUT_S) / found.sigma)
        assert found.sigma < 0.02 * READOUT_S
    assert 0.6 < np.sqrt(np.mean(np.square(errors))) < 1.6


def test_too_little_motion_is_refused() -> None:
    t, u, v, du_dy, dv_dy = moved(1, (0.01, 0.01))
    with pytest.raises(ValueError, match="too little motion"):
        readout_of_motion(t, (u, v), (du_dy, dv_dy), LINES)


def swung(count: int, a_line_s: float) -> tuple[np.ndarray, ...]:
    """t, u, v, du_dy, dv_dy without noise: shear and strain are the velocity times the time of a line."""
    t = np.arange(count) / 60.0
    u, v = 9 * np.sin(3 * t), 12 * np.cos(2 * t)
    return t, u, v, a_line_s * 27 * np.cos(3 * t), -a_line_s * 24 * np.sin(2 * t)


def test_the_time_of_a_picture_is_that_of_its_lines_but_one() -> None:
    t, u, v, du_dy, dv_dy = swung(90, 1e-4)
    found = readout_of_motion(t, (u, v), (du_dy, dv_dy), 41)
    assert found.seconds == pytest.approx(40 * 1e-4, rel=1e-3) and found.sigma < 1e-2 * found.seconds
    for one in (u, dv_dy):
        one[::9] = np.nan
    assert readout_of_motion(t, (u, v), (du_dy, dv_dy), 41).seconds == pytest.approx(40 * 1e-4, rel=1e-3)
    with pytest.raises(ValueError, match="90 pictures with a value in order; it takes 16"):
        readout_of_motion(t[::-1], *((one, one) for one in (swung(90, 1e-4)[1:3])), 41)  # type: ignore[arg-type]


def test_sixteen_velocities_are_needed() -> None:
    """Two at each end have none."""
    for count, words in ((19, "too little motion"), (15, "15 pictures with a value")):
        t, u, v, du_dy, dv_dy = swung(count, 1e-4)
        with pytest.raises(ValueError, match=words):
            readout_of_motion(t, (u, v), (du_dy, dv_dy), 41)
    t, u, v, du_dy, dv_dy = swung(20, 1e-4)
    assert readout_of_motion(t, (u, v), (du_dy, dv_dy), 41).seconds == pytest.approx(40 * 1e-4, rel=0.02)


def banded(bands: float, pictures: int) -> np.ndarray:
    """Means of lines under a lamp without noise, in another phase of the lamp in each picture."""
    line, phase = np.linspace(0, 1, LINES), 2.4 * np.arange(pictures)[:, None]
    return np.asarray(80 * (1 + 0.1 * np.cos(2 * np.pi * bands * line + phase)))


@pytest.mark.parametrize(("bands", "kept"), [(3.3, 0.0), (0.7, 0.1 / 96)])
def test_without_noise_the_mains_are_as_uncertain_as_stated(bands: float, kept: float) -> None:
    """And below one band, what the scene keeps of it."""
    found = readout_of_bands(banded(bands, 96), 120.0)
    assert found.seconds == pytest.approx(bands / 120, rel=1e-3)
    assert found.sigma == pytest.approx(np.hypot(5e-4, kept) * found.seconds, rel=0.1)


@pytest.mark.parametrize(("bands", "found"), [(0.23, False), (0.4, True), (29.5, True), (29.97, False)])
def test_bands_at_the_end_of_what_is_sought_are_none(bands: float, found: bool) -> None:
    """From a quarter of a band to one in eight lines."""
    seen = banded(bands, 96)
    if found:
        assert readout_of_bands(seen, 100.0).seconds == pytest.approx(bands / 100, rel=2e-3)
    else:
        with pytest.raises(ValueError, match="no bands that move"):
            readout_of_bands(seen, 100.0)


GRID = ZoiGrid.cover(Roi(40, 100, 200, 800), 64, 16)
READOUT, HEIGHT = 0.033, 1001
NAMES = ("u", "du_dx", "du_dy", "v", "dv_dx", "dv_dy")


def seen(t: float, sigma: float = 1e-3) -> StrainField:
    """Strained by 1000 um/m, and moving at 4 px/s to the right and 10 px/s down."""
    place = RolledShutter(lambda at: Affine(4 * at, 10 * at, dv_dy=1e-3, x0=140, y0=500), t, READOUT, HEIGHT)
    x, y = np.meshgrid(GRID.x, GRID.y)
    (u, v), (a, b, c, d) = place.displacement(x, y), place.gradient(x, y)
    return StrainField.from_values(GRID, dict(zip(NAMES, (u, a, b, v, c, d), strict=True)), sigma)


def test_velocity_no_longer_shows_as_strain() -> None:
    correction = ShutterCorrection(READOUT, HEIGHT)
    raw = seen(0.1)
    assert raw.mean("eyy")[0] - 1e-3 == pytest.approx(330e-6, rel=3e-3)
    assert raw.mean("gamma_xy")[0] == pytest.approx(4 * READOUT / 1000, rel=3e-3)
    assert correction.apply(raw, 0.1) is raw  # nothing is known of the velocity yet
    field = correction.apply(seen(0.2), 0.2)
    assert field.mean("eyy")[0] == pytest.approx(1e-3, abs=0.5e-6)
    assert field.mean("gamma_xy")[0] == pytest.approx(0, abs=0.5e-6)
    assert field.mean("v")[0] == pytest.approx(2.0 + 1e-3 * (np.mean(GRID.y) - 500), abs=2e-5)


def test_the_uncertainty_of_the_readout_time_is_in_the_strain() -> None:
    correction = ShutterCorrection(READOUT, HEIGHT, 0.1 * READOUT)
    first, second = seen(0.1, 1e-9), seen(0.2, 1e-9)
    correction.apply(first, 0.1)
    found = correction.apply(second, 0.2)
    assert found.mean("eyy")[1] == pytest.approx(0.1 * 330e-6, rel=5e-3)
    assert found.mean("gamma_xy")[1] == pytest.approx(0.1 * 4 * READOUT / 1000, rel=5e-3)


def test_a_lost_picture_and_a_time_that_stands_change_nothing() -> None:
    correction = ShutterCorrection(READOUT, HEIGHT)
    correction.apply(seen(0.1), 0.1)
    lost = StrainField.from_values(GRID, {}, status=np.full(GRID.shape, 5))
    assert correction.apply(lost, 0.15) is lost
    again = seen(0.1)
    assert correction.apply(again, 0.1) is again


def uniform(u: float, v: float, /, **sigmas: float) -> StrainField:
    """Moved as a whole and sheared, with gradients of their own."""
    gradients = {"du_dx": 0.02, "du_dy": 0.03, "dv_dx": 0.01, "dv_dy": -0.04}
    return StrainField.from_values(GRID, {"u": u, "v": v, **gradients}, sigmas)


def test_each_value_loses_what_its_velocity_makes_of_the_time_of_its_line() -> None:
    """Of 51 lines in 20 ms the middle one is number 25; a line is late by its place in the picture as it is now."""
    correction, line_s = ShutterCorrection(0.02, 51), 0.02 / 50
    correction.apply(uniform(0.0, 0.0), 0.5)
    found = correction.apply(uniform(2.0, -3.0), 1.0)  # 4 px/s and -6 px/s
    late = line_s * (GRID.y[:, None] - 3.0 - 25.0) + np.zeros(GRID.shape)
    assert found.u == pytest.approx(2.0 - 4 * late, rel=1e-12)
    assert found.v == pytest.approx(-3.0 + 6 * late, rel=1e-12)
    for name, value in (
        ("du_dx", 0.02 - 4 * line_s * 0.01),
        ("du_dy", 0.03 - 4 * line_s * (1 - 0.04)),
        ("dv_dx", 0.01 + 6 * line_s * 0.01),
        ("dv_dy", -0.04 + 6 * line_s * (1 - 0.04)),
    ):
        assert getattr(found, name) == pytest.approx(value, rel=1e-12), name
    rested = uniform(2.0, -3.0)
    assert np.array_equal(correction.apply(rested, 1.5).parameters, rested.parameters), (
        "since the burst before"
    )


def test_the_noise_of_each_velocity_is_in_its_own_gradients() -> None:
    correction, slope = ShutterCorrection(0.02, 51), 0.02 / 50 * (1 - 0.04)
    first, second = uniform(0.0, 0.0, u=0.5, v=0.1), uniform(2.0, -3.0, u=0.5, v=0.1)
    correction.apply(first, 0.5)
    common = correction.apply(second, 1.0).common
    assert common is not None
    for name, value in (("du_dy", "u"), ("dv_dy", "v")):
        velocity = np.sqrt(2) * first.mean(value)[1] / 0.5
        assert common.variance(name) == pytest.approx((velocity * slope) ** 2, rel=1e-9), name
