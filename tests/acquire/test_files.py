"""Picture files that are damaged, odd or large, and the folder of a run."""

from __future__ import annotations

import os
import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from acquire.camera.contract import with_scheme
from acquire.errors import DataError
from acquire.files.picture import (
    check_regular,
    decode,
    picture_source,
    read_bytes,
    read_picture,
    write_picture,
)
from acquire.text.message import printable


def smooth(dtype: type = np.uint8) -> np.ndarray:
    noise = np.random.default_rng(0).normal(size=(480, 640)).astype(np.float32)
    blurred = cv2.GaussianBlur(noise, (0, 0), 2)
    return cv2.normalize(blurred, None, 0, 255, cv2.NORM_MINMAX).astype(dtype)


@pytest.fixture(params=["pipe", "folder", "device", "socket"])
def odd(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Path]:
    path = tmp_path / "a.png"
    if request.param == "pipe":
        os.mkfifo(path)
    elif request.param == "folder":
        path.mkdir()
    elif request.param == "device":
        path.symlink_to("/dev/zero")
    else:
        import socket

        with socket.socket(socket.AF_UNIX) as end:
            end.bind(str(path))
            yield path
        return
    yield path


def test_what_is_no_regular_file_is_refused_unopened(odd: Path) -> None:
    for read in (check_regular, read_bytes, read_picture):
        with pytest.raises(DataError, match=r"a\.png: cannot be read: it is a"):
            read(odd)


def test_a_name_that_is_not_utf8(tmp_path: Path) -> None:
    path = Path(os.fsdecode(os.fsencode(tmp_path) + b"/\xff\xfe.png"))
    write_picture(path, smooth())
    assert np.array_equal(read_picture(path), smooth())
    assert printable(path).endswith("/\\xff\\xfe.png")
    with pytest.raises(DataError, match="cannot be written: File exists"):
        write_picture(path, smooth())


@pytest.mark.parametrize(
    "compression", [5, 8, 32773, 32946], ids=["lzw", "deflate", "packbits", "old deflate"]
)
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_a_zeroed_part_of_a_tiff_is_told(tmp_path: Path, compression: int, dtype: type) -> None:
    content = bytearray(
        cv2.imencode(".tif", smooth(dtype), [cv2.IMWRITE_TIFF_COMPRESSION, compression])[1].tobytes()
    )
    end = len(content) - 600  # the directory stands at the end
    content[end // 2 : end] = bytes(end - end // 2)
    path = tmp_path / "a.tif"
    path.write_bytes(content)
    with pytest.raises(DataError, match=r"a\.tif: (a damaged image|not an image)"):
        read_picture(path)


def test_a_jpeg_damaged_in_its_middle_is_told(tmp_path: Path) -> None:
    content = bytearray(cv2.imencode(".jpg", smooth())[1].tobytes())
    content[5000:9000] = bytes(4000)
    path = tmp_path / "a.jpg"
    path.write_bytes(content)
    with pytest.raises(DataError, match=r"a damaged image \(Corrupt JPEG data"):
        read_picture(path)


def test_what_others_say_meanwhile_is_passed_on(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    content = cv2.imencode(".png", smooth())[1].tobytes()
    inner = cv2.imdecode

    def talkative(*arguments: object) -> object:
        os.write(2, b"a word of another thread\n")
        return inner(*arguments)

    monkeypatch.setattr(cv2, "imdecode", talkative)
    decoded = decode(content)
    assert decoded.picture is not None
    assert decoded.damage == ""
    assert capfd.readouterr().err == "a word of another thread\n"


def test_decoding_without_a_standard_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "__stderr__", None)
    assert decode(cv2.imencode(".png", smooth())[1].tobytes()).damage == ""


def test_a_limit_of_size(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_bytes(bytes(100))
    assert read_bytes(path, 100) == bytes(100)
    with pytest.raises(DataError, match="more than"):
        read_bytes(path, 99)


def test_the_folder_of_a_run_is_its_session(tmp_path: Path) -> None:
    """It also holds mask.png, which is no picture of a test."""
    run, shots = tmp_path / "run", tmp_path / "shots"
    for folder in (run, shots):
        folder.mkdir()
        (folder / "mask.png").touch()
    (run / "session.h5").touch()
    assert with_scheme(str(run)) == f"session:{run}/session.h5"
    assert with_scheme(f"{run}?fps=5") == f"session:{run}/session.h5?fps=5"
    assert with_scheme(str(shots)) == f"files:{shots}"


def test_a_file_of_two_gigabytes_is_decoded_by_its_name(tmp_path: Path) -> None:
    """OpenCV takes no more of them from memory; nothing of it is read here."""
    path, odd = tmp_path / "a.tif", Path(os.fsdecode(os.fsencode(tmp_path) + b"/\xff.tif"))
    for one in (path, odd):
        with one.open("wb") as file:
            file.truncate(2**31)
    assert picture_source(path) == str(path)
    with pytest.raises(DataError, match="more than 2 GB is read by its name, which must be UTF-8; rename it"):
        picture_source(odd)
    with pytest.raises(DataError, match="2\u202f147 MB are more than the 2\u202f147 MB such a file may have"):
        read_bytes(path)


def test_a_cut_off_jpeg_is_seen_by_its_end(tmp_path: Path) -> None:
    path, content = tmp_path / "a.jpg", cv2.imencode(".jpg", smooth())[1].tobytes()
    for more in (b"", b"\0" * 20):
        path.write_bytes(content + more)
        assert read_picture(path).shape == (480, 640)
    for broken in (content[:-1], content + b"x", content[:-2]):
        path.write_bytes(broken)
        with pytest.raises(DataError, match=r"a\.jpg: not an image, or cut off"):
            read_picture(path)


def test_a_picture_is_written_as_its_name_says(tmp_path: Path) -> None:
    for name in ("a.png", "a.TIF"):
        write_picture(tmp_path / name, smooth(np.uint16))
        assert np.array_equal(read_picture(tmp_path / name), smooth(np.uint16))
    for name, words in (
        ("a.xyz", "no format of pictures has such an ending"),
        ("no/a.png", "cannot be written"),
    ):
        with pytest.raises(DataError, match=words):
            write_picture(tmp_path / name, smooth())
    with pytest.raises(DataError, match="cannot be written: File exists; look at the folder and the disk"):
        write_picture(tmp_path / "a.png", smooth())


def test_a_picture_beyond_the_limit_is_not_called_damaged(tmp_path: Path) -> None:
    side, path = 2**14 + 1, tmp_path / "a.tif"
    entries = [(256, 4, side), (257, 4, side), (258, 3, 8), (259, 3, 1), (262, 3, 1), (273, 4, 200), (277, 3, 1),
               (278, 4, side), (279, 4, side * side)]  # fmt: skip
    head = b"II*\0" + struct.pack("<IH", 8, len(entries))
    path.write_bytes(
        head + b"".join(struct.pack("<HHII", tag, kind, 1, value) for tag, kind, value in entries) + bytes(4)
    )
    with path.open("r+b") as file:
        file.truncate(200 + side * side)
    code = f"from acquire.files.picture import read_picture; read_picture(__import__('pathlib').Path({str(path)!r}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "DataError" in done.stderr and "more than 268 million pixels" in done.stderr
