"""The figures of a tensile test: one table for summary, page, report, comparison and batch, and its text lines.

Modulus, strengths and extensions, each with name, unit and interval.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from acquire.load_cell import LoadLog
from acquire.text import Amount, Message, joined, word
from acquire.text.quantity import unit_of
from analysis.evaluate import (
    AT_LEAST,
    CONFIDENCE,
    STANDARDS,
    ErrorLimits,
    Figure,
    Interval,
    LoadAxis,
    TensileFigures,
    TensileOptions,
    Track,
    evaluate_test,
    free,
    true_at_top,
)
from analysis.field import Blur
from live.config.sections import SpecimenConfig
from live.pipeline.history import History
from live.pipeline.measurement import AXIAL
from live.results.budget import BudgetRow, CameraView, budget_rows
from live.results.stored_fields import Readings

HEADLINE = ("E", "nu", "Rp02", "Rm")
"""The figures that are shown first, and compared between tests."""
_STRENGTHS = ("Rp01", "Rp02", "Rp1", "ReH", "ReL", "Rm")
_EXTENSIONS, _FLOW = ("Ag", "Agt", "A", "At"), ("r", "n")

_PLAIN, _PERCENT, _MPA, _GPA, _KN = ("", 1.0), ("%", 0.01), ("MPa", 1e6), ("GPa", 1e9), ("kN", 1e3)
_STRENGTH_SUFFIXES = dict(zip(_STRENGTHS, ("p0.1", "p0.2", "p1", "eH", "eL", "m"), strict=True))
LAG_MATTERS_S = 0.005  # and beyond its own uncertainty: to correct a smaller one changes no figure
_KINDS = {
    "GPa": "stress", "MPa": "stress", "kN": "force", "%": "share", "": "", "ms": "delay", "mm": "length",
}  # fmt: skip
NOT_KNOWN = Message("not known")


def value_text(value: float, sigma: float, unit: str) -> str:
    """``value ± sigma unit``, rounded to two digits of the uncertainty."""
    if not math.isfinite(value):
        return NOT_KNOWN
    kind = _KINDS[unit]
    one = unit_of(kind, 0.0, unit).one
    return joined("", [Amount(kind, value * one, sigma * one, 2, unit)])


def figure_text(figure: Figure, unit_is: float = 1.0, unit: str = "") -> str:
    """A figure with the larger half of its interval, or as a bound, in ``unit``, which is ``unit_is`` in SI units."""
    text = value_text(figure.value / unit_is, figure.half / unit_is, unit)
    return joined(" ", (AT_LEAST, text)) if figure.is_bound else text


@dataclass(frozen=True, slots=True)
class TensileRow:
    """One line of the table.

    Attributes
    ----------
    name : str
        As in the standards: Rp0.2, or Fp0.2 of a force.
    unit : str
    figure : Figure
        In that unit, or why it is not known.
    """

    name: str
    unit: str
    figure: Figure

    @property
    def column(self) -> str:
        """The head of a column: name and unit."""
        return f"{self.name}_{self.unit}" if self.unit else self.name

    @property
    def remark(self) -> str:
        """What must be shown with the figure; mostly nothing."""
        return self.figure.why if self.figure.known else ""

    @property
    def number(self) -> str:
        """Value, interval and unit for a person."""
        if not self.figure.known:
            return NOT_KNOWN
        return joined(" ", [*[AT_LEAST] * self.figure.is_bound, self.quantity])

    @property
    def quantity(self) -> Amount:
        """The number and the larger half of its interval, in SI units."""
        kind = _KINDS[self.unit]
        one = unit_of(kind, 0.0, self.unit).one
        return Amount(kind, self.figure.value * one, self.figure.half * one, 2)

    @property
    def text(self) -> str:
        """The number and the remark."""
        return self.number + Message(" ({remark})", self.remark) if self.remark else self.number


def tensile_table(figures: TensileFigures, *, stresses: bool) -> dict[str, TensileRow]:
    """The rows by the attribute of ``figures`` that they show, in the order of a report.

    Parameters
    ----------
    figures : TensileFigures
    stresses : bool
        The section is known; else the figures are of forces, N: EA, Fp0.2, Fm.
    """
    modulus, letter = ("E", "R") if stresses else ("EA", "F")
    stiffness, strength = (_GPA, _MPA) if stresses else (_KN, _KN)
    names = {"E": (modulus, stiffness), "E_chord": (f"{modulus} by chord", stiffness), "nu": ("nu", _PLAIN)}
    names |= {key: (letter + end, strength) for key, end in _STRENGTH_SUFFIXES.items()}
    names |= {key: (key, _PERCENT) for key in _EXTENSIONS} | {key: (key, _PLAIN) for key in _FLOW}
    return {
        key: TensileRow(name, unit, getattr(figures, key).over(one))
        for key, (name, (unit, one)) in names.items()
    }


def headline(figures: TensileFigures, *, stresses: bool) -> list[TensileRow]:
    """The rows that are shown first: modulus, Poisson's ratio, proof strength and strength."""
    rows = tensile_table(figures, stresses=stresses)
    return [rows[key] for key in HEADLINE]


