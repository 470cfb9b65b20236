"""Pictures of a folder, a pattern or a TIFF as a camera."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from acquire.addresses import parse_address
from acquire.camera.contract import open_camera
from acquire.errors import ConfigError, DataError, PhasedicError
from acquire.events import Event
from acquire.files.headers import full_pages
from acquire.files.picture import to_gray
from acquire.opencv import images
from acquire.opencv.image_metadata import read_stamps
from acquire.opencv.images import MAX_REPORTED, picture_names, picture_times, read_image


def picture(value: int = 0, shape: tuple[int, ...] = (12, 16), dtype: type = np.uint8) -> NDArray[Any]:
    return (np.arange(np.prod(shape)).reshape(shape) + value).astype(dtype)


def write(path: Path, image: NDArray[Any]) -> Path:
    assert cv2.imwrite(str(path), image)
    return path


@pytest.mark.parametrize(
    ("suffix", "dtype"),
    [("tif", np.uint8), ("tif", np.uint16), ("png", np.uint8), ("png", np.uint16), ("bmp", np.uint8)],
)
def test_pictures_come_as_they_were_written(tmp_path: Path, suffix: str, dtype: type) -> None:
    images = [picture(k, dtype=dtype) for k in range(3)]
    for k, image in enumerate(images):
        write(tmp_path / f"shot_{k}.{suffix}", image)
    with open_camera(f"files:{tmp_path}/*.{suffix}?fps=5") as camera:
        frames = list(camera)
    assert [frame.index for frame in frames] == [0, 1, 2]
    assert [frame.t for frame in frames] == [0.0, 0.2, 0.4]
    assert all(frame.clock == "nominal" and not frame.image.flags.writeable for frame in frames)
    for frame, image in zip(frames, images, strict=True):
        assert frame.image.dtype == dtype
        assert np.array_equal(frame.image, image)
    assert (camera.info.width, camera.info.height, camera.info.live) == (16, 12, False)


def test_natural_order_and_a_folder_without_its_other_files(tmp_path: Path) -> None:
    for k in (10, 9, 1, 2):
        write(tmp_path / f"s{k}.png", np.full((4, 4), k, np.uint8))
    (tmp_path / "notes.txt").write_text("not an image")
    with open_camera(f"files:{tmp_path}") as camera:
        assert [int(frame.image[0, 0]) for frame in camera] == [1, 2, 9, 10]


def test_a_name_with_brackets_is_not_taken_for_a_glob(tmp_path: Path) -> None:
    write(tmp_path / "shot[1].png", picture())
    with open_camera(f"files:{tmp_path}/shot[1].png") as camera:
        assert len(list(camera)) == 1


def test_every_page_of_a_multi_page_tiff(tmp_path: Path) -> None:
    pages = [picture(k, dtype=np.uint16) for k in (5, 300, 3900)]
    path = tmp_path / "stack.tif"
    assert cv2.imwritemulti(str(path), pages)
    assert full_pages(path) == [0, 1, 2]
    with open_camera(f"files:{path}?bits=12") as camera:
        frames = list(camera)
    assert [np.array_equal(f.image, p) for f, p in zip(frames, pages, strict=True)] == [True] * 3
    assert camera.info.bits == 12


def test_equal_channels_are_grey(tmp_path: Path) -> None:
    image = picture()
    write(tmp_path / "a.png", np.dstack([image] * 3))
    assert np.array_equal(read_image(tmp_path / "a.png"), image)


@pytest.mark.parametrize("other", [0, 1, 2])
def test_two_equal_channels_of_three_are_no_grey(other: int) -> None:
    channels = [picture(1)] * 3
    channels[other] = picture(2)
    with pytest.raises(ConfigError, match="gray=luma"):
        to_gray(np.dstack(channels), None, "a.png")
    assert np.array_equal(to_gray(np.dstack(channels), "bgr"[other], "a.png"), channels[other])


def test_colour_has_to_be_chosen(tmp_path: Path) -> None:
    blue, green, red = picture(1), picture(50), picture(30)
    path = write(tmp_path / "a.png", np.dstack([blue, green, red]))
    with pytest.raises(ConfigError, match="gray=luma"):
        open_camera(f"files:{path}")
    assert np.array_equal(read_image(path, "r"), red)
    assert np.array_equal(read_image(path, "b"), blue)
    luma = 0.299 * red + 0.587 * green + 0.114 * blue
    assert np.abs(read_image(path, "luma") - luma).max() <= 0.51
    with pytest.raises(ConfigError, match="luma, r, g, b"):
        open_camera(f"files:{path}?gray=alpha")


def test_a_picture_that_is_broken_or_of_another_size_is_damaged_and_told(tmp_path: Path) -> None:
    for k in range(4):
        write(tmp_path / f"a{k}.png", picture())
    write(tmp_path / "a1.png", picture(shape=(12, 20)))
    (tmp_path / "a2.png").write_text("this is no image")
    told: list[Event] = []
    with open_camera(f"files:{tmp_path}/*.png?fps=2", told.append) as camera:
        frames = list(camera)
    assert [frame.damaged for frame in frames] == [False, True, True, False]
    assert [(frame.index, frame.image.shape) for frame in frames] == [(k, (12, 16)) for k in range(4)]
    assert not frames[1].image.any()
    assert "a1.png is 20x12 uint8, but" in told[0].text
    assert "a2.png: not an image" in told[1].text
    assert all(event.text.endswith("this picture is left out") for event in told)
    assert [event.data for event in told] == [{"t": 0.5, "file": "a1.png"}, {"t": 1.0, "file": "a2.png"}]


def test_a_folder_of_rubbish_is_not_told_picture_by_picture(tmp_path: Path) -> None:
    write(tmp_path / "a.png", picture())
    for k in range(50):
        (tmp_path / f"b{k}.png").write_text("no image")
    told: list[Event] = []
    with open_camera(f"files:{tmp_path}/*.png", told.append) as camera:
        assert sum(frame.damaged for frame in camera) == 50
    assert len(told) == MAX_REPORTED + 1
    assert told[-1].text == "50 pictures were left out in all"


def test_a_page_that_is_broken_leaves_the_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert cv2.imwritemulti(str(tmp_path / "stack.tif"), [picture() for _ in range(3)])
    read, sources = images.read_picture_page, []

    def broken(path: Path, source: Any, page: int) -> Any:
        sources.append(id(source))
        if page == 1:
            raise DataError("page 1 is broken")
        return read(path, source, page)

    with open_camera(f"files:{tmp_path}/stack.tif") as camera:
        monkeypatch.setattr(images, "read_picture_page", broken)
        assert [frame.damaged for frame in camera] == [False, True, False]
    assert len(set(sources)) == 1, "the file is read once"


@pytest.mark.parametrize("suffix", ["tif", "png", "bmp", "jpg"])
def test_a_truncated_file_is_named(tmp_path: Path, suffix: str) -> None:
    path = write(tmp_path / f"a.{suffix}", picture(shape=(60, 80)))
    path.write_bytes(path.read_bytes()[:-400])
    with pytest.raises(DataError, match=f"a.{suffix}: .*cut off"):
        open_camera(f"files:{path}")


def test_what_is_no_picture_of_a_camera_is_named(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no image there"):
        open_camera(f"files:{tmp_path}/*.tif")
    path = write(tmp_path / "a.tif", np.ones((4, 4), np.float32))
    with pytest.raises(DataError, match="float32"):
        open_camera(f"files:{path}")
    path.write_text("this is no image")
    with pytest.raises(DataError, match=r"a\.tif: not an image"):
        open_camera(f"files:{path}")


@pytest.mark.parametrize(("most", "bits"), [(1023, 9), (1024, 10)])
def test_bits_are_checked(tmp_path: Path, most: int, bits: int) -> None:
    path = write(tmp_path / "a.png", np.array([[0, most], [5, 6]], np.uint16))
    with pytest.raises(DataError, match=f"{most} does not fit into bits={bits}"):
        open_camera(f"files:{path}?bits={bits}")
    assert open_camera(f"files:{path}?bits={bits + 1}").info.warnings == ()
    assert open_camera(f"files:{path}").info.bits == 16


def test_jpeg_is_warned_about(tmp_path: Path) -> None:
    path = write(tmp_path / "a.jpg", picture(shape=(40, 40)))
    assert "lossy" in open_camera(f"files:{path}").info.warnings[0]


ODD_ROWS = (("a.png,5,1\nb.png,6,2\n", 1), ("1\n\n2,3,4\n", 2), ("x,y\na,b\n", 1))
"""A time stands alone or behind one name."""


def stamped(folder: Path, text: str) -> str:
    """The address of three pictures with these times."""
    for name in "abc":
        write(folder / f"{name}.png", picture())
    (folder / "times.csv").write_text(text)
    return f"files:{folder}/*.png?stamps={folder}/times.csv"


@pytest.mark.parametrize(
    "text",
    [
        "0.5\n1.5\n1.75\n",
        "time_s\n0.5\n1.5\n1.75\n",
        "# log\nfile,time_s\nb.png,1.5\na.png,0.5\nc.png,1.75\n",
    ],
)
def test_times_from_a_csv(tmp_path: Path, text: str) -> None:
    with open_camera(stamped(tmp_path, text)) as camera:
        assert [frame.t for frame in camera] == [0.5, 1.5, 1.75]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1\n2\n", "2 times for 3"),
        ("1\n2\n1\n", "backwards"),
        ("a.png,1\nb.png,2\n", "no time for c.png"),
        ("1\nx\n2\n", "row 2"),
        ("1\nnan\n2\n", "row 2"),
        ("", "0 times"),
        *((text, rf"row {row} of the times is .*; wanted: \[file name,\] s") for text, row in ODD_ROWS),
    ],
)
def test_times_that_do_not_fit(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(DataError, match=message):
        open_camera(stamped(tmp_path, text))


def test_two_pictures_may_have_one_time(tmp_path: Path) -> None:
    (tmp_path / "times.csv").write_text("1\n1\n2\n")
    assert read_stamps(tmp_path / "times.csv", [Path(name) for name in "abc"]) == [1.0, 1.0, 2.0]


def test_pictures_by_name_have_the_times_of_their_frames(tmp_path: Path) -> None:
    for name in ("s2", "s10", "s1"):
        write(tmp_path / f"{name}.png", picture())
    address = parse_address(f"files:{tmp_path}/*.png?fps=4")
    times = picture_times(address)
    assert times == {"s1.png": 0.0, "s2.png": 0.25, "s10.png": 0.5}
    with open_camera(address.text) as camera:
        assert [frame.t for frame in camera] == list(times.values())
    (tmp_path / "times.csv").write_text("3\n5\n9\n")
    stamped = parse_address(f"files:{tmp_path}/*.png?stamps={tmp_path}/times.csv")
    assert picture_times(stamped) == {"s1.png": 3.0, "s2.png": 5.0, "s10.png": 9.0}


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.sampled_from(["tif", "png", "bmp"]),
    st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 255)), max_size=6),
    st.floats(0, 1),
)
def test_damaged_files_give_an_error_or_a_picture(
    tmp_path: Path, suffix: str, flips: list[tuple[int, int]], kept: float
) -> None:
    path = write(tmp_path / f"a.{suffix}", picture(shape=(24, 31)))
    content = bytearray(path.read_bytes())
    for where, value in flips:
        content[where % len(content)] = value
    path.write_bytes(content[: int(len(content) * kept)])
    try:
        with open_camera(f"files:{path}?gray=luma") as camera:
            assert all(frame.image.ndim == 2 for frame in camera)
    except PhasedicError as error:
        assert "a." in str(error)


def test_real_photographs_are_read_as_grey(data_dir: Path) -> None:
    folder = data_dir / "dic_challenge_1_sample12_ohtcfrp"
    with open_camera(f"files:{folder}/*.tiff") as camera:
        frames = list(camera)
    assert len(frames) == 6
    assert {frame.image.shape for frame in frames} == {(1040, 400)}


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_one_plane_is_grey_whatever_is_asked_for(dtype: type) -> None:
    one = picture(dtype=dtype)
    for gray in (None, "luma", "r"):
        assert np.array_equal(to_gray(one[:, :, np.newaxis], gray, "a.png"), one)
        assert to_gray(one, gray, "a.png") is one


def test_alpha_is_ignored() -> None:
    one, other = picture(1), picture(9)
    assert np.array_equal(to_gray(np.dstack([one, one, one, other]), None, "a.png"), one)
    assert np.array_equal(to_gray(np.dstack([one, other, one, one]), "g", "a.png"), other)


@pytest.mark.parametrize("shape", [(3, 4, 2), (3, 4, 5), (3,), (2, 3, 4, 3)])
def test_what_is_neither_grey_nor_colour(shape: tuple[int, ...]) -> None:
    with pytest.raises(DataError, match="is neither grey nor colour"):
        to_gray(np.zeros(shape, np.uint8), "luma", "a.png")


@pytest.mark.parametrize(
    ("most", "words"),
    [
        (255, ""),
        (256, "if the camera has 10 bits say bits=10"),
        (1023, "if the camera has 10 bits say bits=10"),
        (1024, "if the camera has 12 bits say bits=12"),
        (4096, "if the camera has 14 bits say bits=14"),
        (16384, ""),
    ],
)
def test_the_bits_of_16_bit_files_are_guessed_from_the_largest_value(
    tmp_path: Path, most: int, words: str
) -> None:
    path = write(tmp_path / "a.png", np.array([[0, most]], np.uint16))
    (warning, *_) = (*open_camera(f"files:{path}").info.warnings, "")
    assert words in warning and bool(words) == bool(warning)


@pytest.mark.parametrize("suffix", [".tif", ".tiff", ".png", ".bmp", ".jpg", ".jpeg", ".pgm", ".PNG"])
def test_pictures_of_a_folder_by_their_endings(tmp_path: Path, suffix: str) -> None:
    write(tmp_path / f"a{suffix}", picture())
    (tmp_path / "a.csv").touch()
    info = open_camera(f"files:{tmp_path}").info
    assert (info.name, info.fps, info.clock) == (f"1 image file, a{suffix} ...", 1.0, "nominal")
    assert info.pixel_format == suffix[1:].upper()


def test_pages_have_their_places_and_two_of_a_name_no_times(tmp_path: Path) -> None:
    write(tmp_path / "b.png", picture())
    assert cv2.imwritemulti(str(tmp_path / "a.tif"), [picture(), picture()])
    address = parse_address(f"files:{tmp_path}/*.*")
    assert picture_names(address) == [("a.tif", 0), ("a.tif", 1), ("b.png", 0)]
    with pytest.raises(ConfigError, match="share a name, or one has several pages"):
        picture_times(address)
    (tmp_path / "times.csv").write_text("1\n2\n")
    with open_camera(f"files:{tmp_path}/*.[tp]*?stamps={tmp_path}/times.csv") as camera:
        frames = iter(camera)
        assert [next(frames).t for _ in range(2)] == [1.0, 2.0]
        with pytest.raises(DataError, match="2 times, but there are more pictures"):
            next(frames)


def directories(order: str, *offsets: int, big: bool = False) -> bytes:
    """A TIFF of empty directories, each with the offset of the next."""
    head = b"II" if order == "<" else b"MM"
    if big:
        head += struct.pack(f"{order}HHHQ", 43, 8, 0, 16)
        return head + b"".join(struct.pack(f"{order}QQ", 0, offset) for offset in offsets)
    head += struct.pack(f"{order}HI", 42, 8)
    return head + b"".join(struct.pack(f"{order}HI", 0, offset) for offset in offsets)


@pytest.mark.parametrize("order", ["<", ">"])
def test_pages_of_a_tiff_are_its_directories(tmp_path: Path, order: str) -> None:
    path = tmp_path / "a.tif"
    for content, count in (
        (directories(order, 0), 1),
        (directories(order, 14, 20, 0), 3),
        (directories(order, 0, big=True), 1),
        (directories(order, 32, 48, 0, big=True), 3),
        (b"no TIFF at all, whatever it is", 1),
    ):
        path.write_bytes(content)
        assert full_pages(path) == [*range(count)]
    for content in (directories(order, 14, 8), directories(order, 8), directories(order, 32, 16, big=True)):
        path.write_bytes(content)
        with pytest.raises(DataError, match="the directories of this TIFF run in a circle; save it anew"):
            full_pages(path)
    for content in (directories(order, 999), directories(order, 2**63, big=True)):
        path.write_bytes(content)
        with pytest.raises(DataError, match="a TIFF that is cut off"):
            full_pages(path)
    path.rename(tmp_path / "a.png")
    assert full_pages(tmp_path / "a.png") == [0]


@pytest.mark.parametrize(
    ("step", "words"), [(16, "12 bits say white=65520"), (64, "10 bits say white=65472"), (1, "")]
)
def test_bits_in_the_high_bits_of_16_are_seen(tmp_path: Path, step: int, words: str) -> None:
    levels = 2**15 + step * np.arange(1000 if step < 64 else 500).reshape(20, -1)
    path = write(tmp_path / "a.tif", levels.astype(np.uint16))
    (warning, *_) = (*open_camera(f"files:{path}").info.warnings, "")
    assert words in warning and bool(words) == bool(warning)
    assert open_camera(f"files:{path}?white={65536 - step}").info.warnings == ()


def test_a_link_to_nothing_is_left_out(tmp_path: Path) -> None:
    for k in range(3):
        cv2.imwrite(str(tmp_path / f"{k}.tif"), np.full((20, 30), 100 + k, np.uint8))
    (tmp_path / "1a.tif").symlink_to(tmp_path / "nowhere.tif")
    told: list[Event] = []
    with open_camera(f"files:{tmp_path}", told.append) as camera:
        assert [int(frame.image[0, 0]) for frame in camera if not frame.damaged] == [100, 101, 102]
    assert "1a.tif: cannot be read: No such file or directory" in told[0].text
