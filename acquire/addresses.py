"""Addresses name devices and carry their settings: ``scheme:target?key=value&key=value``.

``parse_address`` splits them, ``Options`` hands out the settings with their types and bounds and
refuses unknown ones, ``Registry`` finds who opens a scheme. Devices of other packages
register through the entry point groups ``phasedic.cameras`` and ``phasedic.load_cells``, whose
entries are openers named after their scheme; what lists the devices of a scheme stands in a group of its own.
"""

from __future__ import annotations

import importlib
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, Generic, TypeVar, overload
from urllib.parse import quote, unquote

from acquire.bounds import NotAllowed, integer_of, not_possible, number_of, one_of, yes_or_no
from acquire.errors import ConfigError
from acquire.events import EventSink, ignore_event
from acquire.text import Message, meant

# A glob may hold a question mark too: settings are the last one followed by key=value pairs, whose values have none
# unless they are a pattern or what a device says and takes.
_PAIR = r"(?:(?:pattern|unstable|overload|underload|error|poll)=[^&]*|[A-Za-z_]\w*=[^&?]*)"
_SETTINGS = re.compile(rf"\?({_PAIR}(?:&{_PAIR})*)$")
_SCHEME = re.compile(r"^([A-Za-z][\w+.-]+):")

Value = TypeVar("Value")
_SAFE = "/:,@+-_.*~"  # in the value of a setting

RECORDING = "session.h5"

Device = TypeVar("Device")


@dataclass(frozen=True, slots=True)
class Address:
    """An address taken apart.

    Attributes
    ----------
    text : str
        As it was given.
    scheme : str
        "" for a bare path such as ``/dev/video0``.
    target : str
        What stands between the scheme and the settings.
    settings : tuple of (key, value)
    """

    text: str
    scheme: str
    target: str
    settings: tuple[tuple[str, str], ...]


def parse_address(text: str) -> Address:
    """Take an address apart; what is the name of an existing file or folder has no settings.

    Raises
    ------
    ConfigError
        An empty address, or a key given twice.
    """
    if not text.strip():
        raise ConfigError("an address is empty; give for example sim:, /dev/video0 or files:shots/*.tif")
    body, given = _apart(text)
    pairs = [pair.partition("=") for pair in given.split("&")] if given else []
    settings = tuple((key, unquote(value)) for key, _, value in pairs)
    if len({key for key, _ in settings}) < len(settings):
        raise ConfigError("{text}: a setting is given twice; give each once", text)
    scheme = _SCHEME.match(body)
    if not scheme:
        return Address(text, "", body, settings)
    return Address(text, scheme[1].lower(), body[scheme.end() :], settings)


def _apart(text: str) -> tuple[str, str]:
    """An address before its settings, and the settings; a ``?`` of a pattern of names belongs to the first."""
    found = _SETTINGS.search(text)
    return (text, "") if not found or _is_there(text) else (text[: found.start()], found[1])


def _is_there(text: str) -> bool:
    """Whether the address, without its scheme, is the name of a file or folder."""
    scheme = _SCHEME.match(text)
    names = (text, text[scheme.end() :]) if scheme else (text,)
    try:
        return any(Path(name).exists() for name in names)
    except (OSError, ValueError):
        return False


def with_setting(address: str, key: str, value: float | str) -> str:
    """The address with one setting changed; an empty text removes it."""
    changed = dict(parse_address(address).settings)
    body = _apart(address)[0]
    changed[key] = value if isinstance(value, str) else f"{value:g}"
    settings = "&".join(f"{k}={quote(v, safe=_SAFE)}" for k, v in changed.items() if v or k != key)
    return f"{body}?{settings}" if settings else body


def expanded(path: str) -> Path:
    """The path with ``~`` replaced by the home folder.

    Raises
    ------
    ConfigError
        There is no such user.
    """
    try:
        return Path(path).expanduser()
    except RuntimeError:
        raise ConfigError(
            "{path}: there is no such user, so no home folder; give the whole path", path
        ) from None


def as_typed(text: str) -> str:
    """A path that was dropped into a terminal or a field, as it would be typed: without quotes and ``file://``.

    What is the name of a file or folder stays as it is.
    """
    if text.endswith("/") and Path(text).is_file():
        return text.rstrip("/")
    bare = text.strip()
    if _is_there(text) or not bare:
        return text
    if len(bare) > 2 and bare[0] == bare[-1] and bare[0] in "'\"":
        bare = bare[1:-1]
    if bare.startswith("file://"):
        bare = unquote(bare.removeprefix("file://"))
    return bare if bare != text.strip() else text


def session_file(path: Path) -> Path:
    """The session file: that in ``path`` where it is the folder of a run, else ``path``."""
    return path / RECORDING if (path / RECORDING).is_file() else path


