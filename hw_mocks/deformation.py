"""Deformations with closed forms: where each reference pixel goes, and the gradient there.

``Deformation`` is all that the renderer asks for; ``Affine`` and ``Wave`` serve accuracy tests,
``SpecimenDeformation`` is that of a specimen at one instant. Displacements are px on the reference grid,
x right and y down: ``deformed(x + u, y + v) = reference(x, y)``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hw_mocks.strain_modes import Modes, StrainModes

Array = NDArray[np.float64]
Gradient = tuple[Array, Array, Array, Array]


class Deformation(Protocol):
    """A displacement field and its exact gradient."""

    def displacement(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """(u, v) in px at reference pixels (x, y), in the shape of x and y."""
        ...

    def gradient(self, x: ArrayLike, y: ArrayLike) -> Gradient:
        """(du_dx, du_dy, dv_dx, dv_dy) there."""
        ...


@dataclass(frozen=True, slots=True)
class Affine:
    """A rigid shift plus a constant gradient about (x0, y0).

    Attributes
    ----------
    u, v : float, px
        Displacement of (x0, y0).
    du_dx, du_dy, dv_dx, dv_dy : float
    x0, y0 : float, px
    """

    u: float = 0.0
    v: float = 0.0
    du_dx: float = 0.0
    du_dy: float = 0.0
    dv_dx: float = 0.0
    dv_dy: float = 0.0
    x0: float = 0.0
    y0: float = 0.0

    @classmethod
    def rotation(cls, angle_rad: float, x0: float = 0.0, y0: float = 0.0) -> Affine:
        """A rigid rotation about (x0, y0); positive turns x towards y, clockwise on the screen."""
        turn, fall = math.sin(angle_rad), math.cos(angle_rad) - 1
        return cls(0.0, 0.0, fall, -turn, turn, fall, x0, y0)

    def displacement(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """See ``Deformation``."""
        dx, dy = np.asarray(x, float) - self.x0, np.asarray(y, float) - self.y0
        u = self.u + self.du_dx * dx + self.du_dy * dy
        v = self.v + self.dv_dx * dx + self.dv_dy * dy
        return np.asarray(u), np.asarray(v)

    def gradient(self, x: ArrayLike, y: ArrayLike) -> Gradient:
        """See ``Deformation``."""
        shape = np.broadcast_shapes(np.shape(x), np.shape(y))
        a, b, c, d = (np.full(shape, g) for g in (self.du_dx, self.du_dy, self.dv_dx, self.dv_dy))
        return a, b, c, d


@dataclass(frozen=True, slots=True)
class Wave:
    """``u = amplitude sin(2 pi x / period)`` along x, nothing along y.

    Attributes
    ----------
    amplitude, period : float, px
    """

    amplitude: float
    period: float

    def displacement(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """See ``Deformation``."""
        x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
        return self.amplitude * np.sin(2 * math.pi / self.period * x), np.zeros_like(y)

    def gradient(self, x: ArrayLike, y: ArrayLike) -> Gradient:
        """See ``Deformation``."""
        x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
        k = 2 * math.pi / self.period
        nothing = np.zeros_like(y)
        return self.amplitude * k * np.cos(k * x), nothing, nothing, nothing


@dataclass(frozen=True, slots=True)
class SpecimenDeformation:
    """A specimen at one instant: its strain field, then turned about its centre and shifted.

    Attributes
    ----------
    modes : StrainModes
    axial, transverse : float
        Mean strains, of a specimen with a neck those elsewhere.
    neck : (float, float)
        What the middle of the neck has more, along and across the load.
    angle : float, rad
        Rigid rotation, clockwise on the screen.
    shift : (float, float), px
        Rigid displacement along x and y.
    """

    modes: StrainModes
    axial: float
    transverse: float
    angle: float = 0.0
    shift: tuple[float, float] = (0.0, 0.0)
    neck: tuple[float, float] = (0.0, 0.0)

    def displacement(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """See ``Deformation``."""
        return self.displaced(self.modes.at(x, y))

    def gradient(self, x: ArrayLike, y: ArrayLike) -> Gradient:
        """See ``Deformation``."""
        return self.strained(self.modes.at(x, y))

    def displaced(self, modes: Modes) -> tuple[Array, Array]:
        """(u, v) in px where ``modes`` were taken."""
        u, v, *_ = self._sums(modes)
        if self.angle:
            turn, fall = math.sin(self.angle), math.cos(self.angle) - 1
            px, py = modes.dx + u, modes.dy + v
            u, v = u + fall * px - turn * py, v + turn * px + fall * py
        return u + self.shift[0], v + self.shift[1]

    def strained(self, modes: Modes) -> Gradient:
        """(du_dx, du_dy, dv_dx, dv_dy) where ``modes`` were taken."""
        _, _, a, b, c, d = self._sums(modes)
        if not self.angle:
            return a, b, c, d
        sin, cos = math.sin(self.angle), math.cos(self.angle)
        a, d = a + 1, d + 1
        return cos * a - sin * c - 1, cos * b - sin * d, sin * a + cos * c, sin * b + cos * d - 1

    def _sums(self, modes: Modes) -> list[Array]:
        """u, v and the four gradients without rotation and shift."""
        sums = [
            self.axial * one + self.transverse * two
            for one, two in zip(modes.axial, modes.transverse, strict=True)
        ]
        for strain, mode in zip(self.neck, modes.neck or (), strict=False):
            sums = [whole + strain * part for whole, part in zip(sums, mode, strict=True)]
        return sums
