"""``figures.json``: every figure in SI units with its interval or its reason, counts, checks, exit code."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquire.errors import DataError
from acquire.text import Message
from analysis.evaluate import Figure, GaugeValue
from live.cli import main
from live.config.loading import load_config
from live.config.sections import SpecimenConfig
from live.pipeline.run_state import RunState
from live.results.finished.figures_file import COUNTS, FILE, FiguresFile, finished, finished_in, stored_lag
from live.results.finished.findings import findings
from live.results.finished.finished_test import FinishedTest
from live.results.run_folder import open_run
from tests.live.made_run import CONFIG, GAUGES, PULLED, make_run
from tests.live.results.finished.test_findings import FLAT
from tests.live.results.finished.test_findings import test_of as made_test

WITH_GAUGES = {**CONFIG, "gauges": GAUGES}
NAMES = (
    "E", "nu", "Rp0.1", "Rp0.2", "Rp1", "ReH", "ReL", "Rm", "Ag", "Agt", "A", "At", "r", "n", "lag",
    "exx at the end", "eyy at the end", "exy at the end",
)  # fmt: skip


def written(test: FinishedTest, folder: Path, exit_code: int = 0, **counts: int) -> dict[str, Any]:
    FiguresFile.of(test, counts, exit_code).write(folder)
    found: dict[str, Any] = json.loads((folder / FILE).read_text(encoding="utf-8"))
    return found


def by_name(content: dict[str, Any]) -> dict[str, dict[str, Any]]:
    return {one["name"]: one for one in content["figures"]}


def test_figures_are_in_si_units_with_their_intervals(tmp_path: Path) -> None:
    test = made_test()
    content = written(test, tmp_path, 5, grabbed=8, measured=6, lost=2)
    assert (content["format"], content["version"], content["exit_code"]) == ("phasedic-figures", 1, 5)
    assert content["counts"] == dict.fromkeys(COUNTS) | {"grabbed": 8, "measured": 6, "lost": 2}
    assert content["checks"] == [
        {"name": one.name, "outcome": one.outcome, "text": one.text} for one in findings(test)
    ]
    found = by_name(content)
    assert set(NAMES) <= set(found)
    for name, key in (("E", "E"), ("nu", "nu"), ("Rp0.2", "Rp02"), ("Rm", "Rm"), ("Rp1", "Rp1")):
        figure: Figure = getattr(test.figures, key)
        assert figure.known
        assert [found[name][part] for part in ("value", "low", "high")] == [
            figure.value,
            figure.low,
            figure.high if math.isfinite(figure.high) else None,
        ]
        assert found[name]["confidence"] == 0.95 and found[name]["reason"] is None
    assert found["E"]["value"] == pytest.approx(70e9, rel=0.01) and found["E"]["unit"] == "Pa"
    assert found["Rp0.2"]["value"] == pytest.approx(212e6, rel=0.01) and found["Rp0.2"]["unit"] == "Pa"
    assert (found["Rm"]["qualifier"], found["Rm"]["high"]) == ("at least", None)
    assert found["Rm"]["remark"] == "the test ended before the stress fell" and found["E"]["remark"] is None
    assert found["Agt"]["unit"] == "1" and "before the stress fell" in found["Agt"]["reason"]
    assert (found["lag"]["unit"], found["nu"]["unit"]) == ("s", "1")


def test_what_is_not_known_is_null_with_its_reason(tmp_path: Path) -> None:
    content = written(made_test(force=np.full(140, math.nan)), tmp_path)
    for name in NAMES[:15]:
        one = by_name(content)[name]
        assert [one[part] for part in ("value", "low", "high", "confidence")] == [None] * 4
        assert one["reason"]


def test_without_a_section_stresses_are_refused_and_forces_are_there(tmp_path: Path) -> None:
    found = by_name(written(made_test(specimen=SpecimenConfig(axis="y")), tmp_path))
    assert "section" in found["E"]["reason"] and "--section" in found["Rm"]["reason"]
    assert found["EA"]["unit"] == "N" and found["EA"]["value"] == pytest.approx(70e9 * 20e-6, rel=0.01)
    assert found["Fm"]["unit"] == "N"


def test_strains_at_the_end_are_those_of_the_last_burst(tmp_path: Path) -> None:
    test = made_test()
    last = dict(test.at_end)
    assert last["eyy"].value == pytest.approx(0.02, abs=2e-5) and last["eyy"].sigma == pytest.approx(2e-6)
    end = {**last, "exx": GaugeValue(math.nan, math.nan, "no ZOI"), "gauge a": GaugeValue(1e-3, 1e-5)}
    found = by_name(written(replace(test, at_end=end), tmp_path))
    assert found["eyy at the end"]["high"] - found["eyy at the end"]["value"] == pytest.approx(
        1.96 * 2e-6, rel=1e-3
    )
    assert found["exx at the end"]["value"] is None and found["exx at the end"]["reason"] == "no ZOI"
    assert found["gauge a at the end"]["value"] == 1e-3


def test_a_film_qualifies_what_is_read_from_strains(tmp_path: Path) -> None:
    """The interval of E holds the limit already, by the evaluation."""
    plain = by_name(written(made_test(), tmp_path))
    (tmp_path / FILE).unlink()
    test = made_test(specimen=replace(FLAT, film_error_percent=10.0))
    film = by_name(written(test, tmp_path))
    qualified = {name for name, one in film.items() if one["qualifier"] == "film"}
    assert {"E", "nu", "Rp0.2", "eyy at the end"} <= qualified and not {"Rm", "lag"} & qualified
    end, before = film["eyy at the end"], plain["eyy at the end"]
    assert end["value"] == before["value"]
    assert end["low"] == pytest.approx(before["low"] - 0.002, abs=1e-5)
    assert end["high"] == pytest.approx(before["high"] + 0.002, abs=1e-5)
    assert film["E"]["high"] - film["E"]["low"] == pytest.approx(2 * 1.96 * 0.1 / 3**0.5 * 70e9, rel=0.03)
    assert {name for name, one in plain.items() if one["qualifier"]} == {"Rm"}


def test_it_is_never_overwritten(tmp_path: Path) -> None:
    (tmp_path / FILE).write_text("mine", encoding="utf-8")
    state = RunState.new(0.5)
    finished(tmp_path, load_config(None, {}), state, 0, math.nan)
    assert (tmp_path / FILE).read_text(encoding="utf-8") == "mine"
    (warning,) = state.event_log.events("warning")
    assert FILE in warning.text


def test_a_run_without_a_burst_has_the_file_too(tmp_path: Path) -> None:
    finished(tmp_path, load_config(None, {}), RunState.new(0.5), 5, math.nan)
    content = json.loads((tmp_path / FILE).read_text(encoding="utf-8"))
    assert content["exit_code"] == 5 and by_name(content)["E"]["value"] is None


def test_the_report_of_a_run_that_was_killed_writes_it(tmp_path: Path) -> None:
    folder = make_run(tmp_path / "run", PULLED)
    assert main(["report", str(folder)]) == 0
    with open_run(folder) as run:
        test = finished_in(run)
    found = by_name(json.loads((folder / FILE).read_text(encoding="utf-8")))
    assert found["E"]["value"] == test.figures.E.value > 1e10
    before = (folder / FILE).read_bytes()
    assert main(["report", str(folder)]) == 0
    assert (folder / FILE).read_bytes() == before


def test_what_a_replay_said_beside_the_figures_stands_in_its_report(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = make_run(tmp_path / "run", PULLED, session=False)
    remarks = (Message("joined of {chunks} chunks", 3), "forces.csv: <two> columns")
    FiguresFile.of(made_test(), {}, 0, remarks=remarks).write(folder)
    monkeypatch.setenv("LC_ALL", "de_DE.UTF-8")
    assert main(["report", str(folder)]) == 0
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "<p>aus 3 Stücken zusammengefügt</p>" in page
    assert "<p>forces.csv: &lt;two&gt; columns</p>" in page


def test_a_report_without_a_recording_has_the_lag_that_the_replay_found(tmp_path: Path) -> None:
    folder = make_run(tmp_path / "run", PULLED, session=False, config=WITH_GAUGES)
    test = replace(made_test(), lag=Figure(0.3, 0.28, 0.32))
    written(test, folder)
    with open_run(folder) as run:
        assert finished_in(run).lag == Figure(0.3, 0.28, 0.32)
    (folder / FILE).write_text('{"figures": []}', encoding="utf-8")
    with pytest.raises(DataError, match=FILE):
        stored_lag(folder)
