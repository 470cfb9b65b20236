"""Software triggers at a steady rate: one a period, none caught up, and refusals."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

import pytest

from acquire.genicam import camera
from acquire.genicam.device import GenicamDevice
from acquire.genicam.library import GenicamError


class Bench:
    """A device and the time; work goes on in the caller, until ``turns`` waits have passed.

    Attributes
    ----------
    triggered : list of float, s
        When it was triggered.
    costs : list of float, s
        How long each trigger blocks; nothing after them.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch, costs: list[float], turns: int) -> None:
        self.now, self.turns, self.costs = 100.0, turns, costs
        self.triggered: list[float] = []
        self.asked: list[str] = []
        self.stopped = False
        self.refused_from = 10**6
        self.at_refusal: Callable[[], None] = lambda: None
        threads = SimpleNamespace(Event=lambda: self, Thread=self._thread)
        monkeypatch.setattr(camera, "threading", threads)
        monkeypatch.setattr(camera, "time", SimpleNamespace(monotonic=lambda: self.now))

    def _thread(self, target: Callable[[], None], **_: Any) -> Any:
        return SimpleNamespace(start=target)

    def wait(self, seconds: float) -> bool:
        assert seconds >= 0.0
        self.turns -= 1
        self.now += seconds
        return self.stopped or self.turns < 0

    def set(self) -> None:
        self.stopped = True

    def is_set(self) -> bool:
        return self.stopped

    def ask(self, name: str) -> None:
        if len(self.triggered) >= self.refused_from:
            self.at_refusal()
            raise GenicamError("the line is down")
        self.asked.append(name)
        self.triggered.append(self.now)
        self.now += self.costs.pop(0) if self.costs else 0.0

    def work(self, period_s: float) -> str:
        """Why it is refused."""
        return camera.SoftwareTrigger(cast(GenicamDevice, self), period_s).refused


@pytest.mark.parametrize(
    ("costs", "at"),
    [
        pytest.param([0.01, 0.03, 0.0, 0.02], [0.0, 0.05, 0.10, 0.15, 0.20], id="whatever a trigger takes"),
        pytest.param(
            [0.0, 0.22], [0.0, 0.05, 0.27, 0.32, 0.37], id="periods that it blocked are not caught up"
        ),
    ],
)
def test_one_picture_each_period(
    monkeypatch: pytest.MonkeyPatch, costs: list[float], at: list[float]
) -> None:
    bench = Bench(monkeypatch, costs, turns=5)
    assert bench.work(0.05) == ""
    assert bench.triggered == pytest.approx([100.0 + t for t in at])
    assert set(bench.asked) == {"arv_camera_software_trigger"}


def test_a_refusal_is_kept_and_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(monkeypatch, [], turns=10)
    bench.refused_from = 3
    assert bench.work(0.05) == "the line is down"
    assert len(bench.triggered) == 3 and bench.turns == 6


def test_a_refusal_after_stop_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    """A camera that is being closed refuses."""
    bench = Bench(monkeypatch, [], turns=10)
    bench.refused_from, bench.at_refusal = 3, bench.set
    assert bench.work(0.05) == ""
