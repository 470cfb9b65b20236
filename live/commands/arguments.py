"""The commands there are, and the parser of their arguments.

Only the module of the command that was asked for is imported, so that ``phasedic --help`` answers at
once. Each module has ``add_arguments(parser)`` and ``command(arguments) -> exit code``.
"""

from __future__ import annotations

import argparse
import importlib
from collections.abc import Callable, Sequence

from live.commands.exit_codes import EXIT_CODES

COMMANDS = {
    "run": ("live.commands.run", "measure live, recording everything"),
    "demo": ("live.commands.demo", "the same on a simulated tensile test, compared with its truth"),
    "replay": ("live.commands.replay", "measure a recorded session, or any folder of pictures"),
    "map": ("live.commands.map", "draw a map of the results over a picture, as a PNG"),
    "characterise": (
        "live.characterise.command",
        "how well this measures: the paper reproduced, peers, or your own pattern",
    ),
    "inspect": ("live.commands.inspect", "one ZOI of a session: its spectrum and its phases"),
    "check": (
        "live.commands.check",
        "is the picture good enough? measured before the test; go or no-go",
    ),
    "average": ("live.commands.average", "average frames into a dark or flat frame"),
    "load-check": (
        "live.commands.load_check",
        "listen to a load cell: rate, range, noise, flags; ready or not",
    ),
    "identify": ("live.commands.identify", "find out what talks on a serial port; only listens"),
    "load-calibrate": (
        "live.commands.load_calibrate",
        "calibrate a load cell: tare, known load, accept",
    ),
    "recover": ("live.commands.recover", "copy what is readable of a damaged or unfinished session"),
    "devices": ("live.commands.devices", "list cameras with their formats, and serial ports"),
}

Command = Callable[[argparse.Namespace], int]


def parse(argv: Sequence[str]) -> tuple[Command, argparse.Namespace]:
    """The command that was asked for, and its arguments; help and bad usage end the program (exit code 2)."""
    parser = argparse.ArgumentParser(
        prog="phasedic",
        description="Live strain measurement by phase-DIC: frames, load, strain maps while the specimen is pulled.",
        epilog=EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=_version())
    subparsers = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    asked = next((word for word in argv if word in COMMANDS), "")
    for name, (module, words) in COMMANDS.items():
        own = subparsers.add_parser(
            name, help=words, epilog=EXIT_CODES, formatter_class=argparse.RawDescriptionHelpFormatter
        )
        if name == asked:
            importlib.import_module(module).add_arguments(own)
    arguments = parser.parse_args(argv)
    command: Command = importlib.import_module(COMMANDS[arguments.command][0]).command
    return command, arguments


def _version() -> str:
    from live import VERSION

    return f"phasedic {VERSION}"
