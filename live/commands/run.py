"""What the commands ``run``, ``replay`` and ``devices`` do; printing and signals are here."""

from __future__ import annotations

import argparse
import contextlib
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType

from live.commands.overrides import overrides
from live.run import LiveRun, Outcome
from live.setup import load_config
from live.tell import Screen, file_lines, summary_lines
from live.view import rerun_command

EXIT_WORDS = {
    1: "a defect of phasedic, see the log",
    3: "the camera was lost before the end",
    5: "finished with loss; the ledger and the events tell what is missing",
    130: "interrupted; everything was closed cleanly",
}


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


def run(arguments: argparse.Namespace) -> int:
    """``phasedic run``."""
    config = load_config(Path(arguments.config) if arguments.config else None, overrides(arguments))
    screen = Screen()
    live = LiveRun(config, screen)
    outcome = run_to_the_end(live, screen)
    conclude(outcome, live, screen)
    return outcome.exit_code


def run_to_the_end(live: LiveRun, screen: Screen) -> Outcome:
    """Run with signals, keyboard and viewer attached."""
    from live.operate import listen

    with signals(lambda: live.stop("interrupted"), screen.say):
        listen(live, sys.stdin, screen)
        return live.run()


def conclude(outcome: Outcome, live: LiveRun, screen: Screen) -> None:
    """Print the summary, the ledger, the losses and the files."""
    screen.say()
    for line in summary_lines(outcome.outputs.history, outcome.loads, live.config.specimen):
        screen.say(line)
    screen.say(outcome.ledger.line())
    troubles = live.journal.events("warning", "error")
    if troubles:
        screen.say(
            f"{len(troubles)} warnings and errors, the last: {troubles[-1].source}: {troubles[-1].text}"
        )
    for line in file_lines(outcome.folder):
        screen.say(line)
    rrd = outcome.folder / "view.rrd"
    if rrd.exists():
        screen.say(f"look at it again with: {rerun_command()} {rrd}")
    if outcome.exit_code in EXIT_WORDS:
        screen.say(f"exit code {outcome.exit_code}: {EXIT_WORDS[outcome.exit_code]}")
