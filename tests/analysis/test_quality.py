"""Steadiness of a series, the pattern of ZOIs by differences of pixels, and the specimen found in a picture."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt, gaussian_filter

from analysis.field import Roi, ZoiGrid
from analysis.picture.pattern import autocorrelation_fwhm
from analysis.picture.spectrum import filtered_pattern
from analysis.quality.pattern import box_sums, speckle_radius, zoi_pattern
from analysis.quality.specimen import _Spread, find_specimen
from analysis.quality.steadiness import Steadiness, aliased, mains_of, steadiness

TIMES = np.arange(60) / 30.0


def test_a_line_has_its_frequency_and_its_mains() -> None:
    found = steadiness(TIMES, 0.5 + 0.1 * np.sin(2 * np.pi * 10 * TIMES))
    assert found.frequency == pytest.approx(10, abs=0.1) and found.rate == pytest.approx(30)
    assert mains_of(found, 2) == 50.0  # 100 Hz shows at 10 Hz in 30 pictures a second


@pytest.mark.parametrize(
    ("frequency", "rate", "shown"), [(100, 30, 10), (120, 25, 5), (110, 30, 10), (7, 30, 7)]
)
def test_a_fast_oscillation_shows_at_its_distance_from_the_nearest_multiple_of_the_rate(
    frequency: float, rate: float, shown: float
) -> None:
    assert aliased(frequency, rate) == pytest.approx(shown)


def test_a_vibration_is_what_noise_does_not_explain() -> None:
    assert Steadiness(0.0, 5.0, 3.0, None, 2.0, 30.0).vibration == pytest.approx(4)
    assert Steadiness(0.0, 3.0, 5.0, None, 2.0, 30.0).vibration == 0


def test_noise_alone_has_no_frequency() -> None:
    noise = np.random.default_rng(3).normal(0, 1, 60)
    found = steadiness(TIMES, noise)
    assert found.frequency is None and mains_of(found, 2) is None
    assert found.rate == pytest.approx(30)


def test_without_times_there_is_neither_frequency_nor_rate() -> None:
    found = steadiness(np.zeros(60), np.arange(60.0) % 2)
    assert found.frequency is None and found.rate is None and mains_of(found, 1) is None


def test_the_same_series_gives_equal_results() -> None:
    """Also where nothing stands out, and from another process: no comparison by identity."""
    for values in (np.zeros(60), np.random.default_rng(3).normal(0, 1, 60)):
        found = steadiness(TIMES, values)
        assert steadiness(TIMES, values) == found
        assert pickle.loads(pickle.dumps(found)) == found


HEIGHT, WIDTH = 300, 360


def scene(radius: float, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Speckle of contrast 38 GL in a slope of light, and all of it but a hole."""
    rng = np.random.default_rng(5)
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    pattern = gaussian_filter(rng.normal(size=x.shape), radius)
    picture = 110 + 38 * pattern / pattern.std() + 30 * (x / WIDTH - 0.5)
    inside = np.hypot(x - 150, y - 160) > 40
    return (picture + rng.normal(0, noise, x.shape)).astype(np.float32), inside


@pytest.mark.parametrize("radius", [1.5, 2.0, 4.0])
@pytest.mark.parametrize("noise", [0.5, 4.0])
def test_as_the_filtered_pattern_has_it(radius: float, noise: float) -> None:
    picture, inside = scene(radius, noise)
    grid = ZoiGrid.cover(Roi(200, 10, 150, 280), 48, 16)
    found = zoi_pattern(picture, grid, noise)
    pattern = filtered_pattern(picture, noise, 5)
    for one, slope in ((found.along_x, pattern.grad_x), (found.along_y, pattern.grad_y)):
        np.testing.assert_allclose(one, box_sums(slope.astype(float) ** 2, grid), rtol=0.06)
    assert math.sqrt(np.median(found.variance)) == pytest.approx(38, rel=0.1)
    of_all = autocorrelation_fwhm(picture, noise) / (4 * math.sqrt(math.log(2)))
    picture[~inside] = 250
    width = speckle_radius(picture, noise, inside)
    assert width == pytest.approx(of_all, rel=0.03)
    assert width == pytest.approx(radius, rel=0.1)


@pytest.mark.parametrize(("size", "step"), [(48, 16), (47, 16), (20, 33)])
def test_sums_over_each_zoi(size: int, step: int) -> None:
    values = np.random.default_rng(0).normal(size=(HEIGHT, WIDTH)).astype(np.float32)
    grid = ZoiGrid.cover(Roi(7, 11, 320, 270), size, step)
    sums = box_sums(values, grid)
    for row, top in enumerate(grid.first_y):
        for column, left in enumerate(grid.first_x):
            part = values[top : top + size, left : left + size]
            assert sums[row, column] == pytest.approx(part.sum(dtype=np.float64), abs=1e-3)


def test_noise_alone_has_no_radius() -> None:
    noise = np.random.default_rng(0).normal(100, 2, (200, 200)).astype(np.float32)
    assert math.isnan(speckle_radius(noise, 2.2, np.ones(noise.shape, bool)))


HEIGHT_SPECIMEN, WIDTH_SPECIMEN = 520, 440
HALF_A_ZOI = 16.0


