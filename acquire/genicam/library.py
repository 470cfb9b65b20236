"""Aravis 0.8 by ctypes: the C functions that are used, and their errors as exceptions.

Facts of ``arv.h`` and nothing else. The library (LGPL-2.1 or later) is loaded when the first ``genicam:`` address is
opened or cameras are listed; tests may put another object with the same methods in its place.
"""

from __future__ import annotations

import ctypes as c
import ctypes.util
from collections.abc import Callable
from functools import cache
from typing import Any

from acquire.camera.live import DeviceFault
from acquire.errors import DeviceError
from acquire.text import Message

LIBRARY = "libaravis-0.8.so.0"
OTHER_VERSIONS = ("aravis-0.10", "aravis-0.9", "aravis-0.6")
HOW_TO_INSTALL = "sudo apt install libaravis-0.8-0 (docs/machine-vision.md)"

_object, _text, _bool, _int, _uint = c.c_void_p, c.c_char_p, c.c_int, c.c_int, c.c_uint
_int64, _uint64, _double, _size = c.c_int64, c.c_uint64, c.c_double, c.c_size_t

_Bounds = tuple[float, float]

_Handler = c.CFUNCTYPE(None, c.c_void_p, c.c_void_p)


class _GError(c.Structure):
    _fields_ = (("domain", c.c_uint32), ("code", c.c_int), ("message", c.c_char_p))


_ERROR = c.POINTER(c.POINTER(_GError))


class GenicamError(DeviceFault):
    """A request that the library or the camera refused; the text is theirs."""


# Name -> result and arguments; what can fail has _ERROR at its end.
CALLS: dict[str, tuple[Any, ...]] = {
    "arv_update_device_list": (None,),
    "arv_get_n_devices": (_uint,),
    "arv_get_device_id": (_text, _uint),
    "arv_get_device_vendor": (_text, _uint),
    "arv_get_device_model": (_text, _uint),
    "arv_get_device_serial_nbr": (_text, _uint),
    "arv_get_device_address": (_text, _uint),
    "arv_get_device_protocol": (_text, _uint),
    "arv_camera_new": (_object, _text, _ERROR),
    "arv_camera_get_device": (_object, _object),
    "arv_camera_get_vendor_name": (_text, _object, _ERROR),
    "arv_camera_get_model_name": (_text, _object, _ERROR),
    "arv_camera_get_device_serial_number": (_text, _object, _ERROR),
    "arv_camera_set_range_check_policy": (None, _object, _int),
    "arv_camera_is_gv_device": (_bool, _object),
    "arv_gv_device_is_controller": (_bool, _object),
    "arv_camera_gv_auto_packet_size": (_uint, _object, _ERROR),
    "arv_camera_gv_set_packet_size": (None, _object, _int, _ERROR),
    "arv_camera_gv_get_packet_size": (_uint, _object, _ERROR),
    "arv_camera_gv_set_packet_size_adjustment": (None, _object, _int),
    "arv_camera_is_feature_available": (_bool, _object, _text, _ERROR),
    "arv_device_get_feature": (_object, _object, _text),
    "arv_gc_feature_node_get_value_as_string": (_text, _object, _ERROR),
    "arv_gc_feature_node_set_value_from_string": (None, _object, _text, _ERROR),
    "arv_camera_dup_available_enumerations_as_strings": (
        _object, _object, _text, c.POINTER(_uint), _ERROR,
    ),
    "arv_camera_get_integer": (_int64, _object, _text, _ERROR),
    "arv_camera_set_integer": (None, _object, _text, _int64, _ERROR),
    "arv_camera_get_integer_bounds": (
        None, _object, _text, c.POINTER(_int64), c.POINTER(_int64), _ERROR,
    ),
    "arv_camera_get_integer_increment": (_int64, _object, _text, _ERROR),
    "arv_camera_get_float_bounds": (
        None, _object, _text, c.POINTER(_double), c.POINTER(_double), _ERROR,
    ),
    "arv_camera_is_frame_rate_available": (_bool, _object, _ERROR),
    "arv_camera_get_frame_rate": (_double, _object, _ERROR),
    "arv_camera_set_frame_rate": (None, _object, _double, _ERROR),
    "arv_camera_get_frame_rate_bounds": (None, _object, c.POINTER(_double), c.POINTER(_double), _ERROR),
    "arv_camera_is_exposure_time_available": (_bool, _object, _ERROR),
    "arv_camera_get_exposure_time": (_double, _object, _ERROR),
    "arv_camera_set_exposure_time": (None, _object, _double, _ERROR),
    "arv_camera_get_exposure_time_bounds": (None, _object, c.POINTER(_double), c.POINTER(_double), _ERROR),
    "arv_camera_is_gain_available": (_bool, _object, _ERROR),
    "arv_camera_get_gain": (_double, _object, _ERROR),
    "arv_camera_set_gain": (None, _object, _double, _ERROR),
    "arv_camera_get_gain_bounds": (None, _object, c.POINTER(_double), c.POINTER(_double), _ERROR),
    "arv_camera_clear_triggers": (None, _object, _ERROR),
    "arv_camera_set_trigger": (None, _object, _text, _ERROR),
    "arv_camera_dup_available_trigger_sources": (_object, _object, c.POINTER(_uint), _ERROR),
    "arv_camera_software_trigger": (None, _object, _ERROR),
    "arv_camera_get_payload": (_uint, _object, _ERROR),
    "arv_camera_create_stream": (_object, _object, _object, _object, _ERROR),
    "arv_camera_start_acquisition": (None, _object, _ERROR),
    "arv_camera_stop_acquisition": (None, _object, _ERROR),
    "arv_stream_push_buffer": (None, _object, _object),
    "arv_stream_timeout_pop_buffer": (_object, _object, _uint64),
    "arv_stream_try_pop_buffer": (_object, _object),
    "arv_buffer_new_allocate": (_object, _size),
    "arv_buffer_get_status": (_int, _object),
    "arv_buffer_get_data": (_object, _object, c.POINTER(_size)),
    "arv_buffer_get_timestamp": (_uint64, _object),
    "arv_buffer_get_system_timestamp": (_uint64, _object),
    "arv_buffer_get_frame_id": (_uint64, _object),
    "arv_buffer_get_image_width": (_int, _object),
    "arv_buffer_get_image_height": (_int, _object),
    "arv_buffer_get_image_pixel_format": (c.c_uint32, _object),
    "g_object_unref": (None, _object),
    "g_free": (None, _object),
    "g_error_free": (None, _object),
    "g_type_name_from_instance": (_text, _object),
}  # fmt: skip


