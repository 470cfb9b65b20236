"""What virtual gauges cost a burst: the measuring path on fields that are there already, by processor time."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any, cast

import numpy as np

from acquire.burst.accumulate import burst_of
from acquire.frame import Burst, Frame
from acquire.load_cell import LoadLog
from analysis import PhaseKernel, Roi, Status, StrainField, ZoiGrid
from analysis.evaluate import GAUGE_KINDS, Gauge
from live.pipeline.measure import measure
from tests.accuracy.truth import Speckle, affine, digitise

SHAPE = (1024, 1024)
COUNTS = (0, 10, 100)  # what one alone adds is less than the noise
BURSTS, ROUNDS = 40, 9
FLICKER = 0.002
"""Share of the ZOIs that another field has lost."""


class ReadyFields:
    """In place of a ``Tracker``: fields one after the other."""

    def __init__(self, fields: list[StrainField]) -> None:
        self._fields, self._count = fields, 0

    def measure(self, burst: Burst) -> StrainField:
        self._count += 1
        return self._fields[self._count % len(self._fields)]


def gauges(count: int) -> list[Gauge]:
    """So many, of every kind in turn, of 70 to 250 px, anywhere in the picture."""
    rng, kinds = np.random.default_rng(4), list(GAUGE_KINDS.values())
    made = []
    for k in range(count):
        start, size = rng.uniform(60, 700, 2), rng.uniform(70, 250, 2)
        kind = kinds[k % len(kinds)]
        handles = [tuple(start.tolist()), tuple((start + size).tolist())]
        made.append(kind.of(f"g{k}", kind.from_handles(handles), "y"))
    return made


def fields(step: int) -> tuple[list[StrainField], Burst]:
    """Two fields of a noisy picture on ZOIs of 32 px, and a burst."""
    rng, pattern = np.random.default_rng(1), Speckle(2.0, 3)
    pictures = [
        digitise(pattern.at(*affine(SHAPE, u=0.2 * i, dv_dy=1e-3 * i)), 8, 0.01, rng) for i in range(3)
    ]
    kernel = PhaseKernel(pictures[0], ZoiGrid.cover(Roi(8, 8, 1008, 1008), 32, step), noise=2.6)
    made = [kernel.measure(picture, noise=2.6) for picture in pictures[1:]]
    frame = Frame(pictures[0], 0, 0.0, "nominal", 0, 8, 0.0)
    return made, burst_of([frame])


def flickering(made: list[StrainField]) -> list[StrainField]:
    """Fields that have each lost other ZOIs."""
    rng = np.random.default_rng(7)
    return [_without(made[k % 2], rng.random(made[0].status.shape) < FLICKER) for k in range(2 * BURSTS)]


def _without(field: StrainField, lost: np.ndarray) -> StrainField:
    parameters, covariance = np.array(field.parameters), np.array(field.covariance)
    parameters[:, lost], covariance[:, lost] = np.nan, np.nan
    status = np.where(lost, np.uint8(Status.LOST), field.status)
    return replace(field, parameters=parameters, covariance=covariance, status=status)


def table(step: int, flicker: bool) -> dict[str, Any]:
    """CPU ms a burst without gauges, and what each of so many adds (median of rounds in turn)."""
    made, burst = fields(step)
    if flicker:
        made = flickering(made)
    took: dict[int, list[float]] = {count: [] for count in COUNTS}
    for _ in range(ROUNDS):
        for count in COUNTS:
            some, tracker = gauges(count), cast(Any, ReadyFields(made))
            steps = measure([burst] * (BURSTS + 1), tracker, LoadLog(), gauges=some)
            next(steps)  # prepares
            began = time.process_time()
            for _one in steps:
                pass
            took[count].append(1e3 * (time.process_time() - began) / BURSTS)
    least = {count: float(np.median(times)) for count, times in took.items()}
    return {"ZOIs": made[0].status.size, "flickering": flicker, "burst without, ms": least[0]} | {
        f"a gauge of {count}, ms": (least[count] - least[0]) / count for count in COUNTS[1:]
    }
