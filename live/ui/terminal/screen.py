"""Prints messages, and one status line that is renewed in place: the most important items that fit the width.

A terminal that was closed must not end a recording: what cannot be printed is dropped. Text from a file or a device may
contain control characters; they are escaped. The terminal of a test with several cameras has lines with the name of
their camera, and one status line of all.
"""

from __future__ import annotations

import math
import os
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, TextIO

from acquire.clock import Clock
from acquire.text import Amount, Message, about, counts, joined, word
from acquire.text.message import duration, printable, share_text
from acquire.text.quantity import IN_ASCII, UNKNOWN
from live.pipeline.consumer import Screen
from live.pipeline.snapshot import AXIAL, BURST, FORCE, STRESS
from live.pipeline.timed.figure import BEYOND, LACKING, FigureState
from live.words.language import told

if TYPE_CHECKING:
    from analysis.evaluate import GaugeValue
    from live.pipeline.measurement import TimeStep
    from live.pipeline.run_state import RunState
    from live.pipeline.snapshot import ShownFigure, Snapshot
    from live.pipeline.timed.figure import TimedFigure

GAP = "  "
MAX_GAUGES = 4
_MATTERS = 6
_OF_CAMERA = ("skipped", "lost_frames")
Item = tuple[int, str]
"""Rank and text; a line that is too long loses the items with the highest rank first."""

_TERMINAL_EVERY_S, _FILE_EVERY_S = 0.25, 5.0
_UNKNOWN_WIDTH, _FILE_WIDTH = 119, 1000


def status_line(s: Snapshot, width: int, words: str = "") -> str:
    """The line, at most ``width`` characters; ``words`` name what the run waits for."""
    return fitted([*_test(s), (3, words), *_strain(s), _assumed(s), *_machine(s)], width)


def cameras_line(
    cameras: Mapping[str, Snapshot], both: Mapping[str, Sequence[float]], width: int, words: str = ""
) -> str:
    """The line of a test with several cameras: strains, of sides mean and bending, and what each camera does.

    Parameters
    ----------
    cameras : mapping of str to Snapshot
        By name, the leading one first.
    both : mapping of str to (mean, bending, sigma)
        Mean of front and back, front minus mean, and the standard uncertainty of either; more is not read.
    width : int
    words : str
    """
    first = next(iter(cameras.values()))
    strains = _both(both) if both else _each(cameras)
    return fitted([*_test(first), (3, words), *strains, *_machines(cameras)], width)


def _each(cameras: Mapping[str, Snapshot]) -> Iterator[Item]:
    """The strain of each camera, where there is no mean."""
    for name, s in cameras.items():
        axial = s.figure(AXIAL)
        if text := figure_text(axial, strain_text(axial.value, axial.sigma), strain_text(axial.last)):
            yield 5, joined(" ", (Message(name), text))


def _both(both: Mapping[str, Sequence[float]]) -> Iterator[Item]:
    for number, (name, (mean, bending, sigma, *_)) in enumerate(both.items()):
        text = Message(
            "{name} {mean}, bending {bending}", name, strain_text(mean, sigma), strain_text(bending, sigma)
        )
        yield 5 if number == 0 else 10, text


def _machines(cameras: Mapping[str, Snapshot]) -> Iterator[Item]:
    for name, s in cameras.items():
        yield (
            8,
            joined(" ", (Message(name), _zois(s.valid, s.zois) if s.time_step is not None else _frames(s))),
        )
        yield from (_item(row) for row in s.rows("terminal") if row.figure.name in _OF_CAMERA)


def fitted(items: Sequence[Item], width: int) -> str:
    """The items that fit, in their order and in the language of the terminal; the last one left is cut."""
    left = [(rank, told(text)) for rank, text in items if text]
    while len(left) > 1 and len(GAP.join(text for _, text in left)) > width:
        left.remove(max(left, key=lambda item: item[0]))
    return GAP.join(text for _, text in left)[: max(width, 0)]


def _test(s: Snapshot) -> list[Item]:
    alarm = joined(" ", [Message("ALARM {text}", text) for text in s.alarms])
    force, stress = s.figure(FORCE), s.figure(STRESS)
    shown = figure_text(force, force_text(force.value), force_text(force.last))
    over = _amount("stress", stress.value) if stress.known else ""
    peak = "" if math.isnan(s.peak_N) else Message("peak {force}", force_text(s.peak_N))
    load = [
        (0, shown if force.known or not shown else Message("force {shown}", shown)),
        (4, over),
        (12, peak),
    ]
    return [(1, alarm), (2, s.doing), (7, duration(s.elapsed_s)), *load]


