"""Bursts, thinning, cropping and rotation: what is left out is left out on purpose, the rest is exact."""

from __future__ import annotations

import contextlib
import dataclasses
from pathlib import Path

import numpy as np
import pytest

from acquire.errors import ConfigError, DataError
from acquire.frame import Burst, CameraInfo
from acquire.record_mode import RecordMode
from acquire.session import RotatingWriter, Session
from tests.acquire.session.fixtures import CAMERA, START, bursts_of, frame, info, sample, writer
from tests.clock import Clock

EIGHT_BIT = dataclasses.replace(CAMERA, bits=8)


def assert_same_burst(a: Burst, b: Burst) -> None:
    np.testing.assert_array_equal(a.mean, b.mean)
    np.testing.assert_array_equal(a.clipped, b.clipped)
    assert not b.mean.flags.writeable and b.mean.dtype == np.float32 and b.clipped.dtype == np.bool_
    for field in dataclasses.fields(Burst):
        if field.name not in ("mean", "clipped"):
            np.testing.assert_equal(getattr(a, field.name), getattr(b, field.name))


@pytest.mark.parametrize("n", [1, 3, 7, 32])
@pytest.mark.parametrize("camera", [CAMERA, EIGHT_BIT], ids=["12 bit", "8 bit"])
def test_bursts_come_back_bit_equal(path: Path, camera: CameraInfo, n: int) -> None:
    bursts = bursts_of(n, 3, camera)
    with writer(path, camera, mode=RecordMode("bursts"), burst_frames=n) as session:
        assert [session.write_burst(burst) for burst in bursts] == [0, 1, 2]
    with Session.open(path) as back:
        assert back.mode.kind == "bursts" and back.burst_count == 3 and len(back) == 0
        for a, b in zip(bursts, back.bursts(), strict=True):
            assert_same_burst(a, b)


def test_a_burst_waits_for_the_disk_with_all_its_frames(path: Path) -> None:
    clock = Clock()
    with writer(path, now=clock, mode=RecordMode("bursts"), burst_frames=7) as session:
        for burst, clock.now_s in zip(bursts_of(7, 3), (1.0, 1.02, 1.04), strict=True):
            session.write_burst(burst)
        assert session.unflushed_frames == 14
        session.flush()
        assert session.unflushed_frames == 0


def test_a_burst_that_does_not_fit_is_refused(path: Path) -> None:
    burst = bursts_of(3, 1)[0]
    odd = dataclasses.replace(burst, mean=burst.mean + np.float32(0.1))
    with writer(path, burst_frames=16) as session:
        with pytest.raises(ValueError, match="fit"):
            session.write_burst(bursts_of(32, 1)[0])
        with pytest.raises(ValueError, match="no mean of whole"):
            session.write_burst(odd)


def test_a_part_of_the_picture(path: Path) -> None:
    path, mode = path, RecordMode("all", crop=(3, 2, 8, 5))
    burst = bursts_of(4, 1)[0]
    with writer(path, mode=mode) as session:
        session.write_frame(frame(0))
        session.write_burst(burst)
    with Session.open(path) as back:
        assert (back.camera.width, back.camera.height) == (8, 5)
        assert back.mode.crop == (3, 2, 8, 5)
        np.testing.assert_array_equal(back.frame(0).image, frame(0).image[2:7, 3:11])
        np.testing.assert_array_equal(back.burst(0).mean, burst.mean[2:7, 3:11])


def test_a_crop_outside_the_picture_is_refused_before_there_is_a_file(path: Path) -> None:
    with pytest.raises(ConfigError, match="leaves the picture"):
        writer(path, mode=RecordMode(crop=(-1, 0, 4, 4)))
    assert not path.exists()


@pytest.mark.parametrize(
    ("crop", "inside"),
    [
        *((crop, True) for crop in ((0, 0, 40, 30), (39, 29, 1, 1), (10, 0, 30, 1), (0, 20, 1, 10))),
        *((crop, False) for crop in ((0, 0, 41, 30), (0, 0, 40, 31), (40, 0, 1, 1), (0, 30, 1, 1))),
        *((crop, False) for crop in ((0, -1, 5, 5), (-1, 0, 5, 5), (0, 0, 5, 0), (0, 0, 0, 5))),
    ],
)
def test_a_crop_reaches_to_the_edges_and_not_beyond(crop: tuple[int, int, int, int], inside: bool) -> None:
    words = r"leaves the picture of 40 x 30 px; give x,y,width,height"
    with contextlib.nullcontext() if inside else pytest.raises(ConfigError, match=words):
        RecordMode(crop=crop).check(40, 30)


