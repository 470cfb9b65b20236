"""Opening the kernel's camera: what it offers, what it refuses, who holds it."""

from __future__ import annotations

import subprocess
import sys
import time
from itertools import islice
from pathlib import Path
from typing import Any

import pytest
from numpy.typing import NDArray

from acquire.camera.contract import open_camera
from acquire.errors import ConfigError, DeviceError
from acquire.v4l2.listing import list_cameras
from live.cli import main
from live.config.loading import load_config
from tests.v4l2.inside import running, vivid

SMALL = "/dev/video0?format=GREY&width=640&height=360"


@pytest.mark.v4l2
def test_it_is_listed_with_all_it_offers() -> None:
    listing = next(one for one in list_cameras() if one.address.startswith(vivid.CAMERA))
    assert "vivid" in listing.name
    text = listing.text()
    offered = {"GREY", "Y10", "Y12", "Y16", "YUYV", "UYVY", "RGGB"}
    assert offered <= {line.split()[0].removeprefix("format=") for line in text.splitlines()}
    assert "640x360 at " in text
    assert "input=1 (HDMI 0)" in text
    assert "gain_automatic" in text
    assert all(not one.address.startswith(vivid.SCREEN) for one in list_cameras())


@pytest.mark.v4l2
def test_the_command_lists_it() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "live.cli", "devices"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "/dev/video0" in done.stdout
    assert "/dev/ttyACM0" in done.stdout


@pytest.mark.v4l2
def test_a_rig_file_is_made_of_what_is_plugged_in(
    tmp_path: Path, pictures: dict[str, NDArray[Any]], capsys: pytest.CaptureFixture[str]
) -> None:
    """The camera and the indicator are found by themselves, the specimen where it is said to look."""
    with running.Indicator(10.0):
        assert main(["init", str(tmp_path / "rig.toml")]) == 0
    config = load_config(tmp_path / "rig.toml", {})
    assert "/dev/v" in config.camera.address
    assert "format=" in config.camera.address
    assert config.load.address.startswith("/dev/ttyACM0?protocol=")
    assert (tmp_path / "rig.png").exists()
    with vivid.looped("GREY", pictures["reference_8"], fps=50):
        camera = "/dev/video0?input=1&format=GREY"
        looped = tmp_path / "looped.toml"
        assert main(["init", str(looped), "--camera", camera, "--load", "none:"]) == 0
    assert "the specimen" in capsys.readouterr().out
    assert load_config(looped, {}).measure.roi == "auto"


@pytest.mark.v4l2
@pytest.mark.parametrize(
    ("query", "words"),
    [
        ("format=MJPG", "format=MJPG is not possible; allowed: YUYV, UYVY, GREY"),
        ("width=111&height=99", "asked for 111x99, the driver gives 320x180"),
        ("width=640&height=360&fps=1234", "asked for fps=1234, the driver gives"),
        ("input=7", r"input=7 is not there; the camera has: 0 \(Webcam 0\), 1 \(HDMI 0\)"),
        ("colour=3", "unknown setting 'colour'.*brightness"),
        ("brightness=300", "brightness=300: the driver"),
        ("exposure_us=5000", "no control for an exposure"),
        ("manual=no&gain=9", "gain is held by an automatic control"),
    ],
)
def test_what_is_not_honoured_is_refused(query: str, words: str) -> None:
    vivid.press("gain_automatic", 1)
    with pytest.raises(ConfigError, match=words):
        open_camera(f"/dev/video0?{query}")


@pytest.mark.v4l2
def test_controls_are_put_on_manual_set_and_read_back() -> None:
    vivid.press("gain_automatic", 1)
    with open_camera(f"{SMALL}&gain=42&contrast=100") as camera:
        controls = camera.info.controls
    assert (controls["gain_automatic"], controls["gain"], controls["contrast"]) == (0, 42, 100)
    assert "gain_automatic: 0" in vivid.ctl("-C", "gain_automatic")
    vivid.press("contrast", 128)


@pytest.mark.v4l2
def test_controls_left_automatic_are_named() -> None:
    vivid.press("gain_automatic", 1)
    camera = open_camera(f"{SMALL}&manual=no")
    assert "gain_automatic" in camera.info.warnings[0]
    camera.close()


@pytest.mark.v4l2
def test_what_is_no_camera() -> None:
    with pytest.raises(DeviceError, match="captures no video"):
        open_camera(vivid.SCREEN)
    with pytest.raises(DeviceError, match=r"/dev/video7: there is no such device; cameras here: /dev/video0"):
        open_camera("/dev/video7")
    with pytest.raises(DeviceError, match="not a V4L2 device"):
        open_camera("/dev/null")


@pytest.mark.v4l2
def test_a_second_program_that_holds_it_is_named() -> None:
    other = subprocess.Popen(
        ["v4l2-ctl", "-d", vivid.CAMERA, "--stream-mmap", "--stream-count=0"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    )
    try:
        assert other.stderr is not None
        other.stderr.read(1)  # it prints a sign for every frame
        with pytest.raises(
            DeviceError, match=rf"another program holds the camera \(v4l2-ctl, PID {other.pid}\)"
        ):
            open_camera(SMALL).__enter__()
    finally:
        other.kill()
        other.communicate()
    with open_camera(SMALL) as camera:
        assert len(list(islice(camera, 2))) == 2


@pytest.mark.v4l2
@pytest.mark.parametrize("request_", ["reqbufs", "qbuf", "streamon"])
def test_a_start_that_fails_says_so_and_leaves_nothing_behind(request_: str) -> None:
    camera = open_camera(SMALL)
    vivid.press(f"inject_vidioc_{request_}_error")
    with pytest.raises(DeviceError, match="/dev/video0"):
        camera.__enter__()
    camera.close()
    with open_camera(SMALL) as again:
        assert len(list(islice(again, 2))) == 2


@pytest.mark.v4l2
def test_the_rate_asked_for_is_in_force() -> None:
    with open_camera(f"{SMALL}&fps=25") as camera:
        assert camera.info.fps == pytest.approx(25, rel=0.001)
        began = time.monotonic()
        frames = list(islice(camera, 10))
    assert frames[-1].raw_t - frames[0].raw_t == pytest.approx(
        (frames[-1].index - frames[0].index) / 25, rel=0.2
    )
    assert frames[0].raw_t > began - 1
