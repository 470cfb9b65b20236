"""A tensile test evaluated: modulus, Poisson's ratio, strengths, extensions and rates, each with its interval.

``evaluate_test`` takes a ``Curve`` and a ``Standard``. The curve itself stays as it was measured; the zero of its
strain is an option that the result names.

The strain rate of parts of a test, and its duration, held against a standard.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from acquire.text import Message, joined
from acquire.text.message import counted
from analysis.evaluate import strengths
from analysis.evaluate.curve import Curve, Floats, Loading, first_crossing, noise, reading
from analysis.evaluate.elastic import (
    FILM,
    MIN_POINTS,
    FittedLine,
    between,
    blur_share,
    chord,
    lens_share,
    line_through,
    not_uniform,
    poisson,
    poisson_between,
)
from analysis.evaluate.figure import Figure
from analysis.evaluate.flow import anisotropy, hardening
from analysis.evaluate.programme import KindOfTest
from analysis.evaluate.seen import Unseen, confirmed, unseen, without_stopped
from analysis.evaluate.tensile_figures import Band, Span, Standard, StrainZero, TensileFigures, TensileOptions

_PARTS, _IN_PART = 10, 5  # of a strain rate held against a standard, and the points that each needs


def strain_rate(loading: Loading, first: int, last: int, bands: tuple[Band, ...]) -> Figure:
    """The slope of strain over time, held against the bands of a standard."""
    t, strain = (loading.t - loading.idle)[first:last], loading.strain[first:last]
    if len(t) < 3 or np.ptp(t) == 0:
        return Figure.none(Message("{count} points of that part are known", len(t)))
    dt, de = t - t.mean(), strain - strain.mean()
    stt = float(dt @ dt)
    slope = float(dt @ de) / stt
    rest = de - slope * dt
    found = Figure.about(slope, math.sqrt(float(rest @ rest) / (len(t) - 2) / stt), len(t) - 2)
    return replace(found, why=_against(slope, _rates(t, strain), bands))


def _rates(t: Floats, strain: Floats) -> list[float]:
    """The rates of the tenths of a part; none of few points."""
    if len(t) < _PARTS * _IN_PART:
        return []
    parts = zip(np.array_split(t, _PARTS), np.array_split(strain, _PARTS), strict=True)
    return [float(np.polyfit(one - one.mean(), values, 1)[0]) for one, values in parts]


def midway(loading: Loading, line: FittedLine) -> int:
    """Where half the strain between the elastic interval and the highest stress has gone."""
    first, last = line.last - 1, loading.top
    if last <= first:
        return last + 1
    half = 0.5 * (loading.course[first] + loading.course[last])
    return first + int(np.argmax(loading.course[first:] >= half))


def _against(rate: float, parts: list[float], bands: tuple[Band, ...]) -> str:
    """Which of the bands a rate is in, and whether the parts have kept to it."""
    if not bands:
        return ""
    inside = [band for band in bands if band.low <= rate <= band.high]
    if inside:
        kept = all(inside[0].low <= one <= inside[0].high for one in parts)
        tenths = (
            ""
            if kept
            else Message(" on average, its tenths at {least:.2g} to {most:.2g} 1/s", min(parts), max(parts))
        )
        return Message("within {name}{tenths}", inside[0].name, tenths)
    texts = [Message("{name} {low:.2g} to {high:.2g} 1/s", band.name, band.low, band.high) for band in bands]
    allowed = joined(", ", texts)
    return Message("outside the standard ({allowed})", allowed)


def seconds_of(loading: Loading, standard: Standard) -> Figure:
    begins = first_crossing(loading.level, 0.02 * float(loading.stress[loading.top]))
    start = loading.t[0] if math.isnan(begins) else np.interp(begins, np.arange(loading.n), loading.t)
    last = loading.n - 1 if loading.broke else loading.top
    value, step = float(loading.t[last] - start), float(np.median(np.diff(loading.t)))
    wanted, words = standard.seconds_to_break, ""
    if wanted and loading.broke:
        inside = wanted[0] <= value <= wanted[1]
        words = Message(
            "{value} {wanted:g} to {wanted2:g} s of the standard",
            "within" if inside else "outside",
            wanted[0],
            wanted[1],
        )
    return Figure(value, value - step, value + step, words)


_LINE = ("E", "E_chord", "nu")
_OF_TENSION = ("Rp01", "Rp02", "Rp1", "ReH", "ReL", "Rm", "Agt", "Ag", "At", "A", "r", "n")
_ROUNDS = 8
_BENT, _SURE = 0.03, 4.0  # of the slope of a half: off that of the whole, and standard uncertainties


def evaluate_test(curve: Curve, options: TensileOptions | None = None) -> TensileFigures:
    """Evaluate a test.

    Parameters
    ----------
    curve : Curve
        As measured, from before the load to the end.
    options : TensileOptions, optional

    Returns
    -------
    TensileFigures
        E and nu carry a remark in ``why`` where the strain is not uniform over the area that they are from.
        Strengths and extensions are known of a tensile test alone, and are bounds where forces were not seen.
    """
    options = options or TensileOptions()
    living, stopped = without_stopped(curve)
    sure, notes = confirmed(living)
    programme = KindOfTest.of(sure, options.test)
    if programme.why:
        found = _untensile(_evaluated(programme.first_rise(sure), options), programme.why)
    else:
        gap = unseen(sure, curve)
        found = _evaluated(sure, options) if gap is None else _bounded(_evaluated(sure, options), sure, gap)
        notes += () if gap is None else (gap.words,)
    if programme.why or options.test != "auto":
        notes += (programme.words,)
    found, notes = _of_film(found, options.limits.film), stopped + notes
    source, elastic = curve.source, curve.elastic_source or curve.source
    return replace(found, strain=source, elastic_strain=elastic, kind=programme.kind, notes=notes)


def _untensile(figures: TensileFigures, why: str) -> TensileFigures:
    """Without what belongs to a tensile test; what else is not known has the same reason."""
    none = Figure.none(why)
    left = {name: one if one.known else none for name in _LINE for one in [getattr(figures, name)]}
    changed: dict[str, Any] = dict.fromkeys(_OF_TENSION, none) | left
    return replace(figures, **changed)


def _bounded(figures: TensileFigures, curve: Curve, gap: Unseen) -> TensileFigures:
    """Strength and extensions as bounds; those of a gap before the highest stress begin where it does."""
    top = curve.stress == figures.Rm.value
    early = top.any() and int(np.argmax(top)) >= gap.after >= 0
    before = float(curve.strain[gap.before]) - figures.zero.strain
    found = {name: getattr(figures, name) for name in ("Rm", "Agt", "Ag", "At", "A")}
    if early and found["Agt"].known and before < found["Agt"].low:
        elastic = found["Agt"].value - found["Ag"].value
        found["Agt"] = replace(found["Agt"], value=before, low=before)
        if found["Ag"].known:
            found["Ag"] = replace(found["Ag"], value=before - elastic, low=before - elastic)
    bounds: dict[str, Any] = {name: one.remarked(gap.words).at_least() for name, one in found.items()}
    return replace(figures, **bounds)


def _of_film(figures: TensileFigures, limit: float | None) -> TensileFigures:
    """With a limit of error of strains in the figures that depend on strain; E has it in its budget."""
    shares = dict.fromkeys(("E", "E_chord", "Rp01", "Rp02", "Rp1"), 0.0)
    shares |= dict.fromkeys(("nu", "Agt", "Ag", "At", "A", "r", "n"), limit or 0.0)
    limited: dict[str, Any] = {
        name: getattr(figures, name).limited(share, FILM) for name, share in shares.items()
    }
    return replace(figures, **limited) if limit else figures


def _evaluated(curve: Curve, options: TensileOptions) -> TensileFigures:
    loading, strength = Loading.of(curve), strengths.tensile_strength(curve)
    if loading.n < MIN_POINTS or loading.stress[loading.top] <= 0:
        words = Message(
            "only {measurements} with strain and a tensile force, {MIN_POINTS} are needed: are sign (--load-sign) "
            "and time (--lag) of the force right?",
            counted(loading.n, "measurement"),
            MIN_POINTS,
        )
        if (n := len(curve.t)) < MIN_POINTS:
            words = Message(
                "{measurements} in all, {MIN_POINTS} are needed: more pictures",
                counted(n, "measurement"),
                MIN_POINTS,
            )
        return replace(_nothing(words, options), Rm=strength)
    if not strength.known:
        return _nothing(strength.why, options)
    elastic = _elastic(loading, options)
    if isinstance(elastic, str):
        return replace(_without_line(loading, options, elastic), Rm=strength)
    return _with_line(loading, options, elastic, strength)


@dataclass(frozen=True, slots=True)
class _Elastic:
    line: FittedLine
    flow: strengths.Yield
    zero: StrainZero


def _elastic(loading: Loading, options: TensileOptions) -> _Elastic | str:
    """The elastic line and what its interval hangs on, found in turns until they agree; or why there is none."""
    limit, zero = 0.5 * float(loading.stress[loading.top]), StrainZero(0.0, Message("as measured"))
    of = Message("half of the highest stress")
    found: _Elastic | None = None
    for _ in range(_ROUNDS):
        first, last, words = _interval(loading, options.standard, limit, zero.strain, of)
        if found and (first, last) == (found.line.first, found.line.last):
            break
        line = line_through(loading, first, last)
        if line is None:
            return Message(
                "only {measurements} {words}, {MIN_POINTS} are needed: take more pictures there, or give "
                "modulus_between",
                counted(last - first, "measurement"),
                words,
                MIN_POINTS,
            )
        zero = _zero(loading, options, line)
        found = _Elastic(line, strengths.yield_point(loading, line), zero)
        known = [f for f in (found.flow.upper, strengths.proof_strength(loading, line, 0.002)) if f.known]
        limit = known[0].value if known else float(loading.stress[loading.top])
        of = Message("the yield strength") if known else Message("the highest stress")
    return found or Message("no points")


def _interval(
    loading: Loading, standard: Standard, limit: float, zero: float, of: str
) -> tuple[int, int, str]:
    """First and last point of the elastic interval, and the interval in words; ``of`` says what ``limit`` is."""
    rule, course = standard.interval, loading.course[: loading.top + 1] - zero
    low, high = rule.low, rule.high
    if rule.by == "yield":
        first, last = between(loading.level[: loading.top + 1], low * limit, high * limit)
        return (
            first,
            last,
            Message("between {low:g} % and {high:g} % of {limit}", 100 * low, 100 * high, of),
        )
    if standard.brittle and course[-1] < standard.brittle[0]:
        low, high = (share * float(course[-1]) for share in standard.brittle[1:])
    return *between(course, low, high), Message(
        "between the strains {low:.3g} % and {high:.3g} %", 100 * low, 100 * high
    )


def _zero(loading: Loading, options: TensileOptions, line: FittedLine) -> StrainZero:
    if options.zero == "toe":
        return StrainZero(line.strain0, Message("where the elastic line has no stress (toe compensation)"))
    if options.zero == "raw":
        return StrainZero(0.0, Message("as measured"))
    at = first_crossing(loading.level, options.preload)
    if math.isnan(at):
        return StrainZero(
            float(loading.strain[0]),
            Message("the first value; the preload was there from the beginning or never"),
        )
    k = int(at)
    value = reading(loading.strain, at, k - MIN_POINTS, k + MIN_POINTS, loading.noise_strain).value
    return StrainZero(value, Message("where the stress first reached the preload"))


def _with_line(
    loading: Loading, options: TensileOptions, elastic: _Elastic, strength: Figure
) -> TensileFigures:
    line, flow, zero = elastic.line, elastic.flow, elastic.zero.strain
    rp01, rp02, rp1 = (strengths.proof_strength(loading, line, offset) for offset in (0.001, 0.002, 0.01))
    agt, at = (_from_zero(f(loading), zero) for f in (strengths.strain_at_top, strengths.strain_at_break))
    ends = [float(loading.stress[k]) for k in (loading.top, -1)]
    region = replace(loading, strain=loading.elastic, noise_strain=noise(loading.elastic))
    slope = line_through(region, line.first, line.last) or line
    remark = not_uniform(loading, slope)
    strained = float(loading.course[line.last - 1] - loading.course[line.first])
    shares = options.limits.shares(strained) | lens_share(loading, line, strained) | blur_share(loading, line)
    nu = _poisson(loading, slope, options.standard)
    figures = TensileFigures(
        E=slope.modulus(math.hypot(*shares.values())).remarked(remark or _not_straight(region, slope)),
        E_chord=chord(region, slope, math.hypot(*shares.values())),
        budget={"scatter": slope.sigma / slope.slope, **shares},
        r2=slope.r2,
        nu=nu.remarked(remark),
        Rp01=rp01,
        Rp02=rp02,
        Rp1=rp1,
        ReH=flow.upper,
        ReL=flow.lower,
        Rm=strength,
        Agt=agt,
        Ag=_plastic(agt, ends[0], line),
        At=at,
        A=_plastic(at, ends[1], line),
        r=anisotropy(loading, slope, nu),
        n=hardening(loading, slope),
        rate_elastic=strain_rate(loading, line.first, line.last, options.standard.rates_elastic),
        rate_plastic=strain_rate(
            loading, midway(loading, line), loading.top + 1, options.standard.rates_plastic
        ),
        seconds=seconds_of(loading, options.standard),
        span=_span(loading, line, zero),
        zero=elastic.zero,
        standard=options.standard.name,
    )
    return figures if options.standard.flow else _without_flow(figures)


def _not_straight(loading: Loading, line: FittedLine) -> str:
    """A remark where a half of the interval of ``line`` has another slope than the whole; else empty."""
    middle = (line.first + line.last) // 2
    halves = [line_through(loading, *part) for part in ((line.first, middle), (middle, line.last))]
    slopes = [half.slope / line.slope for half in halves if half]
    bent = any(
        half is not None
        and abs(half.slope - line.slope) > max(_BENT * line.slope, _SURE * max(half.sigma, line.sigma))
        for half in halves
    )
    if not bent or len(slopes) < len(halves):
        return ""
    return Message("the elastic part is not straight: {low:.0%} and {high:.0%} of E in its halves", *slopes)


def _poisson(loading: Loading, line: FittedLine, standard: Standard) -> Figure:
    if standard.poisson is None:
        return poisson(loading, line)
    return poisson_between(loading, *standard.poisson)


def _without_flow(figures: TensileFigures) -> TensileFigures:
    none = Figure.none(Message("not a figure of {standard}", figures.standard), applies=False)
    return replace(
        figures, Rp01=none, Rp02=none, Rp1=none, ReH=none, ReL=none, Ag=none, A=none, r=none, n=none
    )


def _without_line(loading: Loading, options: TensileOptions, why: str) -> TensileFigures:
    zero = 0.0 if options.zero != "preload" else float(loading.strain[0])
    how = Message("as measured") if options.zero != "preload" else Message("the first value")
    return replace(
        _nothing(Message("no elastic line: {why}", why), options),
        Agt=_from_zero(strengths.strain_at_top(loading), zero),
        At=_from_zero(strengths.strain_at_break(loading), zero),
        seconds=seconds_of(loading, options.standard),
        zero=StrainZero(zero, how),
    )


def _nothing(why: str, options: TensileOptions) -> TensileFigures:
    texts: dict[str, Any] = {
        "span": None,
        "zero": StrainZero(0.0, Message("as measured")),
        "standard": options.standard.name,
        "r2": math.nan,
        "strain": "",
        "elastic_strain": "",
        "budget": {},
    }
    names = [f.name for f in fields(TensileFigures) if f.name not in texts]
    return TensileFigures(**dict.fromkeys(names, Figure.none(why)), **texts)  # type: ignore[arg-type]


def _from_zero(strain: Figure, zero: float) -> Figure:
    return strain.minus(zero) if strain.known else strain


def _plastic(total: Figure, stress: float, line: FittedLine) -> Figure:
    if not total.known:
        return total
    return total.minus(stress / line.slope, stress / line.slope * line.sigma / line.slope)


def _span(loading: Loading, line: FittedLine, zero: float) -> Span:
    ends = [line.first, line.last - 1]
    strain, stress = loading.course[ends] - zero, loading.level[ends]
    return Span((float(strain[0]), float(strain[1])), (float(stress[0]), float(stress[1])), line.n)
