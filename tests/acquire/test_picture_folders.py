"""Pictures as they come from cameras: folders with all that lies in them, and films."""

from __future__ import annotations

import os
import struct
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from acquire.addresses import parse_address
from acquire.camera.contract import open_camera
from acquire.errors import ConfigError, DataError
from acquire.events import Event
from acquire.files.headers import full_pages, quantisation
from acquire.files.picture import WEBCAM_WARNING
from acquire.frame import QUANTISATION
from acquire.opencv.image_metadata import taken_times
from acquire.opencv.images import find_images, picture_names, picture_times
from acquire.opencv.video import FILM_WARNING
from hw_mocks.deformation import Affine
from hw_mocks.speckle import Speckle


def picture(shape: tuple[int, int] = (12, 16), dtype: type = np.uint8) -> NDArray[Any]:
    return np.arange(shape[0] * shape[1]).reshape(shape).astype(dtype)


def write(path: Path, *pages: NDArray[Any]) -> Path:
    assert cv2.imwritemulti(str(path), pages) if len(pages) > 1 else cv2.imwrite(str(path), pages[0])
    return path


def names(target: str, **how: str) -> list[str]:
    return [path.name for path in find_images(target, **how)]


def test_hidden_files_and_those_of_file_managers_are_not_seen(tmp_path: Path) -> None:
    for name in ("Bild_0.png", "Bild_1.png"):
        write(tmp_path / name, picture())
    for name in ("._Bild_0.png", ".DS_Store", "Thumbs.db", "desktop.ini"):
        (tmp_path / name).write_bytes(b"\0")
    assert names(str(tmp_path)) == names(f"{tmp_path}/*") == ["Bild_0.png", "Bild_1.png"]


def test_a_mask_is_named_and_left_out(tmp_path: Path) -> None:
    for name in ("mask.png", "s1.png", "s2.png"):
        write(tmp_path / name, picture())
    told: list[Event] = []
    (tmp_path / "t.csv").write_text("s1.png,1\ns2.png,3\n")
    with open_camera(f"files:{tmp_path}?stamps={tmp_path}/t.csv", told.append) as camera:
        frames = list(camera)
    assert [(frame.damaged, frame.t) for frame in frames] == [(False, 1.0), (False, 3.0), (True, 3.0)]
    assert "mask.png is a mask by its name (--mask" in told[0].text
    assert told[0].text.endswith("this picture is left out")
    assert picture_times(parse_address(f"files:{tmp_path}")) == {"s1.png": 0.0, "s2.png": 1.0}


@pytest.mark.parametrize("other", [picture((20, 16)), picture(dtype=np.uint16)])
def test_a_first_picture_of_another_kind_is_not_the_measure(tmp_path: Path, other: NDArray[Any]) -> None:
    write(tmp_path / "a0.png", other)
    for k in range(1, 5):
        write(tmp_path / f"a{k}.png", picture())
    told: list[Event] = []
    with open_camera(f"files:{tmp_path}", told.append) as camera:
        assert (camera.info.height, camera.info.bits) == (12, 8)
        assert [frame.damaged for frame in camera] == [True, False, False, False, False]
    assert "a0.png is 16x" in told[0].text
    assert "a1.png is 16x12 uint8" in told[0].text


def test_what_there_is_in_place_of_pictures(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=rf"{tmp_path}: no picture in this folder \(it is empty\)"):
        find_images(str(tmp_path))
    (tmp_path / "notes.txt").touch()
    with pytest.raises(DataError, match=r"only notes\.txt\); wanted: \.tif"):
        find_images(str(tmp_path))


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("film.mraw", "a film of a Photron camera"),
        ("film.cihx", "a film of a Photron camera"),
        ("film.CINE", "a film of a Phantom camera"),
        ("shot.nef", "a raw picture cannot be read; develop it"),
    ],
)
def test_foreign_formats_have_a_way_out(tmp_path: Path, name: str, words: str) -> None:
    (tmp_path / name).write_bytes(bytes(100))
    for target in (tmp_path, tmp_path / name):
        with pytest.raises(DataError, match=rf"{name}: {words}.*TIFF"):
            find_images(str(target))


