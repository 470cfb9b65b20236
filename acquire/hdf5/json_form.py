"""JSON that stands in a file, read as what it must be."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from acquire.errors import DataError
from acquire.hdf5.nexus import word


@dataclass(frozen=True, slots=True)
class Said:
    """What a value must be.

    Attributes
    ----------
    kind : type
        str, bool, int, float (which whole numbers are too), dict or list.
    low, high : float
        Range of a number, ends included; not a number is outside.
    missing : bool
        Whether it may be left out or null.
    words : tuple of str
        The texts that are allowed; empty: any.
    """

    kind: type
    low: float = -math.inf
    high: float = math.inf
    missing: bool = False
    words: tuple[str, ...] = ()

    def takes(self, value: Any) -> bool:
        """Whether ``value`` is so."""
        if value is None:
            return self.missing
        if self.kind in (int, float):
            number = isinstance(value, int) if self.kind is int else isinstance(value, int | float)
            return (
                number and not isinstance(value, bool) and self.low <= value <= self.high and _finite(value)
            )
        return isinstance(value, self.kind) and (not self.words or value in self.words)


def _finite(value: float) -> bool:
    return isinstance(value, int) or math.isfinite(value)


def read_object(text: Any, where: str) -> dict[str, Any]:
    """The JSON object that stands in ``text``.

    Raises
    ------
    DataError
        It is none.
    """
    try:
        value = json.loads(word(text))
    except (ValueError, RecursionError) as error:
        raise DataError(f"{where} is not JSON ({error}); the file is damaged, or not of phasedic") from error
    if not isinstance(value, dict):
        raise DataError(f"{where} is not a JSON object; this is not a file as phasedic writes it")
    return value


def check_object(value: Mapping[str, Any], form: Mapping[str, Said], where: str) -> None:
    """Refuse an object whose values are not of ``form``; others than those are let be.

    Raises
    ------
    DataError
    """
    for name, said in form.items():
        if not said.takes(value.get(name)):
            shown = repr(value.get(name))[:60]
            raise DataError(f"{where}: {name!r} is {shown}; this is not a file as phasedic writes it")
