"""Finding out which protocol a serial port has: listening at the usual speeds, and asking only on request.

Listening sends nothing. ``questions`` lists what asking would send, so that it can be shown first:
an unknown machine may move.

From lines that no other protocol understands, a pattern for ``protocol=lines`` is made. They are alike but for their
numbers. The number behind a word such as *weight* or *force* is the value: sketches for the HX711 (``one reading: 12.4
| average: 12.3``), the plotter of the Arduino (``Force:12.3,Raw:8123``), JSON. Without such a word the first number
that changes and is no clock may be it, which a person has to confirm.
"""

from __future__ import annotations

import math
import re
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from acquire.addresses import Options, parse_address
from acquire.clock import Clock
from acquire.errors import ConfigError, DeviceError, PhasedicError
from acquire.load_sample import LoadFlag
from acquire.protocols.base import Parser, Protocol, Reading, find_protocol, is_mass, is_unit
from acquire.serial_line.byte_ports import Port
from acquire.serial_line.ports import PORT_ERRORS, LineSettings, open_port
from acquire.text.message import Message, joined

FEWEST_LINES, ALIKE = 5, 0.8
_NUMBER = re.compile(r"(?<![\w.])[-+]? *\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
_WORD = re.compile(r"[A-Za-z]+")
_VALUE = re.compile(
    r"force|load|weight|reading|value|mass|kraft|gewicht|last|poids|charge|peso", re.IGNORECASE
)
_OTHER = re.compile(r"raw|adc|count|time|temp|average|volt|status", re.IGNORECASE)
_UNIT = re.compile(r'[\s"]*([A-Za-z]+\.?)(?!["\s]*[:=\w])|.*?"unit[s]?"\s*:\s*"([A-Za-z]+\.?)"')
_MAY_BE_ONE = re.compile(r"[ ,.]*")  # between two numbers: 1,234 or 1 234

SPEEDS = (9600, 115200, 57600, 19200, 2400, 4800, 38400, 1200)
LISTEN_S = 1.5
MIN_LINES, MAX_BYTES = 5, 1 << 16
# What sends unasked, the strictest grammar first; ascii with columns where the plain one leaves a choice.
UNASKED = (
    ("mt-sics", ""),
    ("aed-standard", ""),
    ("ascii", ""),
    ("ascii", "millis=1"),
    ("ascii", "millis=1&column=2"),
    ("ascii", "decimal=comma"),
    ("ascii", "decimal=comma&millis=1"),
    ("hbm-aed", "decimals=0"),
    ("lines", "preset=rinstrum"),
)
ASKED = ("mt-sics", "aed-standard", "mark10", "sauter", "hbm-aed", "modbus")
ASKED_SETTINGS = {"modbus": "profile=laumas-tlb", "hbm-aed": "decimals=0"}
SURE = 0.8  # part of the lines that must be readings
COUNTS = 1000  # whole numbers from here on may be counts of a converter

Opener = Callable[[LineSettings], Port]


@dataclass(frozen=True, slots=True)
class LinePattern:
    """What the lines have in common.

    Attributes
    ----------
    pattern : str
        A regular expression as ``protocol=lines`` takes it.
    labelled : bool
        A word says which number is the value, and no two numbers may be one.
    """

    pattern: str
    labelled: bool


def pattern_of(received: bytes) -> LinePattern | None:
    """The pattern of most lines; None where they are too few, no text, unlike, or without a number."""
    text = received.decode("ascii", "replace")
    lines = [line for line in re.split(r"[\r\n\x03]+", text)[1:-1] if line.strip()]
    if len(lines) < FEWEST_LINES:
        return None
    (skeleton, often), *_ = Counter(map(_skeleton, lines)).most_common(1)
    if often < ALIKE * len(lines) or len(skeleton) < 2 or not "".join(skeleton).isprintable():
        return None
    rows = [_numbers(line) for line in lines if _skeleton(line) == skeleton]
    labels = [(_WORD.findall(piece) or [""])[-1] for piece in skeleton[:-1]]
    named = [k for k, label in enumerate(labels) if _VALUE.search(label) and not _OTHER.search(label)]
    column = named[0] if named else _changing(list(zip(*rows, strict=True)))
    clear = not any(_MAY_BE_ONE.fullmatch(piece) for piece in skeleton[1:-1])
    return LinePattern(_pattern(skeleton, column), labelled=bool(named) and clear)


def _skeleton(line: str) -> tuple[str, ...]:
    """The text between the numbers; blanks count as one, those before a number not at all."""
    *before, after = _NUMBER.split(line.strip())
    return (*(" ".join(piece.split()) for piece in before), re.sub(r"\s+", " ", after))


def _numbers(line: str) -> list[float]:
    return [float(found.replace(" ", "")) for found in _NUMBER.findall(line)]


def _changing(columns: Sequence[Sequence[float]]) -> int:
    """The first column that changes and is no clock; else the first."""
    for k, column in enumerate(columns):
        if len(set(column)) > 1 and not all(later > earlier for earlier, later in pairwise(column)):
            return k
    return 0


def _pattern(skeleton: Sequence[str], column: int) -> str:
    parts = []
    for k, piece in enumerate(skeleton):
        unit = _UNIT.match(piece) if k == column + 1 else None
        word = next((group for group in unit.groups() if group), "") if unit else ""
        before, found, after = piece.partition(word) if is_unit(word) else (piece, "", "")
        parts.append(_literal(before) + ("(?P<unit>[A-Za-z.]+)" if found else "") + _literal(after))
        parts.append("(?P<value>[-+]? *[0-9.eE+-]+)" if k == column else "[-+]? *[0-9.eE+-]+")
    return re.sub(r"(\\s\*)+", r"\\s*", r"\s*".join(["", *parts[:-1], ""]))


def _literal(text: str) -> str:
    return "".join(r"\s*" if part == " " else re.escape(part) for part in re.split("( )", text))


@dataclass(frozen=True, slots=True)
class Finding:
    """A guess at what is on the port.

    Attributes
    ----------
    address : str
        To be used as ``--load``.
    protocol : str
    score : float
        Part of the lines that are readings in this protocol.
    lines : tuple of bytes
        Some of what was received.
    remark : str
        What the address still lacks, or what to check.
    """

    address: str
    protocol: str
    score: float
    lines: tuple[bytes, ...]
    remark: str


@dataclass(frozen=True, slots=True)
class Question:
    """A query that reads, and how it would be sent."""

    protocol: str
    line: LineSettings
    data: bytes


def record_bytes(
    line: LineSettings, seconds: float = LISTEN_S, opener: Opener = open_port, clock: Clock = time.monotonic
) -> bytes:
    """What comes on a port by itself within so many seconds.

    Raises
    ------
    ConfigError, DeviceError
        The port cannot be opened, or is lost.
    """
    port = opener(line)
    try:
        return _collect(port, seconds, clock)
    except PORT_ERRORS as error:
        raise DeviceError(
            "{url}: lost while listening ({error}); check the cable", line.url, error
        ) from error
    finally:
        port.close()


def _collect(port: Port, seconds: float, clock: Clock) -> bytes:
    until, received = clock() + seconds, bytearray()
    while clock() < until and len(received) < MAX_BYTES:
        received += port.receive(4096)
    return bytes(received)


def listen(
    device: str, *, seconds: float = LISTEN_S, opener: Opener = open_port, clock: Clock = time.monotonic
) -> Iterator[tuple[int, bytes, Finding | None]]:
    """Listen at one speed after the other until something is understood.

    Yields
    ------
    speed, what was received, and the finding (None where it makes no sense); a speed that the port refuses is left out

    Raises
    ------
    ConfigError, DeviceError
        The port opens at no speed, or is lost.
    """
    refused: list[PhasedicError] = []
    for baud in SPEEDS:
        line = LineSettings(device, baud)
        try:
            port = opener(line)
        except (ConfigError, DeviceError) as error:
            refused.append(error)
            continue
        received = record_bytes(line, seconds, lambda _, port=port: port, clock)  # type: ignore[misc]
        finding = guess(device, baud, received, seconds)
        yield baud, received, finding
        if finding is not None:
            return
    if len(refused) == len(SPEEDS):
        raise refused[0]


def guess(device: str, baud: int, received: bytes, seconds: float = LISTEN_S) -> Finding | None:
    """The protocol that understands most of what was received in so many seconds; None where none does."""
    parity = _parity(received)
    text = bytes(byte & 0x7F for byte in received) if parity != "N" else received
    line = LineSettings(device, baud, 7 if parity != "N" else 8, parity)
    found = [_try(line, name, settings, text, seconds) for name, settings in UNASKED]
    sure = [finding for finding in found if finding is not None and finding.score >= SURE]
    if sure:
        return max(sure, key=lambda finding: finding.score)
    made = pattern_of(text)
    return proposed(line, text) if made is not None and made.labelled else None


def proposed(line: LineSettings, received: bytes) -> Finding | None:
    """``protocol=lines`` with a pattern made from what was received; None where lines are not alike."""
    made = pattern_of(received)
    if made is None:
        return None
    escaped = "".join(f"%{ord(one):02X}" if one in "%&'#" else one for one in made.pattern)
    found = _try(line, "lines", f"pattern={escaped}", received, LISTEN_S)
    return found if found is not None and found.score >= SURE else None


def _parity(received: bytes) -> str:
    """The parity of seven-bit characters that were received as eight bits."""
    if not received or max(received) < 0x80:
        return "N"
    ones = {byte.bit_count() % 2 for byte in received}
    return {frozenset({0}): "E", frozenset({1}): "O"}.get(frozenset(ones), "N")


def _try(line: LineSettings, name: str, settings: str, received: bytes, seconds: float) -> Finding | None:
    protocol = find_protocol(name)
    parser = _parser(protocol, line.url, settings)
    readings = parser.feed(received) + parser.silence()
    if len(readings) < MIN_LINES or ("millis" in settings and not _is_a_clock(readings, seconds)):
        return None
    parts = [f"protocol={name}", f"baud={line.baud}", f"bytesize={line.bytesize}", f"parity={line.parity}"]
    more = [settings] if settings and name != "hbm-aed" else []
    good = [reading for reading in readings if not math.isnan(reading.value)]
    return Finding(
        address=f"{line.url}?{'&'.join([*parts, *more])}",
        protocol=name,
        score=sum(_understood(reading) for reading in readings) / len(readings),
        lines=tuple(reading.raw for reading in readings[-3:]),
        remark=joined("; ", (_reads(good), _remark(readings, text=name == "ascii"))),
    )


def _is_a_clock(readings: list[Reading], seconds: float) -> bool:
    """Whether the field is a plausible counter of milliseconds: monotonic, and as fast as our clock."""
    times = [reading.device_ms for reading in readings if reading.device_ms is not None]
    if len(times) < MIN_LINES or any(later < earlier for earlier, later in pairwise(times)):
        return False
    span_s = (times[-1] - times[0]) * 1e-3
    return 0.2 * seconds < span_s < 2 * seconds


def _reads(good: list[Reading]) -> str:
    """How the last line is read, for a person to compare with the display."""
    if not good:
        return ""
    shown = good[-1].raw.decode("ascii", "backslashreplace").strip()
    return Message("{shown} is read as {value:.9g}: compare the display", repr(shown), good[-1].value)


def _parser(protocol: Protocol, device: str, settings: str) -> Parser:
    address = parse_address(f"{device}?{settings}" if settings else device)
    return protocol.make_parser(Options(address))


def _understood(reading: Reading) -> bool:
    return LoadFlag.ERROR not in reading.flags


def _remark(readings: list[Reading], *, text: bool = False) -> str:
    units = {reading.unit for reading in readings if reading.unit}
    if not units and text and _are_counts(readings):
        return Message(
            "whole numbers without a unit, perhaps raw counts: phasedic load-calibrate finds gain and zero"
        )
    if not units:
        return Message("the line names no unit: add unit=N, or the one on the display")
    masses = sorted(unit for unit in units if is_mass(unit))
    if masses:
        return Message(
            "the line says {masses}: add mass_reads_force=yes if that stands for a force", masses[0]
        )
    return ""


def _are_counts(readings: list[Reading]) -> bool:
    """Whether these are like the counts of a converter: whole, and large."""
    values = [reading.value for reading in readings if not math.isnan(reading.value)]
    return len(values) > 0 and all(value.is_integer() and abs(value) >= COUNTS for value in values)


def questions(device: str) -> list[Question]:
    """What asking would send: queries that read, none that moves, tares or sets anything."""
    found = []
    for name in ASKED:
        protocol = find_protocol(name)
        parser = _parser(protocol, device, ASKED_SETTINGS.get(name, ""))
        data = {**protocol.commands, **parser.commands}["single"]
        line = LineSettings(device, protocol.baud, protocol.bytesize, protocol.parity)
        found.append(Question(name, line, data))
    return found


def ask(question: Question, opener: Opener = open_port, clock: Clock = time.monotonic) -> Finding | None:
    """Send one question and look whether the answer makes sense.

    Raises
    ------
    ConfigError, DeviceError
    """
    port = opener(question.line)
    try:
        _collect(port, 0.3, clock)  # what it sends unasked is no answer
        port.write(question.data)
        received = _collect(port, 0.7, clock).removeprefix(question.data)  # an adapter may echo
    except PORT_ERRORS as error:
        raise DeviceError(
            "{url}: lost while asking ({error}); check the cable", question.line.url, error
        ) from error
    finally:
        port.close()
    return _answer(question, received)


def _answer(question: Question, received: bytes) -> Finding | None:
    protocol, line = find_protocol(question.protocol), question.line
    parser = _parser(protocol, line.url, ASKED_SETTINGS.get(question.protocol, ""))
    parser.feed(b"\r\n" if protocol.silence_s >= 0.1 else b"")
    readings = [r for r in parser.feed(received) + parser.silence() if _understood(r)]
    if not readings:
        return None
    settings = ASKED_SETTINGS.get(question.protocol, "")
    parts = [f"protocol={question.protocol}", f"baud={line.baud}", *([settings] if settings else [])]
    return Finding(
        f"{line.url}?{'&'.join(parts)}", question.protocol, 1.0, (readings[0].raw,), _remark(readings)
    )
