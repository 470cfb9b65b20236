"""The room that a check finds on the disk: by the rate at which the recording writes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from acquire.frame import CameraInfo
from live.config.loading import load_config
from live.setup.check import disk
from live.setup.check.disk import disk_lines, write_rate
from live.setup.check.sample import FrameStack

CAMERA = CameraInfo("v4l2:", "a camera", 640, 512, 12, live=True, clock="device", fps=30.0)
FRAME = 640 * 512 * 2


def stack(fps: float = 20.0, **camera: Any) -> FrameStack:
    """Nine frames as they came, which may be fewer a second than the camera says."""
    frames, times = np.zeros((9, 512, 640), np.uint16), np.arange(9) / fps
    return FrameStack(frames, times, 0, replace(CAMERA, **camera))


@pytest.mark.parametrize(
    ("given", "bytes_a_frame"),
    [
        ({}, FRAME),
        ({"record.mode": "every=5"}, FRAME / 5),
        ({"record.mode": "bursts"}, 640 * 512 * (2 + 1 / 8) / 4),
        ({"record.mode": "bursts", "measure.burst": 20}, 640 * 512 * (4 + 1 / 8) / 20),
        ({"record.enabled": False}, 0),
        ({"camera.back": "v4l2:other"}, 2 * FRAME),
    ],
)
def test_what_is_written_is_that_of_the_frames_that_come(given: dict[str, Any], bytes_a_frame: float) -> None:
    assert write_rate(stack(), load_config(None, given)) == pytest.approx(20 * bytes_a_frame)


def test_a_folder_of_pictures_is_not_recorded() -> None:
    assert write_rate(stack(live=False), load_config(None, {})) == 0
    assert disk_lines(0.0, load_config(None, {})) == []


@pytest.mark.parametrize(
    ("free", "seconds", "good", "shown"),
    [
        (90e6, None, False, "room for 0.1 min at this rate (13.1 MB/s, 0.09 GB free)"),
        (7.8e9, None, False, "room for 9.9 min at this rate"),
        (7.9e9, None, True, "room for 10 min at this rate"),
        (90e6, 6.0, True, "room for 0.1 min at this rate"),
        (90e6, 8.0, False, "room for 0.1 min at this rate"),
        (7.9e9, 3600.0, False, "room for 10 min at this rate"),
    ],
)
def test_it_must_last_for_the_test_or_ten_minutes(
    monkeypatch: pytest.MonkeyPatch, free: float, seconds: float | None, good: bool, shown: str
) -> None:
    config = load_config(None, {} if seconds is None else {"output.seconds": seconds})
    monkeypatch.setattr(disk, "free_bytes", lambda folder: free)
    (line,) = disk_lines(20 * FRAME, config)
    assert line.good is good and line.value.startswith(shown)
    assert f"for a test of {(seconds or 600) / 60:.3g} min: free some space" in line.advice


def test_a_disk_that_is_gone_is_no_go(monkeypatch: pytest.MonkeyPatch) -> None:
    def gone(folder: str) -> int:
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(disk, "free_bytes", gone)
    (line,) = disk_lines(1e6, load_config(None, {"output.dir": "/mnt/usb/run"}))
    assert not line.good and line.value == "/mnt/usb/run: cannot be asked (Input/output error)"
