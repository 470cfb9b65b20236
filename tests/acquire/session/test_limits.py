"""What stands in a session file by value, how much fits, and what of a foreign file is believed."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from acquire.addresses import parse_address
from acquire.burst.accumulate import BurstAccumulator
from acquire.errors import ConfigError, DataError
from acquire.events import Event, EventKind, ignore_event
from acquire.hdf5 import to_json
from acquire.record_mode import RecordMode
from acquire.session import RotatingWriter, Session, layout
from acquire.session import writer as writer_module
from acquire.session.__main__ import main as child
from acquire.session.devices import open_session_camera, open_session_load
from acquire.session.layout import describe_camera, describe_load, event_rows
from acquire.session.reader import first_path, part_path
from acquire.session.recover import recover
from acquire.session.stored import _chosen, camera_from, config_from, events_from, load_from
from acquire.session.writer import _write_failure
from tests.acquire.session.fixtures import CAMERA, LOAD, START, frame, info, sample, writer
from tests.clock import Clock


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "session.h5"


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


def test_what_is_written_waits_for_a_twentieth_of_a_second(path: Path) -> None:
    clock = Clock()
    with writer(path, now=clock) as session:
        clock.now_s = 1.0
        session.write_frame(frame(0))
        clock.now_s = 1.02
        session.write_frame(frame(1))
        assert session.flush_when_due() == pytest.approx(0.03) and session.unflushed_frames == 1


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


def test_what_a_whole_session_has_at_its_top(path: Path) -> None:
    with writer(path) as session:
        for raw in (b"12.5 N", b"", b"x"):
            session.write_load(dataclasses.replace(sample(0), raw=raw))
    with h5py.File(path) as file:
        assert (file.attrs["format"], file.attrs["format_version"]) == (b"phasedic-session", 1)
        assert (file.attrs["set_id"], file.attrs["part"]) == (b"none", 0)
        entry = file["entry"]
        assert (entry.attrs["record"], entry.attrs["crop"].tolist()) == (b"all", [0, 0, 0, 0])
        assert entry["start_time"][()] == b"2026-05-09T07:35:25.123456Z"
        assert entry["load/lines"][:].tobytes() == b"12.5 N\n\nx\n"
        assert entry["load/line_end"][:].tolist() == [7, 8, 10]
        assert json.loads(entry["load/flags"].attrs["flag_names"])["STEP"] == 256
        assert entry["frames/image"].attrs["bits"] == 12
        assert entry["frames/time_s"].fletcher32 and entry["bursts/sum"].chunks == (1, 12, 16)


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


TIME = ("f8", "s", -1e12, 1e12)
COUNT = ("u4", "none", 0, np.inf)
INDEX = ("i8", "none", 0, np.inf)
CLOCK = ("u1", "none", 0, 2)
COLUMNS = {
    "frames": {
        "time_s": TIME, "monotonic_s": TIME, "raw_monotonic_s": TIME, "index": INDEX, "lost_before": COUNT,
        "damaged": ("u1", "none", 0, 1), "clock": CLOCK,
    },
    "load": {
        "time_s": TIME, "monotonic_s": TIME, "force": ("f8", "N", -1e12, 1e12), "flags": ("u4", "none", 0, 511),
        "stable": ("i1", "none", -1, 1), "device_ms": ("f8", "ms", -np.inf, np.inf),
        "unit": ("S8", "none", -np.inf, np.inf), "line_end": ("u8", "none", 1, np.inf),
    },
    "bursts": {
        "time_s": TIME, "monotonic_s": TIME, "n": ("u4", "none", 1, 65536), "noise": ("f8", "GL", 0, 65535),
        "duration": TIME, "first_index": INDEX, "last_index": INDEX, "lost": COUNT, "clock": CLOCK,
    },
    "clock": {"monotonic_s": TIME, "utc": ("S27", "none", -np.inf, np.inf)},
}  # fmt: skip


@pytest.mark.parametrize("group", COLUMNS)
def test_columns_their_units_and_ranges(path: Path, group: str) -> None:
    declared = {
        "frames": layout.FRAME_COLUMNS,
        "load": layout.LOAD_COLUMNS,
        "bursts": layout.BURST_COLUMNS,
        "clock": layout.CLOCK_COLUMNS,
    }[group]
    assert {name: (c.dtype, c.unit, c.low, c.high) for name, c in declared.items()} == COLUMNS[group]
    writer(path).close()
    with h5py.File(path) as file:
        for name, (dtype, unit, _, _) in COLUMNS[group].items():
            column = file["entry"][group][name]
            assert (column.dtype, column.attrs["units"]) == (np.dtype(dtype), unit.encode())


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


def test_numbers_that_do_not_increase_are_refused(path: Path) -> None:
    with writer(path) as session:
        for index in (5, 6, 6):
            session.write_frame(frame(0, index=index))
    with pytest.raises(
        DataError, match="the sequence numbers of frames do not increase at row 2; the file is"
    ):
        Session.open(path)


def test_times_that_run_backwards_are_told(path: Path) -> None:
    with writer(path) as session:
        for k, t in enumerate((1001.0, 1002.0, 1002.0, 1001.5)):
            session.write_frame(frame(k, t=t))
    with Session.open(path) as back:
        assert back.recovered == f"{path}: the times of frames run backwards at 1 places, first after row 2"


@pytest.mark.parametrize(
    ("name", "value", "taken"),
    [
        ("bits", 0, False), ("bits", 1, True), ("bits", 16, True), ("bits", 17, False), ("bits", True, False),
        ("width", 0, False), ("width", 65535, True), ("width", 65536, False), ("height", 0, False),
        ("fps", None, True), ("fps", -1.0, False), ("exposure_s", None, True), ("exposure_s", 2e9, False),
        ("white_level", None, True), ("white_level", 0, False), ("white_level", 65535, True),
        ("clock", "device", True), ("clock", "sun", False), ("live", 1, False), ("name", 5, False),
        ("controls", [], False), ("warnings", {}, False),
    ],
)  # fmt: skip
def test_what_is_believed_of_a_camera(name: str, value: Any, taken: bool) -> None:
    text = json.dumps(describe_camera(CAMERA) | {name: value}).encode()
    if taken:
        assert getattr(camera_from(text, "a.h5"), name) == value
        return
    with pytest.raises(DataError, match=f"a.h5: '{name}' is "):
        camera_from(text, "a.h5")


def test_pictures_beyond_sense_are_refused() -> None:
    large = describe_camera(CAMERA) | {"width": 16384, "height": 16384}
    assert camera_from(to_json(large).encode(), "a.h5").width == 16384
    with pytest.raises(DataError, match="pictures of 16384 x 16385 px are beyond sense"):
        camera_from(to_json(large | {"height": 16385}).encode(), "a.h5")


@pytest.mark.parametrize(
    ("name", "value", "taken"),
    [
        ("sign", -1, True), ("sign", 2, False), ("sign", -2, False), ("sign", 1.0, False),
        ("capacity_N", None, True), ("capacity_N", 1e12, True), ("capacity_N", 1.1e12, False),
        ("capacity_N", -1.0, False), ("settings", None, False), ("protocol", None, False),
    ],
)  # fmt: skip
def test_what_is_believed_of_a_load_cell(name: str, value: Any, taken: bool) -> None:
    text = json.dumps(describe_load(LOAD) | {name: value}).encode()  # type: ignore[operator]
    if taken:
        assert getattr(load_from(text, "a.h5"), name) == value
        return
    with pytest.raises(DataError, match=f"'{name}' is "):
        load_from(text, "a.h5")


def test_there_may_be_no_load_cell_and_a_configuration_has_sections() -> None:
    assert load_from(b" null ", "a.h5") is None and describe_load(None) is None
    assert config_from(b'{"a": {"b": 1}}', "a.h5") == {"a": {"b": 1}}
    with pytest.raises(DataError, match="'a' is 5"):
        config_from(b'{"a": 5}', "a.h5")


def stored_event(**changes: Any) -> bytes:
    plain = {
        "monotonic_s": 1.5,
        "kind": "note",
        "source": "operator",
        "text": "x",
        "level": "info",
        "data": {},
    }
    return json.dumps(plain | changes).encode()


@pytest.mark.parametrize(
    "changes",
    [
        {"level": "fatal"}, {"monotonic_s": 2e12}, {"monotonic_s": None}, {"data": None}, {"text": 5},
        {"kind": "measured"}, {"kind": "measured", "data": {"first": 1, "last": 8, "n": 0}},
        {"kind": "reference", "data": {"first": -1, "last": 8, "n": 8}},
        {"kind": "reference", "data": {"first": 1, "last": 8, "n": 65537}},
    ],
)  # fmt: skip
def test_an_event_that_is_not_as_it_was_written(changes: dict[str, Any]) -> None:
    rows = np.array([stored_event(), stored_event(**changes)], "S512")
    with pytest.raises(DataError, match=r"a\.h5: event 1: "):
        events_from(rows, "a.h5", whole=True)
    assert [event.text for event in events_from(rows, "a.h5", whole=False)] == ["x"]


def test_an_event_of_a_newer_program_is_left_out() -> None:
    rows = np.array([stored_event(kind="from 2030"), stored_event()], "S512")
    assert len(events_from(rows, "a.h5", whole=True)) == 1


def test_a_long_event_goes_on_in_rows_that_begin_with_a_plus() -> None:
    rows = event_rows(Event(10.0, EventKind.NOTE, "operator", "y" * 1200), 4.0)
    assert [len(row) for row in rows.tolist()][:2] == [512, 512]
    assert [row[:1] for row in rows.tolist()] == [b"{", b"+", b"+"]
    whole = json.loads(b"".join((rows[0], *(row[1:] for row in rows[1:]))))
    assert (whole["time_s"], whole["monotonic_s"], whole["text"]) == (6.0, 10.0, "y" * 1200)


def test_a_recording_without_a_load_cell_is_none(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    closed: list[Path] = []
    plain = Session.close
    monkeypatch.setattr(Session, "close", lambda self: (closed.append(self.path), plain(self))[1])
    writer(path, load=None).close()
    address = parse_address(f"session:{path}")
    with pytest.raises(DataError, match=r"recorded without a load cell; use --load none:"):
        open_session_load(address, ignore_event)
    assert closed == [path]
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


def test_bursts_are_saved_too(path: Path) -> None:
    accumulator = BurstAccumulator(3)
    bursts = [burst for k in range(6) if (burst := accumulator.add(frame(k))) is not None]
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
    with writer(path) as session:
        for k in range(3):
            session.write_frame(frame(k))
            session.write_load(sample(k))
    address = parse_address(f"session:{path}")
    for opened in (open_session_camera, open_session_load):
        with opened(address, ignore_event) as device:  # type: ignore[operator]
            items = iter(device)
            next(items)
            device.stop()
            assert list(items) == []


def test_rows_at_the_end_that_are_not_written_yet_are_no_trouble() -> None:
    nan = np.nan
    table: dict[str, Any] = {
        "monotonic_s": np.array([1.0, nan, 3.0, nan, nan]),
        "lost_before": np.array([0, 2, 1, 0, 0], np.uint32),
    }
    good = ~np.isnan(table["monotonic_s"])
    rows = _chosen(table, good, "frames", whole=False)
    assert rows.places.tolist() == [0, 2] and len(rows) == 2
    assert rows.troubles == ("1 of 3 frames have no time, or values beyond sense, and are left out",)
    assert rows.columns["lost_before"].tolist() == [0, 1 + 1 + 2], "that frame, and what was lost before it"
    none = _chosen(table, np.zeros(5, bool), "frames", whole=False)
    assert none.troubles == ("none of 5 frames has a time, so all are left out",) and len(none) == 0


def test_of_bursts_all_their_frames_are_lost() -> None:
    table: dict[str, Any] = {
        "monotonic_s": np.array([1.0, 2.0, 3.0]),
        "n": np.array([4, 5, 6], np.uint32),
        "lost": np.array([0, 2, 1], np.uint32),
    }
    rows = _chosen(table, np.array([True, False, True]), "bursts", whole=False)
    assert rows.columns["lost"].tolist() == [0, 1 + 5 + 2]


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
    with writer(path) as session:
        for k in range(3):
            session.write_frame(frame(k))
            session.write_load(sample(k))
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
    with writer(path) as session:
        session.write_frame(frame(0))
        session.write_load(sample(0))
    assert (child(str(path)), child(str(path), "salvage")) == (0, 0)
    with h5py.File(path, "r+") as file:
        file["entry/load/line_end"][0] = 99
    assert (child(str(path)), child(str(path), "salvage")) == (4, 0)
    told = capsys.readouterr().out
    assert told.startswith(f"{path}: the load samples cannot be read (the lines of the samples do not follow")
    assert told.count("\n") == 1


def test_bursts_have_numbers_through_all_files_of_a_set(path: Path) -> None:
    accumulator = BurstAccumulator(2)
    bursts = [burst for k in range(8) if (burst := accumulator.add(frame(k))) is not None]
    with RotatingWriter(path, info(mode=RecordMode("bursts"), burst_frames=2), 1) as session:
        assert [session.write_burst(burst) for burst in bursts] == [0, 1, 2, 3]
        assert session.unflushed_frames <= 2 and session.free_bytes() > 0
    with Session.open(path) as back:
        assert back.burst_count == 4 and back.burst_column("first_index").tolist() == [5, 7, 9, 11]
        np.testing.assert_array_equal(back.burst(3).mean, bursts[3].mean)
        with pytest.raises(DataError, match="no burst 4; there are 4, from 0"):
            back.burst(4)
