"""Curves as SVG: small, sharp in print, and in the colours of the page around them.

A ``Plot`` is plain data, so that its curves can be saved as CSV too. Colours are classes of the page's style
sheet (light and dark); a file of its own holds ``STYLE``.
"""

from __future__ import annotations

import html
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.text import Message
from live.results.maps.colours import LINES, number, ticks
from live.words.language import of_terminal, told

Array = NDArray[np.float64]
WIDTH, HEIGHT = 580, 310
_LEFT, _RIGHT, _TOP, _BOTTOM = 64, 18, 44, 42
MAX_POINTS = 1600  # of a curve; a longer one is thinned to the extremes of each interval

STYLE = """
.axis,.zero{stroke:var(--edge,#76808b);stroke-width:1;fill:none}
.zero{stroke:var(--ink,#12171d);stroke-width:2}
.grid{stroke:var(--grid,#e3e7eb);stroke-width:1}
.word{fill:var(--soft,#4c5660);font:12px "Liberation Sans",Arial,"Helvetica Neue","Noto Sans","DejaVu Sans",sans-serif}
.word.ink{fill:var(--ink,#12171d);font-weight:700}
.curve{fill:none;stroke-width:2.25;stroke-linejoin:round}
.d2{stroke-dasharray:9 4} .d3{stroke-dasharray:3 3} .d4{stroke-dasharray:11 3 3 3} .d5{stroke-dasharray:15 4}
.d6{stroke-dasharray:2 5} .curve.dashed{stroke:var(--ink,#12171d);stroke-dasharray:6 4;stroke-width:1.2}
polygon.band{stroke:none;opacity:.25} .dot{fill:var(--ink,#12171d);stroke:var(--panel,#fff);stroke-width:2}
"""
COLOURS = len(LINES)
STYLE += "".join(
    f".c{k}{{stroke:var(--c{k},{line})}} .f{k}{{fill:var(--c{k},{line})}}\n"
    for k, line in enumerate(LINES, 1)
)
_TICKS = 5
_LETTER = 7.0  # px, a wide one of the words in a plot


@dataclass(frozen=True, slots=True, eq=False)
class PlotLine:
    """One line of a figure.

    Attributes
    ----------
    label : str
    x, y : (N,) float64
        In the units of the axes; NaN interrupts the line.
    sigma : (N,) float64 or None
        Half the width of the band around it.
    colour : int
    dashed : bool
        A construction, not data; does not widen the axes.
    """

    label: str
    x: Array
    y: Array
    sigma: Array | None = None
    colour: int = 0
    dashed: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Mark:
    """A point with its name and value, such as a proof stress."""

    x: float
    y: float
    name: str
    value: str
    is_bound: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Plot:
    """Curves over one pair of axes.

    Attributes
    ----------
    name : str
        Of its files.
    title, x_label, y_label : str
        Labels with units.
    curves : tuple of PlotLine
    marks : tuple of Mark
    x_range, y_range : (low, high) or None
        Fixed, so that several figures agree; else the extent of the curves.
    """

    name: str
    title: str
    x_label: str
    y_label: str
    curves: tuple[PlotLine, ...]
    marks: tuple[Mark, ...] = ()
    x_range: tuple[float, float] | None = None
    y_range: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class _Axes:
    x: tuple[float, float]
    y: tuple[float, float]

    def across(self, value: Any) -> Any:
        return _LEFT + (value - self.x[0]) / (self.x[1] - self.x[0]) * (WIDTH - _LEFT - _RIGHT)

    def down(self, value: Any) -> Any:
        return HEIGHT - _BOTTOM - (value - self.y[0]) / (self.y[1] - self.y[0]) * (HEIGHT - _TOP - _BOTTOM)


def draw(figure: Plot, *, standalone: bool = False) -> str:
    """The figure as an ``svg`` element, or as a file of its own (``standalone``)."""
    axes = _Axes(
        _rounded(*(figure.x_range or _span(figure.curves, "x"))),
        _rounded(*(figure.y_range or _span(figure.curves, "y"))),
    )
    style = (
        f'<style>{STYLE}</style><rect width="{WIDTH}" height="{HEIGHT}" fill="#fff"/>' if standalone else ""
    )
    words = html.escape(": ".join(map(told, (figure.title, figure.y_label, figure.x_label))))
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{words}">',
        style,
        f'<clipPath id="{figure.name}-clip"><rect x="{_LEFT - 3}" y="{_TOP - 3}" width="{WIDTH - _LEFT - _RIGHT + 6}"'
        f' height="{HEIGHT - _TOP - _BOTTOM + 6}"/></clipPath>',
        *_frame(figure, axes),
        f'<g clip-path="url(#{figure.name}-clip)">',
        *(part for curve in figure.curves for part in _line(curve, axes)),
        "</g>",
        *(_mark(mark, axes) for mark in figure.marks),
        *_legend(figure.curves),
        "</svg>",
    ]
    return "\n".join(part for part in parts if part)


def _span(curves: Sequence[PlotLine], axis: str) -> tuple[float, float]:
    values = [getattr(curve, axis) for curve in curves if not curve.dashed]
    values += [
        c.y + side * c.sigma for c in curves if axis == "y" and c.sigma is not None for side in (-1, 1)
    ]
    finite = np.concatenate([v[np.isfinite(v)] for v in values]) if values else np.zeros(0)
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    margin = 0.0 if high > low else 0.5 * abs(high) or 1.0
    return low - margin, high + margin


