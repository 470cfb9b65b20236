"""A kernel with cameras that are not there: answers the ioctls of ``acquire.v4l2.api`` from tables.

Only what stands below ``Kernel`` is faked, so the product's own code runs as it is. Its clock
moves when somebody waits; faults are switched on by setting attributes or by a script.
"""

from __future__ import annotations

import errno
import os
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.v4l2 import api

BYTES = {
    "GREY": 1, "Y10": 2, "Y12": 2, "Y16": 2, "YUYV": 2, "UYVY": 2, "RGGB": 1, "RG12": 2, "MJPG": 0,
    "RGB3": 3,
}  # fmt: skip


def fault(number: int) -> OSError:
    return OSError(number, os.strerror(number))


@dataclass
class FakeControl:
    """One control; ``automatic``: the id and value of another one that holds it."""

    id: int
    title: str
    type: int = 1
    minimum: int = 0
    maximum: int = 255
    step: int = 1
    value: int = 0
    menu: tuple[str, ...] = ()
    held_by: tuple[int, int] | None = None
    flags: int = 0


@dataclass
class FakeCamera:
    """A camera with square-ish pictures whose grey levels count up frame by frame."""

    path: str = "/dev/video0"
    card: str = "fake camera"
    bus: str = "usb-1"
    formats: tuple[str, ...] = ("YUYV", "GREY", "Y12", "MJPG")
    sizes: tuple[tuple[int, int], ...] = ((8, 4), (16, 8))
    rates: tuple[int, ...] = (10, 20)
    caps: int = api.CAP_CAPTURE | api.CAP_STREAMING
    padding: int = 0
    flags: int = api.STAMP_MONOTONIC
    controls: dict[int, FakeControl] = field(default_factory=dict)
    inputs: tuple[str, ...] = ("Camera 1",)
    # what is in force
    fourcc: str = "YUYV"
    size: tuple[int, int] = (8, 4)
    fps: int = 10
    input: int = 0
    # faults
    present: bool = True
    open_error: int = 0
    request_errors: dict[int, int] = field(default_factory=dict)  # request -> errno, once
    stalled: bool = False
    counts: bool = True
    script: deque[Callable[[FakeCamera], None]] = field(default_factory=deque)  # one a frame
    damaged_next: bool = False
    short_next: bool = False
    skip_next: int = 0
    dead: int = 0  # errno of every request
    # the stream
    buffers: list[bytearray] = field(default_factory=list)
    queued: deque[int] = field(default_factory=deque)
    streaming: bool = False
    sequence: int = 0
    next_t: float = 0.0
    opened: int = 0
    maps_open: int = 0

    def row(self) -> int:
        return self.size[0] * BYTES[self.fourcc] + self.padding

    def picture(self) -> NDArray[Any]:
        """What the frame of the present sequence number shows, before it is packed."""
        width, height = self.size
        kind = np.uint8 if BYTES[self.fourcc] == 1 or self.fourcc in ("YUYV", "UYVY") else np.uint16
        return ((np.arange(width * height).reshape(height, width) + self.sequence) % 251).astype(kind)

    def content(self) -> bytes:
        if self.fourcc == "MJPG":
            import cv2

            return bytes(cv2.imencode(".jpg", self.picture().astype(np.uint8))[1].tobytes())
        image = self.picture()
        if self.fourcc in ("YUYV", "UYVY"):
            chroma = np.full_like(image, 128)
            image = np.dstack([image, chroma] if self.fourcc == "YUYV" else [chroma, image])
        rows = image.reshape(self.size[1], -1).view(np.uint8)
        return np.pad(rows, ((0, 0), (0, self.padding)), constant_values=255).tobytes()


class FakeMap(bytearray):
    camera: FakeCamera

    def close(self) -> None:
        self.camera.maps_open -= 1