def evaluate(history: History, loads: LoadLog, specimen: SpecimenConfig) -> TensileFigures:
    """The tensile figures of the run; stresses are forces (N) where the section is not known."""
    load = specimen.load(history.forces(loads))
    return evaluate_test(history.curve(load, specimen.axis), tensile_options(specimen))


def tensile_options(specimen: SpecimenConfig) -> TensileOptions:
    """The options of the evaluation from the configuration; a preload (MPa) is ignored without a section."""
    standard = STANDARDS.get(specimen.standard) or free(Interval("strain", *specimen.modulus_between))
    limits = ErrorLimits(
        _times(specimen.force_error_percent, 0.01),
        _times(specimen.section_error_percent, 0.01) if specimen.area_m2 else None,
        _times(specimen.strain_error_um_m, 1e-6),
        _times(specimen.film_error_percent, 0.01),
    )
    if specimen.zero == "preload" and specimen.area_m2 is not None:
        return TensileOptions(standard, "preload", specimen.preload_MPa * 1e6, limits, specimen.test)
    return TensileOptions(
        standard, "toe" if specimen.zero == "toe" else "raw", limits=limits, test=specimen.test
    )


def _times(value: float | None, unit: float) -> float | None:
    return None if value is None else unit * value


def budget_of(figures: TensileFigures, view: CameraView, *, stresses: bool) -> list[BudgetRow]:
    """The budget of E; empty where E is not known. ``stresses``: the section is known."""
    if figures.span is None or not figures.budget:
        return []
    return budget_rows(figures.budget, figures.span.strain[1], figures.E.value, view, stresses=stresses)


def lag_of(history: History, loads: LoadLog, specimen: SpecimenConfig) -> Figure:
    """The lag of the load behind the frames, s, found from the test itself."""
    readings = Readings.of_log(loads)
    if not readings.count:
        return Figure.none(Message("no readings of a load cell are there"))
    if loads.by_name:
        return Figure.none(Message("each force was given for a picture: there is none"))
    return readings.lag_behind(Track(history.column("t"), history.along(specimen.axis)[0]))


def lag_line(history: History, loads: LoadLog, specimen: SpecimenConfig) -> list[str]:
    """``lag_of`` as text; nothing without a load, or where there can be none."""
    if not Readings.of_log(loads).count or loads.by_name:
        return []
    lag = lag_of(history, loads, specimen)
    if not lag.known:
        return [Message("lag of the load behind the frames: not known ({why})", lag.why)]
    how = Message("too small to matter")
    if loads.lag_s:
        how = Message("{lag:g} ms corrected", loads.lag_s * 1e3)
    elif abs(lag.value) > max(LAG_MATTERS_S, lag.half):
        how = Message("not applied; --lag {lag} does", f"{lag.value:.3f}")
    text = figure_text(lag, 1e-3, "ms")
    return [
        Message("lag of the load behind the frames: {text} ({CONFIDENCE:.0%}; {how})", text, CONFIDENCE, how)
    ]