def cluttered_scene(
    radius: float = 2.0, noise: float = 1.0, light: float = 0.0, seed: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """A strip with a hole in brushed grips, letters and a blurred pattern beside it; picture and truth (H, W)."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:HEIGHT_SPECIMEN, :WIDTH_SPECIMEN]
    speckle = gaussian_filter(rng.normal(size=x.shape), radius)
    strip = (abs(x - 200) < 80) & (y > 70) & (y < 450) & (np.hypot(x - 200, y - 250) > 32)
    brushed = gaussian_filter(rng.normal(size=x.shape), (0, 30))  # along x alone
    ground = 60 + 25 * gaussian_filter(rng.normal(size=x.shape), 14) / 0.02
    letters = 60 + 150 * ((x // 14 + y // 20) % 5 == 0)
    picture = np.where((y <= 70) | (y >= 450), 120 + 20 * brushed / brushed.std(), ground)
    picture = np.where((x > 350) & (x < 420) & (y > 90) & (y < 150), letters, picture)
    picture = np.where(strip, 110 + 38 * speckle / speckle.std(), picture)
    picture *= 1 + light * (x / WIDTH_SPECIMEN - 0.5)
    return np.clip(picture + rng.normal(0, noise, x.shape), 0, 255).round(), strip


@pytest.mark.parametrize(
    ("radius", "noise", "light"),
    [(1.5, 0.5, 0.0), (2.0, 1.0, 0.6), (2.0, 6.0, 0.0), (4.0, 1.0, 0.0), (3.0, 3.0, -0.6)],
)
def test_the_mask_follows_the_edge(radius: float, noise: float, light: float) -> None:
    picture, strip = cluttered_scene(radius, noise, light)
    found = find_specimen(picture)
    assert found is not None
    outside, inside = distance_transform_edt(~strip), distance_transform_edt(strip)
    assert not found.mask[outside > HALF_A_ZOI].any()
    assert found.mask[inside > HALF_A_ZOI].all()
    assert found.radius == pytest.approx(radius, rel=0.5)
    rows, columns = np.flatnonzero(found.mask.any(axis=1)), np.flatnonzero(found.mask.any(axis=0))
    assert (found.box.x, found.box.y) == (columns[0], rows[0])
    assert not found.mask.flags.writeable


def test_the_radius_of_speckle_from_contrast_and_gradient() -> None:
    """C^2 = 2 r^2 g^2 of blobs; the pixels over which a gradient is taken add 0.5 px^2, noise its variance to C^2."""
    power, inner = np.full((3, 3), 5.0, np.float32), np.ones((3, 3), bool)
    contrast = np.full((3, 3), 2 * (2.0**2 + 0.5) * 5 + 3, np.float32)
    assert _Spread(contrast, power, 3.0).radius(inner) == pytest.approx(2)


def test_dark_and_bright_decide_nothing() -> None:
    """The same picture as a negative."""
    picture, _ = cluttered_scene()
    one, other = find_specimen(picture), find_specimen(255 - picture)
    assert one is not None
    assert other is not None
    np.testing.assert_array_equal(one.mask, other.mask)


def test_the_larger_of_two() -> None:
    rng = np.random.default_rng(2)
    speckle = gaussian_filter(rng.normal(size=(300, 500)), 2)
    speckle *= 40 / speckle.std()
    picture = np.full((300, 500), 90.0)
    picture[20:280, 20:250] += speckle[20:280, 20:250]
    picture[100:200, 330:430] += speckle[100:200, 330:430]
    found = find_specimen(picture + rng.normal(0, 1, picture.shape))
    assert found is not None
    assert not found.mask[:, 300:].any()


@pytest.mark.parametrize("what", ["noise", "lines", "ramp"])
def test_no_pattern_is_no_specimen(what: str) -> None:
    x = np.mgrid[:200, :260][1]
    noise = np.random.default_rng(1).normal(0, 2, x.shape)
    picture = {"noise": 100.0, "lines": 100 + 60 * np.sin(x / 2.0), "ramp": 0.5 * x}[what] + noise
    assert find_specimen(picture) is None


def test_what_is_no_picture() -> None:
    with pytest.raises(ValueError, match=r"\d"):
        find_specimen(np.zeros((8, 8)))


def test_the_box_holds_the_mask_and_no_more() -> None:
    found = find_specimen(cluttered_scene()[0])
    assert found is not None
    box, rows, columns = found.box, found.mask.any(axis=1), found.mask.any(axis=0)
    assert (box.width, box.height) == (np.ptp(np.flatnonzero(columns)) + 1, np.ptp(np.flatnonzero(rows)) + 1)
    assert (
        found.share
        == found.mask[box.y : box.y + box.height, box.x : box.x + box.width].sum() / found.mask.size
    )


@pytest.mark.parametrize(("side", "found"), [(90, True), (30, False)])
def test_the_least_specimen(side: int, found: bool) -> None:
    """Half a percent of the picture; what is narrower than a small ZOI is none."""
    rng = np.random.default_rng(2)
    speckle = gaussian_filter(rng.normal(size=(side, side)), 2)
    picture = np.full((700, 900), 90.0)
    picture[300 : 300 + side, 400 : 400 + side] += 40 * speckle / speckle.std()
    assert (find_specimen(picture + rng.normal(0, 1, picture.shape)) is not None) == found
