"""``phasedic sides``: two runs of one test, of the front and of the back: mean strain, bending, and E of the mean."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from live.ui.terminal.screen import print_line

if TYPE_CHECKING:
    from live.results.sides import SidesOfTest


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic sides``."""
    parser.add_argument("front", help="folder of the run of the front, with the force")
    parser.add_argument("back", help="folder of the run of the back, of the same time on the same machine")
    parser.add_argument("--out", metavar="FILE.csv", help="new file (default: sides.csv beside the front)")


def command(arguments: argparse.Namespace) -> int:
    """``phasedic sides``."""
    from live.results.export.atomic_file import new_file
    from live.results.run_folder import open_run
    from live.results.sides import SidesOfTest, write_sides

    with open_run(arguments.front) as front, open_run(arguments.back) as back:
        out = Path(arguments.out) if arguments.out else front.path / "sides.csv"
        sides = SidesOfTest.of(front, back)
        stresses = front.specimen.area_m2 is not None
    with new_file(out) as part, part.open("x", encoding="utf-8", newline="") as file:
        write_sides(sides, file)
    for line in (*_strains(sides), *_figures(sides, stresses)):
        print_line(line)
    print_line(str(out))
    return 0


def _strains(sides: SidesOfTest) -> Iterator[str]:
    """The last instant that both sides have, µm/m."""
    from live.ui.terminal.status_line import strain_text

    yield "at the end, µm/m:      mean of both        front minus mean"
    for name, one in sides.courses.items():
        known = np.flatnonzero(np.isfinite(one.mean))
        if len(known):
            k = known[-1]
            mean, bending = (strain_text(values[k], one.sigma[k]) for values in (one.mean, one.bending))
            yield f"  {name:<16} {mean:>18}  {bending:>18}"


def _figures(sides: SidesOfTest, stresses: bool) -> Iterator[str]:
    from live.results.figures import headline

    for where in ("both", "front", "back"):
        rows = (row for row in headline(getattr(sides, where), stresses=stresses) if row.figure.known)
        yield f"{where + ':':<7}" + (
            "  ".join(f"{row.name} = {row.text}" for row in rows) or "no figure is known"
        )
