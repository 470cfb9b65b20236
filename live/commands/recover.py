"""``phasedic recover``: copy the readable part of a damaged session."""

from __future__ import annotations

import argparse
from collections.abc import Callable

from acquire.errors import LOSS
from live.ui.terminal.screen import print_line

PrintLine = Callable[[str], None]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic recover``."""
    parser.add_argument("session", help="damaged or unfinished session.h5, or the folder of its run")
    parser.add_argument("--out", metavar="FILE", help="new file (default: beside the session)")


def command(arguments: argparse.Namespace, print_line: PrintLine = print_line) -> int:
    """``phasedic recover SESSION [--out FILE]``; 5 if a part cannot be read."""
    from acquire.session import recover as copy

    done = copy(arguments.session, arguments.out)
    print_line(done.line())
    for sentence in done.unreadable[:10]:
        print_line(f"  {sentence}")
    return LOSS if done.unreadable else 0
