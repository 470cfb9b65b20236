"""A made-up Aravis library: buffers, numbers and losses; its functions are declared as its header has them."""

from __future__ import annotations

import ctypes as c
import threading
from typing import Any

import numpy as np
import pytest

from acquire.genicam import camera as camera_module
from acquire.genicam import device as device_module
from acquire.genicam import library
from acquire.genicam.camera import FoundCamera
from acquire.genicam.device import STATUS, GenicamDevice
from acquire.genicam.library import _ERROR, CALLS, GenicamError, has_aravis
from tests.acquire.genicam.test_setup import Able


class Library:
    """Answers by name, and notes what is asked."""

    def __init__(self, **answers: Any) -> None:
        self.answers = {
            "buffer_get_status": 0,
            "buffer_get_image_width": 3,
            "buffer_get_image_height": 2,
        } | answers
        self.calls: list[tuple[Any, ...]] = []
        self.lost: Any = None

    def call(self, name: str, *arguments: Any) -> Any:
        self.calls.append((name, *arguments))
        answer = self.answers.get(name.removeprefix("arv_"), 1)
        if isinstance(answer, Exception):
            raise answer
        return answer

    def on_signal(self, instance: int, signal: str, action: Any) -> Any:
        self.lost = action
        return action

    def bounds(self, name: str, *arguments: Any, whole: bool = False) -> tuple[float, float]:
        return (8.0, 640.0) if whole else (0.5, 99.5)

    def content(self, buffer: int) -> memoryview:
        return memoryview(bytes(range(6)))

    def row_padding(self, buffer: int) -> int:
        return 5

    def named(self, name: str) -> list[tuple[Any, ...]]:
        return [call for call in self.calls if call[0] == name]


def opened(library: Library) -> GenicamDevice:
    return GenicamDevice(library, "any")  # type: ignore[arg-type]


def taken(content: memoryview, padding: int) -> tuple[list[int], int]:
    return np.frombuffer(content, np.uint8).tolist(), padding


