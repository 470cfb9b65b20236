"""``phasedic identify``: identify the device on a serial port."""

from __future__ import annotations

import argparse
from collections.abc import Callable

from acquire.serial_line import identify
from live.commands.exit_codes import NOT_READY

Say = Callable[[str], None]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic identify``."""
    parser.add_argument("device", help="serial port, as /dev/ttyUSB0")
    parser.add_argument("--ask", action="store_true", help="also send queries (an unknown machine may move)")


def command(arguments: argparse.Namespace, say: Say = print) -> int:
    """``phasedic identify DEVICE [--ask]``; 0 if a device was identified, else 6."""
    for baud, received, finding in identify.listen(arguments.device):
        shown = received[:60].decode("ascii", "backslashreplace")
        say(f"{baud:7} baud: {len(received)} bytes {shown!r}" if received else f"{baud:7} baud: silence")
        if finding is not None:
            _propose(finding.address, finding.remark, say)
            return 0
    if arguments.ask:
        return _ask_all(arguments.device, say)
    say("nothing recognised; --ask sends queries to this port (only if no machine there can move)")
    return NOT_READY


def _ask_all(device: str, say: Say) -> int:
    questions = identify.questions(device)
    say("will send, one after the other:")
    for question in questions:
        line = question.line
        say(f"  {question.data!r}  at {line.baud} {line.bytesize}{line.parity}1 ({question.protocol})")
    for question in questions:
        finding = identify.ask(question)
        say(f"  {question.protocol}: {'answers' if finding else 'no answer'}")
        if finding is not None:
            _propose(finding.address, finding.remark, say)
            return 0
    say("no answer; check cable, speed and the device's own settings (docs/load-cells.md)")
    return NOT_READY


def _propose(address: str, remark: str, say: Say) -> None:
    say(f"use  --load '{address}'")
    if remark:
        say(f"note {remark}")
