"""``phasedic scale``: measure mm per px from two points, a board, or the width of the specimen."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

from acquire.errors import ConfigError
from acquire.text import Amount, Message
from live.commands.options import POSITIVE, add_options, add_verbose, configured, number
from live.config.loading import Config
from live.config.rig_file import write_rig
from live.config.values import AUTO, Number, numbers_of
from live.pipeline.consumer import Screen
from live.setup.region import first_look, region_of
from live.setup.scale import OUT_OF_PLANE_MM, Board, Scale, false_strain, from_board, from_points, from_width
from live.ui.terminal.screen import TerminalScreen

WIDTH_OF_RIG = -1.0  # --width without a number


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic scale``."""
    parser.add_argument(
        "--config", metavar="FILE", help="rig file to which the scale is written (default: print only)"
    )
    add_options(parser, "picture", "camera", "crop", "roi", "mask", "axis")
    how = parser.add_argument_group("method, one of these")
    how.add_argument("--points", metavar="X1,Y1,X2,Y2", help="two points in px, with --length")
    how.add_argument("--length", type=POSITIVE, metavar="MM", help="distance between the two points")
    add_board(how)
    how.add_argument(
        "--width", type=POSITIVE, nargs="?", const=WIDTH_OF_RIG, metavar="MM",
        help="width of the specimen, which is found in the picture (default: width_mm of the rig file)",
    )  # fmt: skip
    parser.add_argument(
        "--sigma",
        type=number(0),
        default=0.0,
        metavar="MM",
        help="standard uncertainty of the length, the width or the board (default 0)",
    )
    parser.add_argument(
        "--stand-off", type=POSITIVE, metavar="MM", help="distance from the camera to the specimen"
    )
    add_verbose(parser)


def add_board(group: Any) -> None:
    """Add the options of a board."""
    words = "board with columns x rows of inner corners, with --square"
    group.add_argument("--checkerboard", metavar="CxR", help=words)
    words = "board with columns x rows of squares, with --square, --marker, --dictionary"
    group.add_argument("--charuco", metavar="CxR", help=words)
    group.add_argument("--square", type=POSITIVE, metavar="MM", help="side of a square of the board")
    group.add_argument("--marker", type=POSITIVE, metavar="MM", help="side of a marker of a ChArUco board")
    words = "its dictionary of markers (default 4X4_50)"
    group.add_argument("--dictionary", default="4X4_50", metavar="NAME", help=words)


def command(arguments: argparse.Namespace) -> int:
    """``phasedic scale``."""
    screen = TerminalScreen()
    _check(arguments)
    config = configured(arguments)
    stand_off = arguments.stand_off or config.scale.stand_off_mm
    scale = _scale(arguments, config, stand_off, screen)
    screen.print(
        Message(
            "scale: {scale:.6g} ± {sigma:.2g} mm/px ({relative:.2%}), {method}",
            *(scale.mm_per_px, scale.sigma, scale.relative, scale.method),
        )
    )
    for remark in scale.remarks:
        screen.print(Message("LOOK  {what}", remark))
    _print_false_strain(stand_off, screen)
    if arguments.config:
        write_rig(Path(arguments.config), scale.changes(arguments.stand_off))
        screen.print(Message("written to {path}; the former file is {path}.bak", arguments.config))
    return 0


def _check(arguments: argparse.Namespace) -> None:
    ways = ("points", "checkerboard", "charuco", "width")
    given = [way for way in ways if getattr(arguments, way) is not None]
    if len(given) != 1:
        raise ConfigError(
            "give one of {options}, not {n} of them", ", ".join(f"--{way}" for way in ways), len(given)
        )


def _scale(arguments: argparse.Namespace, config: Config, stand_off: float | None, screen: Screen) -> Scale:
    if arguments.points is not None:
        x1, y1, x2, y2 = _numbers(arguments.points, ",", 4, float, "--points", "12,30,840,32")
        return from_points((x1, y1, x2, y2), _needed(arguments, "length"), arguments.sigma)
    if not config.camera.address:
        raise ConfigError("no camera is given; use --camera ADDRESS or --config rig.toml")
    first = first_look(config, screen)
    board = board_of(arguments)
    if board is not None:
        return from_board(first.picture, board, arguments.sigma, stand_off)
    width = config.specimen.width_mm if arguments.width == WIDTH_OF_RIG else arguments.width
    if width is None:
        raise ConfigError(
            "--width: give the width of the specimen in mm, or specimen.width_mm in the rig file"
        )
    searched = replace(config, measure=replace(config.measure, roi=AUTO, mask=None))
    region = region_of(searched, first.picture, first.noise)
    return from_width(first.picture, region, config.specimen.first_axis, width, arguments.sigma)


def board_of(arguments: argparse.Namespace) -> Board | None:
    """The board of the arguments; None where they name none."""
    if arguments.checkerboard is not None and arguments.charuco is not None:
        raise ConfigError("give one of --checkerboard and --charuco, not both")
    if arguments.checkerboard is None and arguments.charuco is None:
        return None
    option = "--charuco" if arguments.charuco else "--checkerboard"
    columns, rows = _numbers(arguments.charuco or arguments.checkerboard, "x", 2, int, option, "9x6")
    marker = _needed(arguments, "marker") if arguments.charuco else 0.0
    return Board(columns, rows, _needed(arguments, "square"), marker, arguments.dictionary)


def _needed(arguments: argparse.Namespace, name: str) -> float:
    value: float | None = getattr(arguments, name)
    if value is None:
        raise ConfigError("--{name} MM is needed with this", name)
    return value


def _numbers(text: str, mark: str, count: int, kind: type[Number], option: str, example: str) -> list[Number]:
    try:
        return numbers_of(text, kind, count, mark)
    except ValueError:
        raise ConfigError(
            "{option} {given}: give {n} numbers, as {example}", option, text, count, example
        ) from None


def _print_false_strain(stand_off: float | None, screen: Screen) -> None:
    moved = Message("{distance:g} mm toward the camera", OUT_OF_PLANE_MM)
    if stand_off is None:
        screen.print(Message("give --stand-off MM for the false strain of {moved}", moved))
        return
    strain = Amount("strain", false_strain(stand_off))
    screen.print(
        Message(
            "{moved} at a stand-off of {distance:g} mm gives a false strain of {strain} (exx and eyy)",
            *(moved, stand_off, strain),
        )
    )
