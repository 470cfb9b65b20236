"""``phasedic sides``: front and back of one test: mean strain, bending, and E of the mean."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from acquire.errors import ConfigError
from acquire.text import Message
from live.config.cameras import BACK, FRONT
from live.pipeline.consumer import Screen
from live.ui.terminal.screen import TerminalScreen

if TYPE_CHECKING:
    from live.results.sides import SidesOfTest

TABLE = "strain.csv"
"""Of both sides, in the folder of a test with two cameras."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic sides``."""
    parser.add_argument(
        "front", help="folder of a test with two cameras, or of the run of the front, with the force"
    )
    parser.add_argument(
        "back", nargs="?", help="folder of the run of the back, of the same time on the same machine"
    )
    parser.add_argument("--out", metavar="FILE.csv", help="new file (default: sides.csv beside the front)")


def command(arguments: argparse.Namespace) -> int:
    """``phasedic sides``."""
    front = Path(arguments.front)
    one, other = (front, Path(arguments.back)) if arguments.back else (front / FRONT, front / BACK)
    out = Path(arguments.out) if arguments.out else front / "sides.csv"
    put_together(one, other, out, TerminalScreen())
    return 0


def put_together(front: Path, back: Path, out: Path, screen: Screen) -> None:
    """Write the table of both sides to ``out``, a new file, and print their strains and figures.

    Raises
    ------
    ConfigError, DataError
        The file exists, a run cannot be read, or they are not of one test.
    """
    from live.config.new_files import new_file
    from live.results.run_folder import open_run
    from live.results.sides import SidesOfTest, write_sides

    if front.resolve() == back.resolve():
        raise ConfigError("{front} is given as front and as back; give the run of each", front)
    with open_run(front) as one, open_run(back) as other:
        sides, stresses = SidesOfTest.of_folders(one, other), one.specimen.area_m2 is not None
    with new_file(out) as part, part.open("x", encoding="utf-8", newline="") as file:
        write_sides(sides, file)
    for line in (*_strains(sides), *sides.figure_lines(stresses=stresses)):
        screen.print(line)
    screen.print(str(out))


def _strains(sides: SidesOfTest) -> Iterator[str]:
    """The last instant that both sides have."""
    from live.results.sides import at_end
    from live.ui.terminal.screen import strain_text

    yield Message("at the end:            mean of both        front minus mean")
    for name, one in at_end(sides.courses).items():
        mean, bending = (strain_text(value, one.sigma) for value in (one.mean, one.bending))
        yield Message("  {name:<16} {mean:>18}  {bending:>18}", name, mean, bending)
