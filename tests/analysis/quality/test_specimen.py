"""The specimen found among what an operator's picture has beside it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt, gaussian_filter

from analysis.quality import find_specimen

HEIGHT, WIDTH = 520, 440
HALF_A_ZOI = 16.0


def scene(
    radius: float = 2.0, noise: float = 1.0, light: float = 0.0, seed: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """A strip with a hole in brushed grips, letters and a blurred pattern beside it; picture and truth (H, W)."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    speckle = gaussian_filter(rng.normal(size=x.shape), radius)
    strip = (abs(x - 200) < 80) & (y > 70) & (y < 450) & (np.hypot(x - 200, y - 250) > 32)
    brushed = gaussian_filter(rng.normal(size=x.shape), (0, 30))  # along x alone
    ground = 60 + 25 * gaussian_filter(rng.normal(size=x.shape), 14) / 0.02
    letters = 60 + 150 * ((x // 14 + y // 20) % 5 == 0)
    picture = np.where((y <= 70) | (y >= 450), 120 + 20 * brushed / brushed.std(), ground)
    picture = np.where((x > 350) & (x < 420) & (y > 90) & (y < 150), letters, picture)
    picture = np.where(strip, 110 + 38 * speckle / speckle.std(), picture)
    picture *= 1 + light * (x / WIDTH - 0.5)
    return np.clip(picture + rng.normal(0, noise, x.shape), 0, 255).round(), strip


@pytest.mark.parametrize(
    ("radius", "noise", "light"),
    [(1.5, 0.5, 0.0), (2.0, 1.0, 0.6), (2.0, 6.0, 0.0), (4.0, 1.0, 0.0), (3.0, 3.0, -0.6)],
)
def test_the_mask_follows_the_edge(radius: float, noise: float, light: float) -> None:
    picture, strip = scene(radius, noise, light)
    found = find_specimen(picture)
    assert found is not None
    outside, inside = distance_transform_edt(~strip), distance_transform_edt(strip)
    assert not found.mask[outside > HALF_A_ZOI].any()
    assert found.mask[inside > HALF_A_ZOI].all()
    assert found.radius == pytest.approx(radius, rel=0.5)
    rows, columns = np.flatnonzero(found.mask.any(axis=1)), np.flatnonzero(found.mask.any(axis=0))
    assert (found.box.x, found.box.y) == (columns[0], rows[0])
    assert not found.mask.flags.writeable


def test_dark_and_bright_decide_nothing() -> None:
    """The same picture as a negative."""
    picture, _ = scene()
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
