"""Fault plans: their text and when they are in force."""

from __future__ import annotations

import pytest

from acquire.errors import ConfigError
from hw_mocks.faults import CAMERA_FAULTS, SERIAL_FAULTS, Fault, FaultPlan, parse_faults, plan_frames


def test_lasting_faults_have_an_end() -> None:
    plan = FaultPlan((Fault("silence", 2.0, 1.5),))
    assert [plan.lasting("silence", t) is not None for t in (1.9, 2.0, 3.4, 3.5)] == [
        False,
        True,
        True,
        False,
    ]
    assert plan.lasting("late", 2.0) is None


def test_begun_is_told_once_each() -> None:
    plan = parse_faults("drop@1, drop@3*7", CAMERA_FAULTS, "sim:")
    assert plan.begun("drop", 0.5) is None
    assert plan.begun("drop", 1.2) == Fault("drop", 1.0, 3.0)
    assert plan.begun("drop", 1.3) is None
    assert plan.begun("drop", 9.0) == Fault("drop", 3.0, 7.0)
    assert plan.begun("drop", 9.0) is None


def test_every_name_can_be_written() -> None:
    for table in (CAMERA_FAULTS, SERIAL_FAULTS):
        text = ",".join(f"{name}@1" for name in table)
        plan = parse_faults(text, table, "sim:")
        for name in table:
            assert plan.begun(name, 1.0) == Fault(name, 1.0, table[name])


@pytest.mark.parametrize(
    "text", ["drop", "drop@", "drop@x", "drop@1*x", "drop@1*-1", "drop@inf", "@3", "fall@3"]
)
def test_malformed_text_is_refused(text: str) -> None:
    with pytest.raises(ConfigError, match="sim:y"):
        parse_faults(text, CAMERA_FAULTS, "sim:y")


def test_plan_without_faults_is_every_frame() -> None:
    planned = list(plan_frames(1.0, 10.0, FaultPlan()))
    assert [p.index for p in planned] == list(range(11))
    assert {p.fate for p in planned} == {"good"}
    assert planned[3].t == pytest.approx(0.3)


def test_overlapping_faults_keep_their_counts() -> None:
    plan = parse_faults("drop@0.2*2,damage@0.2*1", CAMERA_FAULTS, "sim:")
    fates = [p.fate for p in plan_frames(0.6, 10.0, plan)]
    assert fates == ["good", "good", "lost", "lost", "damaged", "good", "good"]
