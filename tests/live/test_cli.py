"""The entry point without a command: exit codes, closed streams, messages."""

from __future__ import annotations

import argparse
import errno
import io
import logging
import os
import sys
from types import SimpleNamespace
from typing import Any

import pytest

from acquire.errors import EXIT_INTERRUPTED, ConfigError, DataError, DeviceError
from acquire.text import Message
from live import cli
from tests.live.screens import Terminal


def ended(error: BaseException | None, monkeypatch: pytest.MonkeyPatch) -> int:
    """The exit code of a command that raises ``error``."""
    monkeypatch.setattr(cli, "check_environment", lambda: None)

    def command(arguments: argparse.Namespace) -> int:
        if error is not None:
            raise error
        return 7

    return cli._run(command, argparse.Namespace())


@pytest.mark.parametrize(
    ("error", "code", "words"),
    [
        (None, 7, ""),
        (ConfigError("no such key"), 2, "phasedic: no such key\n"),
        (DeviceError("gone\x1b[2J"), 3, "phasedic: gone\\x1b[2J\n"),
        (DataError("damaged"), 4, "phasedic: damaged\n"),
        (KeyboardInterrupt(), EXIT_INTERRUPTED, "phasedic: interrupted\n"),
        (BrokenPipeError(), 0, ""),
        (OSError(errno.ENOSPC, "No space left", "a.h5"), 4,
         "phasedic: a.h5: No space left; check the path, the permissions and the room on the disk\n"),
        (OSError(errno.ENAMETOOLONG, "File name too long", b"a" * 300), 2,
         f"phasedic: {'a' * 200}: File name too long; give another name\n"),
        (OSError(errno.EINVAL, "Invalid argument"), 2, "phasedic: Invalid argument; give another name\n"),
        (OSError(errno.ELOOP, "Too many links", "a"), 2, "phasedic: a: Too many links; give another name\n"),
        (OSError("odd"), 4, "phasedic: odd; check the path, the permissions and the room on the disk\n"),
    ],
)  # fmt: skip
def test_what_a_command_raises_is_a_message_and_an_exit_code(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    error: BaseException | None,
    code: int,
    words: str,
) -> None:
    assert EXIT_INTERRUPTED == 130
    assert ended(error, monkeypatch) == code
    assert capsys.readouterr().err == words


def test_a_defect_has_its_traceback_in_the_log_and_code_1(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    assert ended(ZeroDivisionError("oh"), monkeypatch) == 1
    (record,) = caplog.records
    assert "a defect of phasedic; please report it" in record.getMessage() and record.exc_info is not None


def test_an_interruption_before_a_command_has_its_code(monkeypatch: pytest.MonkeyPatch) -> None:
    def parse(argv: Any) -> Any:
        assert argv == ["devices"]
        raise KeyboardInterrupt

    monkeypatch.setattr(cli, "parse", parse)
    assert cli.main(["devices"]) == EXIT_INTERRUPTED
    monkeypatch.setattr(sys, "argv", ["phasedic", "devices"])
    assert cli.main() == EXIT_INTERRUPTED


def test_closed_standard_streams_are_opened_on_the_null_device(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[tuple[str, int]] = []
    made: list[tuple[int, str]] = []

    def fstat(number: int) -> None:
        if number == 1:
            raise OSError("closed")

    def fdopen(number: int, mode: str, **more: Any) -> io.StringIO:
        made.append((number, mode))
        return io.StringIO()

    system = SimpleNamespace(
        fstat=fstat, fdopen=fdopen, open=lambda path, flags: opened.append((path, flags)), devnull=os.devnull,
        O_RDWR=os.O_RDWR,
    )  # fmt: skip
    monkeypatch.setattr(cli, "os", system)
    monkeypatch.setattr(sys, "stdin", None)
    before = sys.stderr
    monkeypatch.setattr(sys, "stdout", None)
    cli._replace_closed_streams()
    assert opened == [(os.devnull, os.O_RDWR)] and made == [(0, "r"), (1, "w")]
    assert isinstance(sys.stdin, io.StringIO) and isinstance(sys.stdout, io.StringIO) and sys.stderr is before


class Lost(io.StringIO):
    """A stream that nobody reads any more."""

    def flush(self) -> None:
        raise BrokenPipeError

    def fileno(self) -> int:
        return 77


def test_streams_that_are_lost_are_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    moved: list[tuple[int, int]] = []
    system = SimpleNamespace(
        dup2=lambda new, old: moved.append((new, old)), open=lambda path, flags: 55, devnull="", O_WRONLY=1
    )
    monkeypatch.setattr(cli, "os", system)
    monkeypatch.setattr(sys, "stdout", Lost())
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    cli._drop_lost_streams()
    assert moved == [(55, 77)]


@pytest.mark.parametrize(("stream", "lead"), [(Terminal(), "\r\x1b[K"), (io.StringIO(), "")])
def test_a_message_replaces_the_status_line_of_a_terminal_and_is_printable(
    stream: io.StringIO, lead: str
) -> None:
    handler = cli._StatusLineHandler(stream)
    handler.setFormatter(cli._PrintableFormatter("%(message)s"))
    handler.emit(logging.LogRecord("live", logging.INFO, "", 0, "bad \x1b[31m", None, None))
    assert stream.getvalue() == f"{lead}bad \\x1b[31m\n"


def test_the_log_has_the_language_of_the_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LC_ALL", "de_DE.UTF-8")
    text = Message(
        "the viewer {path} did not start: {error}", "100 %s", OSError(2, "No such file or directory")
    )
    record = logging.LogRecord("live", logging.WARNING, "", 0, text, None, None)
    shown = cli._PrintableFormatter("%(levelname)s %(message)s").format(record)
    assert (
        shown == "WARNUNG der Betrachter 100 %s ist nicht gestartet: keine solche Datei, kein solcher Ordner"
    )
    assert record.levelname == "WARNING"


@pytest.mark.parametrize(("verbose", "root", "ours"), [(False, 30, 20), (True, 10, 10)])
def test_our_own_information_is_shown_and_that_of_libraries_only_when_asked(
    monkeypatch: pytest.MonkeyPatch, verbose: bool, root: int, ours: int
) -> None:
    given: dict[str, Any] = {}
    names = ("acquire", "analysis", "live", "hw_mocks")
    before = {name: logging.getLogger(name).level for name in names}
    monkeypatch.setattr(logging, "basicConfig", lambda **more: given.update(more))
    try:
        cli._set_up_logging(argparse.Namespace(verbose=verbose))
        assert given["level"] == root and len(given["handlers"]) == 1
        assert {logging.getLogger(name).level for name in names} == {ours}
    finally:
        for name, level in before.items():
            logging.getLogger(name).setLevel(level)
