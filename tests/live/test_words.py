"""Languages: entries from .po files, messages filled in with them, English where there is nothing."""

from __future__ import annotations

import argparse
import ast
import json
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from babel.messages.extract import extract

from acquire.errors import ConfigError
from acquire.events import Event, EventKind
from acquire.settings import settings_of
from acquire.text import Message
from acquire.text.message import FIELD, about, fields, from_json, joined, word
from analysis.evaluate import GAUGE_KINDS
from live.commands.arguments import COMMANDS, EXAMPLES, full_parser, parse
from live.pipeline.event_log import sentence
from live.results.maps.painting import FIELD_MAPS
from live.results.quantities import KNOWN as QUANTITIES
from live.results.report.record import FIGURES
from live.setup.devices import camera_settings, load_settings
from live.ui.web.broadcaster import json_bytes
from live.words import language
from live.words.language import LANGUAGES, entries, parsed, said
from tests.live.ui.web.browser import ROOT
from tests.live.ui.web.page_texts import of_the_page

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
    assert said(about("a", Message('still "waiting"')), "de") == "a: wartet"


NAMES = ("file", "Run", "stress", "ok", "camera", "operator", "none", "Datei")
"""What a user may call a camera, a file, a gauge, a column, or be called."""


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("in_language", LANGUAGES)
def test_a_name_like_a_text_of_the_program_stays(in_language: str, name: str) -> None:
    """Whatever says it: messages and errors, joined texts, events, also as a file or the page gets them."""
    texts = [
        about(name, Message("{name} lost", name)),
        joined(", ", (name, Message("{name} lost", name))),
        ConfigError("{path}: cannot be read ({error}); give a text file in TOML", Path(name), name).text,
        sentence(Event(0.0, EventKind.NOTE, f"v4l2:{name}", Message("{text} ({count} times)", name, 2))),
    ]
    for text in texts:
        assert isinstance(text, Message)
        words = said(text, in_language)
        assert words != str(text) and name in re.split(r"[ :,(]+", words.replace("v4l2:", " ")), words
        assert said(from_json(json.loads(json_bytes(text))), in_language) == words
    assert said(about(name, name), in_language) == f"{name}: {name}"


def test_a_word_of_the_program_is_translated_among_others() -> None:
    text = about(word("camera"), ValueError("no load cell"))
    assert said(text, "de") == "Kamera: keine Kraftmessdose" == said(from_json(text.to_json()), "de")
    assert word("{a} m") == "{a} m" and not isinstance(word("{a} m"), Message)
    assert Message(text) is text


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


# Calls whose texts are for people, and which of their arguments are: what ``pybabel extract -k`` takes.
KEYWORDS: dict[str, Any] = {
    "Message": None, "refusal": None, "Spoken": None, "PhasedicError": None, "ConfigError": None, "DataError": None,
    "DeviceError": None, "MachineUnfit": None, "Interrupted": None, "ControlRefused": None, "NotAllowed": None,
    "NotACamera": None, "DeviceFault": None, "GenicamError": None, "MachineError": None, "TooLittleMemory": None,
    "bad_value": None, "WireError": None,
}  # fmt: skip
FIELDS = re.compile(r"\{(\w+)[:}]")
PACKAGES = ("acquire", "analysis", "hw_mocks", "live")


@cache
def modules(*packages: str) -> dict[Path, ast.Module]:
    """What is written in the modules of packages."""
    paths = (path for package in packages for path in sorted((ROOT / package).rglob("*.py")))
    return {path: ast.parse(path.read_text("utf-8")) for path in paths}


def name_of(call: ast.Call) -> str:
    return getattr(call.func, "id", getattr(call.func, "attr", ""))


def put_together(tree: ast.Module) -> list[int]:
    """Lines where a text for people is put together on the spot, so that it has no entry; ``counted`` may."""
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call) and node.args]
    spoken = [call for call in calls if name_of(call) in {*KEYWORDS, "ArgumentTypeError"} - {"Message"}]
    return [
        call.lineno for call in spoken if any(isinstance(a, ast.JoinedStr) for a in ast.walk(call.args[0]))
    ]


def test_no_error_is_put_together() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{line}"
        for path, tree in modules(*PACKAGES).items()
        for line in put_together(tree)
    ]
    assert not found, 'as ConfigError("{path}: no such file", path)'


