"""Every camera keeps the contract of ``acquire.camera.Camera``: one suite over all of them."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterator
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from acquire.addresses import parse_address, with_setting
from acquire.camera import CameraListing, list_cameras
from acquire.camera.contract import Camera, open_camera
from acquire.errors import ConfigError, DataError, DeviceError, PhasedicError
from acquire.events import ignore_event
from acquire.frame import Frame
from acquire.opencv.webcam import OpenCVSettings, live_camera
from acquire.v4l2.camera import open_v4l2
from live.cli import main
from live.commands.init import find_devices
from live.setup.devices import open_rig
from live.ui.terminal.screen import TerminalScreen
from live.ui.web.setup.specimen_check import camera_values
from tests.acquire.session import fixtures as session_fixtures
from tests.acquire.v4l2.fake_kernel import FakeCamera, FakeKernel
from tests.contracts.entry_points import install_example

Opener = Callable[[Path, pytest.MonkeyPatch], Camera]


def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Camera:
    for k in range(6):
        cv2.imwrite(str(tmp_path / f"{k}.png"), np.full((12, 16), 9 * k, np.uint8))
    return open_camera(f"files:{tmp_path}/*.png?fps=5")


def video(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Camera:
    writer = cv2.VideoWriter(str(tmp_path / "a.avi"), cv2.VideoWriter.fourcc(*"FFV1"), 25, (32, 24))
    for k in range(6):
        writer.write(np.full((24, 32, 3), 9 * k, np.uint8))
    writer.release()
    return open_camera(f"video:{tmp_path}/a.avi")


class Webcam:
    """A ``cv2.VideoCapture`` that never ends."""

    count = 0

    def isOpened(self) -> bool:
        return True

    def read(self) -> tuple[bool, Any]:
        self.count += 1
        time.sleep(0.002)  # as a driver does; unpaced, it would keep a core busy
        return True, np.full((12, 16, 3), self.count % 256, np.uint8)

    def get(self, prop: int) -> float:
        return 0.0

    def set(self, prop: int, value: float) -> bool:
        return True

    def release(self) -> None: ...


def opencv(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Camera:
    return live_camera("opencv:0", Webcam, OpenCVSettings(), ignore_event)


def v4l2(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Camera:
    kernel = FakeKernel(FakeCamera())
    return open_v4l2(parse_address("/dev/video0"), ignore_event, kernel)


def session(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Camera:
    with session_fixtures.writer(tmp_path / "run.h5") as writer:
        for k in range(6):
            writer.write_frame(session_fixtures.frame(k))
    return open_camera(f"session:{tmp_path}/run.h5")


def _sim(settings: str) -> Camera:
    from hw_mocks.sim_camera import open_sim_camera
    from hw_mocks.specimen import specimen_from

    address = parse_address(f"sim:uniform?width=64&height=48&seconds=2&fps=50&{settings}")
    return open_sim_camera(address, ignore_event, specimen_from(address))


def sim(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Camera:
    return _sim("bits=12")


def sim_in_lock_step(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Camera:
    return _sim("lockstep=yes")


def somebody_elses(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Camera:
    install_example(tmp_path, monkeypatch)
    (tmp_path / "a.bin").write_bytes(bytes(range(192)) * 6)
    return open_camera(f"raw:{tmp_path}/a.bin?width=16&height=12")


OPENERS = [files, video, opencv, v4l2, session, sim, sim_in_lock_step, somebody_elses]


@pytest.fixture(params=OPENERS, ids=lambda opener: opener.__name__.replace("_", "-"))
def camera(
    request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Camera]:
    opened = request.param(tmp_path, monkeypatch)
    yield opened
    opened.close()


def take(camera: Camera, count: int) -> list[Frame]:
    with camera:
        return list(islice(camera, count))


def test_it_is_a_camera(camera: Camera) -> None:
    assert isinstance(camera, Camera)


def test_info_is_complete_before_the_stream(camera: Camera) -> None:
    info = camera.info
    assert info.address
    assert info.name
    assert min(info.width, info.height, info.bits) > 0
    assert info.bits <= 16
    assert info.clock in ("device", "host", "nominal")
    assert isinstance(info.live, bool)
    assert info.fps is None or info.fps > 0
    assert all(isinstance(text, str) for text in info.warnings)


def test_what_can_be_changed_is_within_its_bounds(camera: Camera) -> None:
    for setting in camera.info.settings:
        assert setting.low <= setting.value <= setting.high
        assert setting.low > 0 or not setting.log
    assert len({setting.key for setting in camera.info.settings}) == len(camera.info.settings)


@pytest.mark.parametrize("opener", [sim, somebody_elses])
def test_the_page_has_a_slider_for_what_can_be_changed(
    opener: Opener, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with contextlib.closing(opener(tmp_path, monkeypatch)) as before:
        info = before.info
    assert [one["key"] for one in camera_values(info)["sliders"]] == [one.key for one in info.settings] != []
    for setting in info.settings:
        wanted = (setting.value + setting.high) / 2
        rig = open_rig(with_setting(info.address, setting.key, wanted), "none:")
        now = {one.key: one.value for one in rig.camera.info.settings}
        rig.close()
        assert now[setting.key] == pytest.approx(wanted, rel=1e-5)


def test_cameras_of_somebody_else_are_listed_with_ours(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    install_example(tmp_path, monkeypatch)
    ours = CameraListing("/dev/video7", "", "this user may not open it")
    monkeypatch.setattr("acquire.v4l2.listing.list_cameras", lambda: [ours])
    monkeypatch.setattr("acquire.serial_line.ports.list_serial_ports", list)  # those of the machine
    monkeypatch.chdir(tmp_path)
    (tmp_path / "good.raw").write_bytes(bytes(640 * 480 * 2))
    (tmp_path / "odd.raw").write_bytes(bytes(7))
    found = list_cameras()
    assert [one.address for one in found] == ["/dev/video7", "raw:good.raw", "raw:odd.raw"]
    assert [bool(one.trouble) for one in found] == [True, False, True]
    open_camera(found[1].address).close()
    assert main(["devices"]) == 0
    assert "  raw:good.raw  raw dump\n      614400 bytes\n" in capsys.readouterr().out
    assert find_devices({}, TerminalScreen()).camera == "raw:good.raw"


def test_frames_are_what_info_promised(camera: Camera) -> None:
    info = camera.info
    frames = take(camera, 4)
    assert len(frames) == 4
    for frame in frames:
        assert frame.image.shape == (info.height, info.width)
        assert frame.image.dtype == (np.uint8 if info.bits <= 8 else np.uint16)
        assert (frame.bits, frame.clock) == (info.bits, info.clock)
        assert int(frame.image.max()) < 2**frame.bits


def test_numbers_increase_times_do_not_run_back_and_gaps_agree(camera: Camera) -> None:
    frames = take(camera, 5)
    for earlier, later in pairwise(frames):
        assert later.index > earlier.index
        assert later.t >= earlier.t
        assert later.lost_before == later.index - earlier.index - 1
    assert frames[0].lost_before >= 0


def test_each_frame_has_read_only_memory_of_its_own(camera: Camera) -> None:
    frames = take(camera, 4)
    kept = [frame.image.copy() for frame in frames]
    for k, frame in enumerate(frames):
        assert not frame.image.flags.writeable
        assert all(not np.shares_memory(frame.image, other.image) for other in frames[:k])
        assert np.array_equal(frame.image, kept[k])
    with pytest.raises(ValueError, match="read-only"):
        frames[0].image[0, 0] = 1


def test_stop_from_another_thread_ends_the_iteration(camera: Camera) -> None:
    with camera:
        stream = iter(camera)
        next(stream)
        stopper = threading.Thread(target=camera.stop)
        stopper.start()
        stopper.join()
        assert len(list(islice(stream, 3))) <= 1  # the one that was on its way


def test_stop_before_the_iteration(camera: Camera) -> None:
    with camera:
        camera.stop()
        assert len(list(islice(camera, 3))) <= 1


def test_closing_twice_and_without_having_entered(camera: Camera) -> None:
    camera.close()
    camera.close()
    camera.stop()


def test_leaving_closes_also_after_an_error(camera: Camera) -> None:
    with pytest.raises(ZeroDivisionError), camera:
        next(iter(camera))
        raise ZeroDivisionError
    camera.close()


@pytest.mark.parametrize(
    ("address", "kind"),
    [
        ("files:{}/nothing/*.tif", DataError),
        ("video:{}/nothing.mp4", DataError),
        ("session:{}/nothing.h5", DataError),
        ("opencv:front", ConfigError),
        ("/dev/video97", DeviceError),
        ("nobody:knows", ConfigError),
        ("files:{}?unknown=1", PhasedicError),
    ],
)
def test_what_cannot_be_opened_is_named(tmp_path: Path, address: str, kind: type[PhasedicError]) -> None:
    text = address.format(tmp_path)
    with pytest.raises(kind) as caught:
        open_camera(text)
    assert text.partition(":")[2].partition("?")[0].partition("/*")[0] in str(caught.value)
