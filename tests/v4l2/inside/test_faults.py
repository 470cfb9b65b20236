"""Every fault the kernel's camera can be given, survived: told, counted, numbers never back."""

from __future__ import annotations

import math
import threading
from itertools import pairwise

import pytest

from acquire.camera.contract import open_camera
from tests.contracts.watching import FrameWatch
from tests.v4l2.inside import vivid

ADDRESS = "/dev/video0?format=GREY&width=640&height=360&fps=25"


class Watch(FrameWatch):
    """As long as an emulated machine takes."""

    patience_s = math.inf

    def __init__(self, address: str = ADDRESS) -> None:
        super().__init__(address)


@pytest.mark.v4l2
def test_dropped_buffers_are_counted() -> None:
    watch = Watch()
    watch.take(lambda: len(watch.frames) >= 40, {5: lambda: vivid.press("percentage_of_dropped_buffers", 40)})
    watch.check_numbers()
    assert sum(frame.lost_before for frame in watch.frames) > 5


@pytest.mark.v4l2
def test_a_damaged_buffer_is_marked() -> None:
    watch = Watch()
    watch.take(watch.after("damaged"), {5: lambda: vivid.press("inject_v4l2_buf_flag_error")})
    watch.check_numbers()
    assert sum(frame.damaged for frame in watch.frames) == 1


@pytest.mark.v4l2
def test_a_fatal_streaming_error_is_survived() -> None:
    watch = Watch()
    watch.take(watch.after("opened again"), {5: lambda: vivid.press("inject_fatal_streaming_error")})
    watch.check_numbers()
    assert "fatal error of the stream" in watch.texts()
    assert [event.level for event in watch.events[:2]] == ["error", "info"]


@pytest.mark.v4l2
def test_a_disconnected_camera_is_found_when_it_is_back() -> None:
    watch = Watch()
    watch.on_text["unplugged"] = vivid.replug
    watch.take(watch.after("opened again"), {5: lambda: vivid.press("disconnect")})
    watch.check_numbers()
    gap = max(frame.lost_before for frame in watch.frames)
    assert gap > 0


@pytest.mark.v4l2
def test_unplugged_and_plugged_in_again_in_mid_stream() -> None:
    watch = Watch()
    watch.on_text["unplugged"] = vivid.plug
    watch.take(watch.after("opened again"), {5: vivid.unplug})
    watch.check_numbers()
    assert "last good frame" in watch.texts()
    with open_camera(ADDRESS) as camera:  # nothing of the old one was left open
        assert next(iter(camera)).index >= 0


@pytest.mark.v4l2
def test_replugged_faster_than_noticed_it_is_found_under_its_new_name() -> None:
    watch = Watch()
    # The handle is still open then, so the kernel gives the old name to the other node.
    watch.take(watch.after("opened again"), {5: vivid.replug})
    watch.check_numbers()
    assert "opened again as /dev/video" in watch.texts()


@pytest.mark.v4l2
def test_a_stalled_camera_is_told_and_goes_on() -> None:
    watch = Watch(ADDRESS + "&stall_s=1")
    watch.on_text["no picture for"] = lambda: vivid.press("percentage_of_dropped_buffers", 0)
    watch.take(watch.after("pictures again"), {5: lambda: vivid.press("percentage_of_dropped_buffers", 100)})
    watch.check_numbers()
    assert watch.texts().count("no picture for") == 1
    assert sum(frame.lost_before for frame in watch.frames) > 5


@pytest.mark.v4l2
def test_a_long_stall_opens_it_anew_and_ends_well() -> None:
    watch = Watch(ADDRESS + "&stall_s=0.5")

    def heal_later() -> None:
        threading.Timer(4.0, lambda: vivid.press("percentage_of_dropped_buffers", 0)).start()

    watch.on_text["no picture for"] = heal_later
    watch.take(watch.after("pictures again"), {5: lambda: vivid.press("percentage_of_dropped_buffers", 100)})
    watch.check_numbers()
    assert max(frame.lost_before for frame in watch.frames) > 25


@pytest.mark.v4l2
def test_stop_ends_it_while_it_is_unplugged() -> None:
    watch = Watch()
    watch.on_text["unplugged"] = watch.camera.stop
    watch.take(lambda: False, {5: vivid.unplug})
    assert len(watch.frames) < 60
    watch.camera.close()


@pytest.mark.v4l2
def test_opencv_behind_its_guards_survives_the_same() -> None:
    watch = Watch("opencv:0?width=640&height=360")
    assert watch.camera.info.clock == "device"
    watch.on_text["looking for it again"] = vivid.plug
    watch.take(watch.after("opened again"), {5: vivid.unplug})
    assert "gone or dead" in watch.texts() or "no picture within" in watch.texts()
    assert all(later.index > earlier.index for earlier, later in pairwise(watch.frames))
