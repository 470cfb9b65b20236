"""The metal of the virtual specimen: elastic, then plastic with Voce and linear hardening.

Uniaxial and rate independent. Nothing here unloads: the programme only ever pulls.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
PLASTIC_NU = 0.5  # plastic flow keeps the volume
NEWTON_STEPS = 20


@dataclass(frozen=True, slots=True)
class Material:
    """Flow stress ``yield_stress + voce (1 - exp(-voce_rate ep)) + hardening ep`` over plastic strain ep.

    Attributes
    ----------
    E : float, Pa
    nu : float
        Elastic Poisson's ratio; that of the plastic part is 0.5.
    yield_stress : float, Pa
    voce : float, Pa
        Rise of the flow stress at saturation; 0 leaves linear hardening alone.
    voce_rate : float
        How fast it saturates, per unit of plastic strain.
    hardening : float, Pa
        Linear hardening modulus.
    """

    E: float = 70e9
    nu: float = 0.33
    yield_stress: float = 140e6
    voce: float = 60e6
    voce_rate: float = 300.0
    hardening: float = 1e9

    @property
    def yield_strain(self) -> float:
        """Axial strain where plastic flow begins."""
        return self.yield_stress / self.E

    def plastic_strain(self, strain: ArrayLike) -> Array:
        """Plastic part of an axial strain >= 0, by Newton's rule.

        The balance of flow stress and E (strain - ep) is concave and rising in ep, so that Newton
        from ep = 0 approaches from one side and cannot overshoot.
        """
        total = np.asarray(strain, float)
        ep = np.zeros_like(total)
        for _ in range(NEWTON_STEPS):
            decay = np.exp(-self.voce_rate * ep)
            flow = self.yield_stress + self.voce * (1 - decay) + self.hardening * ep
            slope = self.voce * self.voce_rate * decay + self.hardening + self.E
            ep = np.maximum(ep - (flow - self.E * (total - ep)) / slope, 0.0)
        return ep

    def stress(self, strain: ArrayLike) -> Array:
        """Axial stress, Pa, at an axial strain >= 0."""
        return np.asarray(self.E * (np.asarray(strain, float) - self.plastic_strain(strain)))

    def transverse(self, strain: ArrayLike) -> Array:
        """Transverse strain at an axial strain >= 0."""
        plastic = self.plastic_strain(strain)
        return np.asarray(-self.nu * (np.asarray(strain, float) - plastic) - PLASTIC_NU * plastic)
