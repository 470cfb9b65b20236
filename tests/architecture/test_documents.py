"""The documents describe the code as it is: names, paths, options, tables, and the picture of the packages."""

from __future__ import annotations

import importlib
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from docs import make_formats, make_site
from live import VERSION
from live.commands.arguments import COMMANDS, full_parser
from tests.architecture.layers import PACKAGES
from tests.architecture.links import dead_links
from tests.architecture.quotes import missing, quoted, strings
from tests.architecture.references import dead_in, dead_references, words

ROOT = Path(__file__).parents[2]
PAGES = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *sorted((ROOT / "docs").rglob("*.md")),
    *sorted((ROOT / "examples").rglob("*.md")),
]
PLACES = [*PACKAGES, "tests", "docs", "examples"]


def test_pages_name_what_is_there() -> None:
    dead = [found for page in PAGES for found in dead_references(ROOT, page)]
    assert not dead, "\n" + "\n".join(dead)


def test_links_lead_somewhere() -> None:
    dead = [found for page in [*PAGES, ROOT / "CHANGELOG.md"] for found in dead_links(ROOT, page)]
    assert not dead, "\n" + "\n".join(dead)


@pytest.mark.parametrize(
    ("link", "dead"),
    [
        ("[a](b.md)", False),
        ("![a](b.md#the-second-part)", False),
        ("[a](#here)", False),
        ("[a](https://example.org/gone)", False),
        ("`[a](gone.md)`", False),
        ("[a](gone.md)", True),
        ("[a](b.md#gone)", True),
        ("[a](../../../etc/passwd)", True),
    ],
)
def test_a_dead_link_is_found(tmp_path: Path, link: str, dead: bool) -> None:
    (tmp_path / "b.md").write_text("# B\n\n## The second part\n", encoding="utf-8")
    (tmp_path / "a.md").write_text(f"# Here\n\n{link}\n", encoding="utf-8")
    assert bool(list(dead_links(tmp_path, tmp_path / "a.md"))) is dead


def test_pages_named_in_the_code_are_there() -> None:
    named = {
        (found, path.relative_to(ROOT).as_posix())
        for place in (*PACKAGES, "tests", "docs", "examples")
        for path in (ROOT / place).rglob("*.py")
        for found in re.findall(r"docs/[\w/-]+\.(?:md|csv)", path.read_text(encoding="utf-8"))
    }
    assert len(named) > 20
    assert not [f"{path} names {page}" for page, path in sorted(named) if not (ROOT / page).is_file()]


@pytest.mark.parametrize("page", make_formats.PAGES, ids=lambda page: page.name)
def test_the_tables_of_the_formats_are_of_today(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert "<!-- table" in text
    assert text == make_formats.filled(text), "the files have changed: python -m docs.make_formats"


def test_options_in_the_pages_exist() -> None:
    commands = full_parser(COMMANDS)._subparsers._group_actions[0].choices
    known = {command: set(parser._option_string_actions) for command, parser in commands.items()}
    used = [
        (page.name, command, option)
        for page in PAGES
        for command, options in commands_in(page.read_text(encoding="utf-8"))
        for option in options
    ]
    assert len(used) > 80
    assert not [f"{name}: {c} has no {option}" for name, c, option in used if option not in known[c]]


def commands_in(text: str) -> Iterator[tuple[str, list[str]]]:
    """Each ``phasedic COMMAND ...`` of a page, as a line of its own or between backquotes, and its options."""
    whole = text.replace("\\\n", " ")
    for line in re.findall(r"(?:^|`)phasedic ([a-z-]+[^`\n]*)", whole, re.MULTILINE):
        command, _, rest = line.partition("#")[0].partition(" ")
        if command in COMMANDS:
            yield command, re.findall(r"(?<!\S)--[a-z-]+", rest)


def test_commands_are_found_in_a_page() -> None:
    page = "phasedic run --zoi 32 \\\n  --report  # --gone\n`phasedic show --rrd FILE`, `--alone`; phasedic is --none\n"
    assert list(commands_in(page)) == [("run", ["--zoi", "--report"]), ("show", ["--rrd"])]


@pytest.mark.parametrize("module", make_site.REFERENCE.values())
def test_the_reference_describes_what_is_there(module: str) -> None:
    assert importlib.import_module(module).__doc__


def test_the_navigation_names_pages_that_are_there() -> None:
    nav = (ROOT / "mkdocs.yml").read_text(encoding="utf-8").partition("\nnav:")[2]
    named = set(re.findall(r"[\w./-]+\.md", nav.partition("not_in_nav")[0]))
    there = {page.relative_to(ROOT).as_posix() for page in PAGES} - {"README.md"}
    assert named - there == {"index.md", "reference.md", "CHANGELOG.md"}


@pytest.mark.slow
def test_the_pages_are_built_without_a_warning() -> None:
    pytest.importorskip("mkdocs")
    pytest.importorskip("mkdocstrings")
    assert make_site.main() == 0
    page = (ROOT / "build" / "site" / "reference.html").read_text(encoding="utf-8")
    assert "PhaseKernel" in page
    assert "deformed" in page


@pytest.mark.parametrize("place", PLACES)
def test_docstrings_and_comments_name_what_is_there(place: str) -> None:
    modules = (path for path in sorted((ROOT / place).rglob("*.py")) if path.name != "test_documents.py")
    dead = [found for path in modules for found in dead_references(ROOT, path)]
    assert not dead, "\n" + "\n".join(dead)


@pytest.mark.parametrize(
    ("text", "dead"),
    [
        ("see ``live.gone``", True),
        ("see ``live.cli.vanished``", True),
        ("see `analysis/gone.py`", True),
        ("see ``live.cli.main``, ``live.pipeline.measure.measure``, `fit/shapes.py` and `shapes.py`", False),
    ],
)
def test_a_dead_reference_is_found(text: str, dead: bool) -> None:
    assert bool(list(dead_in(ROOT, text))) is dead


def test_code_is_not_words(tmp_path: Path) -> None:
    module = tmp_path / "module.py"
    module.write_text('"""Names live.gone."""\nlive.stop()\n# live.lost\n', encoding="utf-8")
    assert sorted(words(module)) == [(1, "Names live.gone."), (3, "# live.lost")]


def test_the_citation_and_the_changes_are_of_this_version() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert project["project"]["dynamic"] == ["version"], "it stands in one place"
    assert project["tool"]["setuptools"]["dynamic"]["version"] == {"attr": "live.VERSION"}
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8").splitlines()
    assert f"version: {VERSION}" in citation
    (released,) = (line.split(": ")[1] for line in citation if line.startswith("date-released: "))
    assert f"## {VERSION}, {released}" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8").splitlines()


def test_quoted_messages_exist() -> None:
    sources = [path for place in PACKAGES for path in sorted((ROOT / place).rglob("*.py"))]
    page, words = ROOT / "docs" / "troubleshooting.md", strings(sources)
    assert len(list(quoted(page))) > 40
    assert not list(missing(page, words)), "\n" + "\n".join(missing(page, words))


@pytest.mark.parametrize(
    ("quote", "exists"), [("the … is full", True), ("the disk is full of …", False), ("full. Go", False)]
)
def test_a_message_that_does_not_exist_is_found(tmp_path: Path, quote: str, exists: bool) -> None:
    page, module = tmp_path / "page.md", tmp_path / "module.py"
    page.write_text(f"text\n> {quote}\n", encoding="utf-8")
    module.write_text("'full. Go'\nraise E(f'{path}: the {what} ' 'is full; go')\n", encoding="utf-8")
    assert bool(list(missing(page, strings([module])))) is not exists
