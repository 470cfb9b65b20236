"""Languages: entries from .po files, messages filled in with them, English where there is nothing."""

from __future__ import annotations

from pathlib import Path

import pytest

from acquire.text import Message
from acquire.text.message import about
from live.words import language
from live.words.language import entries, of_environment, parsed, said

PO = r"""
# a comment
msgid ""
msgstr "Content-Type: text/plain; charset=UTF-8\n"

#: acquire/camera/live.py:1
msgid "no picture for {waited:.1f} s"
msgstr "seit {waited:.1f} s "
"kein Bild"

msgid "still \"waiting\""
msgstr "wartet"

msgid "not yet"
msgstr ""
"""


@pytest.fixture
def german(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    monkeypatch.setattr(language, "FOLDER", tmp_path)
    entries.cache_clear()
    monkeypatch.setattr(language, "entries", entries.__wrapped__)
    (tmp_path / "de.po").write_text(PO, "utf-8")
    return tmp_path / "de.po"


def test_a_file_is_read() -> None:
    assert parsed(PO) == {
        "no picture for {waited:.1f} s": "seit {waited:.1f} s kein Bild",
        'still "waiting"': "wartet",
    }


def test_a_message_is_said_in_a_language_with_its_numbers_and_parts(german: Path) -> None:
    text = about("/dev/video0", Message("no picture for {waited:.1f} s", waited=2.13))
    assert said(text, "de") == "/dev/video0: seit 2,1 s kein Bild"
    assert said('still "waiting"', "de") == "wartet"
    assert said(text, "en") == str(text) and said("not yet", "de") == "not yet"
    assert said(about("a", 'still "waiting"'), "de") == "a: wartet"


@pytest.mark.parametrize("content", ["msgid 1\n", "hello\n", 'msgid "a\n', None])
def test_a_broken_or_missing_file_leaves_english(german: Path, content: str | None) -> None:
    if content is None:
        german.unlink()
    else:
        german.write_text(content, "utf-8")
    assert said(Message("no picture for {waited:.1f} s", waited=2.0), "de") == "no picture for 2.0 s"


def test_an_entry_with_other_fields_leaves_english(german: Path) -> None:
    german.write_text('msgid "{a} m"\nmsgstr "{b} m"\n', "utf-8")
    assert said(Message("{a} m", a=1), "de") == "1 m"


@pytest.mark.parametrize(
    ("environ", "name"),
    [
        ({"LANG": "de_DE.UTF-8"}, "de"),
        ({"LANG": "de_DE", "LC_ALL": "fr_FR"}, "fr"),
        ({"LC_MESSAGES": "C", "LANG": "de_DE"}, "en"),
        ({"LANG": "pl_PL"}, "en"),
        ({}, "en"),
    ],
)
def test_the_language_is_that_of_the_environment(environ: dict[str, str], name: str) -> None:
    assert of_environment(environ) == name
