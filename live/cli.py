"""The command line: ``phasedic run | demo | replay | devices ...``; messages and exit codes."""

from __future__ import annotations

import argparse
import contextlib
import copy
import errno
import logging
import os
import sys
from collections.abc import Sequence
from typing import TextIO

from acquire.errors import DEFECT, EXIT_INTERRUPTED, ConfigError, DataError, PhasedicError
from acquire.text.message import Message, about, brief, printable, word
from live.commands.arguments import Command, parse
from live.commands.process import check_environment, ended_by_sigterm, limit_resources, nonblocking_streams
from live.words.language import said_here, told

_WRONG_PATH = {errno.ENAMETOOLONG, errno.EINVAL, errno.ELOOP}


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    _replace_closed_streams()
    with contextlib.suppress(AttributeError):  # not where a test or a program has put its own stream
        sys.stdout.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]
    limit_resources()
    try:
        with ended_by_sigterm():
            command, arguments = parse(sys.argv[1:] if argv is None else argv)
            with nonblocking_streams():
                _set_up_logging(arguments)
                code = _run(command, arguments)
    except KeyboardInterrupt:  # before or after the command
        code = _interrupted()
    _drop_lost_streams()
    return code


def _replace_closed_streams() -> None:
    """Open closed standard streams on the null device, so that no other file gets their number."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # gets the lowest free number: this one
        if getattr(sys, name) is None:
            stream = os.fdopen(number, "w" if number else "r", encoding="utf-8", closefd=False)
            setattr(sys, name, stream)


def _drop_lost_streams() -> None:
    """Drop a terminal or pipe that is closed; else Python would exit with 120."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):
            with contextlib.suppress(OSError, ValueError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _set_up_logging(arguments: argparse.Namespace) -> None:
    verbose = getattr(arguments, "verbose", False)
    handler = _StatusLineHandler(sys.stderr)
    detailed = "%(asctime)s %(levelname)s %(name)s: %(message)s"
    handler.setFormatter(
        _PrintableFormatter(detailed if verbose else "%(asctime)s %(levelname)s %(message)s", "%H:%M:%S")
    )
    logging.basicConfig(level=logging.DEBUG if verbose else logging.WARNING, handlers=[handler])
    for name in ("acquire", "analysis", "live", "hw_mocks"):
        logging.getLogger(name).setLevel(logging.DEBUG if verbose else logging.INFO)


class _StatusLineHandler(logging.StreamHandler[TextIO]):
    """On a terminal, a message replaces the status line; the next status line follows below it."""

    def emit(self, record: logging.LogRecord) -> None:
        if self.stream.isatty():
            self.stream.write("\r\x1b[K")
        super().emit(record)


class _PrintableFormatter(logging.Formatter):
    """Says messages in the language of the terminal, and printable: they may contain text of a file or a device."""

    def format(self, record: logging.LogRecord) -> str:
        record = copy.copy(record)
        record.levelname = told(word(record.levelname.lower())).upper()
        record.msg = told(record.msg)
        return printable(super().format(record))


def _run(command: Command, arguments: argparse.Namespace) -> int:
    """Run the command; an exception becomes a message and an exit code."""
    try:
        check_environment()
        return command(arguments)
    except PhasedicError as error:
        return _refused(error)
    except KeyboardInterrupt:
        return _interrupted()
    except BrokenPipeError:
        return 0
    except OSError as error:
        logging.getLogger("live").debug("the system refused", exc_info=True)
        return _refused(_system_error(error))
    except Exception:
        logging.getLogger("live").exception("a defect of phasedic; please report it with this traceback")
        return DEFECT


def _system_error(error: OSError) -> PhasedicError:
    """What the system refused, and what to do; the one place for files that no other message covers."""
    name = os.fsdecode(error.filename) if isinstance(error.filename, str | bytes | os.PathLike) else ""
    if error.errno in _WRONG_PATH:
        text = Message("{why}; give another name", error)
        return ConfigError(about(name[:200], text) if name else text)
    text = Message("{why}; check the path, the permissions and the room on the disk", error)
    return DataError(about(name, text) if name else text)


def _refused(error: PhasedicError) -> int:
    print(f"phasedic: {told(printable(brief(error)))}", file=sys.stderr)
    return error.exit_code


def _interrupted() -> int:
    print(f"phasedic: {said_here('interrupted')}", file=sys.stderr)
    return EXIT_INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
