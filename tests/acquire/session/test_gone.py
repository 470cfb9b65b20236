"""A session that somebody removes, cuts or renames while it is written, or locks while it is read."""

from __future__ import annotations

import errno
import fcntl
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import pytest

from acquire.errors import DataError
from acquire.hdf5 import damage
from acquire.session import RotatingWriter, Session
from live.pipeline.event_log import EventLog
from live.pipeline.run_state import FrameCounts
from live.run.recorder import Recorder
from tests.acquire.session.fixtures import frame, info, recorded, writer


def renamed(path: Path) -> None:
    path.rename(path.with_suffix(".other"))


def replaced(path: Path) -> None:
    other = path.with_suffix(".new")
    other.write_bytes(b"other")
    other.replace(path)


CASES: list[tuple[Callable[[Path], object], str, int]] = [
    (Path.unlink, "somebody has removed it", 3),
    (replaced, "somebody has removed it", 3),
    (lambda path: os.truncate(path, 0), "somebody has cut it to 0 of", 3),
    (lambda path: os.truncate(path, path.stat().st_size - 1), "somebody has cut it to", 3),
    (renamed, "somebody has renamed it", 0),
]


@pytest.mark.parametrize(("harm", "words", "lost"), CASES)
def test_the_next_frame_is_refused_and_those_before_are_lost(
    path: Path, harm: Callable[[Path], object], words: str, lost: int
) -> None:
    with writer(path) as session:
        for number in range(3):
            session.write_frame(frame(number))
        session.flush()
        harm(path)
        with pytest.raises(DataError, match=words):
            session.write_frame(frame(3))
        assert session.is_gone and session.unflushed_frames == lost


@pytest.mark.skipif(sys.platform != "linux", reason="no other system tells the name of an open file")
def test_a_folder_that_is_renamed_takes_the_recording_along(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    size = frame(0).image.nbytes
    with RotatingWriter(tmp_path / "run" / "session.h5", info(), 2 * size) as session:
        session.write_frame(frame(0))
        (tmp_path / "run").rename(tmp_path / "other")
        for number in range(1, 5):
            session.write_frame(frame(number))
    with Session.open(tmp_path / "other" / "session.h5") as back:
        assert back.recovered is None and back.indices.tolist() == [frame(k).index for k in range(5)]
    assert len(list((tmp_path / "other").iterdir())) == 3 and not (tmp_path / "run").exists()


def test_it_is_noticed_at_the_end_where_nothing_came_any_more(path: Path) -> None:
    session = writer(path)
    session.write_frame(frame(0))
    path.unlink()
    with pytest.raises(DataError, match="somebody has removed it"):
        session.close()


def test_the_recorder_counts_each_frame_once(path: Path) -> None:
    counts, log = FrameCounts(), EventLog()
    recorder = Recorder(writer(path), counts, log, 10**7)
    for number in range(6):
        if number == 4:
            while counts.recorded < 4:
                pass
            path.unlink()
        counts.add(grabbed=1, measured=1)
        recorder.frame(frame(number))
    recorder.close({})
    assert (counts.recorded, counts.unrecorded) == (0, 6) and counts.adds_up and counts.loss
    assert recorder.failed is not None and "somebody has removed it" in recorder.failed
    assert [event.level for event in log.events()] == ["error"]


def test_a_locked_session_is_not_called_damaged(path: Path) -> None:
    recorded(path)
    with path.open("rb") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        with pytest.raises(DataError, match="is locked: another program has it open") as found:
            Session.open(path)
    assert "damaged" not in str(found.value) and "recover" not in str(found.value)


def test_a_file_system_without_locks_is_read_without(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recorded(path)
    opened, asked = h5py.File, []

    def no_locks(*given: Any, **options: Any) -> Any:
        asked.append(options.get("locking"))
        if options.get("locking") is not False:
            raise OSError(errno.ENOLCK, "Unable to synchronously open file (unable to lock file, errno = 37)")
        return opened(*given, **options)

    monkeypatch.setattr(damage.h5py, "File", no_locks)
    with Session.open(path) as back:
        assert len(back) == 1
    assert asked == [None, False]
