"""``phasedic replay``: measure a recorded session or pictures."""

from __future__ import annotations

import argparse
import datetime
import threading
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from acquire.errors import exit_code_of_all
from live.commands import options
from live.commands.consumers import finish_test
from live.commands.process import signals
from live.config.effect import check_forces
from live.results.folder import check_folder, make_folder
from live.ui.terminal.screen import CamerasScreen, TerminalScreen

if TYPE_CHECKING:
    from live.replay.source import ReplayRequest


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic replay``."""
    parser.add_argument(
        "source",
        help="folder of a run (of one camera or several), session.h5, pictures in a folder, 'files:shots/*.tif' or"
        " 'video:file.mp4'",
    )
    options.add_as_measured(parser)
    options.add_time_span(parser)
    options.add_picture_order(parser, dest="measure.order")
    words = "forces: the export of a testing machine, or a CSV with a header such as file,force_kN or time_s,force_N"
    parser.add_argument("--load", dest="forces", metavar="FILE.csv", help=words)
    options.add_options(parser, "file of forces", *options.FORCES)
    options.add_measure(parser, measure=options.OF_PICTURES)


def command(arguments: argparse.Namespace) -> int:
    """``phasedic replay``."""
    from live.commands.consumers import standard_consumers
    from live.replay.replay import replay
    from live.replay.source import ReplayRequest

    given = _overrides(arguments)
    if arguments.forces is None:
        check_forces(given, "--load FILE.csv")
    request = ReplayRequest(
        source=options.in_picture_order(arguments.source, arguments.picture_order),
        as_measured=arguments.as_measured,
        start_s=arguments.start_s,
        end_s=arguments.end_s,
        reference=arguments.reference,
        config_file=Path(arguments.config) if arguments.config else None,
        overrides=given,
        forces=Path(arguments.forces) if arguments.forces else None,
    )
    screen, stopping = TerminalScreen(), threading.Event()
    every, requests = CamerasScreen(screen), _of_each(request)
    done = {}
    with signals(stopping.set, screen):
        for name, own in requests.items():
            done[name] = replay(own, every.of(name), stopping, standard_consumers(every.of(name)))
    folder = next(iter(done.values())).folder
    code = exit_code_of_all(one.exit_code for one in done.values())
    lines = {name: one.lines for name, one in done.items()}
    return finish_test(
        done, lines, folder.parent if len(done) > 1 else folder, code, screen, verbose=arguments.verbose
    )


def _of_each(request: ReplayRequest) -> dict[str, ReplayRequest]:
    """One for each camera by its name, with folders in one that is made; "" where the recording is of one alone."""
    from live.results.run_folder import SESSION
    from live.results.sides import recorded_cameras_in

    names, wanted = recorded_cameras_in(Path(request.source)), request.overrides.get("output.dir")
    if not names:
        return {"": request}
    check_folder(wanted)
    folder = make_folder(wanted, datetime.datetime.now(datetime.UTC))
    return {
        name: replace(
            request,
            source=str(Path(request.source) / name / SESSION),
            overrides={**request.overrides, "output.dir": str(folder / name)},
        )
        for name in names
    }


def _overrides(arguments: argparse.Namespace) -> dict[str, Any]:
    """The values that the command line sets, and the file of the forces as metadata."""
    given = options.overrides(arguments)
    return (
        given
        if arguments.forces is None
        else {**given, "metadata.forces": str(Path(arguments.forces).absolute())}
    )
