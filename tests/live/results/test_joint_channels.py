"""Front and back as channels of a running test: values at the instant of both, and none that is too old."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from live.pipeline.run_state import RunState
from live.results.sides.channels import JointChannels
from live.results.sides.together import newest
from tests.live.made_up import START, make_measurement

STRAIN, BENT = 1e-3, 2e-4


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
    front, back = side(STRAIN + BENT, range(9)), side(STRAIN - BENT, range(8))
    found = both(front, back).read(START)
    assert found["mean_time_s"] == pytest.approx(0.7)  # the back is not so far yet
    assert found["mean_axial"] == pytest.approx(STRAIN)
    assert found["bending_axial"] == pytest.approx(BENT)
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
