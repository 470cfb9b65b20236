"""``phasedic replay``: measure a recorded session or pictures."""

from __future__ import annotations

import argparse
import threading
from pathlib import Path
from typing import Any

from live.commands.exit_codes import EXIT_WORDS
from live.commands.options import add_as_measured, add_measure, add_time_span, overrides
from live.commands.signals import signals
from live.ui.terminal.screen import TerminalScreen
from live.ui.terminal.summary import print_summary


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic replay``."""
    parser.add_argument(
        "source",
        help="folder of a run, session.h5, pictures in a folder, 'files:shots/*.tif' or 'video:file.mp4'",
    )
    add_as_measured(parser)
    add_time_span(parser)
    parser.add_argument("--reference", metavar="FILE", help="reference picture (default: the first)")
    words = "forces by file or time_s: a CSV with a header such as file,force_kN"
    parser.add_argument("--load", dest="forces", metavar="FILE.csv", help=words)
    add_measure(parser)


def command(arguments: argparse.Namespace) -> int:
    """``phasedic replay``."""
    from live.commands.consumers import standard_consumers
    from live.replay.replay import replay
    from live.replay.source import ReplayRequest

    request = ReplayRequest(
        source=arguments.source,
        as_measured=arguments.as_measured,
        start_s=arguments.start_s,
        end_s=arguments.end_s,
        reference=arguments.reference,
        config_file=Path(arguments.config) if arguments.config else None,
        overrides=_overrides(arguments),
        forces=Path(arguments.forces) if arguments.forces else None,
    )
    screen, stopping = TerminalScreen(), threading.Event()
    with signals(stopping.set, screen.print):
        done = replay(request, screen, stopping, standard_consumers(screen))
    print_summary(
        screen,
        done.run_state,
        done.config.specimen,
        done.folder,
        done.lines,
        verbose=arguments.verbose,
        with_report=done.config.output.report,
    )
    if done.config.output.report:
        from live.commands.report import write_report

        write_report(done.folder, screen)
    if done.exit_code in EXIT_WORDS:
        screen.print(f"exit code {done.exit_code}: {EXIT_WORDS[done.exit_code]}")
    return done.exit_code


def _overrides(arguments: argparse.Namespace) -> dict[str, Any]:
    """The values that the command line sets, and the file of the forces as metadata."""
    given = overrides(arguments)
    return (
        given
        if arguments.forces is None
        else {**given, "metadata.forces": str(Path(arguments.forces).absolute())}
    )
