"""The table of a campaign: a row has the settings of a test, figures with their intervals, noise, losses.

It is ``summary.csv``, and ``summary.parquet`` with pyarrow; each is written completely or not at all.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from acquire.text import Message
from acquire.text.message import from_json, printable
from analysis.evaluate import TensileFigures
from live.config.loading import Config
from live.config.new_files import replaced_file
from live.pipeline.history import History
from live.replay.replay import Replayed
from live.results import Strain, still_phase_of
from live.results.figures import HEADLINE, tensile_table

Value = str | int | float | None
COLUMNS: dict[str, type] = {
    "test": str, "source": str, "outcome": str, "exit_code": int, "error": str,
    "zoi_px": int, "step_px": int, "burst": int, "order": int, "window": str, "estimator": str, "strain": str,
    "instants": int, "zois": int, "valid_last": int,
    **{f"{name}{end}": float for name in ("E_GPa", "nu", "Rp0.2_MPa", "Rm_MPa", "EA_kN", "Fp0.2_kN", "Fm_kN")
       for end in ("", "_low", "_high")},
    "strain_of_E": str, **{f"{name}{end}": float for name in ("r", "n") for end in ("", "_low", "_high")},
    "noise_GL": float, "strain_noise": float, "mean_strain_noise": float,
    "still_instants": int, "strain_noise_measured": float,
    "frames_lost": int, "pictures_left_out": int, "seconds": float,
}  # fmt: skip
"""Name and type of each column; a number that is not known is empty."""
RENEWED = "renewed"  # outcome of a chunk that cannot replace its part of the whole


@dataclass(frozen=True, slots=True, eq=False)
class BatchRow:
    """The row of one test; ``values`` has all of ``COLUMNS``."""

    values: Mapping[str, Value]

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> BatchRow:
        """A row with all columns in their order; a value of another type is left empty."""
        return cls({name: _fitting(values.get(name), kind) for name, kind in COLUMNS.items()})

    @property
    def is_well(self) -> bool:
        """Whether the test has the exit code 0."""
        return self.values["exit_code"] == 0

    @property
    def is_done(self) -> bool:
        """Whether the test has results."""
        return self.values["outcome"] != "failed"

    @property
    def words(self) -> str:
        """Name, outcome and error, in a line."""
        outcome = Message("with loss") if self.is_done else Message("failed")
        return Message("{test}: {outcome}: {error}", self.values["test"], outcome, self.values["error"])

    def to_json(self) -> dict[str, Any]:
        """The values, messages as such, for ``of`` in another process."""
        return {key: one.to_json() if isinstance(one, Message) else one for key, one in self.values.items()}


def failed(name: str, source: str, error: object, exit_code: int) -> BatchRow:
    """The row of a test without results."""
    found = {"test": name, "source": source, "outcome": "failed", "exit_code": exit_code, "error": error}
    return BatchRow.of(found)


def row_of_chunk(name: str, source: str, as_the_whole: bool, seconds: float) -> BatchRow:
    """The row of a chunk, which is in no table."""
    outcome = "done" if as_the_whole else RENEWED
    found = {"test": name, "source": source, "outcome": outcome, "exit_code": 0}
    return BatchRow.of({**found, "seconds": round(seconds, 3)})


def row_of(name: str, source: str, done: Replayed, seconds: float) -> BatchRow:
    """The row of a test that was replayed."""
    history, code = done.run_state.history, done.exit_code
    first = next(iter(done.lines), "") if history.has_values else Message("nothing was measured")
    return BatchRow.of(
        {
            "test": name,
            "source": source,
            "outcome": "done" if code == 0 else "with loss",
            "exit_code": code,
            "error": "" if code == 0 else first,
            **_settings(done.config),
            "burst": done.config.measure.burst or _burst(done),
            **_counts(history),
            **_figures(done.test.figures, done.config),
            **_noise(history),
            **_noise_floor(done.folder / "strain.h5"),
            "frames_lost": done.run_state.frame_counts.lost,
            "pictures_left_out": done.left_out,
            "seconds": round(seconds, 3),
        }
    )


def _settings(config: Config) -> dict[str, Any]:
    measure = config.measure
    names = ("order", "window", "estimator", "strain")
    found = {name: getattr(measure, name) for name in names}
    return {"zoi_px": measure.zoi, "step_px": measure.step, **found}


def _burst(done: Replayed) -> int | None:
    """Frames in a burst where the configuration has no number."""
    time_steps = len(done.run_state.history.time_steps)
    return round(done.run_state.frame_counts.measured / time_steps) if time_steps else None


def _counts(history: History) -> dict[str, Any]:
    last = history.time_steps[-1] if history.time_steps else None
    found: dict[str, Any] = {"instants": len(history.time_steps)}
    return found if last is None else {**found, "zois": last.n_zoi, "valid_last": last.n_valid}


def _figures(figures: TensileFigures, config: Config) -> dict[str, Any]:
    """Stresses where the section is known, else forces; and the strain that E and nu are from."""
    table = tensile_table(figures, stresses=config.specimen.area_m2 is not None)
    parts = {"": "value", "_low": "low", "_high": "high"}
    found: dict[str, Any] = {
        table[key].column + end: getattr(table[key].figure, part)
        for key in (*HEADLINE, "r", "n")
        for end, part in parts.items()
    }
    remark = f" ({figures.E.why})" if figures.E.known and figures.E.why else ""
    return found | {"strain_of_E": figures.elastic_strain + remark}


def _noise(history: History) -> dict[str, float]:
    """Medians over the test: noise of one frame, predicted noise of the strain of one ZOI and of the region."""
    columns = {"noise_GL": "noise_GL", "strain_noise": "zoi_sigma", "mean_strain_noise": "sigma_eyy"}
    return {name: _median(history, column) for name, column in columns.items()}


def _noise_floor(results: Path) -> dict[str, Any]:
    """The length of the still phase, and the scatter of one ZOI's eyy in it."""
    with Strain.open(results) as strain:
        still = still_phase_of(strain, ("eyy",))
    floor = still.floors.get("eyy")
    return {"still_instants": still.time_steps, "strain_noise_measured": floor and floor.measured}


