"""``phasedic export``: a finished run in the format of another program."""

from __future__ import annotations

import argparse
from pathlib import Path

from acquire.errors import ConfigError
from acquire.text import Message
from live.commands.options import POSITIVE, add_gauge_option, add_gauges, number
from live.results.export.formats import FORMATS, ExportRequest, export
from live.results.export.job import ExportOptions
from live.results.quantities import Display
from live.results.run_folder import RunFolder, open_run
from live.ui.terminal.screen import TerminalScreen

FPS = 10.0
_FILMS = ("mp4", "gif")
_PAINTED = ("png", *_FILMS)
BELONGS_TO = {"layout": ("csv",), "fps": _FILMS, "limit": _PAINTED, "no_picture": _PAINTED}
"""Options that only some formats take."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic export``."""
    parser.add_argument("run", help="folder of a run or replay, or a strain.h5")
    parser.add_argument("--to", required=True, choices=tuple(FORMATS), help="format")
    parser.add_argument("--out", metavar="PATH", help="new file or folder (default: in RUN/export)")
    words = (
        "maps separated by commas, all, or response: those of replay --response (default: the usual maps; for pictures"
        " and stacks the axial strain)"
    )
    parser.add_argument("--fields", metavar="NAMES", help=words)
    parser.add_argument("--from", dest="start_s", type=number(), metavar="S", help="begin at this time, s")
    parser.add_argument("--until", dest="end_s", type=number(), metavar="S", help="end at this time, s")
    words = "csv: long (default): a line per ZOI and instant; wide: a file per map; means: only these"
    parser.add_argument("--layout", choices=("long", "wide", "means"), help=words)
    add_gauge_option(parser)
    add_display(parser)
    films = parser.add_argument_group("pictures and films")
    films.add_argument(
        "--fps", type=number(0.1, 240), metavar="N", help="instants per second of film (default 10)"
    )
    films.add_argument("--limit", type=POSITIVE, help="colour range -LIMIT to LIMIT (default: automatic)")
    films.add_argument("--no-picture", action="store_true", help="maps on plain grey")


def add_display(parser: argparse.ArgumentParser) -> None:
    """Units and axes."""
    group = parser.add_argument_group("units and axes")
    group.add_argument(
        "--mm", action="store_true", help="lengths in mm, with --scale or the scale of the test"
    )
    group.add_argument("--scale", type=number(), metavar="MM/PX", help="size of one pixel, mm")
    group.add_argument("--y-up", action="store_true", help="y axis upwards: v and exy change sign")
    group.add_argument("--percent", action="store_true", help="strains in percent")


def display_of(arguments: argparse.Namespace, stored: float | None = None) -> Display:
    """The requested units and axes; ``stored`` is the scale of the test, mm/px.

    Raises
    ------
    ConfigError
        mm without a scale, or a scale without mm.
    """
    if arguments.mm and arguments.scale is None and stored is None:
        raise ConfigError("--mm needs the scale: give --scale with the size of one pixel in mm")
    if arguments.scale is not None and not arguments.mm:
        raise ConfigError("--scale has no effect without --mm; give both")
    scale = (stored if arguments.scale is None else arguments.scale) if arguments.mm else None
    return Display(scale, arguments.y_up, arguments.percent)


def command(arguments: argparse.Namespace) -> int:
    """``phasedic export``."""
    _refuse_without_effect(arguments)
    screen = TerminalScreen()
    with open_run(arguments.run) as run:
        if arguments.more_gauges:
            add_gauges(run, Path(arguments.more_gauges))
        screen.print(str(export(run, _request(arguments, run), screen)))
        for note in run.notes:
            screen.print(Message("note: {what}", note))
    return 0


def _refuse_without_effect(arguments: argparse.Namespace) -> None:
    for name, formats in BELONGS_TO.items():
        if getattr(arguments, name) not in (None, False) and arguments.to not in formats:
            option = f"--{name.replace('_', '-')}"
            raise ConfigError(
                "{option} has no effect with --to {format}; it belongs to {formats}",
                option,
                arguments.to,
                ", ".join(formats),
            )


def _request(arguments: argparse.Namespace, run: RunFolder) -> ExportRequest:
    return ExportRequest(
        arguments.to,
        None if arguments.out is None else Path(arguments.out),
        arguments.fields,
        arguments.start_s,
        arguments.end_s,
        display_of(arguments, run.mm_per_px),
        ExportOptions(
            arguments.layout or "long", arguments.fps or FPS, arguments.limit, not arguments.no_picture
        ),
    )
