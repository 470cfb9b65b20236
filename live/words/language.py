"""Entries of a language, and messages in it.

The files are those of GNU gettext (``de.po``: English ``msgid``, German ``msgstr``). A missing or broken file, and a
text without an entry, give English. The page loads the same entries (``/words/de.json``) and fills them itself.
"""

from __future__ import annotations

import ast
import logging
import os
from collections.abc import Mapping
from functools import cache
from numbers import Real
from pathlib import Path
from typing import Any

from acquire.text import Amount, Message
from acquire.text.message import filled, formatted
from acquire.text.quantity import decimal_mark

log = logging.getLogger(__name__)

LANGUAGES = ("de", "fr")
"""Beside English."""
_OF_PROCESS = ("LC_ALL", "LC_MESSAGES", "LANG")
FOLDER = Path(__file__).parent


@cache
def entries(language: str) -> Mapping[str, str]:
    """English text or template -> that of the language; empty for English, and where the file cannot be read."""
    if language not in LANGUAGES:
        return {}
    try:
        return parsed((FOLDER / f"{language}.po").read_text("utf-8"))
    except (OSError, ValueError, SyntaxError) as error:
        log.warning("%s.po: %s; texts stay English", language, error)
        return {}


def parsed(text: str) -> dict[str, str]:
    """The entries of a .po file; those without a translation are left out.

    Raises
    ------
    ValueError, SyntaxError
        It is none.
    """
    found: dict[str, dict[str, str]] = {}
    entry: dict[str, str] = {}
    key = ""
    for line in text.splitlines():
        if line.startswith("msg"):
            key, _, word = line.partition(" ")
            if key == "msgid":
                entry = {}
            entry[key] = _unquoted(word)
        elif line.startswith('"'):
            entry[key] += _unquoted(line)
        elif line.strip() and not line.startswith("#"):
            raise ValueError(f"{line[:40]!r} is no line of such a file")
        if "msgstr" in entry:
            found[entry.get("msgid", "")] = entry
    return {english: one["msgstr"] for english, one in found.items() if english and one["msgstr"]}


def _unquoted(word: str) -> str:
    value = ast.literal_eval(word)
    if not isinstance(value, str):
        raise ValueError(f"{word[:40]!r} is no text")
    return value


def of_terminal() -> str:
    """The language of the terminal, from the variables of POSIX; English where there are no entries of it."""
    given = next((value for name in _OF_PROCESS if (value := os.environ.get(name))), "")[:2]
    return given if given in LANGUAGES else "en"


def said_here(text: str) -> str:
    """A text in the language of the terminal."""
    return said(text, of_terminal())


def told(text: object, language: str | None = None) -> str:
    """A message or quantity in a language, else that of the terminal; names and other texts as they are."""
    language = language or of_terminal()
    if isinstance(text, Amount):
        return str(text.printed(language))
    return said(text, language) if isinstance(text, Message) else str(text)


def said(text: str, language: str) -> str:
    """A text of the program in a language: its template translated, and its values filled in.

    Messages among the values are translated likewise; names, which are plain texts, stay.
    """
    words = entries(language)
    if not words:
        return str(text)
    if not isinstance(text, Message):
        return words.get(text, text)

    def shown(value: Any, spec: str) -> str:
        if isinstance(value, str):
            return format(told(value, language), spec)
        if isinstance(value, Amount):
            return str(value.printed(language))
        number = formatted(value, spec)
        return number.replace(".", decimal_mark(language)) if isinstance(value, Real) else number

    try:
        return filled(words.get(text.template, text.template), text.values, shown)
    except (KeyError, ValueError):
        log.debug("%s: %r has other fields", language, text.template)
        return str(text)
