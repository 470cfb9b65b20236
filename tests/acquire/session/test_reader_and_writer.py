"""A session read back is what was written, whatever the state in which the writer left it."""

from __future__ import annotations

import dataclasses
import json
import math
import tracemalloc
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray

from acquire.addresses import parse_address
from acquire.clock import ClockPair
from acquire.errors import DataError
from acquire.events import Event, EventKind
from acquire.frame import Frame
from acquire.load_sample import LoadSample
from acquire.session import Session
from acquire.session import rows as loads
from acquire.session.devices import open_session_camera, open_session_load
from acquire.session.layout import FORMAT_VERSION, image_dtype
from acquire.session.stored import read_column
from tests.acquire.session.fixtures import CAMERA, LOAD, START, frame, recorded, sample, writer
from tests.clock import Clock


def assert_same_frame(a: Frame, b: Frame) -> None:
    np.testing.assert_array_equal(a.image, b.image)
    assert a.image.dtype == b.image.dtype and not b.image.flags.writeable
    for name in ("index", "t", "clock", "lost_before", "bits", "raw_t", "damaged"):
        assert getattr(a, name) == getattr(b, name), name


def assert_same_sample(a: LoadSample, b: LoadSample) -> None:
    assert (math.isnan(a.force) and math.isnan(b.force)) or a.force == b.force
    assert dataclasses.replace(a, force=0.0) == dataclasses.replace(b, force=0.0)


@pytest.mark.parametrize("bits", [8, 12])
def test_frames_come_back_bit_equal(path: Path, bits: int) -> None:
    camera = dataclasses.replace(CAMERA, bits=bits)
    changes = (
        {},
        {"lost_before": 2, "index": 8},
        {"damaged": True, "clock": "host", "index": 9},
        {"index": 2**40},
    )
    frames = [frame(k, camera, **change) for k, change in enumerate(changes)]
    with writer(path, camera) as session:
        assert [session.write_frame(f) for f in frames] == [0, 1, 2, 3]
    with Session.open(path) as back:
        assert len(back) == 4 and back.recovered is None
        for a, b in zip(frames, back.frames(), strict=True):
            assert_same_frame(a, b)
        assert [f.index for f in back.frames(1, 3)] == [8, 9]
        assert back.times.tolist() == [f.t for f in frames]
        assert back.indices.tolist() == [f.index for f in frames]


@pytest.mark.parametrize("size", [1, 4, 5, 100])
def test_load_samples_are_read_by_the_piece(path: Path, monkeypatch: pytest.MonkeyPatch, size: int) -> None:
    monkeypatch.setattr(loads, "PIECE", size)
    samples = [*(sample(k) for k in range(22)), dataclasses.replace(sample(22), raw=b"a\nb")]
    with writer(path) as session:
        for one in samples:
            session.write_load(one)
        session.flush()
        path.with_name("killed.h5").write_bytes(path.read_bytes())
    for file in (path, path.with_name("killed.h5")):
        with Session.open(file) as back:
            for a, b in zip(samples, back.load_samples(), strict=True):
                assert_same_sample(a, b)
            low, high = samples[6].t, samples[17].t
            for a, b in zip(samples[6:18], back.each_load_sample(low, high), strict=True):
                assert_same_sample(a, b)
            assert list(back.each_load_sample(high + 1e6)) == []
            times, forces = back.load_curve()
            np.testing.assert_array_equal(times, [one.t for one in samples])
            np.testing.assert_array_equal(forces, [one.force for one in samples])


