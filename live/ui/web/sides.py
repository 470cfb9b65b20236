"""Front and back on the page while a test with two cameras runs: mean and bending, E, and what each camera does."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from live.config.sections import SpecimenConfig
from live.config.sides import BACK, FRONT
from live.pipeline.run_state import RunState
from live.results.figures import headline, tensile_options
from live.results.sides.together import SideOfTest, SidesOfTest, newest

FIGURES_S = 2.0
"""Between two evaluations of all that was measured so far."""


class SidesPanel:
    """What the page shows of both sides.

    Parameters
    ----------
    states : mapping of side to RunState
    specimen : SpecimenConfig
    now : callable giving monotonic seconds
    """

    def __init__(
        self, states: Mapping[str, RunState], specimen: SpecimenConfig, now: Callable[[], float]
    ) -> None:
        self._states, self._specimen, self._now = states, specimen, now
        self._due, self._figures = 0.0, list[dict[str, str]]()

    def state(self) -> dict[str, Any]:
        """Strains at the newest instant of both, figures of the test so far, and the cameras."""
        now = self._now()
        if now >= self._due:
            sides = sides_of(self._states, self._specimen)
            self._figures = [] if sides is None else side_figures(sides, self._specimen)
            self._due = max(now + FIGURES_S, self._now() + 10 * (self._now() - now))
        strains = newest(self._states[FRONT], self._states[BACK])
        return {
            "strains": [
                {"name": name, "mean": one.mean, "bending": one.bending, "sigma": one.sigma}
                for name, one in strains.items()
            ],
            "figures": self._figures,
            "cameras": [self._camera(side, now) for side in (FRONT, BACK)],
        }

    def _camera(self, side: str, now: float) -> dict[str, Any]:
        s = self._states[side].snapshot(now)
        return {
            "side": side, "valid": s.valid, "zois": s.zois, "fps": s.fps, "skipped": s.frames["skipped"],
            "lost": s.lost,
        }  # fmt: skip


def sides_of(states: Mapping[str, RunState], specimen: SpecimenConfig) -> SidesOfTest | None:
    """Both sides of a test so far; None before both have measured."""
    if not all(state.history.has_values for state in states.values()):
        return None
    front, back = (SideOfTest.of_state(states[side], specimen) for side in (FRONT, BACK))
    return SidesOfTest.of(front, back, tensile_options(specimen))


def side_figures(sides: SidesOfTest, specimen: SpecimenConfig) -> list[dict[str, str]]:
    """E, nu and strengths that are known, by the mean of both sides and by each."""
    return [
        {"side": where, "name": row.name, "text": row.text}
        for where in ("both", FRONT, BACK)
        for row in headline(getattr(sides, where), stresses=specimen.area_m2 is not None)
        if row.figure.known
    ]
