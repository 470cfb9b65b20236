"""Virtual gauges: scatter over many noisy pairs, both pictures drawn anew, against the predicted sigma."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis import PhaseKernel, Roi, ZoiGrid
from analysis.evaluate import AreaGauge, Gauge, LineGauge, TransverseGauge, ZoiGauge
from tests.accuracy.truth import Speckle, affine, digitise, field

SHAPE = (176, 272)
MARGIN = 8
SIDE = 112  # of the middle, where the hill is
NOISE, BITS = 0.01, 12
TURN = {"u": 0.3, "v": -0.2, "du_dx": 2e-3, "dv_dy": -1e-3, "du_dy": 5e-3, "dv_dx": -5e-3}
PEAK, WIDTH, PEAK_NOISE = 0.04, 36.0, 0.002  # of a hill of exx, and its sigma, px


def point(value: str) -> list[Gauge]:
    return [ZoiGauge("", (x, y), value) for x in range(40, 240, 32) for y in range(40, 150, 32)]


def mean(value: str) -> list[Gauge]:
    return [
        AreaGauge("", (x, y, 70, 70), value=value) for x in range(16, 200, 48) for y in range(16, 100, 48)
    ]


def peak(statistic: str) -> list[Gauge]:
    box = (0, 0, SIDE, SIDE)
    return [AreaGauge("", box, value="exx", statistic=statistic)]  # type: ignore[arg-type]


def line(length: float, angle: float, radius: float | None = None) -> list[Gauge]:
    dx, dy = length * np.cos(np.deg2rad(angle)), length * np.sin(np.deg2rad(angle))
    starts = [(x, y) for x in range(32, 240, 24) for y in range(32, 144, 24)]
    return [
        LineGauge("", (x, y), (x + dx, y + dy), radius)
        for x, y in starts
        if 24 <= x + dx <= SHAPE[1] - 24 and 24 <= y + dy <= SHAPE[0] - 24
    ]


def across(along: str) -> list[Gauge]:
    return [
        TransverseGauge("", (x, y, 100, 60), along)  # type: ignore[arg-type]
        for x in range(16, 160, 64) for y in range(16, 104, 32)
    ]  # fmt: skip


@dataclass(frozen=True)
class Case:
    name: str
    kind: Callable[[], list[Gauge]]


CASES = (
    Case("zoi, eyy", lambda: point("eyy")),
    Case("zoi, exy", lambda: point("exy")),
    Case("zoi, u", lambda: point("u")),
    Case("area, mean u", lambda: mean("u")),
    Case("area, mean exx", lambda: mean("exx")),
    Case("area, mean eyy", lambda: mean("eyy")),
    Case("line, 40 px along x", lambda: line(40, 0)),
    Case("line, 160 px along x", lambda: line(160, 0)),
    Case("line, 90 px along y, ends of 30 px", lambda: line(90, 90, 30)),
    Case("line, 100 px at 30 degrees", lambda: line(100, 30)),
    Case("line, 100 px at 30 degrees, one ZOI an end", lambda: line(100, 30, 4)),
    Case("transverse, along x", lambda: across("x")),
    Case("transverse, along y", lambda: across("y")),
)
PEAKS = (
    Case("area, largest exx on a hill", lambda: peak("largest")),
    Case("area, smallest exx in a hollow", lambda: peak("smallest")),
)


def hill(height: float) -> Callable[..., tuple[NDArray, NDArray]]:
    """A displacement along x whose exx is a round hill in the middle of the picture."""
    from scipy.special import erf

    def displacement(x: NDArray, y: NDArray) -> tuple[NDArray, NDArray]:
        u = (
            height
            * WIDTH
            * np.sqrt(np.pi / 2)
            * erf(x / (np.sqrt(2) * WIDTH))
            * np.exp(-0.5 * (y / WIDTH) ** 2)
        )
        return u, np.zeros_like(u)

    return displacement


def ratio(
    gauges: list[Gauge], zois: ZoiGrid, pictures: tuple[NDArray, NDArray], pairs: int, noise: float = NOISE
) -> NDArray[np.float64]:
    """Deviation from the mean over all pairs, over the predicted sigma, (pairs, gauges)."""
    rng, share = np.random.default_rng(5), noise * (2**BITS - 1)
    values, sigmas = [], []
    for _ in range(pairs):
        before, after = (digitise(picture, BITS, noise, rng) for picture in pictures)
        found = PhaseKernel(before, zois, noise=share).measure(after, noise=share)
        read = [gauge.measure(found) for gauge in gauges]
        values.append([r.value for r in read])
        sigmas.append([r.sigma for r in read])
    deviation = np.array(values) - np.mean(values, axis=0)
    return np.asarray(deviation / np.array(sigmas) * np.sqrt(pairs / (pairs - 1)))


def grid(size: int, step: int) -> ZoiGrid:
    return ZoiGrid.cover(Roi(MARGIN, MARGIN, SHAPE[1] - 2 * MARGIN, SHAPE[0] - 2 * MARGIN), size, step)


def table(quick: bool) -> Iterator[tuple[str, int, int, int, float]]:
    """Case, ZOI, step, number of values, scatter over sigma."""
    pattern = Speckle(2.0, 1, span=400)
    still, turned = pattern.at(*affine(SHAPE)), pattern.at(*affine(SHAPE, **TURN))
    for size, step, pairs in ((32, 16, 250), (32, 8, 120)):
        gauges = [case.kind() for case in CASES]
        z = ratio(
            [g for some in gauges for g in some], grid(size, step), (still, turned), 20 if quick else pairs
        )
        ends = np.cumsum([len(some) for some in gauges])[:-1]
        for case, part in zip(CASES, np.split(z, ends, axis=1), strict=True):
            yield case.name, size, step, part.size, float(np.sqrt(np.mean(part**2)))
    rows, columns = (slice((n - SIDE) // 2, (n + SIDE) // 2) for n in SHAPE)
    zois = ZoiGrid.cover(Roi(8, 8, SIDE - 16, SIDE - 16), 32, 16)
    for case, height in zip(PEAKS, (PEAK, -PEAK), strict=True):
        moved = pattern.at(*field(SHAPE, hill(height)))
        z = ratio(
            case.kind(), zois, (still[rows, columns], moved[rows, columns]), 20 if quick else 1000, PEAK_NOISE
        )
        yield case.name, 32, 16, z.size, float(np.sqrt(np.mean(z**2)))
