"""A cyclic test of a simulated specimen whose stiffness falls: run, replay, report, alarms, and what is recorded."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from acquire.addresses import parse_address
from acquire.errors import ConfigError
from acquire.events import Event
from acquire.record_mode import RecordMode
from acquire.session import Session
from live.cli import main
from live.config.loading import from_dict, load_config
from live.config.sections import AlarmConfig
from live.pipeline.measurement import Measurement
from live.pipeline.run_state import ActiveAlarms
from live.pipeline.snapshot import ChannelValues
from live.results import Results, ResultsInfo
from live.results.finished.cycles import creep_figures
from live.results.finished.finished_test import FinishedTest
from live.results.report.report import ReportRequest, make_report
from live.results.run_folder import open_run
from live.run.alarms import Alarm, AlarmWatch, check_alarms
from live.run.live_run import LiveRun
from live.run.outcome import Outcome
from live.setup.devices import at_rest
from live.ui.terminal.screen import TerminalScreen
from live.ui.web.run_result import run_result
from tests.live.made_run import CONFIG, UTC_START
from tests.live.made_up import CAMERA, START, make_grid, make_measurement
from tests.live.test_end_to_end import assert_replay_is_bit_equal, live_run, replay, strains

N, FALL, E = 8, 0.1, 70e9
SIM = (
    f"sim:uniform?programme=cyclic&lockstep=yes&hz=1&r=0.1&n={N}&fall={FALL}"
    "&fps=16&width=224&height=192&bits=12&noise=0.5"
)
MODULI = E * (1 - FALL * np.arange(N) / (N - 1))
SECTION = {"specimen.area_mm2": 40.0, "specimen.axis": "y", "measure.burst": 1}


def rows_of(folder: Path) -> dict[str, np.ndarray]:
    with (folder / "cycles.csv").open() as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0] if name != "reason"}


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Outcome, list[dict[str, float]]]:
    folder, seen = tmp_path_factory.mktemp("cyclic") / "run", list[dict[str, float]]()

    def note(live: LiveRun, measurement: Measurement) -> None:
        seen.append(dict(live.run_state.cycles.channels))

    return folder, live_run(folder, SIM, note, **SECTION), seen


def test_the_cycles_are_those_of_the_specimen(finished: tuple[Path, Outcome, Any]) -> None:
    folder, *_ = finished
    rows = rows_of(folder)
    assert rows["cycle"].tolist() == [*range(1, N + 1)]
    assert rows["bursts"].min() >= 15
    assert rows["time_s"] == pytest.approx(2 + np.arange(N), abs=0.02)
    off = (rows["secant_modulus_Pa"] - MODULI) / rows["sigma_secant_modulus_Pa"]
    assert np.abs(off).max() < 3.5 and np.abs(off[[0, -1]]).max() < 2.5
    assert rows["sigma_secant_modulus_Pa"].max() < 0.03 * E
    assert rows["peak_N"] == pytest.approx(40e-6 * E * 1e-3, rel=2e-3)
    strain = 0.9e-3 * E / MODULI
    assert np.abs(rows["range_strain"] - strain).max() < 3.5 * rows["sigma_range_strain"].max()
    assert np.abs(rows["phase_rad"]).max() < 4 * rows["sigma_phase_rad"].max()


def test_figures_and_summary_have_the_change(finished: tuple[Path, Outcome, Any]) -> None:
    folder, outcome, _ = finished
    figures = {one["name"]: one for one in json.loads((folder / "figures.json").read_text())["figures"]}
    assert figures["cycles"]["value"] == N
    change = figures["change of the secant modulus"]
    assert change["low"] < -FALL < change["high"] and change["high"] - change["low"] < 0.05
    (line,) = outcome.test.cycles.lines()
    assert line.startswith(f"{N} cycles of 1 s; secant modulus ") and f"in cycle {N}" in line
    shown = run_result(outcome.run_state, outcome.test, folder, "")["figures"]
    assert [str(one["name"]) for one in shown if "cycle" in str(one["name"])] == [
        "cycles", "secant modulus of cycle 1", f"secant modulus of cycle {N}",
    ]  # fmt: skip


def test_channels_follow_while_the_test_goes_on(finished: tuple[Path, Outcome, Any]) -> None:
    folder, _, seen = finished
    rows, numbers = rows_of(folder), [one["cycle"] for one in seen]
    assert math.isnan(numbers[0])
    known = [one for one in seen if not math.isnan(one["cycle"])]
    assert {one["cycle"] for one in known} >= {*range(4, N)}
    for one in known:
        k = int(one["cycle"]) - 1
        assert one["secant_modulus"] == pytest.approx(rows["secant_modulus_Pa"][k], rel=0.01)
        assert one["peak_N"] == pytest.approx(rows["peak_N"][k], rel=1e-3)


def test_a_replay_counts_the_same(finished: tuple[Path, Outcome, Any], tmp_path: Path) -> None:
    folder, _, _ = finished
    again = tmp_path / "again"
    assert_replay_is_bit_equal(folder, again)
    assert (again / "cycles.csv").read_text() == (folder / "cycles.csv").read_text()
    (folder / "figures.json").rename(tmp_path / "figures.json")
    (folder / "cycles.csv").rename(tmp_path / "cycles.csv")
    assert main(["report", str(folder)]) == 0  # as of a run that was killed
    page, rows, made = (folder / "report.html").read_text(), rows_of(tmp_path), rows_of(folder)
    assert "Secant modulus of the cycles" in page and f"{N} cycles of" in page
    for name in ("secant_modulus_Pa", "peak_N", "time_s"):
        assert made[name] == pytest.approx(rows[name], rel=1e-4)


def test_a_pull_has_no_cycles(tmp_path: Path) -> None:
    outcome = live_run(
        tmp_path / "run", "sim:uniform?lockstep=yes&seconds=4&fps=10&width=160&height=128", **SECTION
    )
    assert not outcome.test.cycles.any and not (tmp_path / "run" / "cycles.csv").exists()
    with open_run(tmp_path / "run") as run:
        assert "cycles" not in json.loads((run.path / "figures.json").read_text())


@pytest.mark.parametrize(("of_cycle", "number"), [(1, N), (4, N), (N + 1, 0)])
def test_a_limit_over_the_value_of_a_cycle(
    finished: tuple[Path, Outcome, Any], of_cycle: int, number: int
) -> None:
    folder, outcome, _ = finished
    modulus = rows_of(folder)["secant_modulus_Pa"]
    config, events = AlarmConfig(channel="secant_modulus", below=0.99, of_cycle=of_cycle), list[Event]()
    state = outcome.run_state
    unjudged: Any = SimpleNamespace(snapshot=lambda t, step: replace(state.snapshot(t, step), figures={}))
    test: Any = SimpleNamespace(
        health=SimpleNamespace(channels=lambda t: {}), alarms=ActiveAlarms(), event_log=events.append
    )
    AlarmWatch([Alarm(config)], ChannelValues(0.0, unjudged), test).idle()
    if not number:
        return
    (event,) = events
    share = modulus[number - 1] / modulus[of_cycle - 1]
    assert event.data["value"] == pytest.approx(share, rel=5e-3)
    assert str(event.text).endswith(f"% of that in cycle {of_cycle}, limit 99.0%")


def test_of_cycle_is_for_figures_of_cycles() -> None:
    with pytest.raises(ConfigError, match="alarm 1: of_cycle is for cycle, peak_strain"):
        from_dict({"alarm": [{"channel": "axial", "above": 1.0, "of_cycle": 1}]}, {}, "here")
    force = {"address": "sim:"}
    absolute = from_dict({"load": force, "alarm": [{"channel": "secant_modulus", "below": 1e9}]}, {}, "here")
    with pytest.raises(ConfigError, match="it needs the section"):
        check_alarms(absolute)
    share = {"channel": "secant_modulus", "below": 0.9, "of_cycle": 1}
    check_alarms(from_dict({"load": force, "alarm": [share]}, {}, ""))


def test_a_look_at_the_rig_begins_no_cycles() -> None:
    from hw_mocks.specimen import specimen_from

    specimen = specimen_from(parse_address(at_rest(SIM)))
    assert specimen.duration_s == 3600 and not specimen.force(np.arange(0, 100, 0.1)).any()


def test_a_held_force_has_its_creep_in_figures_and_report(tmp_path: Path) -> None:
    rng, area = np.random.default_rng(0), 20e-6
    info = ResultsInfo(START, UTC_START.isoformat(), CONFIG, {}, {}, CAMERA, "small", area)
    with Results(tmp_path, make_grid(), info) as results:
        for k in range(600):
            held = max(0.1 * k - 5, 0.0)
            stress = 1e8 * min(0.1 * k / 5, 1)
            strain = stress / 70e9 + 1e-4 * np.log1p(held) + rng.normal(0, 3e-6)
            results.add(make_measurement(k, strain, force=stress * area + rng.normal(0, 0.5)))
    with open_run(tmp_path) as run:
        test = FinishedTest.of_folder(run)
        assert test.creep is not None
        figures = {name: figure for name, figure, _ in creep_figures(test.creep)}
        half, end = 27.5, 55.0
        true = 1e-4 * np.log((end + 0.9) / (half + 0.9)) / (end - half)
        assert figures["creep rate"].low < true < figures["creep rate"].high
        assert figures["time to a strain of 0.0018"].value == pytest.approx(40.3, abs=1)
        (line,) = test.longer
        assert line.startswith("100 MPa held from 4.") and "µm/m/s" in line and "µm/m after" in line
        html = make_report(run, ReportRequest(), TerminalScreen(quiet=True)).html
    part = html.partition("<h2>Creep</h2>")[2].partition("</section>")[0]
    assert "<polyline" in part or "<path" in part
    assert "mean strain rate" in part and "power of 10" in part


def test_the_spacing_grows_with_the_number() -> None:
    kept = [n for n in range(1, 400) if RecordMode.parse("cycles=3").keeps_cycle(n)]
    assert kept == [1, 2, 3, 10, 20, 30, 100, 200, 300]
    kept = [n for n in range(1, 2001) if RecordMode.parse("cycles=10").keeps_cycle(n)]
    assert kept == [*range(1, 10), *range(10, 100, 10), *range(100, 1000, 100), 1000, 2000]
    with pytest.raises(ConfigError, match="'cycles=K' with K from 1"):
        load_config(None, {"record.mode": "cycles=0"})
    assert load_config(None, {"record.mode": "cycles=7"}).record.mode == "cycles=7"


def test_valleys_and_peaks_are_recorded_and_replayed(tmp_path: Path) -> None:
    folder, n, hold_s, fps = tmp_path / "run", 12, 2, 16
    camera = SIM.replace(f"n={N}&fall={FALL}", f"n={n}")
    outcome = live_run(folder, camera, **SECTION, **{"record.mode": "cycles=2"})
    counts, rows = outcome.run_state.frame_counts, rows_of(folder)
    assert outcome.exit_code == 0 and len(rows["cycle"]) == n and counts.adds_up
    with Session.open(folder / "session.h5") as session:
        assert session.mode == RecordMode("bursts") and len(session) == 0
        times = session.burst_column("monotonic_s") - session.start_monotonic
        frames, loads = session.burst_column("n").tolist(), session.load_curve()[1]
    assert counts.recorded == sum(frames) and counts.thinned == counts.grabbed - sum(frames)
    assert counts.load_samples == len(loads) > 100 * n
    # The reference, the hold at the valley before the first cycle, cycles 1, 2 and 10, the last one, and the end.
    assert times[1] < hold_s + 0.1 and times[-1] > hold_s + n
    begun = rows["time_s"][[0, 1, 9, 11]]
    wanted = np.sort([*begun[1:], *(begun + 0.5)])
    assert times[2:-1] == pytest.approx(wanted, abs=0.6 / fps)
    with open_run(folder) as run:
        measured = dict(zip(run.strain.time_s.tolist(), run.force.tolist(), strict=True))
    peaks = [measured[t] for t in times.tolist() if np.abs(rows["time_s"] + 0.5 - t).min() < 0.1]
    assert peaks == pytest.approx(rows["peak_N"][[0, 1, 9, 11]], rel=0.02)
    again = tmp_path / "again"
    assert replay(folder, again, "--as-measured") == 0
    live, back = strains(folder), strains(again)
    rows_again = np.searchsorted(live["time_s"], back["time_s"])
    assert len(rows_again) == len(times) - 1
    # The solution begins at that of the burst before, which is another one here.
    for name in ("exx", "eyy", "exy"):
        off = np.abs(back[name] - live[name][rows_again])
        assert np.nanmax(off / back[f"sigma_{name}"]) < 0.1
    np.testing.assert_array_equal(back["force_N"], live["force_N"][rows_again])
