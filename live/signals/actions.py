"""What an alarm does when it comes. A new action is a class here, in ``ACTIONS``, and its key in ``AlarmConfig``."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

from acquire.events import Event
from live.setup import AlarmConfig
from live.signals.strain_out import StrainOut


@dataclass(frozen=True, slots=True)
class Means:
    """What actions act on.

    Attributes
    ----------
    bell : callable
        Rings at the terminal.
    end : callable taking a str
        Ends the run for this reason.
    outs : sequence of StrainOut
    """

    bell: Callable[[], None]
    end: Callable[[str], None]
    outs: Sequence[StrainOut] = ()


class Action(ABC):
    """One thing an alarm does when it comes.

    Attributes
    ----------
    key : str
        Of ``[[alarm]]``, which asks for it; empty: every alarm does it.
    """

    key: ClassVar[str] = ""

    def __init__(self, config: AlarmConfig, means: Means) -> None:
        self.config, self.means = config, means

    @abstractmethod
    def fire(self, event: Event) -> None:
        """Do it, at once and without waiting; ``event`` is that of the alarm, not yet passed on."""


class RingBell(Action):
    """The terminal rings."""

    def fire(self, event: Event) -> None:
        """Ring."""
        self.means.bell()


class SendLine(Action):
    """A line goes out on all strain outputs."""

    key = "line"

    def fire(self, event: Event) -> None:
        """Leave the line with each output, which sends it with the event of the alarm."""
        for out in self.means.outs:
            out.post(self.config.line)


class EndRun(Action):
    """The run ends."""

    key = "end"

    def fire(self, event: Event) -> None:
        """End it, with the alarm as the reason."""
        self.means.end(event.text)


ACTIONS: tuple[type[Action], ...] = (RingBell, SendLine, EndRun)


def actions_of(config: AlarmConfig, means: Means) -> list[Action]:
    """Those that ``config`` asks for, in the order of ``ACTIONS``."""
    return [kind(config, means) for kind in ACTIONS if not kind.key or getattr(config, kind.key)]
