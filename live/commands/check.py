"""``phasedic check``: picture and load cell before the test; exit code 6 for NO-GO.

``phasedic check --watch``: the check in the terminal and in the view, three times a second.
"""

from __future__ import annotations

import argparse
import math
import shutil
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

import numpy as np
from numpy.typing import NDArray

from acquire.errors import NOT_READY, ConfigError
from acquire.files.picture import write_picture
from acquire.load_cell import check as load_check
from acquire.load_cell.check import LoadReport
from acquire.text import Message, about, word
from acquire.text.message import printable
from live.commands import options
from live.commands.process import interrupts
from live.config.cameras import camera_configs
from live.config.loading import Config
from live.config.sections import DEFAULT_REFERENCE_BURST
from live.pipeline.consumer import Screen
from live.setup.check.check_list import CheckFigures, examine, table_lines
from live.setup.check.lines import CheckLine, budget_lines, disk_lines, write_rate
from live.setup.check.quick_check import QUICK_FRAMES, QuickCheck, QuickChecker, RollingFrames
from live.setup.check.sample import take
from live.setup.check.verdict import DEFAULT_TARGET, check_lines
from live.setup.compiling import Stopping
from live.setup.devices import check_load_port, open_load
from live.setup.grid import with_auto_gauges
from live.setup.pictures import camera_of, report_warnings
from live.setup.specimen_drawing import Overlay, snapshot
from live.ui.rerun.messages import ViewSetup
from live.ui.rerun.view import View, spawn_viewer
from live.ui.terminal.screen import TerminalScreen

if TYPE_CHECKING:
    from analysis import ZoiGrid

PERIOD_S = 1 / 3
BAR_LENGTH = 30
CLOSE_S = 5.0
MAX_NOTES = 4  # the newest

ShowCheck = Callable[[RollingFrames, QuickCheck, list[CheckLine]], None]

LISTEN_S = 3.0


def watch(config: Config, target: float | None, screen: Screen, stopping: Stopping) -> CheckFigures:
    """Repeat the check until ``stopping`` is set or the camera ends; returns the figures of the last frames.

    Raises
    ------
    ConfigError, DataError, DeviceError
        As a check, or the error that ended the camera.
    """
    frames = 2 * (config.measure.reference_burst or DEFAULT_REFERENCE_BURST)
    checker, display, notes = QuickChecker(config), RenewedLines(screen), list[str]()
    with (
        camera_of(config.camera.address, report_warnings(notes.append), crop=config.camera.crop) as camera,
        RollingFrames(camera, frames, config.camera.address) as rolling,
        _viewed(config, notes) as view,
    ):
        due = time.monotonic()
        while not (stopping.is_set() or rolling.over):
            stack = rolling.newest(QUICK_FRAMES)
            if stack is not None:
                quick = checker.check(stack)
                lines = [
                    *check_lines(quick.figures, target, config.measure.reference_shift_px),
                    *disk_lines(write_rate(stack, config), config),
                ]
                shown = [
                    *notes[-MAX_NOTES:],
                    peak_line(quick),
                    *blur_line(quick),
                    *(line.text() for line in lines),
                ]
                display.lines(shown, short_line(quick, lines))
                view(rolling, quick, lines)
            due = max(due + PERIOD_S, time.monotonic() - PERIOD_S)  # a check that took longer is made up for
            while not (stopping.is_set() or rolling.over) and time.monotonic() < due:
                time.sleep(0.02)
        last = rolling.last(frames)
    display.end()
    return checker.full(last)


def peak_line(quick: QuickCheck) -> str:
    """The sharpness as a bar that ends at the peak."""
    if not math.isfinite(quick.of_peak):
        return Message("sharpness: no pattern is visible")
    full = round(BAR_LENGTH * min(quick.of_peak, 1.0))
    bar = "#" * full + "." * (BAR_LENGTH - full)
    return Message(
        "sharpness {sharpness:.3f} [{bar}] {share:.0%} of the peak {peak:.3f}",
        *(quick.figures.sharpness, bar, quick.of_peak, quick.peak),
    )


def blur_line(quick: QuickCheck) -> list[str]:
    """The blur since the sharpest picture; nothing where it is not known."""
    text = quick.blur.text
    return [Message("          {blur} than the sharpest picture so far", text)] if text else []


def short_line(quick: QuickCheck, lines: list[CheckLine]) -> str:
    """One line for an output that is not a terminal."""
    wrong = ", ".join(line.what for line in lines if not line.good)
    return f"sharpness {quick.figures.sharpness:.3f}, peak {quick.peak:.3f}; " + (
        f"LOOK: {wrong}" if wrong else "all well"
    )


