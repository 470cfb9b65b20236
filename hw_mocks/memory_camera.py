"""A camera from memory: ``bench:?width=1280&height=1024&fps=30`` shows whether a machine keeps up.

Pictures of a speckle pattern that is pulled and released again are rendered beforehand; then they come
at a fixed pace, whatever the reader does, from a ring of buffers like a driver's. A reader that is late by
more than the ring loses frames, and the sequence numbers show it. Nothing is rendered while it runs,
so that what is measured is the program and not the simulator.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquire.addresses import Address
from acquire.bounds import one_of
from acquire.camera import CameraBase
from acquire.frame import CameraInfo, Frame, frozen
from acquire.settings import number, read_settings, setting, whole
from hw_mocks.deformation import Affine
from hw_mocks.scene import Exposer, Sensor
from hw_mocks.speckle import Speckle

STILL_S, STILL_FRAMES = 1.0, 40
"""Without motion at the start, at least, for the reference."""
SPOT_PX = 6
"""Radius of a spot of glare."""
SHIFT_PX, STRAIN = (0.11, -0.07), (-3e-5, 1e-4)
"""Motion of the middle (x, y), and strain (exx, eyy), from one picture to the next."""


def _bits(word: str) -> int:
    return int(one_of(word, ("8", "10", "12")))


# fmt: off
@dataclass(frozen=True, slots=True)
class MemorySettings:
    """Of ``bench:``: what comes, and how fast."""

    width: int = setting(whole(64, 8192), 1280, "of the pictures", "px")
    height: int = setting(whole(64, 8192), 1024, "of the pictures", "px")
    bits: int = setting(_bits, 8, "of a sample")
    fps: float = setting(number(0.1, 10_000), 30.0, "frames a second", "1/s")
    seconds: float = setting(number(0.1), 20.0, "after which the camera ends", "s")
    pictures: int = setting(whole(4, 1000), 24, "that are rendered, and shown to and fro")
    buffers: int = setting(whole(1, 1000), 8, "of the ring")
    saturated: float = setting(number(0, 0.5), 0.0, "share of the pixels that are at saturation, in spots")
# fmt: on


class MemoryCamera(CameraBase):
    """See the module; fulfils ``acquire.camera.Camera``.

    Parameters
    ----------
    settings : MemorySettings
    address : str
    clock : callable giving monotonic seconds

    Attributes
    ----------
    dropped : int
        Frames lost so far because the ring was full.
    """

    def __init__(
        self, settings: MemorySettings, address: str, clock: Callable[[], float] = time.monotonic
    ) -> None:
        super().__init__()
        self._settings, self._clock = settings, clock
        self._pictures = render(settings)
        self._begin = 0.0
        self.dropped = 0
        s = settings
        self.info = CameraInfo(
            address, "pictures from memory", s.width, s.height, s.bits, True, "device", s.fps,
            pixel_format="GREY" if s.bits == 8 else f"Y{s.bits}", warnings=("made-up pictures, for the speed only",),
        )  # fmt: skip

    def _start(self) -> None:
        self._begin = self._clock()

    def __iter__(self) -> Iterator[Frame]:
        """Frames as they fall due; each with its own memory, as from a driver's buffer."""
        s, number = self._settings, 0
        total = round(s.seconds * s.fps)
        while number < total and not self.stopped.wait(max(0.0, self._due(number) - self._clock())):
            newest = min(int((self._clock() - self._begin) * s.fps) - 1, total - 1)
            lost = max(0, newest - s.buffers + 1 - number)
            number += lost
            self.dropped += lost
            t = self._due(number)
            yield Frame(
                frozen(self._pictures[self._which(number)].copy()), number, t, "device", lost, s.bits, t
            )
            number += 1

    def _due(self, number: int) -> float:
        return self._begin + (number + 1) / self._settings.fps

    def _which(self, number: int) -> int:
        """The picture of a frame: the first while all is still, then to and fro."""
        moving = number - max(round(STILL_S * self._settings.fps), STILL_FRAMES)
        if moving <= 0:
            return number % 2  # the same pattern with other noise
        last = len(self._pictures) - 2
        step = moving % (2 * last)
        return 1 + (step if step <= last else 2 * last - step)


def render(settings: MemorySettings) -> list[NDArray[np.uint8] | NDArray[np.uint16]]:
    """The pictures, two of the pattern at rest first, (H, W) each."""
    shape = (settings.height, settings.width)
    speckle = Speckle(shape, 2.0, margin=16, seed=1)
    exposer = Exposer(Sensor.with_noise(settings.bits, 0.01), shape, seed=1)
    bright = glare(shape, settings.saturated)
    pictures = []
    for k in (0, *range(settings.pictures)):
        pulled = Affine(
            k * SHIFT_PX[0], k * SHIFT_PX[1], k * STRAIN[0], 0.0, 0.0, k * STRAIN[1],
            settings.width / 2, settings.height / 2,
        )  # fmt: skip
        image = exposer.expose(speckle.fast(pulled)).copy()
        image[bright] = 2**settings.bits - 1
        pictures.append(frozen(image))
    return pictures


def glare(shape: tuple[int, int], share: float) -> NDArray[np.bool_]:
    """Spots that reflect the lamp, (H, W): about ``share`` of the picture."""
    rng, bright = np.random.default_rng(2), np.zeros(shape, np.bool_)
    y, x = np.ogrid[-SPOT_PX : SPOT_PX + 1, -SPOT_PX : SPOT_PX + 1]
    spot = x**2 + y**2 <= SPOT_PX**2
    for _ in range(round(share * bright.size / spot.sum())):
        top, left = (int(rng.integers(0, n - len(spot))) for n in shape)
        bright[top : top + len(spot), left : left + len(spot)] |= spot
    return bright


def open_memory_camera(address: Address) -> MemoryCamera:
    """Open ``bench:?...``; ``MemorySettings`` are its settings.

    Raises
    ------
    ConfigError
        An unknown key or an impossible value.
    """
    return MemoryCamera(read_settings(MemorySettings, address), address.text)
