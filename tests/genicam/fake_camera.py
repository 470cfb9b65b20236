"""A GigE camera that is not there: the one inside Aravis, with more monochrome formats, and with pictures of ours.

    python -m tests.genicam.fake_camera [--serial GV01] [--interface 127.0.0.1] [--pictures FILE.npy] ...

It answers on the loop-back until it is killed. Its k-th frame shows ``picture(k, ...)``, or the k-th picture of the
file (the last one for ever). Its first frame has the number ``FIRST``, so that the wrap at 65535 comes soon.
"""

from __future__ import annotations

import argparse
import ctypes as c
import re
import tempfile
import threading
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.genicam.packing import PACK, PIXEL_FORMATS, picture

FIRST = 65401  # the number of the first frame
PAYLOAD = """<IntSwissKnife Name="PayloadSize" NameSpace="Standard">
<pVariable Name="WIDTH">Width</pVariable><pVariable Name="HEIGHT">Height</pVariable>
<pVariable Name="PIXELFORMAT">PixelFormatRegister</pVariable>
<Formula>WIDTH * HEIGHT * ((PIXELFORMAT&gt;&gt;16)&amp;0xFF) / 8</Formula></IntSwissKnife>"""
WHITE = """<Integer Name="PixelDynamicRangeMax" NameSpace="Standard"><Value>{}</Value>
<Min>0</Min><Max>65535</Max></Integer>"""
GAIN_MODE, CONTINUOUS = 0x114, 2
SENSOR_WIDTH = 0x11C
FILL = c.CFUNCTYPE(None, c.c_void_p, c.c_void_p, c.c_uint32, c.c_uint32, c.c_uint32)


def library() -> Any:
    """The C functions of the fake."""
    lib = c.CDLL("libaravis-0.8.so.0")
    for name in ("arv_fake_camera_new", "arv_gv_fake_camera_new_full", "arv_gv_fake_camera_get_fake_camera"):
        getattr(lib, name).restype = c.c_void_p
    lib.arv_fake_camera_get_genicam_xml.restype = c.c_char_p
    lib.arv_buffer_get_data.restype = c.c_void_p
    return lib


def description(lib: Any, white: int | None) -> str:
    """The description of the camera's features, with all formats, and perhaps a white level."""
    size = c.c_size_t()
    camera = c.c_void_p(lib.arv_fake_camera_new(b"XML"))
    text = str(lib.arv_fake_camera_get_genicam_xml(camera, c.byref(size)).decode())
    entries = "".join(
        f'<EnumEntry Name="{name}" NameSpace="Standard"><Value>{code}</Value></EnumEntry>'
        for name, code in PIXEL_FORMATS.items()
    )
    text = re.sub(
        r'(<Enumeration Name="PixelFormat".*?)<EnumEntry.*</EnumEntry>(\s*<pValue>PixelFormatRegister)',
        lambda found: found[1] + entries + found[2],
        text,
        count=1,
        flags=re.DOTALL,
    )
    text = re.sub(
        r'<IntSwissKnife Name="PayloadSize".*?</IntSwissKnife>', lambda _: PAYLOAD, text, flags=re.DOTALL
    )
    more = "" if white is None else WHITE.format(white)
    return text.replace("</RegisterDescription>", f"{more}</RegisterDescription>")


def fitted(shown: NDArray[Any], width: int, height: int) -> NDArray[Any]:
    """The picture cut or filled up with black to the size of the frame, since its memory holds no more."""
    frame = np.zeros((height, width), shown.dtype)
    part = shown[:height, :width]
    frame[: part.shape[0], : part.shape[1]] = part
    return frame


def serve(options: argparse.Namespace) -> None:
    """Be the camera, for ever."""
    lib = library()
    pictures: NDArray[Any] | None = None if options.pictures is None else np.load(options.pictures)
    names = {code: name for name, code in PIXEL_FORMATS.items()}
    sent = 0

    def fill(buffer: int, data: int, exposure_us: int, gain: int, code: int) -> None:
        nonlocal sent
        name, handle = names[code], c.c_void_p(buffer)
        width, height = lib.arv_buffer_get_image_width(handle), lib.arv_buffer_get_image_height(handle)
        if pictures is None:
            shown = picture(sent, width, height, name)
        else:
            shown = fitted(pictures[min(sent, len(pictures) - 1)], width, height)
        content = PACK[name](shown.reshape(-1))
        size = c.c_size_t()
        c.memmove(lib.arv_buffer_get_data(handle, c.byref(size)), content, len(content))
        sent += 1

    callback = FILL(fill)
    with tempfile.NamedTemporaryFile("w", suffix=".xml") as xml:
        xml.write(description(lib, options.white))
        xml.flush()
        camera = c.c_void_p(
            lib.arv_gv_fake_camera_new_full(
                options.interface.encode(), options.serial.encode(), xml.name.encode()
            )
        )
        inner = c.c_void_p(lib.arv_gv_fake_camera_get_fake_camera(camera))
        lib.arv_fake_camera_set_fill_pattern(inner, callback, None)
        if options.automatic:
            lib.arv_fake_camera_write_register(inner, GAIN_MODE, CONTINUOUS)
        if options.sensor is not None:
            lib.arv_fake_camera_write_register(inner, SENSOR_WIDTH, options.sensor)
        lib.g_object_set(camera, b"gvsp-lost-ratio", c.c_double(options.loss), None)
        assert lib.arv_gv_fake_camera_is_running(camera), "the fake camera does not run"
        print("ready", flush=True)
        threading.Event().wait()


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(prog="fake_camera", description=__doc__)
    parser.add_argument("--serial", default="GV01")
    parser.add_argument("--interface", default="127.0.0.1")
    parser.add_argument("--pictures", type=Path, help="(n, height, width) for the frames one after the other")
    parser.add_argument("--loss", type=float, default=0.0, help="share of the packets that are lost")
    parser.add_argument("--white", type=int, help="the white level that the camera states")
    parser.add_argument("--automatic", action="store_true", help="its gain is automatic at first")
    parser.add_argument("--sensor", type=int, help="its width, px")
    return parser.parse_args()


if __name__ == "__main__":
    serve(arguments())
