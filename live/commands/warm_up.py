"""``phasedic warm-up``: compile everything ahead, for all kinds of pictures and estimators."""

from __future__ import annotations

import argparse

from analysis import PICTURE_KINDS
from live.setup import compile_ahead
from live.tell import TerminalScreen


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """``phasedic warm-up`` has none."""


def command(arguments: argparse.Namespace) -> int:
    """0 once all is there."""
    screen = TerminalScreen()
    took = compile_ahead(PICTURE_KINDS, phase=True, say=screen.status)
    screen.say(f"everything is compiled ({took:.0f} s)" if took else "everything was compiled already")
    return 0
