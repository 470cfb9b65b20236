"""What stands in a session file: groups, columns with units and ranges, long events."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import h5py
import numpy as np
import pytest

from acquire.burst import burst_of
from acquire.errors import DataError
from acquire.events import Event, EventKind
from acquire.record_mode import RecordMode
from acquire.session import Session, layout
from acquire.session.layout import event_rows
from acquire.text import Message
from tests.acquire.session.fixtures import frame, sample, writer


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


TIME, COUNT = ("f8", "s", -1e12, 1e12), ("u4", "none", 0, np.inf)
INDEX, CLOCK = ("i8", "none", 0, np.inf), ("u1", "none", 0, 2)
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
        "blank": ("u4", "none", 0, 65536),
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


def test_a_file_of_before_has_no_blank_pictures(path: Path) -> None:
    with writer(path, mode=RecordMode("bursts")) as session:
        session.write_burst(dataclasses.replace(burst_of([frame(k) for k in range(2)]), blank=1))
    with Session.open(path) as back:
        assert back.burst(0).blank == 1
    with h5py.File(path, "r+") as file:
        del file["entry/bursts/blank"]
    with Session.open(path) as back:
        assert back.burst(0).blank == 0
    with h5py.File(path, "r+") as file:
        del file["entry/bursts/noise"]
    with pytest.raises(DataError, match="noise is missing"):
        Session.open(path)


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


def test_a_long_event_goes_on_in_rows_that_begin_with_a_plus() -> None:
    rows = event_rows(Event(10.0, EventKind.NOTE, "operator", "y" * 1200), 4.0)
    assert [len(row) for row in rows.tolist()][:2] == [512, 512]
    assert [row[:1] for row in rows.tolist()] == [b"{", b"+", b"+"]
    whole = json.loads(b"".join((rows[0], *(row[1:] for row in rows[1:]))))
    assert (whole["time_s"], whole["monotonic_s"], whole["text"]) == (6.0, 10.0, "y" * 1200)
    assert "message" not in whole


def test_an_event_comes_back_as_the_message_that_it_was(path: Path) -> None:
    text = Message("no picture for {waited:.1f} s; still waiting", 2.0)
    with writer(path) as session:
        session.write_event(Event(1001.0, EventKind.DEVICE, "camera", text, "warning"))
    with Session.open(path) as back:
        (event,) = back.events()
    assert event.text == str(text) and isinstance(event.text, Message)
    assert (event.text.template, event.text.values) == (text.template, text.values)