class FakeKernel(api.Kernel):
    """The seam; ``cameras`` are its world."""

    def __init__(self, *cameras: FakeCamera) -> None:
        self.cameras = list(cameras)
        self.t = 1000.0
        self._handles: dict[int, FakeCamera] = {}
        self._next_fd = 3
        self.looking = False
        self.on_wait: Iterator[Callable[[], None]] = iter(())

    # -- the calls

    def open(self, path: str) -> int:
        for camera in self.cameras:
            if camera.path == path and camera.present:
                if camera.open_error:
                    raise fault(camera.open_error)
                self._next_fd += 1
                self._handles[self._next_fd] = camera
                camera.opened += 1
                return self._next_fd
        raise fault(errno.ENOENT)

    def close(self, fd: int) -> None:
        camera = self._handles.pop(fd)
        assert camera.maps_open == 0, "a map was left open: it keeps the device busy"
        camera.streaming = False

    def mmap(self, fd: int, length: int, offset: int) -> Any:
        camera = self._handles[fd]
        camera.maps_open += 1
        mapped = FakeMap(length)
        mapped.camera = camera
        camera.buffers[offset // 4096] = mapped
        return mapped

    def poll(self, fd: int, timeout_s: float) -> bool:
        camera = self._handles[fd]
        if camera.dead:
            return True
        if camera.stalled or not camera.streaming or camera.next_t > self.t + timeout_s:
            self.t += timeout_s
            next(self.on_wait, lambda: None)()
            return False
        self.t = max(self.t, camera.next_t)
        return True

    def nodes(self) -> list[str]:
        if self.looking:  # once a round, where a camera is looked for again
            self.t += 0.5
            next(self.on_wait, lambda: None)()
        return [camera.path for camera in self.cameras if camera.present]

    def now(self) -> float:
        return self.t

    def ioctl(self, fd: int, request: int, argument: Any) -> None:
        camera = self._handles[fd]
        if not camera.present:
            raise fault(errno.ENODEV)
        if camera.dead and request != api.STREAMOFF:
            raise fault(camera.dead)
        if request in camera.request_errors:
            raise fault(camera.request_errors.pop(request))
        _ANSWERS[request](self, camera, argument)

    # -- the answers

    def querycap(self, camera: FakeCamera, a: Any) -> None:
        a.driver, a.card, a.bus_info = b"fake", camera.card.encode(), camera.bus.encode()
        a.capabilities, a.device_caps = camera.caps | api.CAP_DEVICE_CAPS, camera.caps

    def enum_fmt(self, camera: FakeCamera, a: Any) -> None:
        a.pixelformat = api.fourcc(_entry(camera.formats, a.index))
        a.description = _entry(camera.formats, a.index).encode()

    def enum_sizes(self, camera: FakeCamera, a: Any) -> None:
        a.type = api.SIZE_DISCRETE
        a.size.discrete.width, a.size.discrete.height = _entry(camera.sizes, a.index)

    def enum_intervals(self, camera: FakeCamera, a: Any) -> None:
        a.type = api.INTERVAL_DISCRETE
        a.interval.discrete = api.Fraction(1, _entry(camera.rates, a.index))

    def enum_input(self, camera: FakeCamera, a: Any) -> None:
        a.name = _entry(camera.inputs, a.index).encode()

    def set_input(self, camera: FakeCamera, a: Any) -> None:
        camera.input = a.value

    def get_format(self, camera: FakeCamera, a: Any) -> None:
        pix = a.fmt.pix
        pix.width, pix.height = camera.size
        pix.pixelformat, pix.bytesperline = api.fourcc(camera.fourcc), camera.row()

    def set_format(self, camera: FakeCamera, a: Any) -> None:
        if camera.maps_open:
            raise fault(errno.EBUSY)
        pix = a.fmt.pix
        asked = api.fourcc_text(pix.pixelformat)
        camera.fourcc = asked if asked in camera.formats else camera.formats[0]
        camera.size = min(camera.sizes, key=lambda size: abs(size[0] - pix.width) + abs(size[1] - pix.height))
        self.get_format(camera, a)

    def get_parm(self, camera: FakeCamera, a: Any) -> None:
        a.parm.capture.capability = api.CAP_TIMEPERFRAME
        a.parm.capture.timeperframe = api.Fraction(1, camera.fps)

    def set_parm(self, camera: FakeCamera, a: Any) -> None:
        asked = a.parm.capture.timeperframe
        camera.fps = min(camera.rates, key=lambda rate: abs(rate - asked.denominator / asked.numerator))

    def reqbufs(self, camera: FakeCamera, a: Any) -> None:
        if camera.maps_open:
            raise fault(errno.EBUSY)
        camera.buffers = [bytearray()] * a.count
        camera.queued.clear()

    def querybuf(self, camera: FakeCamera, a: Any) -> None:
        a.length, a.m.offset = max(camera.row() * camera.size[1], 4096), 4096 * a.index

    def qbuf(self, camera: FakeCamera, a: Any) -> None:
        camera.queued.append(a.index)

    def streamon(self, camera: FakeCamera, a: Any) -> None:
        camera.streaming, camera.sequence, camera.next_t = True, 0, self.t + 1 / camera.fps

    def streamoff(self, camera: FakeCamera, a: Any) -> None:
        camera.streaming = False

    def dqbuf(self, camera: FakeCamera, a: Any) -> None:
        if camera.script:
            camera.script.popleft()(camera)
        if camera.dead or not camera.present:
            raise fault(camera.dead or errno.ENODEV)
        if camera.stalled or not camera.queued:
            raise fault(errno.EAGAIN)
        if camera.skip_next:
            camera.sequence += camera.skip_next
            camera.next_t += camera.skip_next / camera.fps
            camera.skip_next = 0
        a.index = camera.queued.popleft()
        data = camera.content()
        mapped = camera.buffers[a.index]
        mapped[: len(data)] = data
        a.bytesused = len(data) // 2 if camera.short_next else len(data)
        a.length, a.sequence = len(mapped), camera.sequence if camera.counts else 0
        a.flags = camera.flags | (api.FLAG_ERROR if camera.damaged_next else 0)
        seconds = camera.next_t
        a.timestamp.sec, a.timestamp.usec = int(seconds), round(seconds % 1 * 1e6)
        self.t = max(self.t, camera.next_t)
        camera.damaged_next = camera.short_next = False
        camera.sequence += 1
        camera.next_t += 1 / camera.fps

    def queryctrl(self, camera: FakeCamera, a: Any) -> None:
        later = sorted(number for number in camera.controls if number > a.id & 0x7FFFFFFF)
        if not later:
            raise fault(errno.EINVAL)
        control = camera.controls[later[0]]
        a.id, a.type, a.name = control.id, control.type, control.title.encode()
        a.minimum, a.maximum, a.step, a.flags = control.minimum, control.maximum, control.step, control.flags
        if self._held(camera, control):
            a.flags |= 0x10

    def querymenu(self, camera: FakeCamera, a: Any) -> None:
        a.name = _entry(camera.controls[a.id].menu, a.index).encode()

    def get_ctrl(self, camera: FakeCamera, a: Any) -> None:
        a.value = _known(camera, a.id).value

    def set_ctrl(self, camera: FakeCamera, a: Any) -> None:
        control = _known(camera, a.id)
        if control.flags & 0x4:
            raise fault(errno.EACCES)
        if not self._held(camera, control):
            steps = round((a.value - control.minimum) / control.step) * control.step + control.minimum
            control.value = min(max(steps, control.minimum), control.maximum)

    @staticmethod
    def _held(camera: FakeCamera, control: FakeControl) -> bool:
        if control.held_by is None:
            return False
        holder, value = control.held_by
        return camera.controls[holder].value == value


def _known(camera: FakeCamera, number: int) -> FakeControl:
    if number not in camera.controls:
        raise fault(errno.EINVAL)
    return camera.controls[number]


def _entry(table: tuple[Any, ...], index: int) -> Any:
    if index >= len(table):
        raise fault(errno.EINVAL)
    return table[index]


_ANSWERS: dict[int, Callable[[FakeKernel, FakeCamera, Any], None]] = {
    api.QUERYCAP: FakeKernel.querycap,
    api.ENUM_FMT: FakeKernel.enum_fmt,
    api.ENUM_FRAMESIZES: FakeKernel.enum_sizes,
    api.ENUM_FRAMEINTERVALS: FakeKernel.enum_intervals,
    api.ENUMINPUT: FakeKernel.enum_input,
    api.S_INPUT: FakeKernel.set_input,
    api.G_FMT: FakeKernel.get_format,
    api.S_FMT: FakeKernel.set_format,
    api.G_PARM: FakeKernel.get_parm,
    api.S_PARM: FakeKernel.set_parm,
    api.REQBUFS: FakeKernel.reqbufs,
    api.QUERYBUF: FakeKernel.querybuf,
    api.QBUF: FakeKernel.qbuf,
    api.DQBUF: FakeKernel.dqbuf,
    api.STREAMON: FakeKernel.streamon,
    api.STREAMOFF: FakeKernel.streamoff,
    api.QUERYCTRL: FakeKernel.queryctrl,
    api.QUERYMENU: FakeKernel.querymenu,
    api.G_CTRL: FakeKernel.get_ctrl,
    api.S_CTRL: FakeKernel.set_ctrl,
}
