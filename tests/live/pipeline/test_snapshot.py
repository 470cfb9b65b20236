"""The state of a test is the same in every display, and channels have the value and the unit that their names say."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from acquire.load_sample import LoadSample
from analysis.evaluate import GaugeValue
from live.config.figures import CYCLE_CHANNELS, MEASURED_CHANNELS
from live.config.loading import load_config
from live.config.sections import SpecimenConfig
from live.pipeline.measurement import Measurement, TimeStep
from live.pipeline.run_state import RunState
from live.pipeline.snapshot import ChannelValues, Snapshot, peak_force
from live.results.summary import StatusCard
from live.ui.terminal.screen import status_line
from live.ui.web.broadcaster import Broadcaster, json_bytes
from live.ui.web.page_consumer import PageConsumer
from tests.live.made_up import START, in_ascii, make_measurement
from tests.live.screens import StatedRun


def time_step(**more: Any) -> TimeStep:
    return replace(make_measurement(0).time_step, **more)


def loaded(*forces: float, axis: str = "y") -> RunState:
    """A test with these forces, one a second."""
    run_state = RunState.new(1.0, specimen=SpecimenConfig(axis=axis, area_mm2=40.0))
    run_state.health.state, run_state.health.began_t = "REC", 0.0
    for t, force in enumerate(forces):
        run_state.loads.append(LoadSample(t, force))
        run_state.health.loaded(t, force)
    return run_state


def on_the_page(run_state: RunState) -> dict[str, Any]:
    page = PageConsumer(Broadcaster(), load_config(None, {"specimen.area_mm2": 40.0}), lambda: 5.0)
    page.attach(StatedRun(run_state))
    return page.state()


@pytest.mark.parametrize(
    ("forces", "peak"),
    [
        ((10.0, 5000.0, 4000.0), 5000.0),
        ((-10.0, -5000.0, -4000.0), -5000.0),
        ((20.0, -5000.0, 300.0), -5000.0),
        ((-20.0, math.nan, 300.0, math.inf, -299.0), 300.0),
    ],
)
def test_the_peak_in_tension_and_compression_is_one_on_page_and_status_line(
    forces: tuple[float, ...], peak: float
) -> None:
    run_state = loaded(*forces)
    assert run_state.snapshot(5.0).peak_N == on_the_page(run_state)["peak_N"] == peak
    assert f"  peak {peak:.1f} N" in in_ascii(status_line(run_state.snapshot(5.0), 200))


def test_before_the_first_force_there_is_no_peak() -> None:
    assert math.isnan(peak_force(math.nan, math.nan))
    assert "peak" not in status_line(loaded().snapshot(5.0), 200)
    assert peak_force(math.nan, 0.0) == 0.0


def test_the_latency_on_page_and_status_line_is_that_of_the_monitor() -> None:
    run_state = loaded(1.0)
    run_state.health.latency_p95_s = 0.042
    run_state.history.add(time_step(latency_s=9.0, t=4.0))
    facts = {one["label"]: one["amount"].value for one in on_the_page(run_state)["facts"]}
    assert facts["delay"] == 0.042
    assert "  delay 42 ms" in status_line(run_state.snapshot(5.0), 200)


def test_the_snapshot_of_a_run() -> None:
    run_state = loaded(800.0, 900.0)
    run_state.frame_counts.add(grabbed=5, lost=2, unrecorded=1)
    run_state.alarms.set("a", "a: too much")
    i = time_step(eyy=1e-3, sigma_eyy=2e-6, t=2.0)
    run_state.history.add(i)
    now = run_state.snapshot(2.5)
    force, stress, axial = (now.figure(name) for name in ("force", "stress", "axial"))
    assert (now.elapsed_s, force.value, stress.value) == (2.5, 900.0, pytest.approx(900 / 40e-6))
    assert (force.age, force.state, stress.state) == (1.5, "live", "live")
    assert (now.axial_name, axial.value, axial.sigma) == ("eyy", 1e-3, pytest.approx(2e-6))
    assert (now.valid, now.zois, now.lost) == (i.n_valid, i.n_zoi, 3)
    assert now.alarms == ("a: too much",) and now.time_step is not None and now.time_step.t == i.t
    run_state.frame_counts.add(lost=5)
    assert now.lost == 3, "what came later is not in it"


def test_in_a_replay_the_force_is_that_of_the_instant() -> None:
    run_state = loaded(800.0)
    run_state.health.state = ""
    assert run_state.snapshot(0.0).figure("force").state == "not yet"
    now = run_state.snapshot(1.0, time_step(force=123.0))
    assert (now.state, now.figure("force").value) == ("REPLAY", 123.0)


@pytest.mark.parametrize(("axis", "mean"), [("x", "exx"), ("y", "eyy")])
def test_axial_is_the_gauge_of_that_name_or_else_the_mean_along_the_load(axis: str, mean: str) -> None:
    run_state, plain = loaded(axis=axis), time_step(exx=1e-3, sigma_exx=1e-6, eyy=2e-3, sigma_eyy=2e-6)
    now = run_state.snapshot(0.0, plain)
    axial = now.figure("axial")
    assert (now.axial_name, axial.value, axial.sigma) == (
        mean,
        getattr(plain, mean),
        getattr(plain, f"sigma_{mean}"),
    )
    lost = run_state.snapshot(0.0, replace(plain, gauges={"axial": GaugeValue(math.nan, math.nan, "lost")}))
    assert lost.axial_name == "axial" and lost.figure("axial").why == "lost", (
        "a lost gauge is not replaced by the mean"
    )
    other = run_state.snapshot(0.0, replace(plain, gauges={mean: GaugeValue(0.5, 0.1)}))
    assert other.figure("axial").value == getattr(plain, mean), (
        "a gauge that has the name of a mean is a gauge like others"
    )


def test_before_anything_is_measured_the_page_can_be_told() -> None:
    page = PageConsumer(Broadcaster(), load_config(None, {}), lambda: 5.0)
    assert page.state()["state"] == "opening" and page.state()["elapsed_s"] == 0.0
    assert Snapshot(0.0).figure("axial").state == "none"
    assert json_bytes(on_the_page(loaded(1.0)))


def test_an_axis_that_is_only_assumed_shows_everywhere() -> None:
    """The axis was silently y, where the picture's load ran along x."""
    still = time_step(exx=1e-6, eyy=0.0, exy=0.0)
    for axis, assumed in (("auto", True), ("x", False)):
        run_state = loaded(100.0, axis=axis)
        run_state.history.add(still)
        assert run_state.snapshot(5.0).axis_assumed is assumed
        assert ("axis y assumed" in status_line(run_state.snapshot(5.0), 300)) is assumed
        assert on_the_page(run_state)["axial"]["assumed"] == ("axis assumed" if assumed else "")
        card = StatusCard(run_state.specimen, run_state.loads).written(
            run_state.snapshot(5.0), run_state.history
        )
        assert ("axis of the load **y**, assumed" in card) is assumed
    pulled = loaded(100.0, axis="auto")
    pulled.history.add(time_step(exx=24_812e-6, eyy=-7_236e-6, exy=0.0))
    assert not pulled.snapshot(5.0).axis_assumed and pulled.snapshot(5.0).axis == "x"


