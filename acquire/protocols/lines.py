"""``lines``: one regular expression for every other device that sends lines.

``pattern=`` is matched against the whole line and names its parts: ``(?P<value>...)``, and where they
exist ``unit``, ``sign``, ``flag`` and ``ms``. Words that stand for a state instead of a value:
``overload=H|OL|--``, ``underload=L``, ``error=Err``, ``unstable=?``: a line that contains
a word of the first three (as a whole word) has no value; one that contains an unstable word, or whose
``flag`` is one, is unstable. ``preset=`` loads these from ``line_presets.toml`` or a file of your own.

What cannot be detected: whatever the pattern lets pass. A pattern that backtracks without end makes the
reading slow; lines are at most 256 bytes.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from acquire.bounds import other_than_zero
from acquire.errors import ConfigError
from acquire.load_sample import LoadFlag
from acquire.protocols.base import Parser, ParserSettings, Protocol, Reading, table_of
from acquire.protocols.buffers import Line, LineBuffer, LineParser, bad, number
from acquire.settings import TEXT, choice, setting
from acquire.text import Message

STATES = {"overload": LoadFlag.OVERLOAD, "underload": LoadFlag.UNDERLOAD, "error": LoadFlag.ERROR}
ENDS = {"line": b"\r\n", "cr": b"\r", "lf": b"\n", "etx": b"\x03"}
COMMANDS = ("poll", "start", "stop", "tare", "zero")
PRESETS = Path(__file__).with_name("line_presets.toml")
KEYS = ("pattern", *STATES, "unstable", "net", "ends", "scale", "decimal", "unit", *COMMANDS)


@dataclass(frozen=True, slots=True)
class LineRules:
    """How the address or a preset describes the lines.

    Attributes
    ----------
    pattern : compiled regular expression of bytes
    states : tuple of (word, flag)
        Words that take the place of a value.
    unstable, net : tuple of bytes
        Words that go with a value.
    scale : float
        The number on the line is multiplied with it.
    decimal_comma : bool
    unit : str or None
        Where the line names none.
    """

    pattern: re.Pattern[bytes]
    states: tuple[tuple[bytes, LoadFlag], ...] = ()
    unstable: tuple[bytes, ...] = ()
    net: tuple[bytes, ...] = ()
    scale: float = 1.0
    decimal_comma: bool = False
    unit: str | None = None


class RuledParser(LineParser):
    """See the module."""

    def __init__(
        self, rules: LineRules, ends: bytes = b"\r\n", commands: Mapping[str, bytes] | None = None
    ) -> None:
        super().__init__(LineBuffer(ends=ends))
        self._rules = rules
        self.commands = dict(commands or {})

    def parse(self, line: Line) -> Reading | None:
        """The reading of a line."""
        words = re.findall(rb"[^\s,;:]+", line.data)
        for word, flag in self._rules.states:
            if word in words or line.data.strip() == word:
                return bad(line, flag)
        found = self._rules.pattern.fullmatch(line.data)
        return self._value(line, found, words) if found else bad(line)

    def _value(self, line: Line, found: re.Match[bytes], words: list[bytes]) -> Reading:
        parts = {k: v.decode("ascii", "replace") for k, v in found.groupdict().items() if v is not None}
        state = dict(self._rules.states).get(found.groupdict().get("flag") or b"")
        if state is not None:
            return bad(line, state)
        value = number(parts.get("sign", "").strip() + parts.get("value", ""), self._rules.decimal_comma)
        if math.isnan(value):
            return bad(line)
        marks = {*words, found.groupdict().get("flag") or b""}
        unstable = not marks.isdisjoint(self._rules.unstable)
        flags = LoadFlag.UNSTABLE if unstable else LoadFlag.NONE
        flags |= LoadFlag.NONE if marks.isdisjoint(self._rules.net) else LoadFlag.NET
        stable = (not unstable) if self._rules.unstable else None
        ms = number(parts.get("ms", ""))
        return Reading(
            value * self._rules.scale,
            parts.get("unit") or self._rules.unit,
            line.data,
            line.start,
            stable,
            flags,
            None if math.isnan(ms) else ms,
        )


@dataclass(frozen=True, slots=True)
class LinesSettings(ParserSettings):
    """Those of a preset, which may also stand in the address.

    ``unit``, ``tare`` and ``zero`` of a preset mean another thing in an address, whatever its protocol.
    """

    preset: str | None = setting(TEXT, None, "the keys of a kind of device: its name, or a TOML file")
    pattern: str | None = setting(TEXT, None, "regular expression of a line, with (?P<value>...)")
    overload: str | None = setting(TEXT, None, "words in place of a value, with | between two")
    underload: str | None = setting(TEXT, None, "words in place of a value")
    error: str | None = setting(TEXT, None, "words in place of a value")
    unstable: str | None = setting(TEXT, None, "words beside a value that is not yet still")
    net: str | None = setting(TEXT, None, "words beside a value from which a tare is taken")
    ends: str | None = setting(choice(*ENDS), None, "end of a line; where not given line: CR or LF")
    scale: float | None = setting(other_than_zero, None, "factor of the number on the line")
    decimal: str | None = setting(choice("point", "comma"), None, "the decimal mark; where not given point")
    poll: str | None = setting(TEXT, None, "what asks for a reading")
    start: str | None = setting(TEXT, None, "what starts a stream")
    stop: str | None = setting(TEXT, None, "what ends a stream")

    def parser(self, address: str) -> Parser:
        """Their parser; raises ConfigError where no pattern is given, or an impossible one."""
        rules = load_preset(self.preset) if self.preset else {}
        given = {key: value for key, value in asdict(self).items() if value is not None and key != "preset"}
        try:
            return parser_from(rules | given)
        except ConfigError as error:
            raise ConfigError("{text}: {error}", address, error) from error


def load_preset(name: str) -> dict[str, Any]:
    """A preset of ours by its name, or a TOML file with the same keys.

    Raises
    ------
    ConfigError
    """
    rules = table_of(Message("preset"), name, PRESETS)
    unknown = set(rules) - set(KEYS)
    if unknown:
        raise ConfigError(
            "preset {name}: unknown key {least}; known: {listed}", name, repr(min(unknown)), ", ".join(KEYS)
        )
    return rules


def parser_from(preset: Mapping[str, Any]) -> RuledParser:
    """A parser from the keys of a preset.

    Raises
    ------
    ConfigError
        No pattern, an impossible one, or one without a value.
    """
    if "pattern" not in preset:
        raise ConfigError("protocol=lines needs pattern= or preset=")
    ends = ENDS.get(str(preset.get("ends", "line")))
    if ends is None:
        raise ConfigError("ends={preset} is not possible; allowed: {listed}", preset["ends"], ", ".join(ENDS))
    rules = LineRules(
        pattern=_pattern(str(preset["pattern"])),
        states=tuple((word, flag) for key, flag in STATES.items() for word in _words(preset, key)),
        unstable=_words(preset, "unstable"),
        net=_words(preset, "net"),
        scale=_scale(preset.get("scale", 1.0)),
        decimal_comma=str(preset.get("decimal", "point")) == "comma",
        unit=preset.get("unit"),
    )
    commands = {key: _bytes(preset[key]) for key in COMMANDS if key in preset}
    return RuledParser(rules, ends, commands)


def _pattern(text: str) -> re.Pattern[bytes]:
    try:
        pattern = re.compile(text.encode())
    except re.error as error:
        raise ConfigError("pattern={text} is no regular expression: {error}", text, error) from error
    if "value" not in pattern.groupindex:
        raise ConfigError("pattern={text} names no value; write (?P<value>...) around the number", text)
    return pattern


def _words(rules: Mapping[str, Any], key: str) -> tuple[bytes, ...]:
    return tuple(word.encode() for word in str(rules.get(key, "")).split("|") if word)


def _scale(value: Any) -> float:
    scale = number(str(value))
    if math.isnan(scale) or scale == 0:
        raise ConfigError("scale={value} is not possible; allowed: a number other than zero", value)
    return scale


def _bytes(text: Any) -> bytes:
    r"""A command as it is written in a preset: ``\r`` and ``\n`` mean the bytes."""
    return str(text).replace("\\r", "\r").replace("\\n", "\n").encode("ascii", "replace")


PROTOCOL = Protocol(
    name="lines",
    summary="any other lines, by a regular expression or a preset",
    settings=LinesSettings,
    undetected=Message("whatever the pattern lets pass"),
)
