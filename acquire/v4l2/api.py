"""The kernel's V4L2 interface: its structures and request codes, and the four calls behind all.

Facts of ``linux/videodev2.h`` and nothing else; 64-bit Linux, single-planar capture. ``Kernel``
is the lowest seam: tests put a fake one in its place and run everything above it as it is.
"""

from __future__ import annotations

import ctypes as c
import errno
import fcntl
import mmap
import os
import select
import sys
import time
from pathlib import Path
from typing import Any

from acquire.text import Message

u8, u32, s32, u64 = c.c_uint8, c.c_uint32, c.c_int32, c.c_uint64


class Capability(c.Structure):
    """What a node is."""

    _fields_ = (
        ("driver", c.c_char * 16),
        ("card", c.c_char * 32),
        ("bus_info", c.c_char * 32),
        ("version", u32),
        ("capabilities", u32),
        ("device_caps", u32),
        ("reserved", u32 * 3),
    )


class FormatDescription(c.Structure):
    """One pixel format of an enumeration."""

    _fields_ = (
        ("index", u32),
        ("type", u32),
        ("flags", u32),
        ("description", c.c_char * 32),
        ("pixelformat", u32),
        ("mbus_code", u32),
        ("reserved", u32 * 3),
    )


class PixFormat(c.Structure):
    """A picture's layout."""

    _fields_ = (
        ("width", u32),
        ("height", u32),
        ("pixelformat", u32),
        ("field", u32),
        ("bytesperline", u32),
        ("sizeimage", u32),
        ("colorspace", u32),
        ("priv", u32),
        ("flags", u32),
        ("encoding", u32),
        ("quantization", u32),
        ("transfer", u32),
    )


class _FormatUnion(c.Union):
    # The kernel's union holds pointers, hence its alignment.
    _fields_ = (("pix", PixFormat), ("raw", u8 * 200), ("align", u64))


class Format(c.Structure):
    """Argument of VIDIOC_G_FMT and VIDIOC_S_FMT."""

    _fields_ = (("type", u32), ("fmt", _FormatUnion))


class Fraction(c.Structure):
    """A frame interval in seconds."""

    _fields_ = (("numerator", u32), ("denominator", u32))


class _CaptureParm(c.Structure):
    _fields_ = (
        ("capability", u32),
        ("capturemode", u32),
        ("timeperframe", Fraction),
        ("extendedmode", u32),
        ("readbuffers", u32),
        ("reserved", u32 * 4),
    )


class _ParmUnion(c.Union):
    _fields_ = (("capture", _CaptureParm), ("raw", u8 * 200))


class StreamParm(c.Structure):
    """Argument of VIDIOC_G_PARM and VIDIOC_S_PARM."""

    _fields_ = (("type", u32), ("parm", _ParmUnion))


class _Discrete(c.Structure):
    _fields_ = (("width", u32), ("height", u32))


class _Stepwise(c.Structure):
    _fields_ = tuple(
        (f"{bound}_{side}", u32) for side in ("width", "height") for bound in ("min", "max", "step")
    )


class _SizeUnion(c.Union):
    _fields_ = (("discrete", _Discrete), ("stepwise", _Stepwise))


class FrameSize(c.Structure):
    """One frame size of an enumeration."""

    _fields_ = (
        ("index", u32),
        ("pixel_format", u32),
        ("type", u32),
        ("size", _SizeUnion),
        ("reserved", u32 * 2),
    )


class _StepwiseInterval(c.Structure):
    _fields_ = (("min", Fraction), ("max", Fraction), ("step", Fraction))


class _IntervalUnion(c.Union):
    _fields_ = (("discrete", Fraction), ("stepwise", _StepwiseInterval))


class FrameInterval(c.Structure):
    """One frame interval of an enumeration."""

    _fields_ = (
        ("index", u32),
        ("pixel_format", u32),
        ("width", u32),
        ("height", u32),
        ("type", u32),
        ("interval", _IntervalUnion),
        ("reserved", u32 * 2),
    )


class RequestBuffers(c.Structure):
    """Argument of VIDIOC_REQBUFS."""

    _fields_ = (
        ("count", u32),
        ("type", u32),
        ("memory", u32),
        ("capabilities", u32),
        ("flags", u8),
        ("reserved", u8 * 3),
    )


class _Timeval(c.Structure):
    _fields_ = (("sec", c.c_long), ("usec", c.c_long))


class _Timecode(c.Structure):
    _fields_ = (("type", u32), ("flags", u32), ("rest", u8 * 8))


class _Place(c.Union):
    _fields_ = (("offset", u32), ("userptr", c.c_ulong), ("planes", c.c_void_p), ("fd", s32))


class Buffer(c.Structure):
    """Argument of VIDIOC_QUERYBUF, VIDIOC_QBUF and VIDIOC_DQBUF."""

    _fields_ = (
        ("index", u32),
        ("type", u32),
        ("bytesused", u32),
        ("flags", u32),
        ("field", u32),
        ("timestamp", _Timeval),
        ("timecode", _Timecode),
        ("sequence", u32),
        ("memory", u32),
        ("m", _Place),
        ("length", u32),
        ("reserved2", u32),
        ("request_fd", s32),
    )


class QueryControl(c.Structure):
    """One control of an enumeration."""

    _fields_ = (
        ("id", u32),
        ("type", u32),
        ("name", c.c_char * 32),
        ("minimum", s32),
        ("maximum", s32),
        ("step", s32),
        ("default_value", s32),
        ("flags", u32),
        ("reserved", u32 * 2),
    )


class QueryMenu(c.Structure):
    """One entry of a menu control."""

    # A union of name and s64 value in the kernel, packed; only names are asked for.
    _fields_ = (("id", u32), ("index", u32), ("name", c.c_char * 32), ("reserved", u32))