def test_thumbnails_in_a_tiff_are_not_taken(tmp_path: Path) -> None:
    first = write(tmp_path / "a0.tif", picture(), picture((6, 8)))
    write(tmp_path / "a1.tif", picture((6, 8)), picture())
    assert full_pages(first) == [0]
    address = f"files:{tmp_path}"
    assert picture_names(parse_address(address)) == [("a0.tif", 0), ("a1.tif", 1)]
    with open_camera(address) as camera:
        assert "a0.tif: 1 of 2 pages are taken, the others are smaller" in camera.info.warnings[0]
        assert [(frame.damaged, frame.image.shape) for frame in camera] == [(False, (12, 16))] * 2


@pytest.mark.parametrize(("number", "name"), [(50000, "ZSTD"), (34925, "LZMA")])
def test_a_compression_that_is_not_read_is_named(tmp_path: Path, number: int, name: str) -> None:
    path = write(tmp_path / "a.tif", picture())
    content = path.read_bytes()
    entry = next(k for k in range(len(content)) if content[k : k + 4] == struct.pack("<HH", 259, 3))
    path.write_bytes(content[: entry + 8] + struct.pack("<H", number) + content[entry + 10 :])
    with pytest.raises(DataError, match=f"compressed with {name}, which cannot be read; save it with LZW"):
        open_camera(f"files:{path}")


def test_times_of_files_and_of_exif(tmp_path: Path) -> None:
    shots = [write(tmp_path / f"IMG_{k:04d}.jpg", picture()) for k in (9999, 1)]
    for second, path in enumerate(reversed(shots)):  # copied: in the order of the alphabet
        os.utime(path, (second, second))
    with pytest.raises(ConfigError, match="do not say which comes first"):
        find_images(str(tmp_path))
    for second, path in enumerate(shots):
        exif = b"Exif\0\0" + b"2025:11:25 10:15:%02d\0" % second
        marker = b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif
        path.write_bytes(b"\xff\xd8" + marker + path.read_bytes()[2:])
    assert taken_times(shots) == [20251125101500.0, 20251125101501.0]
    assert names(str(tmp_path)) == ["IMG_9999.jpg", "IMG_0001.jpg"]
    assert names(str(tmp_path), by="name") == ["IMG_0001.jpg", "IMG_9999.jpg"]


