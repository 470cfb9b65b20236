"""``phasedic docs``: the pages of the documentation that came with the program."""

from __future__ import annotations

import argparse
import pydoc
import re
import sys
from pathlib import Path

from acquire.errors import ConfigError, DataError
from acquire.text import Message, meant
from live.ui.terminal.screen import print_line

TOP = Path(__file__).parents[2]
_HEADING = re.compile(r"^(?P<level>##+) (?P<title>.+)$", re.MULTILINE)
"""Of a section; one # alone begins a comment of a shell, too."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic docs``."""
    parser.add_argument("name", nargs="?", help="as a message names it: optics, or docs/optics.md#the-lens")


def command(arguments: argparse.Namespace) -> int:
    """``phasedic docs [NAME]``: one page or one section of it, or the list of pages."""
    folder = shipped("docs")
    pages = {path.relative_to(folder).with_suffix("").as_posix(): path for path in folder.rglob("*.md")}
    if arguments.name is None:
        for name, path in sorted(pages.items(), key=lambda page: ("/" in page[0], page[0])):
            print(f"{name:26} {_heading(path)}")
        print_line(Message("phasedic docs NAME shows one; all are in {folder}", folder))
        return 0
    page, _, anchor = arguments.name.partition("#")
    name = page.removeprefix("docs/").removesuffix(".md")
    if name not in pages:
        raise ConfigError(
            "there is no page {name}{meant}; phasedic docs lists all", repr(name), meant(name, pages)
        )
    text = _section(pages[name].read_text(encoding="utf-8"), anchor)
    if not text:
        raise ConfigError("{name} has no section {anchor}; phasedic docs {name} shows all", name, anchor)
    if sys.stdout.isatty() and sys.stdin.isatty():
        pydoc.pager(text)
    else:
        print(text)
    return 0


def shipped(name: str) -> Path:
    """The folder ``docs`` or ``examples``: of the installed package, or of the sources.

    Raises
    ------
    DataError
        It was not installed.
    """
    for folder in (TOP / "phasedic" / name, TOP / name):
        if folder.is_dir():
            return folder
    raise DataError("{folder} is missing; install phasedic again", TOP / "phasedic" / name)


def _heading(path: Path) -> str:
    return path.read_text(encoding="utf-8").partition("\n")[0].lstrip("# ")


def _section(text: str, anchor: str) -> str:
    """The section under the heading that a link names, empty where there is none; the whole page without a name."""
    if not anchor:
        return text
    start = level = 0
    for one in _HEADING.finditer(text):
        slug = re.sub(r"\s+", "-", re.sub(r"[^\w\s-]", "", one["title"].lower()).strip())
        if level and len(one["level"]) <= level:
            return text[start : one.start()].rstrip()
        if not level and slug == anchor:
            start, level = one.start(), len(one["level"])
    return text[start:].rstrip() if level else ""
