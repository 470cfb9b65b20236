"""How much a session file holds, when it is written, and what a full disk leaves."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import h5py
import numpy as np
import pytest

from acquire.errors import DataError
from acquire.record_mode import RecordMode
from acquire.session import RotatingWriter, Session
from acquire.session import writer as writer_module
from acquire.session.reader import first_path, part_path
from acquire.session.writer import _write_failure
from tests.acquire.session.fixtures import CAMERA, bursts_of, frame, info, writer
from tests.clock import Clock


@pytest.mark.parametrize(("length", "fits"), [(8192, True), (8193, False)])
def test_final_counts_have_8192_bytes(path: Path, length: int, fits: bool) -> None:
    counts = {"a": "x" * (length - len('{"a": ""}'))}
    with writer(path) as session:
        if not fits:
            with pytest.raises(ValueError, match="a ledger of 8193 bytes; at most 8192 fit"):
                session.write_ledger(counts)
            return
        session.write_ledger(counts)
    with Session.open(path) as back:
        assert back.frame_counts == counts


@pytest.mark.parametrize(
    ("free", "words"),
    [
        (
            2**24 - 1,
            "a.h5: disk full (16777215 bytes free); free some space and start a new session; everything",
        ),
        (2**24, "a.h5: writing failed (boom); check the disk; everything complete so far stays readable"),
        (None, "a.h5: its disk is gone (boom); check the disk and cable; everything"),
    ],
)
def test_why_writing_failed(free: int | None, words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def free_bytes(path: Path) -> int:
        if free is None:
            raise OSError("gone")
        return free

    monkeypatch.setattr(writer_module, "free_bytes", free_bytes)
    assert _write_failure(Path("a.h5"), RuntimeError("boom")).startswith(words)


@pytest.mark.parametrize(
    ("bits", "frames", "kind"),
    [(12, 16, "u2"), (12, 17, "u4"), (8, 257, "u2"), (8, 258, "u4"), (16, 1, "u2")],
)
def test_sums_take_two_bytes_where_the_longest_burst_fits(
    path: Path, bits: int, frames: int, kind: str
) -> None:
    writer(path, dataclasses.replace(CAMERA, bits=bits), burst_frames=frames).close()
    with h5py.File(path) as file:
        assert file["entry/bursts/sum"].dtype == np.dtype(kind)


@pytest.mark.parametrize(
    ("name", "first"),
    [
        ("session.h5", "session.h5"),
        ("session.001.h5", "session.h5"),
        ("session.1000.h5", "session.h5"),
        ("session.01.h5", "session.01.h5"),
        ("a.b.123.h5", "a.b.h5"),
        ("session.001x.h5", "session.001x.h5"),
    ],
)
def test_the_first_file_of_a_set_by_name(name: str, first: str) -> None:
    assert first_path(Path("runs") / name) == Path("runs") / first


@pytest.mark.parametrize(
    ("part", "name"), [(0, "a.h5"), (1, "a.001.h5"), (999, "a.999.h5"), (1000, "a.1000.h5")]
)
def test_the_files_of_a_set_have_numbers(part: int, name: str) -> None:
    assert part_path(Path("a.h5"), part) == Path(name)


def refuse(*arguments: object, **more: object) -> None:
    raise OSError(28, "No space left on device")


def test_the_frames_before_the_one_that_the_disk_refused_are_brought_to_the_file(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = Clock()
    session = writer(path, now=clock)
    for number, clock.now_s in enumerate((1.0, 1.03)):
        session.write_frame(frame(number))
    assert session.unflushed_frames == 1
    monkeypatch.setattr(session._images, "append", refuse)
    with pytest.raises(DataError, match=r"(writing failed|disk full)"):
        session.write_frame(frame(2))
    assert session.unflushed_frames == 0
    with Session.open(path) as back:
        assert back.indices.tolist() == [5, 6]


def test_frames_that_wait_when_a_flush_fails_are_lost_and_the_new_one_is_refused(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = Clock()
    session = writer(path, now=clock)
    for clock.now_s in (1.0, 1.02, 1.04):
        session.write_frame(frame(0))
    monkeypatch.setattr(session._frames, "write", refuse)
    clock.now_s += 1.0
    with pytest.raises(DataError):
        session.write_frame(frame(1))
    assert session.unflushed_frames == 2


def test_bursts_have_numbers_through_all_files_of_a_set(path: Path) -> None:
    bursts = bursts_of(2, 4)
    with RotatingWriter(path, info(mode=RecordMode("bursts"), burst_frames=2), 1) as session:
        assert [session.write_burst(burst) for burst in bursts] == [0, 1, 2, 3]
        assert session.unflushed_frames <= 2 and session.free_bytes() > 0
    with Session.open(path) as back:
        assert back.burst_count == 4 and back.burst_column("first_index").tolist() == [5, 7, 9, 11]
        np.testing.assert_array_equal(back.burst(3).mean, bursts[3].mean)
        with pytest.raises(DataError, match="no burst 4; there are 4, from 0"):
            back.burst(4)
