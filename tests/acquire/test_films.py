"""Films: codecs that hold motion back, steps of those that do not, and how many frames there are."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from acquire.camera.opening import open_camera
from acquire.events import Event
from acquire.frame import QUANTISATION
from acquire.opencv.video import FILM_WARNING


def film(path: Path, code: str, frames: int = 6) -> Path:
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter_fourcc(*code), 10, (64, 48))
    if not writer.isOpened():
        pytest.skip(f"no {code} here")
    rng = np.random.default_rng(3)
    for _ in range(frames):
        writer.write(rng.integers(0, 255, (48, 64, 3), dtype=np.uint8))
    writer.release()
    return path


@pytest.mark.parametrize(
    ("name", "code", "inter_frame"),
    [
        ("a.avi", "MJPG", False),
        ("a.mkv", "MJPG", False),
        ("a.avi", "FFV1", False),
        ("a.mkv", "FFV1", False),
        ("a.avi", "HFYU", False),
        ("a.avi", "I420", False),
        ("a.avi", "PNG ", False),
        ("a.avi", "XVID", True),
        ("a.mp4", "mp4v", True),
        ("a.avi", "MPEG", True),
        ("a.webm", "VP80", True),
        ("a.mkv", "VP90", True),
    ],
)
def test_which_codecs_hold_motion_back(tmp_path: Path, name: str, code: str, inter_frame: bool) -> None:
    with open_camera(f"video:{film(tmp_path / name, code)}") as camera:
        assert camera.info.controls["inter_frame"] is inter_frame
        assert (FILM_WARNING in camera.info.warnings) is inter_frame
        assert (QUANTISATION in camera.info.controls) is (code == "MJPG")


@pytest.mark.parametrize(("code", "name"), [("FFV1", "a.mkv"), ("VP80", "a.webm")])
def test_frames_are_counted_where_the_container_does_not(tmp_path: Path, code: str, name: str) -> None:
    told: list[Event] = []
    with open_camera(f"video:{film(tmp_path / name, code, 7)}", told.append) as camera:
        assert camera.info.controls["frames"] == 7
        assert len(list(camera)) == 7
    assert told == []


def test_a_film_that_is_cut_off_is_told(tmp_path: Path) -> None:
    path = film(tmp_path / "a.mkv", "FFV1", 12)
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 2 // 3])
    told: list[Event] = []
    with open_camera(f"video:{path}", told.append) as camera:
        there = len(list(camera))
        assert camera.info.controls["frames"] == there < 12
    assert told[0].data == {"missing": 12 - there}
