"""A pixel is saturated at the white level of its camera: 65520 of 12 bits in the high bits of 16, or 4080 of 4095."""

from __future__ import annotations

import dataclasses
from itertools import islice
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from acquire.addresses import parse_address
from acquire.burst.accumulate import burst_of
from acquire.camera.contract import CroppedCamera, open_camera
from acquire.events import ignore_event
from acquire.frame import Frame, frozen, saturation
from acquire.session import Session
from acquire.v4l2.camera import open_v4l2
from analysis.quality.pattern import exposure
from live.ui.web.map_view import RED, mark_saturated, shrunk
from tests.acquire.session import fixtures
from tests.acquire.v4l2.fake_kernel import FakeCamera, FakeKernel
from tests.contracts.entry_points import install_example

LEVELS = np.array([[0, 4079, 4080, 4095]], np.uint16)
CLIPPED = [[False, False, True, True]]


def frame(index: int, **more: Any) -> Frame:
    return Frame(frozen(LEVELS.copy()), index, float(index), "device", 0, 12, float(index), **more)


def test_saturation_is_the_white_level_else_the_highest() -> None:
    assert (saturation(12, None), saturation(12, 4080), saturation(16, 65520)) == (4095, 4080, 65520)


@pytest.mark.parametrize("n", [1, 3])
def test_bursts_clip_there(n: int) -> None:
    assert burst_of([frame(k, white_level=4080) for k in range(n)]).clipped.tolist() == CLIPPED
    assert burst_of([frame(k) for k in range(n)]).clipped.tolist() == [[False, False, False, True]]


def files(folder: Path, settings: str) -> str:
    cv2.imwrite(str(folder / "a.tif"), LEVELS)
    return f"files:{folder}/a.tif?bits=12{settings}"


def test_pictures_and_a_part_of_them_have_it(tmp_path: Path) -> None:
    with CroppedCamera(open_camera(files(tmp_path, "&white=4080")), (0, 0, 4, 1)) as camera:
        one = next(iter(camera))
        assert (camera.info.saturation, one.saturation) == (4080, 4080)


def test_a_v4l2_camera_has_it() -> None:
    address = parse_address("/dev/video0?format=Y12&white=4080")
    kernel = FakeKernel(FakeCamera())
    with open_v4l2(address, ignore_event, kernel) as camera:
        assert next(iter(camera)).saturation == camera.info.saturation == 4080


def test_a_camera_of_somebody_else_has_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install_example(tmp_path, monkeypatch)
    (tmp_path / "a.bin").write_bytes(LEVELS.astype("<u2").tobytes())
    with open_camera(f"raw:{tmp_path}/a.bin?width=4&height=1&bits=12&white=4080") as camera:
        assert burst_of([next(iter(camera))]).clipped.tolist() == CLIPPED


def test_a_recording_keeps_it_and_older_ones_have_none(tmp_path: Path) -> None:
    for name, white in (("new", 4080), ("old", None)):
        camera = dataclasses.replace(fixtures.CAMERA, white_level=white)
        with fixtures.writer(tmp_path / f"{name}.h5", camera) as writer:
            writer.write_frame(fixtures.frame(0, camera))
        with Session.open(tmp_path / f"{name}.h5") as session:
            assert session.camera.white_level == session.frame(0).white_level == white
        with open_camera(f"session:{tmp_path}/{name}.h5") as again:
            assert [one.saturation for one in islice(again, 1)] == [white or 4095]


def test_full_scale_of_the_check_ends_there() -> None:
    light = exposure(np.full((2, 10), 4080, np.uint16), 4080)
    assert (light.high, light.saturated, light.piled) == (1.0, 1.0, 0.0)


def test_the_page_paints_saturated_pixels_red() -> None:
    picture, scale = shrunk(LEVELS, 12)
    mark_saturated(picture, scale, LEVELS, 4080)
    assert (picture[0] == RED).all(axis=1).tolist() == CLIPPED[0]
