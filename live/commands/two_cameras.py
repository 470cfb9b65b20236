"""A test with two cameras, from the regions of both sides to the table and the report of both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack

from acquire.errors import PhasedicError
from live.commands.consumers import standard_consumers
from live.commands.exit_codes import EXIT_WORDS, LOSS
from live.commands.run import attended
from live.commands.sides import TABLE, put_together
from live.config.loading import Config
from live.config.sides import BACK, FRONT
from live.pipeline.consumer import Consumer
from live.pipeline.screen import Screen
from live.run.outcome import StopSignal
from live.run.two_cameras import BothRuns, OutcomeOfSides, Side, run_two_cameras
from live.setup.region import located
from live.ui.terminal.sides import SidesScreen
from live.ui.terminal.summary import print_summary, trouble_lines


def run_sides(configs: Mapping[str, Config], screen: Screen) -> int:
    """Run both sides and put them together; the exit code."""
    both = SidesScreen(screen)
    with ExitStack() as stack:
        found = {
            name: stack.enter_context(located(config, both.side(name).print))
            for name, config in configs.items()
        }
        outcome = run_attended_sides(found, both)
    return finish(outcome, both)


def run_attended_sides(
    configs: Mapping[str, Config], both: SidesScreen, consumers: Sequence[Consumer] = ()
) -> OutcomeOfSides:
    """Run with signals, keyboard and remote commands; ``consumers`` are of the front."""
    stop, front = StopSignal(), configs[FRONT]
    sides = {
        name: Side(
            config, both.side(name), standard_consumers(both.side(name), consumers if name == FRONT else ())
        )
        for name, config in configs.items()
    }
    with attended(front, both.screen, stop) as attach:

        def on_start(runs: BothRuns) -> None:
            both.attach({name: run.run_state for name, run in runs.runs.items()})
            attach(runs)

        return run_two_cameras(sides, stop=stop, on_start=on_start)


def finish(outcome: OutcomeOfSides, both: SidesScreen) -> int:
    """Print the summaries, write table and report of both; the exit code."""
    screen, folder = both.screen, outcome.folder
    for name, one in outcome.sides.items():
        lines = [*trouble_lines(one.run_state, one.outputs.reports)]
        print_summary(both.side(name), one.run_state, one.config.specimen, one.folder, lines)
    screen.print()
    code = outcome.exit_code
    try:
        put_together(folder / FRONT, folder / BACK, folder / TABLE, screen)
    except PhasedicError as error:
        screen.print(f"warning: front and back were not put together: {error}")
        code = code or LOSS
    if outcome.sides[FRONT].config.output.report:
        from live.commands.report import write_report

        write_report(folder, screen)
    if code in EXIT_WORDS:
        screen.print(f"exit code {code}: {EXIT_WORDS[code]}")
    return code
