"""What is saved of a session file, and what a recording gives as a device."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from acquire.addresses import parse_address
from acquire.errors import ConfigError, DataError
from acquire.events import Event, EventKind, ignore_event
from acquire.record_mode import RecordMode
from acquire.session import Session
from acquire.session.__main__ import main as child
from acquire.session.devices import open_session_camera, open_session_load
from acquire.session.recover import recover
from tests.acquire.session.fixtures import START, bursts_of, frame, recorded, sample, writer


def test_a_recording_without_a_load_cell_is_none(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    closed: list[Path] = []
    plain = Session.close
    monkeypatch.setattr(Session, "close", lambda self: (closed.append(self.path), plain(self))[1])
    writer(path, load=None).close()
    address = parse_address(f"session:{path}")
    with pytest.raises(DataError, match=r"recorded without a load cell; use --load none:"):
        open_session_load(address, ignore_event)
    assert closed == [path]
    with Session.open(path) as back:
        assert back.load_cell is None
    for text, words in (
        ("session:", "name the file, for example session:run.h5"),
        ("session:a?x=1", "known: none"),
    ):
        with pytest.raises(ConfigError, match=words):
            open_session_camera(parse_address(text), ignore_event)


def test_what_is_saved_is_told_in_words_and_numbers(path: Path) -> None:
    with writer(path, mode=RecordMode("every", 2)) as session:
        for k in range(3):
            session.write_frame(frame(k))
            session.write_load(sample(k))
        session.write_event(Event(1001.0, EventKind.NOTE, "operator", "x"))
    done = recover(path)
    assert done.line() == f"{done.path}: 3 frames, 0 bursts, 3 load samples, 1 events"
    with Session.open(done.path) as back:
        assert back.mode == RecordMode("every", 2)
        note = back.events()[-1]
    assert (note.kind, note.source, note.level) == (EventKind.RECORDER, "recover", "info")
    assert (
        note.data == {"unreadable": [], "frames": 3} and note.text == f"copied from session.h5: {done.line()}"
    )
    assert START.monotonic == back.start_monotonic


def test_bursts_are_saved_too(path: Path) -> None:
    bursts = bursts_of(3, 2)
    with writer(path, mode=RecordMode("bursts"), burst_frames=3) as session:
        for burst in bursts:
            session.write_burst(burst)
    done = recover(path)
    assert (done.frames, done.bursts, done.unreadable) == (0, 2, ())
    with Session.open(done.path) as back:
        assert [burst.first_index for burst in back.bursts()] == [5, 8]
        for one, other in zip(back.bursts(), bursts, strict=True):
            np.testing.assert_array_equal(one.mean, other.mean)
            np.testing.assert_array_equal(one.clipped, other.clipped)


def test_a_recording_that_is_stopped_gives_no_more(path: Path) -> None:
    recorded(path, 3)
    address = parse_address(f"session:{path}")
    for opened in (open_session_camera, open_session_load):
        with opened(address, ignore_event) as device:  # type: ignore[operator]
            items = iter(device)
            next(items)
            device.stop()
            assert list(items) == []


@pytest.mark.parametrize(
    ("group", "column", "value", "words"),
    [
        ("frames", "damaged", 7, "/entry/frames/damaged is 7 in row 1, beyond 0 to 1; the file is damaged"),
        ("frames", "monotonic_s", 2e12, "/entry/frames/monotonic_s is 2000000000000.0 in row 1, beyond -1e"),
        ("frames", "index", -5, "/entry/frames/index is -5 in row 1, beyond 0 to inf"),
        ("load", "force", -1e13, "beyond -1e+12 to 1e+12"),
        ("load", "stable", 2, "beyond -1 to 1"),
    ],
)
def test_a_value_beyond_its_range_is_refused_and_left_out_when_the_rest_is_saved(
    path: Path, group: str, column: str, value: float, words: str
) -> None:
    recorded(path, 3)
    with h5py.File(path, "r+") as file:
        file["entry"][group][column][1] = value
    with pytest.raises(DataError) as caught, Session.open(path) as back:
        back.load_samples()
    assert words in str(caught.value)
    done = recover(path)
    assert (done.frames, done.load_samples) == ((2, 3) if group == "frames" else (3, 2))
    assert done.unreadable == (f"1 of 3 {group} have no time, or values beyond sense, and are left out",)


def test_the_child_that_reads_a_session_first_says_what_is_wrong(
    path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recorded(path)
    assert (child(str(path)), child(str(path), "salvage")) == (0, 0)
    with h5py.File(path, "r+") as file:
        file["entry/load/line_end"][0] = 99
    assert (child(str(path)), child(str(path), "salvage")) == (4, 0)
    told = capsys.readouterr().out.replace("\0\n", "")  # signs of progress, as many as it takes
    assert told.startswith(f"{path}: the load samples cannot be read (the lines of the samples do not follow")
    assert told.count("\n") == 1
