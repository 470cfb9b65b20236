"""Values within bounds, wherever they come from: an address, a configuration, the page, a profile."""

from __future__ import annotations

import math
from collections.abc import Sequence

from acquire.errors import ConfigError, Spoken
from acquire.text import Message

TRUE_WORDS, FALSE_WORDS = ("1", "yes", "true", "on"), ("0", "no", "false", "off")


class NotAllowed(Spoken, ValueError):
    """A value is not possible; the text is what is allowed. The caller adds the key and the value."""


def as_number(value: object, low: float = -math.inf, high: float = math.inf) -> float:
    """A number from ``low`` to ``high``, never NaN and no boolean; raises ``NotAllowed``."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise NotAllowed("a number{between}", _between(low, high))
    try:
        return float(value)
    except OverflowError:
        raise NotAllowed("a number{between} of fewer digits", _between(low, high)) from None


def as_integer(value: object, low: float = -math.inf, high: float = math.inf) -> int:
    """A whole number from ``low`` to ``high``, and no boolean; raises ``NotAllowed``."""
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise NotAllowed("a whole number{between}", _between(low, high))
    return value


def number_of(word: str, low: float = -math.inf, high: float = math.inf) -> float:
    """The finite number that ``word`` is, within bounds; raises ``NotAllowed``."""
    try:
        number = float(word)
    except ValueError:
        number = math.nan
    return as_number(math.nan if math.isinf(number) else number, low, high)


def integer_of(word: str, low: float = -math.inf, high: float = math.inf) -> int:
    """The whole number that ``word`` is, within bounds; raises ``NotAllowed``."""
    try:
        number: int | None = int(word)
    except ValueError:
        number = None
    return as_integer(number, low, high)


def one_of(word: str, allowed: Sequence[str]) -> str:
    """``word``, where it is one of ``allowed``; raises ``NotAllowed``."""
    if word not in allowed:
        raise NotAllowed(Message("one of ") + ", ".join(allowed))
    return word


def other_than_zero(word: str) -> float:
    """The number that ``word`` is, and not zero; raises ``NotAllowed``."""
    try:
        number = number_of(word)
    except NotAllowed:
        number = 0.0
    if number == 0:
        raise NotAllowed("a number other than zero")
    return number


def positive(word: str) -> float:
    """The finite number above zero that ``word`` is; raises ``NotAllowed``."""
    try:
        number = number_of(word, 0)
    except NotAllowed:
        number = 0.0
    if number == 0:
        raise NotAllowed("a number above 0")
    return number


def yes_or_no(word: str) -> bool:
    """Whether ``word`` says yes; raises ``NotAllowed``."""
    if word.lower() not in TRUE_WORDS + FALSE_WORDS:
        raise NotAllowed("yes or no")
    return word.lower() in TRUE_WORDS


def in_steps(low: int, high: int, step: int) -> str:
    """The whole numbers that a device takes, in words."""
    steps = Message(" in steps of {step}", step) if step > 1 else ""
    return Message("{low} to {high}{steps}", low, high, steps)


def not_possible(where: object, key: str, value: object, allowed: object) -> ConfigError:
    """The error of a setting whose value is none of what is ``allowed``; ``where`` is its address."""
    return ConfigError(
        "{where}: {key}={value} is not possible; allowed: {allowed}", where, key, value, allowed
    )


def not_kept(where: object, key: str, value: object, got: object) -> ConfigError:
    """The error of a setting of which the camera makes something else."""
    return ConfigError(
        "{where}: {key}={value}: the camera makes it {got}; ask for that", where, key, value, got
    )


def same_value(got: str, asked: str) -> bool:
    """Whether a device has in force what was asked of it: numbers to 1e-4 of their value, words in any case."""
    try:
        return abs(float(got) - float(asked)) <= 1e-4 * abs(float(asked))
    except ValueError:
        return got.lower() == asked.lower()


def _between(low: float, high: float) -> str:
    start = "" if low == -math.inf else Message(" from {shown}", _shown(low))
    return start if high == math.inf else Message("{start} to {shown}", start, _shown(high))


def _shown(bound: float) -> str:
    return str(bound) if isinstance(bound, int) else f"{bound:g}"
