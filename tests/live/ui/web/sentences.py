"""The sentences that the page can show: those of its own files, and those of the modules whose messages it shows."""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from tests.live.ui.web.browser import ROOT

STATIC = ROOT / "live" / "ui" / "web" / "static"
LANGUAGES = ("de", "fr")
# Their messages come to the page: errors, events, refusals and lines of the check ...
MODULES = (
    "live/run/control.py",
    "live/run/live_run.py",
    "live/run/camera_run.py",
    "live/config/cameras.py",
    "live/run/alarms.py",
    "live/setup/check/disk.py",
    "live/setup/check/verdict.py",
    "live/setup/region.py",
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
# ... and all that these say of devices, files, settings and figures: every text of two words or more.
WHOLE = (
    "acquire/addresses.py", "acquire/bounds.py", "acquire/record_mode.py", "acquire/camera/*.py",
    "acquire/files/*.py", "acquire/genicam/*.py", "acquire/hdf5/d*.py", "acquire/load_cell/c*.py",
    "acquire/load_cell/load_log.py",
    "acquire/opencv/*.py", "acquire/pylon/*.py", "acquire/protocols/*.py", "acquire/serial_line/*.py",
    "acquire/session/[!lr]*.py", "acquire/session/reader.py", "acquire/v4l2/*.py",
    "analysis/evaluate/[!ls]*.py", "analysis/field/blur.py", "hw_mocks/faults.py", "hw_mocks/sim_*.py",
    "hw_mocks/specimen.py", "live/config/gauges.py", "live/config/loading.py", "live/config/rig_file.py",
    "live/config/values.py", "live/stream/*.py", "live/pipeline/run_state.py",
    "live/pipeline/timed/*.py", "live/pipeline/guards.py", "live/pipeline/measure.py", "live/run/camera_source.py",
    "live/run/measurer.py",
    "live/run/pre_trigger.py", "live/run/recorder.py", "live/setup/devices.py", "live/setup/grid.py",
    "live/setup/lens.py", "live/setup/scale.py",
)  # fmt: skip
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


# Calls whose texts a programmer reads, or the rig file has as comments.
UNSEEN = {"ValueError", "AssertionError", "TypeError", "compile", "Parameter"}
# Units, settings as they are written, and names that no language changes.
NAMES = re.compile(
    r"\b(px|mm|ms|us|um|Hz|GL|MB|fps|rms|GPa|MPa|TOML|CSV|TIFF|RFC|ZOIs?|[\w.]+=\S*|\w+[._]\S*|\[\[?\w+\]\]?)"
)
# In the listing of ``phasedic devices`` and the lines of ``phasedic load-check``, in files, or compared with.
NOT_SHOWN = {
    "stays the same when replugged: {}",
    "sudo apt install libaravis-0.8-0 (docs/machine-vision.md)",
    "error message = '",
    "exclusively lock",
    "not a figure of {}",
    "command line",
    "automatic now, put on manual when opened: {}",
    "luma of colour, 220 levels; use a grey format if there is one",
    "raw mosaic of colours; plane=g takes the green pixels",
    "compressed, only on request: its artefacts do not average out",
    "not readable here",
    "raw grey levels, {} bits",
    "{} samples in {} s, {} with a value",
    "rate     {} 1/s, jitter {} ms, longest gap {} ms",
    "force    mean {} N, from {} to {} N",
    " ({} of the capacity)",
    "noise    {} N (one reading), {} different values, step {} N",
    "moved    {} N (means of a tenth of the time)",
    "  (this user may not open it: see docs/load-cells.md)",
    "no reading had a value; look at the lines with 'phasedic load-check'",
    "a calibration needs two different loads, none and a known one",
    "the readings do not change with the load; check the cell and its wiring",
    "# Calibration of a load cell; use it with calibration=THIS_FILE in the address.",
    "gain = {}  # N per unit of the line",
    "zero = {}  # on the line, without load",
    "{} cannot be written ({}); choose another folder",
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


def of_the_devices() -> dict[str, str]:
    """All sentences of ``WHOLE`` with the module of each, without those that only programmers and terminals see."""
    found = {}
    for pattern in WHOLE:
        for path in sorted(ROOT.glob(pattern)):
            for text in _sentences(ast.parse(path.read_text("utf-8"))):
                if text not in NOT_SHOWN:
                    found[text] = str(path.relative_to(ROOT))
    return found


def _sentences(tree: ast.AST) -> Iterator[str]:
    """The texts of two words or more that are no docstring, no line for the log and no defect."""
    if isinstance(tree, ast.Expr) and isinstance(tree.value, ast.Constant):
        return
    if isinstance(tree, ast.Call):
        name = tree.func.attr if isinstance(tree.func, ast.Attribute) else getattr(tree.func, "id", "")
        if name in UNSEEN or ast.unparse(tree.func).startswith("log."):
            return
    if isinstance(tree, ast.keyword) and tree.arg == "summary":  # of a protocol, for the documents
        return
    if isinstance(tree, ast.Constant | ast.JoinedStr):
        yield from (text for text in _texts(tree) if re.search(r"[A-Za-z]{2}[,;:]? .*[A-Za-z]{2}", text))
    formats = [one.format_spec for one in ast.walk(tree) if isinstance(one, ast.FormattedValue)]
    parts = tree.values if isinstance(tree, ast.JoinedStr) else list(ast.iter_child_nodes(tree))
    for part in parts:
        if not (isinstance(tree, ast.JoinedStr) and isinstance(part, ast.Constant)) and part not in formats:
            yield from _sentences(part)


UNKNOWN = "\ufffc"
"""For what is filled in."""


class Translator:
    """The texts of the catalogue, looked up as ``words.js`` does it."""

    def __init__(self) -> None:
        self._known = catalogue()
        self._patterns = [
            (
                re.compile("(.*?)".join(map(re.escape, key.split("{}"))), re.DOTALL),
                len(key.replace("{}", "")) < 12,
            )
            for key in sorted((key for key in self._known if "{}" in key), key=len, reverse=True)
        ]

    def knows(self, text: str) -> bool:
        """Whether all words of a text are translated: of its own, and of those filled into a pattern."""
        return self._covers(text.replace("{}", UNKNOWN))

    def _covers(self, text: str) -> bool:
        if text.replace(UNKNOWN, "{}") in self._known or not re.search("[A-Za-z]{2}", NAMES.sub("", text)):
            return True
        ways = (
            self._named,
            partial(self._filled, weak=False),
            self._separated,
            partial(self._filled, weak=True),
        )
        return next((found for way in ways if (found := way(text)) is not None), False)

    def _named(self, text: str) -> bool | None:
        name, colon, rest = text.partition(": ")
        is_known = name.replace(UNKNOWN, "{}") in self._known
        return True if colon and is_name(name) and not is_known and self._covers(rest) else None

    def _filled(self, text: str, weak: bool) -> bool | None:
        for form, is_weak in self._patterns:
            if is_weak == weak and (parts := form.fullmatch(text)):
                covered = all(map(self._covers, parts.groups()))
                if covered or not weak:
                    return covered
        return None

    def _separated(self, text: str) -> bool | None:
        for at in [*re.finditer("; ", text), *re.finditer(": ", text)]:
            if self._covers(text[: at.start()]) and self._covers(text[at.end() :]):
                return True
        return None


def is_name(text: str) -> bool:
    """Of a file, a device or a setting, which stands before a message and stays as it is."""
    return " " not in text or bool(re.search("[/:]", text))


__all__ = [
    "LANGUAGES",
    "STATIC",
    "Path",
    "Translator",
    "catalogue",
    "of_the_devices",
    "of_the_page",
    "of_the_program",
]
