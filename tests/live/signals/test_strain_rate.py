"""The example of a controller: a PID holds the strain rate of a soft machine through strain out."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from acquire.events import EventKind
from examples.strain_rate import main
from hw_mocks.machine import ELASTIC_SHARE, Machine

RATE, UNTIL = 5e-4, 4e-3


def test_the_strain_rate_is_held_through_yield(tmp_path: Path) -> None:
    """Within the 20 % of ISO 6892-1 over a second, where the machine alone would be 40 % off."""
    outcome = main(str(tmp_path / "run"), RATE, UNTIL)
    assert outcome.exit_code == 0
    instants, specimen = outcome.books.history.instants, outcome.rig.specimen
    assert specimen is not None
    times = np.array([specimen.elapsed(instant.t) for instant in instants])
    truth = specimen.axial_strain(times)
    assert UNTIL < truth[-1] < UNTIL + 1e-3
    pulled = times[truth > 2e-4]
    grid = np.arange(pulled[0] + 1.0, pulled[-1] - 1.0, 0.25)
    rates = specimen.axial_strain(grid + 1.0) - specimen.axial_strain(grid)
    settled = (specimen.axial_strain(grid) > 2.6e-3) | (specimen.axial_strain(grid + 1.0) < 2e-3)
    assert np.abs(rates[settled] / RATE - 1).max() < 0.2
    assert np.abs(rates / RATE - 1).max() < 0.6
    notes = [e.text for e in outcome.books.journal.events() if e.kind is EventKind.NOTE]
    assert notes == ["strain rate 0.0005 1/s"]


def test_the_machine_is_soft_until_yield_and_only_pulls() -> None:
    now = [0.0]
    machine = Machine(0, 1e-3, lambda t: t, lambda: now[0])
    machine.drive(1e-3)
    now[0] = 1.0
    machine.drive(-5.0)
    assert machine.strain(0.5) == 0.5e-3 * ELASTIC_SHARE and machine.strain(3.0) == 1e-3 * ELASTIC_SHARE
    now[0] = 4.0
    machine.drive(1e-3)
    left = (1e-3 - 1e-3 * ELASTIC_SHARE) / (1e-3 * ELASTIC_SHARE)
    np.testing.assert_allclose(machine.strain([4 + left, 5 + left, 0.0, -1.0]), [1e-3, 2e-3, 0.0, 0.0])
