"""``phasedic check``: picture and load cell before the test; exit code 6 for NO-GO."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquire.errors import NOT_READY, ConfigError
from acquire.files.picture import write_picture
from acquire.load_cell import check as load_check
from acquire.load_cell.check import LoadReport
from acquire.text import Message
from acquire.text.message import about, word
from live.commands.check_watch import watch
from live.commands.options import (
    MEASURE,
    PICTURES,
    add_config_file,
    add_help_all,
    add_lens,
    add_options,
    add_verbose,
    configured,
    overrides,
    require_new,
)
from live.commands.signals import interrupts
from live.config.cameras import camera_configs
from live.config.loading import Config
from live.setup.check.budget import budget_lines
from live.setup.check.check_list import CheckFigures, examine, table_lines
from live.setup.check.disk import disk_lines, write_rate
from live.setup.check.sample import take
from live.setup.check.verdict import DEFAULT_TARGET, check_lines
from live.setup.devices import check_load_port, open_load
from live.setup.frames import report_warnings
from live.setup.placement import with_auto_gauges
from live.setup.specimen_drawing import Overlay, snapshot
from live.ui.terminal.screen import TerminalScreen

LISTEN_S = 3.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic check``."""
    add_options(parser, "devices", "camera", "back", "beside", "crop", "dark", "flat", "load")
    add_options(parser, "recording of the test", "record", "no-record", "seconds", "out")
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
    target = None if arguments.target is None else arguments.target * 1e-6
    cameras = camera_configs(config, overrides(arguments))
    snapshots = {name: _snapshot_of(name, arguments.snapshot) for name in cameras}
    for path in filter(None, snapshots.values()):
        require_new(path, *PICTURES)
    check_load_port(config.load.address)
    if arguments.watch:
        first, one = next(iter(cameras.items()))
        if first:
            screen.print(
                Message("--watch looks at the {first} only; without it all cameras are checked", word(first))
            )
        with interrupts() as stop:
            figures = watch(one, target, screen, stop.is_set)
        rate = write_rate(figures.stack, config)
        ready = _shown(figures, one, target, snapshots[first], screen, rate)
        screen.print(_verdict([figures], ready))
        return 0 if ready else NOT_READY
    stacks = {name: take(one, report_warnings(screen.print)) for name, one in cameras.items()}
    rate = sum(write_rate(stacks[name], one) for name, one in cameras.items())
    load, every, ready = _load(config), list[CheckFigures](), True
    for name, one in cameras.items():
        if name:
            screen.print(about(word(name), one.camera.address))
        every.append(examine(stacks[name], one, load))
        ready &= _shown(every[-1], one, target, snapshots[name], screen, rate)
        if name:
            screen.print("")
    screen.print(_verdict(every, ready))
    return 0 if ready else NOT_READY


def _snapshot_of(name: str, given: str | None) -> Path | None:
    """The file of one camera's snapshot: with two cameras, its name is part of that of the file."""
    if not given:
        return None
    path = Path(given)
    return path.with_stem(f"{path.stem}-{name}") if name else path


def _shown(
    figures: CheckFigures,
    config: Config,
    target: float | None,
    path: Path | None,
    screen: TerminalScreen,
    rate: float,
) -> bool:
    """Print the figures of one camera, and draw them where that is asked; whether it is ready.

    ``rate``: what the recording of all cameras writes, bytes/s.
    """
    if path is not None:
        write_picture(path, _drawn(figures, config, target))
        screen.print(Message("written: {path}", path))
    lines = [*check_lines(figures, target, config.measure.reference_shift_px), *disk_lines(rate, config)]
    budget = budget_lines(figures, config)
    for line in [
        *(line.text() for line in lines),
        "",
        *table_lines(figures),
        *([""] if budget else []),
        *budget,
    ]:
        screen.print(line)
    return all(line.good for line in lines)


def _verdict(cameras: Sequence[CheckFigures], ready: bool) -> str:
    if not ready:
        return Message("NO-GO: not ready, see the lines with LOOK above")
    if few := [figures.stack for figures in cameras if figures.stack.few]:
        return Message(
            "GO, as far as {pictures} can show: noise in time, flicker, drift and vibration are not measured",
            few[0].count_text,
        )
    return Message("GO: ready")


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
