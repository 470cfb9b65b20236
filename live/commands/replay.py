"""``phasedic replay``: a session or pictures through the measuring path."""

from __future__ import annotations

import argparse
import threading
from pathlib import Path

from live.commands.overrides import overrides
from live.commands.run import signals
from live.tell import Screen, file_lines, summary_lines


def replay_command(arguments: argparse.Namespace) -> int:
    """``phasedic replay``."""
    from live.replay import ReplayRequest, replay

    request = ReplayRequest(
        source=arguments.source,
        as_measured=arguments.as_measured,
        start_s=arguments.start_s,
        end_s=arguments.end_s,
        reference=arguments.reference,
        config_file=Path(arguments.config) if arguments.config else None,
        overrides=overrides(arguments),
    )
    screen, stopping = Screen(), threading.Event()
    with signals(stopping.set, screen.say):
        done = replay(request, screen, stopping)
    screen.say()
    for line in [
        *summary_lines(done.outputs.history, done.loads, done.config.specimen),
        *file_lines(done.folder),
    ]:
        screen.say(line)
    return done.exit_code
