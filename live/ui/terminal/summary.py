"""The summary of a test on the terminal: a dozen lines; the report and ``--verbose`` have all figures."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from acquire.printable import counted
from live.config.sections import SpecimenConfig
from live.pipeline.consumer import ConsumerReport
from live.pipeline.event_log import sentence
from live.pipeline.run_state import RunState
from live.pipeline.screen import Screen
from live.results.figures import (
    alignment_line,
    elastic_lines,
    evaluate,
    figure_lines,
    lag_line,
    plastic_lines,
    tare_line,
)
from live.results.summary import file_lines, noise_line, summary_lines, why_nothing
from live.ui.terminal.status_line import strain_text

SMALL_MB = 10.0  # below it with a decimal
TURNED = math.radians(5)  # off the axis of the load, from which on the summary shows it


def print_summary(
    screen: Screen,
    run_state: RunState,
    specimen: SpecimenConfig,
    folder: Path,
    lines: Sequence[str],
    *,
    verbose: bool = False,
    with_report: bool = False,
) -> None:
    """Print the figures of a test, then ``lines``, then where the files are; ``with_report``: one will be made."""
    screen.print()
    if verbose:
        shown = [*summary_lines(run_state, specimen), *lines, *file_lines(folder)]
    else:
        following = "" if with_report else f"; next: phasedic report {shlex.quote(str(folder))}"
        shown = [*brief_lines(run_state, specimen), *lines, _files(folder) + following]
    for line in shown:
        screen.print(line)


def brief_lines(run_state: RunState, specimen: SpecimenConfig) -> list[str]:
    """State, strain, E, nu and strengths or why they are not known, noise, and what is odd."""
    history = run_state.history
    valid = np.flatnonzero(history.column("n_valid"))
    if not valid.size:
        return [why_nothing(run_state)]
    last = history.time_steps[int(valid[-1])]
    refused = f" ({last.refused})" if last.refused else ""
    axis = history.axis(specimen.axis).axis
    strain, sigma = last.axial(axis)
    lines = [
        f"measured {len(history.time_steps)} bursts, {last.n_valid} of {last.n_zoi} ZOIs valid in the last{refused}",
        f"strain along {axis} at the end: {strain_text(strain, sigma)} µm/m"
        + f" ({last.apart})" * bool(last.apart),
        *_figures(run_state, specimen),
        noise_line(history),
        *_remarks(run_state, specimen),
    ]
    return [line.strip() for line in lines]


def _figures(run_state: RunState, specimen: SpecimenConfig) -> list[str]:
    figures = evaluate(run_state.history, run_state.loads, specimen)
    if figures.E.known:
        return [
            line for line in [*elastic_lines(figures, specimen), *plastic_lines(figures, specimen)] if line
        ]
    if not np.isfinite(run_state.history.forces(run_state.loads)).any():
        return ["E is not known: no force is known (--load)"]
    return [f"E is not known: {figures.E.why}", *figure_lines(figures, specimen)[:1]]


def _remarks(run_state: RunState, specimen: SpecimenConfig) -> Iterator[str]:
    history, loads = run_state.history, run_state.loads
    yield from tare_line(history, loads)
    yield from (line for line in lag_line(history, loads, specimen) if "--lag" in line)
    angle = history.axis(specimen.axis).angle
    if angle.known and abs(angle.value) > TURNED:
        yield from alignment_line(history, specimen)


def trouble_lines(
    run_state: RunState, reports: Sequence[ConsumerReport], *, verbose: bool = False
) -> Iterator[str]:
    """The frame counts, the outputs that lost something (all if ``verbose``), and the last warning or error."""
    yield run_state.frame_counts.line()
    yield from (
        f"  {report.line()}" for report in reports if verbose or report.failed or any(report.dropped.values())
    )
    warnings = run_state.event_log.events("warning", "error")
    if warnings:
        last = sentence(warnings[-1], run_state.event_log.names)
        levels = [event.level for event in warnings]
        counts = [counted(levels.count(one), one) for one in ("warning", "error") if one in levels]
        yield f"{' and '.join(counts)}, the last: {last}"


def _files(folder: Path) -> str:
    """Where the files are."""
    files = [path for path in sorted(folder.iterdir()) if path.is_file() and path.stat().st_size]
    total = sum(path.stat().st_size for path in files) / 1e6
    return f"files: {folder} ({', '.join(path.name for path in files)}; {total:,.{0 if total >= SMALL_MB else 1}f} MB)"
