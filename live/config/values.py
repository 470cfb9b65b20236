"""The checks of the values of the configuration, from a file or from a word of the command line.

The error of a check has what is allowed; the caller adds the key and the value.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar

from acquire.addresses import as_typed
from acquire.bounds import NotAllowed, as_integer, as_number
from acquire.errors import ConfigError
from acquire.record_mode import RECORD_MODES, RecordMode
from acquire.text import Message
from live.config.listen_address import SOCKET, ListenAddress

Number = TypeVar("Number", int, float)

_NUMBER = r"[-+]?(?:[0-9]+[.]?[0-9]*|[.][0-9]+)"
_IN_MM = re.compile(rf"\s*({_NUMBER}(?:\s*,\s*{_NUMBER})*)\s*mm\s*")

MAX_BESIDE = 7

LENS_PARAMETERS = 8

AUTO, ALL = REGIONS = ("auto", "all")
"""Named regions: the specimen found in the picture, or the picture except a rim."""
GIVEN = "given"
"""Only the gauges of the configuration; with ``AUTO``, others are placed too."""


@dataclass(frozen=True, slots=True)
class Check:
    """A kind of value: what is accepted and how it is read.

    Attributes
    ----------
    accept : callable
        Returns the value to use; raises ``NotAllowed``.
    read : callable
        Converts a word of the command line for ``accept``; raises ValueError.
    length : "", "px" or "whole px"
        For a length in the picture, which may be given in mm; "whole px" is rounded.
    words : tuple of str
        The accepted words of a choice.
    """

    accept: Callable[[Any], Any]
    read: Callable[[str], Any] = str
    length: str = ""
    words: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Option:
    """The option of a key on the command line.

    Attributes
    ----------
    name : str
        Without its dashes.
    metavar : str
        "": the option offers the words of the check.
    off, on : bool
        A switch that turns the key off, or on.
    expert : bool
        Only ``--help-all`` shows it.
    many : bool
        May be given several times.
    alone : str
        The value of the option without a word; empty where it needs one.
    """

    name: str
    metavar: str = ""
    off: bool = False
    on: bool = False
    expert: bool = False
    many: bool = False
    alone: str = ""


def key(check: Check, default: Any, help_text: str, option: Option | None = None) -> Any:
    """A field of a section: its check, default, help text and option."""
    return field(default=default, metadata={"check": check, "help": help_text, "option": option})


def number(low: float = -math.inf, high: float = math.inf) -> Check:
    """A number within bounds."""
    return Check(lambda value: as_number(value, low, high), float)


def integer(low: int, high: int) -> Check:
    """A whole number within bounds."""
    return Check(lambda value: as_integer(value, low, high), int)


def length(check: Check, *, whole: bool = False) -> Check:
    """``check`` for a length in the picture: px, or mm as "6 mm" or "10, 20 mm" if the scale is known."""

    def read(word: str) -> Any:
        if _IN_MM.fullmatch(word):
            return word
        try:
            return check.read(word)
        except ValueError as error:
            kind = {int: Message("a whole number of px"), float: Message("a number of px")}.get(check.read)  # type: ignore[call-overload]
            raise ValueError(f"give {kind}, or mm as 6mm" if kind else str(error)) from None

    return Check(check.accept, read, Message("whole px") if whole else "px")


def in_px(value: Any, check: Check, px_per_mm: float | None) -> Any:
    """A length given in mm as px, other values unchanged; raises ``NotAllowed`` if the scale is not known."""
    if isinstance(value, list | tuple):
        return [in_px(v, check, px_per_mm) for v in value]
    found = _IN_MM.fullmatch(value) if check.length and isinstance(value, str) else None
    if found is None:
        return value
    if px_per_mm is None:
        raise NotAllowed("px; for mm the scale must be known: phasedic scale, or mm_per_px in [scale]")
    lengths = [number * px_per_mm for number in numbers_of(found[1], float)]
    if not all(abs(px) < 1e9 for px in lengths):
        raise NotAllowed("a length within the picture")
    values = [round(px) if check.length == "whole px" else px for px in lengths]
    return values if len(values) > 1 else values[0]


def choice(*allowed: str) -> Check:
    """One of a few words."""

    def accept(value: Any) -> str:
        if value not in allowed:
            raise NotAllowed(Message("one of ") + ", ".join(repr(word) for word in allowed))
        return str(value)

    return Check(accept, words=allowed)


def _text(value: Any) -> str:
    if not isinstance(value, str) or "\0" in value:
        raise NotAllowed("a text in quotes, without a zero byte")
    return value


def _camera_address(value: Any) -> str:
    return as_typed(_text(value))


def _load_address(value: Any) -> str:
    return "none:" if _text(value).strip().lower() == "none" else _text(value)


def _listen_address(value: Any) -> str:
    try:
        ListenAddress.parse(_text(value))
    except ValueError as allowed:
        raise NotAllowed(str(allowed)) from None
    return str(value)


def _flag(value: Any) -> bool:
    if not isinstance(value, bool):
        raise NotAllowed("true or false")
    return value


def _box(value: Any) -> tuple[int, int, int, int]:
    if not isinstance(value, list | tuple) or len(value) != 4 or not all(type(v) is int for v in value):
        raise NotAllowed("four whole numbers: x, y, width, height in px")
    x, y, width, height = value
    if x < 0 or y < 0 or width < 1 or height < 1:
        raise NotAllowed("x and y from 0, width and height from 1 (px)")
    return x, y, width, height


def numbers_of(text: str, kind: type[Number], count: int = 0, mark: str = ",") -> list[Number]:
    """The finite numbers between ``mark``; raises ValueError where they are others, or not ``count`` (0: any)."""
    found = [kind(part) for part in text.lower().split(mark)]
    if count not in (0, len(found)) or not all(math.isfinite(one) for one in found):
        raise ValueError(f"give {count} numbers")
    return found


def _read_box(word: str) -> list[int]:
    return numbers_of(word, int, 4)


def _rectangle(value: Any) -> tuple[float, float, float, float]:
    if not isinstance(value, list | tuple) or len(value) != 4 or not all(_finite(v) for v in value):
        raise NotAllowed("four numbers: x, y, width, height in px")
    x, y, width, height = (float(v) for v in value)
    if x < 0 or y < 0 or width <= 0 or height <= 0:
        raise NotAllowed("x and y from 0, width and height above 0 (px)")
    return x, y, width, height


def _region(value: Any) -> tuple[int, int, int, int] | str:
    if value in REGIONS:
        return str(value)
    try:
        return _box(value)
    except NotAllowed as allowed:
        raise NotAllowed("{allowed}; or {listed}", allowed, " or ".join(map(repr, REGIONS))) from None


def _read_region(word: str) -> list[int] | str:
    return word if word in REGIONS else _read_box(word)


def _record_mode(value: Any) -> str:
    try:
        return RecordMode.parse(_text(value)).text()
    except ConfigError:
        raise NotAllowed(RECORD_MODES) from None


def _point(value: Any) -> tuple[float, float]:
    if not isinstance(value, list | tuple) or len(value) != 2 or not all(_finite(v) for v in value):
        raise NotAllowed("two numbers: x, y in px")
    return float(value[0]), float(value[1])


def _finite(value: Any) -> bool:
    return type(value) in (int, float) and abs(value) < 1e6


def _corners(value: Any) -> tuple[tuple[float, float], ...]:
    if not isinstance(value, list | tuple) or not 3 <= len(value) <= 100:
        raise NotAllowed("3 to 100 corners [x, y], px")
    return tuple(_point(corner) for corner in value)


def _strains(value: Any) -> tuple[float, float]:
    if (
        not isinstance(value, list | tuple)
        or len(value) != 2
        or any(type(v) not in (int, float) for v in value)
    ):
        raise NotAllowed("two strains, from and to, as [0.0005, 0.0025]")
    low, high = float(value[0]), float(value[1])
    if not 0 <= low < high <= 1:
        raise NotAllowed("two strains with 0 <= from < to <= 1")
    return low, high


def _sign(value: Any) -> int:
    if type(value) is not int or abs(value) != 1:
        raise NotAllowed("1 or -1")
    return value


def _size(value: Any) -> tuple[int, int]:
    if not isinstance(value, list | tuple) or len(value) != 2:
        raise NotAllowed("two whole numbers: width, height in px")
    return as_integer(value[0], 1, 10**6), as_integer(value[1], 1, 10**6)


def _covariance(value: Any) -> tuple[tuple[float, ...], ...]:
    rows = value if isinstance(value, list | tuple) else ()
    if len(rows) != LENS_PARAMETERS or any(
        not isinstance(row, list | tuple) or len(row) != LENS_PARAMETERS for row in rows
    ):
        raise NotAllowed("{LENS_PARAMETERS} rows of {LENS_PARAMETERS} numbers", LENS_PARAMETERS)
    found = tuple(tuple(as_number(one, -1e18, 1e18) for one in row) for row in rows)
    for i, row in enumerate(found):
        for j, one in enumerate(row[:i]):
            most = math.sqrt(abs(row[i] * found[j][j])) * (1 + 1e-6)
            if abs(one - found[j][i]) > 1e-6 * most or abs(one) > most:
                raise NotAllowed(
                    "a covariance: the same on both sides of the diagonal, and no correlation beyond 1"
                )
        if row[i] < 0:
            raise NotAllowed("a covariance: no variance below 0")
    return found


def _names(value: Any) -> tuple[str, ...]:
    if not isinstance(value, list | tuple) or not 1 <= len(value) <= 64:
        raise NotAllowed("1 to 64 names in brackets")
    return tuple(_text(name) for name in value)


def _addresses(value: Any) -> tuple[str, ...]:
    given = [value] if isinstance(value, str) else value
    if not isinstance(given, list | tuple) or len(given) > MAX_BESIDE:
        raise NotAllowed(
            "an address or a rig file in quotes, or up to {MAX_BESIDE} of them in brackets", MAX_BESIDE
        )
    return tuple(_text(one) for one in given)


ADDRESSES = Check(_addresses)
"""Of further cameras: one, or several in brackets."""
COVARIANCE = Check(_covariance)
"""Of the parameters of a lens."""
SIGN = Check(_sign, int)
SIZE = Check(_size)
"""width, height in px."""
TEXT = Check(_text)
NAMES = Check(_names, lambda word: word.split(","))
"""Names; on the command line separated by commas."""
CAMERA_ADDRESS = Check(_camera_address)
"""Of a camera or pictures, which may have been dropped with quotes."""
LOAD_ADDRESS = Check(_load_address)
"""Of a load cell: none is none: too."""
LISTEN_ADDRESS = Check(_listen_address)
"""PORT or HOST:PORT of a server."""
ORDERS = Check(lambda value: SOCKET if value == SOCKET else _listen_address(value))
"""Of a server, or the word for a unix socket."""
FLAG = Check(_flag)
BOX = length(Check(_box, _read_box), whole=True)
"""x, y, width, height in whole px."""
RECTANGLE = length(Check(_rectangle))
"""x, y, width, height in px."""
STRAINS = Check(_strains)
"""An interval of strains."""
POINT = length(Check(_point))
"""x, y in px."""
CORNERS = length(Check(_corners))
"""x, y in px of each corner of a polygon."""
REGION = length(Check(_region, _read_region), whole=True)
"""A box, or one of ``REGIONS``."""
RECORD_MODE = Check(_record_mode)
