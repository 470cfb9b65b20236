"""What a prepared test has of its settings: distances, shutter, measurement, pictures."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from acquire.errors import DataError
from acquire.frame import CameraInfo
from analysis import StrainField
from analysis.optics import Readout
from live.config.loading import load_config
from live.setup import prepared as prepared_module
from live.setup import readout as readout_module
from live.setup.dry_run import _image, picture_kinds
from live.setup.prepared import MeasurePlan, PreparedKernel, _focal_px
from live.setup.readout import from_lamp, from_motion
from live.setup.region import FirstLook, Region
from live.setup.rig_proposal import Proposal
from tests.live.fakes import frame
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
        "RepetitionGuard", "PartsGuard", "StrainGuard", "PictureGuard", "BlurGuard", "DilatationGuard", "TiltGuard",
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
