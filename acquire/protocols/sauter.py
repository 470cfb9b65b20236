"""``sauter``: Sauter FH, FL and clones.

To a ``9`` the gauge answers one sign digit (1 tension, 0 compression) and six characters:
``1021.15`` is +21.15, ``0011.70`` is -11.70. No unit and no terminator: an answer is the seven bytes
between two silences, so that a lost byte can never shift one answer into the next.

What cannot be detected: transmission errors, and an overload (say ``capacity=``).
"""

from __future__ import annotations

import math
import re

from acquire.load_sample import LoadFlag
from acquire.protocols.base import Parser, ParserSettings, Protocol, Reading
from acquire.protocols.buffers import HeldBytes, number
from acquire.text import Message

LENGTH = 7
LIMIT = 64  # bytes kept of a babble without silence

_ANSWER = re.compile(rb"([01])([0-9]*\.?[0-9]+)")


class SauterParser(Parser):
    """See the module."""

    def __init__(self) -> None:
        self._held = HeldBytes(LIMIT)

    def feed(self, data: bytes) -> list[Reading]:
        """Take bytes; readings come with the silence after them."""
        self._held.add(data)
        return []

    def silence(self) -> list[Reading]:
        """The answer that this silence ends."""
        raw, start = self._held.take(LIMIT)
        if not raw:
            return []
        found = _ANSWER.fullmatch(raw)
        if len(raw) != LENGTH or not found:
            return [Reading(math.nan, None, raw, start, flags=LoadFlag.ERROR)]
        value = number(found[2].decode())
        return [Reading(value if found[1] == b"1" else -value, None, raw, start)]

    def restart(self, lost: int = 0) -> None:
        """Forget the answer begun, and count the bytes never fed."""
        self._held.clear(lost)


class SauterSettings(ParserSettings):
    """No settings of its own."""

    def parser(self, address: str) -> Parser:
        """The one there is."""
        return SauterParser()


PROTOCOL = Protocol(
    name="sauter",
    summary="Sauter FH/FL and clones (asked for each reading)",
    settings=SauterSettings,
    mode="poll",
    unit_on_line=False,
    flags_overload=False,
    commands={"poll": b"9", "single": b"9"},
    undetected=Message("transmission errors are not detected, nor an overload: say capacity="),
    silence_s=0.05,
)
