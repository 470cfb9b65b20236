from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from acquire.camera.opening import open_camera
from acquire.errors import ConfigError, DataError, DeviceError
from acquire.events import Event, ignore_event
from acquire.opencv.webcam import OpenCVCamera, OpenCVSettings


def write_video(path: Path, count: int = 6) -> Path:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"FFV1"), 25, (64, 48))
    for k in range(count):
        writer.write(np.full((48, 64, 3), 40 * k % 256, np.uint8))
    writer.release()
    return path


def test_a_video_gives_its_luma_and_its_own_times(tmp_path: Path) -> None:
    with open_camera(f"video:{write_video(tmp_path / 'a.avi')}") as camera:
        frames = list(camera)
    assert [int(frame.image[5, 5]) for frame in frames] == [0, 40, 80, 120, 160, 200]
    assert [frame.t for frame in frames] == pytest.approx([k / 25 for k in range(6)])
    assert [frame.index for frame in frames] == list(range(6))
    assert "compressed" in camera.info.warnings[0]
    assert (camera.info.clock, camera.info.live, camera.info.fps) == ("nominal", False, 25)


def test_a_video_that_ends_early_is_told(tmp_path: Path) -> None:
    path = write_video(tmp_path / "a.avi", 40)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    events: list[Event] = []
    with open_camera(f"video:{path}", events.append) as camera:
        count = len(list(camera))
    assert 0 < count < 40
    assert f"ends after {count} of" in events[-1].text or camera.info.controls["frames"] <= count


def test_what_is_no_video_is_named(tmp_path: Path) -> None:
    (tmp_path / "a.mp4").write_bytes(b"hello")
    with pytest.raises(DataError, match=r"a\.mp4: not a video"):
        open_camera(f"video:{tmp_path}/a.mp4")
    with pytest.raises(DataError, match="no file"):
        open_camera(f"video:{tmp_path}/b.mp4")
    with pytest.raises(ConfigError, match="gray"):
        open_camera(f"video:{tmp_path}/a.mp4?gray=x")


Read = tuple[bool, NDArray[Any] | None]


class FakeCapture:
    """A ``cv2.VideoCapture`` whose reads are written down beforehand; afterwards it fails."""

    def __init__(self, reads: Sequence[Read], *, opens: bool = True, **forced: float) -> None:
        self._reads, self._opens = list(reads), opens
        self.values: dict[int, float] = {cv2.CAP_PROP_FPS: 30.0}
        self._forced = {getattr(cv2, f"CAP_PROP_{name}"): value for name, value in forced.items()}
        self.released = False
        self.read_count = 0

    def isOpened(self) -> bool:
        return self._opens

    def read(self) -> Read:
        self.read_count += 1
        return self._reads.pop(0) if self._reads else (False, None)

    def get(self, prop: int) -> float:
        return self._forced.get(prop, self.values.get(prop, 0.0))

    def set(self, prop: int, value: float) -> bool:
        self.values[prop] = value
        return True

    def release(self) -> None:
        self.released = True


def shots(*values: int) -> list[Read]:
    return [(True, np.full((4, 6, 3), value, np.uint8)) for value in values]


def camera_of(
    *captures: FakeCapture,
    settings: OpenCVSettings | None = None,
    events: Callable[[Event], None] = ignore_event,
) -> OpenCVCamera:
    waiting = list(captures)
    return OpenCVCamera("opencv:0", lambda: waiting.pop(0), settings or OpenCVSettings(), events)


def take(camera: OpenCVCamera, count: int) -> list[Any]:
    frames = []
    with camera:
        for frame in camera:
            frames.append(frame)
            if len(frames) == count:
                break
    return frames


def test_the_picture_taken_at_opening_is_thrown_away() -> None:
    frames = take(camera_of(FakeCapture(shots(1, 2, 3))), 2)
    assert [int(frame.image[0, 0]) for frame in frames] == [2, 3]
    assert [frame.index for frame in frames] == [0, 1]
    assert {frame.clock for frame in frames} == {"host"}


