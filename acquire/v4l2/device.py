"""One open V4L2 capture node: what it offers, how it is set up, its buffers.

Every method is one or a few requests; an ``OSError`` goes to the caller, who decides what it
means for the test. Nothing here waits for longer than its argument, reconnects or counts frames.
"""

from __future__ import annotations

import contextlib
import ctypes
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from acquire.errors import Spoken
from acquire.text import Message
from acquire.v4l2 import api
from acquire.v4l2.api import Kernel, try_ioctl


@dataclass(frozen=True, slots=True)
class Identity:
    """Who a node is, so that it is found again under another name.

    Attributes
    ----------
    driver, card, bus : str
    """

    driver: str
    card: str
    bus: str

    def __str__(self) -> str:
        return Message("{card} ({driver}, {bus})", self.card, self.driver, self.bus)


@dataclass(frozen=True, slots=True)
class FormatOffer:
    """A pixel format the driver lists."""

    fourcc: str
    description: str


@dataclass(frozen=True, slots=True)
class SizeRange:
    """Frame sizes the driver lists: one size where minimum and maximum agree, px."""

    width: tuple[int, int, int]  # minimum, maximum, step
    height: tuple[int, int, int]

    def __str__(self) -> str:
        if self.width[0] == self.width[1] and self.height[0] == self.height[1]:
            return f"{self.width[0]}x{self.height[0]}"
        return Message(
            "{width}x{height} to {width2}x{height2}",
            self.width[0],
            self.height[0],
            self.width[1],
            self.height[1],
        )


@dataclass(frozen=True, slots=True)
class Mode:
    """What is in force.

    Attributes
    ----------
    fourcc : str
    width, height : int, px
    bytes_per_line : int
    full_range : bool
        Luma uses all 256 levels.
    fps : float or None, 1/s
    field : int
        ``api.FIELD_NONE`` where all rows of a picture are of one moment.
    """

    fourcc: str
    width: int
    height: int
    bytes_per_line: int
    full_range: bool
    fps: float | None
    field: int


@dataclass(frozen=True, slots=True)
class Stamp:
    """The time and state of a buffer."""

    sequence: int
    time: float
    monotonic: bool
    start_of_exposure: bool
    damaged: bool


class NotACamera(Spoken):
    """The node captures no video, or only in a way that is not supported; the text has the reason."""


