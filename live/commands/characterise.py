"""``phasedic characterise``: the accuracy that a picture of yours allows (live.setup.pattern.own_pattern)."""

from __future__ import annotations

import argparse
from pathlib import Path

from acquire.errors import ConfigError
from live.commands.options import POSITIVE, number, whole
from live.config.new_files import made_folder
from live.pipeline.reference import on_fit_machine


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic characterise``."""
    parser.add_argument("--pattern", metavar="FILE", help="the picture")
    parser.add_argument(
        "--out", required=True, metavar="DIR", help="folder of the page, figures and CSV files"
    )
    parser.add_argument("--quick", action="store_true", help="about a minute, with fewer ZOIs and cases")
    parser.add_argument("--page", metavar="FILE", help="where the page goes (default DIR/pattern.md)")
    parser.add_argument(
        "--noise", type=number(0), metavar="GL", help="noise of one frame (default: from its spectrum)"
    )
    parser.add_argument(
        "--burst", type=whole(1), metavar="N", help="frames averaged in a test (default: 1, 4, 16, 64)"
    )
    parser.add_argument("--roi", metavar="X,Y,W,H", help="part of the picture, px")
    parser.add_argument(
        "--target", type=POSITIVE, default=100.0, metavar="UM/M", help="wanted strain noise (default 100)"
    )


def command(arguments: argparse.Namespace) -> int:
    """``phasedic characterise``; returns the exit code.

    Raises
    ------
    ConfigError
        No picture is given, or no matplotlib.
    DataError
        A folder that cannot be written, or a picture that cannot be read.
    MachineUnfit
        The machine measures a known pattern wrong.
    """
    from live.setup.pattern.outcome import figure
    from live.setup.pattern.own_pattern import characterise_pattern

    if not arguments.pattern:
        raise ConfigError(
            "give a picture of your pattern, --pattern FILE; in a checkout make paper reproduces the paper"
        )
    figure(1, 1)  # a missing matplotlib ends the command before the work
    with on_fit_machine():
        return characterise_pattern(arguments, made_folder(Path(arguments.out)))
