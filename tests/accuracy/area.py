"""The strain of an area on the simulated tensile specimen, against its truth and the Cramer-Rao limit.

The elastic part of a test: 12 bit, bursts of 4 frames, a reference of 32. Each instant is rendered once, and each
frame has its own noise. The limit is that of one affine fit over the pixels that the ZOIs cover, of a known pattern
with the noise of the two pictures.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from analysis import KernelSettings, PhaseKernel, Roi, ZoiGrid
from analysis.field import StrainField
from hw_mocks.scene import Exposer, Scene, Sensor
from hw_mocks.specimen import VirtualSpecimen
from hw_mocks.strain_modes import Kind

Floats = NDArray[np.float64]
SHAPE = (512, 640)
RIM = 8
REFERENCE, BURST = 32, 4
STRAINS = ("exx", "eyy", "exy")


@lru_cache(maxsize=2)
def pictures(
    kind: Kind, instants: int
) -> tuple[VirtualSpecimen, Floats, NDArray[np.float32], list[NDArray[np.float32]]]:
    """The specimen, the instants (s), the reference and the averaged bursts of the elastic part."""
    specimen = VirtualSpecimen(kind=kind, height=SHAPE[0], width=SHAPE[1], nominal=True)
    times = np.linspace(specimen.programme.hold_s, specimen.yield_s, instants)
    scene, exposer = Scene(specimen), Exposer(Sensor(), SHAPE, 1)
    taken = [
        burst(scene.render(float(t)), exposer, n) for t, n in [(0.0, REFERENCE), *((t, BURST) for t in times)]
    ]
    return specimen, times, taken[0], taken[1:]


def burst(light: NDArray[np.float32], exposer: Exposer, n: int) -> NDArray[np.float32]:
    total = np.zeros(SHAPE, np.float32)
    for _ in range(n):
        total += exposer.expose(light)
    return total / n


def noise(n: int) -> float:
    """Of an average of ``n`` frames of the simulated sensor at the mean level of its pattern, GL."""
    return Sensor().noise() / math.sqrt(n)


def grid_of(size: int, share: float) -> ZoiGrid:
    return ZoiGrid.cover(Roi(RIM, RIM, SHAPE[1] - 2 * RIM, SHAPE[0] - 2 * RIM), size, round(size * share))


def fields(kind: Kind, instants: int, grid: ZoiGrid, blur_px: float = 0.0) -> Iterator[StrainField]:
    """The fields of the elastic part; later pictures blurred by a Gaussian of ``blur_px``."""
    _, _, reference, later = pictures(kind, instants)
    kernel = PhaseKernel(reference, grid, KernelSettings(), noise(REFERENCE))
    found: StrainField | None = None
    for picture in later:
        seen = cv2.GaussianBlur(picture, (0, 0), blur_px) if blur_px else picture
        found = kernel.measure(seen, start=found, noise=noise(BURST))
        yield found


def limit(kind: Kind, instants: int, grid: ZoiGrid) -> Floats:
    """Cramer-Rao limit of exx, eyy, exy of one affine fit over the pixels that the ZOIs cover, (3,)."""
    specimen = pictures(kind, instants)[0]
    level = Scene(specimen).render(0.0).astype(float)
    sensor, rows, columns = (
        Sensor(),
        *(slice(int(at[0]), int(at[-1]) + grid.size) for at in (grid.first_y, grid.first_x)),
    )
    fy, fx = (sensor.top * derivative(level, axis)[rows, columns] for axis in (0, 1))
    y, x = np.mgrid[rows, columns].astype(float)
    x, y = x - x.mean(), y - y.mean()
    variance = sensor.gain * sensor.top * level[rows, columns] + sensor.read_noise**2 + 1 / 12
    variance *= 1 / REFERENCE + 1 / BURST
    j = np.stack([(g * m).ravel() for g in (fx, fy) for m in (np.ones_like(x), x, y)])
    covariance = np.linalg.inv((j / variance.ravel()) @ j.T)
    shear = np.array([0, 0, 0.5, 0, 0.5, 0])
    return np.sqrt([covariance[1, 1], covariance[5, 5], shear @ covariance @ shear])


def derivative(level: Floats, axis: int) -> Floats:
    from tests.accuracy.limit import _derivative

    return np.asarray(_derivative(level, axis))
