"""``phasedic check --watch``: the check in the terminal and in the view, three times a second."""

from __future__ import annotations

import math
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, TextIO

from acquire.text.printable import printable
from live.config.loading import Config
from live.config.sections import DEFAULT_REFERENCE_BURST
from live.pipeline.screen import Screen
from live.setup.check.check_line import CheckLine
from live.setup.check.check_list import CheckFigures
from live.setup.check.disk import disk_lines, write_rate
from live.setup.check.quick_check import QUICK_FRAMES, QuickCheck, QuickChecker, RollingFrames
from live.setup.check.verdict import check_lines
from live.setup.frames import camera_of, report_warnings
from live.ui.rerun.messages import ViewSetup
from live.ui.rerun.view import View, spawn_viewer

if TYPE_CHECKING:
    from analysis import ZoiGrid

PERIOD_S = 1 / 3
BAR_LENGTH = 30
CLOSE_S = 5.0
MAX_NOTES = 4  # the newest


def watch(config: Config, target: float | None, screen: Screen, stopped: Callable[[], bool]) -> CheckFigures:
    """Repeat the check until ``stopped`` or the camera ends; returns the figures of the last frames.

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
        while not (stopped() or rolling.over):
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
            while not (stopped() or rolling.over) and time.monotonic() < due:
                time.sleep(0.02)
        last = rolling.last(frames)
    display.end()
    return checker.full(last)


def peak_line(quick: QuickCheck) -> str:
    """The sharpness as a bar that ends at the peak."""
    if not math.isfinite(quick.of_peak):
        return "sharpness: no pattern is visible"
    full = round(BAR_LENGTH * min(quick.of_peak, 1.0))
    bar = "#" * full + "." * (BAR_LENGTH - full)
    return f"sharpness {quick.figures.sharpness:.3f} [{bar}] {quick.of_peak:.0%} of the peak {quick.peak:.3f}"


def blur_line(quick: QuickCheck) -> list[str]:
    """The blur since the sharpest picture; nothing where it is not known."""
    text = quick.blur.text
    return [f"          {text} than the sharpest picture so far"] if text else []


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


ShowCheck = Callable[[RollingFrames, QuickCheck, list[CheckLine]], None]


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