class V4L2Device:
    """An open node; ``close()`` it, maps first.

    Raises
    ------
    OSError
        From the kernel.
    NotACamera
        The node is something else.
    """

    def __init__(self, path: str, kernel: Kernel) -> None:
        self.path, self._kernel = path, kernel
        self._maps: list[Any] = []
        self._streaming = False
        self._fd: int | None = kernel.open(path)
        try:
            self.identity = self._identify()
        except BaseException:
            self.close()
            raise

    @property
    def fd(self) -> int:
        """The open descriptor."""
        if self._fd is None:
            raise OSError(9, "the device is closed")
        return self._fd

    def request(self, code: int, argument: Any) -> None:
        """One ioctl."""
        self._kernel.ioctl(self.fd, code, argument)

    def tried(self, code: int, argument: Any) -> bool:
        """One ioctl that the driver may not support."""
        return try_ioctl(self._kernel, self.fd, code, argument)

    def _identify(self) -> Identity:
        found = api.Capability()
        if not self.tried(api.QUERYCAP, found):
            raise NotACamera("it is not a V4L2 device")
        caps = found.device_caps if found.capabilities & api.CAP_DEVICE_CAPS else found.capabilities
        if not caps & api.CAP_CAPTURE:
            many = caps & api.CAP_CAPTURE_MPLANE
            raise NotACamera(
                Message("multiplanar capture is not supported; use opencv:")
                if many
                else Message("it captures no video")
            )
        if not caps & api.CAP_STREAMING:
            raise NotACamera("it cannot stream into memory")
        return Identity(found.driver.decode("latin-1"), _text(found.card), _text(found.bus_info))

    # What it offers

    def _enumerate(self, code: int, kind: type[Any], **fields: int) -> Iterator[Any]:
        for index in range(1000):
            argument = kind(index=index, **fields)
            if not self.tried(code, argument):
                return
            yield argument

    def formats(self) -> list[FormatOffer]:
        """All pixel formats."""
        found = self._enumerate(api.ENUM_FMT, api.FormatDescription, type=api.CAPTURE)
        return [FormatOffer(api.fourcc_text(item.pixelformat), _text(item.description)) for item in found]

    def sizes(self, fourcc: str) -> list[SizeRange]:
        """Frame sizes of a pixel format; empty where the driver does not list them."""
        sizes = []
        for item in self._enumerate(api.ENUM_FRAMESIZES, api.FrameSize, pixel_format=api.fourcc(fourcc)):
            sizes.append(_size_range(item))
            if item.type != api.SIZE_DISCRETE:
                break
        return sizes

    def rates(self, fourcc: str, width: int, height: int) -> list[float]:
        """Frame rates, 1/s, highest first; the two ends where a whole range is offered."""
        size = {"pixel_format": api.fourcc(fourcc), "width": width, "height": height}
        rates: list[float] = []
        for item in self._enumerate(api.ENUM_FRAMEINTERVALS, api.FrameInterval, **size):
            if item.type == api.INTERVAL_DISCRETE:
                rates.append(_rate(item.interval.discrete))
            else:
                rates += [_rate(item.interval.stepwise.min), _rate(item.interval.stepwise.max)]
                break
        return sorted((rate for rate in rates if rate > 0), reverse=True)

    def inputs(self) -> list[str]:
        """Names of its inputs."""
        return [_text(item.name) for item in self._enumerate(api.ENUMINPUT, api.Input)]

    # How it is set up

    def select_input(self, index: int) -> None:
        """Switch to an input."""
        self.request(api.S_INPUT, ctypes.c_int(index))

    def mode(self) -> Mode:
        """What is in force."""
        wanted = api.Format(type=api.CAPTURE)
        self.request(api.G_FMT, wanted)
        pix = wanted.fmt.pix
        return Mode(
            fourcc=api.fourcc_text(pix.pixelformat),
            width=pix.width,
            height=pix.height,
            bytes_per_line=pix.bytesperline,
            full_range=pix.quantization == api.QUANTIZATION_FULL,
            fps=self.fps(),
            field=pix.field,
        )

    def set_format(self, fourcc: str, width: int, height: int) -> None:
        """Ask for a format; ``mode()`` reads what is in force."""
        wanted = api.Format(type=api.CAPTURE)
        pix = wanted.fmt.pix
        pix.width, pix.height, pix.pixelformat = width, height, api.fourcc(fourcc)
        pix.field = api.FIELD_NONE
        self.request(api.S_FMT, wanted)

    def fps(self) -> float | None:
        """Frames a second in force; None where the driver gives none."""
        parm = api.StreamParm(type=api.CAPTURE)
        if not self.tried(api.G_PARM, parm):
            return None
        return _rate(parm.parm.capture.timeperframe) or None

    def set_fps(self, fps: float) -> None:
        """Ask for a frame rate; ``fps()`` reads what is in force."""
        parm = api.StreamParm(type=api.CAPTURE)
        if not self.tried(api.G_PARM, parm):
            return
        parm.parm.capture.timeperframe = api.Fraction(1000, round(1000 * fps))
        self.tried(api.S_PARM, parm)

    # Its buffers

    def start(self, count: int) -> None:
        """Map ``count`` buffers (the driver may give another number) and stream."""
        wanted = api.RequestBuffers(count=count, type=api.CAPTURE, memory=api.MMAP)
        self.request(api.REQBUFS, wanted)
        for index in range(wanted.count):
            buffer = self._buffer(index)
            self.request(api.QUERYBUF, buffer)
            self._maps.append(self._kernel.mmap(self.fd, buffer.length, buffer.m.offset))
            self.request(api.QBUF, self._buffer(index))
        self.request(api.STREAMON, ctypes.c_int(api.CAPTURE))
        self._streaming = True

    def _buffer(self, index: int) -> api.Buffer:
        return api.Buffer(index=index, type=api.CAPTURE, memory=api.MMAP)

    def wait(self, timeout_s: float) -> bool:
        """Whether a picture (or an error) is there within that time."""
        return self._kernel.poll(self.fd, timeout_s)

    @contextlib.contextmanager
    def fetch(self) -> Iterator[tuple[Stamp, memoryview]]:
        """The next picture: its stamp, and the mapped buffer to copy it from, which goes back at the end.

        Raises
        ------
        BlockingIOError
            There is none.
        OSError
            A fault of the device.
        """
        buffer = api.Buffer(type=api.CAPTURE, memory=api.MMAP)
        self.request(api.DQBUF, buffer)
        used = buffer.bytesused or buffer.length
        with memoryview(self._maps[buffer.index]) as whole, whole[:used] as content:
            yield _stamp(buffer), content
        self.request(api.QBUF, self._buffer(buffer.index))

    def stop(self) -> None:
        """End the stream and give the buffers back: maps first, since they keep the device busy."""
        if self._streaming:
            self._streaming = False
            with contextlib.suppress(OSError):
                self.request(api.STREAMOFF, ctypes.c_int(api.CAPTURE))
        for mapped in self._maps:
            mapped.close()
        if self._maps:
            self._maps = []
            with contextlib.suppress(OSError):
                self.request(api.REQBUFS, api.RequestBuffers(type=api.CAPTURE, memory=api.MMAP))

    def close(self) -> None:
        """Give everything back; idempotent."""
        if self._fd is not None:
            self.stop()
            fd, self._fd = self._fd, None
            with contextlib.suppress(OSError):
                self._kernel.close(fd)


def _text(raw: bytes) -> str:
    return raw.decode("utf-8", "replace")


def _rate(interval: api.Fraction) -> float:
    return interval.denominator / interval.numerator if interval.numerator else 0.0


def _size_range(item: api.FrameSize) -> SizeRange:
    if item.type == api.SIZE_DISCRETE:
        w, h = item.size.discrete.width, item.size.discrete.height
        return SizeRange((w, w, 1), (h, h, 1))
    s = item.size.stepwise
    return SizeRange((s.min_width, s.max_width, s.step_width), (s.min_height, s.max_height, s.step_height))


def _stamp(buffer: api.Buffer) -> Stamp:
    return Stamp(
        sequence=buffer.sequence,
        time=buffer.timestamp.sec + buffer.timestamp.usec * 1e-6,
        monotonic=buffer.flags & api.STAMP_MASK == api.STAMP_MONOTONIC,
        start_of_exposure=buffer.flags & api.SOURCE_MASK == api.SOURCE_START_OF_EXPOSURE,
        damaged=bool(buffer.flags & api.FLAG_ERROR),
    )
