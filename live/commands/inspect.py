"""``phasedic inspect``: one ZOI of a session, its windowed spectrum and its phases.

live.setup.pattern.spectrum draws the figure and needs matplotlib. Heavy modules are imported when the command runs.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from acquire.errors import ConfigError, DataError
from acquire.text import Message
from live.commands.options import whole
from live.config.values import numbers_of
from live.ui.terminal.screen import print_line

if TYPE_CHECKING:
    from analysis.field import ZoiGrid


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic inspect``."""
    parser.add_argument("session", help="session.h5, or the folder of its run")
    parser.add_argument("--zoi", required=True, metavar="R,C", help="row and column of the ZOI in the grid")
    parser.add_argument(
        "--frame", type=whole(0), required=True, metavar="N", help="number of the frame (or burst), from 0"
    )
    parser.add_argument(
        "--reference", type=whole(0), default=0, metavar="N", help="reference frame (default 0)"
    )
    parser.add_argument("--size", type=whole(1), metavar="PX", help="side of a ZOI (default: as recorded)")
    parser.add_argument("--step", type=whole(1), metavar="PX", help="distance of ZOIs (default: as recorded)")
    parser.add_argument("--out", default="zoi.png", metavar="FILE", help="the figure (default zoi.png)")


def command(arguments: argparse.Namespace) -> int:
    """``phasedic inspect SESSION --zoi R,C --frame N``."""
    from acquire.session import Session
    from live.setup.pattern.outcome import figure, save_new
    from live.setup.pattern.spectrum import draw_spectrum, zoi_spectrum

    row, column = _row_and_column(arguments.zoi)
    out = Path(arguments.out)
    with Session.open(arguments.session) as session:
        grid = _grid_of(session, arguments)
        rows, columns = grid.shape
        if not (0 <= row < rows and 0 <= column < columns):
            raise ConfigError(
                "--zoi {given}: the grid has rows 0 to {last_row} and columns 0 to {last_column}",
                *(arguments.zoi, rows - 1, columns - 1),
            )
        pictures = [_picture(session, n) for n in (arguments.reference, arguments.frame)]
    left, top = int(grid.first_x[column]), int(grid.first_y[row])
    spectrum = zoi_spectrum(pictures[0], pictures[1], left, top, grid.size)
    drawn = figure(15, 4)
    title = Message(
        "{session}: ZOI {row},{column} ({size} px at x {left}, y {top}), frame {frame}",
        *(Path(arguments.session).name, row, column, grid.size, left, top, arguments.frame),
    )
    draw_spectrum(drawn, spectrum, title)
    save_new(drawn, out)
    print_line(title)
    found = (spectrum.u, spectrum.v, int(spectrum.used.sum()))
    print_line(Message("u = {u:.4f} px, v = {v:.4f} px from {n} frequencies", *found))
    print_line(Message("figure: {path}", out))
    return 0


def _row_and_column(text: str) -> tuple[int, int]:
    try:
        row, column = numbers_of(text, int, 2)
    except ValueError:
        raise ConfigError("--zoi {given}: give row,column of the ZOI, for example 3,5", text) from None
    return row, column


def _picture(session: Any, number: int) -> Any:
    """A frame, or the mean of a burst where only bursts were recorded."""
    return session.frame(number).image if len(session) else session.burst(number).mean


def _grid_of(session: Any, arguments: argparse.Namespace) -> ZoiGrid:
    """The grid of the session's configuration, or with the given size and step."""
    from analysis.field import Roi, ZoiGrid
    from live.config.loading import from_dict
    from live.setup.grid import whole_picture

    measure = from_dict({"measure": session.config.get("measure", {})}, {}, str(session.path)).measure
    height, width = _picture(session, 0).shape
    size = measure.zoi if arguments.size is None else arguments.size
    step = measure.step if arguments.step is None else arguments.step
    roi = measure.roi if isinstance(measure.roi, tuple) else whole_picture(width, height, size)
    try:
        return ZoiGrid.cover(Roi(*roi), size, step)
    except ValueError as error:
        raise DataError("{path}: {why}; give --size and --step", session.path, error) from error
