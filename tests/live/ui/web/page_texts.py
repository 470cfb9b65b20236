"""The texts of the page: those of its HTML and its scripts."""

from __future__ import annotations

import re

from tests.live.ui.web.browser import ROOT

STATIC = ROOT / "live" / "ui" / "web" / "static"


def of_the_page() -> set[str]:
    """All texts of the page: marked in its HTML, translated in its scripts, or in a table of texts there."""
    html = (STATIC / "index.html").read_text("utf-8")
    found = set(re.findall(r'data-(?:t|label|ask|because|yes)="(.+?)"', html))
    for path in STATIC.glob("*.js"):
        if path.name == "uplot.js":
            continue
        text = re.sub(r'\$\("\w+"\)', "$", path.read_text("utf-8"))
        found |= set(re.findall(r'\bt\("(.+?)"\)', text)) | set(re.findall(r'\bt: "(.+?)"', text))
        found |= {
            one
            for call in re.findall(r"\b(?:t|ask)\(([^`]*?)\)", text)
            for one in re.findall(r'"([^"]+)"', call)
        }
        found |= set(re.findall(r'dataset\.(?:t|label|ask|because|yes) = (?:[^;]*? \? )?"([^"]+)"', text))
        found |= {
            one
            for pair in re.findall(r'dataset\.(?:t|ask|because) = [^;]*?\? "(.+?)" : "(.+?)"', text)
            for one in pair
        }
        for table in re.findall(
            r"const (?:HINTS|LABELS|LABELLED|WORDS|BOARD|words|SIZES|RECORDING) = \{(.*?)\};", text, re.S
        ):
            found |= set(re.findall(r': "(.+?)"', table))
        for cells in re.findall(r"(?:const CELLS = |head: )\[(.*?)\]", text, re.S):
            found |= set(re.findall(r'"(.+?)"', cells))
    return {one for one in found if re.search(r"[A-Za-z]{2}", one)}
