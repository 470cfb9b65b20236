"""A burst that raises costs that burst, live and in a replay: counted, named, with its traceback in the folder."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from acquire.events import EventKind
from acquire.frame import Burst
from acquire.load_cell.load_log import LoadLog
from acquire.session import Session
from live.cli import main
from live.pipeline.measure import NewReference, Tracker, measure
from live.pipeline.run_state import RunState
from live.results.folder import LOG, MAX_TRACEBACKS, BurstFailures
from tests.live.made_up import make_measurement

SIM = "sim:uniform?lockstep=yes&seconds=2&fps=10&width=160&height=128&bits=12"
WORDS = ["--zoi", "48", "--step", "24", "--burst", "2", "--no-view", "--no-rrd", "--roi", "all"]


class FailingTracker:
    """Gives a made-up field, but for some bursts."""

    def __init__(self, *bad: int) -> None:
        self.bad, self.renewed = bad, 0

    def measure(self, burst: Burst) -> Any:
        if burst.first_index in self.bad:
            raise ZeroDivisionError("a made-up defect")
        return make_measurement(burst.first_index).field

    def renew_on_demand(self, burst: Burst) -> None:
        raise KeyError("no reference")


def test_a_burst_with_a_blank_picture_is_not_measured(tmp_path: Path) -> None:
    state, work = RunState.new(0.5), bursts(3)
    tracker: Any = FailingTracker()
    given = [work[0], replace(work[1], blank=2), NewReference(replace(work[1], blank=2)), work[2]]
    found = list(measure(given, tracker, LoadLog(0.5), on_failure=BurstFailures(state, tmp_path)))
    assert [m.number for m in found] == [0, 2] and state.frame_counts.failed == work[1].n
    texts = [event.text for event in state.event_log.events("error")]
    assert len(texts) == 2 and all("DataError: picture 2 of" in text for text in texts)


def bursts(n: int) -> list[Burst]:
    return [make_measurement(k).burst for k in range(n)]


def test_the_others_are_measured_and_the_frames_counted_once(tmp_path: Path) -> None:
    state, work = RunState.new(0.5), bursts(4)
    first = [burst.first_index for burst in work]
    tracker: Any = FailingTracker(first[1], first[3])
    failures = BurstFailures(state, tmp_path)
    given = [*work[:2], NewReference(work[0]), *work[2:]]
    found = list(measure(given, tracker, LoadLog(0.5), on_failure=failures))
    assert [m.number for m in found] == [0, 2] and failures.count == 3
    n = work[0].n
    state.frame_counts.add(grabbed=4 * n, measured=2 * n)
    assert state.frame_counts.failed == 2 * n and state.frame_counts.adds_up and state.frame_counts.loss
    assert f" / failed {2 * n} / " in state.frame_counts.line()
    events = state.event_log.events("error")
    assert [event.text.partition(" (")[0] for event in events] == ["burst 2", "the new reference", "burst 4"]
    assert [event.data["first"] for event in events] == [first[1], first[0], first[3]]
    assert all(event.kind is EventKind.MEASUREMENT for event in events)
    log = (tmp_path / LOG).read_text("utf-8")
    assert log.count("Traceback") == 3 and "ZeroDivisionError: a made-up defect" in log


def test_without_a_place_for_failures_the_error_is_raised() -> None:
    tracker: Any = FailingTracker(bursts(1)[0].first_index)
    with pytest.raises(ZeroDivisionError):
        list(measure(bursts(1), tracker, LoadLog(0.5)))


def test_the_log_has_a_limit_and_a_folder_that_is_gone_is_no_matter(tmp_path: Path) -> None:
    state = RunState.new(0.5)
    failures = BurstFailures(state, tmp_path)
    for number in range(MAX_TRACEBACKS + 5):
        failures(number, bursts(1)[0], ValueError("x"))
    assert (tmp_path / LOG).read_text("utf-8").count("ValueError: x") == MAX_TRACEBACKS
    assert state.event_log.count("error") == MAX_TRACEBACKS + 5
    BurstFailures(state, tmp_path / "gone")(0, bursts(1)[0], ValueError("x"))


def failing(monkeypatch: pytest.MonkeyPatch, first: int = 6) -> None:
    """Measuring the burst that begins with frame ``first`` raises."""
    measured = Tracker.measure

    def broken(tracker: Tracker, burst: Burst) -> Any:
        if burst.first_index == first:
            raise ValueError("`x` must be strictly increasing sequence.")
        return measured(tracker, burst)

    monkeypatch.setattr(Tracker, "measure", broken)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, int]]:
    folder = tmp_path_factory.mktemp("run") / "run"
    with pytest.MonkeyPatch.context() as patch:
        failing(patch)
        run = ["run", "--camera", SIM, "--load", "sim:", "--reference-burst", "2", *WORDS]
        code = main([*run, "--out", str(folder)])
    yield folder, code


def test_a_live_test_goes_on(recorded: tuple[Path, int]) -> None:
    folder, code = recorded
    with Session.open(folder / "session.h5") as session:
        counts = session.frame_counts
        told = [event.text for event in session.events() if event.level == "error"]
    assert code == 5 and counts is not None
    assert counts["failed"] == 2 and counts["skipped"] == 0
    assert counts["measured"] == counts["grabbed"] - counts["reference"] - counts["left_out"] - 2
    assert len(told) == 1 and told[0].startswith("burst 3 (frames ")
    assert "strictly increasing" in (folder / LOG).read_text("utf-8")


def test_as_measured_gives_the_same_bits_and_a_replay_of_all_one_burst_more(
    recorded: tuple[Path, int],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    folder, _ = recorded
    assert main(["replay", str(folder), *WORDS, "--out", str(tmp_path / "all")]) == 0
    assert "could not be measured" not in capsys.readouterr().out
    failing(monkeypatch)
    assert (
        main(["replay", str(folder), "--as-measured", "--no-view", "--no-rrd", "--out", str(tmp_path / "as")])
        == 5
    )
    said = capsys.readouterr().out
    assert "1 burst could not be measured; " in said and LOG in said
    live, same, more = (eyy(one) for one in (folder, tmp_path / "as", tmp_path / "all"))
    np.testing.assert_array_equal(live, same)
    assert len(more) == len(live) + 1


def eyy(folder: Path) -> Any:
    with h5py.File(folder / "strain.h5") as file:
        return file["entry/strain/eyy"][()]
