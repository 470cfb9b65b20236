"""``modbus``: weight transmitters on Modbus RTU, by a register map in TOML (``profile=``).

Each reading is one query for a span of registers. Frames carry a CRC-16: a damaged one gives no value.

What cannot be detected: a wrong register map (type, word order, scale); compare the display.
"""

from __future__ import annotations

import math
import struct

from acquire.addresses import Options
from acquire.errors import ConfigError
from acquire.load_sample import LoadFlag
from acquire.protocols.base import Parser, Protocol, Reading
from acquire.protocols.buffers import HeldBytes
from acquire.protocols.modbus_profile import TYPES, FlagBit, Profile, load_profile
from acquire.text import Message

LIMIT = 256  # longest frame of Modbus RTU
EXCEPTION_BYTES, ECHO_BYTES = 5, 8
WRITE_ONE = 6
VALUELESS = LoadFlag.OVERLOAD | LoadFlag.UNDERLOAD | LoadFlag.ERROR


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


def make_parser(options: Options) -> Parser:
    """Takes ``profile`` and ``scale`` out of the address."""
    name = options.text("profile")
    scale = options.number("scale", 1.0)
    if name is None:
        raise ConfigError(
            "{text}: protocol=modbus needs profile=, for example laumas-tlb", options.address.text
        )
    if scale == 0:
        raise ConfigError(
            "{text}: scale=0 is not possible; allowed: a number other than zero", options.address.text
        )
    return ModbusParser(load_profile(name), scale)


PROTOCOL = Protocol(
    name="modbus",
    summary="weight transmitters over Modbus RTU, by profile",
    make_parser=make_parser,
    mode="poll",
    unit_on_line=False,
    flags_overload=False,
    undetected=Message("a wrong register map (type, word order, scale): compare the display"),
    silence_s=0.05,
)