def test_of_other_times_no_load_sample_is_read(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with writer(path) as session:
        for k in range(40):
            session.write_load(sample(k))
    read: list[tuple[str, int]] = []

    def noted(item: h5py.Dataset, n: int, missing: object, *, first: int, whole: bool) -> NDArray[Any]:
        read.append((item.name.rpartition("/")[2], n - first))
        return read_column(item, n, missing, first=first, whole=whole)

    with Session.open(path) as back:
        monkeypatch.setattr(loads, "PIECE", 10)
        monkeypatch.setattr(loads, "read_column", noted)
        monkeypatch.setattr(loads.LoadTable, "_raw_lines", lambda self, rows: [b""] * len(rows))
        assert len(list(back.each_load_sample(high=sample(3).t))) == 4
    assert {count for name, count in read if name == "force"} == {10}
    assert sum(count for name, count in read if name == "force") == 10


def test_a_load_curve_is_no_list_of_objects(path: Path) -> None:
    n = 20_000
    with writer(path) as session:
        for k in range(n):
            session.write_load(LoadSample(START.monotonic + k, float(k), raw=b"%d N" % k))
    peaks = []
    with Session.open(path) as back:
        for read in (back.load_curve, lambda: sum(1 for _ in back.each_load_sample()), back.load_samples):
            tracemalloc.start()
            found = read()
            peaks.append(tracemalloc.get_traced_memory()[1])
            tracemalloc.stop()
            del found
    curve, one_by_one, objects = peaks
    assert curve < objects / 4 and one_by_one < objects / 1.3


def test_what_was_said_once_comes_back(path: Path) -> None:
    writer(path).close()
    with Session.open(path) as back:
        assert dataclasses.asdict(back.camera) == dataclasses.asdict(CAMERA)
        assert back.load_cell is not None and back.load_cell.name == LOAD.name and back.load_cell.sign == -1
        assert back.config == {"measure": {"zoi": 64}}
        assert back.metadata == {"operator": "Zoé"}
        assert back.start_utc == START.utc and back.start_monotonic == START.monotonic
        assert back.frame_counts is None
        assert len(back) == 0 and back.load_samples() == [] and back.events() == []


@pytest.mark.parametrize("length", [0, 300, 512, 5000], ids=lambda n: f"{n} characters")
def test_events_of_any_length(path: Path, length: int) -> None:
    events = [
        Event(1001.5, EventKind.NOTE, "operator", "é" * length, "warning", {"n": 3}),
        Event(1002.25, EventKind.MEASURED, "measurement", "x", data={"first": 1, "last": 8, "n": 8}),
    ]
    with writer(path) as session:
        for event in events:
            session.write_event(event)
        session.write_event(Event(1003.0, EventKind.TARE, "x", "y", data={"force_N": math.nan}))
    with Session.open(path) as back:
        assert back.events()[:2] == events
        assert back.events()[2].data == {"force_N": None}


def test_ledger_and_clock_pairs(path: Path) -> None:
    later = ClockPair(START.monotonic + 60, START.utc)
    with writer(path) as session:
        session.write_clock(later)
        session.write_ledger({"grabbed": 3, "lost": 0})
    with Session.open(path) as back:
        assert back.frame_counts == {"grabbed": 3, "lost": 0}
        assert back.clock_pairs == [START, later]


def test_an_existing_file_is_never_overwritten(path: Path) -> None:
    path.write_bytes(b"precious")
    with pytest.raises(DataError, match="not overwritten"):
        writer(path)
    assert path.read_bytes() == b"precious"


def test_a_frame_that_does_not_fit_is_refused_and_leaves_the_rest(path: Path) -> None:
    with writer(path) as session:
        session.write_frame(frame(0))
        with pytest.raises(DataError, match="described as"):
            session.write_frame(frame(1, dataclasses.replace(CAMERA, width=20)))
        session.write_frame(frame(2))
    with Session.open(path) as back:
        assert back.indices.tolist() == [5, 7]


def test_a_closed_session_takes_nothing_more(path: Path) -> None:
    session = writer(path)
    session.close()
    session.close()
    for write in (
        lambda: session.write_frame(frame(0)),
        lambda: session.write_load(sample(0)),
        lambda: session.write_clock(START),
        lambda: session.write_event(Event(1001.0, EventKind.NOTE, "operator", "x")),
    ):
        with pytest.raises(DataError, match="closed"):
            write()


def test_a_file_still_being_written_can_be_followed(path: Path) -> None:
    with writer(path) as session:
        session.write_frame(frame(0))
        session.flush()
        with Session.open(path) as back:
            assert back.recovered is not None and "still recording" in back.recovered
            assert len(back) == 1
            session.write_load(sample(1))
            session.write_frame(frame(1))
            session.flush()
            back.refresh()
            assert len(back) == 2 and len(back.load_samples()) == 1
            assert_same_frame(frame(1), back.frame(1))


def test_what_comes_slowly_is_in_the_file_at_once(path: Path) -> None:
    clock = Clock()
    with writer(path, now=clock) as session:
        for number in range(3):
            clock.now_s += 1.0
            session.write_load(LoadSample(START.monotonic + number, float(number)))
            with Session.open(path) as back:
                assert [s.force for s in back.load_samples()][-1] == number


def test_what_comes_fast_is_flushed_together_and_on_time(path: Path) -> None:
    clock = Clock()
    with writer(path, now=clock) as session:
        clock.now_s = 1.0
        session.write_frame(frame(0))
        clock.now_s += 0.025
        session.write_frame(frame(1))
        session.write_load(sample(0))
        session.write_event(Event(1001.0, EventKind.NOTE, "operator", "x"))
        assert session.flush_when_due() == pytest.approx(0.025)
        assert session.unflushed_frames == 1
        with Session.open(path) as back:
            assert (len(back), back.load_samples(), back.events()) == (1, [], [])
            clock.now_s += 0.05
            assert session.flush_when_due() == math.inf
            assert session.unflushed_frames == 0
            back.refresh()
            assert (len(back), len(back.load_samples()), len(back.events())) == (2, 1, 1)


def test_a_frame_that_cannot_be_told_leaves_the_rest(path: Path) -> None:
    with writer(path) as session:
        session.write_frame(frame(0))
        with pytest.raises(OverflowError):
            session.write_frame(frame(1, lost_before=2**40))
        session.write_frame(frame(2))
    with Session.open(path) as back:
        assert_same_frame(frame(0), back.frame(0))
        assert_same_frame(frame(2), back.frame(1))
        assert len(back) == 2


def test_foreign_files(tmp_path: Path) -> None:
    text, other = tmp_path / "a.h5", tmp_path / "b.h5"
    text.write_text("hello")
    h5py.File(other, "w").close()
    with pytest.raises(DataError, match="not an HDF5 file"):
        Session.open(text)
    with pytest.raises(DataError, match="not a session"):
        Session.open(other)
    with pytest.raises(DataError, match="no such file"):
        Session.open(tmp_path / "c.h5")


@pytest.mark.parametrize("version", [FORMAT_VERSION + 1, 99])
def test_a_newer_format_is_refused(path: Path, version: int) -> None:
    writer(path).close()
    with h5py.File(path, "r+") as file:
        file.attrs["format_version"] = version
    with pytest.raises(
        DataError, match=rf"format version {version}.*reads up to {FORMAT_VERSION}; update phasedic"
    ):
        Session.open(path)


def test_a_recording_is_no_live_camera_and_its_load_takes_no_tare(path: Path) -> None:
    recorded(path)
    told: list[Event] = []
    address = parse_address(f"session:{path}")
    with open_session_camera(address, told.append) as camera:
        assert CAMERA.live and not camera.info.live
        assert (camera.info.address, [one.index for one in camera]) == (address.text, [5])
    with open_session_load(address, told.append) as load:
        load.tare(force=True)
        load.undo_tare()
        assert [one.force for one in load] == [0.0]
    assert [event.data["tared"] for event in told] == [False, False]


def test_every_dataset_has_units_and_the_plots_are_named(path: Path) -> None:
    writer(path).close()
    without = []

    def look(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset) and "units" not in item.attrs:
            without.append(name)

    with h5py.File(path) as file:
        file.visititems(look)
        assert without == []
        assert file["entry"].attrs["default"] == b"frames"
        assert file["entry/frames"].attrs["default_slice"].tolist() == [b"0", b".", b"."]
        for group, signal in (("frames", "image"), ("load", "force")):
            assert len(file["entry"][group]["title"][()]) > 3
            assert file["entry"][group].attrs["NX_class"] == b"NXdata"
            assert file["entry"][group].attrs["signal"] == signal.encode()


def test_no_frame_beyond_the_end(path: Path) -> None:
    writer(path).close()
    with Session.open(path) as back, pytest.raises(DataError, match="no frame 0"):
        back.frame(0)


def test_what_stands_in_the_file_is_what_its_description_says(path: Path) -> None:
    """For other programs: events with the time of the test, stable as 1, 0 and -1."""
    with writer(path) as session:
        session.write_event(Event(START.monotonic + 2.5, EventKind.NOTE, "operator", "x"))
        for stable in (None, False, True):
            session.write_load(LoadSample(START.monotonic, 1.0, "N", stable))
    with h5py.File(path) as file:
        event = json.loads(file["entry/events"][0])
        assert (event["time_s"], event["monotonic_s"]) == (2.5, START.monotonic + 2.5)
        assert file["entry/load/stable"][:].tolist() == [-1, 0, 1]


@pytest.mark.parametrize(("bits", "kind"), [(1, np.uint8), (8, np.uint8), (9, np.uint16), (16, np.uint16)])
def test_samples_of_more_than_eight_bits_take_two_bytes(bits: int, kind: type) -> None:
    assert image_dtype(bits) == kind
