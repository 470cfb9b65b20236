"""The loop over every live camera: each fault is told, counted and recovered from, whatever the driver."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice
from typing import Any

import numpy as np
import pytest

from acquire import opening
from acquire.camera.live import DeviceFault, Driver, LiveCamera, Picture
from acquire.errors import ConfigError, DeviceError
from acquire.events import Event
from acquire.frame import CameraInfo, Frame

INFO = CameraInfo("mem:", "a camera in memory", 6, 4, 8, True, "device", 10.0, pause_s=0.5, white_level=200)
Step = Callable[["MemoryDriver"], "Picture | None"]


class MemoryDriver:
    """Gives a numbered picture each tenth of a second of its own clock; ``script`` puts something in its place."""

    cycle = 2**32

    def __init__(self, rig: Rig) -> None:
        self.rig, self.name, self.info, self.alike = rig, rig.name, rig.info, rig.alike
        self.number, self.started, self.closed = 0, 0, False

    def start(self) -> None:
        if self.rig.refuses:
            raise DeviceFault(self.rig.refuses)
        self.started += 1

    def fetch(self, timeout_s: float) -> Picture | None:
        step: Step = self.rig.script.pop(0) if self.rig.script else picture
        return step(self)

    def close(self) -> None:
        self.closed = True


def picture(driver: MemoryDriver, **changes: Any) -> Picture:
    driver.rig.t += 0.1
    shown = replace(Picture(np.full((4, 6), driver.number, np.uint8), driver.rig.t, driver.number), **changes)
    driver.number += 1
    return shown


def nothing(driver: MemoryDriver) -> None:
    driver.rig.t += 0.1


def away(driver: MemoryDriver) -> Picture | None:
    raise DeviceFault("the cable is out")


class Rig:
    """A camera over a driver in memory, what it says, and what opening it again does."""

    def __init__(self, *script: Step) -> None:
        self.script, self.t = list(script), 100.0
        self.info, self.name, self.alike, self.refuses = INFO, "mem:", "one", ""
        self.events: list[Event] = []
        self.drivers: list[MemoryDriver] = []
        self.on_open: list[Callable[[], None]] = []

    def opened(self, before: Driver | None) -> MemoryDriver:
        if before is not None:
            self.t += 0.5
            if self.on_open:
                self.on_open.pop(0)()
        self.drivers.append(MemoryDriver(self))
        return self.drivers[-1]

    def camera(self) -> LiveCamera:
        return LiveCamera("mem:", self.opened, self.events.append, lambda: self.t)

    def take(self, count: int) -> list[Frame]:
        with self.camera() as camera:
            return list(islice(camera, count))

    @property
    def texts(self) -> list[str]:
        return [event.text for event in self.events]


@pytest.fixture(autouse=True)
def at_once(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(opening, "RETRY_S", 0.001)
    yield
    assert not [thread for thread in threading.enumerate() if thread.name == "closing"]


def test_frames_are_what_the_driver_gives() -> None:
    rig = Rig()
    frames = rig.take(3)
    assert [(frame.index, frame.lost_before, frame.clock) for frame in frames] == [
        (k, 0, "device") for k in range(3)
    ]
    assert [frame.t for frame in frames] == pytest.approx([100.1, 100.2, 100.3])
    assert {frame.white_level for frame in frames} == {200} and rig.texts == []
    assert rig.drivers[0].closed


def test_a_picture_that_is_not_whole_is_lost_and_told() -> None:
    rig = Rig(picture, lambda driver: picture(driver, image=None, trouble="packets are missing"))
    assert [frame.index for frame in rig.take(2)] == [0, 2]
    assert rig.texts == [
        "mem:: 1 frame(s) came without a whole picture (packets are missing) and are counted as lost"
    ]


def test_a_picture_that_is_not_whole_and_has_no_number_is_lost_too() -> None:
    one = lambda driver: picture(driver, number=None, clock="host")  # noqa: E731
    gone = lambda driver: picture(driver, number=None, clock="host", image=None)  # noqa: E731
    frames = Rig(one, one, gone, gone, one, one).take(4)
    assert [(frame.index, frame.lost_before) for frame in frames] == [(0, 0), (1, 0), (4, 2), (5, 0)]


def test_a_damaged_picture_is_handed_out_marked() -> None:
    rig = Rig(picture, *[lambda driver: picture(driver, trouble="a bit")] * 5)
    assert [frame.damaged for frame in rig.take(7)] == [False, *[True] * 5, False]
    assert rig.texts == [
        "mem:: frame 1 is damaged: recorded, not measured"
    ]  # and no line for each of the others


def test_a_picture_without_a_number_that_comes_again_is_damaged() -> None:
    one, other = (np.full((4, 6), level, np.uint8) for level in (7, 8))
    rig = Rig(*[lambda driver: picture(driver, number=None, image=one.copy())] * 4)
    rig.script += [lambda driver: picture(driver, number=None, image=other.copy())] * 2
    assert [frame.damaged for frame in rig.take(7)] == [False, False, True, True, False, False, False]
    assert sum("the same picture again and again" in text for text in rig.texts) == 1


@pytest.mark.parametrize(("waits", "opened"), [(19, 1), (22, 2)])
def test_a_camera_is_dead_after_four_of_its_longest_pauses(waits: int, opened: int) -> None:
    rig = Rig(picture, *[nothing] * waits)  # of a tenth of a second; the longest pause is half a second
    rig.take(2)
    assert len(rig.drivers) == opened


def test_it_is_closed_before_it_is_said_to_be_away() -> None:
    rig = Rig(picture, away)
    closed: list[bool] = []
    rig.events = type(
        "Events", (list,), {"append": lambda self, event: closed.append(rig.drivers[0].closed)}
    )()
    rig.take(2)
    assert closed == [True, True]


def test_one_that_comes_back_under_another_name_is_told() -> None:
    rig = Rig(picture, away)
    rig.on_open = [lambda: setattr(rig, "name", "mem:other")]
    rig.take(2)
    assert rig.texts[-1] == "mem:: opened again as mem:other; the frames in between are counted as lost"


def test_another_camera_is_not_taken_for_it_and_is_told_once() -> None:
    rig = Rig(picture, away)
    rig.on_open = [
        *[lambda: setattr(rig, "alike", "another")] * 3,
        lambda: setattr(rig, "alike", "one"),
    ]
    assert len(rig.take(2)) == 2
    told = [text for text in rig.texts if "cannot be used" in text]
    assert len(told) == 1 and "another, not one" in told[0]
    assert all(driver.closed for driver in rig.drivers)


def test_one_that_comes_back_and_does_not_stream_is_tried_again() -> None:
    rig = Rig(picture, away)
    rig.on_open = [lambda: setattr(rig, "refuses", "no bandwidth"), lambda: setattr(rig, "refuses", "")]
    assert len(rig.take(2)) == 2 and len(rig.drivers) == 3


def test_frames_from_before_the_test_are_left_out() -> None:
    rig = Rig(*[lambda driver: picture(driver, arrived=50.0)] * 3)
    assert [frame.index for frame in rig.take(2)] == [3, 4]
    assert rig.texts == ["mem:: 3 frames older than the start were left out"]


def test_a_machine_that_does_not_keep_up_is_told_once() -> None:
    def late(driver: MemoryDriver) -> Picture:
        shown = picture(driver)
        driver.rig.t += 1.5
        return shown

    rig = Rig(picture, late, late)
    rig.take(3)
    assert [text for text in rig.texts if "does not keep up" in text] == [
        "mem:: frames are 1.5 s old when they are fetched: this machine does not keep up"
    ]


def test_a_remark_of_the_driver_is_an_event() -> None:
    rig = Rig(lambda driver: picture(driver, remark="its clock jumped"))
    rig.take(1)
    assert rig.texts == ["mem:: its clock jumped"]


def test_why_it_does_not_open_or_stream() -> None:
    def none(before: Driver | None) -> Driver:
        raise DeviceFault("it is not there")

    with pytest.raises(DeviceError, match="mem:: does not open: it is not there"):
        LiveCamera("mem:", none, print)
    rig = Rig()
    camera, rig.refuses = rig.camera(), "no bandwidth"
    with pytest.raises(DeviceError, match="does not stream: no bandwidth"), camera:
        pass
    camera.close()
    assert rig.drivers[0].closed

    def refused(before: Driver | None) -> Driver:
        raise ConfigError("fps=3 is not possible")

    with pytest.raises(ConfigError, match="fps=3"):
        LiveCamera("mem:", refused, print)


def test_closing_from_another_thread_takes_nothing_from_under_a_reader() -> None:
    reading, closed = threading.Event(), []

    def slow(driver: MemoryDriver) -> Picture:
        reading.set()
        threading.Event().wait(0.05)
        closed.append(driver.closed)
        return picture(driver)

    rig = Rig(*[slow] * 100)
    camera = rig.camera()
    with camera:
        reader = threading.Thread(target=lambda: list(camera))
        reader.start()
        reading.wait(10)
    reader.join(10)
    assert rig.drivers[0].closed and not any(closed) and rig.texts == []
