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

from live.results.maps.colours import number, ticks

Array = NDArray[np.float64]
WIDTH, HEIGHT = 580, 310
_LEFT, _RIGHT, _TOP, _BOTTOM = 74, 14, 26, 46
MAX_POINTS = 1600  # of a curve; a longer one is thinned to the extremes of each interval

STYLE = """
.axis{stroke:var(--line,#8a8f98);stroke-width:1;fill:none}
.grid{stroke:var(--faint,#e3e5e8);stroke-width:1}
.word{fill:var(--ink,#20242a);font:12px system-ui,sans-serif}
.curve{fill:none;stroke-width:1.6;stroke-linejoin:round}
.dashed{stroke-dasharray:6 4;stroke-width:1.2}
.c0{stroke:var(--c0,#1f5fbf)} .c1{stroke:var(--c1,#b8480c)} .c2{stroke:var(--c2,#2b7a3d)}
.c3{stroke:var(--c3,#7b3fa0)} .c4{stroke:var(--c4,#8a6d00)} .c5{stroke:var(--c5,#0f7b83)}
.f0{fill:var(--c0,#1f5fbf)} .f1{fill:var(--c1,#b8480c)} .f2{fill:var(--c2,#2b7a3d)}
.f3{fill:var(--c3,#7b3fa0)} .f4{fill:var(--c4,#8a6d00)} .f5{fill:var(--c5,#0f7b83)}
.band{stroke:none;opacity:.25}
"""
COLOURS = 6


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
    axes = _Axes(figure.x_range or _span(figure.curves, "x"), figure.y_range or _span(figure.curves, "y"))
    style = (
        f'<style>{STYLE}</style><rect width="{WIDTH}" height="{HEIGHT}" fill="#fff"/>' if standalone else ""
    )
    words = html.escape(f"{figure.title}: {figure.y_label} over {figure.x_label}")
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{words}">',
        style,
        f'<clipPath id="{figure.name}-clip"><rect x="{_LEFT}" y="{_TOP}" width="{WIDTH - _LEFT - _RIGHT}"'
        f' height="{HEIGHT - _TOP - _BOTTOM}"/></clipPath>',
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
    margin = 0.03 * (high - low) or 0.5 * abs(high) or 1.0
    return low - margin, high + margin


def _frame(figure: Plot, axes: _Axes) -> Iterator[str]:
    bottom, right = HEIGHT - _BOTTOM, WIDTH - _RIGHT
    for value in ticks(*axes.x, about=6):
        x = axes.across(value)
        yield f'<line class="grid" x1="{x:.1f}" y1="{_TOP}" x2="{x:.1f}" y2="{bottom}"/>'
        yield _word(x, bottom + 16, number(value), "middle")
    for value in ticks(*axes.y, about=6):
        y = axes.down(value)
        yield f'<line class="grid" x1="{_LEFT}" y1="{y:.1f}" x2="{right}" y2="{y:.1f}"/>'
        yield _word(_LEFT - 6, y + 4, number(value), "end")
    yield f'<path class="axis" d="M{_LEFT} {_TOP}V{bottom}H{right}"/>'
    yield _word((_LEFT + right) / 2, HEIGHT - 8, figure.x_label, "middle")
    middle = (_TOP + bottom) / 2
    yield (
        f'<text class="word" text-anchor="middle" transform="translate(14 {middle:.0f}) rotate(-90)">'
        f"{html.escape(figure.y_label)}</text>"
    )


def _word(x: float, y: float, words: str, anchor: str = "start") -> str:
    return f'<text class="word" x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{html.escape(words)}</text>'


def _line(curve: PlotLine, axes: _Axes) -> Iterator[str]:
    chosen = _thinned(curve.y)
    x, y = axes.across(curve.x[chosen]), axes.down(curve.y[chosen])
    colour = curve.colour % COLOURS
    if curve.sigma is not None:
        low, high = (axes.down(curve.y[chosen] + side * curve.sigma[chosen]) for side in (-1, 1))
        yield _band(x, low, high, colour)
    dashed = " dashed" if curve.dashed else ""
    path = "".join(
        f"{'L' if inside else 'M'}{a:.1f} {b:.1f}"
        for a, b, inside in zip(x, y, _follows(x, y), strict=True)
        if math.isfinite(a) and math.isfinite(b)
    )
    if path:
        yield f'<path class="curve c{colour}{dashed}" d="{path}"/>'


def _follows(x: Array, y: Array) -> list[bool]:
    """Whether the point before each is known too."""
    known = np.isfinite(x) & np.isfinite(y)
    return [False, *(bool(k) for k in known[:-1])]


def _band(x: Array, low: Array, high: Array, colour: int) -> str:
    known = np.isfinite(x) & np.isfinite(low) & np.isfinite(high)
    forth = [f"{a:.1f},{b:.1f}" for a, b in zip(x[known], low[known], strict=True)]
    back = [f"{a:.1f},{b:.1f}" for a, b in zip(x[known][::-1], high[known][::-1], strict=True)]
    return f'<polygon class="band f{colour}" points="{" ".join(forth + back)}"/>' if forth else ""


def _thinned(y: Array) -> NDArray[np.intp]:
    """Indices that keep the extremes of each interval, so that no spike is lost."""
    n = len(y)
    if n <= MAX_POINTS:
        return np.arange(n)
    edges = np.linspace(0, n, MAX_POINTS // 2 + 1).astype(int)
    filled = np.nan_to_num(y, nan=0.0)
    found = {0, n - 1, *np.flatnonzero(~np.isfinite(y))[:MAX_POINTS].tolist()}
    for a, b in pairwise(edges):
        found |= {a + int(np.argmin(filled[a:b])), a + int(np.argmax(filled[a:b]))}
    return np.array(sorted(found), np.intp)


def _mark(mark: Mark, axes: _Axes) -> str:
    x, y = axes.across(mark.x), axes.down(mark.y)
    left = x > WIDTH - 150
    words = _word(x + (-8 if left else 8), y + 18, f"{mark.name} = {mark.value}", "end" if left else "start")
    return f'<circle class="f3" cx="{x:.1f}" cy="{y:.1f}" r="4"/>{words}'


def _legend(curves: Sequence[PlotLine]) -> Iterator[str]:
    """In a row above the axes."""
    x = float(_LEFT)
    for curve in curves:
        if not curve.label:
            continue
        dashed = " dashed" if curve.dashed else ""
        yield f'<path class="curve c{curve.colour % COLOURS}{dashed}" d="M{x:.0f} 12h22"/>'
        yield _word(x + 27, 16, curve.label)
        x += 42 + 6.6 * len(curve.label)