class Aravis:
    """The calls into the library; nothing above this class calls C."""

    def __init__(self) -> None:
        # Aravis brings glib and gobject with it: their functions are found through its handle.
        library = c.CDLL(LIBRARY)
        self._functions: dict[str, Any] = {}
        for name, (result, *arguments) in CALLS.items():
            function = getattr(library, name)
            function.restype, function.argtypes = result, arguments
            self._functions[name] = function
        # Since 0.8.23; an older one has no padding to report.
        self._get_padding = getattr(library, "arv_buffer_get_image_padding", None)
        if self._get_padding is not None:
            self._get_padding.restype = None
            self._get_padding.argtypes = [_object, c.POINTER(_int), c.POINTER(_int)]
        self._connect = library.g_signal_connect_data
        self._connect.argtypes = [_object, _text, _Handler, _object, _object, _int]
        self._connect.restype = c.c_ulong

    def call(self, name: str, *arguments: Any) -> Any:
        """One function of ``CALLS``, without the place for its error; a text comes decoded.

        Raises
        ------
        GenicamError
            It reported an error.
        """
        function = self._functions[name]
        values = [one.encode() if isinstance(one, str) else one for one in arguments]
        if function.argtypes[-1:] != [_ERROR]:
            return _decoded(function(*values))
        error = c.POINTER(_GError)()
        result = function(*values, c.byref(error))
        if error:
            text = _decoded(error.contents.message)
            self._functions["g_error_free"](error)
            raise GenicamError(text)
        return _decoded(result)

    def bounds(self, name: str, *arguments: Any, whole: bool = False) -> _Bounds:
        """Lowest and highest value that a function of ``CALLS`` gives through pointers."""
        low, high = (_int64() if whole else _double() for _ in range(2))
        self.call(name, *arguments, c.byref(low), c.byref(high))
        return low.value, high.value

    def texts(self, name: str, *arguments: Any) -> list[str]:
        """The texts that a function of ``CALLS`` gives as an array."""
        count = _uint()
        array = self.call(name, *arguments, c.byref(count))
        if not array:
            return []
        found = c.cast(array, c.POINTER(_text))
        texts = [_decoded(found[k]) for k in range(count.value)]
        self.call("g_free", array)
        return texts

    def content(self, buffer: int) -> memoryview:
        """The bytes of a buffer, where they lie: only valid until it is given back."""
        size = _size()
        address = self.call("arv_buffer_get_data", buffer, c.byref(size))
        return memoryview((c.c_char * (size.value if address else 0)).from_address(address or 0)).cast("B")

    def row_padding(self, buffer: int) -> int:
        """Bytes after each row of the picture in a buffer."""
        across, down = _int(), _int()
        if self._get_padding is not None:
            self._get_padding(buffer, c.byref(across), c.byref(down))
        return across.value

    def on_signal(self, instance: int, signal: str, action: Callable[[], None]) -> Any:
        """Have ``action`` called by a thread of the library; what is returned must be kept as long."""
        handler = _Handler(lambda *_: action())
        self._connect(instance, signal.encode(), handler, None, None, 0)
        return handler


def _decoded(value: Any) -> Any:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else value


@cache
def load_aravis() -> Aravis:
    """The library, loaded once.

    Raises
    ------
    DeviceError
        It is not installed, or of another version.
    """
    try:
        return Aravis()
    except (OSError, AttributeError) as error:
        others = [name for name in OTHER_VERSIONS if ctypes.util.find_library(name)]
        there = (
            Message("; {listed} is here, which it does not work with", ", ".join(others)) if others else ""
        )
        raise DeviceError(
            "genicam: cameras need the library Aravis 0.8, which is not there ({error}){there}: {HOW_TO_INSTALL}",
            error,
            there,
            HOW_TO_INSTALL,
        ) from error


def has_aravis() -> bool:
    """Whether the library is installed, without loading anything else in its place."""
    try:
        c.CDLL(LIBRARY)
    except OSError:
        return False
    return True
