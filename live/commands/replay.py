"""``phasedic replay``: measure a recorded session or pictures."""

from __future__ import annotations

import argparse
import datetime
import threading
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from acquire.text import Message
from live.commands.arguments import not_empty
from live.commands.exit_codes import EXIT_WORDS
from live.commands.options import (
    FORCES,
    OF_PICTURES,
    add_as_measured,
    add_measure,
    add_options,
    add_picture_order,
    add_time_span,
    in_picture_order,
    overrides,
)
from live.commands.sides import TABLE, put_together
from live.commands.signals import signals
from live.config.cameras import BACK, FRONT, SIDES
from live.pipeline.screen import Screen
from live.results.folder import check_folder, make_folder
from live.ui.terminal.cameras_screen import CamerasScreen
from live.ui.terminal.screen import TerminalScreen
from live.ui.terminal.summary import print_summary

if TYPE_CHECKING:
    from live.replay.replay import Replayed
    from live.replay.source import ReplayRequest


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic replay``."""
    parser.add_argument(
        "source",
        help="folder of a run (of one camera or several), session.h5, pictures in a folder, 'files:shots/*.tif' or"
        " 'video:file.mp4'",
    )
    add_as_measured(parser)
    add_time_span(parser)
    add_picture_order(parser, dest="measure.order")
    words = "forces: the export of a testing machine, or a CSV with a header such as file,force_kN or time_s,force_N"
    parser.add_argument("--load", dest="forces", metavar="FILE.csv", help=words)
    add_options(parser, "file of forces", *FORCES)
    words = "maps of what each place does over all instants: strain over stress, over that of the region (mean) or of a"
    words += " gauge, or over time, and where it leaves its line"
    parser.add_argument("--response", metavar="stress|mean|GAUGE|time", type=not_empty, help=words)
    add_measure(parser, measure=OF_PICTURES)


def command(arguments: argparse.Namespace) -> int:
    """``phasedic replay``."""
    from live.commands.consumers import standard_consumers
    from live.commands.report import write_report
    from live.replay.replay import replay
    from live.replay.source import ReplayRequest
    from live.results.sides.folder import recorded_cameras_in

    request = ReplayRequest(
        source=in_picture_order(arguments.source, arguments.picture_order),
        as_measured=arguments.as_measured,
        start_s=arguments.start_s,
        end_s=arguments.end_s,
        reference=arguments.reference,
        config_file=Path(arguments.config) if arguments.config else None,
        overrides=_overrides(arguments),
        forces=Path(arguments.forces) if arguments.forces else None,
        response=arguments.response or "",
    )
    screen, stopping = TerminalScreen(), threading.Event()
    if names := recorded_cameras_in(Path(arguments.source)):
        return _replay_cameras(request, names, screen, stopping)
    with signals(stopping.set, screen.print):
        done = replay(request, screen, stopping, standard_consumers(screen))
    report = done.config.output.report
    _print(done, screen, verbose=arguments.verbose, with_report=report)
    if report:
        write_report(done.folder, screen)
    return _ended(done.exit_code, screen)


def _print(done: Replayed, screen: Screen, *, verbose: bool = False, with_report: bool = False) -> None:
    print_summary(
        screen,
        done.run_state,
        done.test,
        done.folder,
        done.lines,
        verbose=verbose,
        with_report=with_report,
    )


def _ended(code: int, screen: Screen) -> int:
    if code in EXIT_WORDS:
        screen.print(Message("exit code {code}: {words}", code, EXIT_WORDS[code]))
    return code


def _replay_cameras(
    request: ReplayRequest, names: tuple[str, ...], screen: Screen, stopping: threading.Event
) -> int:
    """Replay the cameras of a test, one after the other; front and back are put together."""
    from live.commands.consumers import standard_consumers
    from live.commands.report import write_report
    from live.replay.replay import replay
    from live.results.run_folder import SESSION

    given, codes = dict(request.overrides), []
    report = given.pop("output.report", False)
    check_folder(given.get("output.dir"))
    folder = make_folder(given.get("output.dir"), datetime.datetime.now(datetime.UTC))
    with signals(stopping.set, screen.print):
        for name in names:
            own_screen = CamerasScreen(screen).of(name)
            own = replace(
                request,
                source=str(Path(request.source) / name / SESSION),
                overrides={**given, "output.dir": str(folder / name)},
            )
            done = replay(own, own_screen, stopping, standard_consumers(own_screen))
            _print(done, own_screen)
            codes.append(done.exit_code)
    if names == SIDES:
        put_together(folder / FRONT, folder / BACK, folder / TABLE, screen)
    if report:
        write_report(folder, screen)
    return _ended(max(codes), screen)


def _overrides(arguments: argparse.Namespace) -> dict[str, Any]:
    """The values that the command line sets, and the file of the forces as metadata."""
    given = overrides(arguments)
    return (
        given
        if arguments.forces is None
        else {**given, "metadata.forces": str(Path(arguments.forces).absolute())}
    )
