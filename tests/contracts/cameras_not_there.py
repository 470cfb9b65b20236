"""Live cameras of every kind whose device is not there: one world of pictures below the driver of each.

Only what stands below a driver is made up, so that the program's own code runs as it is: the kernel's V4L2 calls, the
libraries of GenICam and pylon, OpenCV's capture, and the driver of somebody else.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from acquire import pylon as pylon_module
from acquire.addresses import parse_address
from acquire.camera import live
from acquire.camera.live import DeviceFault, Driver, LiveCamera, Picture
from acquire.events import Event
from acquire.frame import CameraInfo
from acquire.genicam import camera as genicam_camera
from acquire.genicam.device import CameraIdentity, Received
from acquire.genicam.library import GenicamError
from acquire.opencv.webcam import OpenCVSettings, live_camera
from acquire.v4l2 import api
from acquire.v4l2.camera import open_v4l2
from tests.acquire.genicam.test_setup import MadeUpCamera
from tests.acquire.v4l2.fake_kernel import FakeCamera, FakeKernel

FPS, WIDTH, HEIGHT = 10, 16, 4
PICTURE, LOST, DAMAGED, NOTHING, SLOW, AWAY = "picture", "lost", "damaged", "nothing", "slow", "away"
MISSING = 3
"""Pictures that ``LOST`` leaves out before the next one."""


@dataclass
class Shot:
    number: int
    t: float
    image: NDArray[np.uint8]
    whole: bool


class World:
    """A camera that gives ten pictures a second of its own clock; the words of ``script`` are what it does first.

    Attributes
    ----------
    looks : int
        So many times it is looked for in vain once it is away.
    opened : int
        So many times it began to stream.
    """

    def __init__(self, *script: str, looks: int = 2) -> None:
        self.script, self.looks = list(script), looks
        self.t, self.number, self.present, self.opened = 1000.0, 0, True, 0
        self.events: list[Event] = []

    def now(self) -> float:
        return self.t

    def step(self) -> Shot | None:
        """The next picture, after a tenth of a second; None where none came, or it is away."""
        word = self.script.pop(0) if self.script else PICTURE
        if word == AWAY:
            self.present = False
            return None
        count = {LOST: 1 + MISSING, SLOW: 2}.get(word, 1)
        self.t += count / FPS
        if word == NOTHING:
            return None
        self.number += count if word == LOST else 1
        image = np.full((HEIGHT, WIDTH), self.number % 251, np.uint8)
        return Shot(self.number, self.t, image, word != DAMAGED)

    def look(self) -> bool:
        """Whether it is there when it is opened; half a second goes by where it was away."""
        if not self.present:
            self.t += 0.5
            self.looks -= 1
            self.present = self.looks < 0
        return self.present

    @property
    def texts(self) -> list[str]:
        return [event.text for event in self.events]


# -- the driver of somebody else --------------------------------------------------------------------


class SomebodysDriver:
    cycle = 2**16

    def __init__(self, world: World) -> None:
        if not world.look():
            raise DeviceFault("it is not there")
        self._world, self.name, self.alike, self._started = world, "own:", (WIDTH, HEIGHT), False
        self.info = CameraInfo("own:", "a camera", WIDTH, HEIGHT, 8, True, "device", FPS, pause_s=0.5)

    def start(self) -> None:
        self._world.opened += not self._started
        self._started = True

    def fetch(self, timeout_s: float) -> Picture | None:
        shot = self._world.step()
        if shot is None:
            if not self._world.present:
                raise DeviceFault("the cable is out")
            return None
        return Picture(shot.image if shot.whole else None, shot.t, shot.number)

    def close(self) -> None: ...


def somebodys(world: World, patch: pytest.MonkeyPatch) -> LiveCamera:
    def opened(before: Driver | None) -> Driver:
        return SomebodysDriver(world)

    return LiveCamera("own:", opened, world.events.append, world.now)


# -- V4L2 -------------------------------------------------------------------------------------------


class WorldKernel(FakeKernel):
    """Its camera does what a world says."""

    def __init__(self, world: World) -> None:
        self._world = world
        super().__init__(FakeCamera(formats=("GREY",), fourcc="GREY", sizes=((WIDTH, HEIGHT),)))

    def poll(self, fd: int, timeout_s: float) -> bool:
        camera, shot = self._handles[fd], self._world.step()
        camera.present = self._world.present
        if shot is None:
            return not camera.present
        camera.sequence, camera.next_t, camera.damaged_next = shot.number, shot.t, not shot.whole
        return True

    def open(self, path: str) -> int:
        self.cameras[0].present = self._world.look()
        return super().open(path)

    def ioctl(self, fd: int, request: int, argument: Any) -> None:
        self._world.opened += request == api.STREAMON
        super().ioctl(fd, request, argument)

    def nodes(self) -> list[str]:
        return [self.cameras[0].path]

    def now(self) -> float:
        return self._world.t


def v4l2(world: World, patch: pytest.MonkeyPatch) -> LiveCamera:
    return open_v4l2(parse_address("/dev/video0"), world.events.append, WorldKernel(world))


# -- GenICam ----------------------------------------------------------------------------------------


class WorldDevice(MadeUpCamera):
    """In place of ``GenicamDevice``."""

    identity = CameraIdentity("maker", "model", "1")

    def __init__(self, world: World, library: Any, name: str) -> None:
        if not world.look():
            raise GenicamError("it is not there")
        super().__init__(Width=WIDTH, Height=HEIGHT, frame_rate=FPS)
        self._world, self.lost, self.streaming = world, threading.Event(), False

    def start(self, count: int) -> None:
        self.streaming = True
        self._world.opened += 1

    def fetch(self, timeout_s: float, take: Callable[[memoryview, int], Any]) -> Received | None:
        shot = self._world.step()
        if not self._world.present:
            self.lost.set()
        if shot is None:
            return None
        taken = take(memoryview(shot.image.tobytes()), 0) if shot.whole else None
        trouble = "" if shot.whole else "packets are missing"
        return Received(shot.number, round(shot.t * 1e9), 0.0, trouble, (WIDTH, HEIGHT), taken)

    def close(self) -> None: ...


def on_the_clock_of(world: World, module: Any, patch: pytest.MonkeyPatch) -> None:
    patch.setattr(module, "time", SimpleNamespace(monotonic=world.now))
    patch.setattr(module, "LiveCamera", partial(LiveCamera, now=world.now))


def genicam(world: World, patch: pytest.MonkeyPatch) -> LiveCamera:
    on_the_clock_of(world, genicam_camera, patch)
    patch.setattr(genicam_camera, "GenicamDevice", partial(WorldDevice, world))
    patch.setattr(genicam_camera, "name_of", lambda *_: "maker-1")
    library: Any = object()
    return genicam_camera.open_genicam(parse_address("genicam:1?format=Mono8"), world.events.append, library)


# -- pylon ------------------------------------------------------------------------------------------


class Node(SimpleNamespace):
    """A feature."""

    def FromString(self, text: str) -> None:
        self.Value = text

    def ToString(self) -> str:
        return str(self.Value)


class Result:
    """What ``RetrieveResult`` gives."""

    PaddingX = 0

    def __init__(self, shot: Shot | None) -> None:
        self._shot, self.BlockID = shot, shot.number if shot else 0

    def IsValid(self) -> bool:
        return self._shot is not None

    def GrabSucceeded(self) -> bool:
        return self._shot is not None and self._shot.whole

    def GetErrorDescription(self) -> str:
        return "packets are missing"

    def GetBuffer(self) -> bytes:
        return self._shot.image.tobytes() if self._shot else b""

    def Release(self) -> None: ...


class InstantCamera:
    """A maker's camera of few features."""

    def __init__(self, world: World) -> None:
        self._world, self._grabs = world, False
        self.PixelFormat = Node(Value="Mono8", Symbolics=("Mono8",))
        self.Width, self.Height, self.MaxNumBuffer = Node(Value=WIDTH), Node(Value=HEIGHT), Node(Value=0)
        self._nodes = {"PixelFormat": self.PixelFormat, "AcquisitionFrameRate": Node(Value=float(FPS))}

    def Open(self) -> None:
        if not self._world.look():
            raise GoneError("it is not there")

    def GetNodeMap(self) -> Any:
        return SimpleNamespace(GetNode=self._nodes.get)

    def GetDeviceInfo(self) -> Any:
        return SimpleNamespace(GetVendorName=lambda: "maker", GetModelName=lambda: "model")

    def IsGrabbing(self) -> bool:
        return self._grabs

    def StartGrabbing(self, strategy: object) -> None:
        self._grabs = True
        self._world.opened += 1

    def RetrieveResult(self, timeout_ms: int, handling: object) -> Result:
        return Result(self._world.step())

    def IsCameraDeviceRemoved(self) -> bool:
        return not self._world.present

    def Close(self) -> None:
        self._grabs = False


