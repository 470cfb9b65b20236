"""The commands there are, and the parser of their arguments.

Only the module of the command that was asked for is imported, so that ``phasedic --help`` answers at
once. Each module has ``add_arguments(parser)`` and ``command(arguments) -> exit code``.

An example of each command, shown at the end of its ``--help``; a test has every one of them parsed.
"""

from __future__ import annotations

import argparse
import importlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from live.commands.exit_codes import EXIT_CODES

EXAMPLES = {
    "run": "phasedic run --camera '/dev/video0?format=Y12&fps=30' --load '/dev/ttyUSB0?protocol=ascii&unit=N' --report",
    "demo": "phasedic demo --specimen hole --seconds 20",
    "init": "phasedic init --camera '/dev/video0?format=Y12&fps=30' --section 20,2",
    "scale": "phasedic scale --camera /dev/video0 --points 100,200,900,200 --length 25",
    "page": "phasedic page --camera '/dev/video0?format=Y12&fps=30'",
    "replay": "phasedic replay 'shots/*.tif' --zoi 32 --step 8 --load forces.csv --section 20,2 --out out",
    "batch": "phasedic batch 'runs/*/session.h5' --zoi 32 --step 8 --section 20,2 --workers 4 --out asked-again",
    "study": "phasedic study runs/20261122T081747Z/session.h5 --zoi 24,32,48,64,96 --order 1,2 --roi all",
    "map": "phasedic map out/strain.h5 eyy.png --field eyy --over shots/0000.tif",
    "show": "phasedic show runs/20261122T081747Z --from 2 --to 10",
    "export": "phasedic export runs/20261122T081747Z --to vtk --fields u,v,eyy --mm --scale 0.02 --y-up",
    "report": "phasedic report runs/20261122T081747Z --field eyy --pdf",
    "characterise": "phasedic characterise --pattern reference.tif --target 100 --out characterisation",
    "inspect": "phasedic inspect runs/20261122T081747Z/session.h5 --zoi 10,12 --frame 40 --out zoi.png",
    "check": "phasedic check --camera '/dev/video0?format=Y12&fps=30' --target 50",
    "average": "phasedic average --camera /dev/video0 --frames 64 --out dark.tif",
    "load-check": "phasedic load-check --load '/dev/ttyUSB0?protocol=mt-sics' --seconds 10",
    "identify": "phasedic identify /dev/ttyUSB0",
    "load-calibrate": "phasedic load-calibrate --load '/dev/ttyUSB0?unit=g' --mass 5 --out cell.toml",
    "recover": "phasedic recover damaged.h5 --out rescued.h5",
    "warm-up": "phasedic warm-up",
    "devices": "phasedic devices",
    "completion": "phasedic completion > ~/.local/share/bash-completion/completions/phasedic",
}


def example_of(command: str) -> str:
    """As it stands in the help; nothing where there is none."""
    return f"example:\n  {EXAMPLES[command]}\n\n" if command in EXAMPLES else ""


@dataclass(frozen=True, slots=True)
class Entry:
    """The module of a command, and its line in the help."""

    module: str
    words: str


COMMANDS = {
    "run": Entry("live.commands.run", "measure live, recording everything"),
    "demo": Entry("live.commands.demo", "the same on a simulated tensile test, compared with its truth"),
    "page": Entry(
        "live.commands.page", "set up, measure and conclude in the browser: point instead of typing"
    ),
    "replay": Entry("live.commands.replay", "measure a recorded session, or any folder of pictures"),
    "batch": Entry("live.commands.batch", "many sessions or folders of pictures, replayed by workers"),
    "study": Entry("live.commands.study", "one test with many settings: noise against what they show"),
    "map": Entry("live.commands.map", "draw a map of the results over a picture, as a PNG"),
    "show": Entry("live.commands.show", "a finished run in the view, with a slider in time"),
    "export": Entry(
        "live.commands.export", "a finished run as csv, npz, mat, vtk, tiff, png, mp4, gif, r3xa"
    ),
    "report": Entry("live.commands.report", "a finished run, or several, as one page: HTML, PDF"),
    "characterise": Entry(
        "live.characterise.command",
        "how well this measures: the paper reproduced, peers, or your own pattern",
    ),
    "inspect": Entry("live.characterise.inspect", "one ZOI of a session: its spectrum and its phases"),
    "init": Entry(
        "live.commands.init", "from camera and specimen to a rig.toml: devices, region, ZOIs, gauges"
    ),
    "scale": Entry("live.commands.scale", "mm per px from two points, a board, or the width of the specimen"),
    "check": Entry(
        "live.commands.check", "is the picture good enough? measured before the test; go or no-go"
    ),
    "average": Entry("live.commands.average", "average frames into a dark or flat frame"),
    "load-check": Entry(
        "live.commands.load_check", "listen to a load cell: rate, range, noise, flags; ready or not"
    ),
    "identify": Entry("live.commands.identify", "find out what talks on a serial port; only listens"),
    "load-calibrate": Entry(
        "live.commands.load_calibrate", "calibrate a load cell: tare, known load, accept"
    ),
    "recover": Entry("live.commands.recover", "copy what is readable of a damaged or unfinished session"),
    "warm-up": Entry("live.commands.warm_up", "compile everything ahead of the first test"),
    "completion": Entry(
        "live.commands.completion", "a script that completes commands and options in the shell"
    ),
    "devices": Entry("live.commands.devices", "list cameras with their formats, and serial ports"),
}

_Plain = argparse.RawDescriptionHelpFormatter
Command = Callable[[argparse.Namespace], int]


def parse(argv: Sequence[str]) -> tuple[Command, argparse.Namespace]:
    """The command that was asked for, and its arguments; help and bad usage end the program (exit code 2)."""
    arguments = full_parser([word for word in argv if word in COMMANDS][:1]).parse_args(argv)
    command: Command = importlib.import_module(COMMANDS[arguments.command].module).command
    return command, arguments


def full_parser(known: Iterable[str]) -> argparse.ArgumentParser:
    """The parser of ``phasedic``; of the commands ``known`` with all their arguments."""
    parser = argparse.ArgumentParser(
        prog="phasedic",
        description="Live strain measurement by phase-DIC: frames, load, strain maps while the specimen is pulled.",
        epilog=EXIT_CODES,
        formatter_class=_Plain,
    )
    parser.add_argument("--version", action="version", version=_version())
    subparsers = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    asked = set(known)
    for name, entry in COMMANDS.items():
        own = subparsers.add_parser(
            name, help=entry.words, epilog=example_of(name) + EXIT_CODES, formatter_class=_Plain
        )
        if name in asked:
            importlib.import_module(entry.module).add_arguments(own)
    return parser


def _version() -> str:
    from live import VERSION

    return f"phasedic {VERSION}"
