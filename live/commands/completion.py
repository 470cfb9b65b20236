"""``phasedic completion``: a script with which the shell completes commands, options and file names."""

from __future__ import annotations

import argparse

SHELLS = ("bash", "zsh", "tcsh")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic completion``."""
    parser.add_argument("shell", nargs="?", choices=SHELLS, default=SHELLS[0], help="shell (default bash)")


def command(arguments: argparse.Namespace) -> int:
    """``phasedic completion``."""
    print(script(arguments.shell))
    return 0


def script(shell: str) -> str:
    """The script for one of ``SHELLS``, from the parsers of all commands."""
    import shtab

    from live.commands.arguments import COMMANDS, full_parser, subparsers

    parser = full_parser(COMMANDS)
    for own in subparsers(parser).choices.values():
        # Complete file names for every argument with a free value: shtab reads the attribute ``complete``.
        for action in own._actions:
            if action.nargs != 0 and action.choices is None:
                action.complete = shtab.FILE  # type: ignore[attr-defined]
    return str(shtab.complete(parser, shell))
