"""``phasedic run``: a live test with signals, keyboard, remote commands and the summary at its end."""

from __future__ import annotations

import argparse
import contextlib
import queue
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from acquire.errors import EXIT_WORDS
from acquire.text import Message
from live.commands.attended import attended, page_opened
from live.commands.consumers import finish_test, standard_consumers
from live.commands.options import add_measure, add_options, configured, overrides
from live.config.cameras import FRONT, camera_configs
from live.config.effect import check_effect
from live.config.loading import Config
from live.pipeline.consumer import Consumer, Screen
from live.results.folder import check_folder
from live.results.sides import JointChannels
from live.run.alarms import check_alarms
from live.run.control import Answer, refusal
from live.run.live_run import CameraOfTest, LiveRun, OnStart, run_cameras
from live.run.outcome import Outcome, OutcomeOfTest, StopSignal
from live.setup.devices import check_load_port
from live.setup.region import located
from live.ui.rerun.view import rerun_command, spawn_viewer
from live.ui.terminal.screen import CamerasScreen, TerminalScreen
from live.ui.terminal.summary import trouble_lines

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
    screen, config, given = TerminalScreen(), configured(arguments), overrides(arguments)
    check_effect(given, config)
    configs = camera_configs(config, given)
    check_alarms(config, both_sides=FRONT in configs)
    check_folder(config.output.dir)
    check_load_port(config.load.address)
    if not arguments.page:
        outcome = run_attended(configs, screen)
        return finish(outcome, screen, verbose=arguments.verbose)
    from live.ui.web.page_controller import PageController

    with PageController(None) as controller, page_opened(controller, screen):
        return run_with_page(controller, configs, screen)[1]


def run_with_page(
    controller: PageController, configs: Mapping[str, Config], screen: Screen
) -> tuple[Path, int]:
    """One test, shown on the page until its end; the folder and the exit code."""
    from live.ui.web.run_result import result_of

    controller.viewer = _open_viewer
    shown = {name: [consumer] for name, consumer in controller.begin(configs).items()}
    outcome = run_attended(configs, screen, shown, controller.attach)
    code = finish(outcome, screen)
    controller.end(result_of(outcome.cameras, outcome.folder, EXIT_WORDS.get(code, "")))
    return outcome.folder, code


def _open_viewer(port: int) -> Answer:
    """Open the viewer in its own window."""
    trouble: queue.Queue[str] = queue.Queue()
    if spawn_viewer(port, trouble.put) is None:
        return refusal("no window can be opened here; the folder of the run has view.rrd")
    with contextlib.suppress(queue.Empty):
        return refusal(trouble.get(timeout=VIEWER_OPENS_S))
    return Answer()


def run_attended(
    configs: Mapping[str, Config],
    screen: Screen,
    consumers: Mapping[str, Sequence[Consumer]] = MappingProxyType({}),
    attend: OnStart = lambda live: None,
) -> OutcomeOfTest:
    """Run with signals, keyboard and remote commands.

    Parameters
    ----------
    configs : mapping of str to Config
        Of ``live.config.cameras.camera_configs``.
    screen : Screen
    consumers : mapping of str to a sequence of Consumer, optional
        Beside the standard ones, by camera.
    attend : callable taking the LiveRun, optional
        May add controls of its own.
    """
    every, stop = CamerasScreen(screen), StopSignal()
    leading, joint = next(iter(configs)), JointChannels() if FRONT in configs else None
    with ExitStack() as stack:
        cameras = {}
        for name, config in configs.items():
            own = every.of(name)
            found = stack.enter_context(located(config, own))
            made = standard_consumers(own, consumers.get(name, ()), joint if name == leading else None)
            cameras[name] = CameraOfTest(found, own, made)
        attach = stack.enter_context(attended(configs[leading], screen, stop))

        def on_start(live: LiveRun) -> None:
            every.attach(live.states)
            if joint is not None:
                joint.attach(live.states, live=live.live)
            attach(live)
            attend(live)

        return run_cameras(cameras, stop=stop, on_start=on_start)


def finish(outcome: OutcomeOfTest, screen: Screen, *, verbose: bool = False) -> int:
    """Print the summaries, put sides together, and report where that is asked for; the exit code."""
    lines = {name: _lines(one, verbose=verbose) for name, one in outcome.cameras.items()}
    return finish_test(outcome.cameras, lines, outcome.folder, outcome.exit_code, screen, verbose=verbose)


def _lines(outcome: Outcome, *, verbose: bool) -> list[str]:
    """The frame counts, the losses, and how the recorded view is opened."""
    lines = [*trouble_lines(outcome.run_state, outcome.outputs.reports, verbose=verbose)]
    rrd = outcome.folder / "view.rrd"
    if verbose and rrd.exists():
        lines.append(Message("open the recorded view with: {command}", f"{rerun_command()} {rrd}"))
    return lines
