"""One virtual specimen behind both devices: what the camera takes and what the load cell measures.

Every quantity is a pure function of the time since the start of the test (the programme holds,
pulls to yield, pulls on, holds; or ``Cyclic``). It is the truth that measurements are compared with:
``specimen.at(t)`` has the displacement and its gradient, ``force(t)`` the load. The strain is the
displacement gradient (engineering strain along the load), about the middle of the image.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from acquire.addresses import Address, Options
from acquire.errors import ConfigError
from acquire.settings import take_settings
from acquire.text import meant
from hw_mocks.deformation import NECK_AT, Axis, Gradient, Kind, SpecimenDeformation, StrainModes
from hw_mocks.machine import FlowCurve, Machine, PowerLaw, Programme, Pull, TestClock
from hw_mocks.sim_settings import CyclicSettings, SpecimenSettings

Array = NDArray[np.float64]
KINDS: tuple[Kind, ...] = ("uniform", "hole", "woven", "halves")


@dataclass(frozen=True, slots=True)
class Cyclic(Programme):
    """Cycles between two forces: ``sim:?programme=cyclic&hz=2&r=0.1&n=50&fall=0.1``.

    At rest, to the lowest force, n cycles of 1 - cos between the lowest and the highest, at rest at the lowest. The
    forces stay the same; from cycle to cycle the stiffness falls, in equal steps, from all of it in the first to
    1 - ``fall`` in the last. The strain follows at once: the loop has no area. ``ramp_s`` is the time of all cycles,
    ``max_strain`` the highest strain of the first.

    Attributes
    ----------
    n : int
        Cycles.
    ratio : float
        Lowest over highest force.
    fall : float
        Share of the stiffness that is lost from the first to the last cycle.
    """

    n: int = 10
    ratio: float = 0.1
    fall: float = 0.0

    def strain(self, t: ArrayLike) -> Array:
        """Axial strain at ``t`` seconds since the start."""
        cycles = self.cycles(t)
        wave = self.ratio + (1 - self.ratio) * (1 - np.cos(2 * np.pi * np.clip(cycles, 0, self.n))) / 2
        approach = np.clip(1 + cycles / min(0.5, self.hold_s * self.n / self.ramp_s / 2), 0, 1)
        return np.asarray(self.max_strain * wave * approach / self.stiffness(t))

    def cycles(self, t: ArrayLike) -> Array:
        """How many are done at ``t``; negative before the first."""
        return np.asarray((np.asarray(t, float) - self.hold_s) * self.n / self.ramp_s)

    def stiffness(self, t: ArrayLike) -> Array:
        """Share of the first stiffness that is left."""
        done = np.clip(np.floor(self.cycles(t)), 0, self.n - 1)
        return np.asarray(1 - self.fall * done / max(self.n - 1, 1))


def take_cyclic(address: Address, given: CyclicSettings, material: FlowCurve) -> Cyclic:
    """The programme of an address; raises ConfigError for a highest strain beyond yield."""
    hz, n, top, fall = given.hz, int(given.n), given.max_strain, given.fall
    if top / (1 - fall) > material.yield_strain:
        raise ConfigError(
            "{text}: a cyclic test is elastic here; give max_strain below {strain:.3g}, or yield_MPa",
            address.text,
            material.yield_strain * (1 - fall),
        )
    end = max(1 / hz if given.end is None else given.end, given.seconds - given.hold - n / hz)
    return Cyclic(given.hold, n / hz, end, top / 2, top, n=n, ratio=given.r, fall=fall)


@dataclass(frozen=True, slots=True, eq=False)
class VirtualSpecimen:
    """A tensile specimen and its test.

    Attributes
    ----------
    kind : "uniform" | "hole" | "woven" | "halves"
        See ``hw_mocks.deformation``.
    width, height : int, px
        The field of view.
    material : FlowCurve or PowerLaw
    programme : Programme
    axis : "y" | "x"
        Direction of the load in the image.
    area_m2 : float, m^2
        Cross-section (gross, for the hole).
    px_per_m : float, px/m
        Scale of the image.
    hole_radius_px, cell_px : float, px
        Of the hole, and period of the weave.
    overstrain : float
        Of the weave: highest local strain over the mean, less 1.
    neck_px : float, px
        Width of a neck (``StrainModes.neck``) that grows from the highest force on, while the rest rests; 0: none.
        The strain of the programme, and the stress, are then those of its middle.
    second : FlowCurve or None
        Of the second of two halves, where y (x) is larger; ``material`` is that of the first, whose strain is that of
        the programme. Both have one stress.
    drift_px : (float, float), px
        Rigid displacement along x and y reached at the end of the ramp.
    rotation_rad : float, rad
        Rigid rotation reached there, clockwise on the screen.
    nominal : bool
        The test runs on nominal time from 0 (lock step) instead of the machine's clock.
    clock : TestClock
        When the test began; the one thing here that changes.
    """

    kind: Kind = "uniform"
    width: int = 640
    height: int = 512
    material: FlowCurve | PowerLaw = field(default_factory=FlowCurve)
    programme: Programme = field(default_factory=Programme)
    axis: Axis = "y"
    area_m2: float = 40e-6
    px_per_m: float = 20e3
    hole_radius_px: float = 60.0
    cell_px: float = 96.0
    overstrain: float = 0.6
    neck_px: float = 0.0
    second: FlowCurve | None = None
    drift_px: tuple[float, float] = (0.0, 0.0)
    rotation_rad: float = 0.0
    nominal: bool = False
    clock: TestClock = field(default_factory=TestClock)

    @property
    def E(self) -> float:
        """Young's modulus, Pa."""
        return self.material.E

    @property
    def nu(self) -> float:
        """Elastic Poisson's ratio."""
        return self.material.nu

    @property
    def duration_s(self) -> float:
        """Length of the test, s."""
        return self.programme.duration_s

    @property
    def yield_s(self) -> float:
        """Time since the start at which plastic flow begins, s; infinite where it never does."""
        p, wanted = self.programme, self.material.yield_strain
        if wanted > p.max_strain:
            return math.inf
        return float(np.interp(wanted, (0.0, p.knee_strain, p.max_strain), p.knots_s))

    @property
    def modes(self) -> StrainModes:
        """The strain field per unit of mean strain."""
        middle = ((self.width - 1) / 2, (self.height - 1) / 2)
        neck = NECK_AT * (self.width if self.axis == "x" else self.height), self.neck_px
        return StrainModes(
            self.kind, self.axis, *middle, self.hole_radius_px, self.cell_px, self.overstrain, neck
        )

    def elapsed(self, now: float) -> float:
        """Seconds since the start at ``now`` on the clock of whoever began the test."""
        return self.clock.elapsed(now)

    def axial_strain(self, t: ArrayLike) -> Array:
        """Mean strain along the load, ``t`` seconds since the start.

        For the hole: remote; with a neck: beside it; of two halves: of the second.
        """
        strain = self.programme.strain(t)
        if self.second is not None:
            return self.second.strain_at(self.material.stress(strain))
        if self.neck_px and isinstance(self.material, PowerLaw):
            return np.minimum(strain, self.material.uniform_strain)
        return strain

    def transverse_strain(self, t: ArrayLike) -> Array:
        """Mean strain across the load (for the hole: remote; of the second half)."""
        return (self.second or self.material).transverse(self.axial_strain(t))

    def neck_strains(self, t: float) -> tuple[float, float]:
        """Strains along and across the load in the middle of the neck, or in the first half."""
        strain = self.programme.strain(t)
        return float(strain), float(self.material.transverse(strain))

    def stress(self, t: ArrayLike) -> Array:
        """Mean stress, Pa (for the hole: gross and remote)."""
        return np.asarray(self.material.stress(self.programme.strain(t)) * self.programme.stiffness(t))

    def force(self, t: ArrayLike) -> Array:
        """Load on the specimen, N, tension positive."""
        return np.asarray(self.area_m2 * self.stress(t))

    def at(self, t: float) -> SpecimenDeformation:
        """The deformation ``t`` seconds since the start."""
        progress = float(self.programme.progress(t))
        shift = (progress * self.drift_px[0], progress * self.drift_px[1])
        axial, transverse = float(self.axial_strain(t)), float(self.transverse_strain(t))
        apart = self.neck_px or self.second is not None
        neck = self.neck_strains(t) if apart else (axial, transverse)
        beyond = neck[0] - axial, neck[1] - transverse
        return SpecimenDeformation(self.modes, axial, transverse, progress * self.rotation_rad, shift, beyond)

    def displacement(self, x: ArrayLike, y: ArrayLike, t: float) -> tuple[Array, Array]:
        """Where reference pixels (x, y) have gone: (u, v) in px."""
        return self.at(t).displacement(x, y)

    def gradient(self, x: ArrayLike, y: ArrayLike, t: float) -> Gradient:
        """(du_dx, du_dy, dv_dx, dv_dy) at reference pixels (x, y)."""
        return self.at(t).gradient(x, y)

    def close(self) -> None:
        """Let go the port of the machine, where it is driven from outside."""
        if self.programme.machine is not None:
            self.programme.machine.close()

    def mask(self) -> NDArray[np.bool_]:
        """(H, W) bool: where there is material in the reference image.

        Outside of it the displacement means nothing (it is continued smoothly into the hole).
        """
        if self.kind != "hole":
            return np.ones((self.height, self.width), bool)
        y, x = np.mgrid[: self.height, : self.width]
        modes = self.modes
        return np.asarray(np.hypot(x - modes.x0, y - modes.y0) > self.hole_radius_px)


