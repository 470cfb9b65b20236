"""The soft machine: part of its way goes into the machine until the specimen yields."""

from __future__ import annotations

import pytest

from hw_mocks.machine import ELASTIC_SHARE, Machine


def test_the_strain_follows_the_speed_and_bends_at_yield() -> None:
    now = 0.0
    machine = Machine(0, 3e-3, lambda t: t, lambda: now)
    machine.drive(1e-3)
    # 3e-3 is reached after 3 / 0.6 = 5 s; beyond it the whole way goes into the specimen.
    expected = [0, ELASTIC_SHARE * 2e-3, ELASTIC_SHARE * 4e-3, 3e-3, 4e-3, 5e-3]
    assert machine.strain([0, 2, 4, 5, 6, 7]) == pytest.approx(expected, rel=1e-12)
    now = 6.0
    machine.drive(2e-3)
    assert machine.strain([2, 6, 7]) == pytest.approx([1.2e-3, 4e-3, 6e-3], rel=1e-12)


def test_it_neither_pushes_nor_goes_too_fast() -> None:
    now = 0.0
    machine = Machine(0, 1.0, lambda t: t, lambda: now)
    machine.drive(-1.0)
    assert machine.strain([0, 10]) == pytest.approx([0, 0])
    machine.drive(5.0)
    assert machine.strain([1]) == pytest.approx([ELASTIC_SHARE * 0.1])
