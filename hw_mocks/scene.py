"""What a camera sees: pictures of a deformed pattern, exposed as a sensor does, and a camera that has them from memory.

``bench:?width=1280&height=1024&fps=30`` shows whether a machine keeps up. Pictures of a speckle pattern that is pulled
and released again are rendered beforehand; then they come at a fixed pace, whatever the reader does, from a ring of
buffers like a driver's. A reader that is late by more than the ring loses frames, and the sequence numbers show it.
Nothing is rendered while it runs, so that what is measured is the program and not the simulator.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.addresses import Address, Options
from acquire.bounds import one_of
from acquire.camera import CameraBase
from acquire.clock import Clock
from acquire.frame import CameraInfo, Frame, frozen
from acquire.settings import number, read_settings, setting, take_settings, whole
from hw_mocks.deformation import Affine
from hw_mocks.optics import Optics
from hw_mocks.sim_settings import SensorSettings
from hw_mocks.specimen import VirtualSpecimen
from hw_mocks.speckle import Hole, Speckle

FRINGE = 8.0  # px of pattern beyond what the test can move into view
RENDER_SHARE = 0.4
"""Of one core that rendering may take where the rate follows the machine."""

STILL_S, STILL_FRAMES = 1.0, 40
"""Without motion at the start, at least, for the reference."""
SPOT_PX = 6
"""Radius of a spot of glare."""
SHIFT_PX, STRAIN = (0.11, -0.07), (-3e-5, 1e-4)
"""Motion of the middle (x, y), and strain (exx, eyy), from one picture to the next."""

READ_SHARE = 0.04  # of the noise variance at mid-grey, where only the total is given


class Scene:
    """A specimen with its pattern; the strain field at the speckles is computed once.

    Parameters
    ----------
    specimen : VirtualSpecimen
    radius : float, px
    contrast : float
        Standard deviation of the pattern, part of full scale.
    seed : int
    optics : Optics, optional
    """

    def __init__(
        self,
        specimen: VirtualSpecimen,
        radius: float = 2.0,
        contrast: float = 0.18,
        seed: int = 0,
        optics: Optics | None = None,
    ) -> None:
        self.specimen, self.optics = specimen, optics or Optics()
        shape, modes = (specimen.height, specimen.width), specimen.modes
        hole = Hole(modes.x0, modes.y0, specimen.hole_radius_px) if specimen.kind == "hole" else None
        margin = math.ceil(FRINGE + _travel(specimen, self.optics))
        self.speckle = Speckle(shape, radius, contrast=contrast, seed=seed, margin=margin, hole=hole)
        self._modes = modes.at(self.speckle.blobs.x, self.speckle.blobs.y)

    def render(self, t: float) -> NDArray[np.float32]:
        """The picture ``t`` seconds since the start, (H, W), part of full scale, without noise."""
        if not self.optics.plain:
            seen = self.speckle.fast(self.optics.seen(self.specimen, t))
            light = self.optics.light(t, self.specimen.height) if self.optics.flicker else 1.0
            return np.asarray(seen * light, np.float32)
        motion = self.specimen.at(t)
        u, v = motion.displaced(self._modes)
        blobs = self.speckle.blobs
        return self.speckle.fast_at(blobs.x + u, blobs.y + v, motion.strained(self._modes), motion)

    def exact(self, t: float) -> NDArray[np.float64]:
        """The same by the exact road of ``Speckle``, slowly; raises ValueError at the edges of plates."""
        return self.speckle.exact(self.optics.seen(self.specimen, t))


def _travel(specimen: VirtualSpecimen, optics: Optics) -> float:
    """The furthest that a corner of the image moves during the test, px."""
    x, y = np.array([0.0, 0.0, 1.0, 1.0]) * specimen.width, np.array([0.0, 1.0, 0.0, 1.0]) * specimen.height
    ways = (optics.seen(specimen, t).displacement(x, y) for t in (0.0, specimen.duration_s))
    return max(float(np.max(np.hypot(u, v))) for u, v in ways)


@dataclass(frozen=True, slots=True)
class Sensor:
    """What limits the picture.

    Attributes
    ----------
    bits : int
        8, 10, 12 or 16; saturation is at ``2**bits - 1``.
    full_well_e : float, electrons
        Charge at full scale; infinite: no shot noise.
    read_e : float, electrons
        Standard deviation of the read noise (none where the full well is infinite).
    fixed_pattern : float
        Standard deviation of the constant offset of each pixel, part of full scale.
    brightness : float
        What the light is multiplied with: above 1 the pattern begins to saturate.
    black : float
        Offset in the dark, part of full scale.
    """

    bits: int = 12
    full_well_e: float = 20_000.0
    read_e: float = 10.0
    fixed_pattern: float = 0.0
    brightness: float = 1.0
    black: float = 0.0

    @classmethod
    def with_noise(
        cls, bits: int, noise: float, *, fixed_pattern: float = 0.0, brightness: float = 1.0
    ) -> Sensor:
        """The sensor whose temporal noise at mid-grey is ``noise``, part of full scale (0: none)."""
        if noise <= 0:
            return cls(bits, math.inf, 0.0, fixed_pattern, brightness)
        well = 0.5 / ((1 - READ_SHARE) * noise**2)
        return cls(bits, well, math.sqrt(READ_SHARE) * noise * well, fixed_pattern, brightness)

    @property
    def top(self) -> int:
        """Saturation, GL."""
        return int(2**self.bits) - 1

    @property
    def gain(self) -> float:
        """K, GL per electron."""
        return self.top / self.full_well_e

    @property
    def read_noise(self) -> float:
        """K sigma_d, GL."""
        return self.gain * self.read_e if math.isfinite(self.full_well_e) else 0.0

    def noise(self, level: float = 0.5) -> float:
        """Temporal standard deviation of one frame, GL, quantisation included.

        Parameters
        ----------
        level : float
            Mean signal, part of full scale.
        """
        return math.sqrt(self.gain * self.top * level + self.read_noise**2 + 1 / 12)


def take_sensor(options: Options) -> Sensor:
    """Take the keys of the sensor out of an address's settings; raises ConfigError for an impossible value."""
    given = take_settings(SensorSettings, options)
    return Sensor.with_noise(
        int(given.bits), given.noise / 100, fixed_pattern=given.fpn / 100, brightness=given.brightness
    )


