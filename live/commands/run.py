"""``phasedic run``: a live test with signals, keyboard and what is printed at its end."""

from __future__ import annotations

import argparse
import contextlib
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from types import FrameType

from live.commands.exit_codes import EXIT_WORDS
from live.commands.options import add_measure, add_options, configured
from live.operate import OrderPort, listen
from live.outputs import Consumer
from live.run import INTERRUPTED, LiveRun, Outcome, Stop, run_live
from live.setup import Config
from live.specimen import searched
from live.tell import Screen, file_lines, sentence, summary_lines
from live.view import rerun_command


@contextlib.contextmanager
def signals(stop: Callable[[], None], say: Callable[[str], None]) -> Iterator[None]:
    """SIGINT and SIGTERM call ``stop`` (the third time they kill); a lost terminal is ignored."""
    times = 0

    def handle(number: int, frame: FrameType | None) -> None:
        nonlocal times
        times += 1
        if times > 2:
            signal.signal(number, signal.SIG_DFL)
            signal.raise_signal(number)
        say("closing the files ..." if times == 1 else "still closing; once more ends it at once")
        stop()

    before = {number: signal.signal(number, handle) for number in (signal.SIGINT, signal.SIGTERM)}
    before[signal.SIGHUP] = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic run``."""
    add_options(
        parser,
        "devices and recording",
        "camera",
        "load",
        "no-record",
        "record",
        "armed",
        "start-above",
        "dark",
        "flat",
        "crop",
        "seconds",
    )
    add_options(
        parser, "other programs", "orders", "strain-out", "strain-format", "strain-channels", "token-file"
    )
    add_measure(parser)


def command(arguments: argparse.Namespace) -> int:
    """``phasedic run``."""
    screen = Screen()
    with searched(configured(arguments), screen.say) as config:
        outcome = run_to_the_end(config, screen)
    conclude(outcome, screen)
    return outcome.exit_code


def run_to_the_end(config: Config, screen: Screen, consumers: Sequence[Consumer] = ()) -> Outcome:
    """Run with signals, keyboard, port for orders and viewer attached."""
    stop, operate = Stop(), config.operate
    with contextlib.ExitStack() as stack:
        port = OrderPort(operate.orders, operate.token_file, screen) if operate.orders else None

        def hands(live: LiveRun) -> None:
            keyboard = listen(live, sys.stdin, screen)
            if keyboard is not None:
                stack.callback(keyboard.close)
            if port is not None:
                port.open(live)

        if port is not None:
            stack.callback(port.close)
        stack.enter_context(signals(lambda: stop.ask(INTERRUPTED), screen.say))
        return run_live(config, screen, stop=stop, consumers=consumers, hands=hands)


def conclude(outcome: Outcome, screen: Screen) -> None:
    """Print the summary, the ledger, the losses and the files."""
    screen.say()
    books = outcome.books
    for line in summary_lines(books, outcome.config.specimen):
        screen.say(line)
    screen.say(books.ledger.line())
    for report in outcome.outputs.reports:
        screen.say(f"  {report.line()}")
    troubles = books.journal.events("warning", "error")
    if troubles:
        screen.say(
            f"{len(troubles)} warnings and errors, the last: {sentence(troubles[-1], books.journal.names)}"
        )
    for line in file_lines(outcome.folder):
        screen.say(line)
    rrd = outcome.folder / "view.rrd"
    if rrd.exists():
        screen.say(f"look at it again with: {rerun_command()} {rrd}")
    if outcome.config.output.report:
        from live.commands.report import write_report

        write_report(outcome.folder, screen)
    if outcome.exit_code in EXIT_WORDS:
        screen.say(f"exit code {outcome.exit_code}: {EXIT_WORDS[outcome.exit_code]}")
