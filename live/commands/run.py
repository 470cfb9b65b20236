"""``phasedic run``: a live test with signals, keyboard and what is printed at its end."""

from __future__ import annotations

import argparse
import contextlib
import queue
import sys
import webbrowser
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from live.commands.consumers import standard_consumers
from live.commands.exit_codes import EXIT_WORDS
from live.commands.options import add_measure, add_options, configured
from live.commands.signals import signals
from live.config.loading import Config
from live.pipeline.consumer import Consumer
from live.pipeline.event_log import sentence
from live.pipeline.screen import Screen
from live.results.summary import file_lines, summary_lines
from live.run.control import ControlPort
from live.run.keyboard import listen
from live.run.live_run import INTERRUPTED, LiveRun, run_live
from live.run.outcome import Outcome, StopSignal
from live.setup.region import searched
from live.ui.rerun.view import has_display, rerun_command, spawn_viewer
from live.ui.terminal.screen import TerminalScreen

if TYPE_CHECKING:
    from live.ui.web.page_controller import PageController

RECORDING = ("camera", "load", "no-record", "record", "armed", "start-above", "dark", "flat", "crop")
VIEWER_OPENS_S = 1.5  # where it cannot, it ends sooner than that
OTHER_PROGRAMS = ("orders", "strain-out", "strain-format", "strain-channels", "token-file")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic run``."""
    add_options(parser, "devices and recording", *RECORDING, "seconds")
    add_options(parser, "other programs", *OTHER_PROGRAMS)
    words = "show the operator's page in the browser, on 127.0.0.1, while it runs (phasedic page sets up too)"
    parser.add_argument("--page", action="store_true", help=words)
    add_measure(parser)


def command(arguments: argparse.Namespace) -> int:
    """``phasedic run``."""
    screen = TerminalScreen()
    with searched(configured(arguments), screen.say) as config:
        outcome = run_beside_page(config, screen) if arguments.page else run_to_the_end(config, screen)
    if not arguments.page:
        conclude(outcome, screen)
    return outcome.exit_code


def run_beside_page(config: Config, screen: Screen) -> Outcome:
    """Run with the operator's page, which ends with the run."""
    from live.ui.web.page_controller import PageController

    with PageController(None) as controller:
        invite(controller, screen)
        return watched(controller, config, screen)


def watched(controller: PageController, config: Config, screen: Screen) -> Outcome:
    """One test, with the page, told to its end."""
    from live.ui.web.page_controller import ended

    controller.viewer = _open_viewer
    outcome = run_to_the_end(config, screen, [controller.begin(config)], controller.attend)
    conclude(outcome, screen)
    words = EXIT_WORDS.get(outcome.exit_code, "")
    controller.end(ended(outcome.run_state, outcome.config.specimen, outcome.folder, words))
    return outcome


def invite(controller: PageController, screen: Screen) -> None:
    """Open the page where there is a display; say how to open it."""
    if has_display() and webbrowser.open(controller.address):
        screen.say("the page opens in the browser")
    screen.say(f"the page: {controller.address}")


def _open_viewer(port: int) -> str:
    """The viewer of the view, in a window of its own; what keeps it from opening comes soon."""
    trouble: queue.Queue[str] = queue.Queue()
    if spawn_viewer(port, trouble.put) is None:
        return "no: no window can be opened here; the folder of the run has view.rrd"
    with contextlib.suppress(queue.Empty):
        return f"no: {trouble.get(timeout=VIEWER_OPENS_S)}"
    return "ok"


def run_to_the_end(
    config: Config,
    screen: Screen,
    consumers: Sequence[Consumer] = (),
    attend: Callable[[LiveRun], None] = lambda live: None,
) -> Outcome:
    """Run with signals, keyboard, port for orders and viewer attached; ``attend`` gives orders too."""
    stop, operate = StopSignal(), config.operate
    with contextlib.ExitStack() as stack:
        port = ControlPort(operate.orders, operate.token_file, screen) if operate.orders else None

        def on_start(live: LiveRun) -> None:
            keyboard = listen(live, sys.stdin, screen)
            if keyboard is not None:
                stack.callback(keyboard.close)
            if port is not None:
                port.open(live)
            attend(live)

        if port is not None:
            stack.callback(port.close)
        stack.enter_context(signals(lambda: stop.request(INTERRUPTED), screen.say))
        return run_live(
            config, screen, stop=stop, consumers=standard_consumers(screen, consumers), on_start=on_start
        )


def conclude(outcome: Outcome, screen: Screen) -> None:
    """Print the summary, the ledger, the losses and the files."""
    screen.say()
    run_state = outcome.run_state
    for line in summary_lines(run_state, outcome.config.specimen):
        screen.say(line)
    screen.say(run_state.frame_counts.line())
    for report in outcome.outputs.reports:
        screen.say(f"  {report.line()}")
    troubles = run_state.event_log.events("warning", "error")
    if troubles:
        screen.say(
            f"{len(troubles)} warnings and errors, the last: {sentence(troubles[-1], run_state.event_log.names)}"
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
