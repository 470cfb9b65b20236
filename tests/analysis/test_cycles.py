"""Cycles: counted, and their figures against a truth that is given, with sigma by Monte Carlo."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.evaluate.cyclic.cycles import Cycle, CycleCounter, CycleTable
from analysis.evaluate.cyclic.loop import BurstStrains
from analysis.evaluate.lag import Track

Floats = NDArray[np.float64]
E, MEAN, AMPLITUDE = 70e9, 55e6, 45e6  # Pa: R = 0.1
HOLD = 2.0  # s


@dataclass
class Made:
    """A test of n cycles of 1 - cos from the lowest stress; the strain is late by ``phase`` and drifts."""

    n: int = 10
    hz: float = 1.0
    rate: float = 200.0
    bursts_hz: float = 20.0
    noise: float = 0.0
    noise_Pa: float = 0.0
    phase: float = 0.0
    width: float = 0.0
    drift: float = 0.0
    seed: int = 0
    wave: Callable[[Floats], Floats] = np.cos

    def stress(self, t: Floats, behind: float = 0.0) -> Floats:
        u = np.clip((t - HOLD) * self.hz, 0, self.n)
        return MEAN - AMPLITUDE * self.wave(2 * np.pi * u - behind) * np.clip(t / HOLD, 0, 1)

    def strain(self, t: Floats) -> Floats:
        fine = t[:, None] + self.width * (np.arange(41) - 20) / 41
        return np.asarray(self.stress(fine, self.phase).mean(axis=1) / E + self.drift * t)

    def made(self) -> tuple[Track, BurstStrains]:
        rng, end = np.random.default_rng(self.seed), HOLD + self.n / self.hz + 1
        t, at = np.arange(0, end, 1 / self.rate), np.arange(0.013, end, 1 / self.bursts_hz)
        load = Track(t, self.stress(t) + rng.normal(0, self.noise_Pa, len(t)))
        strain = self.strain(at) + rng.normal(0, self.noise, len(at))
        return load, BurstStrains(at, strain, np.full(len(at), self.width))

    def table(self) -> CycleTable:
        load, bursts = self.made()
        return CycleTable.of([load], bursts)


def triangle(theta: Floats) -> Floats:
    return np.asarray(2 / np.pi * np.arcsin(np.cos(theta)))


def test_cycles_of_a_sine_have_the_figures_it_was_made_with() -> None:
    table = Made(phase=0.02).table()
    assert len(table) == 10 and not any(table.why)
    assert table.column("t") == pytest.approx(HOLD + np.arange(10), abs=0.01)
    assert table.column("duration") == pytest.approx(1, rel=2e-3)
    assert table.column("peak_load") == pytest.approx(MEAN + AMPLITUDE, rel=2e-4)
    assert table.column("valley_load") == pytest.approx(MEAN - AMPLITUDE, rel=2e-3)
    assert table.column("range_strain") == pytest.approx(2 * AMPLITUDE / E, rel=1e-3)
    assert table.column("modulus") == pytest.approx(E / math.cos(0.02), rel=1e-3)
    assert table.column("phase") == pytest.approx(0.02, abs=2e-4)
    assert table.column("area") == pytest.approx(math.pi * AMPLITUDE**2 / E * math.sin(0.02), rel=0.02)


@pytest.mark.parametrize("bursts_hz", [7.3, 31.0])
def test_two_thirds_lie_within_one_sigma(bursts_hz: float) -> None:
    table = Made(
        n=1500, bursts_hz=bursts_hz, noise=20e-6, noise_Pa=2e4, phase=0.05, drift=3e-6, seed=1
    ).table()
    assert len(table) == 1500
    area = math.pi * AMPLITUDE**2 / E * math.sin(0.05)
    truths = {"modulus": E / math.cos(0.05), "phase": 0.05, "area": area, "range_strain": 2 * AMPLITUDE / E}
    for name, truth in truths.items():
        within = np.abs(table.column(name) - truth) < table.column(f"sigma_{name}")
        assert 0.66 < np.count_nonzero(within) / len(table) < 0.70, name


def test_a_stiffness_that_falls_is_followed() -> None:
    def softer(t: Floats) -> Floats:
        return np.asarray(1 - 0.1 * np.clip(np.floor(t - HOLD), 0, 19) / 19)

    load, bursts = Made(n=20).made()
    rng = np.random.default_rng(3)
    strain = bursts.strain / softer(bursts.t) + rng.normal(0, 5e-6, len(bursts.t))
    table = CycleTable.of([load], bursts._replace(strain=strain))
    modulus, sigma = table.column("modulus"), table.column("sigma_modulus")
    assert len(table) == 20
    truth = E * (1 - 0.1 * np.arange(20) / 19)
    assert np.all(np.abs(modulus - truth) < 3.5 * sigma)
    assert sigma.max() < 0.01 * E


def test_few_bursts_in_a_cycle_have_a_reason_and_no_number() -> None:
    table = Made(n=20, bursts_hz=4.7).table()
    assert len(table) == 20
    for name in ("modulus", "range_strain", "peak_strain", "area", "phase"):
        assert np.isnan(table.column(name)).all()
    assert all("aliasing" in why for why in table.why)
    assert table.column("range_load") == pytest.approx(2 * AMPLITUDE, rel=1e-3)


def test_six_bursts_are_enough_for_ranges_that_none_of_them_reach() -> None:
    made = Made(n=30, bursts_hz=6.3)
    table = made.table()
    assert np.isfinite(table.column("modulus")).all()
    assert table.column("range_strain") == pytest.approx(2 * AMPLITUDE / E, rel=2e-3)
    peaks = made.made()[1].strain[15:195].reshape(-1, 6).max(axis=1)
    assert peaks.min() < 0.97 * (MEAN + AMPLITUDE) / E


def test_long_bursts_do_not_stiffen() -> None:
    assert Made(width=0.2, bursts_hz=9).table().column("modulus") == pytest.approx(E, rel=2e-3)
    assert all("a burst lasts 30% of the cycle" in why for why in Made(width=0.3, bursts_hz=9).table().why)


def test_bursts_in_step_with_the_load_see_a_part_of_it() -> None:
    load, bursts = Made(n=6).made()
    table = CycleTable.of([load], bursts.part(np.abs((bursts.t % 1) - 0.5) < 0.22))
    assert len(table) == 6 and all("of the range of the load" in why for why in table.why)


@pytest.mark.parametrize(("rate", "share", "cut"), [(17.3, 0.02, 0.1), (100.0, 2e-3, 4e-3)])
def test_a_triangle(rate: float, share: float, cut: float) -> None:
    table = Made(wave=triangle, rate=rate).table()
    assert len(table) == 10
    assert table.column("modulus") == pytest.approx(E, rel=share)
    assert table.column("range_load") == pytest.approx(2 * AMPLITUDE, rel=cut)


def test_a_drift_over_the_cycle_does_not_change_the_modulus() -> None:
    table = Made(drift=20e-6).table()
    assert table.column("modulus") == pytest.approx(E, rel=1e-3)
    assert table.column("area") == pytest.approx(0, abs=10)


def test_the_secant_of_a_loop_that_bends_is_that_of_its_tips() -> None:
    load, bursts = Made(n=6, bursts_hz=40).made()
    s = (np.interp(bursts.t, load.t, load.values) - MEAN) / AMPLITUDE
    table = CycleTable.of([load], bursts._replace(strain=1e-3 * s + 3e-4 * s**3 + 1e-4 * s**2))
    assert table.column("modulus") == pytest.approx(AMPLITUDE / 1.3e-3, rel=1e-3)
    assert table.column("peak_strain") == pytest.approx(1.4e-3, rel=2e-3)


@pytest.mark.parametrize("each", [100.0, 0.5])
def test_a_pause_is_no_part_of_a_cycle(each: float) -> None:
    load, bursts = Made(n=16).made()
    t, at = (np.where(one > HOLD + 8, one + 30, one) for one in (load.t, bursts.t))
    still = np.arange(HOLD + 8.1, HOLD + 38, 0.1)
    load = Track(
        np.insert(t, np.searchsorted(t, still), still),
        np.insert(load.values, np.searchsorted(t, still), 10e6),
    )
    cycles = counted(load, bursts._replace(t=at), each)
    assert len(cycles) == 16 and max(one.duration for one in cycles) < 1.1
    assert [one.modulus for one in cycles] == pytest.approx([E] * 16, rel=2e-3)


def test_without_a_load_the_strain_turns() -> None:
    _, bursts = Made(noise=5e-6).made()
    table = CycleTable.of(None, bursts)
    assert len(table) == 10
    assert table.column("range_strain") == pytest.approx(2 * AMPLITUDE / E, abs=4e-5)
    assert np.isnan(table.column("modulus")).all() and set(table.why) == {"no force is known"}


def rising(t: Floats) -> Floats:
    return np.minimum(t, 60.0) * 2e6


PROGRAMMES: dict[str, Callable[[Floats], Floats]] = {
    "rest": lambda t: 0 * t,
    "tensile": rising,
    "tensile to the break": lambda t: np.where(t < 70, rising(t), 0.0),
    "creep": lambda t: np.minimum(t * 10e6, 100e6),
    "relaxation": lambda t: np.where(t < 10, t * 10e6, 80e6 + 20e6 * np.exp((10 - t) / 20)),
    "one unloading": lambda t: np.interp(t, [0, 30, 35, 40, 80], [0, 60e6, 1e6, 60e6, 140e6]),
}


def red(rng: np.random.Generator, n: int, share: float) -> Floats:
    """Noise of which a ``share`` of each value stays in the next; 1: a random walk."""
    from scipy.signal import lfilter

    return np.asarray(lfilter([1.0], [1.0, -share], rng.normal(0, 1e5, n)))


def tables(programme: str, share: float, seed: int) -> tuple[CycleTable, CycleTable]:
    """With a load, and of the strain alone."""
    rng = np.random.default_rng(seed)
    t, at = np.arange(0, 80, 0.02), np.arange(0, 80, 0.1)
    load = Track(t, PROGRAMMES[programme](t) + red(rng, len(t), share))
    bursts = BurstStrains(at, PROGRAMMES[programme](at) / E + red(rng, len(at), share) / E, 0 * at)
    return CycleTable.of([load], bursts), CycleTable.of(None, bursts)


@pytest.mark.parametrize("programme", PROGRAMMES)
@pytest.mark.parametrize("share", [0.0, 0.9])
def test_other_tests_have_no_cycles(programme: str, share: float) -> None:
    for seed in range(10):
        assert [len(one) for one in tables(programme, share, seed)] == [0, 0], seed


@pytest.mark.parametrize("share", [0.0, 0.8, 0.95, 1.0])
def test_noise_that_turns_at_random_makes_no_cycles(share: float) -> None:
    """White noise never; of noise with a memory one record in a hundred may be regular by chance."""
    found = [len(one) > 0 for seed in range(100) for one in tables("rest", share, seed)]
    assert sum(found) <= (0 if share == 0 else 2)


def test_noise_in_a_cyclic_test_makes_no_more_cycles() -> None:
    assert len(Made(n=50, noise=60e-6, noise_Pa=3e6).table()) == 50


def test_a_load_cell_at_its_limit_cuts_peaks_and_leaves_no_modulus() -> None:
    load, bursts = Made(noise=2e-6, noise_Pa=3e4).made()
    cut = CycleTable.of([Track(load.t, np.minimum(load.values, 85e6))], bursts)
    assert len(cut) == 10 and all("a load cell at its limit" in why for why in cut.why)
    assert np.isnan(cut.column("modulus")).all()


@pytest.mark.parametrize("step", [1e5, 2e6])
def test_a_load_that_is_held_at_its_peak_is_not_cut(step: float) -> None:
    """A dwell that a quiet load cell shows as equal readings."""
    made = Made(noise=2e-6, wave=lambda theta: np.clip(1.4 * np.cos(theta), -1, 1))
    load, bursts = made.made()
    shown = Track(load.t, np.rint(load.values / step) * step)
    assert not any(CycleTable.of([shown], bursts).why)
    sine, bursts = Made(noise=2e-6).made()
    assert not any(CycleTable.of([Track(sine.t, np.rint(sine.values / step) * step)], bursts).why)


@pytest.mark.parametrize("wrong", [0.0, 99999e6])
def test_a_wrong_reading_now_and_then_is_neither_a_cycle_nor_a_peak(wrong: float) -> None:
    """Each 37th reading has the value that an indicator sends where it has none."""
    load, bursts = Made().made()
    load.values[36::37] = wrong
    found, sound = CycleTable.of([load], bursts), Made().table()
    assert len(found) == len(sound)
    assert found.column("peak_load") == pytest.approx(sound.column("peak_load"), rel=2e-3)
    ramp = np.linspace(0, 200e6, len(load.t))
    ramp[36::37] = wrong
    assert (
        len(CycleTable.of([Track(load.t, ramp)], BurstStrains(bursts.t, bursts.t * 1e-4, bursts.width))) == 0
    )


def counted(load: Track, bursts: BurstStrains, each: float) -> list[Cycle]:
    """The cycles of a test that comes in pieces of ``each`` seconds."""
    counter, found = CycleCounter(loaded=True), list[Cycle]()
    for since in np.arange(0, load.t[-1] + each, each):
        a, b = (np.s_[slice(*np.searchsorted(t, (since, since + each)))] for t in (load.t, bursts.t))
        found += counter.add(Track(load.t[a], load.values[a]), bursts.part(b))
    found += counter.add(Track(load.t[:0], load.t[:0]), bursts.part(slice(0)), ended=True)
    assert counter.is_cyclic
    return found


@pytest.mark.parametrize("each", [0.05, 0.7, 5.0])
def test_cycles_that_come_in_pieces_are_the_same(each: float) -> None:
    made = Made(noise=5e-6, noise_Pa=1e5)
    whole, pieces = made.table(), counted(*made.made(), each)
    assert [one.number for one in pieces] == [*range(1, len(pieces) + 1)]
    for one, values in zip(pieces, whole.values, strict=True):
        assert one.modulus == pytest.approx(values[14], abs=0.3 * values[15])


def test_a_count_begins_anew_where_the_cycles_before_were_small() -> None:
    t = np.arange(0, 40, 0.01)
    load = Track(t, np.where(t < 20, 1e6, 50e6) * np.sin(2 * np.pi * t))
    at = np.arange(0, 40, 0.05)
    table = CycleTable.of([load], BurstStrains(at, np.interp(at, t, load.values) / E, 0 * at))
    assert 19 <= len(table) <= 20 and table.column("range_load").min() > 50e6


def test_memory_does_not_grow() -> None:
    counter, t = CycleCounter(loaded=True), np.arange(20_000) / 1000
    for k in range(20):
        counter.add(
            Track(20 * k + t, 1e6 * (20 * k + t)), BurstStrains(20 * k + t[::100], t[::100], 0 * t[::100])
        )
    assert len(counter._load.t) < 40_000
