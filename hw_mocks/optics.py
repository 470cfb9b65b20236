"""What a lens and the grips make of a flat specimen: pinhole, distortion, motion off the plane, plates, shutter.

A place of the specimen deforms in its plane, moves with the plane (tilt about the middle of the picture, then motion
along the optical axis), is projected from the stand-off, and is displaced radially by the lens. All has a closed
form, so that the renderer draws each speckle where it is seen. Lengths are px of the undeformed specimen at the
stand-off.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from acquire.addresses import Options
from acquire.errors import ConfigError
from acquire.settings import number, take_settings
from hw_mocks.deformation import Deformation, Gradient, SpecimenDeformation
from hw_mocks.sim_settings import ViewSettings
from hw_mocks.specimen import VirtualSpecimen

Array = NDArray[np.float64]
Box = tuple[float, float, float, float]
_ROUNDS = 4  # of the time at which a line is exposed: the motion in a readout is small against the picture


@dataclass(frozen=True, slots=True)
class PlaneMotion:
    """Motion of a plane out of itself.

    Attributes
    ----------
    towards_mm : float, mm
        Along the optical axis, towards the camera.
    tilt_x, tilt_y : float, rad
        About the horizontal and the vertical axis of the picture; positive brings the lower and the right half
        towards the camera.
    """

    towards_mm: float = 0.0
    tilt_x: float = 0.0
    tilt_y: float = 0.0

    def plus(self, other: PlaneMotion, share: float) -> PlaneMotion:
        """This and a share of another."""
        return PlaneMotion(
            self.towards_mm + share * other.towards_mm,
            self.tilt_x + share * other.tilt_x,
            self.tilt_y + share * other.tilt_y,
        )


@dataclass(frozen=True, slots=True)
class Optics:
    """The camera's view.

    Attributes
    ----------
    stand_off_mm : float, mm
        From the pinhole to the specimen; infinite: telecentric.
    distortion : float
        Radial displacement at the corner of the picture over its distance from the middle.
    still : PlaneMotion
        Of the reference: a camera that is not square to the specimen.
    settling : PlaneMotion
        Reached at the largest load, and proportional to the load before.
    plates : tuple of (x, y, width, height), px
        Hung from one grip: they move with the plane and are not loaded.
    plate_strain : float
        Strain of the plates over that of the specimen: a plate that is clamped at both ends by mistake.
    readout_s : float, s
        From the first line of the picture to the last; a frame is stamped at its middle line.
    behind : bool
        The camera looks at the back.
    bending : float
        Strain of the front over the mean of both sides, less 1; the back has as much less.
    flicker, lamp_Hz : float, Hz
        Amplitude of the light over its mean, as the exposure leaves it, and its frequency.
    """

    stand_off_mm: float = math.inf
    distortion: float = 0.0
    still: PlaneMotion = field(default_factory=PlaneMotion)
    settling: PlaneMotion = field(default_factory=PlaneMotion)
    plates: tuple[Box, ...] = ()
    plate_strain: float = 0.0
    readout_s: float = 0.0
    behind: bool = False
    bending: float = 0.0
    flicker: float = 0.0
    lamp_Hz: float = 100.0

    def light(self, t: float, height: int) -> Array:
        """The light on each line of a picture stamped ``t`` (s), (H, 1), over its mean."""
        when = t + self.readout_s * (np.arange(height)[:, None] / max(height - 1, 1) - 0.5)
        return np.asarray(1 + self.flicker * np.cos(2 * math.pi * self.lamp_Hz * when))

    @property
    def plain(self) -> bool:
        """Whether the picture is that of the specimen as it is."""
        return self == Optics(self.stand_off_mm)

    def seen(self, specimen: VirtualSpecimen, t: float) -> Deformation:
        """From the undeformed specimen to the picture stamped ``t`` (s)."""
        if self.readout_s == 0:
            return self._at(specimen, t)
        return RolledShutter(lambda at: self._at(specimen, at), t, self.readout_s, specimen.height)

    def _at(self, specimen: VirtualSpecimen, t: float) -> Deformation:
        most = float(specimen.force(specimen.duration_s))
        share = float(specimen.force(t)) / most if most > 0 else 0.0
        motion, flat = self.still.plus(self.settling, share), specimen.at(t)
        if self.bending:
            side = 1 - self.bending if self.behind else 1 + self.bending
            flat = replace(flat, axial=side * flat.axial, transverse=side * flat.transverse)
        if self.behind:
            motion = PlaneMotion(-motion.towards_mm, -motion.tilt_x, motion.tilt_y)
            flat = replace(flat, angle=-flat.angle, shift=(-flat.shift[0], flat.shift[1]))
        middle = ((specimen.width - 1) / 2, (specimen.height - 1) / 2)
        lens = Lens.of(self, motion, middle, specimen.px_per_m * 1e-3)
        return Seen(WithPlates(flat, self.plates, self.plate_strain) if self.plates else flat, lens)


@dataclass(frozen=True, slots=True)
class WithPlates:
    """A specimen between plates that take a share of its strain and all of its rigid motion."""

    specimen: SpecimenDeformation
    plates: tuple[Box, ...]
    share: float

    def displacement(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """See ``Deformation``."""
        u, v = self._chosen(x, y, "displacement")
        return u, v

    def gradient(self, x: ArrayLike, y: ArrayLike) -> Gradient:
        """See ``Deformation``."""
        a, b, c, d = self._chosen(x, y, "gradient")
        return a, b, c, d

    def _chosen(self, x: ArrayLike, y: ArrayLike, what: str) -> list[Array]:
        x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
        on_plate = np.zeros(x.shape, bool)
        for left, top, width, height in self.plates:
            on_plate |= (x >= left) & (x < left + width) & (y >= top) & (y < top + height)
        one = self.specimen
        plate = replace(one, axial=self.share * one.axial, transverse=self.share * one.transverse)
        pairs = zip(getattr(plate, what)(x, y), getattr(one, what)(x, y), strict=True)
        return [np.where(on_plate, rigid, strained) for rigid, strained in pairs]


@dataclass(frozen=True, slots=True)
class Lens:
    """From places in the plane to places in the picture.

    Attributes
    ----------
    x0, y0 : float, px
        Middle of the picture: the optical axis, and the point about which the plane tilts.
    matrix : (3, 3) float64
        x and y about the middle, scaled up by what is nearer: rows of the homography.
    bulge : float, 1/px^2
        A place at the radius r is displaced by ``bulge r^3`` outwards.
    """

    x0: float
    y0: float
    matrix: Array
    bulge: float

    @classmethod
    def of(cls, optics: Optics, motion: PlaneMotion, middle: tuple[float, float], px_per_mm: float) -> Lens:
        """The lens of ``optics`` on a plane after ``motion``."""
        (sx, cx), (sy, cy) = ((math.sin(a), math.cos(a)) for a in (motion.tilt_x, motion.tilt_y))
        # A place (x, y, 0) turned about the horizontal axis, then about the vertical one; the third row is its
        # distance over the stand-off.
        away = optics.stand_off_mm * px_per_mm
        matrix = np.array(
            [
                [cy, -sy * sx, 0.0],
                [0.0, cx, 0.0],
                [-sy / away, -cy * sx / away, 1 - motion.towards_mm / optics.stand_off_mm],
            ]
        )
        corner = math.hypot(*middle)
        return cls(*middle, matrix, optics.distortion / corner**2)

    def project(self, x: Array, y: Array) -> tuple[Array, Array, Gradient]:
        """Where places (px) are seen, and the derivatives of that by x and by y."""
        x, y, m = x - self.x0, y - self.y0, self.matrix
        depth = m[2, 0] * x + m[2, 1] * y + m[2, 2]
        px, py = (m[0, 0] * x + m[0, 1] * y) / depth, (m[1, 0] * x + m[1, 1] * y) / depth
        xx, xy = (m[0, 0] - px * m[2, 0]) / depth, (m[0, 1] - px * m[2, 1]) / depth
        yx, yy = (m[1, 0] - py * m[2, 0]) / depth, (m[1, 1] - py * m[2, 1]) / depth
        radial = 1 + self.bulge * (px**2 + py**2)
        dxx, dyy = radial + 2 * self.bulge * px**2, radial + 2 * self.bulge * py**2
        dxy = 2 * self.bulge * px * py
        gradient = dxx * xx + dxy * yx, dxx * xy + dxy * yy, dxy * xx + dyy * yx, dxy * xy + dyy * yy
        return self.x0 + radial * px, self.y0 + radial * py, gradient


@dataclass(frozen=True, slots=True)
class Seen:
    """A deformation in the plane as a lens shows it."""

    flat: Deformation
    lens: Lens

    def displacement(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """See ``Deformation``."""
        x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
        u, v = self.flat.displacement(x, y)
        seen_x, seen_y, _ = self.lens.project(x + u, y + v)
        return seen_x - x, seen_y - y

    def gradient(self, x: ArrayLike, y: ArrayLike) -> Gradient:
        """See ``Deformation``."""
        x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
        u, v = self.flat.displacement(x, y)
        a, b, c, d = self.flat.gradient(x, y)
        _, _, (xx, xy, yx, yy) = self.lens.project(x + u, y + v)
        a, d = 1 + a, 1 + d
        return xx * a + xy * c - 1, xx * b + xy * d, yx * a + yy * c, yx * b + yy * d - 1


@dataclass(frozen=True, slots=True)
class RolledShutter:
    """A picture that is read line by line: line y shows the instant ``t + readout (y / (height - 1) - 1/2)``.

    The motion within one readout is a polynomial of the second degree through its begin, middle and end.
    """

    at: Callable[[float], Deformation]
    t: float
    readout_s: float
    height: int

    def displacement(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """See ``Deformation``."""
        u, v, _ = self._exposed(x, y)
        return u, v

    def gradient(self, x: ArrayLike, y: ArrayLike) -> Gradient:
        """See ``Deformation``."""
        _, _, s = self._exposed(x, y)
        a, b, c, d = (_between(values, s) for values in self._three("gradient", x, y))
        du, dv = (_between(values, s, slope=True) for values in self._three("displacement", x, y))
        late = 1 / (1 - dv / (self.height - 1))  # of a place that moves with the readout
        c, d = c * late, (1 + d) * late - 1
        along = du / (self.height - 1)
        return a + along * c, b + along * (1 + d), c, d

    def _three(self, what: str, x: ArrayLike, y: ArrayLike) -> list[tuple[Any, ...]]:
        instants = (self.t - self.readout_s / 2, self.t, self.t + self.readout_s / 2)
        return list(zip(*(getattr(self.at(t), what)(x, y) for t in instants), strict=True))

    def _exposed(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array, Array]:
        """(u, v) of places when their line is read, and the part of the readout before or after its middle."""
        us, vs = self._three("displacement", x, y)
        s = np.zeros(np.broadcast_shapes(np.shape(x), np.shape(y)))
        for _ in range(_ROUNDS):
            s = (np.asarray(y) + _between(vs, s)) / (self.height - 1) - 0.5
        return _between(us, s), _between(vs, s), s


def _between(values: tuple[Any, ...], s: Array, *, slope: bool = False) -> Array:
    """The parabola through values at -1/2, 0 and 1/2, or its slope, at ``s``."""
    first, middle, last = values
    linear, square = last - first, 2 * (first + last - 2 * middle)
    return np.asarray(linear + 2 * square * s if slope else middle + linear * s + square * s**2)


def take_optics(options: Options) -> Optics:
    """Take the keys of the view out of an address's settings.

    Raises
    ------
    ConfigError
        An impossible value.
    """
    given = take_settings(ViewSettings, options)
    stand_off = math.inf if given.stand_off_mm is None else given.stand_off_mm
    return Optics(
        stand_off_mm=stand_off,
        distortion=given.distortion / 100,
        still=PlaneMotion(0.0, math.radians(given.tilt_x_deg), math.radians(given.tilt_y_deg)),
        settling=PlaneMotion(
            options.again("settle_mm", 0.0, number(-0.5 * stand_off, 0.5 * stand_off)),
            math.radians(given.settle_x_deg),
            math.radians(given.settle_y_deg),
        ),
        plates=_plates(options, given.plates),
        plate_strain=given.plate_strain,
        readout_s=given.readout_ms * 1e-3,
        flicker=given.flicker / 100,
        lamp_Hz=given.lamp_hz,
        behind=given.side == "back",
        bending=given.bending / 100,
    )


def _plates(options: Options, text: str) -> tuple[Box, ...]:
    """``x,y,width,height`` of each plate, px, with a semicolon between two."""
    try:
        found = [tuple(float(side) for side in plate.split(",")) for plate in text.split(";") if plate]
    except ValueError:
        found = [()]
    if not all(len(plate) == 4 and plate[2] > 0 and plate[3] > 0 for plate in found):
        raise ConfigError(
            "{address}: plates={given} is not possible; allowed: x,y,width,height in px, with a semicolon between two"
            " plates",
            options.address.text,
            text,
        )
    return tuple((plate[0], plate[1], plate[2], plate[3]) for plate in found)
