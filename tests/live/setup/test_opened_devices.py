"""Devices as they are opened, and the masks and corrections of their pictures."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from acquire.errors import ConfigError, DataError
from acquire.load_cell.zeroed import ZeroedLoadCell
from live.config.loading import load_config
from live.setup import devices as devices_module
from live.setup.check.sample import FrameStack
from live.setup.compiling import progress_text
from live.setup.devices import _open_cropped, at_rest, open_rig
from live.setup.pictures import correction, mask_picture, read_mask, with_mask
from tests.live.fakes import ListCamera, frame
from tests.live.setup.test_prepared import CAMERA


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
