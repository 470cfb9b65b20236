"""The list of the commands, and the parser of their arguments.

The module of a command is imported only when the command is called, so that ``phasedic --help`` starts fast. Each
module has ``add_arguments(parser)`` and ``command(arguments) -> exit code``.

Words are taken as people type and drop them: with quotes that stayed, and patterns that the shell expanded.
"""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

from acquire.errors import EXIT_CODES, USAGE, ConfigError, PhasedicError
from acquire.text import Message, meant
from live.words.language import said_here

OF_PICTURES = ("replay", "check", "scale", "lens", "readout", "study", "average", "init", "run", "page")
"""Commands with one source of pictures: many files stand for it."""
_STORE = argparse._StoreAction  # of one value, where the last one counts
OF_SOURCES = ("--camera", "--back", "--beside")

# Shown at the end of the help of each command; a test parses them all.
EXAMPLES = {
    "run": "phasedic run --camera '/dev/video0?format=Y12&fps=30' --load '/dev/ttyUSB0?protocol=ascii&unit=N' --report",
    "demo": "phasedic demo --specimen hole",
    "examples": "phasedic examples first-hour",
    "docs": "phasedic docs troubleshooting",
    "init": "phasedic init --camera '/dev/video0?format=Y12&fps=30' --section 20,2",
    "scale": "phasedic scale --camera /dev/video0 --points 100,200,900,200 --length 25",
    "lens": "phasedic lens 'board/*.png' --checkerboard 9x6 --square 10 --out lens.toml",
    "readout": "phasedic readout '/dev/video0?exposure_us=2000' --lamp 100 --config rig.toml",
    "page": "phasedic page --camera '/dev/video0?format=Y12&fps=30'",
    "replay": "phasedic replay 'shots/*.tif' --zoi 32 --step 8 --load forces.csv --section 20,2 --out out",
    "batch": "phasedic batch 'runs/*/session.h5' --zoi 32 --step 8 --section 20,2 --workers 4 --out asked-again",
    "study": "phasedic study runs/20261122T081747Z/session.h5 --zoi 24,32,48,64,96 --order 1,2 --roi all",
    "sides": "phasedic sides runs/front runs/back",
    "map": "phasedic map out eyy.png --field eyy --over shots/0000.tif",
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

HELP_ALL = "--help-all"

Command = Callable[[argparse.Namespace], int]


def understood(argv: Sequence[str]) -> list[str]:
    """The words without quotes that were dropped with a path, and many pictures as the one source that they are.

    Raises
    ------
    ConfigError
        The pictures are neither a folder nor a pattern.
    """
    words = [_bare(word) for word in argv]
    if not words or words[0] not in OF_PICTURES:
        return words
    joined: list[str] = []
    while words:
        count = 0
        while count < len(words) and Path(words[count]).suffix and not words[count].startswith("-"):
            count += 1
        if count > 1 and all(map(os.path.isfile, words[:count])):
            of_option = bool(joined) and joined[-1].startswith("-") and joined[-1] not in OF_SOURCES
            joined += _joined(words[:count], of_option)
        else:
            count = max(count, 1)
            joined += words[:count]
        del words[:count]
    return joined


def _bare(word: str) -> str:
    if word[:1] not in ("'", '"') and not word.startswith("file://") and not word.endswith("/"):
        return word
    from acquire.addresses import as_typed

    return as_typed(word)


def _joined(files: Sequence[str], of_option: bool) -> list[str]:
    """The source of all files; the first of them may be the value of the option before."""
    for own in (1, 0) if of_option else (0,):
        if source := _source(files[own:]):
            return [*files[:own], source]
    example = Path(files[-1]).with_stem("*")
    raise ConfigError(
        "{n} files are neither a folder nor a pattern; quote the pattern: '{example}'", len(files), example
    )


def _source(files: Sequence[str]) -> str:
    """The folder or the pattern whose pictures are exactly those of ``files``; else empty."""
    from acquire.files.order import SUFFIXES, listed

    pictures = {Path(file) for file in files if Path(file).suffix.lower() in SUFFIXES}
    if not pictures:
        return ""
    ends, folder = {path.suffix for path in pictures}, str(Path(files[-1]).parent)
    start = os.path.commonprefix([str(path) for path in pictures])  # noqa: RUF071 (of the letters)
    pattern = f"{start}*{ends.pop() if len(ends) == 1 else ''}"
    return next((source for source in (folder, pattern) if set(listed(source)) == pictures), "")


def example_of(command: str) -> str:
    """The example of a command as shown in its help; empty without one."""
    return f"example:\n  {EXAMPLES[command]}\n\n" if command in EXAMPLES else ""


@dataclass(frozen=True, slots=True)
class Entry:
    """The module of a command, and its line in the help."""

    module: str
    help: str


COMMANDS = {
    "run": Entry("live.commands.run", "measure live and record the session"),
    "demo": Entry("live.commands.demo", "measure a simulated tensile test and compare with its truth"),
    "examples": Entry(
        "live.commands.examples", "copy examples to try: pictures of two tests, Python, devices of your own"
    ),
    "docs": Entry("live.commands.docs", "show a page of the documentation, or list them"),
    "page": Entry("live.commands.page", "set up, measure and evaluate in the browser"),
    "replay": Entry("live.commands.replay", "measure a recorded session or a folder of pictures"),
    "batch": Entry("live.commands.batch", "replay many sessions or folders of pictures in parallel"),
    "study": Entry("live.commands.study", "measure one test with many settings: noise against resolution"),
    "sides": Entry("live.commands.sides", "mean and bending of two runs: front and back of one specimen"),
    "map": Entry("live.commands.map", "draw a map of the results over a picture, as a PNG"),
    "show": Entry("live.commands.show", "show a finished run in the view, with a time slider"),
    "export": Entry(
        "live.commands.export", "export a finished run as csv, npz, mat, vtk, tiff, png, mp4, gif, r3xa"
    ),
    "report": Entry("live.commands.report", "report one or several finished runs as a page: HTML, PDF"),
    "characterise": Entry("live.commands.characterise", "measure the accuracy that your own pattern allows"),
    "inspect": Entry("live.commands.inspect", "show one ZOI of a session: its spectrum and phases"),
    "init": Entry(
        "live.commands.init", "find devices and specimen and write a rig.toml: region, ZOIs, gauges"
    ),
    "scale": Entry(
        "live.commands.scale", "measure mm per px from two points, a board, or the width of the specimen"
    ),
    "lens": Entry(
        "live.commands.lens", "calibrate the lens from a board, or from shifted pictures of the specimen"
    ),
    "readout": Entry(
        "live.commands.readout", "measure the readout time of a rolling shutter: from a lamp, or by motion"
    ),
    "check": Entry("live.commands.check", "check picture and load cell before a test: GO or NO-GO"),
    "average": Entry("live.commands.average", "average frames to a dark or flat frame"),
    "load-check": Entry(
        "live.commands.load_check", "check a load cell: rate, range, noise, flags; ready or not"
    ),
    "identify": Entry(
        "live.commands.identify", "identify the device on a serial port; without --ask it only listens"
    ),
    "load-calibrate": Entry(
        "live.commands.load_calibrate", "calibrate a load cell: tare, known load, accept"
    ),
    "recover": Entry("live.commands.recover", "copy the readable part of a damaged or unfinished session"),
    "warm-up": Entry("live.commands.warm_up", "compile everything before the first test"),
    "completion": Entry(
        "live.commands.completion", "print a script with which the shell completes commands and options"
    ),
    "devices": Entry("live.commands.devices", "list cameras with their formats, and serial ports"),
}


class _AllOptions(argparse.RawDescriptionHelpFormatter):
    """Says headings, descriptions line by line, and the help of each option in the language of the terminal."""

    def start_section(self, heading: str | None) -> None:
        """Begin a group of options."""
        super().start_section(heading and said_here(heading))

    def add_text(self, text: str | None) -> None:
        """A description."""
        super().add_text(text and "\n".join(map(said_here, text.splitlines())))

    def _get_help_string(self, action: argparse.Action) -> str | None:
        return action.help and said_here(action.help)


class _HelpFormatter(_AllOptions):
    """Leaves out the expert options, which ``--help-all`` shows."""

    def add_usage(self, usage: Any, actions: Any, groups: Any, prefix: Any = None) -> None:
        """The usage without expert options."""
        super().add_usage(usage, [one for one in actions if not _is_expert(one)], groups, prefix)

    def add_argument(self, action: argparse.Action) -> None:
        """The help of one argument."""
        if not _is_expert(action):
            super().add_argument(action)


def _is_expert(action: argparse.Action) -> bool:
    return "." in action.dest and action.dest in _expert_keys()


@cache
def _expert_keys() -> frozenset[str]:
    from live.config.loading import options

    return frozenset(key for key, field in options().values() if field.metadata["option"].expert)


def bad_value(text: str, *values: Any) -> argparse.ArgumentTypeError:
    """The error of a value that is refused, as ``Message`` takes it, in the language of the terminal."""
    return argparse.ArgumentTypeError(said_here(Message(text, *values)))


def not_empty(word: str) -> str:
    """``word``; an empty one is refused, as a variable of a shell that is not set gives it."""
    if not word:
        raise bad_value("is empty; give a value, or leave it out")
    return word


def parse(argv: Sequence[str]) -> tuple[Command, argparse.Namespace]:
    """The command and its arguments; help ends the program with exit code 0, bad usage with 2."""
    argparse._ = said_here  # type: ignore[attr-defined]  # its own texts: what gettext would be asked for
    argparse.ngettext = lambda one, many, n: said_here(one if n == 1 else many)  # type: ignore[attr-defined]
    parser = full_parser([word for word in argv if word in COMMANDS][:1], all_options=HELP_ALL in argv)
    try:
        argv = understood(argv)
    except PhasedicError as error:
        parser.error(said_here(error.text))
    if not argv:
        parser.print_help(sys.stderr)
        parser.exit(USAGE)
    wanted = next((word for word in argv if not word.startswith("-")), "")
    if wanted and wanted not in COMMANDS:
        near = meant(wanted, COMMANDS)
        text = Message("there is no command {name}{meant}; phasedic --help lists all", repr(wanted), near)
        parser.error(said_here(text))
    arguments, unknown = parser.parse_known_args(argv)
    own = subparsers(parser).choices[arguments.command]
    if twice := _given_twice(own, argv):
        own.error(said_here(Message("{option} is given twice: give it once", twice)))
    if unknown:
        options = (option for action in own._actions for option in action.option_strings)
        first = next((word.partition("=")[0] for word in unknown if word.startswith("--")), "")
        own.error(
            said_here("unrecognized arguments: %s") % " ".join(unknown) + said_here(meant(first, options))
        )
    command: Command = importlib.import_module(COMMANDS[arguments.command].module).command
    return command, arguments


def full_parser(complete: Iterable[str], *, all_options: bool = True) -> argparse.ArgumentParser:
    """The parser of ``phasedic``, with all arguments of the commands ``complete``.

    Parameters
    ----------
    complete : iterable of str
    all_options : bool
        The help shows expert options too.
    """
    formatter = _AllOptions if all_options else _HelpFormatter
    parser = argparse.ArgumentParser(
        prog="phasedic",
        description="Live strain measurement by phase-DIC: frames, load and strain maps during a test.",
        epilog=EXIT_CODES,
        formatter_class=formatter,
    )
    parser.add_argument("--version", action="version", version=_version())
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    with_arguments = set(complete)
    for name, entry in COMMANDS.items():
        own = commands.add_parser(
            name, help=entry.help, epilog=example_of(name) + EXIT_CODES, formatter_class=formatter
        )
        own.register("type", None, not_empty)
        if name in with_arguments:
            importlib.import_module(entry.module).add_arguments(own)
    return parser


def _given_twice(parser: argparse.ArgumentParser, argv: Sequence[str]) -> str:
    """An option of one file or device that is given two, of which argparse drops the first; empty without one.

    Of a setting the last one counts, as everywhere: scripts give their own and pass on what they get.
    """
    single = {
        name
        for one in parser._actions
        if type(one) is _STORE and any(kind in str(one.metavar) for kind in ("FILE", "ADDRESS"))
        for name in one.option_strings
    }
    values: dict[str, str] = {}
    for word, after in pairwise([*argv, ""]):
        name, is_joined, value = word.partition("=")
        given = value if is_joined else after
        if name in single and values.setdefault(name, given) != given:
            return name
    return ""


def subparsers(parser: argparse.ArgumentParser) -> argparse._SubParsersAction[argparse.ArgumentParser]:
    """The parsers of the commands."""
    return next(action for action in parser._actions if isinstance(action, argparse._SubParsersAction))


def _version() -> str:
    from live import VERSION

    return f"phasedic {VERSION}"
