"""A message is received as it was sent; anything else is refused."""

from __future__ import annotations

import json
import socket
import struct
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquire.events import Event, EventKind
from live.ui.rerun.messages import (
    MAX_PICTURE_BYTES,
    ViewSetup,
    ViewTarget,
    events_message,
    events_of,
    field_message,
    field_of,
    picture_message,
    picture_of,
    rows_message,
    rows_of,
    setup_message,
    setup_of,
)
from live.ui.rerun.wire import Kind, Parcel, Reader, WireError, encoded
from tests.live.made_up import START, make_frame, make_grid, make_measurement


def passed(*pieces: bytes | memoryview) -> Parcel:
    ours, theirs = socket.socketpair()
    with theirs, ThreadPoolExecutor() as other, ours:
        other.submit(send, ours, b"".join(pieces))
        return Reader(theirs).next()


def send(ours: socket.socket, data: bytes) -> None:
    ours.sendall(data)
    ours.shutdown(socket.SHUT_WR)


def sent_and_received(message: Parcel) -> Parcel:
    return passed(*encoded(message))


def test_a_setup() -> None:
    setup = ViewSetup("a test", 128, 96, 12, make_grid(), START, area_m2=4e-5, axis="x", strain_range=0.01)
    again, target = setup_of(sent_and_received(setup_message(setup, ViewTarget(9876, "/tmp/view.rrd", "id"))))
    assert target == ViewTarget(9876, "/tmp/view.rrd", "id")
    assert (again.title, again.area_m2, again.axis, again.strain_range) == ("a test", 4e-5, "x", 0.01)
    assert again.grid.to_dict() == setup.grid.to_dict()
    np.testing.assert_array_equal(again.grid.active, setup.grid.active)


def test_a_field() -> None:
    sent = make_measurement(3, 2e-3)
    t, field = field_of(sent_and_received(field_message(sent.t, sent.field)))
    assert t == sent.t
    for name in ("u", "v", "exx", "eyy", "exy", "sigma_exx", "sigma_exy", "status"):
        np.testing.assert_array_equal(getattr(field, name), getattr(sent.field, name))
    np.testing.assert_array_equal(field.grid.active, sent.field.grid.active)


@pytest.mark.parametrize("shape", [(96, 128), (3000, 4000)])
def test_a_picture(shape: tuple[int, int]) -> None:
    frame = make_frame(0, START, shape)
    picture = picture_of(sent_and_received(picture_message(frame)))
    assert picture.image.nbytes <= MAX_PICTURE_BYTES
    assert picture.step == (1 if shape[0] < 100 else 2)
    np.testing.assert_array_equal(picture.image, frame.image[:: picture.step, :: picture.step])
    assert (picture.bits, picture.t) == (12, START)


def test_rows_and_events() -> None:
    rows = [(START, 1.0), (START + 1, float("nan"))]
    again = rows_of(sent_and_received(rows_message(Kind.LOADS, rows)))
    assert again[0] == rows[0]
    np.testing.assert_array_equal(again, rows)
    assert rows_of(sent_and_received(rows_message(Kind.MEANS, []))) == []
    event = Event(START, EventKind.TARE, "operator", "Kraft ΔF genullt", "warning")
    assert events_of(sent_and_received(events_message([event]))) == [event]


def test_it_is_received_in_pieces() -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        theirs.setblocking(False)
        reader = Reader(theirs)
        message = rows_message(Kind.LOADS, [(1.0, 2.0)])
        for byte in b"".join(encoded(message)):
            with pytest.raises(BlockingIOError):
                reader.next()
            ours.sendall(bytes([byte]))
        assert rows_of(reader.next()) == [(1.0, 2.0)]


def framed(meta: bytes, body: bytes = b"", **how: Any) -> bytes:
    how = {"magic": b"pdvw", "version": 1, "kind": Kind.LOADS, "meta": len(meta), "total": len(body), **how}
    return struct.pack("<4sHHIQ", *how.values()) + meta + body


def listing(*arrays: Any) -> bytes:
    return json.dumps({"arrays": arrays}).encode()


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (framed(b"{}", magic=b"RRF2"), "not a message"),
        (framed(b"{}", version=2), "not a message of version 1"),
        (framed(b"{}", kind=99), "has no message 99"),
        (framed(b"{}", total=2**60), "too long"),
        (framed(b"{}"), "damaged"),
        (framed(b"\xff"), "damaged"),
        (framed(b"[]"), "damaged"),
        (framed(listing(["rows", "|O", [1]]), b"12345678"), "array of"),
        (framed(listing(["rows", "<f8", [-1]]), b"12345678"), "array of"),
        (framed(listing(["rows", "<f8", [2**40, 2**40]]), b"12345678"), "shorter"),
        (framed(listing(["rows", "<f8", [1]]), b"1234567812345678"), "longer"),
    ],
)
def test_what_is_no_message_is_refused(data: bytes, message: str) -> None:
    with pytest.raises(WireError, match=message):
        passed(data)


@given(st.binary(max_size=200), st.sampled_from(list(Kind)))
def test_any_bytes_are_a_message_or_refused(body: bytes, kind: Kind) -> None:
    with pytest.raises((WireError, EOFError)):
        passed(framed(body[:50], body[50:], kind=kind))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (rows_of, Parcel(Kind.LOADS, {}, {"rows": np.zeros((2, 3))})),
        (rows_of, Parcel(Kind.LOADS)),
        (picture_of, Parcel(Kind.PICTURE, {"t": 0.0, "bits": 8, "step": 1}, {"image": np.zeros((2, 2, 2), np.uint8)})),
        (picture_of, Parcel(Kind.PICTURE, {"t": 0.0}, {"image": np.zeros((2, 2), np.uint8)})),
        (events_of, Parcel(Kind.EVENTS, {"events": [[1.0, "no such kind", "", "", "info"]]})),
        (setup_of, Parcel(Kind.SETUP, {"grid": {}}, {"active": np.ones((2, 2), bool)})),
        (field_of, Parcel(Kind.FIELD, {"t": 0.0, "grid": None}, {"active": np.ones((2, 2), bool)})),
    ],
)  # fmt: skip
def test_a_message_with_something_else_in_it_is_refused(make: Any, message: Parcel) -> None:
    with pytest.raises(WireError):
        make(sent_and_received(message))


def test_arrays_of_other_types_are_not_sent() -> None:
    with pytest.raises(WireError, match="<i8"):
        encoded(Parcel(Kind.LOADS, {}, {"rows": np.zeros(3, np.int64)}))
