"""``phasedic docs``: the pages of the documentation that came with the program."""

from __future__ import annotations

import argparse
import difflib
import pydoc
import sys
from pathlib import Path

from acquire.errors import ConfigError, DataError
from acquire.text import Message

TOP = Path(__file__).parents[2]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic docs``."""
    parser.add_argument("name", nargs="?", help="as a message names it: optics, or docs/optics.md")


def command(arguments: argparse.Namespace) -> int:
    """``phasedic docs [NAME]``: one page, or the list of them."""
    folder = shipped("docs")
    pages = {path.relative_to(folder).with_suffix("").as_posix(): path for path in folder.rglob("*.md")}
    if arguments.name is None:
        for name, path in sorted(pages.items(), key=lambda page: ("/" in page[0], page[0])):
            print(f"{name:26} {_heading(path)}")
        print(f"phasedic docs NAME shows one; all are in {folder}")
        return 0
    name = arguments.name.partition("#")[0].removeprefix("docs/").removesuffix(".md")
    if name not in pages:
        near = difflib.get_close_matches(name, pages, 1)
        meant = Message(" (did you mean {near}?)", near[0]) if near else ""
        raise ConfigError("there is no page {name}{meant}; phasedic docs lists all", repr(name), meant)
    text = pages[name].read_text(encoding="utf-8")
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
