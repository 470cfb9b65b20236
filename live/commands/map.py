"""``phasedic map``: draw a map of the results over a picture."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from acquire.opencv.images import read_image
from acquire.text.message import printable
from live.results import Strain
from live.results.maps.map import MapRequest, draw, save
from live.results.run_folder import open_run
from live.ui.terminal.screen import print_line

_VISIBLE_PX = 2.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic map``."""
    parser.add_argument("results", help="folder of a run or replay, or a strain.h5")
    parser.add_argument("png", help="picture to write, .png or .jpg")
    parser.add_argument(
        "--field",
        default="eyy",
        help="u, v, exx, eyy, exy, sigma_eyy, residual, status, a map of replay --response ... (default eyy)",
    )
    parser.add_argument(
        "--row", type=int, default=-1, help="number of the instant, from 0 (default: the last)"
    )
    parser.add_argument("--over", metavar="FILE", help="picture under the map")
    parser.add_argument("--limit", type=float, help="colour range -LIMIT to LIMIT (default: automatic)")
    parser.add_argument("--title", help="title (default: map, time and ZOI)")
    words = "median filter of N x N ZOIs, for display only"
    parser.add_argument("--median", type=int, default=1, metavar="N", help=words)
    words = "Gaussian filter, for display only"
    parser.add_argument("--low-pass", type=float, default=0.0, metavar="PX", help=words)
    words = "reduce the blur by the ZOI, for display only (order 1): 3 or 7 steps, noted in the title"
    parser.add_argument("--deconvolve", type=int, default=0, metavar="STEPS", help=words)
    words = "with --deconvolve: make its response end N times more abruptly: less noise, longer ringing beside an edge"
    parser.add_argument("--sharpen", type=int, default=0, metavar="N", help=words)


def command(arguments: argparse.Namespace) -> int:
    """``phasedic map``."""
    background = None if arguments.over is None else read_image(Path(arguments.over), gray="luma")
    path = Path(arguments.png)
    with open_run(arguments.results) as run:
        strain = run.strain
        picture = MapRequest(
            arguments.field,
            arguments.row,
            arguments.limit,
            printable(arguments.title or ""),
            arguments.median,
            arguments.low_pass,
            arguments.deconvolve,
            arguments.sharpen,
        )
        save(draw(strain, picture, background), path)
        if arguments.over is not None:
            _warn_of_motion(strain, arguments.row)
    print_line(str(path))
    return 0


def _warn_of_motion(strain: Strain, row: int) -> None:
    """Warn if the specimen moved: the map lies on the reference, and on a later picture it is misplaced."""
    moved = float(np.nanmax(np.hypot(strain.maps("u", row), strain.maps("v", row)), initial=0.0))
    if moved > _VISIBLE_PX:
        print_line(
            f"note: the map lies on the reference picture; the specimen moved by up to {moved:.0f} px since, so give"
            " the reference to --over, or phasedic export --to png, which moves the map with it"
        )
