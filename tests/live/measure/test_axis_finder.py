"""The axis of the load as it is found while a test runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from live.measure import AxisFinder, Instant
from live.measure import history as module
from tests.live.made_up import START, make_measurement


def instants(count: int) -> list[Instant]:
    """Still for a third, then pulled along x."""
    one, rng = make_measurement(0).instant, np.random.default_rng(1)
    found = []
    for k in range(count):
        e = 1e-3 * max(0.0, 3 * k / count - 1)
        exx, eyy, exy = np.array([e, -0.3 * e, 0.0]) + rng.normal(0, 1e-6, 3)
        found.append(replace(one, t=START + k, exx=exx, eyy=eyy, exy=exy))
    return found


@pytest.mark.parametrize("most", [2000, 50])
def test_y_until_the_strains_tell(monkeypatch: pytest.MonkeyPatch, most: int) -> None:
    monkeypatch.setattr(module, "MOST_INSTANTS", most)
    finder, course = AxisFinder("auto"), instants(300)
    told = [finder.add(i) for i in course]
    assert set(told[:100]) == {"y"} and set(told[130:]) == {"x"}
    assert len(finder._strains.kept) <= most
    again = AxisFinder("auto")
    assert [again.add(i) for i in course for _ in range(2)][::2] == told, "told twice it counts once"


def test_what_is_given_holds() -> None:
    for axis in ("x", "y"):
        finder = AxisFinder(axis)
        assert {finder.add(i) for i in instants(100)} == {axis}