class Options:
    """The settings of an address, taken one by one with their types and bounds.

    After the last one ``done()`` refuses what is left and lists what is known.
    """

    def __init__(self, address: Address) -> None:
        self.address = address
        self._left = dict(address.settings)
        self._known: list[str] = []

    @overload
    def text(self, key: str, default: str) -> str: ...
    @overload
    def text(self, key: str, default: None = None) -> str | None: ...
    def text(self, key: str, default: str | None = None) -> str | None:
        """The setting as it stands, or ``default``."""
        self._known.append(key)
        return self._left.pop(key, default)

    def choice(self, key: str, allowed: tuple[str, ...], default: str) -> str:
        """One of ``allowed``."""
        return self.read(key, default, lambda word: one_of(word, allowed))

    @overload
    def number(self, key: str, default: float, *, minimum: float = ..., maximum: float = ...) -> float: ...
    @overload
    def number(
        self, key: str, default: None = None, *, minimum: float = ..., maximum: float = ...
    ) -> float | None: ...
    def number(
        self, key: str, default: float | None = None, *, minimum: float = -math.inf, maximum: float = math.inf
    ) -> float | None:
        """A finite number within bounds, or ``default`` where it is not given."""
        return self.read(key, default, lambda word: number_of(word, minimum, maximum))

    @overload
    def integer(self, key: str, default: int, *, minimum: int = ..., maximum: int = ...) -> int: ...
    @overload
    def integer(
        self, key: str, default: None = None, *, minimum: int = ..., maximum: int = ...
    ) -> int | None: ...
    def integer(
        self, key: str, default: int | None = None, *, minimum: float = -math.inf, maximum: float = math.inf
    ) -> int | None:
        """A whole number within bounds, or ``default`` where it is not given."""
        return self.read(key, default, lambda word: integer_of(word, minimum, maximum))

    def flag(self, key: str, default: bool = False) -> bool:
        """Yes or no."""
        return self.read(key, default, yes_or_no)

    def read(self, key: str, default: Value, check: Callable[[str], Value]) -> Value:
        """What ``check`` makes of the setting, or ``default``; the ``NotAllowed`` that it raises names the setting."""
        self.text(key)
        return self.again(key, default, check)

    def again(self, key: str, default: Value, check: Callable[[str], Value]) -> Value:
        """As ``read``, of a setting that was taken: for a check that depends on others."""
        word = dict(self.address.settings).get(key)
        if word is None:
            return default
        try:
            return check(word)
        except NotAllowed as allowed:
            raise not_possible(self.address.text, key, word, allowed) from None

    def rest(self) -> dict[str, str]:
        """All settings not taken yet, for a scheme with keys of its own choosing."""
        left, self._left = self._left, {}
        return left

    def done(self) -> None:
        """Refuse what is left.

        Raises
        ------
        ConfigError
            Names the unknown key and lists the known ones.
        """
        if self._left:
            first, known = next(iter(self._left)), ", ".join(self._known) or Message("none")
            raise ConfigError(
                "{text}: unknown setting {next}{meant}; known: {known}",
                self.address.text,
                repr(first),
                meant(first, self._known),
                known,
            )


Opener = Callable[[Address, EventSink], Device]


class Registry(Generic[Device]):
    """Which function opens which scheme.

    Parameters
    ----------
    what : str
        "camera" or "load cell", for messages.
    group : str
        Entry point group through which other packages add schemes.
    builtin : mapping of scheme to "module:function"
        Imported when first used, so that asking for help stays fast.
    fallback : str or None
        "module:function" that takes every other scheme (a pyserial URL).
    lists_group : str
        Entry point group of what lists the devices that are there, by scheme; "": none.
    lists : mapping of scheme to "module:function"
        Those of our own; a function without arguments that gives a list.
    settings_group : str
        Entry point group of the classes of settings (``acquire.settings``), by scheme; "": none.
    settings : mapping of scheme to "module:class"
        Those of our own.
    elsewhere : sequence of str
        Schemes that the program opens without this registry; for messages.
    """

    def __init__(
        self,
        what: str,
        group: str,
        builtin: dict[str, str],
        fallback: str | None = None,
        *,
        lists_group: str = "",
        lists: Mapping[str, str] | None = None,
        settings_group: str = "",
        settings: Mapping[str, str] | None = None,
        elsewhere: Sequence[str] = (),
    ) -> None:
        self._elsewhere = elsewhere
        self._what, self._group, self._fallback = what, group, fallback
        self._lists_group, self._lists = lists_group, dict(lists or {})
        self._settings_group, self._settings = settings_group, dict(settings or {})
        self._openers: dict[str, str | Opener[Device]] = dict(builtin)

    def register(self, scheme: str, opener: Opener[Device]) -> None:
        """Add or replace a scheme."""
        self._openers[scheme] = opener

    def schemes(self) -> list[str]:
        """All known schemes, those of other packages included."""
        return sorted({*self._openers, *(entry.name for entry in entry_points(group=self._group))})

    def listers(self) -> Iterator[tuple[str, Callable[[], list[Any]]]]:
        """Scheme, and what lists its devices; our own first. What is not ours is imported when it is called."""
        for scheme, path in self._lists.items():
            yield scheme, lambda path=path: _load(path)()  # type: ignore[misc]
        for entry in sorted(entry_points(group=self._lists_group)):
            yield entry.name, lambda entry=entry: entry.load()()  # type: ignore[misc]

    def settings(self) -> Iterator[tuple[str, type]]:
        """Scheme, and the class of its settings; our own first."""
        for scheme, path in self._settings.items():
            yield scheme, _load(path)
        for entry in sorted(entry_points(group=self._settings_group)):
            yield entry.name, entry.load()

    def open(self, text: str, on_event: EventSink = ignore_event) -> Device:
        """Open what ``text`` names; see ``Camera`` and ``LoadCell`` for what is raised."""
        address = parse_address(text)
        opener = self._openers.get(address.scheme)
        if opener is None:
            for entry in entry_points(group=self._group, name=address.scheme):
                opener = entry.load()
        if opener is None:
            opener = self._fallback
        if opener is None:
            known = ", ".join(
                f"{scheme}:" if scheme else "/dev/..." for scheme in [*self.schemes(), *self._elsewhere]
            )
            raise ConfigError(
                "{text}: no {what} has the scheme {scheme}:{meant}; known: {known}",
                address.text,
                self._what,
                address.scheme,
                meant(address.scheme, [*self.schemes(), *self._elsewhere]),
                known,
            )
        return (_load(opener) if isinstance(opener, str) else opener)(address, on_event)


def _load(path: str) -> Any:
    module, _, name = path.partition(":")
    return getattr(importlib.import_module(module), name)
