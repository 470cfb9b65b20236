"""``phasedic check``: judge a burst of the still specimen; exit code 6 where it is not ready."""

from __future__ import annotations

import argparse
from pathlib import Path

from acquire.errors import ConfigError
from live.check.check import NOT_READY, take
from live.check.judge import judge
from live.commands.overrides import overrides
from live.setup import load_config
from live.tell import Screen


def check(arguments: argparse.Namespace) -> int:
    """Run the check; 0 ready, 6 not ready."""
    screen = Screen()
    config = load_config(Path(arguments.config) if arguments.config else None, overrides(arguments))
    if not config.camera.address:
        raise ConfigError("no camera is given; use --camera ADDRESS (see phasedic devices)")
    taken, means, camera = take(config)
    lines = judge(taken, means, camera, config, arguments.target)
    for line in lines:
        screen.say(line.text())
    ready = all(line.good for line in lines)
    screen.say("ready" if ready else "not ready: see what to look at above")
    return 0 if ready else NOT_READY
