"""``phasedic run``: a live test with signals, keyboard, remote commands and the summary at its end."""

from __future__ import annotations

import argparse
import contextlib
import queue
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from live.commands.attended import attended, open_page
from live.commands.consumers import standard_consumers
from live.commands.exit_codes import EXIT_WORDS
from live.commands.options import add_measure, add_options, configured, overrides
from live.config.loading import Config
from live.config.sides import second_camera, side_configs
from live.pipeline.consumer import Consumer
from live.pipeline.screen import Screen
from live.results.folder import check_folder
from live.run.alarms import check_alarms
from live.run.live_run import LiveRun, run_live
from live.run.outcome import Outcome, StopSignal
from live.setup.devices import check_load_port
from live.setup.region import located
from live.ui.rerun.view import rerun_command, spawn_viewer
from live.ui.terminal.screen import TerminalScreen
from live.ui.terminal.summary import print_summary, trouble_lines

if TYPE_CHECKING:
    from live.ui.web.page_controller import PageController

RECORDING = (
    "camera",
    "back",
    "beside",
    "load",
    "no-record",
    "record",
    "armed",
    "start-above",
    "dark",
    "flat",
    "crop",
)
VIEWER_OPENS_S = 1.5  # a viewer that cannot open ends sooner
OTHER_PROGRAMS = ("orders", "strain-out", "strain-format", "strain-channels", "token-file")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic run``."""
    add_options(parser, "devices and recording", *RECORDING, "seconds")
    add_options(parser, "other programs", *OTHER_PROGRAMS)
    words = (
        "show the operator's page in the browser, on 127.0.0.1, during the run (phasedic page also sets up)"
    )
    parser.add_argument("--page", action="store_true", help=words)
    add_measure(parser)


def command(arguments: argparse.Namespace) -> int:
    """``phasedic run``."""
    screen, config = TerminalScreen(), configured(arguments)
    check_alarms(config, both_sides=config.camera.back is not None)
    check_folder(config.output.dir)
    check_load_port(config.load.address)
    if second_camera(config) is not None:
        from live.commands.two_cameras import run_sides

        return run_sides(side_configs(config, overrides(arguments)), screen, page=arguments.page)
    with located(config, screen.print) as config:
        outcome = run_and_show_page(config, screen) if arguments.page else run_attended(config, screen)
    if not arguments.page:
        print_outcome(outcome, screen, verbose=arguments.verbose)
    return outcome.exit_code


def run_and_show_page(config: Config, screen: Screen) -> Outcome:
    """Run with the operator's page until the run ends."""
    from live.ui.web.page_controller import PageController

    with PageController(None) as controller:
        open_page(controller, screen)
        return run_with_page(controller, config, screen)


def run_with_page(controller: PageController, config: Config, screen: Screen) -> Outcome:
    """One test, shown on the page until its end."""
    from live.ui.web.run_result import run_result

    controller.viewer = _open_viewer
    outcome = run_attended(config, screen, [controller.begin(config)], controller.attach)
    print_outcome(outcome, screen)
    words = EXIT_WORDS.get(outcome.exit_code, "")
    controller.end(run_result(outcome.run_state, outcome.test, outcome.folder, words))
    return outcome


def _open_viewer(port: int) -> str:
    """Open the viewer in its own window; returns "ok", or "no: " and the reason."""
    trouble: queue.Queue[str] = queue.Queue()
    if spawn_viewer(port, trouble.put) is None:
        return "no: no window can be opened here; the folder of the run has view.rrd"
    with contextlib.suppress(queue.Empty):
        return f"no: {trouble.get(timeout=VIEWER_OPENS_S)}"
    return "ok"


def run_attended(
    config: Config,
    screen: Screen,
    consumers: Sequence[Consumer] = (),
    attend: Callable[[LiveRun], None] = lambda live: None,
) -> Outcome:
    """Run with signals, keyboard and remote commands; ``attend`` may add controls of its own."""
    stop, made = StopSignal(), standard_consumers(screen, consumers)
    with attended(config, screen, stop) as attach:

        def on_start(live: LiveRun) -> None:
            attach(live)
            attend(live)

        return run_live(config, screen, stop=stop, consumers=made, on_start=on_start)


def print_outcome(outcome: Outcome, screen: Screen, *, verbose: bool = False) -> None:
    """Print the summary, the frame counts, the losses and where the files are."""
    run_state, folder = outcome.run_state, outcome.folder
    lines = [*trouble_lines(run_state, outcome.outputs.reports, verbose=verbose)]
    rrd = folder / "view.rrd"
    if verbose and rrd.exists():
        lines.append(f"open the recorded view with: {rerun_command()} {rrd}")
    report = outcome.config.output.report
    print_summary(screen, run_state, outcome.test, folder, lines, verbose=verbose, with_report=report)
    if report:
        from live.commands.report import write_report

        write_report(folder, screen)
    if outcome.exit_code in EXIT_WORDS:
        screen.print(f"exit code {outcome.exit_code}: {EXIT_WORDS[outcome.exit_code]}")
