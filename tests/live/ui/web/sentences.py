"""The sentences that the page can show: those of its own files, and those of the modules whose messages it shows."""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Iterator
from pathlib import Path

from tests.live.ui.web.browser import ROOT

STATIC = ROOT / "live" / "ui" / "web" / "static"
LANGUAGES = ("de", "fr")
# Their messages come to the page in normal use; those of drivers and files stay English.
MODULES = (
    "live/run/control.py",
    "live/run/live_run.py",
    "live/run/alarms.py",
    "live/setup/check/verdict.py",
    "live/ui/web/page_controller.py",
    "live/ui/web/map_view.py",
    "live/ui/web/setup/camera_preview.py",
    "live/ui/web/setup/device_lists.py",
    "live/ui/web/setup/draft_changes.py",
    "live/ui/web/setup/drawn_region.py",
    "live/ui/web/setup/load_preview.py",
    "live/ui/web/setup/setup_session.py",
    "live/ui/web/setup/specimen_check.py",
    "live/ui/web/setup/specimen_region.py",
)
# Calls whose texts are shown, and the places of these texts.
SHOWN = {
    "ConfigError": (0,),
    "DataError": (0,),
    "DeviceError": (0,),
    "ControlRefused": (0,),
    "CheckLine": (0, 1, 3),
    "_not_measured": (1,),
    "_emit": (1,),
    "emit": (2,),
}


def catalogue() -> dict[str, dict[str, str]]:
    """The texts by their English."""
    found: dict[str, dict[str, str]] = json.loads((STATIC / "catalogue.json").read_text("utf-8"))
    return found


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
            r"const (?:HINTS|LABELS|WORDS|BOARD|words|SIZES|RECORDING) = \{(.*?)\};", text, re.S
        ):
            found |= set(re.findall(r': "(.+?)"', table))
        for cells in re.findall(r"(?:const CELLS = |head: )\[(.*?)\]", text, re.S):
            found |= set(re.findall(r'"(.+?)"', cells))
    return {one for one in found if re.search(r"[A-Za-z]{2}", one)}


def of_the_program() -> Iterator[str]:
    """All sentences of ``MODULES``, with {} for what is filled in."""
    for name in MODULES:
        for node in ast.walk(ast.parse((ROOT / name).read_text("utf-8"))):
            if isinstance(node, ast.Call):
                yield from _of_call(node)
            elif isinstance(node, ast.Dict | ast.Return):
                yield from (
                    one.removeprefix("no: ")
                    for one in _texts(node)
                    if one.startswith("no: ") and one != "no: {}"
                )


def _of_call(node: ast.Call) -> Iterator[str]:
    name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
    for place in SHOWN.get(name, ()):
        if place < len(node.args):
            yield from _texts(node.args[place])


def _texts(node: ast.AST) -> Iterator[str]:
    """Each whole text in an expression."""
    if isinstance(node, ast.Constant):
        if isinstance(node.value, str) and re.search(r"[A-Za-z]{2}", node.value):
            yield node.value
    elif isinstance(node, ast.JoinedStr):
        text = "".join(part.value if isinstance(part, ast.Constant) else "{}" for part in node.values)  # type: ignore[misc]
        if re.search(r"[A-Za-z]{2}", text.replace("{}", "")):
            yield text
    elif not isinstance(node, ast.Call | ast.Subscript | ast.Compare | ast.Attribute):
        for child in ast.iter_child_nodes(node):
            yield from _texts(child)


def translated(text: str, known: dict[str, dict[str, str]]) -> bool:
    """Whether the catalogue has the text, whole or in parts, as ``words.js`` looks it up."""
    if text in known:
        return True
    filled = text.replace("{}", "0")
    for key in known:
        if "{}" in key and re.fullmatch(".+?".join(map(re.escape, key.split("{}"))), filled, re.S):
            return True
    return any(
        translated(text[: at.start()], known) and translated(text[at.end() :], known)
        for at in re.finditer("; |: ", text)
    )


__all__ = ["LANGUAGES", "STATIC", "Path", "catalogue", "of_the_page", "of_the_program", "translated"]