def _rounded(low: float, high: float) -> tuple[float, float]:
    """The next round numbers outward; a hundredth of the range beyond zero is shown beside the axis."""
    if abs(low) < 0.01 * high:
        low = 0.0
    if abs(high) < -0.01 * low:
        high = 0.0
    marks = ticks(low, high, about=_TICKS)
    step = marks[1] - marks[0]
    return (
        float(f"{math.floor(low / step + 1e-9) * step:.12g}"),
        float(f"{math.ceil(high / step - 1e-9) * step:.12g}"),
    )


def _frame(figure: Plot, axes: _Axes) -> Iterator[str]:
    bottom, right = HEIGHT - _BOTTOM, WIDTH - _RIGHT
    for value in _marks(*axes.x):
        x = axes.across(value)
        yield f'<line class="grid" x1="{x:.1f}" y1="{_TOP}" x2="{x:.1f}" y2="{bottom}"/>'
        yield _word(x, bottom + 16, number(value, of_terminal()), "middle")
    for value in _marks(*axes.y):
        y = axes.down(value)
        yield f'<line class="grid" x1="{_LEFT}" y1="{y:.1f}" x2="{right}" y2="{y:.1f}"/>'
        yield _word(_LEFT - 6, y + 4, number(value, of_terminal()), "end")
    yield f'<path class="axis" d="M{_LEFT} {_TOP}V{bottom}H{right}"/>'
    yield _word(right, HEIGHT - 6, figure.x_label, "end")
    yield _word(4, 14, figure.y_label, kind="word ink")


def _marks(low: float, high: float) -> list[float]:
    """Round numbers from end to end."""
    marks = ticks(low, high, about=_TICKS)
    return marks if marks[0] == low and marks[-1] == high else ticks(low, high, about=_TICKS + 3)


def _word(x: float, y: float, words: str, anchor: str = "start", kind: str = "word") -> str:
    return f'<text class="{kind}" x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{html.escape(told(words))}</text>'


def _look(curve: PlotLine) -> str:
    """The classes of a line: its colour with the dash of that, or that of a construction."""
    k = curve.colour % COLOURS + 1
    return f"curve c{k} dashed" if curve.dashed else f"curve c{k} d{k}"


def _line(curve: PlotLine, axes: _Axes) -> Iterator[str]:
    chosen = _thinned(curve.x, curve.y)
    x, y = axes.across(curve.x[chosen]), axes.down(curve.y[chosen])
    if curve.sigma is not None:
        low, high = (axes.down(curve.y[chosen] + side * curve.sigma[chosen]) for side in (-1, 1))
        yield _band(x, low, high, curve.colour % COLOURS + 1)
    path = "".join(
        f"{'L' if inside else 'M'}{a:.1f} {b:.1f}"
        for a, b, inside in zip(x, y, _follows(x, y), strict=True)
        if math.isfinite(a) and math.isfinite(b)
    )
    if path:
        yield f'<path class="{_look(curve)}" d="{path}"/>'


def _follows(x: Array, y: Array) -> list[bool]:
    """Whether the point before each is known too."""
    known = np.isfinite(x) & np.isfinite(y)
    return [False, *(bool(k) for k in known[:-1])]


def _band(x: Array, low: Array, high: Array, colour: int) -> str:
    known = np.isfinite(x) & np.isfinite(low) & np.isfinite(high)
    forth = [f"{a:.1f},{b:.1f}" for a, b in zip(x[known], low[known], strict=True)]
    back = [f"{a:.1f},{b:.1f}" for a, b in zip(x[known][::-1], high[known][::-1], strict=True)]
    return f'<polygon class="band f{colour}" points="{" ".join(forth + back)}"/>' if forth else ""


def _thinned(x: Array, y: Array) -> NDArray[np.intp]:
    """Indices that keep the extremes of each interval of ``x``, or of equal numbers where it goes back."""
    n = len(y)
    if n <= MAX_POINTS:
        return np.arange(n)
    edges = np.linspace(0, n, MAX_POINTS // 2 + 1).astype(int)
    if np.all(np.diff(x) > 0):
        edges = np.unique(np.append(np.searchsorted(x, np.linspace(x[0], x[-1], len(edges))), n))
    filled = np.nan_to_num(y, nan=0.0)
    found = {0, n - 1, *np.flatnonzero(~np.isfinite(y))[:MAX_POINTS].tolist()}
    for a, b in pairwise(edges):
        found |= {a + int(np.argmin(filled[a:b])), a + int(np.argmax(filled[a:b]))}
    return np.array(sorted(found), np.intp)


def _mark(mark: Mark, axes: _Axes) -> str:
    x, y = axes.across(mark.x), axes.down(mark.y)
    name = Message("{name} {sign} {value}", mark.name, "≥" if mark.is_bound else "=", mark.value)
    left = x + 8 + _LETTER * len(name) > WIDTH  # where the curve often is
    words = _word(x + (-8 if left else 8), y + 18, name, "end" if left else "start", "word ink")
    return f'<circle class="dot" cx="{x:.1f}" cy="{y:.1f}" r="5"/>{words}'


def _legend(curves: Sequence[PlotLine]) -> Iterator[str]:
    """In a row above the axes."""
    x = float(_LEFT)
    for curve in curves:
        if not curve.label:
            continue
        yield f'<path class="{_look(curve)}" d="M{x:.0f} 30h24"/>'
        yield _word(x + 29, 34, curve.label)
        x += 44 + 6.6 * len(told(curve.label))
