"""``phasedic recover``: copy what is readable of a damaged session."""

from __future__ import annotations

import argparse

from live.commands.load import Say


def recover(arguments: argparse.Namespace, say: Say = print) -> int:
    """``phasedic recover SESSION [--out FILE]``; 5 when something could not be read."""
    from acquire.session import recover as copy

    done = copy(arguments.session, arguments.out)
    say(done.line())
    for sentence in done.unreadable[:10]:
        say(f"  {sentence}")
    return 5 if done.unreadable else 0