def test_a_buffer_by_value(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(device_module.time, "time_ns", lambda: 5_250_000_000)
    library = Library(
        buffer_get_frame_id=77, buffer_get_timestamp=123_456, buffer_get_system_timestamp=5_000_000_000
    )
    device = opened(library)
    device.start(3)
    assert len(library.named("arv_stream_push_buffer")) == 3
    received = device.fetch(0.25, taken)
    assert received is not None
    assert (received.number, received.stamp_ns, received.age_s) == (77, 123_456, pytest.approx(0.25))
    assert (received.trouble, received.size, received.taken) == ("", (3, 2), ([0, 1, 2, 3, 4, 5], 5))
    assert library.named("arv_stream_timeout_pop_buffer") == [("arv_stream_timeout_pop_buffer", 1, 250_000)]
    assert len(library.named("arv_stream_push_buffer")) == 4, "it goes back"


@pytest.mark.parametrize(("now_s", "age_s"), [(4.9, 0.0), (5.0, 0.0), (64.9, 59.9), (65.1, 0.0)])
def test_an_age_beyond_sense_is_none(now_s: float, age_s: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """The wall clock may have been set meanwhile."""
    monkeypatch.setattr(device_module.time, "time_ns", lambda: round(now_s * 1e9))
    device = opened(Library(buffer_get_system_timestamp=5_000_000_000))
    device.start(1)
    received = device.fetch(1.0, taken)
    assert received is not None and received.age_s == pytest.approx(age_s)


@pytest.mark.parametrize(
    ("status", "words"), [(3, "packets are missing"), (6, "it is not complete"), (99, "unknown")]
)
def test_a_buffer_that_is_not_whole_is_not_taken(status: int, words: str) -> None:
    device = opened(Library(buffer_get_status=status))
    device.start(1)
    received = device.fetch(1.0, taken)
    assert received is not None and received.trouble.startswith(words)
    assert (received.size, received.taken) == ((0, 0), None)
    assert set(STATUS) == {-1, 1, 2, 3, 4, 5, 6, 7, 8}


def test_no_buffer_is_no_picture_and_a_closed_camera_gives_none() -> None:
    library = Library(stream_timeout_pop_buffer=None)
    device = opened(library)
    device.start(1)
    assert device.streaming and device.fetch(0.1, taken) is None
    device.close()
    assert not device.streaming
    assert [call[0] for call in library.calls[-3:]] == [
        "arv_camera_stop_acquisition", "g_object_unref", "g_object_unref",
    ]  # fmt: skip
    count = len(library.calls)
    device.close()
    assert len(library.calls) == count
    for use in (lambda: device.fetch(0.1, taken), lambda: device.integer("Width")):
        with pytest.raises(GenicamError, match="the camera is closed"):
            use()
    assert not device.has("Width")


def test_numbers_of_a_feature() -> None:
    device = opened(Library(camera_get_integer=320, camera_get_integer_increment=16))
    assert (device.integer("Width"), device.integer_bounds("Width"), device.highest("Width")) == (
        320, (8, 640, 16), 640,
    )  # fmt: skip
    assert device.bounds_of("gain") == (0.5, 99.5)


def test_who_a_camera_is_and_that_it_is_lost() -> None:
    library = Library(
        camera_get_vendor_name="Maker", camera_get_model_name="M1",
        camera_get_device_serial_number=GenicamError("it has none"),
    )  # fmt: skip
    device = opened(library)
    assert str(device.identity) == "Maker M1 ()"
    assert isinstance(device.lost, threading.Event) and not device.lost.is_set()
    library.lost()
    assert device.lost.is_set()


@pytest.mark.parametrize(
    ("answers", "words"),
    [
        ({"camera_new": None}, "it is not there"),
        ({"gv_device_is_controller": 0}, "another program holds the camera"),
    ],
)
def test_a_camera_that_cannot_be_had(answers: dict[str, Any], words: str) -> None:
    with pytest.raises(GenicamError, match=words):
        opened(Library(**answers))
    assert opened(Library(camera_is_gv_device=0, gv_device_is_controller=0)).is_gige is False


def test_a_camera_in_the_list(monkeypatch: pytest.MonkeyPatch) -> None:
    class Listed(Able):
        closed = False

        def highest(self, feature: str) -> int:
            return {"Width": 1280, "Height": 1024}[feature]

        def close(self) -> None:
            Listed.closed = True

    camera = Listed()
    monkeypatch.setattr(camera_module, "GenicamDevice", lambda library, name: camera)
    found = camera_module._look_at(None, FoundCamera("Maker-1", "Maker", "M1", "1", "10.0.0.2", "GigEVision"))  # type: ignore[arg-type]
    assert (found.address, found.trouble) == ("genicam:Maker-1?format=Mono12p", "")
    assert found.name == "Maker M1 (1, GigEVision 10.0.0.2)" and Listed.closed
    assert found.details == (
        "format=Mono12p, Mono8", "640x480 of 1280x1024", "fps=20 (1..100)", "exposure_us=2500 (10..1000000)",
        "gain=3 (-12..24)", "trigger=no, Line0, Software",
    )  # fmt: skip


HEADER = """
void arv_update_device_list ();
unsigned arv_get_n_devices ();
text arv_get_device_id (unsigned);
text arv_get_device_vendor (unsigned);
text arv_get_device_model (unsigned);
text arv_get_device_serial_nbr (unsigned);
text arv_get_device_address (unsigned);
text arv_get_device_protocol (unsigned);
object arv_camera_new (text, error);
object arv_camera_get_device (object);
text arv_camera_get_vendor_name (object, error);
text arv_camera_get_model_name (object, error);
text arv_camera_get_device_serial_number (object, error);
void arv_camera_set_range_check_policy (object, int);
int arv_camera_is_gv_device (object);
int arv_gv_device_is_controller (object);
unsigned arv_camera_gv_auto_packet_size (object, error);
void arv_camera_gv_set_packet_size (object, int, error);
unsigned arv_camera_gv_get_packet_size (object, error);
void arv_camera_gv_set_packet_size_adjustment (object, int);
int arv_camera_is_feature_available (object, text, error);
object arv_device_get_feature (object, text);
text arv_gc_feature_node_get_value_as_string (object, error);
void arv_gc_feature_node_set_value_from_string (object, text, error);
object arv_camera_dup_available_enumerations_as_strings (object, text, unsigned*, error);
int64 arv_camera_get_integer (object, text, error);
void arv_camera_set_integer (object, text, int64, error);
void arv_camera_get_integer_bounds (object, text, int64*, int64*, error);
int64 arv_camera_get_integer_increment (object, text, error);
void arv_camera_get_float_bounds (object, text, double*, double*, error);
int arv_camera_is_frame_rate_available (object, error);
double arv_camera_get_frame_rate (object, error);
void arv_camera_set_frame_rate (object, double, error);
void arv_camera_get_frame_rate_bounds (object, double*, double*, error);
int arv_camera_is_exposure_time_available (object, error);
double arv_camera_get_exposure_time (object, error);
void arv_camera_set_exposure_time (object, double, error);
void arv_camera_get_exposure_time_bounds (object, double*, double*, error);
int arv_camera_is_gain_available (object, error);
double arv_camera_get_gain (object, error);
void arv_camera_set_gain (object, double, error);
void arv_camera_get_gain_bounds (object, double*, double*, error);
void arv_camera_clear_triggers (object, error);
void arv_camera_set_trigger (object, text, error);
object arv_camera_dup_available_trigger_sources (object, unsigned*, error);
void arv_camera_software_trigger (object, error);
unsigned arv_camera_get_payload (object, error);
object arv_camera_create_stream (object, object, object, error);
void arv_camera_start_acquisition (object, error);
void arv_camera_stop_acquisition (object, error);
void arv_stream_push_buffer (object, object);
object arv_stream_timeout_pop_buffer (object, uint64);
object arv_stream_try_pop_buffer (object);
object arv_buffer_new_allocate (size);
int arv_buffer_get_status (object);
object arv_buffer_get_data (object, size*);
uint64 arv_buffer_get_timestamp (object);
uint64 arv_buffer_get_system_timestamp (object);
uint64 arv_buffer_get_frame_id (object);
int arv_buffer_get_image_width (object);
int arv_buffer_get_image_height (object);
uint32 arv_buffer_get_image_pixel_format (object);
void g_object_unref (object);
void g_free (object);
void g_error_free (object);
text g_type_name_from_instance (object);
"""
KINDS: dict[str, Any] = {
    "void": None, "object": c.c_void_p, "text": c.c_char_p, "int": c.c_int, "unsigned": c.c_uint,
    "int64": c.c_int64, "uint64": c.c_uint64, "uint32": c.c_uint32, "double": c.c_double, "size": c.c_size_t,
    "error": _ERROR,
}  # fmt: skip


def kind(name: str) -> Any:
    return c.POINTER(KINDS[name[:-1]]) if name.endswith("*") else KINDS[name]


def declared() -> dict[str, tuple[Any, ...]]:
    found = {}
    for line in HEADER.strip().splitlines():
        result, name, arguments = line.rstrip(");").replace("(", "").split(" ", 2)
        found[name] = (kind(result), *(kind(one) for one in arguments.split(", ") if one))
    return found


def test_every_function_is_called_as_it_is_declared() -> None:
    assert declared() == CALLS


@pytest.mark.parametrize("installed", [True, False])
def test_whether_the_library_is_there(installed: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(library, "LIBRARY", "libc.so.6" if installed else "libnothing-of-that-name.so.0")
    assert has_aravis() is installed
