"""A measurement waits for its force, but not for ever."""

from __future__ import annotations

import numpy as np

from acquire.load_cell import LoadLog
from acquire.load_sample import LoadSample
from live.measure import HOLD_S, Settling
from tests.live.made_up import START, make_loads, make_measurement


def test_a_measurement_waits_for_its_force() -> None:
    loads = make_loads(0.15, lambda t: 100.0 * t)
    settling = Settling(loads)
    settled = [m for k in range(3) for m in settling.add(make_measurement(k))]
    assert (len(settled), len(settling)) == (2, 1)
    for k in range(16, 40):
        loads.append(LoadSample(START + k / 100, float(k)))
    settled += settling.add(make_measurement(3))
    assert len(settling) == 0
    np.testing.assert_allclose([m.force for m in settled], [0.0, 10.0, 20.0, 30.0], atol=1e-6)
    assert [m.number for m in settled] == [0, 1, 2, 3]


def test_a_silent_load_cell_holds_measurements_back_only_so_long() -> None:
    settling, settled = Settling(LoadLog()), []
    for k in range(40):
        settled += settling.add(make_measurement(k))
        assert len(settling) <= HOLD_S / 0.1 + 1
    assert len(settled) == 40 - len(settling) > 10
    settled += settling.rest()
    assert len(settled) == 40
    assert np.isnan([m.force for m in settled]).all()
