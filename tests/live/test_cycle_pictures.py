"""Bursts at valley and peak of some cycles, of a simulated cyclic test: which are recorded, and their replay."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquire.errors import ConfigError
from acquire.record_mode import RecordMode
from acquire.session import Session
from live.cli import main
from live.config.loading import load_config
from live.results.run_folder import open_run
from tests.live.test_cyclic import SECTION, rows_of
from tests.live.test_end_to_end import live_run, strains

N, FPS, HOLD_S = 12, 16, 2
SIM = (
    f"sim:uniform?programme=cyclic&lockstep=yes&hz=1&r=0.1&n={N}&fps={FPS}"
    "&width=224&height=192&bits=12&noise=0.5"
)  # fmt: skip


def test_the_spacing_grows_with_the_number() -> None:
    kept = [n for n in range(1, 400) if RecordMode.parse("cycles=3").keeps_cycle(n)]
    assert kept == [1, 2, 3, 10, 20, 30, 100, 200, 300]
    kept = [n for n in range(1, 2001) if RecordMode.parse("cycles=10").keeps_cycle(n)]
    assert kept == [*range(1, 10), *range(10, 100, 10), *range(100, 1000, 100), 1000, 2000]
    with pytest.raises(ConfigError, match="'cycles=K' with K from 1"):
        load_config(None, {"record.mode": "cycles=0"})
    assert load_config(None, {"record.mode": "cycles=7"}).record.mode == "cycles=7"


def test_valleys_and_peaks_are_recorded_and_replayed(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    outcome = live_run(folder, SIM, **SECTION, **{"record.mode": "cycles=2"})
    counts, rows = outcome.run_state.frame_counts, rows_of(folder)
    assert outcome.exit_code == 0 and len(rows["cycle"]) == N and counts.adds_up
    with Session.open(folder / "session.h5") as session:
        assert session.mode == RecordMode("bursts") and len(session) == 0
        times = session.burst_column("monotonic_s") - session.start_monotonic
        frames, loads = session.burst_column("n").tolist(), session.load_curve()[1]
    assert counts.recorded == sum(frames) and counts.thinned == counts.grabbed - sum(frames)
    assert counts.load_samples == len(loads) > 100 * N
    # The reference, the hold at the valley before the first cycle, cycles 1, 2 and 10, the last one, and the end.
    assert times[1] < HOLD_S + 0.1 and times[-1] > HOLD_S + N
    begun = rows["time_s"][[0, 1, 9, 11]]
    wanted = np.sort([*begun[1:], *(begun + 0.5)])
    assert times[2:-1] == pytest.approx(wanted, abs=0.6 / FPS)
    with open_run(folder) as run:
        measured = dict(zip(run.strain.time_s.tolist(), run.force.tolist(), strict=True))
    peaks = [measured[t] for t in times.tolist() if np.abs(rows["time_s"] + 0.5 - t).min() < 0.1]
    assert peaks == pytest.approx(rows["peak_N"][[0, 1, 9, 11]], rel=0.02)
    again = tmp_path / "again"
    assert main(["replay", str(folder), "--as-measured", "--out", str(again), "--no-view", "--no-rrd"]) == 0
    live, back = strains(folder), strains(again)
    rows_again = np.searchsorted(live["time_s"], back["time_s"])
    assert len(rows_again) == len(times) - 1
    # The solution begins at that of the burst before, which is another one here.
    for name in ("exx", "eyy", "exy"):
        off = np.abs(back[name] - live[name][rows_again])
        assert np.nanmax(off / back[f"sigma_{name}"]) < 0.1
    np.testing.assert_array_equal(back["force_N"], live["force_N"][rows_again])
