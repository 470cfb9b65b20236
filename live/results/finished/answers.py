"""What a person asks of a test: can its figures be believed, what is missing, and what to type for it.

Summary and report show the same lines, made of the figures and checks that ``figures.json`` has.

Whether the first figures of a test can be believed, as one sentence for page and report.
"""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from acquire.text import Message, joined, word
from live.results.figures import TensileRow
from live.results.finished.findings import NO_FORCE, DataCheck, changes
from live.results.finished.finished_test import FinishedTest
from live.results.run_folder import SESSION


@dataclass(frozen=True, slots=True)
class Belief:
    """The sentence.

    Attributes
    ----------
    kind : "good", "look" or "bad"
        All figures can be believed, some, or none is known.
    words : str
        Each exception is named.
    more : str
        What their intervals hold; empty where no figure is known.
    """

    kind: Literal["good", "look", "bad"]
    words: str
    more: str = ""


def belief(rows: Sequence[TensileRow], troubles: Sequence[str], limits: str = "") -> Belief:
    """The sentence on the figures ``rows``.

    What the data say against a test (``troubles``) stands against all of its figures. ``limits`` are those of error
    that the interval of E holds beside the scatter, in words (``beyond_scatter``). A bound says by itself what it is:
    it is in doubt only where nothing else is known.
    """
    known = [row for row in rows if row.figure.known]
    sure = ", ".join(row.name for row in known if not row.remark)
    doubtful = ", ".join(row.name for row in known if row.remark and not (sure and row.figure.is_bound))
    if not known:
        return Belief("bad", Message("No figure is known; the list says why."))
    held = Message("The intervals (95 %) hold the scatter.")
    if limits:
        held = Message("The intervals (95 %) hold the scatter, that of E also the {limits}.", limits)
    if troubles:
        names = ", ".join(row.name for row in known)
        return Belief("look", Message("Look at the remarks before you believe {names}.", names), held)
    if doubtful and sure:
        return Belief("look", Message("{sure} can be believed; look at {doubtful}.", sure, doubtful), held)
    if doubtful:
        return Belief("look", Message("Look at {doubtful}: each has a remark.", doubtful), held)
    more = Message("The data say nothing against them.")
    return Belief("good", Message("{sure} can be believed.", sure), more + " " + held)


@dataclass(frozen=True, slots=True)
class MeasuredAgain:
    """How the test can be measured once more.

    Attributes
    ----------
    command : str
        That measures it again; words where no recording is there.
    n_frames : float
        Frames in a burst.
    skipped : int
        Frames of bursts that were recorded and not measured; 0 where they were not recorded.
    """

    command: str
    n_frames: float = 1.0
    skipped: int = 0

    @classmethod
    def of(cls, folder: Path, n_frames: float, skipped: int) -> MeasuredAgain:
        """How a run or replay in ``folder`` can be."""
        if not (folder / SESSION).exists():
            return cls(Message("the same command with"), n_frames)
        return cls(f"phasedic replay {shlex.quote(str(folder))}", n_frames, skipped)


def checks_line(found: Sequence[DataCheck]) -> str:
    """Which checks of the data are good, which are in doubt, and which could not be made."""
    words = {
        "good": Message("good"), "doubt": Message("in doubt"), "not checked": Message("not possible"),
    }  # fmt: skip
    names = {outcome: [word(one.name) for one in found if one.outcome == outcome] for outcome in words}
    without = [one for one in found if one.text == NO_FORCE]
    if without:
        names["not checked"] = [Message("{n} that need a force", len(without))]
    parts = [joined(" ", (joined(", ", held), words[outcome])) for outcome, held in names.items() if held]
    return Message("checks of the data: {checks}", joined("; ", parts))


def missing_lines(test: FinishedTest, again: MeasuredAgain) -> Iterator[str]:
    """What is missing for E and the rest, each with what to type."""
    section = "" if test.specimen.area_m2 else " --section W,T"
    if not test.has_force and not test.samples.count:
        yield Message("missing: forces, for E: {command} --load FORCES.csv{section}", again.command, section)
    elif not test.has_force:
        yield Message(
            "missing: forces at the time of the pictures, for E: {command} --load FORCES.csv --lag S",
            again.command,
        )
    elif not test.figures.E.known and test.figures.kind == "tensile":
        yield _more_points(test, again)
    elif section and test.figures.E.known:
        yield Message("missing: the section in mm, for E in GPa: {command}{section}", again.command, section)
    if test.has_force and test.axis.assumed:
        yield Message(
            "missing: the axis of the load ({axis} is assumed): {command} --axis x or y",
            test.axis.axis,
            again.command,
        )
    if again.skipped:
        yield Message(
            "missing: {skipped} frames came too fast to be measured: {command} measures them",
            again.skipped,
            again.command,
        )


def _more_points(test: FinishedTest, again: MeasuredAgain) -> str:
    """What gives the elastic line more points."""
    stress = test.curve.stress[np.isfinite(test.curve.stress)]
    if not changes(stress, 0.0):
        return Message("missing: a force that changes, for E: look at load cell and file of forces")
    if again.n_frames > 1:
        return Message(
            "missing: points while the force rises, for E: {command} --burst 1 gives {n:.3g} times as many",
            again.command,
            again.n_frames,
        )
    return Message(
        "missing: points while the force rises, for E: take more pictures there, or pull more slowly"
    )
