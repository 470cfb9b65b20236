"""Framed messages between a test and the process of its view, checked when they are read.

A message is a header (magic, version, kind, two lengths; little endian), a JSON object, and the bytes
of its arrays, each padded to 8. "arrays" in the object lists name, type and shape of each array. Nothing
that is read is executed.
"""

from __future__ import annotations

import json
import math
import socket
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.errors import DataError

MAGIC, VERSION = b"pdvw", 1
MAX_META_BYTES, MAX_BYTES = 2**23, 2**28
"""Limits of one message; a larger one is refused."""

_HEADER = struct.Struct("<4sHHIQ")
_TYPES = ("|b1", "|u1", "<u2", "<f4", "<f8")
_ALIGN = 8


class Kind(IntEnum):
    """Kind of a message; those from 20 on come from the process of the view."""

    SETUP = 1
    MEANS = 2
    FIELD = 3
    PICTURE = 4
    LOADS = 5
    POINTS = 6
    EVENTS = 7
    STATUS = 8
    END = 9
    FIGURES = 10
    GAUGE = 11
    WHOLE = 12
    SERVING = 20  # port (None: no server), rrd (None: no file)
    TROUBLE = 21  # text, lasting: whether a restart is useless
    FULL = 22  # memory_MiB: the process ends because it grew to this
    ENDED = 23


class WireError(DataError):
    """The data are not a message of this version, or contradict its header."""


@dataclass(frozen=True, slots=True, eq=False)
class Parcel:
    """One message.

    Attributes
    ----------
    kind : Kind
    meta : mapping of str to JSON value
    arrays : mapping of str to array of bool, uint8, uint16, float32 or float64
    """

    kind: Kind
    meta: Mapping[str, Any] = field(default_factory=dict)
    arrays: Mapping[str, NDArray[Any]] = field(default_factory=dict)


def encoded(message: Parcel) -> list[memoryview]:
    """The bytes of ``message`` in pieces. The arrays are not copied; they must not change until they are sent.

    Raises
    ------
    WireError
        An array has another type.
    """
    arrays = {name: np.ascontiguousarray(array) for name, array in message.arrays.items()}
    listed = [[name, array.dtype.str, array.shape] for name, array in arrays.items()]
    if unknown := [kind for _, kind, _ in listed if kind not in _TYPES]:
        raise WireError("arrays of {type} are not sent to the view", unknown[0])
    meta = json.dumps({**message.meta, "arrays": listed}).encode()
    meta += b" " * _padding(len(meta))
    total = sum(array.nbytes + _padding(array.nbytes) for array in arrays.values())
    pieces = [_HEADER.pack(MAGIC, VERSION, message.kind, len(meta), total) + meta]
    views = [memoryview(pieces[0])]
    for array in arrays.values():
        views += [array.reshape(-1).view(np.uint8).data, memoryview(b"\0" * _padding(array.nbytes))]
    return [view for view in views if view.nbytes]


def _padding(length: int) -> int:
    return -length % _ALIGN


class Reader:
    """Reads messages from a stream socket, blocking or not.

    Parameters
    ----------
    source : socket
    """

    def __init__(self, source: socket.socket) -> None:
        self._source = source
        self._head: tuple[Kind, int] | None = None
        self._expect(_HEADER.size)

    def next(self) -> Parcel:
        """The next message.

        Raises
        ------
        BlockingIOError
            The message is not complete yet; what was received is kept.
        EOFError
            The other side closed the socket.
        WireError
            The data are not a message.
        """
        if self._head is None:
            self._fill()
            kind, meta, total = _checked_header(bytes(self._buffer))
            self._head = kind, meta
            self._expect(meta + total)
        self._fill()
        (kind, meta), body = self._head, self._buffer
        self._head = None
        self._expect(_HEADER.size)
        return _message(kind, body, meta)

    def _expect(self, length: int) -> None:
        self._buffer, self._got = bytearray(length), 0

    def _fill(self) -> None:
        while self._got < len(self._buffer):
            received = self._source.recv_into(memoryview(self._buffer)[self._got :])
            if not received:
                raise EOFError
            self._got += received


def _checked_header(header: bytes) -> tuple[Kind, int, int]:
    magic, version, number, meta, total = _HEADER.unpack(header)
    if (magic, version) != (MAGIC, VERSION):
        raise WireError(
            "not a message of version {version} to or from the view: {bytes}", VERSION, repr(header[:6])
        )
    if meta > MAX_META_BYTES or total > MAX_BYTES:
        raise WireError("a message of {meta} + {total} bytes is too long for the view", meta, total)
    try:
        return Kind(number), meta, total
    except ValueError as error:
        raise WireError("the view has no message {number}", number) from error


def _message(kind: Kind, body: bytearray, length: int) -> Parcel:
    try:
        meta = json.loads(bytes(body[:length]))
        listed = [(str(name), str(dtype), tuple(shape)) for name, dtype, shape in meta.pop("arrays")]
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise WireError(
            "a message {kind} to or from the view is damaged: {error}", kind.name, error
        ) from error
    return Parcel(kind, meta, _arrays(kind, memoryview(body)[length:], listed))


def _arrays(
    kind: Kind, body: memoryview, listed: list[tuple[str, str, tuple[int, ...]]]
) -> dict[str, NDArray[Any]]:
    arrays, begin = {}, 0
    for name, dtype, shape in listed:
        if dtype not in _TYPES or any(type(n) is not int or n < 0 for n in shape):
            raise WireError(
                "a message {kind} to the view has an array of {dtype} {shape}", kind.name, dtype, shape
            )
        count, length = math.prod(shape), math.prod(shape) * np.dtype(dtype).itemsize
        if begin + length > len(body):
            raise WireError("a message {kind} to the view is shorter than its arrays", kind.name)
        arrays[name] = (
            np.frombuffer(body, dtype, count, begin).reshape(shape) if count else np.empty(shape, dtype)
        )
        begin += length + _padding(length)
    if begin != len(body):
        raise WireError("a message {kind} to the view is longer than its arrays", kind.name)
    return arrays
