"""Means of frames as files: kept to the last bit, and bad ones refused."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from acquire.burst.accumulate import (
    BurstAccumulator,
    _solve,
    average_bursts,
    burst_of,
    motion_between_frames,
)
from acquire.burst.flat_field import FlatField, load_mean, save_mean
from acquire.errors import ConfigError, DataError
from acquire.files.picture import write_picture
from acquire.frame import Burst, Frame, frozen


def frame(image: NDArray[Any], index: int, *, bits: int = 8, lost: int = 0, damaged: bool = False) -> Frame:
    t = 100.0 + index / 10
    return Frame(frozen(image), index, t, "device", lost, bits, t, damaged)


def small(index: int, value: int = 7, **more: Any) -> Frame:
    return frame(np.full((3, 5), value, np.uint8), index, **more)


@pytest.mark.parametrize(("dtype", "bits"), [(np.uint8, 8), (np.uint16, 12), (np.uint16, 16)])
@pytest.mark.parametrize("n", [1, 2, 7, 8, 9, 16, 21])
def test_mean_noise_and_clipping_are_those_of_plain_arithmetic(dtype: type, bits: int, n: int) -> None:
    rng = np.random.default_rng(n)
    stack = rng.integers(0, 2**bits, (n, 61, 83)).astype(dtype)
    burst = burst_of([frame(image, 40 + i, bits=bits) for i, image in enumerate(stack)])
    exact = stack.astype(np.int64)
    assert burst.mean.dtype == (np.float32 if n > 1 else dtype)
    assert np.array_equal(burst.mean, (exact.sum(axis=0) / n).astype(np.float32))
    assert np.array_equal(burst.clipped, (exact == 2**bits - 1).any(axis=0))
    if n == 1:
        assert math.isnan(burst.noise)
    else:
        assert burst.noise == pytest.approx(math.sqrt((np.diff(exact, axis=0) ** 2).mean() / 2), rel=1e-12)
    assert (burst.n, burst.first_index, burst.last_index, burst.lost) == (n, 40, 40 + n - 1, 0)
    assert burst.t == pytest.approx(104 + (n - 1) / 20)
    assert burst.duration == pytest.approx((n - 1) / 10)


def test_noise_is_that_of_one_frame_and_ignores_slow_motion() -> None:
    rng = np.random.default_rng(1)
    drift = np.arange(32)[:, None, None] * 0.5
    stack = np.rint(1000 + drift + rng.normal(0, 4, (32, 200, 200))).astype(np.uint16)
    burst = burst_of([frame(image, i, bits=12) for i, image in enumerate(stack)])
    assert burst.noise == pytest.approx(math.hypot(4, 12**-0.5), rel=0.01)


def test_memory_is_its_own_and_read_only() -> None:
    sources = [small(0), small(1)]
    burst = burst_of(sources)
    assert not np.shares_memory(burst.mean, sources[0].image)
    assert not burst.mean.flags.writeable
    assert not burst.clipped.flags.writeable


@pytest.mark.parametrize(
    ("frames", "n", "bursts"),
    [
        pytest.param(
            [small(i, lost=2 * (i == 5)) for i in (0, 1, 2, 5, 6, 7, 8, 9, 10)],
            4,
            [(5, 8, 2)],
            id="a gap restarts it",
        ),
        pytest.param(
            [small(0), small(1, lost=4), small(2)], 2, [(1, 2, 4)], id="also one without a step in the index"
        ),
        pytest.param(
            [small(0), small(1, damaged=True), small(2), small(3)], 2, [(2, 3, 1)], id="a damaged frame"
        ),
        pytest.param(
            [small(0), small(1), small(4, lost=2), small(5)],
            2,
            [(0, 1, 0), (4, 5, 2)],
            id="a loss is of the next one",
        ),
        pytest.param([], 3, [], id="no frames"),
        pytest.param([], 65536, [], id="the longest"),
    ],
)
def test_what_is_lost_on_the_way(frames: list[Frame], n: int, bursts: list[tuple[int, int, int]]) -> None:
    found = [(b.first_index, b.last_index, b.lost) for b in average_bursts(frames, n)]
    assert found == bursts


@pytest.mark.parametrize(("not_before", "first"), [(100.25, [3]), (100.2, [2, 4])])
def test_frames_older_than_the_command_are_left_out(not_before: float, first: list[int]) -> None:
    """One of its very instant counts."""
    bursts = list(average_bursts([small(i) for i in range(6)], 2, not_before=not_before))
    assert [(b.first_index, b.lost) for b in bursts] == [(index, 0) for index in first]


@pytest.mark.parametrize("n", [0, -1, 65537])
def test_an_impossible_n_is_a_configuration_error(n: int) -> None:
    with pytest.raises(ConfigError, match="burst of"):
        average_bursts([], n)


def test_an_exact_list_with_a_gap_is_refused() -> None:
    with pytest.raises(DataError, match="consecutive"):
        burst_of([small(0), small(2)])
    with pytest.raises(ConfigError):
        burst_of([])


def test_frames_of_another_kind_are_refused_by_name() -> None:
    with pytest.raises(DataError, match=r"frame 1 is 6x3 .* began with 5x3"):
        burst_of([small(0), frame(np.zeros((3, 6), np.uint8), 1)])


@settings(max_examples=60)
@given(st.lists(st.sampled_from(["good", "damaged", "gap"]), max_size=60), st.integers(1, 5))
def test_what_is_lost_or_damaged_is_counted_once(kinds: list[str], n: int) -> None:
    frames = list(_stream(kinds))
    accumulator = BurstAccumulator(n)
    bursts = [burst for burst in map(accumulator.add, frames) if burst]
    told_lost = sum(f.lost_before for f in frames)
    tail = accumulator.add(small(10_000, damaged=True))
    assert tail is None
    rest = [b for b in map(accumulator.add, (small(20_000 + i) for i in range(n))) if b]
    damaged = sum(f.damaged for f in frames) + 1
    assert sum(b.lost for b in bursts + rest) == told_lost + damaged
    indices = {f.index for f in frames if not f.damaged}
    assert all(set(range(b.first_index, b.last_index + 1)) <= indices for b in bursts)


def _stream(kinds: list[str]) -> Iterator[Frame]:
    index = 0
    for kind in kinds:
        index += 3 if kind == "gap" else 1
        yield small(index, lost=2 if kind == "gap" else 0, damaged=kind == "damaged")


def test_a_burst_of_one_is_the_frame_itself() -> None:
    only = small(5, lost=2)
    assert burst_of([only]).mean is only.image and burst_of([only]).lost == 2


def waves(
    u: float = 0.0, v: float = 0.0, strain: float = 0.0, noise: float = 0.0, seed: int = 0
) -> NDArray[Any]:
    """A smooth pattern that has moved by (u, v) and been stretched along y about the middle."""
    y, x = np.mgrid[:180, :200].astype(float)
    x, y = x - u, (y - v - 90) / (1 + strain)
    level = np.sin(0.61 * x + 0.23 * y) + np.cos(0.52 * y - 0.31 * x) + np.sin(0.37 * x - 0.44 * y + 1)
    image = 2000 + 500 * level + np.random.default_rng(seed).normal(0, noise, level.shape)
    return np.rint(image).astype(np.uint16)


@pytest.mark.parametrize(("u", "v"), [(0.05, 0.0), (0.0, -0.05), (0.03, 0.04), (0.2, 0.1), (-0.5, 0.0)])
def test_a_known_motion_is_told_well_enough(u: float, v: float) -> None:
    motion = motion_between_frames(waves(), waves(u, v), 0.3)
    assert motion == pytest.approx(math.hypot(u, v), rel=0.15)


def test_stretching_shows_although_the_middle_stands_still() -> None:
    # 45 px from the middle on the average of a tile, at 1e-3
    assert motion_between_frames(waves(), waves(strain=1e-3), 0.3) == pytest.approx(0.045, rel=0.15)


def test_noise_alone_is_not_taken_for_motion() -> None:
    seen = [
        motion_between_frames(waves(noise=40, seed=k), waves(noise=40, seed=k + 100), 40) for k in range(20)
    ]
    assert max(seen) < 0.03


def test_a_large_motion_is_never_taken_for_none() -> None:
    assert motion_between_frames(waves(), waves(u=1.5), 0.3) > 0.3


@pytest.mark.parametrize(
    "image",
    [
        np.full((50, 60), 9, np.uint8),
        np.tile(np.arange(60, dtype=np.uint8), (50, 1)),
        *(np.zeros(shape, np.uint8) for shape in ((1, 1), (2, 9), (3, 3))),
    ],
    ids=["flat", "of columns", "a pixel", "two rows", "tiny"],
)
def test_without_contrast_in_both_directions_nothing_is_known(image: NDArray[Any]) -> None:
    assert math.isnan(motion_between_frames(image, image, 1.0))


def test_a_burst_tells_its_motion_over_the_whole_of_its_frames() -> None:
    burst = burst_of([frame(waves(u=0.02 * k), k, bits=12) for k in range(4)])
    assert burst.motion_px == pytest.approx(0.08, rel=0.15)
    assert math.isnan(burst_of([frame(waves(), 0, bits=12)]).motion_px)


def burst(mean: np.ndarray) -> Burst:
    clipped = np.zeros(mean.shape, np.bool_)
    return Burst(mean.astype(np.float32), 4, math.nan, clipped, 12, 0.0, 0.1, 0, 3, 0, "device")


def scene() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(1)
    true = rng.uniform(200, 3000, (40, 50))
    return true, rng.uniform(0, 60, true.shape), rng.uniform(0.7, 1.3, true.shape)


def test_fixed_pattern_is_taken_out() -> None:
    true, dark, gain = scene()
    field = FlatField.from_images(dark, dark + 2000 * gain)
    corrected = field.apply(burst(dark + true * gain)).mean
    scale = np.median(corrected / true)
    assert np.abs(corrected / (scale * true) - 1).max() < 1e-5
    assert scale == pytest.approx(np.median(gain), rel=0.01)
    assert corrected.dtype == np.float32
    assert not corrected.flags.writeable


def test_dark_alone_and_flat_alone() -> None:
    true, dark, gain = scene()
    assert np.allclose(FlatField.from_images(dark, None).apply(burst(true + dark)).mean, true, rtol=1e-5)
    corrected = FlatField.from_images(None, 2000 * gain).apply(burst(true * gain)).mean / true
    assert np.ptp(corrected) < 1e-4


def test_pixels_that_see_nothing_are_marked() -> None:
    true, dark, gain = scene()
    flat = dark + 2000 * gain
    flat[3, 4] = dark[3, 4]
    result = FlatField.from_images(dark, flat).apply(burst(dark + true * gain))
    assert np.argwhere(result.clipped).tolist() == [[3, 4]]
    assert np.isfinite(result.mean).all()


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(DataError, match="dark or a flat"):
        FlatField.from_images(None, None)
    with pytest.raises(DataError, match="of one size"):
        FlatField.from_images(np.ones((2, 2)), np.ones((2, 3)))
    with pytest.raises(DataError, match="no brighter"):
        FlatField.from_images(np.ones((2, 2)), np.ones((2, 2)))
    with pytest.raises(DataError, match="for 50x40 pictures, the camera gives 6x5"):
        FlatField.from_images(scene()[1], None).apply(burst(np.ones((5, 6))))


def test_means_are_kept_to_the_last_bit(tmp_path: Path) -> None:
    mean = np.random.default_rng(2).normal(100, 30, (20, 30)).astype(np.float32)
    save_mean(mean, tmp_path / "dark.tif")
    np.testing.assert_array_equal(load_mean(str(tmp_path / "dark.tif")), mean)
    with pytest.raises(ConfigError, match="nothing is overwritten"):
        save_mean(mean, tmp_path / "dark.tif")
    with pytest.raises(ConfigError, match="TIFF"):
        save_mean(mean, tmp_path / "dark.png")
    with pytest.raises(DataError, match="cannot be written"):
        save_mean(mean, tmp_path / "nowhere" / "dark.tif")
    assert load_mean(None) is None
    with pytest.raises(DataError, match="no such"):
        load_mean(str(tmp_path / "x.tif"))
    (tmp_path / "text.tif").write_text("no picture")
    with pytest.raises(DataError, match="not an image"):
        load_mean(str(tmp_path / "text.tif"))


def test_the_displacement_of_a_tile_from_its_sums() -> None:
    """Of 100 pixels with a noise of 0.2: 1 is taken off the squares, 2 noise^2 (xx + yy) / D off the motion's."""
    assert _solve(101, 0, 101, 10, 0, 100, noise=0.2) == pytest.approx(math.sqrt(0.01 - 0.0016))
    assert _solve(101, 0, 101, 0, -10, 100, noise=0.2) == pytest.approx(math.sqrt(0.01 - 0.0016))
    u, v = 100 * 10 / 6400, -60 * 10 / 6400
    assert _solve(101, 60, 101, 10, 0, 100, noise=0.2) == pytest.approx(math.sqrt(u * u + v * v - 0.0025))
    assert _solve(101, 0, 101, 1, 1, 100, noise=0.2) == 0.0, "no more than noise shows"