class ControlValue(c.Structure):
    """Argument of VIDIOC_G_CTRL and VIDIOC_S_CTRL."""

    _fields_ = (("id", u32), ("value", s32))


class Input(c.Structure):
    """One input of an enumeration."""

    _fields_ = (
        ("index", u32),
        ("name", c.c_char * 32),
        ("type", u32),
        ("audioset", u32),
        ("tuner", u32),
        ("std", u64),
        ("status", u32),
        ("capabilities", u32),
        ("reserved", u32 * 3),
    )


def _code(direction: int, number: int, argument: Any) -> int:
    return direction << 30 | c.sizeof(argument) << 16 | ord("V") << 8 | number


def _ior(number: int, argument: Any) -> int:
    return _code(2, number, argument)


def _iow(number: int, argument: Any) -> int:
    return _code(1, number, argument)


def _iowr(number: int, argument: Any) -> int:
    return _code(3, number, argument)


QUERYCAP = _ior(0, Capability)
ENUM_FMT = _iowr(2, FormatDescription)
G_FMT, S_FMT = _iowr(4, Format), _iowr(5, Format)
REQBUFS, QUERYBUF = _iowr(8, RequestBuffers), _iowr(9, Buffer)
QBUF, DQBUF = _iowr(15, Buffer), _iowr(17, Buffer)
STREAMON, STREAMOFF = _iow(18, c.c_int), _iow(19, c.c_int)
G_PARM, S_PARM = _iowr(21, StreamParm), _iowr(22, StreamParm)
ENUMINPUT, G_INPUT, S_INPUT = _iowr(26, Input), _ior(38, c.c_int), _iowr(39, c.c_int)
G_CTRL, S_CTRL = _iowr(27, ControlValue), _iowr(28, ControlValue)
QUERYCTRL, QUERYMENU = _iowr(36, QueryControl), _iowr(37, QueryMenu)
ENUM_FRAMESIZES, ENUM_FRAMEINTERVALS = _iowr(74, FrameSize), _iowr(75, FrameInterval)

CAPTURE, MMAP, FIELD_NONE = 1, 1, 1
FIELDS_APART = {2: "top", 3: "bottom", 5: "sequential", 6: "sequential", 7: "alternate"}
FIELDS_WOVEN = {4, 8, 9}  # both fields in the rows of one picture
CAP_CAPTURE, CAP_CAPTURE_MPLANE, CAP_STREAMING, CAP_DEVICE_CAPS = 0x1, 0x1000, 0x04000000, 0x80000000
CAP_TIMEPERFRAME = 0x1000
SIZE_DISCRETE = INTERVAL_DISCRETE = 1
FLAG_ERROR = 0x40
STAMP_MASK, STAMP_MONOTONIC = 0xE000, 0x2000
SOURCE_MASK, SOURCE_START_OF_EXPOSURE = 0x70000, 0x10000
QUANTIZATION_FULL = 1


_LINUX_ONLY = Message("cameras by their device need Linux")


class Kernel:
    """The calls into the kernel; nothing above this class touches a device otherwise."""

    def open(self, path: str) -> int:
        """A descriptor of the node."""
        if sys.platform == "linux":
            return os.open(path, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
        else:
            raise OSError(errno.ENOSYS, _LINUX_ONLY)

    def close(self, fd: int) -> None:
        """Give it back."""
        os.close(fd)

    def ioctl(self, fd: int, request: int, argument: Any) -> None:
        """One request; again when a signal interrupts it."""
        if sys.platform == "linux":
            while True:
                try:
                    fcntl.ioctl(fd, request, argument)
                except InterruptedError:
                    continue
                return
        else:
            raise OSError(errno.ENOSYS, _LINUX_ONLY)

    def mmap(self, fd: int, length: int, offset: int) -> Any:
        """A buffer of the driver, readable."""
        if sys.platform == "linux":
            return mmap.mmap(fd, length, mmap.MAP_SHARED, mmap.PROT_READ | mmap.PROT_WRITE, offset=offset)
        else:
            raise OSError(errno.ENOSYS, _LINUX_ONLY)

    def poll(self, fd: int, timeout_s: float) -> bool:
        """Whether there is something to fetch (a picture or an error)."""
        if sys.platform == "linux":
            poller = select.poll()
            poller.register(fd, select.POLLIN)
            return bool(poller.poll(timeout_s * 1000))
        else:
            raise OSError(errno.ENOSYS, _LINUX_ONLY)

    def nodes(self) -> list[str]:
        """All video nodes there are."""
        return sorted((str(path) for path in Path("/dev").glob("video*")), key=lambda p: (len(p), p))

    def now(self) -> float:
        """``time.monotonic()``."""
        return time.monotonic()


def try_ioctl(kernel: Kernel, fd: int, request: int, argument: Any) -> bool:
    """Whether the driver supports the request and its argument (ENOTTY and EINVAL mean it does not)."""
    try:
        kernel.ioctl(fd, request, argument)
    except OSError as error:
        if error.errno in (errno.EINVAL, errno.ENOTTY):
            return False
        raise
    return True


def fourcc(text: str) -> int:
    """The number of a four-character code: ``"Y12"`` is ``"Y12 "``."""
    return int.from_bytes(text.ljust(4).encode("latin-1")[:4], "little")


def fourcc_text(code: int) -> str:
    """The four characters, without trailing blanks; a big-endian format has ``-BE`` behind it."""
    text = (code & 0x7FFFFFFF).to_bytes(4, "little").decode("latin-1").rstrip(" \0")
    return text + "-BE" * bool(code & 0x80000000)