@pytest.mark.parametrize("quality", [30, 75, 92])
def test_steps_of_a_jpeg_are_those_of_its_tables(tmp_path: Path, quality: int) -> None:
    coded = cv2.imencode(".jpg", picture((40, 40)), [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()
    steps = quantisation(coded)
    assert steps is not None
    scale = 5000 // quality if quality < 50 else 200 - 2 * quality
    first_row = [16, 11, 10, 16, 24, 40, 51, 61]  # ITU-T T.81, table K.1
    assert list(steps[:8]) == [max(1, (scale * step + 50) // 100) for step in first_row]
    assert steps[8] == max(1, (scale * 12 + 50) // 100)
    assert quantisation(coded[:40]) is None
    assert quantisation(b"no picture") is None
    (tmp_path / "a.jpg").write_bytes(coded)
    assert open_camera(f"files:{tmp_path}").info.controls[QUANTISATION] == steps


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
        *((name, code, False) for name in ("a.avi", "a.mkv") for code in ("MJPG", "FFV1")),
        *(("a.avi", code, False) for code in ("HFYU", "I420", "PNG ")),
        ("a.avi", "XVID", True), ("a.mp4", "mp4v", True), ("a.avi", "MPEG", True), ("a.webm", "VP80", True),
        ("a.mkv", "VP90", True),
    ],
)  # fmt: skip
def test_which_codecs_hold_motion_back(tmp_path: Path, name: str, code: str, inter_frame: bool) -> None:
    with open_camera(f"video:{film(tmp_path / name, code)}") as camera:
        assert camera.info.controls["inter_frame"] is inter_frame
        assert (FILM_WARNING in camera.info.warnings) is inter_frame
        assert not any("read as 8" in text for text in camera.info.warnings)
        assert (QUANTISATION in camera.info.controls) is (code == "MJPG")


def test_a_colour_film_without_a_choice_is_named_once(tmp_path: Path) -> None:
    told: list[Event] = []
    path = film(tmp_path / "a.mkv", "FFV1")
    for gray in ("", "?gray=g"):
        with open_camera(f"video:{path}{gray}", told.append) as camera:
            assert len(list(camera)) == 6
    assert ["red, green and blue differ by 1" in event.text for event in told] == [True]


def test_a_film_of_more_than_8_bits_is_named(tmp_path: Path) -> None:
    path, size = tmp_path / "a.mkv", (64, 48)
    depth = (cv2.VIDEOWRITER_PROP_DEPTH, cv2.CV_16U, cv2.VIDEOWRITER_PROP_IS_COLOR, 0)
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter_fourcc(*"FFV1"), 10, size, depth)
    if not writer.isOpened():
        pytest.skip("no films of 16 bits here")
    writer.write(np.full(size[::-1], 30000, np.uint16))
    writer.release()
    with open_camera(f"video:{path}") as camera:
        assert [text.partition(",")[0] for text in camera.info.warnings] == ["film of 16 bits"], "it is grey"
    with open_camera(f"video:{film(tmp_path / 'b.mkv', 'FFV1')}") as camera:
        assert camera.info.warnings == (WEBCAM_WARNING,)


@pytest.mark.parametrize("fields", [0.0, 0.5])
def test_an_interlaced_film_is_named_once(tmp_path: Path, fields: float) -> None:
    """``fields``: time between odd and even rows over that between pictures."""
    speckle, told, size = Speckle((96, 128), radius=2.0, seed=5), list[Event](), (128, 96)
    path = tmp_path / "a.avi"
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter_fourcc(*"MJPG"), 25, size)
    for k in range(12):
        early, late = (255 * speckle.render(Affine(0.1 * t, 0.3 * t), (96, 128)) for t in (k, k + fields))
        picture = np.where(np.arange(96)[:, None] % 2, late, early)
        writer.write(np.repeat(np.rint(picture).astype(np.uint8)[:, :, None], 3, axis=2))
    writer.release()
    with open_camera(f"video:{path}", told.append) as camera:
        assert len(list(camera)) == 12
    assert ["rows are 0.1" in event.text for event in told] == [True] * bool(fields)


@pytest.mark.parametrize(("code", "name"), [("FFV1", "a.mkv"), ("VP80", "a.webm")])
def test_frames_are_counted_where_the_container_does_not(tmp_path: Path, code: str, name: str) -> None:
    told: list[Event] = []
    with open_camera(f"video:{film(tmp_path / name, code, 7)}?gray=luma", told.append) as camera:
        assert camera.info.controls["frames"] == 7
        assert len(list(camera)) == 7
    assert told == []


def test_a_film_is_begun_later_and_timed_anew(tmp_path: Path) -> None:
    path, told = film(tmp_path / "a.mkv", "FFV1", 7), list[Event]()
    with open_camera(f"video:{path}") as camera:
        whole = list(camera)
    with open_camera(f"video:{path}?first=3&fps=1000&gray=luma", told.append) as camera:
        assert (camera.info.fps, camera.info.controls["frames"]) == (1000, 5)
        frames = list(camera)
    assert [f.t for f in frames] == [k / 1000 for k in range(5)] and told == []
    assert all((a.image == b.image).all() for a, b in zip(frames, whole[2:], strict=True))
    with pytest.raises(DataError, match="has 7 pictures, none with number 8"):
        open_camera(f"video:{path}?first=8")


def test_a_film_that_is_cut_off_is_told(tmp_path: Path) -> None:
    path = film(tmp_path / "a.mkv", "FFV1", 12)
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 2 // 3])
    told: list[Event] = []
    with open_camera(f"video:{path}?gray=luma", told.append) as camera:
        there = len(list(camera))
        assert camera.info.controls["frames"] == there < 12
    assert told[0].data == {"missing": 12 - there}
