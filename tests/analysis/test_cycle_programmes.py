"""Cycles of programmes that change and of loads that are no sines: the truth or a reason, and no wrong figure."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.evaluate.cyclic.cycles import CycleCounter, CycleTable
from analysis.evaluate.cyclic.loop import BurstStrains
from analysis.evaluate.lag import Track

Floats = NDArray[np.float64]
E, LOW, HIGH, START = 70e9, 10e6, 100e6, 2.0
N = 40
Wave = Callable[[Floats], Floats]


def cosine(u: Floats) -> Floats:
    return np.asarray((1 - np.cos(np.pi * u)) / 2)


def line(u: Floats) -> Floats:
    return u


def dwell(u: Floats) -> Floats:
    return np.clip(2 * u - 0.5, 0, 1)


def jump(u: Floats) -> Floats:
    return np.clip(20 * u - 9.5, 0, 1)


@dataclass
class Programme:
    """Half cycles between turns after a preload; metals that flow as well, by Ramberg, Osgood and Masing."""

    high: Floats
    low: Floats
    length: Floats
    wave: Wave = cosine
    flow_Pa: float = np.inf
    noise: float = 10e-6

    def __post_init__(self) -> None:
        self.begins = START + np.concatenate([[0], np.cumsum(self.length)])
        self.times = np.concatenate([[0, 1, START], self.begins[:-1] + self.length / 2, self.begins[1:]])
        turns = np.concatenate([[0, self.low[0], self.low[0]], self.high, self.low])
        self.turns, self.times = turns[np.argsort(self.times)], np.sort(self.times)

    def both(self, t: Floats) -> tuple[Floats, Floats]:
        """Stress and strain."""
        k = np.clip(np.searchsorted(self.times, t, side="right") - 1, 0, len(self.turns) - 2)
        steps = np.diff(self.turns)
        part = np.clip((t - self.times[k]) / np.diff(self.times)[k], 0, 1)
        change = steps[k] * self.wave(part)
        flown = np.concatenate([[0], np.cumsum(self._flow(steps))])
        stress = self.turns[k] + change
        return stress, stress / E + flown[k] + self._flow(change)

    def _flow(self, change: Floats) -> Floats:
        return np.asarray(2 * np.sign(change) * (np.abs(change) / (2 * self.flow_Pa)) ** 8)

    def table(self, rate: float = 200.0, bursts_hz: float = 20.3, noise_Pa: float = 2e4) -> CycleTable:
        rng, end = np.random.default_rng(3), self.times[-1] + 1
        t, at = np.arange(0, end, 1 / rate), np.arange(0.013, end, 1 / bursts_hz)
        load = Track(t, self.both(t)[0] + rng.normal(0, noise_Pa, len(t)))
        strain = self.both(at)[1] + rng.normal(0, self.noise, len(at))
        return CycleTable.of([load], BurstStrains(at, strain, 0 * at))


def even(
    wave: Wave = cosine, low: float = LOW, high: float = HIGH, noise: float = 10e-6, flow: float = np.inf
) -> Programme:
    one = np.ones(N)
    return Programme(high * one, low * one, one, wave, flow, noise)


def levels(small: NDArray[np.bool_]) -> Programme:
    """Two levels about one mean."""
    change = np.where(small, 27e6, 0)
    return Programme(HIGH - change, LOW + change, np.ones(len(small)))


def lengths(length: Floats) -> Programme:
    one = np.ones(len(length))
    return Programme(HIGH * one, LOW * one, length)


def pulls(table: CycleTable, name: str, truth: Floats | float) -> Floats:
    """How many standard uncertainties the known figures are off."""
    off = (table.column(name) - truth) / table.column(f"sigma_{name}")
    return np.abs(off[np.isfinite(off)])


K = np.arange(N)
CHANGING = {
    "blocks of two levels": levels(K % 10 >= 5),
    "small, then large": levels(K < N // 2),
    "large, then small": levels(K >= N // 2),
    "growing": Programme(55e6 + (14e6 + 0.8e6 * K), 55e6 - (14e6 + 0.8e6 * K), np.ones(N)),
    "a mean that drifts": Programme(HIGH + 2.5e6 * K, LOW + 2.5e6 * K, np.ones(N)),
    "lower valleys now and then": Programme(np.full(N, HIGH), np.where(K % 20 == 10, -50e6, LOW), np.ones(N)),
    "tension and compression": even(low=-100e6),
    "compression": even(low=-100e6, high=-10e6),
    "a fifth of the range as noise": even(noise=0.2 * (HIGH - LOW) / E),
}


@pytest.mark.parametrize("name", CHANGING)
def test_cycles_of_a_changing_programme_are_all_there_with_their_stiffness(name: str) -> None:
    made = CHANGING[name]
    table = made.table()
    assert len(table) == N
    assert np.count_nonzero(np.isfinite(table.column("modulus"))) >= N - 1
    assert np.median(pulls(table, "modulus", E)) < 1.1 and pulls(table, "modulus", E).max() < 5
    assert table.column("peak_load") == pytest.approx(made.high, abs=2e6)
    assert pulls(table, "phase", 0.0).max() < 5


@pytest.mark.parametrize("change", [3.0, 1.5, 1.3, 0.67, 0.33])
def test_a_change_of_frequency_costs_a_cycle_and_makes_no_wrong_range(change: float) -> None:
    table = lengths(np.where(K < N // 2, 1.0, change)).table(bursts_hz=40.3)
    assert len(table) == N
    known = np.isfinite(table.column("range_load"))
    assert np.count_nonzero(~known) <= 1
    assert all("a cycle of another length" in why for why in table.why if why)
    assert table.column("range_load")[known] == pytest.approx(HIGH - LOW, rel=0.01)
    assert pulls(table, "range_strain", (HIGH - LOW) / E).max() < 5


def test_a_slower_cycle_that_comes_in_pieces_waits_for_its_end() -> None:
    made, counter = lengths(np.where(K < N // 2, 1.0, 3.0)), CycleCounter(loaded=True)
    ranges = list[float]()
    for since in np.arange(0, made.times[-1], 0.1):
        t, at = since + np.arange(0, 0.1, 0.005), since + np.arange(0, 0.1, 0.05)
        cycles = counter.add(Track(t, made.both(t)[0]), BurstStrains(at, made.both(at)[1], 0 * at))
        ranges += [one.range_load for one in cycles]
    ranges = [one for one in ranges if one == one]
    assert len(ranges) >= N - 2 and ranges == pytest.approx([HIGH - LOW] * len(ranges), rel=0.01)


@pytest.mark.parametrize("level", [30e6, 55e6, 100e6])
def test_cycles_before_a_load_that_is_held_between_the_levels_still_count(level: float) -> None:
    high = np.where(K == 20, level, HIGH)
    made = Programme(high, np.full(N, LOW), np.where(K == 20, 30.0, 1.0), dwell)
    table = made.table()
    assert len(table) == N
    assert np.count_nonzero(np.isfinite(table.column("modulus"))) >= N - 1
    assert pulls(table, "modulus", E).max() < 5


@pytest.mark.parametrize("rate", [16.4, 50.0, 1000.0])
def test_the_range_of_a_triangle_is_as_uncertain_as_its_tips(rate: float) -> None:
    table = even(line).table(rate)
    assert len(table) == N
    assert pulls(table, "range_load", HIGH - LOW).max() < 2
    assert pulls(table, "range_strain", (HIGH - LOW) / E).max() < 5


@pytest.mark.parametrize("bursts_hz", [6.3, 20.3, 50.3])
def test_a_load_that_jumps_has_a_modulus_and_no_loop(bursts_hz: float) -> None:
    table = even(jump).table(1000.0, bursts_hz)
    assert np.median(pulls(table, "modulus", E)) < 1 and np.quantile(pulls(table, "modulus", E), 0.9) < 3
    assert np.quantile(pulls(table, "range_strain", (HIGH - LOW) / E), 0.9) < 3
    assert np.isnan(table.column("area")).all() and np.isnan(table.column("phase")).all()


@pytest.mark.parametrize(("wave", "part"), [(cosine, 0.08), (line, 0.05), (dwell, 0.08)])
def test_the_loop_of_a_metal_that_flows(wave: Wave, part: float) -> None:
    """Of a load that is held at its peak the strain is not higher than at the tips."""
    made = even(wave, flow=150e6)
    table = made.table(1000.0, 40.3)
    at = np.linspace(made.begins[5], made.begins[6], 20001)
    stress, strain = made.both(at)
    area = np.sum((stress[1:] + stress[:-1]) / 2 * np.diff(strain))
    assert np.median(table.column("area")) == pytest.approx(area, rel=part)
    assert np.median(table.column("range_strain")) == pytest.approx(np.ptp(strain), rel=0.02)
    assert np.median(table.column("modulus")) == pytest.approx(np.ptp(stress) / np.ptp(strain), rel=0.02)


def test_a_gap_of_the_load_has_its_own_reason() -> None:
    made = even()
    t, at = np.arange(0, 44, 0.005), np.arange(0, 44, 0.05)
    t = t[(t < 10.2) | (t > 10.7)]
    table = CycleTable.of([Track(t, made.both(t)[0])], BurstStrains(at, made.both(at)[1], 0 * at))
    assert len(table) == N
    assert [why for why in table.why if why] == ["no reading of the load for 51% of the cycle"]
