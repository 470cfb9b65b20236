"""``phasedic load-check``: check a load cell; ready for a test or not."""

from __future__ import annotations

import argparse
from collections.abc import Callable

from acquire.errors import NOT_READY
from acquire.load_cell import check
from acquire.text import Message, about, word
from live.commands.options import number
from live.setup.devices import open_load
from live.ui.terminal.screen import print_line

PrintLine = Callable[[str], None]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic load-check``."""
    parser.add_argument("--load", required=True, metavar="ADDRESS", help="address of the load cell")
    parser.add_argument(
        "--seconds",
        type=number(0.1, 3600),
        default=10.0,
        metavar="S",
        help="duration of the check (default 10)",
    )


def command(arguments: argparse.Namespace, print_line: PrintLine = print_line) -> int:
    """``phasedic load-check``; 0 if ready for a test, else 6."""
    cell = open_load(arguments.load, lambda event: print_line(about(word(event.level), event.text)))
    print_line(Message("listening to {name} for {seconds:g} s ...", cell.info.name, arguments.seconds))
    found = check.report(check.listen(cell, arguments.seconds), cell.info)
    for line in check.report_lines(found):
        print_line(line)
    print_line(Message("ready") if found.ready else Message("not ready"))
    return 0 if found.ready else NOT_READY
