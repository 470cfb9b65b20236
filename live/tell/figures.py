"""The figures of a tensile test in words: modulus, strengths, extensions, each with its interval."""

from __future__ import annotations

import math

from acquire.load_cell import LoadLog
from analysis.evaluate import (
    CONFIDENCE,
    STANDARDS,
    Curve,
    Figure,
    Interval,
    LoadAxis,
    Options,
    TensileFigures,
    Track,
    evaluate_test,
    find_lag,
    free,
)
from live.measure import History
from live.setup import SpecimenConfig

_STRENGTHS = (
    ("Rp0.1", "Rp01"),
    ("Rp0.2", "Rp02"),
    ("Rp1", "Rp1"),
    ("ReH", "ReH"),
    ("ReL", "ReL"),
    ("Rm", "Rm"),
)
_EXTENSIONS = ("Ag", "Agt", "A", "At")


def quantity(value: float, sigma: float, unit: str) -> str:
    """``value +- sigma unit`` with as many digits as the uncertainty deserves."""
    if not math.isfinite(value):
        return "not known"
    if not math.isfinite(sigma) or sigma <= 0:
        return f"{value:.4g} {unit}".rstrip()
    digits = max(0, min(6, 1 - math.floor(math.log10(sigma))))
    return f"{value:.{digits}f} +- {sigma:.{digits}f} {unit}".rstrip()


def interval(figure: Figure, unit_is: float = 1.0, unit: str = "") -> str:
    """A figure with the larger half of its interval, in a unit that is ``unit_is`` of ours."""
    half = max(figure.high - figure.value, figure.value - figure.low)
    return quantity(figure.value / unit_is, half / unit_is, unit)


def evaluate(history: History, loads: LoadLog, specimen: SpecimenConfig) -> TensileFigures:
    """The tensile figures of the run; stresses are forces (N) where the section is not known."""
    axial, transverse = history.along(specimen.axis)
    stress = history.forces(loads) / (specimen.area_m2 or 1.0)
    return evaluate_test(Curve(history.column("t"), axial, stress, transverse), options_of(specimen))


def options_of(specimen: SpecimenConfig) -> Options:
    """How the configuration asks for the evaluation; a preload (MPa) needs a section, and is let go without."""
    standard = STANDARDS.get(specimen.standard) or free(Interval("strain", *specimen.modulus_between))
    if specimen.zero == "preload" and specimen.area_m2 is not None:
        return Options(standard, "preload", specimen.preload_MPa * 1e6)
    return Options(standard, "toe" if specimen.zero == "toe" else "raw")


def lag_line(history: History, loads: LoadLog, specimen: SpecimenConfig) -> list[str]:
    """How late the load comes, as the test itself tells it; nothing without a load."""
    t, force = loads.arrays()
    if not len(t):
        return []
    lag = find_lag(Track(history.column("t"), history.along(specimen.axis)[0]), Track(t, force))
    if not lag.known:
        return [f"lag of the load beside the frames: not known ({lag.why})"]
    how = f"{loads.lag_s * 1e3:g} ms taken off" if loads.lag_s else f"not applied; --lag {lag.value:.3f} does"
    return [f"lag of the load beside the frames: {interval(lag, 1e-3, 'ms')} ({CONFIDENCE:.0%}; {how})"]


def tare_line(history: History, loads: LoadLog) -> list[str]:
    """That the zero was moved in mid-test; nothing where it was not."""
    tared = history.tared_in_mid_test(loads)
    if not tared:
        return []
    return [
        f"tared in mid-test by {tared:+.4g} N: these figures go by the zero before; strain.csv has it as zero_N"
    ]


def alignment_line(history: History, specimen: SpecimenConfig) -> list[str]:
    """How far the largest strain lies off the axis of the load; nothing where the strains do not tell."""
    load = history.axis(specimen.axis)
    words = axis_words(load)
    stays = load.found and load.axis != specimen.first_axis and history.gauge("axial") is not None
    return [words + ("; the gauge axial stays where it was placed" if stays else "")] if words else []


def axis_words(load: LoadAxis) -> str:
    """The axis of the load with the angle to it; empty where the strains do not tell."""
    if not load.off.known:
        return ""
    words = f"largest strain {interval(load.off, math.pi / 180, 'degrees')} off {load.axis} (clockwise)"
    if load.found:
        return f"{words}; {load.axis} was found to be the axis of the load"
    wrong = abs(load.off.value) > math.pi / 4
    return words + (f"; is specimen.axis = {load.axis!r} right?" if wrong else "")


def elastic_lines(figures: TensileFigures, specimen: SpecimenConfig) -> list[str]:
    """E, nu and the strengths in words; nothing where the curve told nothing."""
    if not figures.E.known or figures.span is None:
        return []
    if specimen.area_m2 is None:
        stiffness = interval(figures.E, 1e3, "kN per unit strain")
        first = f"EA = {stiffness} (give [specimen] width_mm and thickness_mm for E)"
        second = f"highest force {figures.Rm.value:.4g} N"
    else:
        first = f"E = {interval(figures.E, 1e9, 'GPa')}"
        second = "  ".join(strengths(figures))
    nu = f"nu = {interval(figures.nu)}"
    return [f"{first}  {nu}  ({figures.span.n} points, +-: {CONFIDENCE:.0%} interval)", second]


def strengths(figures: TensileFigures) -> list[str]:
    """Those that are known, MPa."""
    found = [(words, getattr(figures, name)) for words, name in _STRENGTHS]
    return [f"{words} = {interval(figure, 1e6, 'MPa')}" for words, figure in found if figure.known]


def figure_lines(figures: TensileFigures, specimen: SpecimenConfig) -> list[str]:
    """All of a test: what ``elastic_lines`` says, how it was had, extensions, rates, and what cannot be had."""
    lines, span = elastic_lines(figures, specimen), figures.span
    if span is None:
        return []
    low, high = span.strain
    lines.append(
        f"  {figures.standard}: strains {100 * low:.3f} to {100 * high:.3f} %, R2 = {figures.r2:.5f}, by chord"
        f" {_chord(figures, specimen)}; strain counts {figures.zero.how}"
    )
    known = [(name, getattr(figures, name)) for name in _EXTENSIONS if getattr(figures, name).known]
    if known:
        length = f"  (gauge length {specimen.gauge_length_mm:g} mm)" if specimen.gauge_length_mm else ""
        lines.append("  ".join(f"{name} = {interval(figure, 0.01, '%')}" for name, figure in known) + length)
    if figures.rate_elastic.known:
        words = f" ({figures.rate_elastic.why})" if figures.rate_elastic.why else ""
        lines.append(f"strain rate {figures.rate_elastic.value:.3g} 1/s in the elastic part{words}")
    return lines + _unknown(figures)


def _chord(figures: TensileFigures, specimen: SpecimenConfig) -> str:
    if specimen.area_m2 is None:
        return interval(figures.E_chord, 1e3, "kN per unit strain")
    return interval(figures.E_chord, 1e9, "GPa")


def _unknown(figures: TensileFigures) -> list[str]:
    """Which figures of the standard are not known, and why, a line for each reason."""
    names = [*(_STRENGTHS), *((name, name) for name in _EXTENSIONS), ("nu", "nu")]
    reasons: dict[str, list[str]] = {}
    for words, name in names:
        figure: Figure = getattr(figures, name)
        if not figure.known and not figure.why.startswith("not a figure of"):
            reasons.setdefault(figure.why, []).append(words)
    return [f"not known: {', '.join(words)} ({why})" for why, words in reasons.items()]
