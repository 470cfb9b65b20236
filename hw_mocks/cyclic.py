"""Cycles between two forces, while the specimen loses stiffness: ``sim:?programme=cyclic&hz=2&r=0.1&n=50&fall=0.1``.

At rest, to the lowest force, n cycles of 1 - cos between the lowest and the highest, at rest at the lowest. The forces
stay the same; from cycle to cycle the stiffness falls, in equal steps, from all of it in the first to 1 - ``fall`` in
the last. The strain follows at once: the loop has no area.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from acquire.addresses import Address
from acquire.errors import ConfigError
from hw_mocks.machine import Array, FlowCurve, Programme
from hw_mocks.sim_settings import CyclicSettings


@dataclass(frozen=True, slots=True)
class Cyclic(Programme):
    """See the module; ``ramp_s`` is the time of all cycles, ``max_strain`` the highest strain of the first.

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
