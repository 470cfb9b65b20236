"""``phasedic check``: picture and load cell before the test; exit code 6 for NO-GO."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquire.errors import ConfigError
from acquire.files.picture import write_picture
from acquire.load_cell import check as load_check
from acquire.load_cell.check import LoadReport
from live.commands.check_watch import watch
from live.commands.exit_codes import NOT_READY
from live.commands.options import (
    MEASURE,
    PICTURES,
    add_config_file,
    add_help_all,
    add_lens,
    add_options,
    add_verbose,
    configured,
    require_new,
)
from live.commands.signals import interrupts
from live.config.loading import Config
from live.config.sides import names_of, second_camera
from live.setup.check.budget import budget_lines
from live.setup.check.check_list import CheckFigures, examine, table_lines
from live.setup.check.sample import take
from live.setup.check.verdict import DEFAULT_TARGET, check_lines
from live.setup.devices import check_load_port, open_load
from live.setup.placement import with_auto_gauges
from live.setup.region import report_warnings
from live.setup.specimen_drawing import Overlay, snapshot
from live.ui.terminal.screen import TerminalScreen

LISTEN_S = 3.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic check``."""
    add_options(parser, "devices", "camera", "crop", "dark", "flat", "load")
    parser.add_argument(
        "--target", type=float, metavar="UM_M", help="largest strain noise of one ZOI for the test, um/m"
    )
    parser.add_argument(
        "--snapshot",
        metavar="FILE",
        help="write a new PNG: the picture with ruler, region, gauges and the noise of the ZOIs",
    )
    parser.add_argument(
        "--watch",
        action="store_true",
        help="repeat the check three times a second until Ctrl-C, with the peak of the sharpness",
    )
    add_config_file(parser)
    add_options(parser, "measurement", *(name for name in MEASURE if name != "strain"), "axis")
    add_lens(parser)
    add_options(parser, "view of --watch", "no-view")
    add_verbose(parser)
    add_help_all(parser)


def command(arguments: argparse.Namespace) -> int:
    """Run the check; 0 for GO, 6 for NO-GO."""
    screen = TerminalScreen()
    config = configured(arguments)
    if not config.camera.address:
        raise ConfigError("no camera is given; use --camera ADDRESS (see phasedic devices)")
    if arguments.snapshot:
        require_new(Path(arguments.snapshot), *PICTURES)
    check_load_port(config.load.address)
    if (second := second_camera(config)) is not None:
        here, other = names_of(config)
        screen.print(f"this checks the {here}; check the {other} on its own: {second}")
    target = None if arguments.target is None else arguments.target * 1e-6
    if arguments.watch:
        with interrupts() as stop:
            figures = watch(config, target, screen, stop.is_set)
    else:
        figures = examine(take(config, report_warnings(screen.print)), config, _load(config))
    if arguments.snapshot:
        write_picture(Path(arguments.snapshot), _drawn(figures, config, target))
        screen.print(f"written: {arguments.snapshot}")
    lines = check_lines(figures, target, config.measure.reference_shift_px)
    budget = budget_lines(figures, config)
    for line in [
        *(line.text() for line in lines),
        "",
        *table_lines(figures),
        *([""] if budget else []),
        *budget,
    ]:
        screen.print(line)
    ready = all(line.good for line in lines)
    screen.print(_verdict(figures, ready))
    return 0 if ready else NOT_READY


def _verdict(figures: CheckFigures, ready: bool) -> str:
    if not ready:
        return "NO-GO: not ready, see the lines with LOOK above"
    if figures.stack.few:
        open_points = "noise in time, flicker, drift and vibration are not measured"
        return f"GO, as far as {figures.stack.count_text} can show: {open_points}"
    return "GO: ready"


def _drawn(figures: CheckFigures, config: Config, target: float | None) -> NDArray[np.uint8]:
    """The picture with region, ZOIs and gauges drawn over it."""
    zois = figures.zois
    gauges = with_auto_gauges(config, zois.grid).gauges
    limit = DEFAULT_TARGET if target is None else target
    overlay = Overlay(figures.region, zois.grid, gauges, zois.sigma, limit, figures.px_per_mm)
    return snapshot(figures.stack.mean().mean, overlay)


def _load(config: Config) -> LoadReport | None:
    """The check of a few seconds of the load cell, if there is one."""
    if config.load.address == "none:":
        return None
    cell = open_load(config.load.address, camera_address=config.camera.address)
    return load_check.report(load_check.listen(cell, LISTEN_S), cell.info)
