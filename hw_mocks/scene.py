"""What the simulated camera takes: the pattern on the specimen at any instant, and the sensor that makes counts of it.

Noise of a pixel at mean grey level mu: ``sigma^2 = K mu + K^2 sigma_d^2 + 1/12`` (EMVA 1288), shot
noise taken as normal, which holds above some ten electrons; fixed pattern, rounding and saturation come on top.
Motion during the exposure is left out: a frame shows its mid-exposure instant.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from functools import lru_cache
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.addresses import Options
from acquire.frame import frozen
from acquire.settings import take_settings
from hw_mocks.optics import Optics
from hw_mocks.sim_settings import SensorSettings
from hw_mocks.specimen import VirtualSpecimen
from hw_mocks.speckle import Hole, Speckle

FRINGE = 8.0  # px of pattern beyond what the test can move into view
RENDER_SHARE = 0.4
"""Of one core that rendering may take where the rate follows the machine."""


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


READ_SHARE = 0.04  # of the noise variance at mid-grey, where only the total is given


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