@pytest.mark.parametrize(
    ("square", "noise", "seen"), [(2.0, 0.2, False), (2.1, 0.2, True), (1.0, 0.0, False), (1.1, 0.0, True)]
)
def test_contrast_is_seen_above_the_noise_and_a_tenth_of_a_grey_level_a_pixel(
    square: float, noise: float, seen: bool
) -> None:
    assert math.isnan(_solve(square, 0, square, 0.1, 0, 100, noise=noise)) != seen


def test_a_pixel_is_useless_below_a_twentieth_of_the_median_of_the_flat() -> None:
    flat = np.full((5, 5), 1000.0, np.float32)
    flat[0, :3] = (49.0, 51.0, 5000.0)
    field = FlatField.from_images(None, flat)
    assert np.argwhere(field.useless).tolist() == [[0, 0]]
    assert field.gain[0, :4].tolist() == pytest.approx([1.0, 1000 / 51, 0.2, 1.0])
    assert not field.dark.any()


@pytest.mark.parametrize(
    "image", [np.ones((4, 5, 3), np.uint8), np.full((4, 5), np.nan, np.float32)], ids=["colour", "nan"]
)
def test_a_colour_picture_or_one_without_numbers_is_no_mean(tmp_path: Path, image: NDArray[Any]) -> None:
    write_picture(tmp_path / "dark.tif", image)
    with pytest.raises(DataError, match=r"dark\.tif: is not a grey TIFF; take the frame anew"):
        load_mean(str(tmp_path / "dark.tif"))
    write_picture(tmp_path / "grey.tif", np.full((4, 5), 7, np.uint8))
    mean = load_mean(str(tmp_path / "grey.tif"))
    assert mean is not None and mean.dtype == np.float32 and np.all(mean == 7)
