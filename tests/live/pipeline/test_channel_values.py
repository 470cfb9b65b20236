"""The channels of alarms and strain output: each has the value and the unit that its name says."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from acquire.load_sample import LoadSample
from analysis.evaluate import GaugeValue
from live.config.figures import CYCLE_CHANNELS, MEASURED_CHANNELS
from live.config.sections import SpecimenConfig
from live.pipeline.channel_values import ChannelValues
from live.pipeline.measurement import Measurement
from live.pipeline.run_state import RunState
from tests.live.made_up import START, make_measurement


def values() -> ChannelValues:
    """Of a test of 40 mm^2 with 800 N on it."""
    run_state = RunState.new(1.0, specimen=SpecimenConfig(axis="y", area_mm2=40.0))
    run_state.health.state = "REC"
    run_state.loads.append(LoadSample(START, 800.0))
    return ChannelValues(START, run_state.snapshot, lambda: {"more": 7.0}, lambda: START + 0.3)


def at(t: float, axial: float) -> Measurement:
    """A measurement ``t`` s after the start."""
    m = make_measurement(0)
    return replace(m, time_step=replace(m.time_step, t=START + t, eyy=axial))


def test_every_channel_has_the_value_of_its_name() -> None:
    m = make_measurement(2)
    step = replace(
        m.time_step,
        n_valid=3, n_zoi=4, exx=-3e-4, eyy=1e-3, exy=2e-5, sigma_eyy=4e-6, largest=2e-3, latency_s=0.016,
        noise_GL=1.5, gauges={"left": GaugeValue(5e-4, 6e-6, "", 0.5)},
    )  # fmt: skip
    read = values().read(replace(m, time_step=step))
    assert set(read) == {*MEASURED_CHANNELS, "gauge_left", "sigma_gauge_left", "more"}
    assert math.isnan(read.pop("strain_rate"))
    assert [math.isnan(read.pop(name)) for name in CYCLE_CHANNELS] == [True] * 5
    assert (read.pop("age_s"), read.pop("force_age_s")) == (pytest.approx(0.1), pytest.approx(0.3))
    wanted = {
        "time_s": 0.2, "frame": 16, "axial": 1e-3, "sigma_axial": 4e-6, "force_N": 800.0, "stress_MPa": 20.0,
        "exx": -3e-4, "eyy": 1e-3, "exy": 2e-5, "largest": 2e-3, "lost_share": 0.25, "latency_s": 0.016,
        "noise_GL": 1.5, "gauge_left": 5e-4, "sigma_gauge_left": 6e-6, "more": 7.0,
    }  # fmt: skip
    assert {name: read[name] for name in wanted} == pytest.approx(wanted)


def test_the_rate_needs_three_instants_and_looks_back_a_second() -> None:
    """Still, and from 1 s on at 1e-3 a second."""
    asked = values()
    rates = [asked.read(at(k / 4, 1e-3 * max(k / 4 - 1, 0)))["strain_rate"] for k in range(13)]
    assert math.isnan(rates[0]) and math.isnan(rates[1])
    assert rates[2:5] == pytest.approx([0.0, 0.0, 0.0], abs=1e-15)
    assert 0 < rates[5] < rates[6] < rates[7] < 1e-3
    assert rates[8:] == pytest.approx([1e-3] * 5)


def test_of_slow_measurements_three_make_a_rate_and_a_lost_one_has_none() -> None:
    asked = values()
    rates = [asked.read(at(t, 2e-4 * t))["strain_rate"] for t in (0.0, 5.0, 10.0, 20.0)]
    assert rates[2:] == pytest.approx([2e-4, 2e-4])
    assert math.isnan(asked.read(at(25.0, math.nan))["strain_rate"])
    assert asked.read(at(30.0, 6e-3))["strain_rate"] == pytest.approx(2e-4), "the lost one is left out"
    assert asked.read(at(30.0, 6e-3))["strain_rate"] == pytest.approx(2e-4), "the same again counts once"
