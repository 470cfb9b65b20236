"""The status line of a live run: the most important items that fit the width of the terminal."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from acquire.text import Amount, Message, counts, joined, word
from acquire.text.message import duration, share_text
from acquire.text.quantity import UNKNOWN
from live.pipeline.snapshot import AXIAL, BURST, FORCE, STRESS
from live.pipeline.timed.figure import BEYOND, LACKING, FigureState
from live.words.language import told

if TYPE_CHECKING:
    from analysis.evaluate import GaugeValue
    from live.pipeline.measurement import TimeStep
    from live.pipeline.snapshot import ShownFigure, Snapshot
    from live.pipeline.timed.figure import TimedFigure

GAP = "  "
MAX_GAUGES = 4
_MATTERS = 6
_OF_CAMERA = ("skipped", "lost_frames")
Item = tuple[int, str]
"""Rank and text; a line that is too long loses the items with the highest rank first."""


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
