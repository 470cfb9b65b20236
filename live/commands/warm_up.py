"""``phasedic warm-up``: compile for all kinds of pictures and estimators, then run the self-test."""

from __future__ import annotations

import argparse

from acquire.text import Message
from analysis import PICTURE_KINDS, KernelSettings, check_machine
from live.pipeline.reference import on_fit_machine
from live.setup.compiling import compile_ahead
from live.ui.terminal.screen import TerminalScreen

SELF_TEST_ZOI = 64
"""Side of the ZOI of this self-test; a test repeats it with its own ZOI."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """``phasedic warm-up`` has no arguments."""


def command(arguments: argparse.Namespace) -> int:
    """``phasedic warm-up``; raises MachineUnfit if a known pattern is measured wrong."""
    screen = TerminalScreen()
    took = compile_ahead(PICTURE_KINDS, phase=True, screen=screen)
    compiled = Message("everything is compiled ({took:.0f} s)", took)
    screen.print(compiled if took else Message("everything was compiled already"))
    with on_fit_machine():
        for settings in (KernelSettings(), KernelSettings(order=2), KernelSettings(estimator="phase")):
            check_machine(settings, SELF_TEST_ZOI)
    screen.print(Message("self-test: a known pattern is measured right"))
    return 0
