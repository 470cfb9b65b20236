"""Averaging of frames: strain noise against burst length, and its limits."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.field import Roi, ZoiGrid
from hw_mocks.deformation import Affine
from live.setup.pattern.outcome import (
    ExperimentContext,
    ExperimentOutcome,
    ResultTable,
    figure,
    save_figure,
    shown,
)
from tests.paper.outcomes import verdict
from tests.paper.truth import SensorModel, TrueScene, limit, ours

Floats = NDArray[np.float64]
SIZE, STEP, RADIUS = 32, 32, 2.0
NOISES = (0.1, 0.3, 1.0, 4.0)
LENGTHS = (1, 2, 4, 8, 16, 32, 64)
SHIFT = Affine(0.37, -0.21)
"""Between reference and current burst, so that both are rounded differently."""
FIXED_PATTERN = 20.0  # GL at 12 bit, constant in time
MOTIONS = (0.0, 0.05, 0.2, 0.5, 1.0, 2.0)
MOTION_FRAMES = 16


class BurstStudy:
    """One pattern and its grid; bursts of one shift against bursts at rest."""

    def __init__(self, quick: bool) -> None:
        side = (256, 320) if quick else (384, 480)
        self.scene = TrueScene(side, RADIUS, seed=55)
        self.grid = ZoiGrid.cover(Roi(16, 16, side[1] - 32, side[0] - 32), SIZE, STEP)
        self.moved = self.scene.light(SHIFT)
        sigma = limit(self.scene.slopes, self.grid, SIZE / 6).sigma[1]
        self.unit = float(np.sqrt(np.mean(sigma**2)))
        self.fixed = np.random.default_rng(9).standard_normal(side).astype(np.float32)

    def predicted(self, camera: SensorModel, n: int) -> float:
        """Noise limit of exx for means of n frames, rounding averaged like noise."""
        return self.unit * camera.sigma / camera.top / math.sqrt(n)

    def bursts(self, camera: SensorModel, fixed: float = 0.0) -> Iterator[tuple[int, Any, Any]]:
        """(n, mean of the reference, mean of the current frames), growing frame by frame."""
        pattern = self.fixed * np.float32(fixed / camera.top)
        totals = [np.zeros(self.scene.reference.shape, np.uint32) for _ in range(2)]
        for n in range(1, LENGTHS[-1] + 1):
            for total, light in zip(totals, (self.scene.reference, self.moved), strict=True):
                total += camera.picture(light + pattern, self.scene.rng)
            if n in LENGTHS:
                reference, current = ((total / n).astype(np.float32) for total in totals)
                yield n, reference, current

    def scatter(self, reference: Any, current: Any, sigma: float) -> tuple[float, float]:
        """(std of exx over ZOIs, mean error of u px)."""
        field = ours((reference, current), self.grid, sigma)
        return float(np.nanstd(field.exx, ddof=1)), float(np.nanmean(field.u)) - SHIFT.u


def burst(context: ExperimentContext) -> ExperimentOutcome:
    """N = 1 .. 64, 8 and 12 bit, 0.1 to 4 GL; then fixed pattern and motion at 12 bit."""
    study = BurstStudy(context.quick)
    rows: list[tuple[Any, ...]] = []
    cases = [(bits, noise, 0.0) for bits in (8, 12) for noise in NOISES] + [(12, 4.0, FIXED_PATTERN)]
    for bits, noise, fixed in context.steps(cases):
        camera = SensorModel(bits, noise)
        for n, reference, current in study.bursts(camera, fixed):
            std, error = study.scatter(reference, current, camera.sigma / math.sqrt(n))
            rows.append((bits, noise, fixed, n, 1e6 * std, 1e6 * study.predicted(camera, n), error))
    columns = (
        "bits", "camera noise GL", "fixed pattern GL", "frames N", "measured std of exx um/m",
        "predicted um/m", "mean error of u px",
    )  # fmt: skip
    table = ResultTable("burst", columns, tuple(rows))
    motion = _motion(study)
    name = _draw(context, table, motion)
    best = _at(table, 12, 4.0, 0.0, 64)
    found = (verdict("std of exx, 12 bit, 4 GL, 64 frames", "um/m", best[4], best[5], "the noise limit"),)
    return ExperimentOutcome(
        "burst", "Averaging frames", _text(table, motion, name), (table, motion), (name,), found
    )


def _motion(study: BurstStudy) -> ResultTable:
    """Steady motion during the current burst, 12 bit, 4 GL."""
    camera, rows = SensorModel(12, 4.0), []
    reference = _mean(study, camera, [study.scene.reference] * MOTION_FRAMES)
    for smear in MOTIONS:
        places = (np.arange(MOTION_FRAMES) - (MOTION_FRAMES - 1) / 2) * smear / MOTION_FRAMES
        lights = [study.scene.light(Affine(SHIFT.u + float(x), SHIFT.v)) for x in places]
        std, error = study.scatter(
            reference, _mean(study, camera, lights), camera.sigma / math.sqrt(MOTION_FRAMES)
        )
        rows.append((smear, 1e6 * std, 1e6 * study.predicted(camera, MOTION_FRAMES), error))
    columns = (
        "motion during the burst px",
        "measured std of exx um/m",
        "predicted at rest um/m",
        "mean error of u px",
    )
    return ResultTable("burst_motion", columns, tuple(rows))


def _mean(study: BurstStudy, camera: SensorModel, lights: list[Any]) -> Any:
    total = np.zeros(lights[0].shape, np.uint32)
    for light in lights:
        total += camera.picture(light, study.scene.rng)
    return (total / len(lights)).astype(np.float32)


def _draw(context: ExperimentContext, table: ResultTable, motion: ResultTable) -> str:
    drawn = figure(14, 4)
    axes = drawn.subplots(1, 3)
    for place, bits in zip(axes, (8, 12), strict=False):
        for number, noise in enumerate(NOISES):
            rows = np.array([row[3:6] for row in table.rows if row[:3] == (bits, noise, 0.0)], float)
            place.loglog(rows[:, 0], rows[:, 1], "o", color=f"C{number}", label=f"{noise:g} GL")
            place.loglog(rows[:, 0], rows[:, 2], color=f"C{number}", linewidth=0.9)
        place.set_title(f"{bits} bit; lines: predicted, falling as 1/sqrt(N)", fontsize=9)
    rows = np.array([row[3:6] for row in table.rows if row[2]], float)
    axes[1].loglog(rows[:, 0], rows[:, 1], "kx", label=f"4 GL + {FIXED_PATTERN:g} GL fixed pattern")
    for place in axes[:2]:
        place.set(xlabel="frames averaged, N", ylabel="std of exx, um/m")
        place.legend(fontsize=7, title="camera noise", title_fontsize=7, loc="lower left")
        place.grid(alpha=0.3, which="both")
    values = np.array(motion.rows)
    axes[2].plot(values[:, 0], values[:, 1], "o-", label="measured")
    axes[2].plot(values[:, 0], values[:, 2], "k--", label="predicted at rest")
    axes[2].set(xlabel="motion during the burst, px", ylabel="std of exx, um/m")
    axes[2].set_title(f"{MOTION_FRAMES} frames, 12 bit, 4 GL, steady motion along x", fontsize=9)
    axes[2].legend(fontsize=7)
    axes[2].grid(alpha=0.3)
    return save_figure(context, "burst.png", drawn)


def _at(table: ResultTable, bits: int, noise: float, fixed: float, n: int) -> tuple[Any, ...]:
    return next(row for row in table.rows if row[:4] == (bits, noise, fixed, n))


def _summary(table: ResultTable) -> ResultTable:
    columns = (
        "bits",
        "camera noise GL",
        "std of exx, N = 1, um/m",
        "N = 64",
        "predicted, N = 64",
        "gain (8 at best)",
    )
    rows = []
    for bits in (8, 12):
        for noise in NOISES:
            one, many = (_at(table, bits, noise, 0.0, n) for n in (1, 64))
            rows.append((bits, noise, one[4], many[4], many[5], one[4] / many[4]))
    return ResultTable("burst_summary", columns, tuple(rows))


def _text(table: ResultTable, motion: ResultTable, name: str) -> str:
    fixed, plain = _at(table, 12, 4.0, FIXED_PATTERN, 64), _at(table, 12, 4.0, 0.0, 64)
    still, half, last = motion.rows[0], motion.rows[3], motion.rows[-1]
    return f"""The paper recommends averaging. Strain noise of a {SIZE} px ZOI for bursts of N frames, reference and
current burst alike, the pattern shifted by ({SHIFT.u}, {SHIFT.v}) px between them; prediction: the noise limit with
sqrt(noise^2 + 1/12)/sqrt(N) GL.

{_summary(table).markdown()}

Averaging follows 1/sqrt(N) as long as the noise of a frame is above about 0.3 GL. Below, each pixel rounds to the
same level in every frame: the error of rounding stays, whatever N. A fixed pattern of {FIXED_PATTERN:g} GL that
does not move with the specimen leaves {shown(fixed[4])} um/m at N = 64 instead of {shown(plain[4])} and pulls u towards
zero by {shown(abs(fixed[6]))} px of {SHIFT.u}: dark and flat frames remove it, averaging does not. Steady motion of
{half[0]:g} px during the burst changes the noise from {shown(still[1])} to {shown(half[1])} um/m, {last[0]:g} px to
{shown(last[1])}, since the contrast of fine speckle is smeared; the mean displacement stays that of the middle of
the burst (error {shown(abs(last[3]))} px at {last[0]:g} px).

![Strain noise against burst length, and against motion during the burst]({name})"""
