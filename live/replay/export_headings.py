"""What the heading of an exported column means: force, time, name of a picture or number of a row, and its unit.

Names are those of common testing machines, in the languages of their programs; units stand in brackets, after a
slash, comma, blank or underscore, or below the heading.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Sequence

from acquire.errors import ConfigError
from acquire.protocols.units import is_mass, newtons_per

_WORDS = {
    "force": "force load f kraft last charge effort 荷重 試験力 力 fuerza carga forza carico"
    " forca kracht siła сила усилие нагрузка 载荷 负荷 试验力 拉力 力值 하중",
    "time": "time t seconds zeit temps duree 時間 tiempo tempo tijd tid czas время 时间 시간 x_value",
    "clock": "timestamp date datum datetime uhrzeit heure clock 時刻 日時",
    "date": "date datum fecha data 日付",
    "name": "file filename picture image name bild bilddatei datei dateiname fichier photo ファイル 画像",
    "row": "index no nr number point sample frame row nummer #",
    "neutral": "axial axiale standard test tensile traction primary elapsed running measured actual applied cell"
    " channel ch ai value signal d de essai der des gemessen",
    "other": "max maximum maximal maximale peak min minimum break bruch rupture rate speed displacement extension"
    " strain stress spannung contrainte position setpoint command demand target soll sollwert consigne error"
    " temperature stiffness step line limit constant mode type unit drop",
}
"""The words of each kind, folded; of ``name`` and ``row`` they are the whole heading. ``other`` makes it none."""
_ENDINGS = {
    "force": ("kraft", "荷重", "試験力", "载荷", "负荷", "试验力"),
    "time": ("zeit", "時間", "时间"),
}
_SECONDS = {
    1.0: "s sec secs second seconds sek sekunde sekunden seconde secondes 秒",
    1e-3: "ms msec millisecond milliseconds millisekunden",
    1e-6: "us µs usec microsecond microseconds",
    60.0: "min mins minute minutes minuten 分",
    3600.0: "h hr hour hours std stunde stunden heure heures",
}
_ALIASES = {
    "newton": "N", "newtons": "N", "kilonewton": "kN", "kilonewtons": "kN", "kip": "klbf", "kips": "klbf",
}  # fmt: skip
_BRACKETS = re.compile(r"(.*?)\s*[\[({<]\s*([^\[\](){}<>]*?)\s*[\])}>]\s*")
_BARE = re.compile(r"(.*?)(?:\s*[/,|]\s*|[\s_]+(?:in\s+)?)([^\s/,|_]+)")
_LONGEST_UNIT = 8


def _folded(text: str) -> str:
    """Without case, accents and width: "Prüfzeit " and "prufzeit" are the same."""
    decomposed = unicodedata.normalize("NFKD", text.casefold())
    return "".join(c for c in decomposed if not unicodedata.combining(c)).strip()


_SECONDS_OF = {_folded(word): factor for factor, words in _SECONDS.items() for word in words.split()}
_KINDS = {kind: frozenset(map(_folded, words.split())) for kind, words in _WORDS.items()}


def plain_unit(cell: str) -> str:
    """A unit without its brackets and full stop."""
    return unicodedata.normalize("NFKC", cell).strip("[](){}<> \t.")


def seconds_per(unit: str) -> float | None:
    """Seconds of one unit of time; None where it is none."""
    return _SECONDS_OF.get(_folded(unit))


def newtons_of(unit: str) -> float | None:
    """Newtons of one unit of force; None where it is none."""
    try:
        return newtons_per(_ALIASES.get(unit.lower(), unit))
    except ConfigError:
        return None


def is_unit(word: str) -> bool:
    """Whether a word is a unit of force, mass or time."""
    return seconds_per(word) is not None or newtons_of(word) is not None or is_mass(word) or word == "MN"


def name_and_unit(cell: str) -> tuple[str, str]:
    """The name of a column and its unit, "" without one: ``Load (kN)``, ``Kraft [N]``, ``F/N``, ``force_N``."""
    text = unicodedata.normalize("NFKC", cell).strip()
    found = _BRACKETS.fullmatch(text)
    if (
        found
        and found[1]
        and (is_unit(found[2]) or (0 < len(found[2]) <= _LONGEST_UNIT and " " not in found[2]))
    ):
        return found[1], plain_unit(found[2])
    found = _BARE.fullmatch(text)
    return (found[1], found[2]) if found and found[1] and is_unit(found[2]) else (text, "")


def _rank(name: str, kind: str) -> int | None:
    """How surely a name is of ``kind``: 0 by its words, 1 by a letter, 2 where it has other words; None: it is not."""
    folded = _folded(name)
    if kind in ("name", "row", "date") or folded in _KINDS[kind]:
        words = re.sub(r"[\s_.]+", "", folded)
        return int(len(folded) == 1 and kind != "row") if {words, folded} & _KINDS[kind] else None
    parts = re.findall(r"[^\W\d_]+", folded)
    own = [part in _KINDS[kind] or part.endswith(_ENDINGS.get(kind, "\0")) for part in parts]
    if not any(own) or any(part in _KINDS["other"] for part in parts):
        return None
    rest = [
        part for part, is_own in zip(parts, own, strict=True) if not is_own and part not in _KINDS["neutral"]
    ]
    return 2 if rest else int(all(len(part) == 1 for part, is_own in zip(parts, own, strict=True) if is_own))


def find_columns(heads: Sequence[str], kind: str) -> list[int]:
    """The columns that may be of ``kind``: force, time, clock, duration (by its unit alone), name or row.

    Those with a unit of it come before those without, and these before those of another unit. Of times that whose name
    says so most surely is taken, of forces none: two may be two load cells.
    """
    per = {"force": newtons_of, "time": seconds_per}.get(kind)
    if kind == "duration":  # in a language that is not known here
        return [k for k, head in enumerate(heads) if _is_by_unit(*name_and_unit(head), seconds_per)]
    ranked: dict[tuple[int, int], list[int]] = {}
    for k, (name, unit) in enumerate(map(name_and_unit, heads)):
        if (rank := _rank(name, kind)) is not None:
            fit = 0 if per is None else 1 if not unit else 0 if per(unit) is not None else 2
            ranked.setdefault((fit, 0 if kind == "force" else rank), []).append(k)
    if kind == "force" and not ranked:
        return [k for k, head in enumerate(heads) if _is_by_unit(*name_and_unit(head), newtons_of)]
    return ranked[min(ranked)] if ranked else []


def _is_by_unit(name: str, unit: str, per: Callable[[str], float | None]) -> bool:
    words = set(re.findall(r"[^\W\d_]+", _folded(name)))
    return bool(unit) and per(unit) is not None and not words & _KINDS["other"]


def given_columns(heads: Sequence[str], given: str) -> tuple[int, int | None] | None:
    """The columns that ``FORCE`` or ``FORCE,TIME`` names, by heading or number from 1; None where one is not there."""
    if (alone := _column_called(heads, given)) is not None:
        return alone, None
    for comma in re.finditer(",", given):
        force = _column_called(heads, given[: comma.start()])
        key = _column_called(heads, given[comma.end() :])
        if force is not None and key is not None:
            return force, key
    return None


def _column_called(heads: Sequence[str], word: str) -> int | None:
    word = word.strip()
    if word.isdecimal():
        return int(word) - 1 if 1 <= int(word) <= len(heads) else None
    full = [k for k, head in enumerate(heads) if _folded(head) == _folded(word)]
    named = full or [k for k, head in enumerate(heads) if _folded(name_and_unit(head)[0]) == _folded(word)]
    return named[0] if len(named) == 1 else None
