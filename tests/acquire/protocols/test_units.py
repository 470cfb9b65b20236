"""Units to newtons."""

from __future__ import annotations

import pytest

from acquire.errors import ConfigError
from acquire.protocols.units import is_mass, is_unit, newtons_per

FORCES = {
    "N": 1.0,
    "kN": 1e3,
    "mN": 1e-3,
    "kgf": 9.80665,
    "lbf": 4.4482216153,
    "lbF": 4.4482216153,
    "gf": 9.80665e-3,
}
MASSES = {"kg": 9.80665, "g": 9.80665e-3, "t": 9806.65, "lb": 4.4482216153}


@pytest.mark.parametrize(("unit", "newtons"), FORCES.items())
def test_forces(unit: str, newtons: float) -> None:
    assert newtons_per(unit) == pytest.approx(newtons, rel=1e-9)
    assert is_unit(unit) and not is_mass(unit)


@pytest.mark.parametrize(("unit", "newtons"), MASSES.items())
def test_masses_need_leave(unit: str, newtons: float) -> None:
    assert newtons_per(unit, mass_reads_force=True) == pytest.approx(newtons, rel=1e-9)
    with pytest.raises(ConfigError, match="mass_reads_force=yes"):
        newtons_per(unit)


@pytest.mark.parametrize("unit", ["", "stone", "Pa", "N m"])
def test_other_units_are_refused(unit: str) -> None:
    assert not is_unit(unit)
    with pytest.raises(ConfigError, match="not known"):
        newtons_per(unit)


@pytest.mark.parametrize("unit", ["MN", "Mn", "MG", "Mg"])
def test_mega_is_never_taken_for_milli(unit: str) -> None:
    with pytest.raises(ConfigError, match="milli or mega"):
        newtons_per(unit, mass_reads_force=True)
