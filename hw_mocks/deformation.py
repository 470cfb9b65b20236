"""Deformations with closed forms: where each reference pixel goes, and the gradient there.

``Deformation`` is all that the renderer asks for; ``Affine`` and ``Wave`` serve accuracy tests,
``SpecimenDeformation`` is that of a specimen at one instant. Displacements are px on the reference grid,
x right and y down: ``deformed(x + u, y + v) = reference(x, y)``.

The strain fields of the virtual specimens are linear in the two mean strains. A field is ``axial * A(x, y) + transverse
* T(x, y)``; A and T are closed forms with exact gradients, so that they are computed once for the places that matter
and combined at each instant.

- uniform: homogeneous.
- hole: Kirsch's plate with a round hole in uniaxial tension, plane stress and small strain
  (Muskhelishvili's potentials). Kinematic beyond yield: the field keeps its elastic shape with the
  transverse strain of the moment, plasticity does not spread from the hole.
- woven: homogeneous plus a periodic part with over-strain where the yarns of a plain weave cross;
  its mean over a cell is the mean strain.

- halves: homogeneous in each of two halves along the load, which flow at different stresses.

Beside these a neck may grow: a band across the load whose strains, beyond those elsewhere, fall off as sech^2. The
first half is such a part too: what it has beyond the second one falls off at its edge as tanh.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Kind = Literal["uniform", "hole", "woven", "halves"]
Axis = Literal["x", "y"]
Mode = tuple[Array, Array, Array, Array, Array, Array]  # u, v, du_dx, du_dy, dv_dx, dv_dy
# The field is continued into the hole down to this part of its radius, where it stays finite.
CONTINUED = 0.75
NECK_AT = 0.2  # of the distance along the load, from the centre
SEAM_PX = 4.0  # half the width of the seam between two halves

Gradient = tuple[Array, Array, Array, Array]


@dataclass(frozen=True, slots=True, eq=False)
class Modes:
    """Both fields at given places, per unit of mean strain.

    Attributes
    ----------
    dx, dy : array, px
        Places, from the centre.
    axial, transverse : tuple of six arrays
        u and v in px, then du_dx, du_dy, dv_dx, dv_dy.
    neck : pair of the same, or None
        Per unit of strain that the middle of the neck, or the first half, has more than the rest, along and across
        the load.
    """

    dx: Array
    dy: Array
    axial: Mode
    transverse: Mode
    neck: tuple[Mode, Mode] | None = None


@dataclass(frozen=True, slots=True)
class StrainModes:
    """Which field, and where it is.

    Attributes
    ----------
    kind : "uniform" | "hole" | "woven" | "halves"
    axis : "x" | "y"
        Direction of the load.
    x0, y0 : float, px
        The point that strain leaves where it is; centre of the hole, corner of a cell.
    hole_radius : float, px
    cell : float, px
        Period of the weave along x and y.
    overstrain : float
        Highest local strain over the mean, less 1.
    neck : (float, float), px
        Its middle along the load, from (x0, y0), and its width: the argument of sech^2 is the distance over it.
        Without a width there is no neck.
    """

    kind: Kind = "uniform"
    axis: Axis = "y"
    x0: float = 0.0
    y0: float = 0.0
    hole_radius: float = 60.0
    cell: float = 96.0
    overstrain: float = 0.6
    neck: tuple[float, float] = (0.0, 0.0)

    def at(self, x: ArrayLike, y: ArrayLike) -> Modes:
        """The two fields at reference pixels (x, y), px."""
        x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
        dx, dy = x - self.x0, y - self.y0
        along, across = (dx, dy) if self.axis == "x" else (dy, dx)
        if self.kind == "hole":
            pair = _hole(along, across, self.hole_radius)
        elif self.kind == "woven":
            pair = _woven(along, across, self.cell, self.overstrain)
        else:
            zero, one = np.zeros_like(along), np.ones_like(along)
            pair = (along, zero, one, zero, zero, zero), (zero, across, zero, zero, zero, one)
        neck = _necked(along, across, *self.neck) if self.neck[1] else None
        if self.kind == "halves":
            neck = _first_half(along, across)
        if self.axis == "x":
            return Modes(dx, dy, *pair, neck)
        turned = None if neck is None else (_swapped(neck[0]), _swapped(neck[1]))
        return Modes(dx, dy, _swapped(pair[0]), _swapped(pair[1]), turned)


def _swapped(mode: Mode) -> Mode:
    along, across, aa, ac, ca, cc = mode
    return across, along, cc, ca, ac, aa


def _necked(along: Array, across: Array, middle: float, width: float) -> tuple[Mode, Mode]:
    far, zero = (along - middle) / width, np.zeros_like(along)
    share = 1 / np.cosh(np.clip(far, -300, 300)) ** 2
    moved = width * (np.tanh(far) + math.tanh(middle / width))
    narrows = -2 / width * share * np.tanh(far) * across
    return (moved, zero, share, zero, zero, zero), (zero, across * share, zero, zero, narrows, share)


def _first_half(along: Array, across: Array) -> tuple[Mode, Mode]:
    far, zero = along / SEAM_PX, np.zeros_like(along)
    share = (1 - np.tanh(far)) / 2
    moved = (along - SEAM_PX * (np.logaddexp(far, -far) - math.log(2))) / 2
    narrows = -across / (2 * SEAM_PX) / np.cosh(np.clip(far, -300, 300)) ** 2
    return (moved, zero, share, zero, zero, zero), (zero, across * share, zero, zero, narrows, share)


def _woven(along: Array, across: Array, cell: float, over: float) -> tuple[Mode, Mode]:
    k = 2 * math.pi / cell
    sa, ca, sc, cc = np.sin(k * along), np.cos(k * along), np.sin(k * across), np.cos(k * across)
    zero = np.zeros_like(along)
    stretch, shear = 1 + over * ca * cc, -over * sa * sc
    axial = (along + over / k * sa * cc, zero, stretch, shear, zero, zero)
    transverse = (zero, across + over / k * ca * sc, zero, zero, shear, stretch)
    return axial, transverse


def _hole(along: Array, across: Array, radius: float) -> tuple[Mode, Mode]:
    """Kirsch: 2 G (u + i v) = kappa phi - z conj(phi') - conj(psi), load along the real axis.

    phi = S/4 (z + 2 a^2/z), psi = -S/2 (z + a^2/z - a^4/z^3), kappa = (3 - nu)/(1 + nu); with
    S = E axial and nu = -transverse/axial both sides are linear in the two strains.
    Muskhelishvili, Some Basic Problems of the Mathematical Theory of Elasticity, section 56a.
    """
    z: Complex = along + 1j * across
    zc = z.conj()
    (p, p_z, p_zc), (b, b_z, b_zc), (c, c_z, c_zc) = _around_hole(z, radius)
    phi, phi_z, phi_zc = z / 4 + p / 2, 0.25 + p_z / 2, p_zc / 2
    rest = z / 4 - zc / 2 - (b + p.conj() - c) / 2
    rest_z = 0.25 - (b_z + p_zc.conj() - c_z) / 2
    rest_zc = -0.5 - (b_zc + p_z.conj() - c_zc) / 2
    axial = _from_complex(3 * phi - rest, 3 * phi_z - rest_z, 3 * phi_zc - rest_zc)
    transverse = _from_complex(phi + rest, phi_z + rest_z, phi_zc + rest_zc)
    return axial, transverse


def _around_hole(z: Complex, a: float) -> tuple[tuple[Complex, Complex, Complex], ...]:
    """a^2/z, a^2 z/conj(z)^2 and a^4/conj(z)^3, each with its derivatives by z and by conj(z).

    Within CONTINUED of the radius, powers of |z| are held at their value there: polynomials that
    join continuously.
    """
    limit = CONTINUED * a
    out = np.abs(z) >= limit
    w: Complex = np.where(out, z, limit)  # never zero
    wc, zc, none = w.conj(), z.conj(), np.zeros_like(z)
    a2, near2 = a**2, (a / limit) ** 2
    p = np.where(out, a2 / w, near2 * zc), np.where(out, -a2 / w**2, none), np.where(out, none, near2)
    inner = 3 * near2 * z**2 / limit**2
    b = (
        np.where(out, a2 * w / wc**2, inner * z / 3),
        np.where(out, a2 / wc**2, inner),
        np.where(out, -2 * a2 * w / wc**3, none),
    )
    c = (
        np.where(out, a2**2 / wc**3, near2 * inner * z / 3),
        np.where(out, none, near2 * inner),
        np.where(out, -3 * a2**2 / wc**4, none),
    )
    return p, b, c


def _from_complex(d: Complex, d_z: Complex, d_zc: Complex) -> Mode:
    """u + i v and its derivatives by z and by its conjugate, as six real fields."""
    d_along, d_across = d_z + d_zc, 1j * (d_z - d_zc)
    return d.real, d.imag, d_along.real, d_across.real, d_along.imag, d_across.imag


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
