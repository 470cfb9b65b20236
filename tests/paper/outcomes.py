"""Verdicts, stored outcomes and maps of the experiments, beside what ``live.setup.pattern.outcome`` has."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from acquire.errors import DataError
from live.setup.pattern.outcome import FORMAT, Comparison, ExperimentOutcome, ResultTable, Word, shown

EQUAL_WITHIN = 0.1


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
    """The outcome of an earlier run with the same key; None where there is none.

    Raises
    ------
    DataError
        The file is not an outcome.
    """
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