def specimen_from(address: Address) -> VirtualSpecimen:
    """The specimen that a ``sim:`` address describes.

    Keys for devices are left to ``open_sim_camera`` and ``open_sim_load``, which refuse what
    nobody knows.

    Raises
    ------
    ConfigError
        An unknown kind or an impossible value.
    """
    specimen = take_specimen(Options(address))
    if specimen.programme.machine is not None:
        specimen.programme.machine.listen()
    return specimen


def take_specimen(options: Options) -> VirtualSpecimen:
    """Take the keys of the specimen out of an address's settings; raises as ``specimen_from``."""
    kind, address = _kind(options.address), options.address
    cyclic = ("programme", "cyclic") in address.settings
    given = take_settings(CyclicSettings if cyclic else SpecimenSettings, options)
    if cyclic and kind == "halves":
        raise ConfigError("{text}: halves are pulled, programme=cyclic is for the others", address.text)
    material = _material(given, 120.0 if kind == "halves" else 140.0)
    clock = TestClock()
    return VirtualSpecimen(
        kind=kind,
        width=given.width,
        height=given.height,
        material=material,
        programme=take_cyclic(address, given, material)
        if isinstance(given, CyclicSettings) and isinstance(material, FlowCurve)
        else _programme(address, given, material, clock),
        axis="x" if given.axis == "x" else "y",
        area_m2=given.section_mm2 * 1e-6,
        px_per_m=given.px_per_mm * 1e3,
        hole_radius_px=given.hole,
        cell_px=given.cell,
        overstrain=given.overstrain,
        neck_px=_checked_neck(address, given.neck, kind, material),
        second=_second(address, given.yield2_MPa, kind, material),
        drift_px=(given.drift_x, given.drift_y),
        rotation_rad=math.radians(given.rotation_deg),
        nominal=given.lockstep,
        clock=clock,
    )


