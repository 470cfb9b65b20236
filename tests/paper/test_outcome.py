"""How results of experiments are kept, shown and judged."""

from __future__ import annotations

import csv
import io
import math
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquire.errors import ConfigError, DataError
from live.setup.pattern.outcome import (
    Comparison,
    ExperimentContext,
    ExperimentOutcome,
    ResultTable,
    figure,
    save_figure,
    shown,
    write_outcome,
)
from tests.paper.outcomes import compared, read_outcome, verdict

TABLE = ResultTable("numbers", ("name", "length px"), (("a", 1.5), ("b, c", float("nan")), ("d", 3)))
OUTCOME = ExperimentOutcome(
    "name", "Title", "text ![x](p.png)", (TABLE,), (), (Comparison("s", "the paper", "better"),), 2.5
)


def test_csv_keeps_every_digit() -> None:
    table = ResultTable("t", ("x px",), ((0.1 + 0.2,), (1e-17,)))
    rows = list(csv.reader(io.StringIO(table.csv())))
    assert rows[0] == ["x px"]
    assert [float(row[0]) for row in rows[1:]] == [0.1 + 0.2, 1e-17]


def test_markdown_is_a_table() -> None:
    lines = TABLE.markdown().splitlines()
    assert lines[0] == "| name | length px |"
    assert lines[2] == "| a | 1.50 |"
    assert lines[3] == "| b, c | - |"
    assert len({line.count("|") for line in lines}) == 1


@given(st.floats(1e-12, 1e12))
def test_shown_keeps_three_digits(value: float) -> None:
    assert float(shown(value)) == pytest.approx(value, rel=0.006)


def test_what_is_not_a_number_is_shown_as_it_is() -> None:
    assert (shown("x"), shown(7), shown(0.0), shown(float("nan"))) == ("x", "7", "0", "-")


@pytest.mark.parametrize(
    ("ours", "word"), [(0.5, "better"), (0.95, "equal"), (1.05, "equal"), (1.2, "worse")]
)
def test_verdicts(ours: float, word: str) -> None:
    assert compared(ours, 1.0) == word
    found = verdict("noise", "px", ours, 1.0, "a peer")
    assert found.word == word
    assert shown(ours) in found.subject


def test_an_outcome_survives_the_disk(tmp_path: Path) -> None:
    write_outcome(OUTCOME, tmp_path, "key")
    again = read_outcome("name", tmp_path, "key")
    assert again is not None
    assert (again.text, again.verdicts, again.seconds) == (OUTCOME.text, OUTCOME.verdicts, 2.5)
    assert again.tables[0].rows[0] == ("a", 1.5)
    assert math.isnan(again.tables[0].rows[1][1])
    assert (tmp_path / "numbers.csv").read_text(encoding="utf-8") == TABLE.csv()


def test_what_does_not_serve_is_not_taken(tmp_path: Path) -> None:
    assert read_outcome("name", tmp_path, "key") is None
    write_outcome(OUTCOME, tmp_path, "key")
    assert read_outcome("name", tmp_path, "another key") is None
    with_figure = ExperimentOutcome("name", "t", "", figures=("gone.png",))
    write_outcome(with_figure, tmp_path, "key")
    assert read_outcome("name", tmp_path, "key") is None


@pytest.mark.parametrize("text", ["", "{", "[]", '{"format": 1, "key": "key", "outcome": {}}'])
def test_a_damaged_file_is_named(tmp_path: Path, text: str) -> None:
    (tmp_path / "name.json").write_text(text, encoding="utf-8")
    with pytest.raises(DataError, match=r"name\.json"):
        read_outcome("name", tmp_path, "key")


def test_without_matplotlib_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(ConfigError, match=r"pip install phasedic\[plots\]"):
        figure()


def test_a_figure_is_written(tmp_path: Path) -> None:
    drawn = figure(2, 1)
    drawn.subplots().plot([0, 1], [1, 0])
    assert save_figure(ExperimentContext(tmp_path), "a.png", drawn) == "a.png"
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"


def test_steps_tick(tmp_path: Path) -> None:
    shares: list[float] = []
    assert list(ExperimentContext(tmp_path, tick=shares.append).steps("abcd")) == list("abcd")
    assert shares == [0.25, 0.5, 0.75, 1.0]
