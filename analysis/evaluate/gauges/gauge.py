"""What a virtual gauge is: a name and a geometry in px of the reference picture, read from a strain field.

A kind of gauge is one class (``kinds``, ``extensometers``): its parameters with their bounds, the ZOIs it takes, what
is read from them, its outline, and how it is made from the places that a person drags on a picture. Uncertainties
contain the noise of the reference and the correlation of overlapping ZOIs.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, fields
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from analysis.evaluate.gauges.geometry import Line, Mask, Point, inside_polygon
from analysis.evaluate.gauges.readings import GaugeReading, GaugeSet, GaugeValue
from analysis.field import StrainField, ZoiGrid

AUTO_GAUGES = ("extension", "width", "area")
"""The gauges of a whole specimen: holes in it are meant."""
OFF_REGION, _HOLES = 0.1, 0.5  # of the area of a gauge (of its length); holes may be meant
_SAMPLES = 100  # along the box around a gauge


@dataclass(frozen=True, slots=True)
class Parameter:
    """The kind, bounds and choices of a parameter of a gauge, in the metadata of its field.

    Attributes
    ----------
    kind : "point", "box", "corners", "length" or "choice"
        (x, y); (x, y, width, height); at least three (x, y); a number; a word. Places and lengths in px.
    words : str
        Its meaning.
    low, high : float, px
        Bounds of a length.
    choices : tuple of str
    by_axis : mapping of "x" and "y" to a word
        What it is by the axis of the load where it is not given.
    """

    kind: Literal["point", "box", "corners", "length", "choice"]
    words: str
    low: float = 0.0
    high: float = math.inf
    choices: tuple[str, ...] = ()
    by_axis: Mapping[str, str] | None = None

    @property
    def metadata(self) -> dict[str, Any]:
        """Metadata of its field."""
        return {"parameter": self}


@dataclass(frozen=True, slots=True)
class Gauge(ABC):
    """A virtual gauge; raises ValueError where its parameters are impossible.

    Attributes
    ----------
    name : str
    kind : str
        As a configuration has it.
    label, hint : str
        Of its button on a page, and what to do with the mouse.
    gesture : "click", "line" or "box"
        How it is drawn: at one place, from one place to another, or between two opposite corners.
    default_name : str
        Of a new one.
    """

    name: str
    kind: ClassVar[str]
    label: ClassVar[str]
    hint: ClassVar[str]
    gesture: ClassVar[Literal["click", "line", "box"]]
    default_name: ClassVar[str]

    @abstractmethod
    def select(self, grid: ZoiGrid) -> tuple[Mask, ...]:
        """The ZOIs that lie where the gauge is, (R, C) bool: one mask, or one for each of its two ends."""

    @property
    @abstractmethod
    def reading(self) -> GaugeReading:
        """What is read from these ZOIs."""

    @abstractmethod
    def outline(self, zoi: float) -> tuple[Line, ...]:
        """Lines to be drawn, px, with ZOIs of a side of ``zoi`` px; a closed one ends where it begins."""

    @abstractmethod
    def handles(self) -> tuple[Point, ...]:
        """The places that a person can drag, px."""

    @classmethod
    @abstractmethod
    def from_handles(cls, handles: Sequence[Point]) -> dict[str, Any]:
        """The parameters of a gauge with these handles, or drawn from the first to the second of them."""

    @classmethod
    def parameters(cls) -> dict[str, Parameter]:
        """By their names, as a configuration has them."""
        return {f.name: f.metadata["parameter"] for f in fields(cls) if "parameter" in f.metadata}

    @classmethod
    def of(cls, name: str, table: Mapping[str, Any], axis: str) -> Gauge:
        """Made of the keys of ``table`` that are its own, with what follows from the ``axis`` of the load.

        Raises
        ------
        ValueError
            One is missing or impossible.
        """
        known = cls.parameters()
        given = {key: value for key, value in table.items() if key in known and value is not None}
        by_axis = {key: one.by_axis[axis] for key, one in known.items() if one.by_axis is not None}
        needed = (f.name for f in fields(cls) if f.name in known and f.default is MISSING)
        for key in needed:
            if key not in given:
                raise ValueError(f"a gauge of kind {cls.kind!r} needs {key!r}")
        return cls(name, **(by_axis | given))

    def measure(self, field: StrainField) -> GaugeValue:
        """Its value with its standard uncertainty; of field after field, ``GaugeSet`` is faster."""
        return GaugeSet([self]).read(field)[self.name]

    def zois(self, grid: ZoiGrid) -> tuple[Mask, ...]:
        """The active ZOIs that it takes, (R, C) bool: one mask, or one for each of its two ends."""
        return tuple(mask & grid.active for mask in self.select(grid))

    def share(self, grid: ZoiGrid) -> float:
        """The share of its area that ZOIs, each its square of pixels, measure; 1 where little is off the region."""
        corners = np.array(self.outline(grid.size)[0])
        x, y = np.meshgrid(*np.linspace(corners.min(axis=0), corners.max(axis=0), _SAMPLES).T)
        inside = inside_polygon(x, y, corners)
        j, i = _over(grid.first_x, x[inside], grid.size), _over(grid.first_y, y[inside], grid.size)
        rows, columns = (_sums(np.asarray(grid.active.any(axis=axis))) for axis in (1, 0))
        both = _sums(_sums(grid.active.T).T)
        measured = both[i[1], j[1]] - both[i[0], j[1]] - both[i[1], j[0]] + both[i[0], j[0]] > 0
        on_region = (rows[i[1]] > rows[i[0]]) & (columns[j[1]] > columns[j[0]])
        off, missing = (1 - np.count_nonzero(found) / max(found.size, 1) for found in (on_region, measured))
        over_holes = missing >= _HOLES and self.name not in AUTO_GAUGES
        return 1 - missing if off >= OFF_REGION or over_holes else 1.0


def _over(first: NDArray[np.intp], places: NDArray[np.float64], size: int) -> NDArray[np.intp]:
    """Of the ZOIs with these ``first`` px along one axis, the first and one past the last over each place, (2, N)."""
    return np.searchsorted(first, (places - size, places), "right")


def _sums(values: NDArray[Any]) -> NDArray[np.intp]:
    """Of all values before each along the first axis, and of all."""
    return np.concatenate([np.zeros((1, *values.shape[1:]), np.intp), values.cumsum(axis=0, dtype=np.intp)])
