"""``figures.json``: figures, counts and checks of a test for other programs; and what a person asks of them.

docs/strain-format.md describes the file. Can the figures be believed, what is missing, and what is to be typed for it:
summary and report show the same lines, made of the figures and checks that ``figures.json`` has.
"""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np

from acquire.errors import DataError, PhasedicError
from acquire.events import EventKind
from acquire.text import Message, joined, word
from acquire.text.message import kept, taken
from analysis.evaluate import CONFIDENCE, Figure
from analysis.evaluate.elastic import FILM
from live.config.loading import Config
from live.config.new_files import new_file
from live.pipeline.run_state import RunState
from live.results.figures import TensileRow, tensile_table
from live.results.finished.cycles import creep_figures
from live.results.finished.findings import NO_FORCE, DataCheck, changes, findings
from live.results.finished.finished_test import FinishedTest
from live.results.place_response import response_of
from live.results.run_folder import SESSION, RunFolder

FILE, FORMAT, VERSION = "figures.json", "phasedic-figures", 1
COUNTS = ("grabbed", "recorded", "measured", "skipped", "lost", "without_force")
T = TypeVar("T")
_SI = {"MPa": "Pa", "GPa": "Pa", "kN": "N", "%": "1", "": "1"}
NamedFigure = tuple[str, Figure, str]
"""Name, figure and SI unit."""
_NO_SECTION = Message("the section is not known: give --section W,T")


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
    if len(stress) > 3 and not changes(stress, 0.0):
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


@dataclass(frozen=True, slots=True)
class FiguresFile:
    """The content of the file.

    Attributes
    ----------
    figures : sequence of mapping
        name, value, low, high, confidence, unit, reason, qualifier, remark; SI units, None where unknown.
    counts : mapping of str to int or None
        ``COUNTS``.
    checks : sequence of DataCheck
    exit_code : int
    remarks : sequence of str
        Further lines of the summary of a replay.
    """

    figures: Sequence[Mapping[str, Any]]
    counts: Mapping[str, int | None]
    checks: Sequence[DataCheck]
    exit_code: int
    remarks: Sequence[str] = ()

    @classmethod
    def of(
        cls,
        test: FinishedTest,
        counts: Mapping[str, int],
        exit_code: int,
        more: Iterable[NamedFigure] = (),
        remarks: Sequence[str] = (),
    ) -> FiguresFile:
        """The file of a finished test, with ``more`` figures; of the counts of frames those in ``COUNTS`` are taken."""
        chosen = {name: counts.get(name) for name in COUNTS}
        return cls(
            [*_figures(test), *(_row(*one) for one in more)], chosen, findings(test), exit_code, remarks
        )

    @property
    def text(self) -> str:
        """As JSON."""
        checks = [{"name": one.name, "outcome": one.outcome, "text": one.text} for one in self.checks]
        content = {
            "format": FORMAT,
            "version": VERSION,
            "figures": self.figures,
            "counts": self.counts,
            "checks": checks,
            "exit_code": self.exit_code,
            "remarks": [kept(one) for one in self.remarks],
        }
        return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"

    def write(self, folder: Path) -> None:
        """Write a new file into ``folder``; raises DataError or ConfigError where that cannot be done."""
        with new_file(folder / FILE) as part:
            part.write_text(self.text, encoding="utf-8")


def finished(
    folder: Path,
    config: Config,
    run_state: RunState,
    exit_code: int,
    reference_N: float,
    start_t: float = 0.0,
    remarks: Sequence[str] = (),
) -> FinishedTest:
    """Evaluate a run or replay that has just ended, and write its ``figures.json`` and ``cycles.csv``.

    Where writing fails it is an event. ``reference_N`` is the force at the reference, N; NaN where it is not known;
    ``start_t`` the time, s, that times of the results count from; ``remarks`` what the summary says beside the
    figures. A response of the places that is wanted is evaluated.
    """
    test = FinishedTest.of_run(run_state, config.specimen, config.gauges, reference_N, start_t)
    test = replace(test, measure=config.measure.strain)
    further: Sequence[NamedFigure] = ()
    if config.output.response:
        lines, further = response_of(folder, test.figures, config.output.response)
        test = replace(test, response=tuple(lines))
    try:
        test.cycles.write(folder)
        counts = run_state.frame_counts.as_dict()
        FiguresFile.of(test, counts, exit_code, further, remarks).write(folder)
    except PhasedicError as error:
        run_state.event_log.emit(EventKind.RECORDER, FILE, error.text, "warning")
    return test


def finished_in(run: RunFolder) -> FinishedTest:
    """The finished test of a folder; where no reading is recorded, with the lag that the replay found with its file."""
    test = FinishedTest.of_folder(run)
    return test if run.readings.count else replace(test, lag=stored_lag(run.path) or test.lag)


def stored_lag(folder: Path) -> Figure | None:
    """The lag that the run or replay found, s, from its ``figures.json``; None where there is no such file."""
    return _read(folder, _lag_of)


def stored_remarks(folder: Path) -> list[str]:
    """What the summary of a replay said beside the figures; nothing where there is no ``figures.json``."""
    return _read(folder, lambda content: [*map(taken, content.get("remarks", ()))]) or []


def _lag_of(content: Mapping[str, Any]) -> Figure:
    found = {one["name"]: one for one in content["figures"]}["lag"]
    value, low, high = (
        math.nan if found[key] is None else float(found[key]) for key in ("value", "low", "high")
    )
    return Figure(value, low, high, str(found["reason"] or ""))


def _read(folder: Path, of: Callable[[Mapping[str, Any]], T]) -> T | None:
    path = folder / FILE
    if not path.exists():
        return None
    try:
        return of(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise DataError(
            "{path}: cannot be read ({why}); make the results again with phasedic replay", path, error
        ) from None


def _figures(test: FinishedTest) -> Iterator[dict[str, Any]]:
    stresses = test.specimen.area_m2 is not None
    for key, row in tensile_table(test.figures, stresses=stresses).items():
        yield _row(row.name, getattr(test.figures, key), _SI.get(row.unit, row.unit))
    if not stresses:
        for row in tensile_table(test.figures, stresses=True).values():
            if _SI.get(row.unit) == "Pa":
                yield _row(row.name, Figure.none(_NO_SECTION), "Pa")
    yield _row("lag", test.lag, "s")
    for name, figure, unit in (*test.cycles.figures(), *creep_figures(test.creep)):
        yield _row(name, figure, unit)
    for name, value in test.at_end.items():
        figure = Figure.about(value.value, value.sigma) if not value.reason else Figure.none(value.reason)
        film = test.specimen.film_error_percent
        yield _row(f"{name} at the end", figure.limited(film / 100, FILM) if film else figure, "1")


def _row(name: str, figure: Figure, unit: str) -> dict[str, Any]:
    return {
        "name": name,
        "value": _finite(figure.value),
        "low": _finite(figure.low),
        "high": _finite(figure.high),
        "confidence": CONFIDENCE if figure.known else None,
        "unit": unit,
        "reason": None if figure.known else figure.why or "not known",
        "qualifier": figure.qualifier or None,
        "remark": (figure.why or None) if figure.known else None,
    }


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
