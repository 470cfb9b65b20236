"""A pattern for ``protocol=lines``, made from lines that no other protocol understands.

Lines are alike but for their numbers. The number behind a word such as *weight* or *force* is the value: sketches for
the HX711 (``one reading: 12.4 | average: 12.3``), the plotter of the Arduino (``Force:12.3,Raw:8123``), JSON. Without
such a word the first number that changes and is no clock may be it, which a person has to confirm.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from acquire.protocols.units import is_unit

MIN_LINES, ALIKE = 5, 0.8
_NUMBER = re.compile(r"(?<![\w.])[-+]? *\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
_WORD = re.compile(r"[A-Za-z]+")
_VALUE = re.compile(
    r"force|load|weight|reading|value|mass|kraft|gewicht|last|poids|charge|peso", re.IGNORECASE
)
_OTHER = re.compile(r"raw|adc|count|time|temp|average|volt|status", re.IGNORECASE)
_UNIT = re.compile(r'[\s"]*([A-Za-z]+\.?)(?!["\s]*[:=\w])|.*?"unit[s]?"\s*:\s*"([A-Za-z]+\.?)"')
_MAY_BE_ONE = re.compile(r"[ ,.]*")  # between two numbers: 1,234 or 1 234


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
    if len(lines) < MIN_LINES:
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
