"""What a set-up makes of its settings: distances, pictures, the region of a check, a scale, devices."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from acquire.errors import ConfigError, DataError, DeviceError
from acquire.frame import CameraInfo
from acquire.load_cell.zeroed import ZeroedLoadCell
from analysis import Roi, StrainField, ZoiGrid
from analysis.optics import Readout
from live.config.loading import load_config
from live.setup import devices as devices_module
from live.setup import prepared as prepared_module
from live.setup import readout as readout_module
from live.setup import scale as scale_module
from live.setup.check.check_list import median
from live.setup.check.noise_floor import BURSTS, ORDERS, SIZES, StrainNoise, ZoiFloor, _filled, _share
from live.setup.check.quick_check import QuickCheck, RollingFrames, _same_region
from live.setup.check.sample import FrameStack, around, moved, temporal_noise
from live.setup.check.stillness import MAX_ZOIS, covered, middle
from live.setup.compiling import progress_text
from live.setup.devices import _open_cropped, at_rest, open_rig
from live.setup.dry_run import _image, picture_kinds
from live.setup.lens_calibration import _box
from live.setup.pictures import correction, mask_picture, read_mask, with_mask
from live.setup.prepared import MeasurePlan, PreparedKernel, _focal_px
from live.setup.readout import from_lamp, from_motion
from live.setup.region import FirstLook, Region, _mean_and_noise, _within
from live.setup.rig_proposal import Proposal
from live.setup.scale import Board, _bands, _edge, _sides, _tilt, from_points, from_width, specimen_width
from tests.live.fakes import ListCamera, frame
from tests.live.made_up import make_field, make_grid

CAMERA = CameraInfo("a:", "a", 128, 96, 8, False, "nominal")


def plan(**settings: Any) -> MeasurePlan:
    given = {"measure.zoi": 32, "measure.roi": [0, 0, 128, 96]}
    given |= {key.replace("__", "."): value for key, value in settings.items()}
    return MeasurePlan.of(load_config(None, given), CAMERA, None)


def test_the_distance_of_the_camera_is_in_px_of_the_specimen_or_assumed() -> None:
    known = plan(scale__mm_per_px=0.05, scale__stand_off_mm=400.0)
    assert known.focal_px == pytest.approx(8000.0) and _focal_px(known.config) == pytest.approx(8000.0)
    for part in ({"scale__mm_per_px": 0.05}, {"scale__stand_off_mm": 400.0}, {}):
        assert plan(**part).focal_px == 4 * 128 and _focal_px(plan(**part).config) is None


def test_a_rolling_shutter_is_corrected_where_its_time_is_known() -> None:
    """At 100 px/s the 12.5 ms of 96 lines show as a strain of 100 * 0.0125 / 95."""
    assert plan().shutter is None and plan(camera__readout_ms=0).shutter is None
    given = plan(camera__readout_ms=12.5, camera__sigma_readout_ms=0.5)
    shutter = given.shutter
    assert shutter is not None
    shutter.apply(StrainField.from_values(given.grid, {"v": 0.0}, 1e-6), 1.0)
    found = shutter.apply(StrainField.from_values(given.grid, {"v": 10.0}, 1e-6), 1.1)
    assert float(found.dv_dy[0, 0]) == pytest.approx(-100 * 0.0125 / 95)
    assert found.mean("dv_dy")[1] == pytest.approx(100 * 0.0005 / 95, rel=0.01)


@pytest.mark.parametrize("nu", [None, 0.3])
def test_a_measurement_has_what_was_configured(monkeypatch: pytest.MonkeyPatch, nu: float | None) -> None:
    given: dict[str, Any] = {}
    monkeypatch.setattr(
        prepared_module, "measure", lambda bursts, tracker, loads, **more: given.update(more, tracker=tracker)
    )
    settings = {
        "gauges__mid": {"kind": "zoi", "at": [60, 50]},
        "measure__strain": "green",
        "measure__renew_at": 0.4,
    }
    settings |= {} if nu is None else {"specimen__nu": nu}
    made = plan(scale__stand_off_mm=400.0, scale__mm_per_px=0.1, **settings)
    kernel: Any = SimpleNamespace(period=np.full((2, 2), np.inf))
    PreparedKernel(made, kernel, 1.5).measurements([], None, [].append)  # type: ignore[arg-type]
    guards = {type(guard).__name__: guard for guard in given["guards"]}
    assert list(guards) == [
        "RepetitionGuard", "StrainGuard", "PictureGuard", "BlurGuard", "DilatationGuard", "TiltGuard",
    ]  # fmt: skip
    dilatation, tilt = guards["DilatationGuard"], guards["TiltGuard"]
    assert (dilatation._nu, dilatation._stand_off_mm) == (nu, 400.0)
    assert (tilt._focal_px, tilt._seeks_dilatation) == (4000.0, nu is None)
    assert ([gauge.name for gauge in given["gauges"]], given["strain"]) == (["mid"], "green")
    tracker = given["tracker"]
    assert (tracker._noise_GL, tracker._renew_at) == (1.5, 0.4)
    assert given["corrections"].plates is None and given["corrections"].lens is None


@pytest.mark.parametrize(("bits", "kinds"), [(8, ("uint8", "float32")), (9, ("uint16", "float32"))])
def test_the_pictures_of_the_dry_run_are_as_those_of_the_camera(bits: int, kinds: tuple[str, ...]) -> None:
    camera = replace(CAMERA, bits=bits, width=30, height=21)
    assert picture_kinds(camera) == kinds
    image, other = _image(camera, 1), _image(camera, 2)
    assert image.shape == (21, 30) and str(image.dtype) == kinds[0]
    top = 2**bits - 1
    assert abs(int(image.min()) - 0.3 * top) < 3 and abs(int(image.max()) - 0.7 * top) < 4
    assert 0 < np.abs(image.astype(int) - other).max() <= 4


@pytest.mark.parametrize("bits", [8, 12])
def test_the_contrast_of_a_proposal_is_over_full_scale(bits: int) -> None:
    """Columns of 60 and 160 GL in turn have a standard deviation of 50 GL."""
    picture = np.tile(np.array([60, 160], np.uint16), (96, 64))
    first = FirstLook(picture, None, replace(CAMERA, bits=bits))
    found = Proposal(first, Region((0, 0, 128, 96), None, ""), load_config(None, {"measure.zoi": 32}), "", "")
    assert found.contrast == pytest.approx(50 / (2**bits - 1), rel=1e-3)


def test_a_mask_is_white_where_it_is_measured_and_has_the_size_of_the_pictures(tmp_path: Path) -> None:
    mask = np.zeros((96, 128), bool)
    mask[10:20, 30:50] = True
    assert mask_picture(mask)[15, 40] == 255 and mask_picture(mask)[0, 0] == 0
    config = with_mask(load_config(None, {}), mask, tmp_path)
    assert config.measure.mask == str(tmp_path / "mask.png")
    found = read_mask(config.measure.mask, 128, 96)
    assert found is not None and np.array_equal(found, mask)
    assert read_mask(None, 1, 1) is None and with_mask(config, None, tmp_path) is config
    with pytest.raises(DataError, match="the mask has 128 x 96 px, the pictures 96 x 128"):
        read_mask(config.measure.mask, 96, 128)


def test_the_correction_of_a_part_is_that_part_of_the_correction(tmp_path: Path) -> None:
    dark = np.add.outer(np.arange(96), np.arange(128)).astype(np.float32) % 9
    for name, image in (("dark", dark), ("small", dark[:, :50])):
        cv2.imwrite(str(tmp_path / f"{name}.tif"), image)
    config = load_config(None, {"camera.dark": str(tmp_path / "dark.tif")})
    stack = FrameStack(np.full((1, 96, 128), 100, np.uint8), np.zeros(1), 0, CAMERA)
    cut = slice(8, 40), slice(20, 90)
    whole = correction(config, CAMERA)(stack.mean()).mean
    part = correction(config, CAMERA, cut)(stack.cut(*cut).mean()).mean
    assert np.array_equal(part, whole[cut]) and not np.array_equal(part, whole[:32, :70])
    small = load_config(None, {"camera.dark": str(tmp_path / "small.tif")})
    with pytest.raises(DataError, match=r"small\.tif has 50 x 96 px, the pictures 128 x 96"):
        correction(small, CAMERA)


def test_frames_of_a_check_are_a_burst_with_their_mean_times_and_clipped_pixels() -> None:
    frames = np.array([[[0, 10]], [[1, 255]], [[5, 20]]], np.uint8)
    stack = FrameStack(frames, np.array([1.0, 1.5, 3.0]), 0, CAMERA)
    burst = stack.mean(1, 2)
    assert (burst.mean.tolist(), burst.clipped.tolist()) == ([[3.0, 137.5]], [[False, True]])
    assert (burst.n, burst.t, burst.duration, burst.first_index, burst.last_index) == (2, 2.25, 1.5, 1, 2)
    assert stack.mean().mean.tolist() == [[2.0, 95.0]] and stack.mean(0, 1).mean.tolist() == [[0.0, 10.0]]
    assert stack.few and stack.noise() is None and stack.count_text == "3 pictures"
    assert FrameStack(frames[:1], np.zeros(1), 0, CAMERA).count_text == "1 picture"


def test_the_noise_in_time_is_that_of_one_frame_without_the_drift_of_the_light() -> None:
    rng = np.random.default_rng(0)
    still = rng.normal(100, 2.0, (40, 2000))
    assert temporal_noise(still) == pytest.approx(2.0, rel=0.02)
    assert temporal_noise(still + np.arange(40)[:, None] * 5.0) == pytest.approx(2.0, rel=0.02)
    assert temporal_noise(np.ones((9, 50), np.uint8)) == 0.0
    many = FrameStack(rng.normal(100, 2.0, (16, 40, 50)), np.arange(16.0), 0, CAMERA)
    assert many.noise() == pytest.approx(2.0 / 4, rel=0.03) and not many.few


def test_some_of_the_pixels_stand_for_all() -> None:
    frames = np.arange(2 * 300 * 400, dtype=np.uint32).reshape(2, 300, 400)
    stack = FrameStack(frames, np.zeros(2), 0, CAMERA)
    inside = np.zeros((300, 400), bool)
    inside[10:12, 20:23] = True
    assert stack.pixels(inside).tolist() == [
        [4020, 4021, 4022, 4420, 4421, 4422],
        [124020, 124021, 124022, 124420, 124421, 124422],
    ]


def test_a_cut_has_a_margin_within_the_picture_and_the_same_zois() -> None:
    inside = np.zeros((400, 500), bool)
    inside[150:200, 220:300] = True
    rows, columns = around(inside)
    margin = 150 - rows.start
    assert margin > 0 and (rows.stop, columns.start, columns.stop) == (
        200 + margin,
        220 - margin,
        300 + margin,
    )
    assert around(np.zeros((7, 9), bool)) == (slice(0, 7), slice(0, 9))
    corner = np.zeros((400, 500), bool)
    corner[0, 0] = True
    assert around(corner) == (slice(0, 1 + margin), slice(0, 1 + margin))
    grid = ZoiGrid.cover(Roi(220, 150, 80, 48), 32, 16)
    found = moved(grid, (rows, columns))
    assert (found.first_x + columns.start).tolist() == grid.first_x.tolist()
    assert (found.first_y + rows.start).tolist() == grid.first_y.tolist()
    seen = covered(grid, inside.shape)
    assert seen.sum() == 80 * 48 and seen[150, 220] and seen[197, 299] and not seen[198, 299]


def test_the_zois_about_the_middle_do_not_overlap_and_are_few() -> None:
    grid = ZoiGrid.cover(Roi(0, 0, 800, 400), 32, 8)
    chosen = middle(grid)
    assert chosen.n_active == MAX_ZOIS == 64
    rows, columns = np.nonzero(chosen.active)
    x, y = np.unique(chosen.first_x[columns]), np.unique(chosen.first_y[rows])
    assert set(np.diff(x)) == set(np.diff(y)) == {32} and len(x) in (8, 9, 10) and len(y) in (8, 9, 10)
    assert abs(x.mean() + 15.5 - grid.x.mean()) <= 16 and abs(y.mean() + 15.5 - grid.y.mean()) <= 16
    roi = chosen.roi
    assert (roi.x, roi.y) == (int(x[0]), int(y[0])), "no larger than they are"
    assert (roi.x + roi.width, roi.y + roi.height) == (int(x[-1]) + 32, int(y[-1]) + 32)
    few = ZoiGrid.cover(Roi(0, 0, 80, 48), 32, 16)
    assert middle(few).n_active == few.n_active == 8


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


def test_the_newest_frames_of_a_camera_without_damaged_ones() -> None:
    shown = [frame(k, damaged=k == 18, lost=2 if k in (3, 12) else 0) for k in range(20)]
    frames = RollingFrames(ListCamera(shown, live=True), 10, "list:")  # type: ignore[arg-type]
    assert frames.frame() is None
    with frames:
        frames._thread.join()
        assert frames.over and frames.received == 19
        newest = frames.frame()
        assert newest is not None and newest.index == 19
        stack = frames.newest(8)
        assert stack is not None and stack.times.tolist() == pytest.approx(
            [1.1, 1.2, 1.3, 1.4, 1.5, 1.6, 1.7, 1.9]
        )
        assert stack.lost == 2, "between those that are looked at"
        seven = frames.newest(7)
        assert seven is None
    short = RollingFrames(ListCamera(shown[:4], error=DeviceError("gone")), 1, "list:")  # type: ignore[arg-type]
    with short:
        short._thread.join()
        with pytest.raises(DeviceError, match="gone"):
            short.newest(8)


def test_sharpness_is_a_share_of_its_peak() -> None:
    def of(sharpness: float, peak: float) -> float:
        figures: Any = SimpleNamespace(sharpness=sharpness)
        return QuickCheck(figures, peak, None).of_peak  # type: ignore[arg-type]

    assert of(0.2, 0.25) == 0.8 and math.isnan(of(0.2, 0.0))


@pytest.mark.parametrize(("width", "same"), [(100, True), (98, True), (97, False)])
def test_a_region_is_the_same_up_to_two_hundredths(width: int, same: bool) -> None:
    where: Any = SimpleNamespace(
        camera=SimpleNamespace(width=200, height=100), config=load_config(None, {"measure.zoi": 32})
    )
    one, other = Region((0, 0, 100, 50), None, "", True), Region((0, 0, width, 50), None, "", True)
    assert _same_region(one, other, where) == same == _same_region(other, one, where)
    assert not _same_region(one, replace(one, found=False), where)


def test_the_mean_of_a_first_look_and_its_noise() -> None:
    images = [np.full((4, 4), value, np.uint8) for value in (10, 12, 11, 15)]
    mean, noise = _mean_and_noise(images)
    assert float(mean[0, 0]) == 12.0 and noise == pytest.approx(float(np.std([2, -1, 4])) / math.sqrt(2) / 2)
    alone, unknown = _mean_and_noise(images[:1])
    assert alone is images[0] and unknown is None
    assert _mean_and_noise([images[0]] * 3)[1] is None


def test_a_found_box_is_cut_by_the_rim() -> None:
    picture, config = np.zeros((200, 300)), load_config(None, {"measure.zoi": 32})
    assert _within(0, 0, 300, 200, config, picture) == (4, 4, 292, 192)
    assert _within(10, 20, 30, 40, config, picture) == (10, 20, 30, 40)
    assert _within(290, 190, 10, 10, config, picture) == (290, 190, 6, 6)
    assert _within(298, 198, 2, 2, config, picture) == (298, 198, 1, 1)


def test_a_scale_from_points_needs_a_distance_and_a_length() -> None:
    assert from_points((0, 0, 1.01, 0), 1.0).mm_per_px == pytest.approx(1 / 1.01)
    for points, length in (((0, 0, 1.0, 0), 1.0), ((0, 0, 9, 0), 0.0), ((0, 0, 9, 0), math.inf)):
        with pytest.raises(ConfigError, match="more than 1 px apart and a length above 0 mm"):
            from_points(points, length)
    found = from_points((0, 0, 30, 40), 25.0)
    assert found.method == "two points 50.0 px apart, 25 mm" and found.relative == pytest.approx(
        math.sqrt(2) / 50
    )
    assert found.changes(400.0)["scale.stand_off_mm"] == 400.0 and "scale.stand_off_mm" not in found.changes()
    assert found.changes()["scale.mm_per_px"] == 0.5 and found.changes()["scale.sigma_mm_per_px"] == 0.014


def test_without_a_visible_edge_the_width_is_that_of_the_mask_and_less_certain() -> None:
    mask = np.zeros((300, 400), bool)
    mask[20:280, 100:301] = True
    even = np.random.default_rng(0).normal(100, 20, (300, 400))
    region = Region((0, 0, 400, 300), mask, "", True)
    for axis, picture, one in (("y", even, mask), ("x", even.T, mask.T)):
        scale = from_width(picture, replace(region, mask=one), axis, 20.1)
        assert scale.mm_per_px == pytest.approx(0.1)
        assert scale.relative == pytest.approx(math.sqrt(2) * 6 / 201)
        assert scale.remarks == ("the edges are known to some px only: two points or a board are better",)
    wide = replace(region, mask=np.ones((300, 400), bool))
    with pytest.raises(DataError, match="the edges of the specimen leave the picture"):
        from_width(even, wide, "y", 20.0)
    with pytest.raises(DataError, match="the edges of the specimen are not visible"):
        from_width(even, replace(region, found=False), "y", 20.0)


def test_the_scatter_of_the_bands_and_the_edges_make_the_uncertainty_of_a_width(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    mask = np.zeros((400, 300), bool)
    mask[:, 50:150] = True
    for found, known in (([100.0, 102.0, None, 106.0], True), ([100.0, None, None, None], False)):
        widths = iter(found)
        monkeypatch.setattr(scale_module, "_band_width", lambda grey, mask, widths=widths: next(widths))
        px, sigma = specimen_width(np.zeros((400, 300)), Region(None, mask, "", True), "y")
        spread = 1.25 * math.sqrt((2.667**2 + 0.667**2 + 3.333**2) / 3) / math.sqrt(3)
        expected = (102.0, math.hypot(spread, math.sqrt(2))) if known else (100.0, math.sqrt(2) * 6)
        assert (px, sigma) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(
    ("first", "stop", "sides"), [(1, 299, (1.0, 299.0)), (0, 299, None), (1, 300, None), (9, 9, None)]
)
def test_a_mask_that_reaches_the_edge_of_the_picture_has_no_sides(
    first: int, stop: int, sides: tuple[float, float] | None
) -> None:
    mask = np.zeros((10, 300), bool)
    mask[:6, first:stop] = True
    assert _sides(mask) == sides
    mask[5] = False
    assert _sides(mask) is None, "of half of the rows it is no side"


def test_the_width_is_looked_for_in_the_middle_half_by_bands() -> None:
    def bands(first: int, last: int) -> list[tuple[int, int]]:
        mask = np.zeros((500, 10), bool)
        mask[first:last] = True
        return [(band.start, band.stop) for band in _bands(mask)]

    assert bands(100, 300) == [(150, 198), (198, 246)]
    assert bands(100, 140) == [(110, 130)]
    assert bands(100, 110) == [(102, 114)]


def test_an_edge_is_where_the_scatter_falls_to_the_middle() -> None:
    scatter = np.full(200, 1.0, np.float32)
    scatter[:101] = 21.0
    scatter[101] = 16.0
    assert _edge(scatter, 100, 21.0) == pytest.approx(101.5 + 5 / 15)
    scatter[123] = 21.0
    assert _edge(scatter, 100, 21.0) is None, "it falls no more where the search ends"
    assert _edge(scatter, 100, 2.0) is None, "the background scatters as much"
    assert _edge(scatter, 100, math.nan) is None


@pytest.mark.parametrize(
    ("change", "uneven", "told"), [(0.005, 0.005, False), (0.0051, 0.0, True), (0.0, 0.0051, True)]
)
def test_a_tilt_is_told_from_half_a_percent_on(change: float, uneven: float, told: bool) -> None:
    assert len(list(_tilt(change, uneven, 50.0, None))) == told


def test_the_tilt_in_degrees_is_from_the_distance_or_from_the_shortening() -> None:
    (words,) = _tilt(0.025, 0.0152, 50.0, 400.0)  # sin of 11.5 degrees is 0.2
    assert "about 12 degrees: the scale changes by 2.5% over it and by 1.5% between its directions" in words
    (words,) = _tilt(0.025, 0.0152, 50.0, None)  # cos of 10 degrees is 0.9848
    assert "about 10 degrees" in words


@pytest.mark.parametrize(
    ("columns", "rows", "square", "marker", "good"),
    [(3, 60, 0.1, 0.0, True), (2, 60, 1, 0, False), (3, 61, 1, 0, False), (3, 3, 0, 0, False),
     (3, 3, 1, 1, False), (3, 3, 1, 0.9, True), (3, 3, 1, -0.1, False)],
)  # fmt: skip
def test_the_limits_of_a_board(columns: int, rows: int, square: float, marker: float, good: bool) -> None:
    if good:
        assert Board(columns, rows, square, marker).dictionary == "4X4_50"
    else:
        with pytest.raises(ConfigError, match=r"a board has 3 to 60|smaller than its squares"):
            Board(columns, rows, square, marker)


def test_the_part_that_was_calibrated_is_about_all_places_and_in_the_picture() -> None:
    assert _box(np.array([[10.0, 50.0], [40.0, 20.0], [30.0, 30.0]])) == (10.0, 20.0, 30.0, 30.0)
    assert _box(np.array([[-3.0, -5.0], [40.0, 20.0]])) == (0.0, 0.0, 40.0, 20.0)


def test_the_time_of_compiling_that_is_left() -> None:
    assert progress_text(0.099, 5.0).endswith("[" + "#" * 3 + "." * 27 + "] 5 s, about a minute")
    assert progress_text(0.25, 10.0).endswith("[" + "#" * 8 + "." * 22 + "] 10 s, about 31 s left")
    assert progress_text(1.0, 10.0).endswith("[" + "#" * 30 + "] 10 s, about 1 s left")


def test_a_simulated_test_is_at_rest_for_a_look() -> None:
    assert at_rest("/dev/video0?fps=3") == "/dev/video0?fps=3"
    rest = at_rest("sim:hole?seconds=5&fps=20")
    assert (
        "max_strain=0" in rest
        and "seconds=3600" in rest
        and "hold=1" in rest
        and "end=1" in rest
        and "fps=20" in rest
    )


def test_forces_count_from_the_zero_that_is_given() -> None:
    rig = open_rig("sim:uniform?fps=20&width=64&height=64", "sim:", zero_N=5.0)
    assert isinstance(rig.load, ZeroedLoadCell) and rig.specimen is not None
    rig.close()
    plain = open_rig("sim:uniform?fps=20&width=64&height=64", "sim:")
    assert not isinstance(plain.load, ZeroedLoadCell)
    plain.close()


def test_a_camera_whose_picture_cannot_be_cut_is_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    camera = ListCamera([frame(0)])
    monkeypatch.setattr(devices_module, "_open_camera", lambda *_: camera)
    with pytest.raises(ConfigError, match="leaves the picture of 6 x 4 px"):
        _open_cropped("a:", print, None, (0, 0, 7, 4))
    assert camera.stopped.is_set()
    assert _open_cropped("a:", print, None, None) is camera


def test_bands_are_looked_for_in_whole_pictures_and_no_more_than_needed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seen: list[np.ndarray] = []

    def bands(profiles: np.ndarray, lamp_Hz: float) -> Readout:
        seen.append(profiles)
        if lamp_Hz == 120:
            raise ValueError("no bands")
        return Readout(0.01, 1e-4)

    monkeypatch.setattr(readout_module, "readout_of_bands", bands)
    frames = [frame(k, value=k % 200, damaged=k == 1) for k in range(200)]
    assert from_lamp(frames, 100.0).seconds == 0.01
    assert seen[0].shape == (128, 4) and seen[0][:3, 0].tolist() == [0.0, 2.0, 3.0]
    with pytest.raises(DataError, match="no bands: a global shutter has none"):
        from_lamp(frames, 120.0)


def test_the_motion_that_shows_a_readout_time_is_the_mean_of_each_picture(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    given: list[Any] = []
    monkeypatch.setattr(readout_module, "readout_of_motion", lambda *values: given.extend(values))
    grid = make_grid()
    from_motion([0.0, 0.1], [make_field(grid, 0.0), make_field(grid, 1e-3)], 480)
    t, (u, v), (du_dy, dv_dy), height = given
    assert (
        (t, height) == ([0.0, 0.1], 480)
        and dv_dy == pytest.approx([0.0, 1e-3])
        and du_dy == pytest.approx([0.0, 0.0])
    )
    assert v[1] > 0 > u[1]
