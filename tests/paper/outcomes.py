"""Verdicts, stored outcomes, page and maps of the experiments, beside what ``live.setup.pattern.outcome`` has."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from acquire.errors import DataError
from live.setup.pattern import outcome as product
from live.setup.pattern.outcome import FORMAT, ExperimentOutcome, ResultTable, shown

EQUAL_WITHIN = 0.1
Word = Literal["better", "equal", "worse"]
WORDS: tuple[Word, ...] = ("better", "equal", "worse")


@dataclass(frozen=True, slots=True)
class Comparison:
    """Our result against another one: the paper, the limit or a peer; both figures are in the subject."""

    subject: str
    against: str
    word: Word


def compared(ours: float, theirs: float) -> Word:
    """The verdict on two figures; smaller is better."""
    if ours < theirs * (1 - EQUAL_WITHIN):
        return "better"
    return "equal" if ours <= theirs * (1 + EQUAL_WITHIN) else "worse"


def verdict(what: str, unit: str, ours: float, theirs: float, against: str) -> Comparison:
    """A verdict whose text carries both figures."""
    subject = f"{what}: {shown(float(ours))} against {shown(float(theirs))} {unit}".rstrip()
    return Comparison(subject, against, compared(ours, theirs))


def colour_map(axes: Any, values: Any, title: str, unit: str, limits: Sequence[float] | None = None) -> Any:
    """A map with its colour bar, symmetric about its middle unless limits are given."""
    import numpy as np

    low, high = limits if limits is not None else np.nanpercentile(values, [1, 99])
    picture = axes.imshow(values, cmap="RdBu_r", vmin=low, vmax=high, interpolation="nearest")
    axes.set_title(title, fontsize=9)
    axes.set_xticks([])
    axes.set_yticks([])
    axes.figure.colorbar(picture, ax=axes, shrink=0.8, label=unit)
    return picture


def read_outcome(name: str, folder: Path, key: str) -> ExperimentOutcome | None:
    """The outcome of an earlier run with the same key; None where there is none."""
    path = folder / f"{name}.json"
    if not path.exists():
        return None
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        if document["format"] != FORMAT or document["key"] != key:
            return None
        outcome = _from_dict(document["outcome"])
    except (ValueError, KeyError, TypeError) as error:
        raise DataError(f"{path} is not a result of an experiment ({error}); delete it") from error
    return outcome if all((folder / each).exists() for each in outcome.figures) else None


def _from_dict(values: dict[str, Any]) -> ExperimentOutcome:
    tables = tuple(
        ResultTable(t["name"], tuple(t["columns"]), tuple(tuple(row) for row in t["rows"]))
        for t in values["tables"]
    )
    verdicts = tuple(Comparison(**v) for v in values["verdicts"])
    return ExperimentOutcome(
        values["name"], values["title"], values["text"], tables,
        tuple(values["figures"]), verdicts, float(values["seconds"]),
    )  # fmt: skip


def comparison_summary(outcomes: Sequence[ExperimentOutcome]) -> str:
    """The comparisons in which ours is worse, equal (within 10 %) or better, from all sections."""
    verdicts = [verdict for outcome in outcomes for verdict in outcome.verdicts]
    if not verdicts:
        return ""
    counts = ", ".join(f"{word} in {sum(v.word == word for v in verdicts)}" for word in WORDS)
    lines = ["## Comparisons", "", f"Of {len(verdicts)} comparisons (equal: within 10 %): {counts}."]
    for word in reversed(WORDS):
        chosen = [v for v in verdicts if v.word == word]
        if chosen:
            lines += ["", f"**{word.capitalize()}** (ours first):", "", *(_line(v) for v in chosen)]
    return "\n".join(lines)


def _line(verdict: Comparison) -> str:
    return f"- {verdict.subject} ({verdict.against})"


def _table(verdicts: Sequence[Comparison]) -> ResultTable:
    rows = [(v.word, v.subject, v.against) for word in reversed(WORDS) for v in verdicts if v.word == word]
    return ResultTable("verdicts", ("verdict", "ours against the other", "the other"), tuple(rows))


def write_page(outcomes: list[ExperimentOutcome], target: Path, folder: Path, typed: str, intro: str) -> None:
    """The page with the comparisons first, and these as CSV beside the figures."""
    product.write_page(outcomes, target, folder, typed, intro, comparison_summary(outcomes))
    if verdicts := [v for outcome in outcomes for v in outcome.verdicts]:
        (folder / "verdicts.csv").write_text(_table(verdicts).csv(), encoding="utf-8")
