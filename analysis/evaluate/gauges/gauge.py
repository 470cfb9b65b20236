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

from analysis.evaluate.gauges.geometry import Line, Mask, Point
from analysis.evaluate.gauges.readings import GaugeReading, GaugeSet, GaugeValue
from analysis.field import StrainField, ZoiGrid


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
