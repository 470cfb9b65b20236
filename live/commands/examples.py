"""``phasedic examples``: copy the examples, and render the pictures that they measure."""

from __future__ import annotations

import argparse
import json
import shutil
from pathlib import Path
from typing import Any

from acquire.text import Message
from live.commands.docs import shipped
from live.config.new_files import new_folder
from live.ui.terminal.screen import print_line

FOLDER = "phasedic-examples"
CELL = "# %%"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic examples``."""
    words = f"new folder that they are copied to (default {FOLDER})"
    parser.add_argument("folder", nargs="?", default=FOLDER, metavar="DIR", help=words)


def command(arguments: argparse.Namespace) -> int:
    """``phasedic examples [DIR]``; nothing is overwritten."""
    from hw_mocks.example_pictures import write_pictures

    folder = Path(arguments.folder)
    ignored = shutil.ignore_patterns("__*", "*.egg-info", "build")
    with new_folder(folder) as part:
        try:
            shutil.copytree(shipped("examples"), part, ignore=ignored, dirs_exist_ok=True)
        except shutil.Error as error:  # it has the errors of all files
            raise OSError(error.args[0][0][2].partition(": ")[0]) from error
        cells = (part / "notebook.py").read_text(encoding="utf-8").split(f"\n{CELL}")
        (part / "notebook.ipynb").write_text(notebook(cells), encoding="utf-8")
        print_line(Message("rendering the pictures ..."))
        write_pictures(part)
    page = folder / "README.md"
    print_line(Message("{page} has a command for each example, and what it gives. The first:", page))
    print_line(
        f"  cd {folder}\n  phasedic replay shots --load forces.csv --section 20,2 --config gauges.toml --report"
    )
    return 0


def notebook(cells: list[str]) -> str:
    """The text of an .ipynb: the head as text, each cell with its comment."""
    parts: list[dict[str, Any]] = [
        {"cell_type": "markdown", "metadata": {}, "source": cells[0].strip('" \n')}
    ]
    for cell in cells[1:]:
        made: dict[str, Any] = {"cell_type": "code", "metadata": {}, "execution_count": None, "outputs": []}
        parts.append(made | {"source": f"#{cell.rstrip()}"})
    return json.dumps({"cells": parts, "metadata": {}, "nbformat": 4, "nbformat_minor": 4}, indent=1)
