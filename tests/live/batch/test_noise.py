"""The noise that is measured while nothing moves."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from live.batch.work.noise import measured_noise, still_instants
from tests.live.made_run import force_of, make_run, noisy

STRAINS = (*[0.0] * 10, *np.linspace(1e-4, 3e-3, 20))


def test_still_until_the_force_leaves() -> None:
    force = np.array([5.0, 5.1, 4.9, 5.05, 8.0, 5.0, 100.0])
    assert still_instants(force) == 4
    assert still_instants(np.array([np.nan, 1.0])) == 0
    assert still_instants(np.full(5, np.nan)) == 0
    assert still_instants(np.array([1.0, 1.0, np.nan, 9.0])) == 2  # nobody knows what it did then
    assert still_instants(np.zeros(9)) == 0  # nothing was pulled


def test_measured_where_it_was_still(tmp_path: Path) -> None:
    """The noise of 2e-5 is measured, whatever it is said to be; strain that varies later is not taken for it."""
    folder = make_run(
        tmp_path / "run", STRAINS, session=False, field_of=lambda k, strain: noisy(k, strain, 2e-5, 1e-6)
    )
    found = measured_noise(folder / "strain.h5", np.array([force_of(strain) for strain in STRAINS]))
    assert found["still_instants"] == 10
    assert found["strain_noise_measured"] == pytest.approx(2e-5, rel=0.15)
    assert measured_noise(folder / "strain.h5", np.full(30, np.nan)) == {"still_instants": 0}
