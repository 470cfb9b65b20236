"""A message is received as it was sent; anything else is refused."""

from __future__ import annotations

import json
import pickle
import socket
import struct
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
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
from live.ui.rerun.wire import MAX_META_BYTES, Kind, MessagePipe, Parcel, WireError
from tests.live.made_up import START, make_frame, make_grid, make_measurement


@contextmanager
def pipes() -> Iterator[tuple[MessagePipe, MessagePipe]]:
    ours, theirs = socket.socketpair()
    both = MessagePipe(ours), MessagePipe(theirs)
    with ours, theirs, closing(both[0]), closing(both[1]):
        yield both


def passed(*pieces: bytes) -> Parcel:
    """What is read of these parts of a message, where nothing comes after them."""
    with pipes() as (ours, theirs):
        for piece in pieces:
            ours._connection.send_bytes(piece)
        return theirs.next()


def sent_and_received(message: Parcel) -> Parcel:
    with pipes() as (ours, theirs), ThreadPoolExecutor() as other:
        sent = other.submit(ours.send, message)
        received = theirs.next()
        sent.result()
        return received


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


def text(*arrays: Any, kind: Any = Kind.LOADS, meta: Any = None) -> bytes:
    return json.dumps([kind, {} if meta is None else meta, arrays]).encode()


@pytest.mark.parametrize(
    ("pieces", "message"),
    [
        ([b"{}"], "damaged"),
        ([b"\xff"], "damaged"),
        ([b"[" * 100_000], "damaged"),
        ([pickle.dumps(Kind.LOADS)], "damaged"),
        ([text(kind=99)], "damaged"),
        ([text(meta=1)], "damaged"),
        ([text(["rows", "|O", [1]]), b"12345678"], "array of"),
        ([text(["rows", "<f8", [-1]]), b"12345678"], "array of"),
        ([text(["rows", "<f8", [True]]), b"12345678"], "array of"),
        ([text(["rows", "<f8", [2**40, 2**40]]), b"12345678"], "too long"),
        ([text(*[["rows", "|u1", [2**27]]] * 3), b"12345678"], "too long"),
        ([text(["rows", "<f8", [2]]), b"12345678"], "shorter"),
        ([text(["rows", "<f8", [1]]), b"1234567812345678"], "more than 8 bytes"),
    ],
)
def test_what_is_no_message_is_refused(pieces: list[bytes], message: str) -> None:
    with pytest.raises(WireError, match=message):
        passed(*pieces)


@pytest.mark.parametrize("head", [struct.pack("!i", MAX_META_BYTES + 1), struct.pack("!iQ", -1, 2**60)])
def test_what_announces_too_much_is_refused_unread(head: bytes) -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs, closing(MessagePipe(theirs)) as pipe:
        ours.sendall(head)
        with pytest.raises(WireError, match="more than 8388608 bytes"):
            pipe.next()


@given(st.binary(max_size=200))
def test_any_bytes_are_a_message_or_refused(body: bytes) -> None:
    with pytest.raises(WireError):
        passed(body)


def test_a_message_that_ends_in_the_middle_is_an_end() -> None:
    ours, theirs = socket.socketpair()
    with theirs, closing(MessagePipe(theirs)) as pipe:
        with ours:
            ours.sendall(struct.pack("!i", 100) + b"[")
        with pytest.raises(OSError, match="end of file"):
            pipe.next()


def test_arrays_of_other_types_are_not_sent() -> None:
    with pipes() as (ours, _), pytest.raises(WireError, match="<i8"):
        ours.send(Parcel(Kind.LOADS, {}, {"rows": np.zeros(3, np.int64)}))
