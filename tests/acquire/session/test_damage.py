"""Sessions that were killed, cut, damaged or left on a full disk: refused or read right, never wrong or for ever.

The limit on the size of files stands in for the full disk: writing fails in the same place. Many more cases:
``python -m tests.acquire.session.fuzz --cases 20000`` and ``python -m tests.acquire.session.kill_recorder``.
"""

from __future__ import annotations

import contextlib
import math
import re
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from acquire.clock import ClockPair
from acquire.errors import DataError
from acquire.hdf5 import damage as child
from acquire.record_mode import RecordMode
from acquire.session import Session, recover
from acquire.session.part import SessionPart
from tests.acquire.session.fixtures import CAMERA, START, frame, recorded, sample, writer
from tests.acquire.session.fuzz import fuzz, whole_session
from tests.acquire.session.kill_recorder import kill_once


def test_damaged_files_are_refused_or_right(tmp_path: Path) -> None:
    ends = fuzz(tmp_path, range(250))
    assert {end for _, end in ends} <= {"refused", "right"}, ends


@pytest.mark.slow
def test_a_damaged_unfinished_file_is_tried_in_a_child_with_a_time_limit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    content = whole_session(tmp_path / "whole.h5", abandoned=True)
    path = tmp_path / "cut.h5"
    path.write_bytes(content[: len(content) * 2 // 5])
    with pytest.raises(DataError, match="does not come to an end"):
        child.probe(path, "acquire.session", timeout_s=2.0)
    monkeypatch.setattr(child, "PROBE_S", 2.0)
    with pytest.raises(DataError):
        Session.open(path)


@pytest.mark.parametrize(
    ("script", "limit_s", "refused"),
    [
        ("for _ in range(6): time.sleep(1.0); said[0] = 0.0; still_reading()", 5.0, ""),
        ("time.sleep(60)", 1.5, "does not come to an end"),
        ("said[0] = 0.0; still_reading(); time.sleep(60)", 1.5, "does not come to an end"),
        ("said[0] = 0.0; still_reading(); print('why'); sys.exit(4)", 60.0, "^why$"),
        ("sys.exit(3)", 60.0, r"the HDF5 library fails on it \(3\)"),
    ],
)
def test_a_long_file_may_take_long_as_long_as_its_reading_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, script: str, limit_s: float, refused: str
) -> None:
    """A recording of 75 minutes at 1 kHz needs more than the limit, and is whole."""
    head = "import sys, time\nfrom acquire.hdf5.damage import still_reading, _said as said\n"
    monkeypatch.setattr(child, "python_command", lambda *words: [sys.executable, "-c", head + script])
    with pytest.raises(DataError, match=refused) if refused else contextlib.nullcontext():
        child.probe(tmp_path / "session.h5", "none", timeout_s=limit_s)


@pytest.mark.parametrize("start", [math.nan, math.inf, 2e12])
def test_a_session_without_a_start_is_refused(path: Path, start: float) -> None:
    """All its times would be wrong, and its first clock reading would not be that of the start."""
    recorded(path)
    with h5py.File(path, "r+") as file:
        file["entry/start_monotonic_s"][()] = start
    with pytest.raises(DataError, match=r"start_monotonic_s is .*; it must be -1e\+12 to 1e\+12"):
        Session.open(path)


def abandoned(path: Path, frames: int = 6) -> Path:
    """A copy of a file whose writer is still at it: what a kill leaves behind."""
    with writer(path.with_name("alive.h5")) as session:
        for k in range(frames):
            session.write_load(sample(k))
            session.write_frame(frame(k))
        session.flush()
        path.write_bytes(session.path.read_bytes())
    return path


def test_an_abandoned_file_opens_and_says_so(tmp_path: Path) -> None:
    path = abandoned(tmp_path / "killed.h5")
    with Session.open(path) as back:
        assert back.recovered is not None and "not closed by its writer" in back.recovered
        assert len(back) == 6 and len(back.load_samples()) == 6
        np.testing.assert_array_equal(back.frame(5).image, frame(5).image)


def test_recover_makes_a_clean_copy(tmp_path: Path) -> None:
    path = abandoned(tmp_path / "killed.h5")
    before = path.read_bytes()
    done = recover(path)
    assert (done.frames, done.load_samples, done.unreadable) == (6, 6, ())
    assert done.path.name == "killed.recovered.h5" and path.read_bytes() == before
    with Session.open(done.path) as back:
        assert back.recovered is None and back.frame_counts is None
        assert back.indices.tolist() == [5, 6, 7, 8, 9, 10]
        assert back.metadata == {"operator": "Zoé"}
        assert "copied from killed.h5" in back.events()[-1].text
    with pytest.raises(DataError, match="not overwritten"):
        recover(path)


def test_the_folder_of_a_run_stands_for_its_session(tmp_path: Path) -> None:
    run = tmp_path / "run"
    run.mkdir()
    recorded(run / "session.h5")
    with Session.open(run) as read:
        assert len(read) == 1
    assert recover(run).path == run / "session.recovered.h5"


def test_a_frame_that_cannot_be_read_becomes_a_counted_loss(path: Path) -> None:
    with writer(path) as session:
        for k in range(4):
            session.write_frame(frame(k))
        session.write_ledger({"grabbed": 4})
    with Session.open(path) as back:
        chunk = back._parts[0].entry["frames/image"].id.get_chunk_info(1)
    content = bytearray(path.read_bytes())
    content[chunk.byte_offset + 10] ^= 0xFF
    path.write_bytes(content)
    with Session.open(path) as back, pytest.raises(DataError, match="frame 1 cannot be read"):
        list(back.frames())
    done = recover(path, path.with_name("clean.h5"))
    assert done.frames == 3 and len(done.unreadable) == 1 and "1 part could not be read" in done.line()
    with Session.open(done.path) as back:
        assert [f.lost_before for f in back.frames()] == [0, 1, 0]
        assert back.frame_counts == {"grabbed": 4}


def long_session(path: Path, frames: int = 600) -> bytes:
    with writer(path) as session:
        for k in range(frames):
            session.write_load(sample(k))
            session.write_frame(frame(k))
            if k % 20 == 0:
                session.flush()  # as every second in a test
        session.write_ledger({"grabbed": frames})
    return path.read_bytes()


def test_of_a_file_cut_to_half_the_frames_that_are_there_are_saved(path: Path) -> None:
    content = long_session(path)
    path.write_bytes(content[: len(content) // 2])
    with pytest.raises(DataError, match=r"is truncated: .* or save what is there with 'phasedic recover'"):
        Session.open(path)
    done = recover(path)
    assert 200 < done.frames < 400 and done.load_samples == 512
    assert not any("run backwards" in words for words in done.unreadable), "padding is no time"
    counts = [found for words in done.unreadable if (found := re.match(r"(\d+) of \d+ frames", words))]
    assert sum(int(found[1]) for found in counts) == 600 - done.frames
    assert any(words.startswith("88 of 600 load have no time") for words in done.unreadable)
    with Session.open(done.path) as back:
        assert len(back) == done.frames
        for k, found in enumerate(back.frames()):
            np.testing.assert_array_equal(found.image, frame(k).image)


def test_zeros_in_the_middle_cost_only_what_stood_there(path: Path) -> None:
    """A checksum of zeros is right over zeros: such a picture must not pass as a black one."""
    content = bytearray(long_session(path))
    with Session.open(path) as back:
        images = back._parts[0].entry["frames/image"].id
        chunks = [images.get_chunk_info(number) for number in (300, 301, 302)]
    for chunk in chunks:
        content[chunk.byte_offset : chunk.byte_offset + chunk.size] = bytes(chunk.size)
    path.write_bytes(content)
    done = recover(path)
    assert done.frames == 597 and "3 of 600 frames cannot be read" in " ".join(done.unreadable)
    with Session.open(done.path) as back:
        assert back.frame(300).lost_before == frame(303).lost_before + 3
        np.testing.assert_array_equal(back.frame(300).image, frame(303).image)


def test_why_nothing_can_be_saved(path: Path) -> None:
    """It advised to do what had just failed."""
    content = long_session(path, 10)
    path.write_bytes(content[:6000])
    with pytest.raises(DataError, match="nothing of it can be saved") as refused:
        recover(path)
    assert "phasedic recover" not in str(refused.value)


def test_a_cropped_session_keeps_its_crop(path: Path) -> None:
    with writer(path, mode=RecordMode("every", 2, (3, 2, 8, 5))) as session:
        session.write_frame(frame(0))
    done = recover(path)
    with Session.open(done.path) as back:
        assert back.mode == RecordMode("every", 2, (3, 2, 8, 5))
        assert back.camera.width == 8 and CAMERA.width == 16
        np.testing.assert_array_equal(back.frame(0).image, frame(0).image[2:7, 3:11])


def test_what_is_no_session_cannot_be_recovered(tmp_path: Path) -> None:
    path = tmp_path / "notes.h5"
    path.write_text("notes")
    with pytest.raises(DataError, match="not an HDF5 file"):
        recover(path)
    assert list(tmp_path.iterdir()) == [path]


CHILD = """
import resource, sys
from pathlib import Path
from acquire.errors import DataError
from tests.acquire.session.fixtures import frame, sample, writer
session = writer(Path(sys.argv[1]))
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), resource.RLIM_INFINITY))
for number in range(10_000):
    try:
        session.write_load(sample(number))
        session.write_frame(frame(number))
        if number % 4 == 3:
            session.flush()
    except DataError as error:
        print(number - session.unflushed_frames)
        print(error)
        break
try:
    session.write_frame(frame(number))
except DataError as error:
    print(error)
session.close()
"""


@pytest.mark.parametrize("limit", [150_000, 200_123, 299_999])
def test_all_flushed_frames_are_readable(path: Path, limit: int) -> None:
    child = subprocess.run(
        [sys.executable, "-c", CHILD, str(path), str(limit)], capture_output=True, text=True, timeout=60
    )
    assert child.returncode == 0, child.stderr
    number, why, after = child.stdout.splitlines()
    assert "stays readable" in why and str(path) in why
    assert "closed" in after
    with Session.open(path) as back:
        assert back.recovered is not None
        assert len(back) >= int(number) > 0
        for k in range(int(number)):
            np.testing.assert_array_equal(back.frame(k).image, frame(k).image)


@pytest.mark.parametrize("folder", ["/proc", "/no such folder"])
def test_a_folder_that_is_not_there_or_may_not_be_written(folder: str) -> None:
    with pytest.raises(DataError, match="choose a folder that exists, is writable and has room"):
        writer(Path(folder, "session.h5"))


@pytest.mark.timed
@pytest.mark.parametrize(
    "after_s", [0.0, pytest.param(0.113, marks=pytest.mark.slow), pytest.param(0.351, marks=pytest.mark.slow)]
)
def test_only_the_youngest_are_lost(tmp_path: Path, after_s: float) -> None:
    remains = kill_once(tmp_path, after_s, fps=100, size=256)
    # How long a flush waits for a core depends on the machine's load here; the script measures it.
    assert remains.oldest_missing_s < 0.2, remains
    assert remains.frames_found > (after_s - 0.2) * 100 * 0.8, remains


@pytest.mark.parametrize(
    ("lost", "gone", "left"),
    [
        pytest.param(
            (0, 0, 4, 2, 0, 0), slice(1, 3), [(5, 0), (8, 2 + 4 + 2), (9, 0), (10, 0)], id="the next one"
        ),
        pytest.param((1, 2, 0, 0), slice(2), [(7, 1 + 1 + 2 + 1), (8, 0)], id="the first"),
    ],
)
def test_frames_without_a_time_are_lost_before(
    path: Path, lost: tuple[int, ...], gone: slice, left: list[tuple[int, int]]
) -> None:
    with writer(path) as session:
        for number, count in enumerate(lost):
            session.write_frame(frame(number, lost_before=count))
    with h5py.File(path, "r+") as file:
        file["entry/frames/monotonic_s"][gone] = math.nan
    found = recover(path)
    assert found.frames == len(left)
    with Session.open(found.path) as back:
        assert [(one.index, one.lost_before) for one in back.frames()] == left


def test_a_copy_of_one_file_of_a_set_says_which_it_is_and_reads_the_clocks_once(path: Path) -> None:
    later = ClockPair(START.monotonic + 60, START.utc)
    with writer(path, set_id="a set", part=3) as session:
        session.write_frame(frame(0))
        session.write_clock(later)
    with SessionPart(recover(path).path) as copy:
        assert (copy.set_id, copy.part) == ("a set", 3)
        assert copy.clock_pairs() == [START, later]
