"""What the JSON in a file must hold, as data, and the check of it."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from acquire.errors import DataError
from acquire.hdf5.tables import as_text


@dataclass(frozen=True, slots=True)
class JsonField:
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
        value = json.loads(as_text(text))
    except (ValueError, RecursionError) as error:
        raise DataError(
            "{where} is not JSON ({error}); the file is damaged, or not of phasedic", where, error
        ) from error
    if not isinstance(value, dict):
        raise DataError("{where} is not a JSON object; this is not a file as phasedic writes it", where)
    return value


def check_object(value: Mapping[str, Any], form: Mapping[str, JsonField], where: str) -> None:
    """Refuse an object whose values are not of ``form``; others than those are let be.

    Raises
    ------
    DataError
    """
    for name, declared in form.items():
        if not declared.takes(value.get(name)):
            shown = repr(value.get(name))[:60]
            raise DataError(
                "{where}: {name} is {shown}; this is not a file as phasedic writes it",
                where,
                repr(name),
                shown,
            )
