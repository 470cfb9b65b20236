"""Webcams and videos by OpenCV: times, settings, losses, and the end."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from acquire.camera.contract import open_camera
from acquire.camera.live import LiveCamera
from acquire.errors import ConfigError, DataError, DeviceError
from acquire.events import Event, ignore_event
from acquire.opencv import webcam
from acquire.opencv.webcam import OpenCVSettings, live_camera


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


def test_what_is_no_video_is_named(tmp_path: Path) -> None:
    (tmp_path / "a.mp4").write_bytes(b"hello")
    with pytest.raises(DataError, match=r"a\.mp4: not a video"):
        open_camera(f"video:{tmp_path}/a.mp4")
    with pytest.raises(DataError, match="no file"):
        open_camera(f"video:{tmp_path}/b.mp4")


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
) -> LiveCamera:
    waiting = list(captures)
    asked = settings or OpenCVSettings()
    return live_camera("opencv:0", lambda: waiting.pop(0), asked, events, now=lambda: 100.0)


def take(camera: LiveCamera, count: int) -> list[Any]:
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
    steps = [0, 1, 2, 3, 4, 5, 8, 9, 10, 12, 13]
    capture = StampedCapture([100.0, *(100.1 + k / 30 for k in steps), 100.1 + 14 / 30])
    camera = live_camera("opencv:0", lambda: capture, OpenCVSettings(), ignore_event, now=lambda: 100.0)
    frames = take(camera, len(steps))
    assert {frame.clock for frame in frames} == {"device"}
    assert [frame.lost_before for frame in frames] == [0, 0, 0, 0, 0, 0, 2, 0, 0, 1, 0]
    assert [frame.index for frame in frames] == steps
    assert [frame.t for frame in frames] == pytest.approx([100.1 + k / 30 for k in steps])


class Unsettable(FakeCapture):
    """Takes settings without a word, and changes nothing."""

    def set(self, prop: int, value: float) -> bool:
        return True


def test_automatics_are_switched_off_and_read_back_or_named(monkeypatch: pytest.MonkeyPatch) -> None:
    automatics = (cv2.CAP_PROP_AUTO_EXPOSURE, cv2.CAP_PROP_AUTO_WB, cv2.CAP_PROP_AUTOFOCUS)
    for system, manual in (("linux", 1), ("win32", 0)):
        monkeypatch.setattr("acquire.opencv.webcam.sys.platform", system)
        capture = FakeCapture(shots(1))
        info = camera_of(capture).info
        assert [capture.values[prop] for prop in automatics] == [manual, 0, 0]
        assert not any("automatic" in text for text in info.warnings)
        info = camera_of(Unsettable(shots(1), AUTO_EXPOSURE=3, AUTOFOCUS=1)).info
        (told,) = [text for text in info.warnings if "automatic" in text]
        assert "exposure, focus;" in told


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

    def __init__(self, reads: Sequence[Read]) -> None:
        super().__init__(reads)
        self.gate = threading.Event()


def test_stop_ends_a_stalled_camera() -> None:
    capture = StalledCapture(shots(1))
    with camera_of(capture) as camera:
        threading.Timer(0.05, camera.stop).start()
        assert list(camera) == []  # although its read still blocks
    capture.gate.set()


class StampedVideo(FakeCapture):
    """A video of these stamps, ms, 25 pictures a second."""

    def __init__(self, *stamps: float) -> None:
        super().__init__(shots(*range(len(stamps))), FPS=25.0, FRAME_WIDTH=6, FRAME_HEIGHT=4, FRAME_COUNT=9)
        self._stamps = stamps

    def get(self, prop: int) -> float:
        return self._stamps[self.read_count - 1] if prop == cv2.CAP_PROP_POS_MSEC else super().get(prop)


def test_times_of_a_video_that_does_not_count_on_go_on_by_its_rate(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.avi").write_bytes(b"RIFF")
    monkeypatch.setattr(cv2, "VideoCapture", lambda *_: StampedVideo(0, 0, 0, 200, 200, 100))
    events: list[Event] = []
    with open_camera(f"video:{tmp_path}/a.avi", events.append) as camera:
        frames = list(camera)
    assert [frame.t for frame in frames] == pytest.approx([0, 0.04, 0.08, 0.2, 0.24, 0.28])
    assert [frame.raw_t for frame in frames] == pytest.approx([0, 0, 0, 0.2, 0.2, 0.1])
    assert events[0].text.endswith("ends after 6 of 9 frames; it may be cut off")
    assert events[0].data == {"missing": 3}


def test_a_camera_of_opencv_gets_its_settings_by_their_names(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[int] = []
    fake = FakeCapture(shots(1))

    def capture(number: int) -> FakeCapture:
        opened.append(number)
        return fake

    monkeypatch.setattr(cv2, "VideoCapture", capture)
    address = "opencv:3?width=640&height=480&fps=25&exposure=-5&gain=2&gray=r"
    with open_camera(address) as camera:
        assert opened == [3] and camera.info.fps == 25
    names = ("FRAME_WIDTH", "FRAME_HEIGHT", "FPS", "EXPOSURE", "GAIN")
    assert [fake.values[getattr(cv2, f"CAP_PROP_{name}")] for name in names] == [640, 480, 25, -5, 2]


@pytest.mark.parametrize(("fps", "known"), [(0.0, None), (30.0, 30.0), (100000.0, None), (-1.0, None)])
def test_a_camera_is_described_by_its_picture_and_a_rate_of_sense(fps: float, known: float | None) -> None:
    info = camera_of(FakeCapture(shots(1), FPS=fps)).info
    assert (info.width, info.height, info.bits, info.fps, info.clock) == (6, 4, 8, known, "host")


@pytest.mark.parametrize(("now", "clock"), [(100.9, "device"), (99.1, "device"), (101.1, "host")])
def test_stamps_are_the_drivers_where_they_are_of_this_clock(now: float, clock: str) -> None:
    camera = live_camera(
        "opencv:0", lambda: StampedCapture([100.0]), OpenCVSettings(), ignore_event, now=lambda: now
    )
    assert camera.info.clock == clock
    assert len(camera.info.warnings) == (1 if clock == "device" else 2)


def test_a_picture_of_another_size_is_left_out_and_told() -> None:
    events: list[Event] = []
    reads: list[Read] = [*shots(0, 1), (True, np.zeros((8, 6, 3), np.uint8)), *shots(2)]
    frames = take(camera_of(FakeCapture(reads), events=events.append), 2)
    assert [(int(frame.image[0, 0]), frame.index, frame.lost_before) for frame in frames] == [
        (1, 0, 0),
        (2, 2, 1),
    ]
    assert "1 frame(s) came without a whole picture (it is of 6x8 px)" in events[0].text


@pytest.mark.parametrize(
    ("took_s", "words"),
    [
        (0.0049, "the device is gone or dead (its reads fail at once)"),
        (0.0051, "no picture within 0.0 s"),
        (1.24, "no picture within 1.2 s"),
    ],
)
def test_a_read_that_fails_at_once_has_waited_for_nothing(took_s: float, words: str) -> None:
    assert webcam._verdict(took_s) == words


def test_a_read_that_takes_its_time_is_a_stall_not_a_fault() -> None:
    capture = StalledCapture(shots(1))
    driver = webcam.OpenCVDriver("opencv:0", capture, OpenCVSettings(), time.monotonic)
    driver.start()
    assert driver.fetch(0.01) is None and driver.info.pause_s == 2.0
    driver.close()
    capture.gate.set()
