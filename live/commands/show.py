"""``phasedic show``: show a finished run in the view, with a time slider."""

from __future__ import annotations

import argparse
import threading
from pathlib import Path

from live.commands.options import add_gauge_option, add_gauges, add_time_span, whole
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
    parser.add_argument("--every", type=whole(1), metavar="N", help=words)
    add_gauge_option(parser)
    words = "port of the view on 127.0.0.1 (default 9876)"
    parser.add_argument("--port", type=whole(1024, 65535), default=9876, help=words)
    words = "write this file instead of showing it, for: rerun FILE.rrd"
    parser.add_argument("--rrd", metavar="FILE.rrd", help=words)


def command(arguments: argparse.Namespace) -> int:
    """``phasedic show``."""
    screen, stop = TerminalScreen(), threading.Event()
    request = ShowRequest(arguments.start_s, arguments.end_s, arguments.every)
    rrd = Path(arguments.rrd) if arguments.rrd else None
    if rrd is not None:
        check_free(rrd)
    with signals(stop.set, None), open_run(arguments.run) as run:
        if arguments.more_gauges:
            add_gauges(run, Path(arguments.more_gauges))
        show(run, request, screen, stop, port=arguments.port, rrd=rrd)
    if rrd is not None:
        screen.print(str(rrd))
    return 0
