"""Steers vivid, the kernel's virtual camera: its faults, and pictures shown to its looped input."""

from __future__ import annotations

import ctypes
import os
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from acquire.v4l2 import api
from acquire.v4l2.device import NotACamera, V4L2Device

CAMERA, SCREEN = "/dev/video0", "/dev/video1"
DRIVER = Path("/sys/bus/platform/drivers/vivid")
OUTPUT = 2  # V4L2_BUF_TYPE_VIDEO_OUTPUT


def ctl(*words: str, node: str = CAMERA) -> str:
    """Run v4l2-ctl on a node."""
    done = subprocess.run(["v4l2-ctl", "-d", node, *words], capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"v4l2-ctl {words}: {done.stderr or done.stdout}"
    return done.stdout


def press(control: str, value: int = 1, node: str = CAMERA) -> None:
    """Set a control, faults above all."""
    ctl("-c", f"{control}={value}", node=node)


def webcam() -> None:
    """Bring vivid back to its webcam with moving test patterns."""
    ctl("-i", "0")
    ctl("-c", "percentage_of_dropped_buffers=0,osd_text_mode=0")


def plugged() -> bool:
    """Whether the driver has the device."""
    return (DRIVER / "vivid.0").exists()


def unplug() -> None:
    """Take the driver from the device, as a pulled cable does."""
    (DRIVER / "unbind").write_text("vivid.0")


def plug() -> None:
    """Give it back."""
    (DRIVER / "bind").write_text("vivid.0")
    until(lambda: any(Path("/dev").glob("video*")), 10)


def replug() -> None:
    """Out and in again."""
    unplug()
    plug()


def put_in_order() -> None:
    """Make sure that the camera is there under its own name, as a webcam without faults."""
    if not plugged():
        plug()
    if not _is_camera():
        replug()
    assert _is_camera(), "the camera does not come back; is a handle still open?"
    webcam()


def _is_camera() -> bool:
    try:
        V4L2Device(CAMERA, api.Kernel()).close()
    except (OSError, NotACamera):
        return False
    return True


def until(condition: Callable[[], bool], seconds: float) -> None:
    """Wait for something that must happen."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "it did not happen in time"
        time.sleep(0.05)


class Screen:
    """Shows pictures on the output node, until told otherwise; a thread keeps its buffers filled.

    Parameters
    ----------
    fourcc : str
    picture : (H, W) or (H, W, 2) array of bytes as they are to be
    """

    def __init__(self, fourcc: str, picture: NDArray[Any]) -> None:
        self._fourcc, self._height, self._width = fourcc, *picture.shape[:2]
        self._bytes = picture.tobytes()
        self._kernel = api.Kernel()
        self._fd = self._kernel.open(SCREEN)
        self._maps: list[Any] = []
        self._shown: dict[int, bytes] = {}
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._feed, name="screen", daemon=True)

    def show(self, picture: NDArray[Any]) -> None:
        """From now on this one."""
        self._bytes = picture.tobytes()

    def __enter__(self) -> Self:
        wanted = api.Format(type=OUTPUT)
        self._kernel.ioctl(self._fd, api.G_FMT, wanted)
        pix = wanted.fmt.pix
        pix.width, pix.height, pix.pixelformat = self._width, self._height, api.fourcc(self._fourcc)
        pix.bytesperline = 0
        self._kernel.ioctl(self._fd, api.S_FMT, wanted)
        got = api.fourcc_text(pix.pixelformat), pix.width, pix.height
        assert got == (self._fourcc, self._width, self._height), got
        buffers = api.RequestBuffers(count=4, type=OUTPUT, memory=api.MMAP)
        self._kernel.ioctl(self._fd, api.REQBUFS, buffers)
        for index in range(buffers.count):
            buffer = api.Buffer(index=index, type=OUTPUT, memory=api.MMAP)
            self._kernel.ioctl(self._fd, api.QUERYBUF, buffer)
            self._maps.append(self._kernel.mmap(self._fd, buffer.length, buffer.m.offset))
            self._queue(index)
        self._kernel.ioctl(self._fd, api.STREAMON, ctypes.c_int(OUTPUT))
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ended.set()
        self._thread.join()
        self._kernel.ioctl(self._fd, api.STREAMOFF, ctypes.c_int(OUTPUT))
        for mapped in self._maps:
            mapped.close()
        os.close(self._fd)

    def _queue(self, index: int) -> None:
        content = self._bytes
        if self._shown.get(index) is not content:  # copying is what an emulated machine is slow at
            self._maps[index][: len(content)] = content
            self._shown[index] = content
        buffer = api.Buffer(
            index=index, type=OUTPUT, memory=api.MMAP, bytesused=len(content), field=api.FIELD_NONE
        )
        self._kernel.ioctl(self._fd, api.QBUF, buffer)

    def _feed(self) -> None:
        import select

        poller = select.poll()
        poller.register(self._fd, select.POLLOUT)
        while not self._ended.is_set():
            if not poller.poll(100):
                continue
            buffer = api.Buffer(type=OUTPUT, memory=api.MMAP)
            try:
                self._kernel.ioctl(self._fd, api.DQBUF, buffer)
            except BlockingIOError:
                continue
            self._queue(buffer.index)


@contextmanager
def looped(fourcc: str, picture: NDArray[Any], fps: int = 60) -> Iterator[Screen]:
    """What the screen shows, the camera's input 1 sees, pixel for pixel."""
    height, width = picture.shape[:2]
    timings = f"cvt,width={width},height={height},fps={fps}"
    ctl("-o", "0", node=SCREEN)
    ctl("--set-dv-bt-timings", timings, node=SCREEN)
    ctl("-i", "1")
    ctl("--set-dv-bt-timings", timings)
    ctl("-c", "loop_video=1,osd_text_mode=2")
    try:
        with Screen(fourcc, picture) as screen:
            yield screen
    finally:
        press("loop_video", 0)
        ctl("-i", "0")


def speckle(height: int, width: int, dtype: type = np.uint8, top: int = 255, seed: int = 5) -> NDArray[Any]:
    """A random picture with every bit in use."""
    return np.random.default_rng(seed).integers(0, top + 1, (height, width)).astype(dtype)
