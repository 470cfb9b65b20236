"""What a prepared test has of its settings, and its devices as they are opened."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from acquire.errors import ConfigError, DataError
from acquire.frame import CameraInfo
from acquire.load_cell.contract import ZeroedLoadCell
from analysis import StrainField
from analysis.optics import Readout
from live.commands import readout as readout_module
from live.commands.readout import from_lamp, from_motion
from live.config.loading import load_config
from live.setup import devices as devices_module
from live.setup import prepared as prepared_module
from live.setup.check.sample import FrameStack
from live.setup.compiling import progress_text
from live.setup.devices import _open_cropped, at_rest, open_rig
from live.setup.dry_run import _image, picture_kinds
from live.setup.pictures import correction, mask_picture, read_mask, with_mask
from live.setup.prepared import MeasurePlan, PreparedKernel, _focal_px
from live.setup.region import FirstLook, Region
from live.setup.rig_proposal import Proposal
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
        "StartGuard", "PartsGuard", "StrainGuard", "PictureGuard", "BlurGuard", "DilatationGuard", "TiltGuard",
    ]  # fmt: skip
    dilatation, tilt = guards["DilatationGuard"], guards["TiltGuard"]
    assert (dilatation._nu, dilatation._stand_off_mm) == (nu, 400.0)
    assert (tilt._focal_px, tilt._seeks_dilatation) == (4000.0, nu is None)
    assert ([gauge.name for gauge in given["gauges"]], given["strain"]) == (["mid"], "green")
    tracker = given["tracker"]
    assert (tracker._noise_GL, tracker._renew_at) == (1.5, 0.4)
    assert given["corrections"].plates is None and given["corrections"].lens is None


def test_a_gauge_that_is_partly_off_the_region_is_an_event_of_the_first_field(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    given: dict[str, Any] = {}
    monkeypatch.setattr(prepared_module, "measure", lambda *_, **more: given.update(more))
    made = plan(measure__roi=[64, 0, 64, 96], gauges__mid={"kind": "area", "box": [0, 0, 128, 96]})
    kernel: Any = SimpleNamespace(period=np.full((2, 2), np.inf))
    events: list[Any] = []
    PreparedKernel(made, kernel, 1.5).measurements([], None, events.append)  # type: ignore[arg-type]
    for t in (3.0, 4.0):
        given["guards"][0].check(None, SimpleNamespace(t=t))
    told = [(one.t, one.source, one.level) for one in events]
    assert told == [(3.0, "gauges", "warning")]
    assert "of its area lies where nothing is measured" in events[0].text


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


def test_bands_are_looked_for_in_no_more_pictures_than_needed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seen: list[np.ndarray] = []

    def bands(profiles: np.ndarray, lamp_Hz: float) -> Readout:
        seen.append(profiles)
        if lamp_Hz == 120:
            raise ValueError("no bands")
        return Readout(0.01, 1e-4)

    monkeypatch.setattr(readout_module, "readout_of_bands", bands)
    frames = [frame(k, value=k % 200) for k in range(200)]
    assert from_lamp(frames, 100.0).seconds == 0.01
    assert seen[0].shape == (128, 4) and seen[0][:3, 0].tolist() == [0.0, 1.0, 2.0]
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
