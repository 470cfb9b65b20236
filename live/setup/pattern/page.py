"""The Markdown page of a characterisation: verdicts first, then section by section."""

from __future__ import annotations

import datetime
import os
import platform
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from acquire.errors import DataError
from live.setup.pattern.outcome import Comparison, ExperimentOutcome, ResultTable, Word

WORDS: tuple[Word, ...] = ("better", "equal", "worse")
LIBRARIES = ("phasedic", "numpy", "scipy", "numba", "opencv-python-headless")


def machine() -> str:
    """Processor, system and versions, in one line."""
    versions = []
    for name in LIBRARIES:
        try:
            versions.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            continue
    return (
        f"{_processor()}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}; "
        + ", ".join(versions)
    )


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    return next(
        (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), platform.machine()
    )


def page(outcomes: Sequence[ExperimentOutcome], command: str, images: str, intro: str) -> str:
    """The whole page.

    Parameters
    ----------
    outcomes : sequence of ExperimentOutcome
    command : str
        The command as typed.
    images : str
        Folder of the figures relative to the page; "" for the same folder.
    intro : str
    """
    seconds = sum(outcome.seconds for outcome in outcomes)
    today = datetime.datetime.now(datetime.UTC).date().isoformat()
    made = f"Made by `{command}` on {today} in {seconds:.0f} s on {machine()}."
    parts = ["# Characterisation", intro.strip(), made, comparison_summary(outcomes)]
    parts += [f"## {outcome.title}\n\n{linked(outcome, images)}" for outcome in outcomes]
    return "\n\n".join(part for part in parts if part) + "\n"


def linked(outcome: ExperimentOutcome, images: str) -> str:
    """The text of an outcome with links to its figures and CSV files."""
    text = outcome.text.strip()
    prefix = f"{images}/" if images else ""
    for name in outcome.figures:
        text = text.replace(f"]({name})", f"]({prefix}{name})")
    if outcome.tables:
        text += (
            "\n\nNumbers: " + ", ".join(f"[{t.name}.csv]({prefix}{t.name}.csv)" for t in outcome.tables) + "."
        )
    return text


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
    """Write the Markdown page with links to the figures, and the verdicts as CSV beside them."""
    images = os.path.relpath(folder, target.parent)
    text = page(outcomes, typed, "" if images == "." else images, intro)
    try:
        target.write_text(text, encoding="utf-8")
        if verdicts := [v for outcome in outcomes for v in outcome.verdicts]:
            (folder / "verdicts.csv").write_text(_table(verdicts).csv(), encoding="utf-8")
    except OSError as error:
        raise DataError("{path} cannot be written: {why}; give another --page", target, error) from error