def tare_line(history: History, loads: LoadLog) -> list[str]:
    """A note where the load cell was tared in mid-test; else nothing."""
    tared = history.tared_in_mid_test(loads)
    if not tared:
        return []
    return [
        Message(
            "tared in mid-test by {force}: these figures use the zero before; strain.csv has the tare as zero_N",
            Amount("force", tared),
        )
    ]


def sharpness_line(blur: Sequence[float], sigma: Sequence[float]) -> list[str]:
    """How the sharpness of the picture changed, from its blur and sigma over time, px; nothing where not known."""
    known = [one for one in map(Blur, blur, sigma) if math.isfinite(one.px)]
    if not known:
        return []
    largest = max(known, key=lambda one: abs(one.px))
    last = known[-1]
    return [
        Message(
            "sharpness since the reference: {largest} at most, {last} in the last picture",
            largest.text,
            last.text,
        )
    ]


def film_line(specimen: SpecimenConfig) -> list[str]:
    """The limit of error of strains of a compressed film; nothing for others."""
    limit = specimen.film_error_percent
    if not limit:
        return []
    return [
        Message(
            "strains of a compressed film: not better than {limit:g} %, beside ± (the codec holds motion back; record "
            "MJPG, FFV1 or pictures)",
            limit,
        )
    ]


def alignment_line(history: History, specimen: SpecimenConfig) -> list[str]:
    """The angle from the axis of the load to the largest strain; nothing where it is not known."""
    if not history.time_steps:
        return []
    load = history.axis(specimen.axis)
    words = axis_text(load)
    turned = load.found and load.axis != specimen.first_axis
    placed = [name for name in (AXIAL, "extension") if turned and history.gauge(name) is not None]
    kept = [Message("; the gauge {name} keeps its place", name) for name in placed]
    return [joined("", [words, *kept])] if words else []


def axis_text(load: LoadAxis) -> str:
    """The axis of the load and the angle to the largest strain; empty where the axis is given and no more is known."""
    if load.assumed:
        return Message(
            "{axis} is assumed to be the axis of the load; give [specimen] axis = 'x' or 'y'", load.axis
        )
    if not load.angle.known:
        found = Message("{axis} was found to be the axis of the load: the larger strain", load.axis)
        return found if load.found else ""
    angle = figure_text(load.angle, math.pi / 180)
    words = Message("largest strain {angle} degrees off {axis} (clockwise)", angle, load.axis)
    if load.found:
        return words + Message("; {axis} was found to be the axis of the load", load.axis)
    wrong = abs(load.angle.value) > math.pi / 4
    return words + Message("; is specimen.axis = {axis} right?", repr(load.axis)) if wrong else words


def elastic_lines(figures: TensileFigures, specimen: SpecimenConfig) -> list[str]:
    """E, nu and the strengths as text; nothing where E is not known."""
    if not figures.E.known or figures.span is None:
        return []
    rows = _rows(figures, specimen)
    of = Message(" of {strain}", figures.elastic_strain) if figures.elastic_strain else ""
    if specimen.section_text:
        of = Message("{of}, section {section}", of, specimen.section_text)
    limits = beyond_scatter(figures)
    held = Message(", of E with {limits}", limits) if limits else Message(" of the scatter alone")
    how = Message(
        "({n} points{of}, ±: {CONFIDENCE:.0%} interval{held})", figures.span.n, of, CONFIDENCE, held
    )
    strengths = _known_texts(rows, _STRENGTHS)
    return [joined("  ", (_text(rows, "E"), _text(rows, "nu"), how)), *([strengths] if strengths else [])]


def beyond_scatter(figures: TensileFigures) -> str:
    """What the interval of E holds beside the scatter, in words; empty where it holds no more."""
    causes = [cause for cause in figures.budget if cause != "scatter"]
    return Message("limits of {causes}", joined(", ", map(word, causes))) if causes else ""


def _rows(figures: TensileFigures, specimen: SpecimenConfig) -> dict[str, TensileRow]:
    return tensile_table(figures, stresses=specimen.area_m2 is not None)


def _text(rows: Mapping[str, TensileRow], key: str) -> str:
    return Message("{name} = {text}", word(rows[key].name), rows[key].text)


