"""The languages of the page: one file each, every word of the page in it, none that is not there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import live.serve
from analysis.evaluate import GAUGE_KINDS
from live.maps import FIELD_MAPS

STATIC = Path(live.serve.__file__).parent / "static"
SCRIPTS = [
    path for path in STATIC.glob("*.js") if path.name != "uplot.js" and not path.name.startswith("words-")
]


def entries(name: str) -> dict[str, str]:
    lines = re.findall(r'^  "(.+?)": "(.+)",$', (STATIC / f"words-{name}.js").read_text("utf-8"), re.M)
    assert len(lines) == len(dict(lines)), "a word stands twice"
    return dict(lines)


def words() -> set[str]:
    """All that is translated: marked in the page, or handed to ``t`` as it stands or by a table of words."""
    html = (STATIC / "index.html").read_text("utf-8")
    found = set(re.findall(r'data-t="(.+?)"', html))
    for path in SCRIPTS:
        text = path.read_text("utf-8")
        found |= set(re.findall(r'\bt\("(.+?)"\)', text)) | set(re.findall(r'dataset\.t = "(.+?)"', text))
        found |= {word for pair in re.findall(r'\bt\(\w+ \? "(.+?)" : "(.+?)"\)', text) for word in pair}
        for table in re.findall(r"const (?:HINTS|LABELS|WORDS|BOARD) = \{(.*?)\};", text, re.S):
            found |= set(re.findall(r': "(.+?)"', table))
        for cells in re.findall(r"const CELLS = \[(.*?)\]", text, re.S):
            found |= set(re.findall(r'"(.+?)"', cells)) - {"ZOIs"}
    return found


@pytest.mark.parametrize("name", ["de", "fr"])
def test_every_word_is_there(name: str) -> None:
    known = set(entries(name))
    assert not words() - known
    # Of maps and of kinds of gauges the page has the names from the server; one without a translation is English.
    served = {*FIELD_MAPS, *(word for kind in GAUGE_KINDS.values() for word in (kind.label, kind.hint))}
    assert not known - words() - served


def test_the_library_has_its_licence_and_origin() -> None:
    text = (STATIC / "uplot-license.txt").read_text("utf-8")
    assert "The MIT License" in text and "https://github.com/leeoniya/uPlot" in text and "1.6.32" in text
