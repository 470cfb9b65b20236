"""``phasedic warm-up``: compile everything ahead, for all kinds of pictures and estimators; the self-test."""

from __future__ import annotations

import argparse

from analysis import PICTURE_KINDS, KernelSettings, check_machine
from live.pipeline.reference import on_fit_machine
from live.setup.compiling import compile_ahead
from live.ui.terminal.screen import TerminalScreen

TESTED_PX = 64
"""The ZOI of the self-test; those of a test are tested when it begins."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """``phasedic warm-up`` has none."""


def command(arguments: argparse.Namespace) -> int:
    """0 once all is there; MachineUnfit where a known pattern is measured wrong."""
    screen = TerminalScreen()
    took = compile_ahead(PICTURE_KINDS, phase=True, say=screen.status)
    screen.say(f"everything is compiled ({took:.0f} s)" if took else "everything was compiled already")
    with on_fit_machine():
        for settings in (KernelSettings(), KernelSettings(order=2), KernelSettings(estimator="phase")):
            check_machine(settings, TESTED_PX)
    screen.say("self-test: a known pattern is measured right")
    return 0