def values() -> ChannelValues:
    """Of a test of 40 mm^2 with 800 N on it."""
    run_state = RunState.new(1.0, specimen=SpecimenConfig(axis="y", area_mm2=40.0))
    run_state.health.state = "REC"
    run_state.loads.append(LoadSample(START, 800.0))
    return ChannelValues(
        START, run_state, SimpleNamespace(read=lambda start: {"more": 7.0}), lambda: START + 0.3
    )


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
    assert math.isnan(read.pop("strain_rate")) and math.isnan(read.pop("sigma_strain_rate"))
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


def test_the_sigma_of_the_rate_is_that_of_the_scatter() -> None:
    rng, asked, step = np.random.default_rng(3), values(), 1 / 30
    read = [asked.read(at(k * step, 2e-5 * k * step + rng.normal(0, 5e-6))) for k in range(3000)]
    off = [(one["strain_rate"] - 2e-5) / one["sigma_strain_rate"] for one in read[40::31]]
    assert np.std(off) == pytest.approx(1.0, abs=0.15) and len(off) > 90
    usual = np.median([one["sigma_strain_rate"] for one in read[40:]])
    assert usual == pytest.approx(5e-6 / math.sqrt(31 * (31**2 - 1) / 12) / step, rel=0.03)


def test_of_slow_measurements_three_make_a_rate_and_a_lost_one_has_none() -> None:
    asked = values()
    rates = [asked.read(at(t, 2e-4 * t))["strain_rate"] for t in (0.0, 5.0, 10.0, 20.0)]
    assert rates[2:] == pytest.approx([2e-4, 2e-4])
    assert math.isnan(asked.read(at(25.0, math.nan))["strain_rate"])
    assert asked.read(at(30.0, 6e-3))["strain_rate"] == pytest.approx(2e-4), "the lost one is left out"
    assert asked.read(at(30.0, 6e-3))["strain_rate"] == pytest.approx(2e-4), "the same again counts once"
