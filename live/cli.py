"""The command line: ``phasedic run | demo | replay | devices ...``; messages and exit codes."""

from __future__ import annotations

import argparse
import contextlib
import logging
import os
import sys
from collections.abc import Sequence
from typing import TextIO

from acquire.errors import PhasedicError
from acquire.printable import brief, printable
from live.commands.arguments import Command, parse
from live.commands.exit_codes import EXIT_INTERRUPTED
from live.commands.streams import unhurried_streams


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    _replace_closed_streams()
    try:
        command, arguments = parse(sys.argv[1:] if argv is None else argv)
        with unhurried_streams():
            _set_up_logging(arguments)
            code = _outcome(command, arguments)
    except KeyboardInterrupt:  # before or after the command
        code = _interrupted()
    _let_go_of_lost_streams()
    return code


def _replace_closed_streams() -> None:
    """Let a stream that was closed before we began lead nowhere, so that no file of ours gets its number."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest free number: this one
        if getattr(sys, name) is None:
            stream = os.fdopen(number, "w" if number else "r", encoding="utf-8", closefd=False)
            setattr(sys, name, stream)


def _let_go_of_lost_streams() -> None:
    """A terminal or pipe that has gone must not turn the exit code into Python's 120."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):
            with contextlib.suppress(OSError, ValueError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _set_up_logging(arguments: argparse.Namespace) -> None:
    verbose = getattr(arguments, "verbose", False)
    handler = _OverTheStatusLine(sys.stderr)
    long = "%(asctime)s %(levelname)s %(name)s: %(message)s"
    handler.setFormatter(_Harmless(long if verbose else "%(asctime)s %(levelname)s %(message)s", "%H:%M:%S"))
    logging.basicConfig(level=logging.DEBUG if verbose else logging.WARNING, handlers=[handler])
    for name in ("acquire", "analysis", "live", "hw_mocks"):
        logging.getLogger(name).setLevel(logging.DEBUG if verbose else logging.INFO)


class _OverTheStatusLine(logging.StreamHandler[TextIO]):
    """On a terminal a message takes the place of the status line, which comes again below it."""

    def emit(self, record: logging.LogRecord) -> None:
        if self.stream.isatty():
            self.stream.write("\r\x1b[K")
        super().emit(record)


class _Harmless(logging.Formatter):
    """Messages may hold words out of a file or a device."""

    def format(self, record: logging.LogRecord) -> str:
        return printable(super().format(record))


def _outcome(command: Command, arguments: argparse.Namespace) -> int:
    """Run the command; what it raises becomes a message and an exit code."""
    try:
        return command(arguments)
    except PhasedicError as error:
        print(f"phasedic: {printable(brief(error))}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        return _interrupted()
    except BrokenPipeError:
        return 0
    except Exception:
        logging.getLogger("live").exception("a defect of phasedic; please report it with this traceback")
        return 1


def _interrupted() -> int:
    print("phasedic: interrupted", file=sys.stderr)
    return EXIT_INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