@lru_cache(maxsize=1)
def normal_quantiles() -> NDArray[np.float32]:
    """The normal distribution cut into 65536 equally likely values, (65536,) float32, variance 1.

    Sixteen random bits are a normal deviate then, a few times faster than by rejection; the tails
    end at 4.3 standard deviations.
    """
    inverse = NormalDist().inv_cdf
    values = np.array([inverse((i + 0.5) / 65536) for i in range(65536)])
    return np.asarray(values / values.std(), np.float32)


class Exposer:
    """Makes frames of one sensor, each with fresh noise.

    Parameters
    ----------
    sensor : Sensor
    shape : (H, W), px
    seed : int
        The same seed gives the same frames in the same order.
    """

    def __init__(self, sensor: Sensor, shape: tuple[int, int], seed: int = 0) -> None:
        self.sensor, self._shape = sensor, shape
        pixels = shape[0] * shape[1]
        self._state = int(np.random.SeedSequence(seed).generate_state(1, np.uint64)[0])
        spread = sensor.fixed_pattern * sensor.top
        pattern = np.random.default_rng(seed).standard_normal(pixels)
        self._fixed = (spread * pattern).astype(np.float32)

    def expose(self, light: NDArray[Any]) -> NDArray[Any]:
        """One frame.

        Parameters
        ----------
        light : (H, W) float32, part of full scale

        Returns
        -------
        (H, W) uint8 or uint16, GL
            Read-only.
        """
        from hw_mocks.speckle_loops import GOLDEN, expose

        sensor = self.sensor
        image = np.empty(self._shape, np.uint8 if sensor.bits == 8 else np.uint16)
        flat = np.ascontiguousarray(light, np.float32).ravel()
        scale, offset = sensor.brightness * sensor.top, sensor.black * sensor.top
        noise = (np.uint64(self._state), normal_quantiles(), self._fixed)
        self._state = (self._state + GOLDEN * -(-flat.size // 4)) % 2**64
        signal = (scale, offset, sensor.gain, sensor.read_noise**2)
        expose(flat, *noise, *signal, float(sensor.top), image.ravel())
        return frozen(image)


def upper_half(image: NDArray[Any]) -> NDArray[Any]:
    """A damaged picture: the rest never came."""
    torn = image.copy()
    torn[image.shape[0] // 2 :] = 0
    return frozen(torn)


def rendered_fps(scene: Scene, sensor: Sensor) -> float:
    """The rate at which rendering leaves most of the machine to the measurement, 1/s."""
    exposer = Exposer(sensor, (scene.specimen.height, scene.specimen.width), 0)
    exposer.expose(scene.render(0.0))  # compiles
    taken = []
    for t in np.linspace(0, scene.specimen.duration_s, 6):
        begin = time.perf_counter()
        exposer.expose(scene.render(float(t)))
        taken.append(time.perf_counter() - begin)
    return RENDER_SHARE / float(np.median(taken))


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

    def __init__(self, settings: MemorySettings, address: str, clock: Clock = time.monotonic) -> None:
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
