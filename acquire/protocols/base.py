"""What a protocol is: a description, a parser, the bytes of its commands; protocols by name; units of force."""

from __future__ import annotations

import importlib
import tomllib
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

from acquire.addresses import Options
from acquire.errors import ConfigError
from acquire.load_sample import LoadFlag
from acquire.settings import take_settings

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

Mode = Literal["listen", "stream", "poll"]
Parity = Literal["N", "E", "O"]

# Imported when used; each module has a PROTOCOL.
PROTOCOLS: Mapping[str, str] = {
    "ascii": "acquire.protocols.ascii",
    "mt-sics": "acquire.protocols.mt_sics",
    "aed-standard": "acquire.protocols.aed_standard",
    "mark10": "acquire.protocols.mark10",
    "sauter": "acquire.protocols.sauter",
    "hbm-aed": "acquire.protocols.hbm_aed",
    "modbus": "acquire.protocols.modbus",
    "lines": "acquire.protocols.lines",
}


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


@dataclass(frozen=True, slots=True)
class Reading:
    """One message of a device, as it stood on the line.

    Attributes
    ----------
    value : float
        In ``unit``, with the sign of the line; NaN where there is no valid value.
    unit : str or None
        None where the line names none.
    stable : bool or None
        None where the line has no such mark.
    flags : LoadFlag
    raw : bytes
        Without the line end.
    start : int
        Number of the first byte of the message, counted from the first byte ever fed.
    device_ms : float or None, ms
    """

    value: float
    unit: str | None
    raw: bytes
    start: int
    stable: bool | None = None
    flags: LoadFlag = LoadFlag.NONE
    device_ms: float | None = None


class Parser(ABC):
    """Turns bytes, in any chunking, into readings. Never raises, whatever the bytes.

    Only complete messages that match the whole grammar give values; a complete message that
    does not is a reading with flag ERROR and value NaN, so that its bytes are kept.

    Attributes
    ----------
    commands : mapping of str to bytes
        Added to those of the protocol, where they depend on settings.
    """

    commands: Mapping[str, bytes] = MappingProxyType({})

    @abstractmethod
    def feed(self, data: bytes) -> list[Reading]:
        """Take the next bytes; the readings that they complete."""

    def silence(self) -> list[Reading]:
        """Told that nothing came for a while: where no byte ends a message, silence does."""
        return []

    @abstractmethod
    def restart(self, lost: int = 0) -> None:
        """The connection was interrupted: what is half received will never be completed.

        ``lost`` bytes of it were never fed; they count for ``Reading.start``.
        """


@dataclass(frozen=True, slots=True)
class ParserSettings(ABC):
    """The settings of a protocol in an address, declared by ``acquire.settings``, and the parser that they make."""

    @abstractmethod
    def parser(self, address: str) -> Parser:
        """Their parser; raises ConfigError, which names ``address``, where they do not fit each other."""


@dataclass(frozen=True, slots=True)
class Protocol:
    """A protocol's description.

    Attributes
    ----------
    name, summary : str
    settings : type of ParserSettings
    baud, bytesize, parity : line settings where the address has none
    mode : "listen" | "stream" | "poll"
        Listen: the device sends by itself. Stream: it does after the command ``start``.
        Poll: each reading is asked for with ``poll``.
    sign : int
        With which tension is positive.
    unit_on_line : bool
        False: the address must name the unit.
    flags_overload : bool
        False: an overload shows only as a value beyond the capacity.
    commands : mapping of str to bytes
        "poll", "single", "start", "stop", "tare", "zero", "identify" as far as the device has them.
    rates : mapping of 1/s to bytes
        Commands that start a stream at these rates, where the device lets choose.
    undetected : str
        What damage of a line this protocol cannot show, for the documentation and the log.
    max_rate : float, 1/s
        Of polling, where the address has none.
    silence_s : float, s
        After which a message without an end is over.
    """

    name: str
    summary: str
    settings: type[ParserSettings]
    baud: int = 9600
    bytesize: int = 8
    parity: Parity = "N"
    mode: Mode = "listen"
    sign: int = 1
    unit_on_line: bool = True
    flags_overload: bool = True
    commands: Mapping[str, bytes] = field(default_factory=dict)
    undetected: str = ""
    max_rate: float = 10.0
    rates: Mapping[float, bytes] = field(default_factory=dict)
    silence_s: float = 0.1

    def make_parser(self, options: Options) -> Parser:
        """The parser of an address, from which it takes the settings of the protocol; raises ConfigError."""
        return take_settings(self.settings, options).parser(options.address.text)


def find_protocol(name: str) -> Protocol:
    """The protocol called ``name``.

    Raises
    ------
    ConfigError
        It is unknown; lists those there are.
    """
    if name not in PROTOCOLS:
        raise ConfigError(
            "no protocol is called {name}; there are: {listed}", repr(name), ", ".join(PROTOCOLS)
        )
    protocol: Protocol = importlib.import_module(PROTOCOLS[name]).PROTOCOL
    return protocol


def table_of(what: str, name: str, ours: Path) -> dict[str, Any]:
    """A table of the file ``ours`` by its name, or a TOML file of the user's; ``what`` it is, for messages.

    Raises
    ------
    ConfigError
        There is no such table, or the file cannot be read.
    """
    known = tomllib.loads(ours.read_text(encoding="utf-8"))
    if name in known:
        return dict(known[name])
    if not name.endswith(".toml"):
        raise ConfigError(
            "no {what} is called {name}; there are: {listed}, or give a .toml file",
            *(what, repr(name), ", ".join(known)),
        )
    try:
        return tomllib.loads(Path(name).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ConfigError("{what} {name}: {error}", what, name, error) from error
