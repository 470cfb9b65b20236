"""The outcome of a characterisation: what it consists of, its file and page, its progress.

An ``ExperimentOutcome`` is text and tables, stored as JSON without loss; figures and CSV files are beside it.
"""

from __future__ import annotations

import csv
import dataclasses
import datetime
import io
import json
import math
import os
import platform
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, TextIO

from acquire.errors import ConfigError, DataError
from live.config.new_files import new_file

FORMAT = 1
DPI = 80
_BAR = 24  # letters

LIBRARIES = ("phasedic", "numpy", "scipy", "numba", "opencv-python-headless")


@dataclass(frozen=True, slots=True)
class ResultTable:
    """Rows under headings that carry their units; ``name`` is that of its CSV file."""

    name: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...]

    def csv(self) -> str:
        """As CSV, numbers in full."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(self.columns)
        writer.writerows(self.rows)
        return text.getvalue()

    def markdown(self) -> str:
        """As a Markdown table, numbers to three digits."""
        lines = ["| " + " | ".join(self.columns) + " |", "|" + " --- |" * len(self.columns)]
        lines += ["| " + " | ".join(shown(value) for value in row) + " |" for row in self.rows]
        return "\n".join(lines)


@dataclass(frozen=True, slots=True)
class ExperimentOutcome:
    """The result of one experiment.

    Attributes
    ----------
    name, title : str
    text : str
        Markdown under the title, with links ``![...](figure.png)``.
    tables : tuple of ResultTable
    figures : tuple of str
        File names beside the page.
    verdicts : tuple
        Comparisons with others (``tests.paper.outcomes``); none of one's own pattern.
    seconds : float, s
        Time it took.
    """

    name: str
    title: str
    text: str
    tables: tuple[ResultTable, ...] = ()
    figures: tuple[str, ...] = ()
    verdicts: tuple[Any, ...] = ()
    seconds: float = 0.0


@dataclass(frozen=True, slots=True)
class ExperimentContext:
    """The folder, extent, data and progress of an experiment.

    Attributes
    ----------
    folder : Path
        Of its figures.
    quick : bool
        Fewer ZOIs and cases.
    data : Path or None
        Folder of real image sets.
    tick : callable
        Called with the share done so far, 0 to 1.
    """

    folder: Path
    quick: bool = False
    data: Path | None = None
    tick: Callable[[float], None] = field(default=lambda share: None)

    def steps(self, items: Iterable[Any]) -> Iterable[Any]:
        """The items one by one, ticking after each."""
        everything = list(items)
        for number, item in enumerate(everything):
            yield item
            self.tick((number + 1) / len(everything))


def shown(value: Any) -> str:
    """A value as text: three digits, with a power of ten where needed."""
    if not isinstance(value, float):
        return str(value)
    if math.isnan(value):
        return "-"
    if value == 0:
        return "0"
    if 1e-3 <= abs(value) < 1e4:
        digits = max(0, 2 - math.floor(math.log10(abs(value))))
        return f"{value:.{digits}f}"
    return f"{value:.2e}"


def figure(width: float = 9.0, height: float = 3.6) -> Any:
    """An empty figure (inches) that needs no display.

    Raises
    ------
    ConfigError
        matplotlib is missing.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise ConfigError(
            "figures need matplotlib, which is not installed: pip install phasedic[plots]"
        ) from None
    return Figure(figsize=(width, height), layout="constrained")


def save_figure(context: ExperimentContext, name: str, drawn: Any) -> str:
    """Write a figure beside the page; returns its file name."""
    drawn.savefig(context.folder / name, dpi=DPI, metadata={"Software": None})
    return name


def write_outcome(outcome: ExperimentOutcome, folder: Path, key: str) -> None:
    """Store an outcome as JSON, and its tables as CSV. The JSON appears complete or not at all."""
    for table in outcome.tables:
        (folder / f"{table.name}.csv").write_text(table.csv(), encoding="utf-8")
    document = {"format": FORMAT, "key": key, "outcome": dataclasses.asdict(outcome)}
    new = folder / f".{outcome.name}.json.new"
    new.write_text(json.dumps(document, indent=1), encoding="utf-8")
    new.replace(folder / f"{outcome.name}.json")


def save_new(drawn: Any, path: Path) -> None:
    """Write a figure to a new file, in the format that its name ends in.

    Raises
    ------
    ConfigError
        The file exists, or has another ending than .png, .svg and .pdf.
    DataError
        It cannot be written.
    """
    if path.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise ConfigError("{path}: choose a name that ends in .png, .svg or .pdf", path)
    with new_file(path) as part:
        drawn.savefig(part, dpi=110, format=path.suffix.lower()[1:])


class ProgressBar:
    """The progress of an experiment: a bar on a terminal, else one line at the end. Called with the share done."""

    def __init__(self, name: str, screen: TextIO | None) -> None:
        self._name, self._screen = name, screen
        self._live = screen is not None and screen.isatty()
        self(0.0)

    def __call__(self, share: float) -> None:
        if self._live:
            filled = round(_BAR * min(max(share, 0.0), 1.0))
            self._write(f"\r{self._name:12} [{'#' * filled}{'.' * (_BAR - filled)}] {100 * share:3.0f} %")

    def done(self, words: str) -> None:
        """Show the end of the experiment."""
        if self._live:
            self(1.0)
            self._write(f"  {words}\n")
        else:
            self._write(f"{self._name:12} {words}\n")

    def _write(self, text: str) -> None:
        if self._screen is not None:
            print(text, end="", file=self._screen, flush=True)


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


def page(outcomes: Sequence[ExperimentOutcome], command: str, images: str, *intro: str) -> str:
    """The whole page.

    Parameters
    ----------
    outcomes : sequence of ExperimentOutcome
    command : str
        The command as typed.
    images : str
        Folder of the figures relative to the page; "" for the same folder.
    *intro : str
        What stands above the first section; the line on command and machine comes behind the first.
    """
    seconds = sum(outcome.seconds for outcome in outcomes)
    today = datetime.datetime.now(datetime.UTC).date().isoformat()
    made = f"Made by `{command}` on {today} in {seconds:.0f} s on {machine()}."
    parts = ["# Characterisation", intro[0].strip(), made, *intro[1:]]
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


def write_page(
    outcomes: Sequence[ExperimentOutcome], target: Path, folder: Path, typed: str, *intro: str
) -> None:
    """Write the Markdown page with links to the figures."""
    images = os.path.relpath(folder, target.parent)
    try:
        target.write_text(page(outcomes, typed, "" if images == "." else images, *intro), encoding="utf-8")
    except OSError as error:
        raise DataError("{path} cannot be written: {why}; give another --page", target, error) from error
