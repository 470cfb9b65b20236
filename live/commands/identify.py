"""``phasedic identify``: identify the device on a serial port."""

from __future__ import annotations

import argparse
from collections.abc import Callable

from acquire.errors import NOT_READY, PhasedicError
from acquire.serial_line import identify
from acquire.serial_line.ports import LineSettings
from acquire.text.message import Message, about, brief, word
from live.ui.terminal.screen import print_line

PrintLine = Callable[[str], None]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic identify``."""
    parser.add_argument("device", help="serial port, as /dev/ttyUSB0")
    parser.add_argument("--ask", action="store_true", help="also send queries (an unknown machine may move)")


def command(arguments: argparse.Namespace, print_line: PrintLine = print_line) -> int:
    """``phasedic identify DEVICE [--ask]``; 0 if a device was identified, else 6."""
    heard: list[tuple[int, bytes]] = []
    for baud, received, finding in identify.listen(arguments.device):
        heard.append((baud, received))
        shown = received[:60].decode("ascii", "backslashreplace")
        text = Message("{n} bytes {text}", len(received), repr(shown)) if received else word("silence")
        print_line(Message("{baud:7} baud: {text}", baud, text))
        if finding is not None:
            _propose(finding.address, finding.remark, print_line)
            return 0
    if arguments.ask:
        return _ask_all(arguments.device, print_line)
    for baud, received in heard:
        if (finding := identify.proposed(LineSettings(arguments.device, baud), received)) is not None:
            print_line(Message("lines that no protocol knows, at {baud} baud:", baud))
            for one in finding.lines:
                print_line(f"  {one.decode('ascii', 'backslashreplace')}")
            print_line(Message("their pattern; check that it takes the right number (docs/load-cells.md):"))
            _propose(finding.address, finding.remark, print_line)
            return NOT_READY
    print_line(Message("nothing recognised; --ask sends queries (only where no machine can move)"))
    return NOT_READY


def _ask_all(device: str, print_line: PrintLine) -> int:
    questions = identify.questions(device)
    print_line(Message("will send, one after the other:"))
    for question in questions:
        line = question.line
        how = f"{line.baud} {line.bytesize}{line.parity}1"
        print_line(Message("  {data}  at {how} ({protocol})", repr(question.data), how, question.protocol))
    for question in questions:
        try:
            finding = identify.ask(question)
        except PhasedicError as error:
            print_line("  " + about(question.protocol, brief(error)))
            continue
        print_line("  " + about(question.protocol, word("answers" if finding else "no answer")))
        if finding is not None:
            _propose(finding.address, finding.remark, print_line)
            return 0
    print_line(Message("no answer; check cable, speed and the device's own settings (docs/load-cells.md)"))
    return NOT_READY


def _propose(address: str, remark: str, print_line: PrintLine) -> None:
    print_line(Message("use  --load '{address}'", address))
    if remark:
        print_line(Message("note: {what}", remark))
