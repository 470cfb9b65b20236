"""The colour scale of a map: its range and unit, and the colours of statuses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from analysis.field import Status
from live.results.maps.colours import colour, nice_above, unit_for

if TYPE_CHECKING:
    from live.results.reader import Strain

Floats = NDArray[np.floating]
Image = NDArray[np.uint8]
Span = tuple[float, float]
Kind = Literal["about zero", "from zero", "free"]

OPACITY = 184
"""Of a map over a picture, 0..255."""
_WITHIN = 98.0  # percent of the values lie within the colours
_NOISE = 4.0  # sigma that the colours reach at least
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
_FREE = ("u", "v", "iterations", "amplification", "poisson", "leaves_at_strain", *_SHOWN)
_FROM_ZERO = ("residual", "chi2", "instants", "fate")


def shown_unit(name: str) -> tuple[str, float]:
    """The unit of a map of the whole test for a person, and what its values are multiplied with."""
    return _SHOWN.get(name.removeprefix("sigma_"), (_UNITS.get(name, ""), 1.0))


def range_kind(name: str) -> Kind:
    """The kind of range of a map: about zero for strains, from zero for uncertainties, else over the values."""
    if name in _FREE:
        return "free"
    return "from zero" if name.startswith("sigma") or name in _FROM_ZERO else "about zero"


class AutoRange:
    """The range of a map: it follows the data in round steps, and does not flicker.

    98 % of the values are inside. It grows at once, and shrinks when the data have been small for
    ``shrink_after`` maps. Noise alone does not fill the colours: the range of a strain reaches at least four
    times the typical sigma. For a single map, it is the result of the first ``update``.

    Parameters
    ----------
    kind : "about zero", "from zero" or "free"
    fixed : float or None
        Always -fixed to fixed, or 0 to fixed.
    """

    def __init__(
        self, kind: Kind = "about zero", fixed: float | None = None, *, shrink_after: int = _SHRINK_AFTER
    ) -> None:
        self._kind, self._fixed, self._shrink_after = kind, fixed, shrink_after
        self._span: Span | None = None if fixed is None else (0.0 if kind == "from zero" else -fixed, fixed)
        self._small = 0

    def update(self, values: Floats, sigmas: Floats | None = None) -> Span:
        """The ends of the range after a further map and its uncertainty, in the unit of ``values``."""
        if self._fixed is None:
            wanted = _wanted_span(self._kind, values, sigmas)
            if wanted is not None:
                self._follow(wanted)
        return self._span or (-1e-4 if self._kind == "about zero" else 0.0, 1e-4)

    def _follow(self, wanted: Span) -> None:
        low, high = self._span or (math.inf, -math.inf)
        outside = wanted[0] < low or wanted[1] > high
        self._small = self._small + 1 if wanted[1] - wanted[0] < _SHRINK * (high - low) else 0
        if outside or self._small >= self._shrink_after:
            self._span, self._small = _rounded(self._kind, wanted), 0


def _wanted_span(kind: Kind, values: Floats, sigmas: Floats | None) -> Span | None:
    """The range of one map before rounding; None where the map is empty or all zero."""
    found = np.asarray(values[np.isfinite(values)], np.float64)
    if not found.size:
        return None
    noise = sigmas[np.isfinite(sigmas)] if sigmas is not None else found[:0]
    least = _NOISE * float(np.median(noise)) if noise.size else 0.0
    if kind == "free":
        low, high = (float(v) for v in np.percentile(found, (50 - _WITHIN / 2, 50 + _WITHIN / 2)))
        width = max(2 * least, 1e-3 * max(abs(low), abs(high))) or 1e-6
        margin = max(width - (high - low), 0) / 2
        return low - margin, high + margin
    largest = 1.05 * float(np.percentile(np.abs(found), _WITHIN))
    if kind == "about zero":
        largest = max(largest, least)
    return ((-largest if kind == "about zero" else 0.0), largest) if largest > 0 else None


def _rounded(kind: Kind, span: Span) -> Span:
    """Round ends; those of a free range are multiples of a fifth of it."""
    low, high = span
    if kind == "free":
        step = nice_above(high - low) / 5
        return math.floor(low / step) * step, math.ceil(high / step) * step
    return (0.0 if kind == "from zero" else -nice_above(high)), nice_above(high)


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
    """

    low: float
    high: float
    unit: str
    factor: float

    @classmethod
    def of(cls, name: str, span: Span, unit: str = "", factor: float = 1.0) -> ColourScale:
        """The scale of the map ``name`` from ``span[0]`` to ``span[1]`` of its values.

        ``unit`` and ``factor`` convert the values; without a unit, strains are in um/m or %. Those of the whole test
        have units of their own.
        """
        if name.removeprefix("sigma_") in _SHOWN:
            unit, factor = shown_unit(name)
        unit = unit or _UNITS.get(name, "")
        if not unit and name not in _UNITS:
            shown = unit_for(max(abs(end) for end in span))
            unit, factor = shown.name, factor * shown.factor
        low, high = sorted(end * factor for end in span)
        return cls(float(f"{low:.9g}"), float(f"{high:.9g}"), unit, factor)

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
        middle, half = (self.low + self.high) / 2, (self.high - self.low) / 2
        return colour(np.asarray(values, np.float64) * self.factor - middle, half, alpha)


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
    known = {int(status): (status.name, status.text) for status in Status}
    found = []
    for number, count in zip(numbers.tolist(), counts.tolist(), strict=True):
        if number != Status.NOT_MEASURED:
            name, text = known.get(number, (f"status {number}", "of a later version of phasedic"))
            red, green, blue, _ = _status_table(255)[number].tolist()
            found.append(StatusCount(name, text, count, (red, green, blue)))
    return tuple(found)
