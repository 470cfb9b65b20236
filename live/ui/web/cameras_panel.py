"""Several cameras on the page while a test runs: of sides mean and bending, E, and what each camera does."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from analysis.evaluate import TensileFigures
from live.config.cameras import BACK, FRONT
from live.config.sections import SpecimenConfig
from live.pipeline.run_state import RunState
from live.pipeline.snapshot import FPS
from live.results.figures import evaluate, headline, tensile_options
from live.results.sides import SideOfTest, SidesOfTest, newest

FIGURES_S = 2.0
"""Between two evaluations of all that was measured so far."""


class CamerasPanel:
    """What the page shows of all cameras.

    Parameters
    ----------
    states : mapping of str to RunState
    specimen : SpecimenConfig
    now : callable giving monotonic seconds
    """

    def __init__(
        self, states: Mapping[str, RunState], specimen: SpecimenConfig, now: Callable[[], float]
    ) -> None:
        self._states, self._specimen, self._now = states, specimen, now
        self._due, self._figures = 0.0, list[dict[str, str]]()

    def state(self) -> dict[str, Any]:
        """Strains at the newest instant of both sides, figures of the test so far, and the cameras."""
        now = self._now()
        if now >= self._due:
            self._figures = side_figures(figures_of(self._states, self._specimen), self._specimen)
            self._due = max(now + FIGURES_S, self._now() + 10 * (self._now() - now))
        return {
            "strains": [{"name": name, **one._asdict()} for name, one in newest(self._states, now).items()],
            "figures": self._figures,
            "cameras": [self._camera(side, now) for side in self._states],
        }

    def _camera(self, side: str, now: float) -> dict[str, Any]:
        state = self._states[side]
        s = state.snapshot(now)
        return {
            "side": side,
            "failed": state.health.camera_failed,
            "valid": s.valid,
            "zois": s.zois,
            "fps": s.figure(FPS).value,
            "skipped": s.frames["skipped"],
            "lost": s.lost,
        }


def figures_of(states: Mapping[str, RunState], specimen: SpecimenConfig) -> dict[str, TensileFigures]:
    """The figures of a test so far, by the mean ("both") and by each side; of fields by each. None before strains."""
    if not all(state.history.has_values for state in states.values()):
        return {}
    if FRONT not in states:
        return {name: evaluate(state.history, state.loads, specimen) for name, state in states.items()}
    front, back = (SideOfTest.of_state(states[side], specimen) for side in (FRONT, BACK))
    return SidesOfTest.of(front, back, tensile_options(specimen)).figures


def side_figures(found: Mapping[str, TensileFigures], specimen: SpecimenConfig) -> list[dict[str, str]]:
    """E, nu and strengths that are known."""
    return [
        {"side": where, "name": row.name, "text": row.text}
        for where, figures in found.items()
        for row in headline(figures, stresses=specimen.area_m2 is not None)
        if row.figure.known
    ]
