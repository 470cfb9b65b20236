"""``modbus``: weight transmitters on Modbus RTU, by a register map in TOML (``profile=``).

Each reading is one query for a span of registers. Frames carry a CRC-16: a damaged one gives no value.

What cannot be detected: a wrong register map (type, word order, scale); compare the display.

The register map is read from TOML and checked; nothing is hard-coded.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from acquire.bounds import NotAllowed, as_integer, other_than_zero
from acquire.errors import ConfigError
from acquire.load_sample import LoadFlag
from acquire.protocols.base import Parser, ParserSettings, Protocol, Reading, table_of
from acquire.protocols.buffers import HeldBytes
from acquire.settings import TEXT, setting
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

LIMIT = 256  # longest frame of Modbus RTU
EXCEPTION_BYTES, ECHO_BYTES = 5, 8
WRITE_ONE = 6
VALUELESS = LoadFlag.OVERLOAD | LoadFlag.UNDERLOAD | LoadFlag.ERROR


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


def crc16(data: bytes) -> bytes:
    """The check sum of Modbus RTU, low byte first (Modbus over serial line V1.02, 6.2.2)."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ (0xA001 if crc & 1 else 0)
    return crc.to_bytes(2, "little")


def frame(*parts: int, words: tuple[int, ...] = ()) -> bytes:
    """A frame of bytes and 16-bit words, with its check sum."""
    body = bytes(parts) + b"".join(word.to_bytes(2, "big") for word in words)
    return body + crc16(body)


class ModbusParser(Parser):
    """See the module.

    Parameters
    ----------
    profile : Profile
    scale : float
        Value of one count.
    """

    def __init__(self, profile: Profile, scale: float = 1.0) -> None:
        self._profile, self._scale = profile, scale
        self._request = frame(profile.slave, profile.function, words=(profile.first, profile.count))
        self.commands = {"poll": self._request, "single": self._request} | {
            name: frame(profile.slave, WRITE_ONE, words=command) for name, command in profile.commands.items()
        }
        self._held = HeldBytes(LIMIT)

    def feed(self, data: bytes) -> list[Reading]:
        """Take bytes; the readings of the answers that they complete."""
        self._held.add(data)
        readings = []
        while (size := self._complete()) > 0:
            readings += self._read(*self._held.take(size))
        return readings

    def _complete(self) -> int:
        """Size of the sound frame at the beginning of what is held; 0 where there is none."""
        held = self._held.data
        if len(held) < EXCEPTION_BYTES or held[0] != self._profile.slave:
            return 0
        if held[1] == self._profile.function:
            size = 5 + 2 * self._profile.count if held[2] == 2 * self._profile.count else 0
        else:
            size = EXCEPTION_BYTES if held[1] & 0x80 else ECHO_BYTES if held[1] == WRITE_ONE else 0
        sound = 0 < size <= len(held) and crc16(bytes(held[: size - 2])) == held[size - 2 : size]
        return size if sound else 0

    def _read(self, answer: bytes, start: int) -> list[Reading]:
        if answer[1] == WRITE_ONE:
            return []
        if answer[1] & 0x80:
            return [Reading(math.nan, None, answer, start, flags=LoadFlag.ERROR)]
        words = struct.unpack(f">{self._profile.count}H", answer[3:-2])
        flags = LoadFlag.NONE
        for bit in self._profile.flags:
            flags |= bit.flag if self._raised(bit, words) else LoadFlag.NONE
        value = math.nan if flags & VALUELESS else self._value(words) * self._scale
        if math.isnan(value) and not flags & VALUELESS:
            flags |= LoadFlag.ERROR
        has_mark = any(bit.flag is LoadFlag.UNSTABLE for bit in self._profile.flags)
        stable = LoadFlag.UNSTABLE not in flags if has_mark else None
        return [Reading(value, None, answer, start, stable, flags)]

    def _raised(self, bit: FlagBit, words: tuple[int, ...]) -> bool:
        return bool(words[bit.register - self._profile.first] & bit.mask) is bit.when_set

    def _value(self, words: tuple[int, ...]) -> float:
        profile = self._profile
        at = profile.register - profile.first
        taken = words[at : at + TYPES[profile.kind]]
        if profile.order == "little":
            taken = taken[::-1]
        code = {"i16": ">h", "u16": ">H", "i32": ">i", "u32": ">I", "f32": ">f"}[profile.kind]
        value = float(struct.unpack(code, struct.pack(f">{len(taken)}H", *taken))[0])
        negative = profile.sign_bit is not None and self._raised(profile.sign_bit, words)
        return (-value if negative else value) if math.isfinite(value) else math.nan

    def silence(self) -> list[Reading]:
        """What is held at a silence is no sound answer."""
        raw, start = self._held.take(LIMIT)
        return [Reading(math.nan, None, raw, start, flags=LoadFlag.ERROR)] if raw else []

    def restart(self, lost: int = 0) -> None:
        """Forget the answer begun, and count the bytes never fed."""
        self._held.clear(lost)


@dataclass(frozen=True, slots=True)
class ModbusSettings(ParserSettings):
    """The register map, and what a count is worth."""

    profile: str | None = setting(TEXT, None, "the register map: its name, or a TOML file")
    scale: float = setting(other_than_zero, 1.0, "value of one count, in the unit of unit")

    def parser(self, address: str) -> Parser:
        """Their parser; raises ConfigError without a profile."""
        if self.profile is None:
            raise ConfigError("{text}: protocol=modbus needs profile=, for example laumas-tlb", address)
        return ModbusParser(load_profile(self.profile), self.scale)


PROTOCOL = Protocol(
    name="modbus",
    summary="weight transmitters over Modbus RTU, by profile",
    settings=ModbusSettings,
    mode="poll",
    unit_on_line=False,
    flags_overload=False,
    undetected=Message("a wrong register map (type, word order, scale): compare the display"),
    silence_s=0.05,
)
