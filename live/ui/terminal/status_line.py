"""The status line of a live run: the most important items that fit the width of the terminal."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from acquire.text.printable import duration, share_text
from live.pipeline.snapshot import AXIAL, BURST, DISK, FORCE, FPS, STRESS
from live.pipeline.timed.figure import BEYOND, LACKING, FigureState

if TYPE_CHECKING:
    from analysis.evaluate import GaugeValue
    from live.pipeline.measurement import TimeStep
    from live.pipeline.snapshot import Snapshot
    from live.pipeline.timed.figure import TimedFigure

GAP = "  "
MAX_GAUGES = 4
LARGE_SIGMA = 10e-6  # from here on without a decimal
Item = tuple[int, str]
"""Rank and text; a line that is too long loses the items with the highest rank first."""
SideValues = tuple[float, float, float]
"""Mean of front and back, front minus mean, and the standard uncertainty of either."""


def status_line(s: Snapshot, width: int, words: str = "") -> str:
    """The line, at most ``width`` characters; ``words`` name what the run waits for."""
    return fitted([*_test(s), (3, words), *_strain(s), _assumed(s), *_machine(s)], width)


def cameras_line(
    cameras: Mapping[str, Snapshot], both: Mapping[str, SideValues], width: int, words: str = ""
) -> str:
    """The line of a test with several cameras: strains, of sides mean and bending, and what each camera does.

    Parameters
    ----------
    cameras : mapping of str to Snapshot
        By name, the leading one first.
    both : mapping of str to (mean, bending, sigma)
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
        if text := figure_text(axial, strain_text(axial.value, axial.sigma), f"{axial.last * 1e6:+,.0f}"):
            yield 5, f"{name} {text} µm/m"


def _both(both: Mapping[str, SideValues]) -> Iterator[Item]:
    for number, (name, (mean, bending, sigma)) in enumerate(both.items()):
        text = f"{name} {strain_text(mean, sigma)}, bending {strain_text(bending, sigma)} µm/m"
        yield 5 if number == 0 else 10, text


def _machines(cameras: Mapping[str, Snapshot]) -> Iterator[Item]:
    for name, s in cameras.items():
        frames = s.frames
        done = f"{s.valid}/{s.zois} ZOIs" if s.time_step is not None else f"{frames['grabbed']} frames"
        yield 8, f"{name} {done}"
        yield 11, f"skipped {frames['skipped']}"
        yield (6, f"LOST {s.lost}") if s.lost else (13, "lost 0")


def fitted(items: Sequence[Item], width: int) -> str:
    """The items that fit, in their order; the last one left is cut."""
    left = [item for item in items if item[1]]
    while len(left) > 1 and len(GAP.join(text for _, text in left)) > width:
        left.remove(max(left, key=lambda item: item[0]))
    return GAP.join(text for _, text in left)[: max(width, 0)]


def _test(s: Snapshot) -> list[Item]:
    alarm = " ".join(f"ALARM {text}" for text in s.alarms)
    force, stress = s.figure(FORCE), s.figure(STRESS)
    shown = figure_text(force, force_text(force.value), force_text(force.last))
    over = f"{stress.value * 1e-6:.1f} MPa" if stress.known else ""
    peak = "" if math.isnan(s.peak_N) else f"peak {force_text(s.peak_N)}"
    load = [(0, shown if force.known or not shown else f"force {shown}"), (4, over), (12, peak)]
    return [(1, alarm), (2, s.state), (7, duration(s.elapsed_s)), *load]


def _strain(s: Snapshot) -> list[Item]:
    i = s.time_step
    if i is None:
        return []
    burst = s.figure(BURST)
    if not burst.known:
        last = f"{s.axial_name} {s.figure(AXIAL).last * 1e6:+z,.0f} µm/m"
        return [(5, f"strain {figure_text(burst, '', last)}")]
    items = [(5 if number == 0 else 10, text) for number, text in enumerate(gauge_texts(i))]
    items[-1] = items[-1][0], f"{items[-1][1]} µm/m"
    return [*items, (5, share_text(i.area_share)), (8, f"{i.n_valid}/{i.n_zoi} ZOIs")]


def _assumed(s: Snapshot) -> Item:
    """That the direction of the load is not known, once there are strains whose axis it would be."""
    return 11, f"axis {s.axis} assumed" if s.axis_assumed and s.time_step is not None else ""


def _machine(s: Snapshot) -> list[Item]:
    frames = s.frames
    late = "" if math.isnan(s.latency_p95_s) else f"p95 {s.latency_p95_s * 1e3:.0f} ms"
    measured = f"measured {frames['measured']}" if s.time_step is not None else f"{frames['grabbed']} frames"
    fps, disk = s.figure(FPS), s.figure(DISK)
    bare = frames.get("without_force", 0)
    return [
        (9, f"{figure_text(fps, f'{fps.value:.0f}')} fps"),
        (6, f"WITHOUT FORCE {bare}" if bare else ""),
        (12, measured),
        (11, f"skipped {frames['skipped']}"),
        (6, f"LOST {s.lost}") if s.lost else (13, "lost 0"),
        (12, late),
        (14, f"disk {text} min" if (text := figure_text(disk, f"{disk.value / 60:.0f}")) else ""),
    ]


def figure_text(figure: TimedFigure, live: str, last: str = "") -> str:
    """What is shown of a figure: ``live``, or what it has instead of a value; empty where there is no such source.

    Of one that is old, ``last`` and its age are shown too.
    """
    if figure.known or figure.state is FigureState.NONE:
        return live if figure.known else ""
    if figure.state in BEYOND:
        return figure.state.upper()
    if figure.state not in LACKING:
        return f"– ({figure.state})"
    words = (
        f"{last}, {figure.age:.0f} s ago"
        if last and math.isfinite(figure.age) and figure.last == figure.last
        else figure.why
    )
    return f"– ({words})" if words else "–"


def force_text(value: float) -> str:
    """A force with its unit; empty where it is not known."""
    return "" if math.isnan(value) else f"{value:.1f} N"


def strain_text(value: float, sigma: float) -> str:
    """A strain and its sigma in µm/m, thousands apart; the unit stands once at the end of a line."""
    digits = 1 if sigma < LARGE_SIGMA else 0
    return f"{value * 1e6:+z,.0f} ± {sigma * 1e6:,.{digits}f}"


def gauge_texts(i: TimeStep) -> list[str]:
    """The virtual gauges with their sigmas in µm/m, or the means where there are none."""
    if not i.gauges:
        return [
            f"{name} {strain_text(getattr(i, name), getattr(i, f'sigma_{name}'))}"
            for name in ("eyy", "exx", "exy")
        ]
    return [_gauge_text(name, gauge) for name, gauge in list(i.gauges.items())[:MAX_GAUGES]]


def _gauge_text(name: str, gauge: GaugeValue) -> str:
    if gauge.reason:
        return f"{name} lost"
    return f"{name} {strain_text(gauge.value, gauge.sigma)} {share_text(gauge.share)}".rstrip()
