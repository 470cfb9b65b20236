"""The functions of Aravis are declared as its header has them."""

from __future__ import annotations

import ctypes as c
from typing import Any

import pytest

from acquire.genicam import library
from acquire.genicam.library import _ERROR, CALLS, has_aravis

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
