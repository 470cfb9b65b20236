"""The colour scale of a map: its range, colours and unit, and the colours of statuses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.field import Status
from live.results.maps.colours import colour, diverging_table, nice_above, number, sequential_table, unit_for

if TYPE_CHECKING:
    from live.results.reader import Strain

Floats = NDArray[np.floating]
Image = NDArray[np.uint8]
Kind = Literal["about zero", "from zero", "free"]

OPACITY = 184
"""Of a map over a picture, 0..255."""
_WITHIN = 98.0  # percent of the values lie within the colours
_NOISE = 4.0  # sigma that the colours reach at least
_BOTH_SIDES = 0.1  # of the larger end: beyond it the values lie on both sides of zero
_SHRINK, _SHRINK_AFTER = 0.55, 20
_SAMPLE = 25  # instants that give the range of a run
_UNITS = dict.fromkeys(("u", "v", "blur", "sigma_u", "sigma_v", "sigma_blur"), "px")
_UNITS |= {"residual": "chi\u00b2", "iterations": ""}
_UNITS |= dict.fromkeys(
    ("amplification", "sigma_amplification", "poisson", "sigma_poisson", "instants", "fate"), ""
)
_UNITS["chi2"] = "chi\u00b2"
_SHOWN = {
    "compliance": ("µm/m/MPa", 1e12), "rate": ("µm/m/s", 1e6), "leaves_at_stress": ("MPa", 1e-6),
}  # fmt: skip
_FROM_ZERO = ("residual", "chi2", "blur", "instants", "fate")

_STATUSES = {
    Status.OK: (42, 157, 75),
    Status.NO_PATTERN: (127, 127, 127),
    Status.CLIPPED: (242, 200, 15),
    Status.OUTSIDE: (148, 103, 189),
    Status.LOST: (214, 39, 40),
    Status.NOT_CONVERGED: (255, 127, 14),
    Status.POOR_MATCH: (31, 119, 180),
    Status.UNEVEN: (140, 86, 75),
    Status.AMBIGUOUS: (227, 119, 194),
}
_UNKNOWN = (60, 60, 60)


def shown_unit(name: str) -> tuple[str, float]:
    """The unit of a map of the whole test for a person, and what its values are multiplied with."""
    return _SHOWN.get(name.removeprefix("sigma_"), (_UNITS.get(name, ""), 1.0))


def range_kind(name: str) -> Kind:
    """The kind of range of a map: from zero for uncertainty, residual and blur, else over the values."""
    return "from zero" if name.startswith("sigma") or name in _FROM_ZERO else "free"


class ColourRange(NamedTuple):
    """The range of the colours of a map, in the unit of its values; diverging is symmetric about zero."""

    low: float
    high: float
    is_diverging: bool = False


class AutoRange:
    """The range of a map: it follows the data in round steps, and does not flicker.

    98 % of the values are inside. It grows at once, and shrinks when the data have been small for
    ``shrink_after`` maps. Noise alone does not fill the colours: the range of a strain reaches at least four
    times the typical sigma. For a single map, it is the result of the first ``update``. Every map that the program
    shows has its range from here, and so its colours.

    Parameters
    ----------
    kind : "about zero", "from zero" or "free"
        Free: over the values; about zero where these lie on both sides of it.
    fixed : float or None
        Always -fixed to fixed, or 0 to fixed.
    """

    def __init__(
        self, kind: Kind = "about zero", fixed: float | None = None, *, shrink_after: int = _SHRINK_AFTER
    ) -> None:
        self._kind, self._fixed, self._shrink_after = kind, fixed, shrink_after
        self._span: ColourRange | None = None
        if fixed is not None:
            self._span = ColourRange(0.0, fixed) if kind == "from zero" else ColourRange(-fixed, fixed, True)
        self._small = 0

    def update(self, values: Floats, sigmas: Floats | None = None) -> ColourRange:
        """The range after a further map and its uncertainty, in the unit of ``values``."""
        if self._fixed is None:
            wanted = _wanted_span(self._kind, values, sigmas)
            if wanted is not None:
                self._follow(wanted)
        return self._span or (
            ColourRange(-1e-4, 1e-4, True) if self._kind == "about zero" else ColourRange(0.0, 1e-4)
        )

    def _follow(self, wanted: ColourRange) -> None:
        low, high, _ = self._span or (math.inf, -math.inf, False)
        outside = wanted.low < low or wanted.high > high
        self._small = self._small + 1 if wanted.high - wanted.low < _SHRINK * (high - low) else 0
        if outside or self._small >= self._shrink_after:
            self._span, self._small = _rounded(self._kind, wanted), 0


def _wanted_span(kind: Kind, values: Floats, sigmas: Floats | None) -> ColourRange | None:
    """The range of one map before rounding; None where the map is empty or all zero."""
    found = np.asarray(values[np.isfinite(values)], np.float64)
    if not found.size:
        return None
    noise = sigmas[np.isfinite(sigmas)] if sigmas is not None else found[:0]
    least = _NOISE * float(np.median(noise)) if noise.size else 0.0
    low, high = (float(v) for v in np.percentile(found, (50 - _WITHIN / 2, 50 + _WITHIN / 2)))
    smaller, tenth = min(-low, high), _BOTH_SIDES * max(-low, high)
    if kind == "free" and smaller <= max(tenth, least):
        if 0 < smaller <= least <= tenth:  # noise beyond zero
            low, high = (0.0, high) if high > -low else (low, 0.0)
        width = max(2 * least, 1e-3 * max(abs(low), abs(high))) or 1e-6
        margin = max(width - (high - low), 0) / 2
        return ColourRange(low - margin, high + margin)
    largest = 1.05 * float(np.percentile(np.abs(found), _WITHIN))
    if kind == "from zero":
        return ColourRange(0.0, largest) if largest > 0 else None
    largest = max(largest, least)
    return ColourRange(-largest, largest, True) if largest > 0 else None


def _rounded(kind: Kind, span: ColourRange) -> ColourRange:
    """Round ends; those of a free range are multiples of a fifth of it."""
    low, high, is_diverging = span
    if kind == "free" and not is_diverging:
        step = nice_above(high - low) / 5
        return ColourRange(math.floor(low / step) * step, math.ceil(high / step) * step)
    return ColourRange(0.0 if kind == "from zero" else -nice_above(high), nice_above(high), is_diverging)


@dataclass(frozen=True, slots=True)
class ColourScale:
    """The values and the unit of the colours of a map.

    Attributes
    ----------
    low, high : float
        Ends of the colours, in ``unit``.
    unit : str
    factor : float
        From the values of the map to ``unit``.
    is_diverging : bool
        About zero; else sequential.
    """

    low: float
    high: float
    unit: str
    factor: float
    is_diverging: bool = False

    @classmethod
    def of(cls, name: str, span: ColourRange, unit: str = "", factor: float = 1.0) -> ColourScale:
        """The scale of the map ``name`` over ``span`` of its values.

        ``unit`` and ``factor`` convert the values; without a unit, strains are in um/m or %. Those of the whole test
        have units of their own.
        """
        if name.removeprefix("sigma_") in _SHOWN:
            unit, factor = shown_unit(name)
        unit = unit or _UNITS.get(name, "")
        if not unit and name not in _UNITS:
            shown = unit_for(max(abs(span.low), abs(span.high)))
            unit, factor = shown.name, factor * shown.factor
        low, high = sorted((span.low * factor, span.high * factor))
        return cls(float(f"{low:.9g}"), float(f"{high:.9g}"), unit, factor, span.is_diverging)

    @classmethod
    def of_run(
        cls,
        strain: Strain,
        name: str,
        rows: Sequence[int],
        limit: float | None = None,
        unit: str = "",
        factor: float = 1.0,
    ) -> ColourScale:
        """One scale for the map ``name`` at all ``rows``; ``limit`` fixes it, in the unit of the file."""
        picked = [rows[k] for k in np.unique(np.linspace(0, len(rows) - 1, _SAMPLE).astype(int))]
        sigma = f"sigma_{name}"
        values = np.stack([strain.maps(name, row) for row in picked])
        sigmas = (
            np.stack([strain.maps(sigma, row) for row in picked])
            if sigma in (*strain.names, *strain.whole_names)
            else None
        )
        return cls.of(name, AutoRange(range_kind(name), limit).update(values, sigmas), unit, factor)

    def colours(self, values: Floats, alpha: int = OPACITY) -> Image:
        """(R, C, 4) RGBA of stored values; transparent where there is none."""
        return colour(np.asarray(values, np.float64) * self.factor, self.low, self.high, self._table, alpha)

    def ramp(self, length: int) -> Image:
        """(length, 3): the colours from the lowest to the highest value."""
        return self._table[np.linspace(0, 255, length).round().astype(np.intp)]

    def mark(self, value: float, language: str = "en") -> str:
        """A value of the bar for a person; with a plus sign where zero is its middle."""
        return "+" * (self.is_diverging and value > 0) + number(value, language)

    @property
    def _table(self) -> Image:
        return diverging_table() if self.is_diverging else sequential_table()


@dataclass(frozen=True, slots=True)
class StatusCount:
    """A line of the legend of a map of statuses: status, number of ZOIs, and its red, green and blue."""

    name: str
    text: str
    count: int
    rgb: tuple[int, int, int]


@lru_cache(maxsize=8)
def _status_table(alpha: int) -> Image:
    """(256, 4) RGBA by the number of a status; ZOIs that are not active are transparent."""
    table = np.full((256, 4), (*_UNKNOWN, alpha), np.uint8)
    table[Status.NOT_MEASURED] = 0
    for status, rgb in _STATUSES.items():
        table[status, :3] = rgb
    return table


def status_colours(statuses: NDArray[np.integer], alpha: int = OPACITY) -> Image:
    """(R, C, 4) RGBA of a map of statuses."""
    return np.asarray(_status_table(alpha)[np.asarray(statuses, np.uint8)])


def status_legend(statuses: NDArray[np.integer]) -> tuple[StatusCount, ...]:
    """The statuses in a map and how often each occurs, without ZOIs that are not active."""
    numbers, counts = np.unique(np.asarray(statuses, np.uint8), return_counts=True)
    known = {int(one): (one.name, one.text) for one in Status}
    found = []
    for status, count in zip(numbers.tolist(), counts.tolist(), strict=True):
        if status != Status.NOT_MEASURED:
            name, text = known.get(status, (f"status {status}", "of a later version of phasedic"))
            red, green, blue, _ = _status_table(255)[status].tolist()
            found.append(StatusCount(name, text, count, (red, green, blue)))
    return tuple(found)
