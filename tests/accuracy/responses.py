"""The response of places over all instants of simulated tensile tests, against their truth.

12 bit, bursts of 4 frames, a reference of 32 that is drawn anew for each test. Where the strain is not uniform a ZOI
sees the strain as its own pattern weighs it: its slope is held against that of the same pictures without noise, and
that against the best affine field of the truth.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquire.addresses import parse_address
from analysis import PhaseKernel, Roi, StrainField, ZoiGrid
from analysis.evaluate.response import Departures, ResponseLines, ResponseSums
from hw_mocks.scene import Exposer, Scene, Sensor
from hw_mocks.specimen import VirtualSpecimen, specimen_from
from live.commands.demo import ZoiTruth
from live.results.place_response import UP_TO
from tests.accuracy.coverage import Coverage

Array = NDArray[np.float64]
SHAPE, RIM, SIZE, STEP = (352, 352), 8, 64, 32
REFERENCE, BURST, INSTANTS, NOISE_FREE = 32, 4, 110, 12
KNEES = {"uniform": (140.0,), "woven": (140.0,), "hole": (140.0,), "halves": (120.0, 160.0)}
WITHIN = (0.66, 0.70), (0.94, 0.96)
FALSE_MPA, LATE_MPA = 5.0, 8.0
"""A place that leaves so long before its knee does so falsely; the median comes no later."""


@dataclass(frozen=True)
class Case:
    """One line of the table."""

    kind: str
    sigma: float  # of the slope of a place, in modulus times compliance: 1 is the material
    one_frame: float  # the same from the last elastic instant alone
    coverage: Coverage  # of slopes and of Poisson's ratios
    pattern: float  # rms of slopes without noise about those of the best affine field
    chi2: float
    leaves: list[tuple[float, float, float]]  # median, 1 and 99 % of each knee, MPa
    places: int
    left: int
    false: int

    @property
    def holds(self) -> bool:
        """Coverage within its limits, widened by twice the standard error; places leave in time, and none falsely."""
        c, knees = self.coverage, KNEES[self.kind]
        shares = zip((c.one, c.two), WITHIN, strict=True)
        errors = [2 * (share * (1 - share) / c.values) ** 0.5 for share in (c.one, c.two)]
        covered = all(
            low - e <= share <= high + e for (share, (low, high)), e in zip(shares, errors, strict=True)
        )
        in_time = all(-FALSE_MPA < m - at < LATE_MPA for (m, *_), at in zip(self.leaves, knees, strict=True))
        return covered and in_time and self.false == 0


def specimen(kind: str) -> VirtualSpecimen:
    height, width = SHAPE
    return specimen_from(parse_address(f"sim:{kind}?width={width}&height={height}&hole=40&lockstep=yes"))


def cases(quick: bool) -> Iterator[Case]:
    """What was found on each specimen."""
    for kind in KNEES:
        yield _case(kind, 1 if quick else 8)


def _case(kind: str, tests: int) -> Case:
    one = specimen(kind)
    grid = ZoiGrid.cover(Roi(RIM, RIM, SHAPE[1] - 2 * RIM, SHAPE[0] - 2 * RIM), SIZE, STEP)
    if kind == "hole":
        active = np.hypot(grid.x - one.modes.x0, (grid.y - one.modes.y0)[:, None]) > 40 + 0.8 * SIZE
        grid = ZoiGrid(grid.roi, grid.size, grid.step, active)
    clear = np.ones(grid.shape, bool)
    if kind == "halves":  # the seam is of neither
        clear &= np.abs(grid.y - one.modes.y0)[:, None] > SIZE / 2
    t = np.linspace(one.programme.hold_s, one.programme.hold_s + one.programme.ramp_s, INSTANTS)
    elastic = np.linspace(one.programme.hold_s, 0.9 * one.yield_s, NOISE_FREE)
    scene, stress = Scene(one), one.stress(t) / one.E
    still = scene.render(0.0)
    plain, beside = _lines(_fields(grid, scene, still, elastic, None), one.stress(elastic) / one.E)
    truth = ZoiTruth(one, grid).strains(float(elastic[-1]))[1] / float(one.stress(elastic[-1]) / one.E)
    off, sigmas, single, chi2, at = [], [], [], [], []
    for seed in range(tests):
        fields = list(_fields(grid, scene, still, t, Exposer(Sensor(), SHAPE, seed)))
        found = Departures(grid.shape, INSTANTS)
        for x, field in zip(stress, fields, strict=True):
            found.add(float(x), field.eyy, field.sigma("eyy", "current"))
        slopes, across = _lines(fields, stress, UP_TO * np.where(np.isnan(found.at), np.inf, found.at))
        for lines, free in ((slopes, plain), (across, beside)):
            z = ((lines.slope - free.slope) / lines.sigma)[clear]
            off.append(z[np.isfinite(z)])
        last = int(np.searchsorted(stress, 0.9 * KNEES[kind][0] * 1e6 / one.E))
        sigmas.append(slopes.sigma[clear & grid.active])
        single.append(fields[last].sigma_eyy[clear & grid.active] / stress[last])
        chi2.append(slopes.chi2[clear & grid.active])
        at.append(np.where(clear & grid.active, found.at * one.E / 1e6, np.nan))
    every, where = np.abs(np.concatenate(off)), np.array(at)
    knees = KNEES[kind]
    first = grid.y < one.modes.y0
    halves = (first, ~first) if len(knees) == 2 else (np.ones(len(first), bool),)
    leaves = [tuple(np.nanpercentile(where[:, rows], (50, 1, 99)).tolist()) for rows in halves]
    false = sum(
        int(np.count_nonzero(where[:, rows] < k - FALSE_MPA)) for rows, k in zip(halves, knees, strict=True)
    )
    return Case(
        kind, float(np.nanmedian(sigmas)), float(np.nanmedian(single)),
        Coverage(float(np.mean(every < 1)), float(np.mean(every < 2)), len(every)),
        float(np.sqrt(np.nanmean((plain.slope - truth)[clear] ** 2))), float(np.nanmedian(chi2)), leaves,
        tests * int(np.count_nonzero(clear & grid.active)), int(np.isfinite(where).sum()), false,
    )  # fmt: skip


def _fields(
    grid: ZoiGrid, scene: Scene, still: NDArray[np.float32], t: Array, exposer: Exposer | None
) -> Iterator[StrainField]:
    """The field of each instant; without ``exposer`` of pictures without noise."""

    def burst(light: NDArray[np.float32], n: int) -> NDArray[np.float32]:
        if exposer is None:
            return np.asarray(4095 * light, np.float32)
        return np.asarray(sum(exposer.expose(light).astype(np.float32) for _ in range(n)) / n, np.float32)

    sensor, field = Sensor(), None
    reference = burst(still, REFERENCE)
    noise = sensor.noise() if exposer else 1.0
    kernel = PhaseKernel(reference, grid, noise=noise / REFERENCE**0.5 if exposer else noise)
    for one in t:
        field = kernel.measure(burst(scene.render(float(one)), BURST), start=field, noise=noise / BURST**0.5)
        yield field


def _lines(
    fields: Iterator[StrainField] | list[StrainField], x: Array, end: Array | float = np.inf
) -> tuple[ResponseLines, ResponseLines]:
    """Lines of eyy over ``x``, and of exx over eyy of the place, up to ``end``."""
    slope, across = ResponseSums(), ResponseSums()
    for one, field in zip(x, fields, strict=True):
        y, s_y, s_x = (
            np.where(one <= end, field.eyy, np.nan),
            *(field.sigma(n, "current") for n in ("eyy", "exx")),
        )
        slope += ResponseSums.of(one, y, s_y)
        across += ResponseSums.of(y, field.exx, s_x, sigma_x=s_y)
    return slope.lines(), across.lines()
