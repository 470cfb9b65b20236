"""Units of force, and of mass read as force, to newtons."""

from __future__ import annotations

from acquire.errors import ConfigError

G0 = 9.80665  # m/s^2, standard gravity

FORCES = {
    "n": 1.0,
    "newton": 1.0,
    "newtons": 1.0,
    "mn": 1e-3,
    "dan": 10.0,
    "kn": 1e3,
    "kgf": G0,
    "kp": G0,
    "gf": G0 * 1e-3,
    "lbf": 4.4482216153,
    "ozf": 4.4482216153 / 16,
    "klbf": 4448.2216153,
}
MASSES = {  # kg
    "kg": 1.0,
    "g": 1e-3,
    "mg": 1e-6,
    "t": 1e3,
    "lb": 0.45359237,
    "lbs": 0.45359237,
    "oz": 0.45359237 / 16,
}
UNITS = (*FORCES, *MASSES)
DOUBTFUL = ("mn", "mg")  # with a capital M: milli- or mega-


def _name(text: str) -> str:
    """``lb.`` is lb."""
    return text.lower().removesuffix(".")


def is_unit(text: str) -> bool:
    """Whether ``text`` names a unit of force or mass."""
    return _name(text) in UNITS


def is_mass(text: str) -> bool:
    """Whether ``text`` names a unit of mass, which is no force unless the address allows it."""
    return _name(text) in MASSES


def newtons_per(unit: str, mass_reads_force: bool = False) -> float:
    """What one of ``unit`` is in newtons.

    Parameters
    ----------
    unit : str
        Upper or lower case, but for mN and mg, whose M may be mega.
    mass_reads_force : bool
        Take a mass as the weight it has under standard gravity, 9.80665 m/s^2.

    Raises
    ------
    ConfigError
        An unknown unit, a mass without leave, or ``MN`` and ``MG``.
    """
    name = _name(unit)
    if name in DOUBTFUL and unit.startswith("M"):
        raise ConfigError(
            "{unit} may be milli or mega; compare the display, and say gain= in newtons for one of it", unit
        )
    if name in FORCES:
        return FORCES[name]
    if name not in MASSES:
        raise ConfigError("unit {unit} is not known; known: {listed}", repr(unit), ", ".join(UNITS))
    if not mass_reads_force:
        raise ConfigError(
            "{unit} is a unit of mass; say mass_reads_force=yes if the display shows the force as a mass (1 "
            "{unit} is then {MASSES:g} N)",
            unit,
            MASSES[name] * G0,
        )
    return MASSES[name] * G0