@pytest.mark.parametrize(
    ("code", "count"),
    [
        ("DataError(f'{path}: gone')", 1),
        ("raise argparse.ArgumentTypeError(f'{word}: give a number' if kind else str(error))", 1),
        ("DataError('{path}: gone', path)", 0),
        ("DataError('{path}: gone', f'{folder}/{name}')", 0),
    ],
)
def test_errors_that_are_put_together_are_found(code: str, count: int) -> None:
    assert len(put_together(ast.parse(code))) == count


@cache
def templates() -> dict[str, str]:
    """All messages of the program, with the place of each."""
    found: dict[str, str] = {}
    for path in modules(*PACKAGES):
        with path.open("rb") as file:
            for line, text, *_ in extract("python", file, KEYWORDS):
                found.setdefault(str(text), f"{path.relative_to(ROOT)}:{line}")
    return {text: place for text, place in found.items() if re.search("[A-Za-z]{2}", FIELDS.sub("", text))}


@pytest.mark.parametrize("name", LANGUAGES)
def test_every_message_is_translated(name: str) -> None:
    known = entries(name)
    assert len(templates()) > 800
    missing = {f"{place}: {text}" for text, place in templates().items() if text not in known}
    assert not missing, "give each an entry in live/words/*.po"


@pytest.mark.parametrize("name", LANGUAGES)
def test_every_text_of_the_page_is_translated(name: str) -> None:
    served = {word for kind in GAUGE_KINDS.values() for word in (kind.label, kind.hint)}
    served |= {str(kind) for kind in EventKind}
    served |= {one.words for one in QUANTITIES.values() if not isinstance(one.words, Message)}
    served |= {
        one.words
        for kind in (*camera_settings().values(), *load_settings().values())
        for one in settings_of(kind)
    }
    served |= {words for _, _, words in FIGURES} | {item for item, _, _ in practice_rows()}
    assert not {text for text in {*of_the_page(), *FIELD_MAPS, *served} if text not in entries(name)}


@pytest.mark.parametrize("name", LANGUAGES)
def test_a_translation_has_the_fields_of_its_text_and_stands_for_one_that_is_there(name: str) -> None:
    known = {*templates(), *of_the_page()}
    for english, words in entries(name).items():
        assert set(FIELDS.findall(words)) == set(FIELDS.findall(english)), english
        made_of_words = "{n} "  # ``counted`` puts a noun behind
        assert not FIELDS.search(english) or english in known or english.startswith(made_of_words), english


def nouns() -> set[str]:
    """What ``counted`` is given as a word; the nouns of consumers and levels come as variables."""
    calls = (
        node
        for tree in modules("acquire", "live").values()
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
    )
    words = (call.args[1] for call in calls if name_of(call) == "counted" and len(call.args) == 2)
    return {str(word.value) for word in words if isinstance(word, ast.Constant)}


@pytest.mark.parametrize("name", LANGUAGES)
def test_what_is_counted_has_one_and_many_in_each_language(name: str) -> None:
    found = nouns()
    assert len(found) > 5
    assert not {noun for noun in found for end in ("", "s") if f"{{n}} {noun}{end}" not in entries(name)}


def helps(parser: argparse.ArgumentParser) -> Iterator[str]:
    """All texts of a parser and those of its commands: descriptions line by line, headings, helps."""
    for text in (parser.description, parser.epilog):
        yield from (text or "").splitlines()
    for group in parser._action_groups:
        yield from filter(None, (group.title, group.description))
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            yield from (str(one.help) for one in action._choices_actions)
            for one in action.choices.values():
                yield from helps(one)
        elif action.help:
            yield action.help


@pytest.mark.parametrize("name", LANGUAGES)
def test_every_help_is_translated(name: str) -> None:
    known, texts = entries(name), set(helps(full_parser(COMMANDS)))
    texts |= {part for text in texts if isinstance(text, Message) for part in text.values.values()}
    words = {text for text in texts if not isinstance(text, Message) or not text.values}
    assert len(words) > 200
    examples = {f"  {line}" for line in EXAMPLES.values()}
    assert not {one for one in words - examples if " " in one.strip() and one not in known}


