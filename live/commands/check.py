"""``phasedic check``: judge the still specimen before the test; exit code 6 for NO-GO."""

from __future__ import annotations

import argparse

from acquire.errors import ConfigError
from acquire.load_cell import check as load_check
from acquire.load_cell.check import LoadReport
from live.check import examine, judge, table_lines, take
from live.commands.exit_codes import NOT_READY
from live.commands.options import add_measure, add_options, configured
from live.setup import Config, open_load
from live.tell import Screen

LISTEN_S = 3.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic check``."""
    add_options(parser, "devices", "camera", "crop", "dark", "flat", "load")
    parser.add_argument(
        "--target", type=float, metavar="UM_M", help="strain noise of one ZOI that is needed, um/m"
    )
    add_measure(parser)


def command(arguments: argparse.Namespace) -> int:
    """Run the check; 0 for GO, 6 for NO-GO."""
    screen = Screen()
    config = configured(arguments)
    if not config.camera.address:
        raise ConfigError("no camera is given; use --camera ADDRESS (see phasedic devices)")
    figures = examine(take(config), config, _load(config), config.scale.px_per_mm)
    target = None if arguments.target is None else arguments.target * 1e-6
    lines = judge(figures, target, config.measure.reference_shift_px)
    for line in [*(line.text() for line in lines), "", *table_lines(figures)]:
        screen.say(line)
    ready = all(line.good for line in lines)
    screen.say("GO: ready" if ready else "NO-GO: not ready, see what to look at above")
    return 0 if ready else NOT_READY


def _load(config: Config) -> LoadReport | None:
    """A few seconds of the load cell, where there is one."""
    if config.load.address == "none:":
        return None
    cell = open_load(config.load.address)
    return load_check.report(load_check.listen(cell, LISTEN_S), cell.info)
