"""Every fault is an event, is counted, and is recovered from; the end never waits for a dead camera."""

from __future__ import annotations

import threading
import time

import pytest

from acquire.camera.live import DEAD
from acquire.genicam.device import GenicamDevice
from acquire.genicam.library import Aravis, GenicamError
from tests.contracts.watching import FrameWatch
from tests.genicam.inside.fakes import FakeCameraProcess

SMALL = "genicam:127.0.0.1?format=Mono8&fps=20&width=200&height=100"


def test_missing_packets_are_lost_frames() -> None:
    with FakeCameraProcess("--loss", "0.02"):
        watch = FrameWatch(f"{SMALL}&packet_size=600")
        watch.take(lambda: sum(frame.lost_before for frame in watch.frames) >= 3)
    watch.check_numbers()
    assert "without a whole picture" in watch.texts() or "lost" in watch.texts()


def test_a_camera_that_stands_still_is_told_and_goes_on() -> None:
    with FakeCameraProcess() as fake:
        watch = FrameWatch(f"{SMALL}&stall_s=0.6")
        watch.on_text["no picture for"] = fake.go_on
        watch.take(watch.after("pictures again"), {5: fake.pause})
    watch.check_numbers()
    assert watch.texts().count("no picture for") == 1


@pytest.mark.parametrize("away_s", [0.0, 3.0])
def test_unplugged_and_plugged_in_again(away_s: float) -> None:
    with FakeCameraProcess() as fake:
        watch = FrameWatch(SMALL)

        def replug() -> None:
            fake.unplug()
            threading.Timer(away_s, fake.plug).start()

        watch.take(watch.after("pictures again"), {5: replug})
    watch.check_numbers()
    texts = watch.texts()
    assert "no picture for" in texts
    first_after = next(frame for frame in watch.frames if frame.lost_before)
    before = watch.frames[watch.frames.index(first_after) - 1]
    assert first_after.lost_before == pytest.approx((first_after.t - before.t) * 20 - 1, abs=1.01)
    assert first_after.lost_before >= 20 * away_s


def test_one_that_comes_back_too_small_is_reported_and_not_taken() -> None:
    """The picture would be another; the right one is taken when it comes."""
    with FakeCameraProcess() as fake:
        watch = FrameWatch(SMALL)

        def swapped(*options: str) -> None:
            fake.unplug()
            fake.plug(*options)

        watch.on_text["cannot be used"] = swapped
        watch.take(watch.after("pictures again"), {5: lambda: swapped("--sensor", "150")})
    watch.check_numbers()
    assert "it is back, but cannot be used" in watch.texts()
    assert "width=200 is not possible; allowed: 1 to 150" in watch.texts()
    assert {frame.image.shape for frame in watch.frames} == {(100, 200)}


def test_one_that_answers_no_more_is_found_by_its_heartbeat() -> None:
    """Where pauses are allowed, as with a trigger, the library finds that the camera is gone."""
    with FakeCameraProcess() as fake:
        watch = FrameWatch(f"{SMALL}&stall_s=60")
        watch.on_text["no longer answers"] = fake.plug
        watch.take(watch.after("opened again"), {5: fake.unplug})
    watch.check_numbers()
    assert "no picture for" not in watch.texts()
    assert max(frame.lost_before for frame in watch.frames) > 20


def test_the_end_comes_at_once_while_the_camera_is_looked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each attempt fails at once here, and the end comes between two of them: no error comes out of it."""
    with FakeCameraProcess() as fake:
        watch = FrameWatch(SMALL.replace("127.0.0.1", "GV01"))

        def gone(library: Aravis, name: str) -> GenicamDevice:
            raise GenicamError("it is not there")

        def stop_soon() -> None:
            monkeypatch.setattr("acquire.genicam.camera.GenicamDevice", gone)
            threading.Timer(1.0 + DEAD * 0.5, watch.camera.stop).start()

        watch.on_text["no picture for"] = stop_soon
        watch.take(lambda: False, {5: fake.unplug})
    assert len(watch.frames) >= 5


def test_the_end_does_not_wait_for_a_camera_that_is_away() -> None:
    with FakeCameraProcess() as fake:
        watch = FrameWatch(SMALL)
        stopped: list[float] = []

        def stop() -> None:
            stopped.append(time.monotonic())
            watch.camera.stop()

        watch.on_text["no picture for"] = lambda: threading.Timer(2.5, stop).start()
        watch.take(lambda: False, {5: fake.unplug})
    assert time.monotonic() - stopped[0] < 1.5


def test_a_triggered_camera_may_rest() -> None:
    """Nothing triggers the line of the fake: no event comes, and nothing is lost, however long it takes."""
    with FakeCameraProcess():
        watch = FrameWatch("genicam:127.0.0.1?format=Mono8&width=64&height=48&trigger=Line0")
        threading.Timer(3.0, watch.camera.stop).start()
        watch.take(lambda: False)
    assert watch.camera.info.fps is None
    assert watch.frames == [] and watch.events == []


def test_software_triggers_come_at_the_rate() -> None:
    with FakeCameraProcess():
        watch = FrameWatch("genicam:127.0.0.1?format=Mono8&width=64&height=48&trigger=Software&fps=10")
        begun = time.monotonic()
        watch.first(11)
        took = time.monotonic() - begun
    assert watch.camera.info.fps == 10
    assert 0.9 < took < 5
    watch.check_numbers()
