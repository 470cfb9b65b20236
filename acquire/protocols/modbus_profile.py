"""The register map of a Modbus transmitter: read from TOML, checked, nothing hard-coded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from acquire.bounds import NotAllowed, as_integer
from acquire.errors import ConfigError
from acquire.load_sample import LoadFlag
from acquire.protocols.base import table_of
from acquire.text import Message

PROFILES = Path(__file__).with_name("modbus_profiles.toml")
TYPES = {"i16": 1, "u16": 1, "i32": 2, "u32": 2, "f32": 2}  # registers of each
ORDERS = ("big", "little")
FLAGS = {
    "overload": LoadFlag.OVERLOAD,
    "underload": LoadFlag.UNDERLOAD,
    "unstable": LoadFlag.UNSTABLE,
    "error": LoadFlag.ERROR,
    "net": LoadFlag.NET,
}
MAX_REGISTERS = 32  # registers of one query that every known transmitter answers


@dataclass(frozen=True, slots=True)
class FlagBit:
    """Where a flag stands: it is raised when ``register & mask`` is (set) or is not (not set) zero-free."""

    flag: LoadFlag
    register: int
    mask: int
    when_set: bool


@dataclass(frozen=True, slots=True)
class Profile:
    """A register map.

    Attributes
    ----------
    slave, function : int
    register : int
        First register of the value.
    kind, order : str
        Type of the value, and which of its two registers comes first ("big": the high one).
    sign_bit : FlagBit or None
        For transmitters that give magnitude and sign apart.
    flags : tuple of FlagBit
    commands : mapping of name to (register, value)
    """

    slave: int
    function: int
    register: int
    kind: str
    order: str
    sign_bit: FlagBit | None
    flags: tuple[FlagBit, ...]
    commands: Mapping[str, tuple[int, int]]

    @property
    def first(self) -> int:
        """First register of the query."""
        return min([self.register, *(bit.register for bit in self._bits())])

    @property
    def count(self) -> int:
        """Registers of the query."""
        last = max([self.register + TYPES[self.kind], *(bit.register + 1 for bit in self._bits())])
        return last - self.first

    def _bits(self) -> tuple[FlagBit, ...]:
        return self.flags if self.sign_bit is None else (*self.flags, self.sign_bit)


def load_profile(name: str) -> Profile:
    """A profile of ours by its name, or a TOML file of the user's.

    Raises
    ------
    ConfigError
        Unknown name, unreadable file, or a key that is missing, unknown or impossible.
    """
    return profile_from(table_of(Message("profile"), name, PROFILES), name)


def profile_from(table: Mapping[str, Any], name: str) -> Profile:
    """A profile from its keys.

    Raises
    ------
    ConfigError
    """
    try:
        _known_keys(table, ("slave", "function", "value", "sign", "flags", "commands"), "")
        value = table["value"]
        _known_keys(value, ("register", "type", "order"), "value.")
        flags = table.get("flags", {})
        _known_keys(flags, tuple(FLAGS), "flags.")
        profile = Profile(
            slave=_whole(table.get("slave", 1), 1, 247, "slave"),
            function=_whole(table.get("function", 3), 3, 4, "function"),
            register=_whole(value["register"], 0, 65534, "value.register"),
            kind=_one_of(value.get("type", "i32"), tuple(TYPES), "value.type"),
            order=_one_of(value.get("order", "big"), ORDERS, "value.order"),
            sign_bit=_bit(table["sign"], LoadFlag.NONE, "sign") if "sign" in table else None,
            flags=tuple(_bit(bit, FLAGS[flag], f"flags.{flag}") for flag, bit in flags.items()),
            commands={key: _command(command, key) for key, command in table.get("commands", {}).items()},
        )
    except KeyError as error:
        raise ConfigError("profile {name}: the key {error} is missing", name, error) from error
    except (TypeError, AttributeError) as error:
        raise ConfigError("profile {name}: a table is expected where a plain value stands", name) from error
    except ConfigError as error:
        raise ConfigError("profile {name}: {error}", name, error) from error
    if profile.count > MAX_REGISTERS:
        raise ConfigError(
            "profile {name}: registers span {count}; one query reads at most {MAX_REGISTERS}",
            name,
            profile.count,
            MAX_REGISTERS,
        )
    return profile


def _bit(table: Mapping[str, Any], flag: LoadFlag, where: str) -> FlagBit:
    _known_keys(table, ("register", "mask", "set"), f"{where}.")
    when_set = table.get("set", True)
    if not isinstance(when_set, bool):
        raise ConfigError("{where}.set must be true or false", where)
    return FlagBit(
        flag,
        _whole(table["register"], 0, 65535, f"{where}.register"),
        _whole(table["mask"], 1, 65535, f"{where}.mask"),
        when_set,
    )


def _command(table: Mapping[str, Any], name: str) -> tuple[int, int]:
    _known_keys(table, ("register", "value"), f"commands.{name}.")
    if name not in ("tare", "zero"):
        raise ConfigError("commands.{name}: there are tare and zero", name)
    return (
        _whole(table["register"], 0, 65535, f"commands.{name}.register"),
        _whole(table["value"], 0, 65535, f"commands.{name}.value"),
    )


def _known_keys(table: Mapping[str, Any], known: tuple[str, ...], where: str) -> None:
    unknown = set(table.keys()) - set(known)
    if unknown:
        raise ConfigError(
            "unknown key {where}{least}; known: {listed}", where, min(unknown), ", ".join(known)
        )


def _whole(value: Any, low: int, high: int, where: str) -> int:
    try:
        return as_integer(value, low, high)
    except NotAllowed as allowed:
        raise ConfigError(
            "{where} = {value} is not possible; allowed: {allowed}", where, repr(value), allowed
        ) from None


def _one_of(value: Any, allowed: tuple[str, ...], where: str) -> str:
    if value not in allowed:
        raise ConfigError(
            "{where} = {value} is not possible; allowed: {listed}", where, repr(value), ", ".join(allowed)
        )
    return str(value)