def _median(history: History, column: str) -> float:
    values = history.column(column)
    values = values[np.isfinite(values)]
    return float(np.median(values)) if values.size else math.nan


def _fitting(value: Any, kind: type) -> Value:
    if kind is str:
        return "" if value is None else printable(from_json(value))
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return None
    return int(value) if kind is int else float(value)


def write_summary(rows: Sequence[BatchRow], out: Path) -> list[Path]:
    """Write the table, in place of that of an earlier call; Parquet only where pyarrow is installed.

    Raises
    ------
    DataError
        A file cannot be written; the earlier one stays.
    """
    made = {"summary.csv": as_csv(rows)}
    if (table := as_parquet(rows)) is not None:
        made["summary.parquet"] = table
    for name, content in made.items():
        with replaced_file(out / name) as part:
            part.write_bytes(content)
    return [out / name for name in made]


def as_csv(rows: Sequence[BatchRow]) -> bytes:
    """A heading, and a line for each test; unknown values are empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows([_cell(row.values[name]) for name in COLUMNS] for row in rows)
    return text.getvalue().encode("utf-8", "backslashreplace")


def as_parquet(rows: Sequence[BatchRow]) -> bytes | None:
    """The table as Parquet with types; None without pyarrow."""
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError:
        return None
    kinds = {str: pyarrow.string(), int: pyarrow.int64(), float: pyarrow.float64()}
    schema = pyarrow.schema([(name, kinds[kind]) for name, kind in COLUMNS.items()])
    sink = io.BytesIO()
    parquet.write_table(pyarrow.Table.from_pylist([dict(row.values) for row in rows], schema), sink)
    return sink.getvalue()


def _cell(value: Value) -> Any:
    """The value as a cell that no spreadsheet reads as a formula."""
    return value.lstrip("=+-@\t ") if isinstance(value, str) else "" if value is None else value
