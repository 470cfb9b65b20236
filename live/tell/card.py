"""The status card of the view: where the test stands, in a few lines of Markdown."""

from __future__ import annotations

import math

from acquire.load_cell import LoadLog
from live.measure import History, Snapshot
from live.setup import SpecimenConfig
from live.tell.figures import elastic_lines, evaluate

EVERY_S = 1.0  # of the test


class StatusCard:
    """Writes the card anew once a second of the test."""

    def __init__(self, specimen: SpecimenConfig, loads: LoadLog) -> None:
        self._specimen, self._loads = specimen, loads
        self._last = -math.inf

    def is_due(self, now: float) -> bool:
        """Whether the last card is old at ``now`` (s, monotonic); then the next is not, for a while."""
        if now - self._last < EVERY_S:
            return False
        self._last = now
        return True

    def written(self, snapshot: Snapshot, history: History) -> str:
        """The card, from the last instant and the figures of all of ``history``."""
        return "\n\n".join(self._lines(snapshot, history))

    def _lines(self, snapshot: Snapshot, history: History) -> list[str]:
        i, frames, lost = history.instants[-1], snapshot.frames, snapshot.lost
        lines = [
            f"**{i.n_valid} of {i.n_zoi}** ZOIs valid" + (f" ({i.refused})" if i.refused else ""),
            f"one ZOI **{i.zoi_sigma * 1e6:.3g}** µm/m, mean **{i.sigma_eyy * 1e6:.2g}** µm/m (1 σ)",
        ]
        figures = evaluate(history, self._loads, self._specimen)
        lines += [
            line.replace("  ", ", ").replace("+-", "±") for line in elastic_lines(figures, self._specimen)
        ]
        lines.append(
            f"recorded {frames['recorded']}, measured {frames['measured']}, skipped {frames['skipped']},"
            f" lost {f'**{lost}**' if lost else 0}"
        )
        return lines
