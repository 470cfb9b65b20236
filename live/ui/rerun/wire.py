"""Messages between a test and the process of its view, checked when they are read.

A message is a JSON text (kind, content, and name, type and shape of each array), then the bytes of each array.
``multiprocessing.connection`` frames them; it is given bytes alone, so that nothing that is read is executed.
"""

from __future__ import annotations

import json
import math
import select
import socket
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.errors import DataError

MAX_META_BYTES, MAX_BYTES = 2**23, 2**28
"""Limits of one message, of its text and of its arrays; a larger one is refused."""

_TYPES = ("|b1", "|u1", "<u2", "<f4", "<f8")


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


class MessagePipe:
    """Sends and reads messages through a stream socket; one thread may send while another reads.

    Parameters
    ----------
    connected : socket
        Blocking. It stays that of the caller.
    """

    def __init__(self, connected: socket.socket) -> None:
        self._connection = Connection(connected.dup().detach())

    def close(self) -> None:
        """Close it."""
        self._connection.close()

    def ready(self, seconds: float = 0.0) -> bool:
        """Whether something can be read, also an end, within this time."""
        return bool(select.select([self._connection], [], [], seconds)[0])

    def send(self, message: Parcel) -> None:
        """Send a message; its arrays are not copied.

        Raises
        ------
        WireError
            An array has another type.
        OSError
            The other side closed the socket, or takes nothing (``acquire.system.send_within``).
        """
        arrays = {name: np.ascontiguousarray(array) for name, array in message.arrays.items()}
        listed = [[name, array.dtype.str, array.shape] for name, array in arrays.items()]
        if unknown := [kind for _, kind, _ in listed if kind not in _TYPES]:
            raise WireError("arrays of {type} are not sent to the view", unknown[0])
        self._connection.send_bytes(json.dumps([message.kind, message.meta, listed]).encode())
        for array in arrays.values():
            self._connection.send_bytes(array.reshape(-1).view(np.uint8).data)

    def next(self) -> Parcel:
        """The next message.

        Raises
        ------
        EOFError, OSError
            The other side closed the socket.
        WireError
            The data are not a message.
        """
        text = self._read(MAX_META_BYTES)
        try:
            number, meta, arrays = json.loads(text)
            listed = [(str(name), str(dtype), tuple(shape)) for name, dtype, shape in arrays]
            kind, meta = Kind(number), dict(meta)
        except (ValueError, TypeError, RecursionError) as error:
            raise WireError("a message to or from the view is damaged: {error}", error) from error
        for _, dtype, shape in listed:
            if dtype not in _TYPES or any(type(n) is not int or n < 0 for n in shape):
                raise WireError(
                    "a message {kind} to the view has an array of {dtype} {shape}", kind.name, dtype, shape
                )
        if sum(_length(dtype, shape) for _, dtype, shape in listed) > MAX_BYTES:
            raise WireError("a message {kind} is too long for the view", kind.name)
        return Parcel(kind, meta, {name: self._array(kind, dtype, shape) for name, dtype, shape in listed})

    def _array(self, kind: Kind, dtype: str, shape: tuple[int, ...]) -> NDArray[Any]:
        length = _length(dtype, shape)
        data = self._read(length)
        if len(data) != length:
            raise WireError("a message {kind} to the view is shorter than its arrays", kind.name)
        return np.frombuffer(data, dtype).reshape(shape) if length else np.empty(shape, dtype)

    def _read(self, most: int) -> bytes:
        try:
            return self._connection.recv_bytes(most)
        except OSError as error:
            if self._connection.readable:  # cut off: the other side has ended
                raise
            raise WireError("a message to or from the view has more than {most} bytes", most) from error


def _length(dtype: str, shape: tuple[int, ...]) -> int:
    return math.prod(shape) * np.dtype(dtype).itemsize