class RenewedLines:
    """Lines renewed in place on a terminal; elsewhere a short line every few seconds."""

    def __init__(self, screen: Screen, stream: TextIO | None = None) -> None:
        self._screen, self._stream = screen, stream or sys.stdout
        self._terminal = self._stream.isatty()
        self._up = 0

    def lines(self, lines: list[str], short: str) -> None:
        """Show these lines in place of the last ones."""
        if not self._terminal:
            self._screen.status(short)
            return
        width, height = shutil.get_terminal_size()
        shown = [printable(part)[: width - 1] for line in lines for part in line.split("\n")][: height - 2]
        clear_below = "\x1b[0J"
        text = "".join(f"\x1b[2K{line}\n" for line in shown)
        self._stream.write((f"\x1b[{self._up}A" if self._up else "") + text + clear_below)
        self._stream.flush()
        self._up = len(shown)

    def end(self) -> None:
        """Further output begins below."""
        if self._terminal:
            self._stream.write("\n")


@contextmanager
def _viewed(config: Config, notes: list[str]) -> Iterator[ShowCheck]:
    """A function that shows a check in the view: the picture, and the lines as its status card.

    The address and the warnings of the view are added to ``notes``.
    """
    views: list[View] = []

    def show(rolling: RollingFrames, quick: QuickCheck, lines: list[CheckLine]) -> None:
        if not config.view.enabled:
            return
        if not views:
            views.append(_view(config, quick.figures, quick.figures.zois.grid, notes))
        frame = rolling.frame()
        if frame is not None:
            views[0].picture(frame)
        views[0].status(card(quick, lines))

    try:
        yield show
    finally:
        for view in views:
            view.close(CLOSE_S)


def _view(config: Config, figures: CheckFigures, grid: ZoiGrid, notes: list[str]) -> View:
    camera = figures.stack.camera
    start = float(figures.stack.times[-1])
    setup = ViewSetup("phasedic check", camera.width, camera.height, camera.bits, grid, start)

    def serving(view: View) -> None:
        port = view.port if config.view.spawn else None
        if port is None or spawn_viewer(port, notes.append) is None:
            notes.extend(view.instructions.splitlines())

    def tell(text: str, level: str) -> None:
        notes.append(text)

    return View(setup, port=config.view.port, rrd=None, notify=tell, on_serving=serving)


def card(quick: QuickCheck, lines: list[CheckLine]) -> str:
    """The check as Markdown."""
    rows = [
        f"| {'' if line.good else '**LOOK**'} | {_cell(line.what)} | {_cell(line.value)} |" for line in lines
    ]
    return "\n".join([f"`{peak_line(quick)}`", *blur_line(quick), "", "| | | |", "|---|---|---|", *rows])


def _cell(text: str) -> str:
    return printable(text).replace("|", "/")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic check``."""
    options.add_options(parser, "devices", "camera", "back", "beside", "crop", "dark", "flat", "load")
    options.add_options(parser, "recording of the test", "record", "no-record", "seconds", "out")
    parser.add_argument(
        "--target",
        type=options.POSITIVE,
        metavar="UM_M",
        help="largest strain noise of one ZOI for the test, um/m",
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
    options.add_config_file(parser)
    options.add_options(
        parser, "measurement", *(name for name in options.MEASURE if name != "strain"), "axis"
    )
    options.add_lens(parser)
    options.add_options(parser, "view of --watch", "no-view")
    options.add_verbose(parser)
    options.add_help_all(parser)


def command(arguments: argparse.Namespace) -> int:
    """Run the check; 0 for GO, 6 for NO-GO."""
    screen = TerminalScreen()
    config = options.configured(arguments)
    if not config.camera.address:
        raise ConfigError("no camera is given; use --camera ADDRESS (see phasedic devices)")
    target = None if arguments.target is None else arguments.target * 1e-6
    cameras = camera_configs(config, options.overrides(arguments))
    snapshots = {name: _snapshot_of(name, arguments.snapshot) for name in cameras}
    for path in filter(None, snapshots.values()):
        options.require_new(path, *options.PICTURES)
    check_load_port(config.load.address)
    if arguments.watch:
        first, one = next(iter(cameras.items()))
        if first:
            screen.print(
                Message("--watch looks at the {first} only; without it all cameras are checked", word(first))
            )
        with interrupts() as stop:
            figures = watch(one, target, screen, stop)
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
