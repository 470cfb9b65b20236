"""What is written is brought to its disk once a second; a disk that fails is told."""

from __future__ import annotations

import errno
import os
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from acquire.errors import DataError
from acquire.hdf5 import ToDisk
from acquire.hdf5 import pace as pace_module
from tests.acquire.session.fixtures import frame, writer


def until(holds: Callable[[], bool]) -> None:
    end = time.monotonic() + 20
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_it_is_brought_again_and_again_and_at_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, brought, plain = tmp_path / "a", list[int](), os.fdatasync

    def bring(file: int) -> None:
        brought.append(os.fstat(file).st_size)
        plain(file)

    monkeypatch.setattr(os, "fdatasync", bring)
    path.write_bytes(b"1")
    to_disk = ToDisk(path, every_s=0.02)
    until(lambda: len(brought) > 2)
    path.write_bytes(b"1234")
    to_disk.close()
    assert brought[0] == 1 and brought[-1] == 4
    count = len(brought)
    to_disk.close()
    assert len(brought) == count and to_disk.failure is None


def test_the_memory_of_what_was_brought_is_let_go_but_for_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, given = tmp_path / "a", list[tuple[int, int]]()
    path.write_bytes(bytes(3_000_000))
    monkeypatch.setattr(pace_module, "KEPT_BYTES", 1_000_000)
    monkeypatch.setattr(os, "posix_fadvise", lambda file, start, size, advice: given.append((start, size)))
    ToDisk(path).close()
    assert given == [(0, 2_000_000)]


@pytest.mark.parametrize(("code", "fails"), [(errno.EIO, True), (errno.ENOSPC, True), (errno.EINVAL, False)])
def test_a_disk_that_fails_ends_the_recording_and_one_that_cannot_is_let_be(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: int, fails: bool
) -> None:
    def refuse(file: int) -> None:
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(ToDisk.__init__, "__defaults__", (0.01,))
    session = writer(tmp_path / "session.h5")
    monkeypatch.setattr(os, "fdatasync", refuse)

    def failed() -> bool:
        session.write_frame(frame(0))
        time.sleep(0.06)
        return False

    if fails:
        with pytest.raises(DataError, match=r"session\.h5: "):
            until(failed)
    else:
        for number in range(5):
            session.write_frame(frame(number))
            time.sleep(0.06)
        session.close()
