"""Front and back of one test put together: strains, E, and the channels of a running test."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from datetime import timedelta
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from acquire.errors import DataError
from analysis.evaluate import Course, Curve, TensileOptions, TwoSides, evaluate_test
from live.cli import main
from live.pipeline.measurement import AXIAL
from live.pipeline.run_state import RunState
from live.results.figures import tensile_options
from live.results.run_folder import open_run
from live.results.sides import JointChannels, SideOfTest, SidesOfTest, longest_gap, newest, shift_s
from tests.live import made_run
from tests.live.made_run import CONFIG, GAUGES, PULLED, make_run, noisy
from tests.live.made_up import START, make_measurement

BENT, TOWARDS = 0.05, -0.08  # bending and out-of-plane motion of the front, as shares of the strain
LATER_S = 0.73  # the back was started so much later


def runs(
    folder: Path, monkeypatch: pytest.MonkeyPatch, config: Mapping[str, Any] = CONFIG
) -> tuple[Path, Path]:
    """Two runs of one test; the times of the back count from its own start."""
    wrong = BENT + TOWARDS
    front = make_run(folder / "front", config=config, field_of=lambda k, e: noisy(k, e * (1 + wrong)))
    monkeypatch.setattr(made_run, "START", made_run.START + LATER_S)
    back = make_run(folder / "back", config=config, field_of=lambda k, e: noisy(k + 1000, e * (1 - wrong)))
    return front, back


def test_between_instants_by_lines_and_nothing_across_gaps() -> None:
    course = Course(
        np.array([0.0, 1.0, 2.0, 9.0]), np.array([0.0, 2.0, 4.0, 4.0]), np.array([3.0, 4.0, 0.0, 0.0])
    )
    found = course.at(np.array([-0.1, 0.0, 0.5, 2.0, 5.0, 9.1]), 2.0)
    np.testing.assert_allclose(found.value, [np.nan, 0, 1, np.nan, np.nan, np.nan])
    assert found.sigma[2] == pytest.approx(2.5)
    assert np.isnan(Course(np.zeros(1), np.zeros(1), np.zeros(1)).at(np.zeros(3), 1.0).value).all()


def test_a_gap_is_five_times_the_usual_distance_of_instants() -> None:
    assert longest_gap(np.array([0.0, 0.2, 0.4, 0.6, 9.0])) == pytest.approx(1.0)
    assert longest_gap(np.zeros(1)) == 0.0


def test_the_curve_of_the_mean_has_means_and_the_stress_of_the_front() -> None:
    """The errors of two lenses are independent: half of their root sum of squares is in the mean."""
    t, ones = np.arange(60) / 10, np.ones(60)

    def side(strain: float, lens: float, stress: float) -> SideOfTest:
        curve = Curve(t, strain * t, stress * t, -strain * t / 4, narrowing=-strain * t, lens=lens * ones)
        return SideOfTest({}, curve, stress * t)

    front, back = side(1e-3, 3e-5, 7e7), side(3e-3, 4e-5, 9e7)
    sides = SidesOfTest.of(front, back, TensileOptions())
    assert [one.Rm.value for one in sides.figures.values()] == pytest.approx([7e7 * t[-1]] * 3)
    found = sides.curve
    assert found.transverse is not None and found.narrowing is not None and found.lens is not None
    np.testing.assert_allclose(found.strain, 2e-3 * t)
    np.testing.assert_allclose(found.stress, 7e7 * t)
    np.testing.assert_allclose(found.transverse, -5e-4 * t)
    np.testing.assert_allclose(found.narrowing, -2e-3 * t)
    np.testing.assert_allclose(found.lens, 2.5e-5)


def test_the_newest_values_are_those_of_the_newest_instant_of_both(monkeypatch: pytest.MonkeyPatch) -> None:
    def recent(state: Any) -> dict[str, Course]:
        t = np.arange(state.last + 1.0)
        return {AXIAL: Course(t, 1e-3 * t * state.last, np.zeros(state.last + 1))}

    monkeypatch.setattr("live.results.sides._recent", recent)
    healthy, live = SimpleNamespace(camera_failed=False), SimpleNamespace(known=True)
    made = SimpleNamespace(figure=lambda _: live)
    front, back = (
        cast(RunState, SimpleNamespace(last=k, health=healthy, snapshot=lambda _: made)) for k in (6, 4)
    )
    mean, bending, _, at = newest({"front": front, "back": back})[AXIAL]
    assert at == 4.0
    assert mean == pytest.approx(4e-3 * (6 + 4) / 2) and bending == pytest.approx(4e-3 * (6 - 4) / 2)


def test_mean_bending_and_their_sigma() -> None:
    t = np.arange(3.0)
    front, back = (
        Course(t, np.full(3, value), np.full(3, sigma)) for value, sigma in ((110.0, 3), (90.0, 4))
    )
    both = TwoSides.of(front, back, 2.0)
    assert both.mean.tolist() == [100, 100, 100]
    assert both.bending.tolist() == [10, 10, 10]
    assert both.sigma.tolist() == pytest.approx([2.5, 2.5, 2.5])
    exact = Course(t, t, np.zeros(3))
    # Both see cos(0.1 degree): short by 1.5 um/m at most.
    assert TwoSides.of(exact, exact, 2.0).sigma == pytest.approx(1.523e-6 / math.sqrt(3), rel=1e-3)


def test_the_mean_has_neither_bending_nor_motion(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    config = {**CONFIG, "gauges": GAUGES}
    with open_run(
        make_run(tmp_path / "truth", config=config, field_of=lambda k, e: noisy(k, e, 0.0, 1e-5))
    ) as run:
        truth, E = run.gauges["axial"].value, evaluate_test(run.curve, tensile_options(run.specimen)).E.value
    front, back = runs(tmp_path, monkeypatch, config)
    with open_run(front) as one, open_run(back) as other:
        assert other.start_monotonic - one.start_monotonic == pytest.approx(LATER_S)
        sides = SidesOfTest.of_folders(one, other)
    axial = sides.courses["axial"]
    for values, share in ((axial.mean, 1.0), (axial.bending, BENT + TOWARDS)):
        rest = values - share * truth
        assert np.mean(np.abs(rest) < 3 * axial.sigma) > 0.95
        assert abs(np.mean(rest)) < 1e-6
    assert abs(sides.figures["front"].E.value / E - 1) > 0.025
    assert sides.figures["both"].E.value == pytest.approx(E, rel=1e-3)
    assert sides.figures["both"].E.low < E < sides.figures["both"].E.high


@pytest.mark.slow
def test_the_command_writes_a_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    front, back = runs(tmp_path, monkeypatch, {**CONFIG, "gauges": GAUGES})
    assert main(["sides", str(front), str(back)]) == 0
    shown = capsys.readouterr().out
    assert "both:   E = " in shown and "front:  E = " in shown and "back:   E = " in shown
    with (front / "sides.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(PULLED)
    assert float(rows[-1]["mean_axial"]) == pytest.approx(PULLED[-1], rel=0.02)  # of a coarse grid
    assert float(rows[-1]["bending_axial"]) == pytest.approx((BENT + TOWARDS) * PULLED[-1], rel=0.02)
    assert abs(float(rows[-1]["mean_shear"])) < 1e-5
    assert main(["sides", str(front), str(back)]) == 2  # it exists
    assert "sides.csv" in capsys.readouterr().err


@pytest.mark.slow
def test_what_is_not_of_one_test_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    front = make_run(tmp_path / "front")
    same = make_run(tmp_path / "same", session=False)  # by its time: of one run with two cameras
    monkeypatch.setattr(made_run, "START", made_run.START + 501.0)
    monkeypatch.setattr(made_run, "UTC_START", made_run.UTC_START + timedelta(seconds=1))
    without = make_run(tmp_path / "without", session=False)
    elsewhere = make_run(tmp_path / "elsewhere")
    with open_run(front) as one, open_run(same) as other:
        assert shift_s(one, other) == 0
    with open_run(front) as one, open_run(without) as other, pytest.raises(DataError, match="no recording"):
        SidesOfTest.of_folders(one, other)
    with open_run(front) as one, open_run(elsewhere) as other, pytest.raises(DataError, match="500 s apart"):
        SidesOfTest.of_folders(one, other)


STRAIN, BENDING = 1e-3, 2e-4


def side(strain: float, numbers: Sequence[int]) -> RunState:
    state = RunState.new(1.0)
    measure(state, strain, numbers)
    return state


def measure(state: RunState, strain: float, numbers: Sequence[int]) -> None:
    for number in numbers:
        state.history.add(make_measurement(number, strain).time_step)


def both(front: RunState, back: RunState) -> JointChannels:
    joint = JointChannels()
    joint.attach({"front": front, "back": back}, live=True)
    return joint


def test_mean_bending_and_sigma_at_the_newest_instant_of_both() -> None:
    front, back = side(STRAIN + BENDING, range(9)), side(STRAIN - BENDING, range(8))
    found = both(front, back).read(START)
    assert found["mean_time_s"] == pytest.approx(0.7)  # the back is not so far yet
    assert found["mean_axial"] == pytest.approx(STRAIN)
    assert found["bending_axial"] == pytest.approx(BENDING)
    assert 0 < found["sigma_mean_axial"] < 1e-5


def test_nothing_before_both_have_measured() -> None:
    assert JointChannels().read(START) == {}
    waiting = both(side(STRAIN, range(40)), side(STRAIN, ()))
    assert (waiting.read(START), waiting.lost) == ({}, "")


@pytest.mark.parametrize("late", ["front", "back"])
def test_a_side_that_stalls_leaves_no_value(late: str) -> None:
    states = {"front": side(STRAIN, range(8)), "back": side(STRAIN, range(8))}
    joint = both(**states)
    goes_on = states["back" if late == "front" else "front"]
    measure(goes_on, STRAIN, range(8, 18))
    assert joint.lost == "" and joint.read(START)["mean_time_s"] == pytest.approx(0.7)
    measure(goes_on, STRAIN, range(18, 21))
    assert (joint.read(START), joint.lost) == ({}, f"the {late} gives no strains")
    measure(states[late], STRAIN, range(21, 24))
    measure(goes_on, STRAIN, range(21, 24))
    assert joint.lost == "" and joint.read(START)["mean_time_s"] == pytest.approx(2.3)


def test_strains_that_one_side_has_no_more() -> None:
    front, back = side(STRAIN, range(8)), side(STRAIN, range(8))
    joint = both(front, back)
    for number in range(8, 25):
        measure(front, STRAIN, [number])
        measure(back, float("nan"), [number])
        assert number > 17 or not joint.lost
    assert (joint.read(START), joint.lost) == ({}, "no strain of both for 1.7 s")


def test_a_pause_of_both_is_no_loss() -> None:
    front, back = side(STRAIN, range(8)), side(STRAIN, range(8))
    joint = both(front, back)
    measure(front, STRAIN, range(1000, 1003))
    assert joint.lost == ""
    measure(back, STRAIN, range(1000, 1003))
    assert joint.lost == "" and joint.read(START)["mean_time_s"] == pytest.approx(100.2)


@pytest.mark.parametrize("failed", ["front", "back"])
def test_a_camera_that_fails_leaves_no_value_at_once(failed: str) -> None:
    states = {"front": side(STRAIN, range(8)), "back": side(STRAIN, range(8))}
    joint = both(**states)
    states[failed].health.camera_failed = True
    assert (joint.read(START), joint.lost) == ({}, f"the camera of the {failed} has failed")


def test_two_cameras_that_stall_together_leave_no_value() -> None:
    now = [START + 0.8]
    states = {name: side(STRAIN, range(8)) for name in ("front", "back")}
    joint = JointChannels(lambda: now[0])
    joint.attach(states, live=True)
    for state in states.values():
        state.health.state = "REC"
    assert joint.lost == "" and joint.read(START)["mean_axial"] == pytest.approx(STRAIN)
    now[0] = START + 3.0
    assert (joint.read(START), joint.lost) == ({}, "the front gives no strains")
    assert newest(states, now[0]) == {}
    for state in states.values():
        state.health.paused = True
    assert (joint.read(START), joint.lost) == ({}, "")
