"""What cameras share: addresses without a scheme, guards, parts of a picture, lists."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from acquire.addresses import parse_address
from acquire.camera import CAMERAS, CameraListing, CroppedCamera, list_cameras, with_scheme
from acquire.camera.contract import CameraBase, without_v4l2
from acquire.errors import ConfigError
from acquire.events import ignore_event
from acquire.frame import CameraInfo, Frame, frozen


@pytest.mark.parametrize(
    ("name", "address"),
    [
        ("a.h5", "session:{}"),
        ("a.HDF5", "session:{}"),
        *((f"a{suffix}", "video:{}") for suffix in (".mp4", ".avi", ".mkv", ".mov", ".m4v", ".webm", ".MP4")),
        ("a.tif", "files:{}"),
        ("a.unknown", "files:{}"),
    ],
)
def test_a_file_needs_no_scheme(tmp_path: Path, name: str, address: str) -> None:
    (tmp_path / name).touch()
    assert with_scheme(f"{tmp_path}/{name}") == address.format(f"{tmp_path}/{name}")
    assert with_scheme(f"{tmp_path}/{name}?x=1") == address.format(f"{tmp_path}/{name}?x=1")


def test_what_is_not_there_stays_as_it_is(tmp_path: Path) -> None:
    for text in (
        f"{tmp_path}/a.mp4",
        "/dev/video0?fps=5",
        "sim:hole",
        "opencv:0",
        "genicam:x.h5",
        "other:thing",
    ):
        assert with_scheme(text) == text
    assert with_scheme(f"{tmp_path}/gone.h5") == f"session:{tmp_path}/gone.h5"
    assert with_scheme(f"{tmp_path}/*.tif?fps=5") == f"files:{tmp_path}/*.tif?fps=5"
    assert with_scheme(str(tmp_path)) == f"files:{tmp_path}"


class Counting(CameraBase):
    """Two pictures of 6 x 4 pixels, each of which has its place as its grey level."""

    info = CameraInfo("counting:", "counts", 6, 4, 8, True, "device", 30.0, controls={"gain": 3})

    def __init__(self) -> None:
        super().__init__()
        self.done: list[str] = []

    def __iter__(self) -> Iterator[Frame]:
        for k in range(2):
            image = frozen(np.arange(24, dtype=np.uint8).reshape(4, 6) + np.uint8(100 * k))
            yield Frame(image, 7 + k, 1.0 + k, "device", k, 8, 1.0 + k)

    def _start(self) -> None:
        self.done.append("start")

    def _release(self) -> None:
        self.done.append("release")


def test_a_part_of_the_picture_is_a_camera_of_its_own() -> None:
    whole = Counting()
    with CroppedCamera(whole, (1, 2, 3, 2)) as part:
        assert (part.info.width, part.info.height, part.info.fps) == (3, 2, 30.0)
        assert part.info.controls == {"gain": 3, "crop": [1, 2, 3, 2]}
        frames = list(part)
        assert whole.done == ["start"]
        part.stop()
        assert whole.stopped.is_set()
    part.close()
    assert whole.done == ["start", "release"]
    assert frames[0].image.tolist() == [[13, 14, 15], [19, 20, 21]]
    assert [(frame.index, frame.t, frame.lost_before) for frame in frames] == [(7, 1.0, 0), (8, 2.0, 1)]
    assert not frames[1].image.flags.writeable and frames[1].image.flags.owndata


def test_a_part_that_leaves_the_picture_is_refused() -> None:
    with pytest.raises(ConfigError, match="crop 4,0,3,4 leaves the picture of 6 x 4 px"):
        CroppedCamera(Counting(), (4, 0, 3, 4))


def test_the_cameras_of_all_are_listed_though_those_of_one_cannot_be(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken() -> list[CameraListing]:
        raise OSError("no bus")

    listers = [("a", broken), ("b", lambda: [CameraListing("b:1", "one")])]
    monkeypatch.setattr(CAMERAS, "listers", lambda: iter(listers))
    assert list_cameras() == [
        CameraListing("a:", "", "its cameras cannot be listed: no bus"),
        CameraListing("b:1", "one"),
    ]


def test_a_camera_in_a_list() -> None:
    full = CameraListing("b:1", "a name", "it is busy", "/dev/by-id/x", ("Y12 30/s", "gain=1"))
    assert full.text().split("\n      ") == [
        "  b:1  a name", "it is busy", "stays the same when replugged: /dev/by-id/x", "Y12 30/s", "gain=1",
    ]  # fmt: skip
    assert CameraListing("b:1", "").text() == "  b:1"


def test_without_v4l2_other_cameras_are_named() -> None:
    with pytest.raises(
        ConfigError, match=r"/dev/video0: .*need Linux \(V4L2\); choose opencv:0, genicam: or"
    ):
        without_v4l2(parse_address("/dev/video0"), ignore_event)
