"""The figures of a run as text: the summary at its end, and the status card of the view while it runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from acquire.load_cell import LoadLog
from acquire.text import Amount, Message, counts, joined, word
from acquire.text.message import brief, counted, share_text
from analysis.field import Blur, Status
from live.config.sections import SpecimenConfig
from live.pipeline.history import History
from live.pipeline.run_state import RunState
from live.pipeline.snapshot import Snapshot
from live.results.figures import (
    alignment_line,
    elastic_lines,
    evaluate,
    figure_lines,
    film_line,
    lag_line,
    sharpness_line,
    tare_line,
)
from live.results.finished.figures_file import checks_line
from live.results.finished.findings import DataCheck, doubts, findings
from live.results.finished.finished_test import FinishedTest
from live.words.language import told

_CARD_EVERY_S = 1.0  # of the test


def valid_line(history: History) -> str:
    """How many bursts were measured, and how many ZOIs have a value in the last of them."""
    last = history.time_steps[-1]
    refused = Message(" ({refused})", last.refused) if last.refused else ""
    return Message(
        "measured {bursts}, {valid} of {zois} ZOIs valid in the last{refused}",
        counted(len(history.time_steps), "burst"), *counts(last.n_valid, last.n_zoi), refused,
    )  # fmt: skip


def noise_line(history: History) -> str:
    """The noise of the picture and of the strain, typical of the run."""
    noise = history.column("noise_GL")
    noise = noise[np.isfinite(noise)]
    picture = Message("one frame {noise:.3g} GL, ", np.median(noise)) if noise.size else ""
    one, mean = (float(np.nanmedian(history.column(name))) for name in ("zoi_sigma", "sigma_eyy"))
    return Message(
        "noise: {picture}strain of one ZOI {one}, of the region {mean} (predicted, 1 sigma)",
        picture, Amount.rough("strain", one), Amount.rough("strain", mean, 2),
    )  # fmt: skip


def latency_lines(history: History) -> list[str]:
    """The latency of the results; nothing in a replay."""
    late = history.column("latency_s") * 1e3
    if not np.isfinite(late).any():
        return []
    p50, p95 = np.nanpercentile(late, (50, 95))
    kernel = np.median(history.column("measure_s")) * 1e3
    return [
        Message(
            "latency from the last frame of a burst: p50 {p50:.0f} ms, p95 {p95:.0f} ms, largest {most:.0f} ms; "
            "the kernel took {kernel:.1f} ms",
            p50,
            p95,
            np.nanmax(late),
            kernel,
        )
    ]


def why_nothing(run_state: RunState) -> str:
    """Why no ZOI has a value, in one sentence."""
    time_steps, troubles = run_state.history.time_steps, run_state.event_log.events("warning", "error")
    if time_steps:
        why = time_steps[-1].refused or Message("no ZOI is active")
        named = sorted((why.index(one.name), word(one.text)) for one in Status if one.name in why)
        words = Message("nothing was measured: no ZOI has a value ({why})", why)
        return joined("; ", (words, named[0][1])) if named else words  # the most frequent stands first
    if troubles:
        return Message("nothing was measured: {why}", brief(troubles[-1].text))
    return Message(
        "nothing was measured: {grabbed} frames gave no burst after the reference; take shorter bursts",
        run_state.frame_counts.grabbed,
    )


def look_lines(found: Sequence[DataCheck]) -> list[str]:
    """What the data say against the figures."""
    return [Message("look: {text}", text) for text in doubts(found)]


def summary_lines(run_state: RunState, test: FinishedTest) -> list[str]:
    """The summary, a line each."""
    history, specimen = run_state.history, test.specimen
    valid = np.flatnonzero(history.column("n_valid"))
    if not valid.size:
        return [why_nothing(run_state)]
    last, largest_ones = history.time_steps[-1], history.column("largest")[valid]
    largest = largest_ones[np.argmax(np.abs(largest_ones))]
    strains = {
        name: Amount("strain", getattr(last, name), getattr(last, f"sigma_{name}"))
        for name in ("exx", "eyy", "exy")
    }
    means = joined("  ", [joined(" ", one) for one in strains.items()])
    means = Message("none, {why}", last.apart) if last.apart else means
    means = means if last.n_valid else Message("no value, 0 of {zois} ZOIs valid", last.n_zoi)
    lines = [
        valid_line(history),
        Message(
            "last strain of the region: {means}; largest of any ZOI {largest}",
            joined(" ", (means, share_text(last.least_share))),
            Amount("strain", largest),
        ),
        noise_line(history),
    ]
    lines += sharpness_line(history.column("blur").tolist(), history.column("sigma_blur").tolist())
    found = findings(test)
    lines += [*latency_lines(history), *film_line(specimen), checks_line(found), *look_lines(found)]
    figures = [*test.longer, *figure_lines(test.figures, specimen)]
    if figures:
        figures += tare_line(history, run_state.loads) + lag_line(history, run_state.loads, specimen)
    return lines + figures + alignment_line(history, specimen)


def file_lines(folder: Path) -> list[str]:
    """The files in ``folder``, with sizes."""
    return [
        Message("  {path}  ({size})", path, Amount("size", path.stat().st_size))
        for path in sorted(folder.iterdir())
        if path.is_file() and path.stat().st_size
    ]


class StatusCard:
    """The card in Markdown, renewed once a second of the test."""

    def __init__(self, specimen: SpecimenConfig, loads: LoadLog) -> None:
        self._specimen, self._loads = specimen, loads
        self._last = -math.inf

    def is_due(self, now: float) -> bool:
        """Whether a second has passed at ``now`` (s, monotonic) since this last returned True."""
        if now - self._last < _CARD_EVERY_S:
            return False
        self._last = now
        return True

    def written(self, snapshot: Snapshot, history: History) -> str:
        """The card in the language of the terminal: the last measurement, and the figures of all of ``history``."""
        return "\n\n".join(told(line) for line in self._lines(snapshot, history))

    def _lines(self, snapshot: Snapshot, history: History) -> list[str]:
        i, frames, lost = history.time_steps[-1], snapshot.frames, snapshot.lost
        one, mean = Amount.rough("strain", i.zoi_sigma), Amount.rough("strain", i.sigma_eyy, 2)
        refused = Message(" ({refused})", i.refused) if i.refused else ""
        lines: list[str] = [
            Message("**{valid} of {zois}** ZOIs valid{refused}", *counts(i.n_valid, i.n_zoi), refused),
            Message("one ZOI **{one}**, region **{mean}** (1 σ)", one, mean),
        ]
        lines += film_line(self._specimen)
        blur = Blur(i.blur, i.sigma_blur).text
        lines += [Message("{blur} since the reference", blur)] * bool(blur)
        if part := share_text(i.least_share):
            lines.append(Message("strain **{part}**", part))
        if snapshot.axis_assumed:
            lines.append(Message("axis of the load **{axis}**, assumed", snapshot.axis))
        figures = evaluate(history, self._loads, self._specimen)
        lines += [told(line).replace("  ", ", ") for line in elastic_lines(figures, self._specimen)]
        lost_text = Message("**{lost}**", lost) if lost else 0
        lines.append(
            Message(
                "recorded {recorded}, measured {measured}, skipped {skipped}, lost {lost}",
                *counts(*(frames[name] for name in ("recorded", "measured", "skipped"))),
                lost_text,
            )
        )
        return lines
