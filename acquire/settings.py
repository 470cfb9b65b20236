"""The settings of an address, declared like the keys of the configuration: check, default, help and unit.

A kind of device has one class of its settings, a field each. Reading an address, what is refused, ``phasedic devices
--settings`` and the tables of the documents follow from it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, fields
from typing import Any, TypeVar

from acquire.addresses import Address, Options
from acquire.bounds import NotAllowed, integer_of, number_of, one_of, yes_or_no
from acquire.errors import ConfigError

Settings = TypeVar("Settings")
Check = Callable[[str], Any]
"""Makes a value of the word of an address; raises ``NotAllowed``."""
OTHERS = "others"

FLAG: Check = yes_or_no
TEXT: Check = str


@dataclass(frozen=True, slots=True)
class Setting:
    """A declared setting.

    Attributes
    ----------
    key : str
    check : Check
    default : object
    words : str
        Its meaning.
    unit : str
    """

    key: str
    check: Check
    default: Any
    words: str
    unit: str

    @property
    def allowed(self) -> str:
        """What it may be, in words; "" for any text."""
        try:
            self.check("")
        except NotAllowed as allowed:
            return str(allowed)
        return ""

    @property
    def plain_default(self) -> str:
        """Its default as an address has it; "" where there is none."""
        if isinstance(self.default, bool):
            return "yes" if self.default else "no"
        return "" if self.default is None else str(self.default)

    @property
    def stands(self) -> str:
        """Its default in words; "" where there is none."""
        return f"default {self.plain_default}" if self.plain_default else ""


def number(low: float = -math.inf, high: float = math.inf) -> Check:
    """A number within bounds."""
    return lambda word: number_of(word, low, high)


def whole(low: float = -math.inf, high: float = math.inf) -> Check:
    """A whole number within bounds."""
    return lambda word: integer_of(word, low, high)


def choice(*allowed: str) -> Check:
    """One of a few words."""
    return lambda word: one_of(word, allowed)


def setting(check: Check, default: Any, words: str, unit: str = "") -> Any:
    """A field that is the setting of its own name."""
    return field(default=default, metadata={"setting": (check, words, unit)})


def others(check: Check, words: str) -> Any:
    """A field with all settings that are no fields, by their names."""
    return field(default_factory=dict, metadata={OTHERS: (check, words)})


def settings_of(kind: type) -> Iterator[Setting]:
    """Those that a class declares, in their order; that of all others last, without a key."""
    for one in fields(kind):
        if "setting" in one.metadata:
            check, words, unit = one.metadata["setting"]
            yield Setting(one.name, check, one.default, words, unit)
        elif OTHERS in one.metadata:
            check, words = one.metadata[OTHERS]
            yield Setting("", check, None, words, "")


def keys_of(kind: type) -> str:
    """The keys that a class declares, for messages."""
    return ", ".join(one.key for one in settings_of(kind) if one.key)


def no_feature(where: str, name: str, kind: type) -> ConfigError:
    """The error of a feature that a camera does not have, beside the settings that ``kind`` declares."""
    return ConfigError(
        "{where}: this camera has no feature {name}; known settings: {known}", where, name, keys_of(kind)
    )


def read_settings(kind: type[Settings], address: Address) -> Settings:
    """The settings of ``address``.

    Raises
    ------
    ConfigError
        An impossible value; an unknown one, unless all others are taken.
    """
    options = Options(address)
    found = take_settings(kind, options)
    options.done()
    return found


def take_settings(kind: type[Settings], options: Options) -> Settings:
    """The settings ``kind`` of an address that may have more; raises ConfigError for an impossible value."""
    address, found = options.address, dict[str, Any]()
    for one in fields(kind):  # type: ignore[arg-type]
        if "setting" in one.metadata:
            found[one.name] = options.read(one.name, one.default, one.metadata["setting"][0])
    for one in fields(kind):  # type: ignore[arg-type]
        if OTHERS in one.metadata:
            keys = [key for key, _ in address.settings if key not in found]
            found[one.name] = {key: options.read(key, "", one.metadata[OTHERS][0]) for key in keys}
    return kind(**found)
