"""Errors a person can act on, and the exit codes.

Each message names the device or file, says what happened and what to do next.
Whatever is not one of these is a defect of ours and reaches main with its
traceback in the log.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from acquire.text import Message, word

DEFECT, USAGE, DEVICE, DATA, LOSS, NOT_READY, EXIT_INTERRUPTED = 1, 2, 3, 4, 5, 6, 130

EXIT_CODES = """exit codes:
  0 success   1 a defect of phasedic   2 usage or configuration   3 device   4 file or data
  5 finished with loss, or nothing measured   6 not ready (check, self-test)   130 interrupted, closed cleanly
"""

EXIT_WORDS = {
    DEFECT: Message("a defect of phasedic, see the log"),
    DEVICE: Message("the camera was lost before the end"),
    LOSS: Message(
        "finished with loss or nothing measured; summary, frame counts and events show what is missing"
    ),
    EXIT_INTERRUPTED: Message("interrupted; everything was closed cleanly"),
}


class Spoken(Exception):
    """An error whose text is for people: ``Spoken("{path}: there is no such file", path)``, as a ``Message`` takes it.

    Attributes
    ----------
    text : str
        Its message, which keeps template and values where it has any.
    """

    def __init__(self, text: str = "", *values: Any) -> None:
        self.text = Message(text, *values) if values else word(text)
        super().__init__(self.text)


class PhasedicError(Spoken):
    """Base of all errors a person can act on; ``exit_code`` is what the process ends with."""

    exit_code = DEFECT


class ConfigError(PhasedicError):
    """Usage or configuration: an unknown key, an impossible value, a malformed address."""

    exit_code = USAGE


class TooLittleMemory(ConfigError):
    """What is to be measured needs more memory than there is."""


class DeviceError(PhasedicError):
    """A camera or load cell that cannot be opened, or is gone for good."""

    exit_code = DEVICE


class DataError(PhasedicError):
    """A file or its content: missing, truncated, foreign, or not of the kind it claims to be."""

    exit_code = DATA


class MachineUnfit(PhasedicError):
    """This machine computes wrong numbers: not ready, whatever is measured with whatever device."""

    exit_code = NOT_READY


class Interrupted(PhasedicError):
    """A person or the system ended it before there was anything to close."""

    exit_code = EXIT_INTERRUPTED


def exit_code_of(error: BaseException) -> int:
    """Exit code of an error: its own, else that of a defect."""
    return error.exit_code if isinstance(error, PhasedicError) else DEFECT


def exit_code_of_all(codes: Iterable[int]) -> int:
    """Exit code of a test from those of its cameras: finished with loss where one failed and another did not."""
    found = {*codes}
    if len(found) == 1:
        return found.pop()
    return next((one for one in (DEFECT, EXIT_INTERRUPTED) if one in found), LOSS)
