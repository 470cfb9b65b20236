"""What of a foreign session file is believed, and which rows are left out."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from acquire.errors import DataError
from acquire.hdf5 import to_json
from acquire.session.layout import describe_camera, describe_load
from acquire.session.stored import _chosen, camera_from, config_from, events_from, load_from
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
