"""Errors a person can act on.

Each message names the device or file, says what happened and what to do next.
Whatever is not one of these is a defect of ours and reaches main with its
traceback in the log.
"""

from __future__ import annotations

from typing import Any

from acquire.text import Message


class Spoken(Exception):
    """An error whose text is for people: ``Spoken("{path}: there is no such file", path)``, as a ``Message`` takes it.

    Attributes
    ----------
    text : str
        Its message, which keeps template and values where it has any.
    """

    def __init__(self, text: str = "", *values: Any) -> None:
        self.text = Message(text, *values) if values else text
        super().__init__(self.text)


class PhasedicError(Spoken):
    """Base of all errors a person can act on; ``exit_code`` is what the process ends with."""

    exit_code = 1


class ConfigError(PhasedicError):
    """Usage or configuration: an unknown key, an impossible value, a malformed address."""

    exit_code = 2


class TooLittleMemory(ConfigError):
    """What is to be measured needs more memory than there is."""


class DeviceError(PhasedicError):
    """A camera or load cell that cannot be opened, or is gone for good."""

    exit_code = 3


class DataError(PhasedicError):
    """A file or its content: missing, truncated, foreign, or not of the kind it claims to be."""

    exit_code = 4


class MachineUnfit(PhasedicError):
    """This machine computes wrong numbers: not ready, whatever is measured with whatever device."""

    exit_code = 6


class Interrupted(PhasedicError):
    """A person or the system ended it before there was anything to close."""

    exit_code = 130
