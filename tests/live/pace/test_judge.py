"""A lost pace is told once, with its cause."""

from __future__ import annotations

import pytest

from live.pace import Lag, Pace
from live.pace.processor import Use, used

PERIOD_S = 1 / 30


def told(latency_s: float, *, backlog: float = 0.0, kernel_s: float = 0.01, others: float = 0.0,
         view: float = 0.0, seconds: float = 4.0) -> list[str]:  # fmt: skip
    """The warnings of some seconds of measurements, ``others`` and ``view`` in cores."""
    now = 0.0

    def use() -> Use:
        return Use(now, now * (1.0 + others + view), now * 1.0, now * view)

    pace, warnings = Pace(lambda: backlog, use), []
    for k in range(round(seconds * 30)):
        now = k * PERIOD_S
        if words := pace.look(Lag(now, latency_s, kernel_s), PERIOD_S):
            warnings.append(words)
    assert pace.p95_s == pytest.approx(latency_s)
    return warnings


def test_nothing_is_said_while_all_is_well() -> None:
    assert told(0.04) == []


@pytest.mark.parametrize(
    ("cause", "says"),
    [
        ({"backlog": 0.3}, "the disk is too slow"),
        ({"others": 0.9}, "another program takes 0.9 processor cores"),
        ({"kernel_s": 0.05}, "the kernel needs 50 ms"),
        ({"view": 0.8}, "drawing takes 0.8 processor cores"),
        ({}, "the processor is short"),
    ],
)
def test_a_lost_pace_is_told_once_with_its_cause(cause: dict[str, float], says: str) -> None:
    (warning,) = told(0.1, **cause)
    assert "up to 100 ms late (p95), bursts every 33 ms" in warning
    assert says in warning


def test_bursts_that_come_seldom_have_a_latency_and_no_warning() -> None:
    pace = Pace(lambda: 0.0, lambda: Use(0.0, 0.0, 0.0, 0.0))
    assert [pace.look(Lag(2.0 * k, 9.0, 0.01), 2.0) for k in range(20)] == [""] * 20
    assert pace.p95_s == pytest.approx(9.0)


def test_the_bursts_that_waited_for_the_first_result_tell_nothing() -> None:
    pace = Pace(lambda: 0.0, lambda: Use(0.0, 0.0, 0.0, 0.0))
    late = [max(0.8 - 0.3 * k * PERIOD_S, 0.02) for k in range(150)]
    assert not any(pace.look(Lag(k * PERIOD_S, late[k], 0.01), PERIOD_S) for k in range(150))
    assert pace.p95_s < 0.05


def test_it_is_told_again_when_it_lasts() -> None:
    assert len(told(0.1, seconds=68)) == 3


def test_this_machine_says_who_uses_it() -> None:
    before = used()
    assert before is not None
    sum(k * k for k in range(2_000_000))
    after = used()
    assert after is not None
    assert after.own > before.own
    assert after.all >= before.all > 0