@pytest.mark.parametrize("name", LANGUAGES)
def test_the_help_of_a_command_speaks_the_language_of_the_terminal(
    name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("LC_ALL", f"{name}.UTF-8")
    with pytest.raises(SystemExit):
        parse(["run", "--help"])
    shown = " ".join(capsys.readouterr().out.split())
    for text in (
        "exit codes:",
        "measure at once, but record only after the start command",
        "side of a ZOI, px",
    ):
        assert text not in shown and " ".join(said(text, name).split()) in shown


def test_every_field_has_a_value() -> None:
    """Of each message that is written down with its values."""
    for path, tree in modules(*PACKAGES).items():
        for node in ast.walk(tree):
            if not isinstance(node, ast.Call) or name_of(node) not in KEYWORDS or not node.args:
                continue
            text = getattr(node.args[0], "value", None)
            spread = any(isinstance(one, ast.Starred) for one in node.args)
            if isinstance(text, str) and not spread and not any(one.arg is None for one in node.keywords):
                given = len(node.args) - 1 + len(node.keywords)
                want = len(fields(text)) if given or name_of(node) == "Message" else 0
                assert given == want, f"{path}:{node.lineno}: {text}"


def practice_rows() -> list[tuple[str, str, str]]:
    tree = modules("live")[ROOT / "live" / "results" / "report" / "record.py"]
    nodes = (node for one in tree.body if isinstance(one, ast.FunctionDef) for node in ast.walk(one))
    rows = (node for node in nodes if isinstance(node, ast.Tuple) and len(node.elts) == 3)
    heads = [tuple(getattr(one, "value", "") for one in row.elts) for row in rows]
    found = [row for row in heads if isinstance(row[0], str) and row[0][:1].isupper()]
    assert len(found) > 20
    return found


HOLD_MESSAGES = ("why", "words", "remark", "reason", "refused", "apart", "state", "doing", "trouble", "text")
TAKE_APART = ("partition", "rpartition", "split", "startswith", "endswith", "removeprefix", "removesuffix",
              "replace")  # fmt: skip


def test_no_text_for_people_is_taken_apart() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{line}: {code}"
        for path, tree in modules("live").items()
        for line, code in taken_apart(tree)
    ]
    assert not found, "give what is asked for a field of its own"


@pytest.mark.parametrize(
    ("code", "count"),
    [
        ("row.why.startswith('not')", 1),
        ("mark.words.partition(' = ')[0]", 1),
        ("'PAUSED' in s.state", 1),
        ("s.state in ('a', 'b')", 0),
        ("re.match('x', figure.why)", 1),
        ("try: f()\nexcept OSError as error: str(error).replace('a', 'b')", 1),
        ("try: f()\nexcept OSError as error: '--lag' in error.text", 1),
        ("given.startswith('a')", 0),
    ],
)
def test_texts_that_are_taken_apart_are_found(code: str, count: int) -> None:
    assert len(list(taken_apart(ast.parse(code)))) == count


def taken_apart(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Lines and code where a message, or the text of an error, is searched or cut."""
    errors = {node.name for node in ast.walk(tree) if isinstance(node, ast.ExceptHandler)}

    def holds(node: ast.AST) -> bool:
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "str" and node.args:
            return isinstance(node.args[0], ast.Name) and node.args[0].id in errors
        return isinstance(node, ast.Attribute) and node.attr in HOLD_MESSAGES

    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            of = node.func.value
            cut = node.func.attr in TAKE_APART and holds(of)
            if cut or (ast.unparse(of) == "re" and any(map(holds, node.args))):
                yield node.lineno, ast.unparse(node)
        elif (
            isinstance(node, ast.Compare)
            and isinstance(node.ops[0], ast.In | ast.NotIn)
            and holds(node.comparators[0])
        ):
            yield node.lineno, ast.unparse(node)


@pytest.mark.parametrize("language", ["", *LANGUAGES])
def test_a_message_is_short(language: str) -> None:
    """What happened, to what, what to do next; a field counts as it is mostly filled in."""
    texts = entries(language).values() if language else templates()
    found = [text for text in texts if len(FIELD.sub("123", text)) > (200 if language else 160)]
    assert not found, "say it in 160 characters; the manual stands in docs"
