"""``phasedic characterise --pattern``: the accuracy that a picture allows, and the ZOI, step and burst to take."""

from __future__ import annotations

import argparse
import math
import sys
import time
from dataclasses import astuple, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.errors import ConfigError, DataError
from acquire.opencv.images import read_image
from acquire.text import Message
from analysis.picture.pattern import PatternReport, describe_pattern
from live.config.values import numbers_of
from live.setup.pattern.imposed import ExpectedErrors, Imposed, expected
from live.setup.pattern.outcome import (
    ExperimentContext,
    ExperimentOutcome,
    ProgressBar,
    ResultTable,
    figure,
    save_figure,
    shown,
    write_outcome,
    write_page,
)
from live.words.language import told

SIZES = (16, 24, 32, 48, 64, 96, 128)
BURSTS = (1, 4, 16, 64)
LARGEST = 640  # px of a side that are used; more takes longer and improves nothing
PAGE = "pattern.md"
FINEST, COARSEST = 1.2, 5.0
"""Speckle radii, px, between which a pattern is neither aliased nor wasteful."""

INTRODUCTION = """The accuracy that this picture allows. Its noise is removed, a quintic spline deforms it, it gets new
noise and rounding, and the kernel measures it. **This truth shares its interpolation with the kernel: there is no
independent truth for a picture whose scene is not known, so the bias is a lower bound.** Noise and spatial
resolution are valid."""

_UNITS = {
    "size": "ZOI px", "n": "frames averaged", "bias_u": "largest bias of u px", "sigma_u": "std of u px",
    "sigma_strain": "std of exx", "predicted_u": "predicted sigma of u px",
    "predicted_strain": "predicted sigma of exx",
    "limit_strain": "noise limit of exx", "strain_error": "relative error of 1e-3 strain", "length": "l_10% px",
    "refused": "share of ZOIs refused", "zois": "ZOIs",
}  # fmt: skip


def characterise_pattern(arguments: argparse.Namespace, folder: Path) -> int:
    """The command; returns the exit code.

    Raises
    ------
    ConfigError
        Impossible numbers, or a region outside the picture.
    DataError
        A file that is not a picture, or one without a pattern.
    """
    picture, bits = _picture(Path(arguments.pattern), arguments.roi)
    progress, begin = ProgressBar(told(Message("pattern")), sys.stderr), time.monotonic()
    context = ExperimentContext(folder, arguments.quick, None, progress)
    outcome = pattern(context, picture, bits, arguments.noise, arguments.burst, arguments.target * 1e-6)
    outcome = replace(outcome, seconds=time.monotonic() - begin)
    progress.done(told(Message("{seconds:.1f} s", outcome.seconds)))
    write_outcome(outcome, folder, "pattern")
    target = Path(arguments.page) if arguments.page else folder / PAGE
    write_page(
        [outcome],
        target,
        folder,
        f"phasedic characterise --pattern {Path(arguments.pattern).name}",
        INTRODUCTION,
    )
    print(told(Message("page: {path}", target)))
    return 0


