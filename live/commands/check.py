"""``phasedic check``: judge a burst of the still specimen; exit code 6 where it is not ready."""

from __future__ import annotations

import argparse

from acquire.errors import ConfigError
from live.check.check import take
from live.check.judge import judge
from live.commands.exit_codes import NOT_READY
from live.commands.options import add_measure, add_options, configured
from live.tell import Screen


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic check``."""
    add_options(parser, "camera", "camera", "crop")
    parser.add_argument(
        "--target", type=float, metavar="UM_M", help="strain noise of one ZOI that is needed, um/m"
    )
    add_measure(parser)


def command(arguments: argparse.Namespace) -> int:
    """Run the check; 0 ready, 6 not ready."""
    screen = Screen()
    config = configured(arguments)
    if not config.camera.address:
        raise ConfigError("no camera is given; use --camera ADDRESS (see phasedic devices)")
    taken, means, camera = take(config)
    lines = judge(taken, means, camera, config, arguments.target)
    for line in lines:
        screen.say(line.text())
    ready = all(line.good for line in lines)
    screen.say("ready" if ready else "not ready: see what to look at above")
    return 0 if ready else NOT_READY