def _strain(s: Snapshot) -> list[Item]:
    i = s.time_step
    if i is None:
        return []
    burst = s.figure(BURST)
    if not burst.known:
        last = joined(" ", (s.axial_name, strain_text(s.figure(AXIAL).last)))
        return [(5, Message("strain {text}", figure_text(burst, "", last)))]
    items = [(5 if number == 0 else 10, text) for number, text in enumerate(gauge_texts(i))]
    return [*items, (5, share_text(i.area_share)), (8, _zois(i.n_valid, i.n_zoi))]


def _assumed(s: Snapshot) -> Item:
    """That the direction of the load is not known, once there are strains whose axis it would be."""
    return 11, Message("axis {axis} assumed", s.axis) if s.axis_assumed and s.time_step is not None else ""


def _machine(s: Snapshot) -> list[Item]:
    return [(12, "" if s.time_step is not None else _frames(s)), *map(_item, s.rows("terminal"))]


def _item(row: ShownFigure) -> Item:
    """A figure with its name; one that matters in capitals, and kept longer."""
    last = "" if row.now.why else joined("", [replace(row.amount, value=row.now.last)])
    amount = figure_text(row.now, joined("", [row.amount]), last)
    if row.matters:
        return min(_MATTERS, row.figure.terminal), joined(" ", (told(word(row.figure.said)).upper(), amount))
    return row.figure.terminal, joined(" ", (word(row.figure.said), amount))


def _zois(valid: int, zois: int) -> str:
    return Message("{valid}/{zois} ZOIs", *counts(valid, zois))


def _frames(s: Snapshot) -> str:
    return Message("{n} frames", *counts(s.frames["grabbed"]))


def figure_text(figure: TimedFigure, live: str, last: str = "") -> str:
    """What is shown of a figure: ``live``, or what it has instead of a value; empty where there is no such source.

    Of one that is old, ``last`` and its age are shown too.
    """
    if figure.known or figure.state is FigureState.NONE:
        return live if figure.known else ""
    if figure.state in BEYOND:
        return word(figure.state.upper())
    if figure.state not in LACKING:
        return Message("– ({why})", word(str(figure.state)))
    words = (
        Message("{last}, {age:.0f} s ago", last, figure.age)
        if last and math.isfinite(figure.age) and figure.last == figure.last
        else figure.why
    )
    return Message("– ({why})", words) if words else UNKNOWN


def force_text(value: float) -> str:
    """A force with its unit; empty where it is not known."""
    return "" if math.isnan(value) else _amount("force", value)


def strain_text(value: float, sigma: float = math.nan) -> str:
    """A strain, with its sigma where that is known."""
    return _amount("strain", value, sigma)


def _amount(kind: str, value: float, sigma: float = math.nan) -> str:
    """An amount alone as a text that can still be translated."""
    return joined("", [Amount(kind, value, sigma)])


def gauge_texts(i: TimeStep) -> list[str]:
    """The virtual gauges with their sigmas, or the means where there are none."""
    if not i.gauges:
        return [
            joined(" ", (name, strain_text(getattr(i, name), getattr(i, f"sigma_{name}"))))
            for name in ("eyy", "exx", "exy")
        ]
    return [_gauge_text(name, gauge) for name, gauge in list(i.gauges.items())[:MAX_GAUGES]]


def _gauge_text(name: str, gauge: GaugeValue) -> str:
    if gauge.reason:
        return Message("{name} lost", name)
    return joined(" ", (name, strain_text(gauge.value, gauge.sigma), share_text(gauge.share)))


def print_line(text: str = "") -> None:
    """Print a line on standard output, control characters escaped; for commands without a status line."""
    TerminalScreen().print(text)