def _picture(path: Path, roi: str | None) -> tuple[NDArray[Any], int]:
    """The middle of the picture or of its region, at most 640 px a side, and its depth in bits."""
    picture = read_image(path, gray="luma")
    bits = _depth(picture)
    if roi is not None:
        try:
            x, y, width, height = numbers_of(roi, int, 4)
        except ValueError:
            raise ConfigError("--roi {roi}: give four whole numbers x,y,width,height", roi) from None
        rows, columns = picture.shape
        if min(x, y) < 0 or x + width > columns or y + height > rows or min(width, height) < 1:
            raise ConfigError(
                "--roi {roi} leaves the picture of {width} x {height} px",
                *(roi, picture.shape[1], picture.shape[0]),
            )
        picture = picture[y : y + height, x : x + width]
    top, left = (max(0, (side - LARGEST) // 2) for side in picture.shape)
    picture = picture[top : top + LARGEST, left : left + LARGEST]
    if min(picture.shape) < 64:
        raise DataError(
            "{path}: {width} x {height} px are too few; 64 x 64 are needed at least",
            path,
            picture.shape[1],
            picture.shape[0],
        )
    return picture, bits


def _depth(picture: NDArray[Any]) -> int:
    """8 for bytes; else the smallest usual depth that holds the brightest pixel."""
    if picture.dtype == np.uint8:
        return 8
    brightest = int(picture.max())
    return next((bits for bits in (10, 12, 14) if brightest < 2**bits), 16)


def pattern(
    context: ExperimentContext,
    picture: NDArray[Any],
    bits: int,
    noise: float | None,
    burst: int | None,
    target: float,
) -> ExperimentOutcome:
    """Characterise one picture; ``target`` is a standard deviation of strain."""
    report = describe_pattern(picture, bits, noise)
    sigma = math.sqrt(max(report.noise**2, 1 / 12))
    if not report.gradient > 0 or report.contrast < 1e-6:
        raise DataError("the picture shows no pattern; check focus, exposure and speckle")
    imposed = Imposed(picture, sigma, float(2**bits - 1))
    bursts = (burst,) if burst else ((1, 16) if context.quick else BURSTS)
    sizes = SIZES[1:6:2] if context.quick else SIZES
    cases = [
        (size, order, n) for n in bursts for order in (1, 2) for size in sizes if order == 1 or n == bursts[0]
    ]
    found = [result for case in context.steps(cases) if (result := expected(imposed, report.gradient, *case))]
    if not found:
        raise DataError(
            "no ZOI could be measured on this picture; give a larger region (--roi) or a better pattern"
        )
    spectrum = ResultTable("pattern_spectrum", ("frequency cycles/px", "power GL^2"), _pairs(report))
    table = ResultTable(
        "pattern", tuple(_column(f.name) for f in fields(ExpectedErrors)), tuple(astuple(e) for e in found)
    )
    name = _draw(context, report, found, target)
    text = "\n\n".join([_described(report, bits, noise), recommended(found, target, burst), _short(found).markdown(),
                        f"![Spectrum of the pattern, strain noise and bias against ZOI size]({name})"])  # fmt: skip
    return ExperimentOutcome("pattern", "Your pattern", text, (table, spectrum), (name,))


def _pairs(report: PatternReport) -> tuple[tuple[float, float], ...]:
    return tuple(
        (float(r), float(p)) for r, p in zip(report.spectrum_radius, report.spectrum_power, strict=True)
    )


def _column(name: str) -> str:
    return _UNITS.get(name, name)


def _described(report: PatternReport, bits: int, noise: float | None) -> str:
    source = "as given" if noise is not None else "from the corners of its spectrum"
    advice = []
    if report.speckle_radius < FINEST:
        advice.append(
            "speckle finer than the pixels resolve: bias of interpolation grows; defocus slightly or come closer"
        )
    if report.speckle_radius > COARSEST:
        advice.append("speckle coarser than needed: a finer one gives less noise at the same ZOI")
    if report.clipped > 0.005:
        advice.append("clipped pixels: reduce exposure or light")
    if report.contrast < 0.08 * 2**bits:
        advice.append("little contrast: more light or a better pattern")
    verdict = "; ".join(advice) if advice else "suitable"
    width, band = shown(report.autocorrelation_fwhm), shown(report.band)
    return f"""{bits} bit, mean {shown(report.mean)} GL, contrast (std) {shown(report.contrast)} GL, noise
{shown(report.noise)} GL ({source}), clipped pixels {100 * report.clipped:.2g} %. Speckle radius
{shown(report.speckle_radius)} px (autocorrelation {width} px wide at half height), gradient
g = {shown(report.gradient)} GL/px, pattern above the noise up to {band} cycles/px. Verdict: {verdict}."""


def recommended(found: list[ExpectedErrors], target: float, burst: int | None) -> str:
    """The smallest ZOI, then the shortest burst, that reaches the target."""
    able = [e for e in found if e.order == 1 and e.refused < 0.05 and e.sigma_strain <= target]
    if not able:
        best = min(found, key=lambda e: e.sigma_strain)
        return (
            f"**Recommendation**: {1e6 * target:g} um/m is not reached by any case tried; nearest is a ZOI of "
            f"{best.size} px with {best.n} frames averaged: {1e6 * best.sigma_strain:.3g} um/m. Take longer bursts or "
            "larger ZOIs, more light, or a pattern with more contrast."
        )
    lines = []
    for n in sorted({e.n for e in able}):
        best = min((e for e in able if e.n == n), key=lambda e: e.size)
        lines.append(
            f"- {n} frame{'s' * (n > 1)} averaged: ZOI {best.size} px, step {max(best.size // 4, 1)} px: "
            f"{1e6 * best.sigma_strain:.3g} um/m, sines longer than {best.length:.0f} px keep 90 %"
        )
    return (
        f"**Recommendation** for {1e6 * target:g} um/m (one standard deviation of one ZOI):\n\n"
        + "\n".join(lines)
    )


def _short(found: list[ExpectedErrors]) -> ResultTable:
    columns = (
        "ZOI px", "order", "frames", "bias of u px", "std of u px", "std of exx um/m", "predicted um/m",
        "limit um/m", "error of 1e-3 %", "l_10% px",
    )  # fmt: skip
    rows = tuple(
        (e.size, e.order, e.n, e.bias_u, e.sigma_u, 1e6 * e.sigma_strain, 1e6 * e.predicted_strain,
         1e6 * e.limit_strain, 100 * e.strain_error, e.length)
        for e in found
    )  # fmt: skip
    return ResultTable("pattern_short", columns, rows)


def _draw(
    context: ExperimentContext, report: PatternReport, found: list[ExpectedErrors], target: float
) -> str:
    drawn = figure(14, 4)
    axes = drawn.subplots(1, 3)
    axes[0].semilogy(report.spectrum_radius, report.spectrum_power, label="picture")
    axes[0].axhline(max(report.noise**2, 1e-12), color="k", linestyle="--", label="noise")
    axes[0].set(xlabel="frequency, cycles/px", ylabel="power, GL^2", title="spectrum of the pattern")
    for order, n in sorted({(e.order, e.n) for e in found}):
        chosen = [e for e in found if (e.order, e.n) == (order, n)]
        label = f"order {order}, {n} frame{'s' * (n > 1)}"
        axes[1].loglog([e.size for e in chosen], [1e6 * e.sigma_strain for e in chosen], "o-", label=label)
        axes[2].loglog([e.length for e in chosen], [1e6 * e.sigma_strain for e in chosen], "o-", label=label)
    axes[1].axhline(1e6 * target, color="k", linewidth=0.8, label="target")
    axes[1].set(xlabel="side of the ZOI, px", ylabel="std of exx, um/m", title="strain noise of one ZOI")
    axes[2].set(
        xlabel="l_10%, px", ylabel="std of exx, um/m", title="strain noise against spatial resolution"
    )
    for each in axes:
        each.grid(alpha=0.3, which="both")
        each.legend(fontsize=7)
    return save_figure(context, "pattern.png", drawn)