def _known_texts(rows: Mapping[str, TensileRow], keys: Sequence[str]) -> str:
    return joined("  ", [_text(rows, key) for key in keys if rows[key].figure.known])


def figure_lines(
    figures: TensileFigures, specimen: SpecimenConfig, length: Figure | None = None
) -> list[str]:
    """All figures as text: ``elastic_lines``, the elastic part, extensions, strain rates, and what is not known.

    ``length`` is that between the ends of the extension, mm, where it is known; else the one given is taken.
    """
    rows, span = _rows(figures, specimen), figures.span
    lines = elastic_lines(figures, specimen) or [line for line in [_known_texts(rows, _STRENGTHS)] if line]
    if not lines:
        return list(figures.notes)
    if span is not None:
        low, high = span.strain
        lines.append(
            Message(
                "{standard}: strains {low:.3f} to {high:.3f} %, R2 = {r2:.5f}, by chord {chord}; strain{named} counts "
                "{zero}",
                figures.standard, 100 * low, 100 * high, figures.r2, rows["E_chord"].text, _named(figures.strain),
                figures.zero.how,
            )
        )  # fmt: skip
    lines += plastic_lines(figures, specimen, length)
    parts = Message("in the elastic part"), Message("after it")
    known = [
        Message("{rate:.3g} 1/s {when}", one.value, when) + (Message(" ({why})", one.why) if one.why else "")
        for when, one in zip(parts, (figures.rate_elastic, figures.rate_plastic), strict=True)
        if one.known
    ]
    if known:
        lines.append(Message("strain rate {rates}", joined(", ", known)))
    return lines + _unknown_lines(rows)


def plastic_lines(
    figures: TensileFigures, specimen: SpecimenConfig, length: Figure | None = None
) -> list[str]:
    """Notes on the test, extensions with the elongation, true stress and strain at the highest force, r and n."""
    rows = _rows(figures, specimen)
    extensions, flow = _known_texts(rows, _EXTENSIONS), _known_texts(rows, _FLOW)
    if extensions:
        given = specimen.gauge_length_mm
        length = length or (Figure.about(given, 0.0) if given else None)
        extensions = joined("", (extensions, _elongation(figures, length)))
    return [*figures.notes, *(line for line in (extensions, _true_line(figures, specimen), flow) if line)]


def _true_line(figures: TensileFigures, specimen: SpecimenConfig) -> str:
    """True stress and strain at the highest force, where a neck begins; empty where they are not known."""
    strength, strain = figures.Rm, figures.Agt
    if not (strain.known and figures.Ag.known and strength.known and specimen.area_m2):
        return ""
    stress, true_strain = true_at_top(strength, strain)
    return Message(
        "true stress {stress}, true strain {strain} at the highest force",
        figure_text(stress, 1e6, "MPa"),
        figure_text(true_strain, 0.01, "%"),
    )


def _elongation(figures: TensileFigures, length: Figure | None) -> str:
    """The elongation at the highest force and at break, mm; empty without a gauge length."""
    if length is None:
        return ""
    totals = ((Message("at the highest force"), figures.Agt), (Message("at break"), figures.At))
    known = [
        Message("elongation {length} {when}", figure_text(one.times(length), 1, "mm"), when)
        for when, one in totals
        if one.known
    ]
    words = joined(", ", [Message("gauge length {length:.4g} mm", length.value), *known])
    return Message("  ({words})", words)


def _named(strain: str) -> str:
    return Message(" ({strain})", strain) if strain else ""


def _unknown_lines(rows: Mapping[str, TensileRow]) -> list[str]:
    """The figures of the standard that are not known: one line for each reason."""
    reasons: dict[str, list[str]] = {}
    for key in ("E", *_STRENGTHS, *_EXTENSIONS, "nu", *_FLOW):
        figure = rows[key].figure
        if not figure.known and figure.applies:
            reasons.setdefault(figure.why, []).append(rows[key].name)
    return [Message("not known: {names} ({why})", ", ".join(names), why) for why, names in reasons.items()]