def test_a_dead_handle_is_opened_again_and_told() -> None:
    events: list[Event] = []
    first, second = FakeCapture(shots(1, 2)), FakeCapture(shots(3, 4))
    frames = take(camera_of(first, second, events=events.append), 3)
    assert [int(frame.image[0, 0]) for frame in frames] == [2, 3, 4]
    assert [frame.index for frame in frames] == [0, 1, 2]
    assert ["gone or dead" in events[0].text, "opened again" in events[1].text] == [True, True]
    assert first.released
    assert first.read_count == 3  # one failure is enough


def test_the_same_picture_again_and_again_is_not_measured() -> None:
    events: list[Event] = []
    frames = take(camera_of(FakeCapture(shots(0, 7, 7, 7, 7, 8)), events=events.append), 5)
    assert [frame.damaged for frame in frames] == [False, False, True, True, False]
    assert sum("same picture" in event.text for event in events) == 1


def test_what_is_not_honoured_is_refused_with_what_there_is() -> None:
    capture = FakeCapture(shots(1), FRAME_WIDTH=640)
    with pytest.raises(ConfigError, match="width=1920, the driver gives 640"):
        camera_of(capture, settings=OpenCVSettings(width=1920))
    assert capture.released


@pytest.mark.parametrize(("got", "taken"), [(1263, True), (1266, True), (1200, False), (1300, False)])
def test_a_setting_is_in_force_within_a_hundredth(got: int, taken: bool) -> None:
    capture, settings = FakeCapture(shots(1), FRAME_WIDTH=got), OpenCVSettings(width=1275)
    if taken:
        assert camera_of(capture, settings=settings).info.controls["width"] == got
    else:
        with pytest.raises(ConfigError, match=f"width=1275, the driver gives {got}"):
            camera_of(capture, settings=settings)


def test_a_camera_is_described_by_its_picture() -> None:
    info = camera_of(FakeCapture(shots(1))).info
    assert (info.width, info.height, info.bits, info.fps, info.clock) == (6, 4, 8, 30.0, "host")


class StampedCapture(FakeCapture):
    """Has a stamp for each read, s."""

    def __init__(self, stamps: Sequence[float]) -> None:
        super().__init__(shots(*range(len(stamps))))
        self._stamps = list(stamps)

    def get(self, prop: int) -> float:
        if prop == cv2.CAP_PROP_POS_MSEC:
            return 1000 * self._stamps[min(self.read_count, len(self._stamps)) - 1]
        return super().get(prop)


def test_stamps_of_the_driver_tell_how_many_were_lost() -> None:
    capture = StampedCapture([100.0, 100.1, 100.1 + 1 / 30, 100.1 + 4 / 30, 100.1 + 5 / 30])
    camera = OpenCVCamera("opencv:0", lambda: capture, OpenCVSettings(), ignore_event, now=lambda: 100.0)
    frames = take(camera, 3)
    assert {frame.clock for frame in frames} == {"device"}
    assert [frame.lost_before for frame in frames] == [0, 0, 2]
    assert [frame.index for frame in frames] == [0, 1, 4]
    assert [frame.t for frame in frames] == pytest.approx([100.1, 100.1 + 1 / 30, 100.1 + 4 / 30])


def test_a_camera_that_does_not_open_or_gives_nothing() -> None:
    with pytest.raises(DeviceError, match="no camera opens"):
        camera_of(FakeCapture([], opens=False))
    with pytest.raises(DeviceError, match="gives no picture"):
        camera_of(FakeCapture([]))
    with pytest.raises(ConfigError, match="number of the camera"):
        open_camera("opencv:front")


class StalledCapture(FakeCapture):
    def read(self) -> Read:
        if self.read_count >= 1:
            self.gate.wait()
        return super().read()

    gate = threading.Event()


def test_stop_ends_a_stalled_camera() -> None:
    capture = StalledCapture(shots(1))
    with camera_of(capture) as camera:
        threading.Timer(0.05, camera.stop).start()
        assert list(camera) == []  # although its read still blocks
    capture.gate.set()
