"""Bursts, thinning, cropping and rotation: what is left out is left out on purpose, the rest is exact."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import h5py
import numpy as np
import pytest

from acquire.burst.accumulate import BurstAccumulator
from acquire.errors import ConfigError, DataError
from acquire.frame import Burst, CameraInfo
from acquire.record_mode import RecordMode
from acquire.session import RotatingWriter, Session
from tests.acquire.session.fixtures import CAMERA, START, frame, info, sample, writer
from tests.clock import Clock

EIGHT_BIT = dataclasses.replace(CAMERA, bits=8)


def bursts_of(n: int, count: int, camera: CameraInfo = CAMERA) -> list[Burst]:
    accumulator = BurstAccumulator(n)
    found = [accumulator.add(frame(k, camera)) for k in range(n * count)]
    return [burst for burst in found if burst is not None]


def assert_same_burst(a: Burst, b: Burst) -> None:
    np.testing.assert_array_equal(a.mean, b.mean)
    np.testing.assert_array_equal(a.clipped, b.clipped)
    assert not b.mean.flags.writeable and b.mean.dtype == np.float32 and b.clipped.dtype == np.bool_
    for field in dataclasses.fields(Burst):
        if field.name not in ("mean", "clipped"):
            np.testing.assert_equal(getattr(a, field.name), getattr(b, field.name))


@pytest.mark.parametrize("n", [1, 3, 7, 32])
@pytest.mark.parametrize("camera", [CAMERA, EIGHT_BIT], ids=["12 bit", "8 bit"])
def test_bursts_come_back_bit_equal(tmp_path: Path, camera: CameraInfo, n: int) -> None:
    bursts = bursts_of(n, 3, camera)
    path = tmp_path / "session.h5"
    with writer(path, camera, mode=RecordMode("bursts"), burst_frames=n) as session:
        assert [session.write_burst(burst) for burst in bursts] == [0, 1, 2]
    with Session.open(path) as back:
        assert back.mode.kind == "bursts" and back.burst_count == 3 and len(back) == 0
        for a, b in zip(bursts, back.bursts(), strict=True):
            assert_same_burst(a, b)


def test_a_burst_waits_for_the_disk_with_all_its_frames(tmp_path: Path) -> None:
    clock = Clock()
    with writer(tmp_path / "session.h5", now=clock, mode=RecordMode("bursts"), burst_frames=7) as session:
        for burst, clock.now_s in zip(bursts_of(7, 3), (1.0, 1.02, 1.04), strict=True):
            session.write_burst(burst)
        assert session.unflushed_frames == 14
        session.flush()
        assert session.unflushed_frames == 0


def test_short_sums_are_stored_short(tmp_path: Path) -> None:
    path = tmp_path / "session.h5"
    with writer(path, EIGHT_BIT, burst_frames=32) as session:
        session.write_burst(bursts_of(32, 1, EIGHT_BIT)[0])
    with h5py.File(path) as back:
        assert back["entry/bursts/sum"].dtype == np.uint16


def test_a_longer_burst_than_agreed_is_refused(tmp_path: Path) -> None:
    with writer(tmp_path / "session.h5", burst_frames=16) as session, pytest.raises(ValueError, match="fit"):
        session.write_burst(bursts_of(32, 1)[0])


def test_a_mean_that_is_no_mean_of_grey_levels_is_refused(tmp_path: Path) -> None:
    burst = bursts_of(3, 1)[0]
    odd = dataclasses.replace(burst, mean=burst.mean + np.float32(0.1))
    with writer(tmp_path / "session.h5") as session, pytest.raises(ValueError, match="no mean of whole"):
        session.write_burst(odd)


def test_a_part_of_the_picture(tmp_path: Path) -> None:
    path, mode = tmp_path / "session.h5", RecordMode("all", crop=(3, 2, 8, 5))
    burst = bursts_of(4, 1)[0]
    with writer(path, mode=mode) as session:
        session.write_frame(frame(0))
        session.write_burst(burst)
    with Session.open(path) as back:
        assert (back.camera.width, back.camera.height) == (8, 5)
        assert back.mode.crop == (3, 2, 8, 5)
        np.testing.assert_array_equal(back.frame(0).image, frame(0).image[2:7, 3:11])
        np.testing.assert_array_equal(back.burst(0).mean, burst.mean[2:7, 3:11])


@pytest.mark.parametrize("crop", [(-1, 0, 4, 4), (0, 0, 17, 4), (10, 10, 4, 4), (0, 0, 0, 4)])
def test_a_crop_outside_the_picture_is_refused(tmp_path: Path, crop: tuple[int, int, int, int]) -> None:
    with pytest.raises(ConfigError, match="leaves the picture"):
        writer(tmp_path / "session.h5", mode=RecordMode(crop=crop))
    assert not (tmp_path / "session.h5").exists()


@pytest.mark.parametrize(
    ("text", "kept"),
    [("all", [0, 1, 2, 3, 4]), ("every=2", [0, 2, 4]), ("bursts", [])],
)
def test_modes(text: str, kept: list[int]) -> None:
    mode = RecordMode.parse(text)
    assert [k for k in range(5) if mode.keeps(k)] == kept
    assert mode.text() == text


@pytest.mark.parametrize("text", ["every=0", "every=", "some", "every=1.5", "every=-1"])
def test_other_modes_are_refused(text: str) -> None:
    with pytest.raises(ConfigError, match="every=K"):
        RecordMode.parse(text)


# -- rotation ---------------------------------------------------------------------------------


def rotated(folder: Path, frames: int = 10, limit: int = 3 * 16 * 12 * 2) -> Path:
    path = folder / "session.h5"
    with RotatingWriter(path, info(), limit) as session:
        for k in range(frames):
            session.write_load(sample(k))
            assert session.write_frame(frame(k)) == k
        session.write_ledger({"grabbed": frames})
    return path


def test_bytes_are_counted_through_all_files(tmp_path: Path) -> None:
    picture = 16 * 12 * 2
    with RotatingWriter(tmp_path / "session.h5", info(), 2 * picture) as session:
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
