"""The summary of a test on the terminal: a dozen lines; the report and ``--verbose`` have all figures."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from acquire.text import Amount, Message, counts, joined
from acquire.text.message import counted
from live.pipeline.consumer import ConsumerReport, Screen
from live.pipeline.event_log import sentence
from live.pipeline.history import History
from live.pipeline.run_state import RunState
from live.results.figures import alignment_line, elastic_lines, figure_lines, film_line, tare_line
from live.results.finished.figures_file import MeasuredAgain, checks_line, missing_lines
from live.results.finished.findings import NO_FORCE, findings
from live.results.finished.finished_test import FinishedTest
from live.results.summary import file_lines, look_lines, noise_line, summary_lines, valid_line, why_nothing
from live.ui.terminal.screen import strain_text

MOST = 12
"""Lines of the summary."""
Ranked = tuple[int, str]
"""A line, and how soon it gives way where there are too many: 0 stays."""
TURNED = math.radians(5)  # off the axis of the load, from which on the summary shows it


def print_summary(
    screen: Screen,
    run_state: RunState,
    test: FinishedTest,
    folder: Path,
    lines: Sequence[str],
    *,
    verbose: bool = False,
    with_report: bool = False,
) -> None:
    """Print the figures of a test, then ``lines``, then where the files are; ``with_report``: one will be made."""
    screen.print()
    missing = [*missing_lines(test, _again(run_state, folder))] * run_state.history.has_values
    if verbose:
        shown = [*summary_lines(run_state, test), *missing, *lines, *file_lines(folder)]
    else:
        quoted = shlex.quote(str(folder))
        following = "" if with_report else Message("; next: phasedic report {folder}", quoted)
        ranked = [*_ranked(run_state, test), *((2, one) for one in missing)]
        ranked += [(min(3 * k, 3), line) for k, line in enumerate(lines)]
        shown = [*_most_needed(ranked), _files(folder) + following]
    for line in shown:
        screen.print(line)


def _most_needed(ranked: Sequence[Ranked]) -> list[str]:
    """The lines that fit, in their order; the others are counted in one, and stand in the report."""
    room = MOST - 2  # a blank line before them, the files after them
    if len(ranked) <= room:
        return [line for _, line in ranked]
    needed = sorted(range(len(ranked)), key=lambda k: (ranked[k][0], k))[: room - 1]
    more = Message("{n} more remarks: report.html", len(ranked) - len(needed))
    return [*(ranked[k][1] for k in sorted(needed)), more]


def _again(run_state: RunState, folder: Path) -> MeasuredAgain:
    counts = run_state.frame_counts
    recorded = counts.skipped * (counts.recorded > 0)
    return MeasuredAgain.of(folder, counts.measured / max(len(run_state.history.time_steps), 1), recorded)


def brief_lines(run_state: RunState, test: FinishedTest) -> list[str]:
    """What was measured, whether it can be believed, E, nu and strengths or why they are not known."""
    return [line for _, line in _ranked(run_state, test)]


def _ranked(run_state: RunState, test: FinishedTest) -> list[Ranked]:
    history = run_state.history
    if not history.has_values:
        return [(0, why_nothing(run_state))]
    at_end, found = _at_end(history, test), findings(test)
    groups = (
        (0, [valid_line(history), *at_end[:1]]),
        (2, at_end[1:]),
        (4, [noise_line(history)]),
        (2, film_line(test.specimen)),
        (0, [checks_line(found)]),
        (1, look_lines(found)),
        (0, _figures(run_state, test)),
        (2, test.figures.notes if test.has_force else ()),
        (0, test.longer[:1]),
        (2, test.longer[1:]),
        (2, _remarks(run_state, test)),
    )
    ranks: dict[str, int] = {}
    for rank, lines in groups:
        for line in lines:
            ranks.setdefault(line, rank)  # a note may be why E is not known
    return [(rank, line) for line, rank in ranks.items()]


def _at_end(history: History, test: FinishedTest) -> list[str]:
    """The strain of the last burst; where it has none, also of the last that has one."""
    axis, plain = test.axis.axis, test.measure == "engineering"
    n, known = len(history.time_steps), np.flatnonzero(np.isfinite(history.along(axis)[0]))
    texts = [strain_text(*history.time_steps[int(k)].axial(axis)) for k in known[-1:]]
    if n - 1 in known[-1:]:
        text = Message("strain along {axis} at the end: {text}", axis, texts[0])
        return [text if plain else joined(" ", (text, Message("(measure of strain: {name})", test.measure)))]
    last = history.time_steps[-1]
    why = last.apart or Message(
        "{n_valid} of {n_zoi} valid ({why})", *counts(last.n_valid, last.n_zoi), last.refused
    )
    none = Message("strain along {axis} at the end: no value, {why}", axis, why)
    newest = (
        Message("the last burst with a value is {k} of {n}: {text}", known[-1] + 1, n, texts[0])
        if texts
        else ""
    )
    return [line for line in (none, newest) if line]


def _figures(run_state: RunState, test: FinishedTest) -> list[str]:
    figures, specimen = test.figures, test.specimen
    if figures.E.known:
        return elastic_lines(figures, specimen)
    why = figures.E.why
    if not run_state.with_load:
        why = NO_FORCE
    elif not test.has_force:
        last_t = run_state.history.time_steps[-1].t
        why = Message("no burst has a force: {why}", run_state.loads.why_none_at(last_t))
    strengths = figure_lines(figures, specimen)[:1] if test.has_force else []
    return [Message("E is not known: {why}", why), *strengths]


def _remarks(run_state: RunState, test: FinishedTest) -> Iterator[str]:
    yield from tare_line(run_state.history, run_state.loads)
    angle = test.axis.angle
    if angle.known and abs(angle.value) > TURNED:
        yield from alignment_line(run_state.history, test.specimen)


def trouble_lines(
    run_state: RunState, reports: Sequence[ConsumerReport], *, verbose: bool = False
) -> Iterator[str]:
    """The frame counts, the outputs that lost something (all if ``verbose``), and the last warning or error."""
    yield run_state.frame_counts.line()
    yield from (
        Message("  {line}", one.line())
        for one in reports
        if verbose or one.failed or one.lost or any(one.dropped.values())
    )
    warnings = run_state.event_log.events("warning", "error")
    if warnings:
        last = sentence(warnings[-1], run_state.event_log.names)
        numbers = {level: run_state.event_log.count(level) for level in ("warning", "error")}
        counts = [counted(n, level) for level, n in numbers.items() if n]
        both = Message("{warnings} and {errors}", *counts) if len(counts) > 1 else counts[0]
        yield Message("{counts}, the last: {last}", both, last)


def _files(folder: Path) -> str:
    """Where the files are."""
    files = [path for path in sorted(folder.iterdir()) if path.is_file() and path.stat().st_size]
    total = Amount("size", sum(path.stat().st_size for path in files))
    return Message(
        "files: {folder} ({names}; {total})", folder, ", ".join(path.name for path in files), total
    )
