"""``phasedic recover``: copy what is readable of a damaged session."""

from __future__ import annotations

import argparse
from collections.abc import Callable

from live.ui.terminal.screen import say as told

Say = Callable[[str], None]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic recover``."""
    parser.add_argument("session")
    parser.add_argument("--out", metavar="FILE", help="the copy (default: beside it)")


def command(arguments: argparse.Namespace, say: Say = told) -> int:
    """``phasedic recover SESSION [--out FILE]``; 5 when something could not be read."""
    from acquire.session import recover as copy

    done = copy(arguments.session, arguments.out)
    say(done.line())
    for sentence in done.unreadable[:10]:
        say(f"  {sentence}")
    return 5 if done.unreadable else 0
