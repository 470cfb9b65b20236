"""What summary, page, report and figures.json say of the creep of a finished test."""

from __future__ import annotations

from collections.abc import Iterator

from acquire.text import Message
from acquire.text.message import joined
from acquire.text.quantity import Amount
from analysis.evaluate import Figure
from analysis.evaluate.creep import Creep


def creep_figures(creep: Creep | None) -> Iterator[tuple[str, Figure, str]]:
    """Name, figure and SI unit of what other programs get; nothing of a test whose force is not held."""
    if creep is not None:
        yield "creep rate", creep.rate, "1/s"
        for strain, time in creep.times:
            yield f"time to a strain of {strain:.6g}", time, "s"


def creep_lines(creep: Creep | None, *, stresses: bool) -> list[str]:
    """What a person reads; nothing of a test whose force is not held."""
    if creep is None:
        return []
    rate = joined("/", [_amount("strain", creep.rate), "s"]) if creep.rate.known else creep.rate.why
    found = [
        Message("{strain} after {time}", Amount.rough("strain", strain, 4), _amount("time", time))
        for strain, time in creep.times
    ]
    load, duration = Amount.rough("stress" if stresses else "force", creep.load, 4), creep.t[-1:].sum()
    held = Message(
        "{load} held from {since:.4g} s on: mean strain rate in the last half of {duration:.4g} s: {rate}",
        load, creep.since, duration, rate,
    )  # fmt: skip
    return [joined(", ", [held, *found])]


def _amount(kind: str, figure: Figure) -> Amount:
    return Amount(kind, figure.value, figure.high - figure.value, 2)