def _kind(address: Address) -> Kind:
    wanted = address.target or "uniform"
    for kind in KINDS:
        if kind == wanted:
            return kind
    raise ConfigError(
        "{text}: there is no simulated specimen {wanted}{meant}; known: {listed}",
        address.text,
        repr(wanted),
        meant(wanted, KINDS),
        ", ".join(KINDS),
    )


def _checked_neck(address: Address, width: float, kind: Kind, material: FlowCurve | PowerLaw) -> float:
    if width and (kind != "uniform" or not isinstance(material, PowerLaw)):
        raise ConfigError("{text}: a neck needs sim:uniform of a sheet metal; give n or r", address.text)
    return width


def _second(
    address: Address, strength: float | None, kind: Kind, material: FlowCurve | PowerLaw
) -> FlowCurve | None:
    if kind != "halves" and strength is None:
        return None
    if kind != "halves" or not isinstance(material, FlowCurve):
        raise ConfigError("{text}: yield2_MPa is of sim:halves, which have no n or r", address.text)
    return replace(material, yield_stress=(160.0 if strength is None else strength) * 1e6)


def _material(given: SpecimenSettings, yield_MPa: float) -> FlowCurve | PowerLaw:
    """Sheet metal of given n and r, where one of them is given and they are not of the programme."""
    modulus, nu = given.E_GPa * 1e9, given.nu
    strength = (yield_MPa if given.yield_MPa is None else given.yield_MPa) * 1e6
    if given.programme == "cyclic" or (given.n is None and given.r is None):
        return FlowCurve(E=modulus, nu=nu, yield_stress=strength)
    n, r = 0.2 if given.n is None else given.n, 1.0 if given.r is None else given.r
    return PowerLaw(n, r, modulus, nu, strength)


def _programme(
    address: Address, given: SpecimenSettings, material: FlowCurve | PowerLaw, clock: TestClock
) -> Programme:
    seconds, top = given.seconds, given.max_strain
    # A short test keeps its parts in proportion unless they are given.
    hold = min(2.0, 0.1 * seconds) if given.hold is None else given.hold
    end = min(1.0, 0.05 * seconds) if given.end is None else given.end
    if hold + end >= seconds:
        raise ConfigError(
            "{text}: hold and end leave no time to pull; give seconds above {hold:g}",
            address.text,
            hold + end,
        )
    plastic = top > material.yield_strain
    knee_strain, knee = (material.yield_strain, 0.6) if plastic else (top / 2, 0.5)
    port = given.machine
    machine = None if port is None else Machine(port, material.yield_strain, clock.elapsed)
    return Programme(
        hold, seconds - hold - end, end, knee_strain, top, knee, machine, Pull() if given.waits else None
    )
