"""What of a foreign session file is believed, and which rows are left out."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquire.errors import DataError
from acquire.hdf5 import to_json
from acquire.session.layout import BURST_COLUMNS, FRAME_COLUMNS, describe_camera, describe_load
from acquire.session.stored import (
    Oddities,
    Rows,
    camera_from,
    config_from,
    events_from,
    load_from,
    read_column,
    read_rows,
)
from tests.acquire.session.fixtures import CAMERA, LOAD


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


def rows_of(folder: Path, columns: dict[str, Any], *, closed: bool) -> Rows:
    """What a file of damaged columns holds."""
    with h5py.File(folder / "rows.h5", "w") as file:
        group = file.create_group("entry/frames")
        for name, values in columns.items():
            group.create_dataset(name, data=values)
        form = {name: {**FRAME_COLUMNS, **BURST_COLUMNS}[name] for name in columns}
        return read_rows(group, form, whole=False, closed=closed)


def test_rows_at_the_end_that_are_not_written_yet_are_no_trouble(tmp_path: Path) -> None:
    nan = np.nan
    table = {
        "monotonic_s": np.array([1.0, nan, 3.0, nan, nan]),
        "lost_before": np.array([0, 2, 1, 0, 0], np.uint32),
    }
    rows = rows_of(tmp_path, table, closed=False)
    assert rows.places.tolist() == [0, 2] and len(rows) == 2
    assert rows.troubles == ("1 of 3 frames have no time, or values beyond sense, and are left out",)
    assert rows.columns["lost_before"].tolist() == [0, 1 + 1 + 2], "that frame, and what was lost before it"
    table["monotonic_s"][:] = nan
    none = rows_of(tmp_path, table, closed=False)
    assert none.troubles == ("none of 5 frames has a time, so all are left out",) and len(none) == 0


def test_of_a_file_that_was_closed_the_rows_at_the_end_are_missed(tmp_path: Path) -> None:
    rows = rows_of(tmp_path, {"monotonic_s": np.array([1.0, np.nan, np.nan])}, closed=True)
    assert rows.troubles == ("2 of 3 frames have no time, or values beyond sense, and are left out",)


def test_of_bursts_all_their_frames_are_lost(tmp_path: Path) -> None:
    table = {
        "monotonic_s": np.array([1.0, np.nan, 3.0]),
        "n": np.array([4, 5, 6], np.uint32),
        "lost": np.array([0, 2, 1], np.uint32),
    }
    rows = rows_of(tmp_path, table, closed=True)
    assert rows.columns["lost"].tolist() == [0, 1 + 5 + 2]


@settings(deadline=None)
@given(
    st.lists(st.sampled_from([0.0, 1.0, 2.0, 3.0, np.nan]), max_size=12),
    st.integers(1, 12),
    st.booleans(),
)
def test_oddities_by_the_piece_are_those_of_all(times: list[float], size: int, closed: bool) -> None:
    every, pieces = (Oddities("load", closed=closed) for _ in range(2))
    t = np.array(times, np.float64)
    for odd, step in ((every, max(len(t), 1)), (pieces, size)):
        for first in range(0, len(t), step):
            part = t[first : first + step]
            odd.add(~np.isnan(part), part[~np.isnan(part)])
    assert pieces.words() == every.words() and pieces.left_out == every.left_out
    kept = t[~np.isnan(t)]
    last = len(t) if closed else 1 + max(np.flatnonzero(~np.isnan(t)), default=-1)
    assert every.left_out == last - len(kept)
    assert ("run backwards" in " ".join(every.words())) == bool(np.any(np.diff(kept) < 0))


def test_times_of_zero_all_over_a_chunk_were_never_written(tmp_path: Path) -> None:
    """As of the padding of a file that is cut; the force may be zero for long."""
    with h5py.File(tmp_path / "rows.h5", "w") as file:
        t = np.arange(1.0, 11.0)
        t[4:8] = 0.0
        times = file.create_dataset("monotonic_s", data=t, chunks=(4,))
        forces = file.create_dataset("force", data=np.zeros(10), chunks=(4,))
        odd = np.isnan(read_column(times, missing=np.nan, whole=False))
        assert np.flatnonzero(odd).tolist() == [4, 5, 6, 7] and len(odd) == 10
        part = np.isnan(read_column(times, 10, np.nan, first=6, whole=False))
        assert part.tolist() == [True, True, False, False]
        assert not read_column(times, whole=True)[4:8].any()
        assert not np.isnan(read_column(forces, missing=np.nan, whole=False)).any()
