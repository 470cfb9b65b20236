"""One open GenICam camera: its features, its stream, its buffers.

Every method is one or a few requests; a ``GenicamError`` goes to the caller, who decides what it means for the
test. Requests to a camera that is gone block for seconds: who must not wait opens and closes in a thread of its own.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from acquire.genicam.library import Aravis, GenicamError
from acquire.text import Message

Take = Callable[[memoryview, int], Any]

RANGE_CHECK = 1  # ARV_RANGE_CHECK_POLICY_ENABLE
NO_ADJUSTMENT = 0  # ARV_GV_PACKET_SIZE_ADJUSTMENT_NEVER
SUCCESS = 0
STATUS = {
    -1: Message("unknown trouble"),
    1: "cleared",
    2: Message("packets were missing until the time was over"),
    3: Message("packets are missing"),
    4: Message("a packet has a wrong number"),
    5: Message("it is larger than agreed"),
    6: Message("it is not complete"),
    7: Message("it was aborted"),
    8: Message("it is no picture"),
}


@dataclass(frozen=True, slots=True)
class CameraIdentity:
    """Who a camera is, so that it is found again under another address.

    Attributes
    ----------
    vendor, model, serial : str
    """

    vendor: str
    model: str
    serial: str

    def __str__(self) -> str:
        return Message("{vendor} {model} ({serial})", self.vendor, self.model, self.serial)


@dataclass(frozen=True, slots=True, eq=False)
class Received:
    """A buffer that was received.

    Attributes
    ----------
    number : int
        The camera's number of the frame.
    stamp_ns : int, ns
        On the camera's clock; 0 where it has none.
    age_s : float, s
        Since it began to arrive.
    trouble : str
        Why it is no whole picture; "" where it is one.
    size : (width, height), px
    taken : Any
        What was made of its bytes; None where there is trouble.
    """

    number: int
    stamp_ns: int
    age_s: float
    trouble: str
    size: tuple[int, int]
    taken: Any


class GenicamDevice:
    """An open camera; ``close()`` it.

    Parameters
    ----------
    library : Aravis
    name : str
        Its identifier or IP address, as Aravis takes it.

    Attributes
    ----------
    lost : threading.Event
        Set when the library finds that the camera no longer answers.

    Raises
    ------
    GenicamError
        It is not there, or does not answer.
    """

    def __init__(self, library: Aravis, name: str) -> None:
        self._library = library
        # Requests wait for one another, pictures for nobody; whoever closes waits for both.
        self._requests, self._pictures = threading.RLock(), threading.RLock()
        self._stream: int | None = None
        self._handle: int | None = library.call("arv_camera_new", name)
        if not self._handle:
            raise GenicamError("it is not there")
        try:
            self._device = library.call("arv_camera_get_device", self._handle)
            self.lost = threading.Event()
            self._handler = library.on_signal(self._device, "control-lost", self.lost.set)
            library.call("arv_camera_set_range_check_policy", self._handle, RANGE_CHECK)
            self.is_gige = bool(library.call("arv_camera_is_gv_device", self._handle))
            if self.is_gige and not self._library.call("arv_gv_device_is_controller", self._device):
                raise GenicamError("another program holds the camera")
            self.identity = self._identify()
        except BaseException:
            self.close()
            raise

    def _identify(self) -> CameraIdentity:
        names = ("vendor_name", "model_name", "device_serial_number")
        found = []
        for name in names:
            try:
                found.append(self.ask(f"arv_camera_get_{name}") or "")
            except GenicamError:
                found.append("")
        return CameraIdentity(*found)

    # Features

    def ask(self, name: str, *arguments: Any) -> Any:
        """One call of the library that takes the camera first."""
        with self._requests:
            if self._handle is None:
                raise GenicamError("the camera is closed")
            return self._library.call(name, self._handle, *arguments)

    def bounds_of(self, what: str) -> tuple[float, float]:
        """Lowest and highest ``frame_rate``, ``exposure_time`` or ``gain``."""
        return self._library.bounds(f"arv_camera_get_{what}_bounds", self._handle)

    def has(self, feature: str) -> bool:
        """Whether there is such a feature now."""
        try:
            return bool(self.ask("arv_camera_is_feature_available", feature))
        except GenicamError:
            return False

    def kind(self, feature: str) -> str:
        """The type of its node: ``Enumeration``, ``Boolean``, ``Command``, ``IntegerNode`` ..."""
        return str(self._library.call("g_type_name_from_instance", self._node(feature))).removeprefix("ArvGc")

    def _node(self, feature: str) -> int:
        node = self._library.call("arv_device_get_feature", self._device, feature)
        if not node:
            raise GenicamError("there is no feature {feature}", feature)
        return int(node)

    def text(self, feature: str) -> str:
        """Its value as text."""
        return str(self._library.call("arv_gc_feature_node_get_value_as_string", self._node(feature)))

    def set_text(self, feature: str, value: str) -> None:
        """Set it; ``text`` reads what is in force."""
        self._library.call("arv_gc_feature_node_set_value_from_string", self._node(feature), value)

    def integer(self, feature: str) -> int:
        """Its value as a whole number."""
        return int(self.ask("arv_camera_get_integer", feature))

    def set_integer(self, feature: str, value: int) -> None:
        """Set it; ``integer`` reads what is in force."""
        self.ask("arv_camera_set_integer", feature, value)

    def integer_bounds(self, feature: str) -> tuple[int, int, int]:
        """Lowest and highest value, and the step."""
        low, high = self._library.bounds("arv_camera_get_integer_bounds", self._handle, feature, whole=True)
        return int(low), int(high), int(self.ask("arv_camera_get_integer_increment", feature))

    def highest(self, feature: str) -> int:
        """The highest value of a whole number."""
        return self.integer_bounds(feature)[1]

    def choices(self, feature: str) -> list[str]:
        """The values that an enumeration has now."""
        return self._library.texts("arv_camera_dup_available_enumerations_as_strings", self._handle, feature)

    # Its stream

    @property
    def streaming(self) -> bool:
        """Whether it was started."""
        return self._stream is not None

    def start(self, count: int) -> None:
        """Give it ``count`` buffers, and stream."""
        payload = self.ask("arv_camera_get_payload")
        stream = self.ask("arv_camera_create_stream", None, None)
        if not stream:
            raise GenicamError("no stream can be made")
        self._stream = int(stream)
        for _ in range(count):
            self._library.call(
                "arv_stream_push_buffer", stream, self._library.call("arv_buffer_new_allocate", payload)
            )
        self.ask("arv_camera_start_acquisition")

    def fetch(self, timeout_s: float, take: Take) -> Received | None:
        """The next picture within that time: ``take`` copies it out of the buffer, which goes back at once.

        ``take`` gets its bytes, and how many of them are padding after each row.
        """
        with self._pictures:
            if self._stream is None:
                raise GenicamError("the camera is closed")
            buffer = self._library.call("arv_stream_timeout_pop_buffer", self._stream, round(timeout_s * 1e6))
            if not buffer:
                return None
            try:
                return self._received(buffer, take)
            finally:
                self._library.call("arv_stream_push_buffer", self._stream, buffer)

    def _received(self, buffer: int, take: Take) -> Received:
        about = {
            name: self._library.call(f"arv_buffer_get_{name}", buffer)
            for name in ("status", "frame_id", "timestamp", "system_timestamp")
        }
        good = about["status"] == SUCCESS
        size = tuple(
            self._library.call(f"arv_buffer_get_image_{side}", buffer) if good else 0
            for side in ("width", "height")
        )
        with self._library.content(buffer) as content:
            taken = take(content, self._library.row_padding(buffer)) if good else None
        age = (time.time_ns() - about["system_timestamp"]) * 1e-9
        return Received(
            number=about["frame_id"],
            stamp_ns=about["timestamp"],
            age_s=age if 0 <= age < 60 else 0.0,  # the wall clock may have been set
            trouble="" if good else STATUS.get(about["status"], "unknown trouble"),
            size=(size[0], size[1]),
            taken=taken,
        )

    def close(self) -> None:
        """Stop and give everything back; idempotent."""
        with self._requests, self._pictures:
            stream, self._stream = self._stream, None
            handle, self._handle = self._handle, None
        if stream is not None:
            with contextlib.suppress(GenicamError):
                self._library.call("arv_camera_stop_acquisition", handle)
            self._library.call("g_object_unref", stream)
        if handle is not None:
            self._library.call("g_object_unref", handle)