class GoneError(Exception):
    """In place of pylon's own."""


def pylon(world: World, patch: pytest.MonkeyPatch) -> LiveCamera:
    listed = SimpleNamespace(GetSerialNumber=lambda: "1", GetFriendlyName=lambda: "model (1)")
    factory = SimpleNamespace(EnumerateDevices=lambda: [listed], CreateFirstDevice=lambda wanted: wanted)
    library = SimpleNamespace(
        DeviceInfo=lambda: SimpleNamespace(SetSerialNumber=lambda serial: None),
        TlFactory=SimpleNamespace(GetInstance=lambda: factory),
        InstantCamera=lambda device: InstantCamera(world),
        GrabStrategy_OneByOne=0, TimeoutHandling_Return=0,
    )  # fmt: skip
    nodes = SimpleNamespace(
        GenericException=GoneError, IsAvailable=lambda node: True, IsWritable=lambda node: True
    )
    patch.setattr(pylon_module, "_pylon", lambda: (library, nodes))
    on_the_clock_of(world, pylon_module, patch)
    return pylon_module.open_pylon(parse_address("pylon:1"), world.events.append)


# -- OpenCV -----------------------------------------------------------------------------------------


class WorldCapture:
    """In place of ``cv2.VideoCapture``: its reads wait, and its thread runs ahead of whoever takes the frames."""

    def __init__(self, world: World) -> None:
        self._world, self._there, self._stamp, self._reads = world, world.look(), world.t, 0

    def isOpened(self) -> bool:
        return self._there

    def read(self) -> tuple[bool, Any]:
        self._reads += 1
        if self._reads == 1:  # at opening; thrown away
            return True, np.zeros((HEIGHT, WIDTH, 3), np.uint8)
        self._world.opened += self._reads == 2
        while (shot := self._world.step()) is None and self._world.present:
            time.sleep(0.012)  # longer than one look of the loop
        if shot is None:
            return False, None
        self._stamp = shot.t
        size = (HEIGHT, WIDTH, 3) if shot.whole else (HEIGHT, WIDTH + 2, 3)
        return True, np.full(size, shot.image[0, 0], np.uint8)

    def get(self, prop: int) -> float:
        return {cv2.CAP_PROP_POS_MSEC: 1000 * self._stamp, cv2.CAP_PROP_FPS: FPS}.get(prop, 0.0)

    def set(self, prop: int, value: float) -> bool:
        return True

    def release(self) -> None: ...


def opencv(world: World, patch: pytest.MonkeyPatch) -> LiveCamera:
    patch.setattr(live, "SLICE_S", 0.01)
    capture: Callable[[], Any] = partial(WorldCapture, world)
    return live_camera("opencv:0", capture, OpenCVSettings(), world.events.append, world.now)


KINDS: dict[str, Callable[[World, pytest.MonkeyPatch], LiveCamera]] = {
    "": v4l2, "genicam": genicam, "pylon": pylon, "opencv": opencv, "own": somebodys,
}  # fmt: skip
"""By their schemes."""