def test_what_is_cut_out_is_x_y_width_height() -> None:
    image = np.arange(12).reshape(3, 4)
    assert RecordMode(crop=(1, 0, 2, 3)).cut(image).tolist() == [[1, 2], [5, 6], [9, 10]]
    assert RecordMode().cut(image) is image


@pytest.mark.parametrize(
    ("text", "kind", "kept"),
    [("all", "all", [0, 1, 2, 3, 4]), ("every=2", "every", [0, 2, 4]), ("bursts", "bursts", [])],
)
def test_modes(text: str, kind: str, kept: list[int]) -> None:
    mode = RecordMode.parse(text, (1, 2, 3, 4))
    assert [k for k in range(5) if mode.keeps(k)] == kept
    assert (mode.kind, mode.crop, mode.text()) == (kind, (1, 2, 3, 4), text)


@pytest.mark.parametrize(
    "text",
    ["", "some", "all ", "bursts2", "every=", "every=0", "every=1.5", "every=-1", "every=2x", "every=2 ", "xevery=2",
     "every=1234567890"],
)  # fmt: skip
def test_other_modes_are_refused(text: str) -> None:
    with pytest.raises(ConfigError) as caught:
        RecordMode.parse(text)
    assert "allowed: 'all', 'bursts', 'every=K' or 'cycles=K' with K from 1" in str(caught.value)


# -- rotation ---------------------------------------------------------------------------------


def rotated(folder: Path, frames: int = 10, limit: int = 3 * 16 * 12 * 2) -> Path:
    path = folder / "session.h5"
    with RotatingWriter(path, info(), limit) as session:
        for k in range(frames):
            session.write_load(sample(k))
            assert session.write_frame(frame(k)) == k
        session.write_ledger({"grabbed": frames})
    return path


def test_bytes_are_counted_through_all_files(path: Path) -> None:
    picture = 16 * 12 * 2
    with RotatingWriter(path, info(), 2 * picture) as session:
        for k in range(5):
            session.write_frame(frame(k))
            assert session.bytes_written == (k + 1) * picture
        assert session.path.name == "session.002.h5"


@pytest.mark.parametrize("opened", ["session.h5", "session.001.h5", "session.003.h5"])
def test_a_rotated_set_opens_as_one(tmp_path: Path, opened: str) -> None:
    rotated(tmp_path)
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        "session.001.h5", "session.002.h5", "session.003.h5", "session.h5"
    ]  # fmt: skip
    with Session.open(tmp_path / opened) as back:
        assert len(back) == 10 and back.indices.tolist() == list(range(5, 15))
        for k, found in enumerate(back.frames()):
            np.testing.assert_array_equal(found.image, frame(k).image)
        assert len(back.load_samples()) == 10
        assert back.frame_counts == {"grabbed": 10} and back.clock_pairs == [START]
        assert back.recovered is None


def test_a_missing_file_of_a_set_is_told_and_the_rest_is_read(tmp_path: Path) -> None:
    path = rotated(tmp_path)
    (tmp_path / "session.002.h5").unlink()
    with Session.open(path) as back:
        assert back.recovered is not None and "session.002.h5" in back.recovered
        assert back.indices.tolist() == [5, 6, 7, 8, 9, 10, 14]


def test_a_file_of_another_set_is_not_taken(tmp_path: Path) -> None:
    path = rotated(tmp_path, frames=2)
    other = tmp_path / "other"
    other.mkdir()
    rotated(other)
    (other / "session.001.h5").rename(tmp_path / "session.001.h5")
    with Session.open(path) as back:
        assert len(back) == 2


def test_rotation_does_not_overwrite(tmp_path: Path) -> None:
    (tmp_path / "session.001.h5").write_text("mine")
    with pytest.raises(DataError, match=r"session.001.h5 exists already"):
        rotated(tmp_path)
    assert (tmp_path / "session.001.h5").read_text() == "mine"
