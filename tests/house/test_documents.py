"""The documents speak of the house as it is: names, paths, and the picture of the rooms."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from docs.make_architecture import PICTURE, drawing
from tests.house.messages import quoted, spoken, unsaid
from tests.house.references import dead_in, dead_references, words
from tests.house.rooms import PACKAGES
from tests.house.sources import read_house

ROOT = Path(__file__).parents[2]
PAGES = [
    ROOT / "README.md",
    *sorted((ROOT / "docs").rglob("*.md")),
    *sorted((ROOT / "examples").rglob("*.md")),
]
PLACES = [*PACKAGES, "tests", "docs", "examples"]


def test_pages_name_what_is_there() -> None:
    dead = [found for page in PAGES for found in dead_references(ROOT, page)]
    assert not dead, "\n" + "\n".join(dead)


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
        ("see ``live.cli.main``, ``live.measure.measure``, `fit/shapes.py` and `shapes.py`", False),
    ],
)
def test_a_dead_reference_is_found(text: str, dead: bool) -> None:
    assert bool(list(dead_in(ROOT, text))) is dead


def test_code_is_not_words(tmp_path: Path) -> None:
    module = tmp_path / "module.py"
    module.write_text('"""Says live.gone."""\nlive.stop()\n# live.lost\n', encoding="utf-8")
    assert sorted(words(module)) == [(1, "Says live.gone."), (3, "# live.lost")]


def test_the_picture_is_of_today() -> None:
    assert PICTURE.read_text(encoding="utf-8") == drawing(read_house(ROOT, PACKAGES)), (
        "the rooms or what they say of themselves have changed: python -m docs.make_architecture"
    )


def test_the_citation_and_the_changes_are_of_this_version() -> None:
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8").splitlines()
    assert f"version: {version}" in citation
    (released,) = (line.split(": ")[1] for line in citation if line.startswith("date-released: "))
    assert f"## {version}, {released}" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8").splitlines()


def test_quoted_messages_are_said() -> None:
    sources = [path for place in PACKAGES for path in sorted((ROOT / place).rglob("*.py"))]
    page, words = ROOT / "docs" / "troubleshooting.md", spoken(sources)
    assert len(list(quoted(page))) > 40
    assert not list(unsaid(page, words)), "\n" + "\n".join(unsaid(page, words))


@pytest.mark.parametrize(
    ("quote", "said"), [("the … is full", True), ("the disk is full of …", False), ("full. Go", False)]
)
def test_a_message_nobody_says_is_found(tmp_path: Path, quote: str, said: bool) -> None:
    page, module = tmp_path / "page.md", tmp_path / "module.py"
    page.write_text(f"text\n> {quote}\n", encoding="utf-8")
    module.write_text("'full. Go'\nraise E(f'{path}: the {what} ' 'is full; go')\n", encoding="utf-8")
    assert bool(list(unsaid(page, spoken([module])))) is not said