class TerminalScreen(Screen):
    """Prints to ``stream``; the status line at most four times a second (a log: every 5 s)."""

    def __init__(
        self, stream: TextIO | None = None, now: Clock = time.monotonic, quiet: bool = False
    ) -> None:
        self._stream = stream or sys.stdout
        self._now, self._quiet = now, quiet
        self._terminal = self._stream.isatty()
        self._every = _TERMINAL_EVERY_S if self._terminal else _FILE_EVERY_S
        self._last = -math.inf
        self._width = 0
        self._prompt: str | None = None

    def print(self, text: str = "") -> None:
        """Print a line that stays."""
        if not self._quiet:
            self._write(" " * self._width + "\r" * (self._width > 0) + told(printable(text)) + "\n")
            self._width = 0
            if self._prompt is not None:
                self._renew(self._prompt)

    def bell(self) -> None:
        """Ring the bell of a terminal."""
        if self._terminal and not self._quiet:
            self._write("\a")

    @property
    def is_due(self) -> bool:
        """Whether the status line may be renewed by now."""
        return not self._quiet and self._prompt is None and self._now() - self._last >= self._every

    @property
    def width(self) -> int:
        """Letters of the status line; many in a log."""
        return self._columns() if self._terminal else _FILE_WIDTH

    def status(self, text: str) -> None:
        """Renew the status line, in place on a terminal."""
        if not self.is_due:
            return
        self._last = self._now()
        if self._terminal:
            self._renew(text)
        else:
            self._write(told(printable(text)) + "\n")

    def _renew(self, text: str) -> None:
        """Renew the last line, cut to the width of the terminal: a line that wraps cannot be renewed."""
        text = told(printable(text))[: self._columns()]
        self._write(text.ljust(self._width) + "\r")
        self._width = len(text)

    def _columns(self) -> int:
        """Usable columns: a character in the last column may wrap."""
        try:
            return os.get_terminal_size(self._stream.fileno()).columns - 1
        except (OSError, ValueError):
            return _UNKNOWN_WIDTH

    def snapshot(self, snapshot: Snapshot, words: str = "") -> None:
        """Renew the status line of a live run; ``words`` name what it waits for."""
        self.status(status_line(snapshot, self.width, words))

    def prompt(self, text: str | None) -> None:
        """Show what the operator types in place of the status line; None ends that."""
        self._prompt = text
        if self._terminal and not self._quiet:
            self._renew(text or "")

    def progress(self, i: TimeStep, done: int, expected: int | None, elapsed_s: float) -> None:
        """Renew the status line of a replay: ``done`` of ``expected`` bursts, ZOI/s, remaining time."""
        bursts, left, rate = Message("{done} bursts", *counts(done)), "", ""
        if expected is not None and done <= expected:
            bursts = Message("{done} of {expected} bursts", *counts(done, expected))
            left = Message("{time} left", duration(elapsed_s / done * (expected - done)))
        if elapsed_s > 0:
            rate = Message("{rate} ZOI/s", Amount("count", done * i.n_zoi / elapsed_s))
        valid = Message("{valid}/{zois} ZOIs", *counts(i.n_valid, i.n_zoi))
        strains = (*gauge_texts(i), share_text(i.area_share))
        self.status(joined(GAP, (bursts, force_text(i.force), *strains, valid, rate, left)))

    def _write(self, text: str) -> None:
        encoding = getattr(self._stream, "encoding", None) or "utf-8"
        try:
            text.encode(encoding)
        except UnicodeEncodeError:
            text = text.translate(IN_ASCII).encode(encoding, "backslashreplace").decode(encoding)
        try:
            self._stream.write(text)
            self._stream.flush()
        except (OSError, ValueError):
            self._quiet = True


class CamerasScreen:
    """A screen for all cameras; ``of`` is the part of one.

    Parameters
    ----------
    screen : Screen
    """

    def __init__(self, screen: Screen) -> None:
        self.screen = screen
        self._snapshots: dict[str, Snapshot] = {}
        self._states: Mapping[str, RunState] = {}

    def of(self, name: str) -> Screen:
        """The screen of one camera; that of all for a camera without a name."""
        return _CameraScreen(name, self) if name else self.screen

    def attach(self, states: Mapping[str, RunState]) -> None:
        """Show strains of all cameras, which have begun."""
        self._states = states

    def show(self, name: str, snapshot: Snapshot, words: str) -> None:
        """Renew the status line; ``snapshot`` is of the camera ``name``."""
        from live.results.sides import newest

        self._snapshots[name] = snapshot
        all_of = {one: state.snapshot(snapshot.t) for one, state in self._states.items()} or self._snapshots
        both = newest(self._states, snapshot.t)
        self.screen.status(cameras_line(all_of, both, self.screen.width, words))


class _CameraScreen(Screen):
    def __init__(self, name: str, every: CamerasScreen) -> None:
        self._name, self._every = name, every

    @property
    def is_due(self) -> bool:
        return self._every.screen.is_due

    def print(self, text: str = "") -> None:
        self._every.screen.print(about(Message(self._name), text) if text else "")

    def bell(self) -> None:
        self._every.screen.bell()

    def status(self, text: str) -> None:
        self._every.screen.status(f"{self._name}: {text}")

    def snapshot(self, snapshot: Snapshot, words: str = "") -> None:
        self._every.show(self._name, snapshot, words)
