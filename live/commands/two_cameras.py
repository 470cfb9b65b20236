"""A test with two cameras, from the regions of both sides to the table and the report of both."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from acquire.errors import PhasedicError
from live.commands.attended import attended, open_page
from live.commands.consumers import standard_consumers
from live.commands.exit_codes import EXIT_WORDS, LOSS
from live.commands.sides import TABLE, put_together
from live.config.loading import Config
from live.config.sides import BACK, FRONT
from live.pipeline.consumer import Consumer
from live.pipeline.screen import Screen
from live.results.sides.channels import JointChannels
from live.run.outcome import StopSignal
from live.run.two_cameras import BothRuns, OutcomeOfSides, Side, run_two_cameras
from live.setup.region import located
from live.ui.terminal.sides import SidesScreen
from live.ui.terminal.summary import print_summary, trouble_lines

if TYPE_CHECKING:
    from live.ui.web.page_controller import PageController


def run_sides(configs: Mapping[str, Config], screen: Screen, *, page: bool = False) -> int:
    """Run both cameras, with the operator's page or without, and put sides together; the exit code."""
    if not page:
        outcome, both = _run(configs, screen)
        return finish(outcome, both)
    from live.ui.web.page_controller import PageController

    with PageController(None) as controller:
        open_page(controller, screen)
        return run_sides_with_page(controller, configs, screen)[1]


def run_sides_with_page(
    controller: PageController, configs: Mapping[str, Config], screen: Screen
) -> tuple[Path, int]:
    """One test, both cameras shown on the page, of sides with mean and bending; the folder and the exit code."""
    from live.ui.web.run_result import sides_result

    def attend(runs: BothRuns) -> None:
        controller.attach_both(runs, runs.runs)

    outcome, both = _run(configs, screen, controller.begin_all(configs), attend)
    code = finish(outcome, both)
    states = {name: one.run_state for name, one in outcome.sides.items()}
    tests = {name: one.test for name, one in outcome.sides.items()}
    controller.end(sides_result(states, tests, outcome.folder, EXIT_WORDS.get(code, "")))
    return outcome.folder, code


def _run(
    configs: Mapping[str, Config],
    screen: Screen,
    shown: Mapping[str, Consumer] | None = None,
    attend: Callable[[BothRuns], None] = lambda runs: None,
) -> tuple[OutcomeOfSides, SidesScreen]:
    """Run with signals, keyboard and remote commands; ``shown`` are further consumers, by side."""
    both, stop = SidesScreen(screen), StopSignal()
    first, joint = next(iter(configs)), JointChannels() if FRONT in configs else None
    with ExitStack() as stack:
        sides = {}
        for name, config in configs.items():
            side = both.side(name)
            found = stack.enter_context(located(config, side.print))
            more = [] if shown is None else [shown[name]]
            made = standard_consumers(side, more, joint if name == first else None)
            sides[name] = Side(found, side, made)
        attach = stack.enter_context(attended(configs[first], screen, stop))

        def on_start(runs: BothRuns) -> None:
            both.attach(runs.states)
            if joint is not None:
                joint.attach(runs.states, live=runs.live)
            attach(runs)
            attend(runs)

        return run_two_cameras(sides, stop=stop, on_start=on_start), both


def finish(outcome: OutcomeOfSides, both: SidesScreen) -> int:
    """Print the summaries, write table and report of both; the exit code."""
    screen, folder = both.screen, outcome.folder
    for name, one in outcome.sides.items():
        lines = [*trouble_lines(one.run_state, one.outputs.reports)]
        print_summary(both.side(name), one.run_state, one.test, one.folder, lines)
    screen.print()
    code = outcome.exit_code
    try:
        if FRONT in outcome.sides:
            put_together(folder / FRONT, folder / BACK, folder / TABLE, screen)
    except PhasedicError as error:
        screen.print(f"warning: front and back were not put together: {error}")
        code = code or LOSS
    if next(iter(outcome.sides.values())).config.output.report:
        from live.commands.report import write_report

        write_report(folder, screen)
    if code in EXIT_WORDS:
        screen.print(f"exit code {code}: {EXIT_WORDS[code]}")
    return code
