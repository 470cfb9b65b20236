"""``phasedic show``: show a finished run in the view, with a time slider."""

from __future__ import annotations

import argparse
import threading
from pathlib import Path

from acquire.errors import ConfigError
from live.commands.options import add_gauge_option, add_gauges, add_time_span
from live.commands.signals import signals
from live.config.new_files import check_free
from live.results.run_folder import open_run
from live.ui.rerun.playback import ShowRequest, show
from live.ui.terminal.screen import TerminalScreen


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic show``."""
    parser.add_argument("run", help="folder of a run or replay, or a strain.h5")
    add_time_span(parser)
    words = "show one instant in N (default: as many as the memory of the viewer holds)"
    parser.add_argument("--every", type=int, metavar="N", help=words)
    add_gauge_option(parser)
    parser.add_argument("--port", type=int, default=9876, help="port of the view on 127.0.0.1 (default 9876)")
    words = "write this file instead of showing it, for: rerun FILE.rrd"
    parser.add_argument("--rrd", metavar="FILE.rrd", help=words)


def command(arguments: argparse.Namespace) -> int:
    """``phasedic show``."""
    _check(arguments)
    screen, stop = TerminalScreen(), threading.Event()
    request = ShowRequest(arguments.start_s, arguments.end_s, arguments.every)
    rrd = Path(arguments.rrd) if arguments.rrd else None
    with signals(stop.set, None), open_run(arguments.run) as run:
        if arguments.more_gauges:
            add_gauges(run, Path(arguments.more_gauges))
        show(run, request, screen, stop, port=arguments.port, rrd=rrd)
    if rrd is not None:
        screen.print(str(rrd))
    return 0


def _check(arguments: argparse.Namespace) -> None:
    if arguments.every is not None and arguments.every < 1:
        raise ConfigError("--every {n} is not possible; give a whole number from 1", arguments.every)
    if not 1024 <= arguments.port <= 65535:
        raise ConfigError("--port {port} is not possible; give 1024 to 65535", arguments.port)
    if arguments.rrd:
        check_free(Path(arguments.rrd))
