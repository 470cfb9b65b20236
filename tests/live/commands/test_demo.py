"""The demo: its truth, its comparison, and its exit code."""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from acquire.addresses import parse_address
from acquire.errors import Interrupted
from acquire.load_sample import LoadSample
from analysis import PICTURE_KINDS, Roi, ZoiGrid
from analysis.evaluate import Figure
from hw_mocks.specimen import specimen_from
from live.cli import main
from live.commands import demo
from live.commands.demo import MeansCollector, ZoiTruth, middle_of
from live.config.loading import load_config
from live.pipeline.run_state import RunState
from live.results.figures import evaluate
from tests.live.made_run import finished
from tests.live.made_up import START, make_grid, make_measurement
from tests.live.screens import RecordingScreen

SHORT = ["--seconds", "2", "--fps", "10", "--reference-burst", "2", "--burst", "2", "--step", "64"]


@pytest.mark.parametrize(("agreed", "code"), [pytest.param(True, 5, marks=pytest.mark.slow), (False, 1)])
def test_without_a_modulus_it_says_so(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    agreed: bool,
    code: int,
) -> None:
    """As on a busy machine, which measures few bursts of the elastic part; it ended with 0."""
    monkeypatch.setattr(demo, "_print_strain", lambda *values: agreed)
    words = ["demo", *SHORT, "--no-view", "--no-rrd", "--out", str(tmp_path / "out")]
    assert main(words) == code
    output = capsys.readouterr().out
    assert "E is not known: " in output and "E  not known, true 70 GPa" in output
    assert ("exit code 5: E was not measured (" in output) is agreed


def test_it_compiles_what_every_kind_of_picture_needs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What that spares the next commands: test_compiled_once.py."""
    asked: list[tuple[object, object]] = []

    def compile_ahead(kinds: object, *, phase: bool, screen: object) -> None:
        asked.append((kinds, phase))
        raise Interrupted("enough")

    monkeypatch.setattr(demo, "compile_ahead", compile_ahead)
    assert main(["demo", "--out", str(tmp_path / "out")]) == 130
    assert asked == [(PICTURE_KINDS, True)]


class Stretched:
    """A specimen of uniform gradients that grow with time."""

    yield_s, E, nu = 5.0, 70e9, 0.3

    def displacement(self, x: np.ndarray, y: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray]:
        return t * (3 + 1e-3 * x + 2e-3 * y), t * (-1 + 4e-3 * x + 5e-3 * y)

    def axial_strain(self, t: np.ndarray) -> np.ndarray:
        return np.maximum(t - 1.0, 0.0) * 1e-3

    def elapsed(self, t: float) -> float:
        return t - START

    def force(self, t: np.ndarray) -> np.ndarray:
        return 100.0 * np.asarray(t)


def test_the_truth_of_a_zoi_is_the_plane_through_what_is_prescribed() -> None:
    grid = ZoiGrid.cover(Roi(10, 20, 80, 64), size=32, step=16)
    truth = ZoiTruth(Stretched(), grid, (100, 50))  # type: ignore[arg-type]
    exx, eyy, exy = truth.strains(2.0)
    assert exx.shape == grid.shape
    np.testing.assert_allclose(exx, 2e-3)
    np.testing.assert_allclose(eyy, 10e-3)
    np.testing.assert_allclose(exy, 6e-3)
    u, *_, _, _ = truth._parameters(1.0)
    x, y = np.meshgrid(grid.x + 100, grid.y + 50)
    np.testing.assert_allclose(u, 3 + 1e-3 * x + 2e-3 * y, rtol=1e-9)
    some = np.zeros(grid.shape, bool)
    some[1:, :2] = True
    assert truth.region(2.0, some) == pytest.approx((2e-3, 10e-3, 6e-3), rel=1e-5)
    assert all(math.isnan(value) for value in truth.region(2.0, np.zeros(grid.shape, bool)))


def test_a_zoi_sees_a_curved_field_by_its_weight() -> None:
    """The mean of the square of the distance is that of a Gaussian that ends at three sigma."""

    class Curved(Stretched):
        def displacement(self, x: np.ndarray, y: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray]:
            return (x - 25.5) ** 2 + 0 * y, 0 * x

    grid = ZoiGrid.cover(Roi(10, 20, 32, 32), size=32, step=16)
    place = np.arange(32) - 15.5
    weight = np.exp(-(place**2) / (2 * (32 / 6) ** 2))
    u, du_dx, *_ = ZoiTruth(Curved(), grid)._parameters(0.0)  # type: ignore[arg-type]
    assert u[0, 0] == pytest.approx(np.sum(weight * place**2) / weight.sum()) and du_dx[
        0, 0
    ] == pytest.approx(0)


def test_the_middle_of_a_burst_in_which_the_ramp_begins() -> None:
    times = np.array([0.0, 1.0, 2.0, 3.0])
    assert middle_of(Stretched(), times) == pytest.approx(1.75)  # type: ignore[arg-type]
    assert middle_of(Stretched(), times - 5) == pytest.approx(-3.5)  # type: ignore[arg-type]
    assert middle_of(Stretched(), times + 5) == pytest.approx(6.5)  # type: ignore[arg-type]


def test_what_the_demo_keeps_of_a_measurement() -> None:
    collector, m = MeansCollector(), make_measurement(3, 2e-3)
    collector.measurement(m)
    (kept,) = collector.measurements
    np.testing.assert_allclose(kept.times, m.t + np.linspace(-0.035, 0.035, 8))
    assert kept.mean == pytest.approx((-6e-4, 2e-3, 0.0), abs=1e-12)
    step = m.time_step
    assert kept.sigma == (step.sigma_exx, step.sigma_eyy, step.sigma_exy) and kept.valid.sum() == 33


@pytest.mark.parametrize(
    ("within", "beyond", "agreed"), [(100, 0, True), (98, 0, True), (96, 0, False), (100, 1, False)]
)
def test_ninety_seven_percent_must_agree_and_none_may_be_far_off(
    within: int, beyond: int, agreed: bool
) -> None:
    ratios, screen = np.full((100, 2, 3), 0.5), RecordingScreen()
    lines = screen.lines
    ratios[within:, 0] = 1.01
    ratios[:beyond, 1, 0] = 1.01
    errors = np.tile([3e-6, -4e-6, 0.0], (100, 1))
    assert demo._print_strain(ratios, errors, screen) is agreed
    assert "error 3.00, 4.00, 0.00 µm/m rms in 100 instants" in lines[0]
    assert (
        f"{within:.1f}% of these 300 values within 0.05% of the strain + 3 sigma, {beyond} beyond" in lines[1]
    )
    ratios[0, 1, 0] = math.nan
    assert demo._print_strain(ratios, errors, screen) is False
    assert demo._print_strain(np.zeros(0), np.zeros(0), screen) is False
    assert lines[-1].endswith("no instant of the elastic part was measured")


def test_the_demo_compares_the_elastic_part_with_its_truth() -> None:
    state, screen = RunState.new(1.0), RecordingScreen()
    lines = screen.lines
    for t in (1.0, 2.0):
        state.loads.append(LoadSample(START + t, 100.0 * t + (3.0 if t > 1 else 1.0)))
    state.loads.append(LoadSample(START + 3.0, math.nan))
    state.loads.close()
    grid = make_grid()
    outcome: Any = SimpleNamespace(
        rig=SimpleNamespace(specimen=Stretched()), grid=grid, run_state=state, exit_code=0
    )
    collector = MeansCollector()

    def measured(t: float, off: float, sigma: float = 1e-6) -> Any:
        times = START + t + np.array([-0.1, 0.1])
        truth = np.array([1e-3, 5e-3, 3e-3]) * t
        return demo.MeasuredMeans(
            times, None, np.ones(grid.shape, bool), tuple(truth * (1 + off)), (sigma,) * 3
        )  # type: ignore[arg-type]

    collector.measurements = [measured(2.0, 0.0), measured(4.0, 4e-4), measured(4.95, 5.0)]  # the last yields
    config = load_config(None, {"specimen.area_mm2": 40.0})
    outcome.test = finished(state, config.specimen)
    code = demo.compare(outcome, collector, config, screen)
    assert code == 5 and any("exit code 5: E was not measured" in line for line in lines)
    assert any("100.0% of these 6 values" in line for line in lines)
    assert "  force: mean error 2 N, scatter 1 N in 2 samples" in lines
    assert any(line.endswith("true 70 GPa") for line in lines) and any(
        line.endswith("true 0.3") for line in lines
    )
    collector.measurements = [measured(2.0, 0.01)]
    assert demo.compare(outcome, collector, config, screen) == 1
    collector.measurements, outcome.exit_code = [measured(2.0, 0.0)], 130
    assert demo.compare(outcome, collector, config, screen) == 0
    outcome.exit_code, outcome.run_state = 0, RunState.new(1.0)
    assert demo.compare(outcome, MeansCollector(), config, screen) == 5, "a machine too slow to measure"


def test_the_rig_of_the_demo() -> None:
    arguments = argparse.Namespace(specimen="hole", fps=None, **{"output.seconds": None})
    given = demo._defaults(arguments)
    address = "sim:hole?bits=12&fps=auto&buffers=64&section_mm2=40&waits=yes&hold=120&seconds=137"
    assert given["camera.address"] == address
    assert (given["specimen.width_mm"], given["specimen.thickness_mm"], given["load.address"]) == (
        20.0,
        2.0,
        "sim:",
    )
    arguments = argparse.Namespace(specimen="hole", fps=12.5, **{"output.seconds": 7.0})
    assert "fps=12.5&" in demo._defaults(arguments)["camera.address"]
    assert demo._defaults(arguments)["camera.address"].endswith("&waits=yes&hold=3.5&seconds=7")


class MachineOf:
    """A machine that measures a burst every ``period_s``, ``late_s`` after its frames at first and later and later."""

    def __init__(self, kind: str, seconds: float | None = None) -> None:
        address = demo._defaults(argparse.Namespace(specimen=kind, fps=None, **{"output.seconds": seconds}))[
            "camera.address"
        ]
        self.specimen = specimen_from(parse_address(address))
        self.specimen.clock.begin(START)
        self.now = START
        self.operator = demo.Operator(seconds, lambda: self.now)
        self.operator.operate(self.specimen, 10.0)

    def measure(self, number: int, t: float, now: float) -> None:
        self.now = now
        m = make_measurement(number, 0.0)
        self.operator.measurement(replace(m, burst=replace(m.burst, t=t)))


@pytest.mark.parametrize("kind", demo.SPECIMENS)
@pytest.mark.parametrize(
    ("taken_s", "measured_s", "lasts_s"),
    [
        (0.1, 0.1, 17.0),  # a fast machine: the test is as long as ever
        (0.8, 0.8, 56 * 0.8 / 0.6),
        (0.1, 0.9, 56 * 0.9 / 0.6),  # the camera keeps its rate, the kernel does not
        (0.9, 0.1, 56 * 0.9 / 0.6),  # bursts that waited for the kernel come all at once
        (5.0, 5.0, 150.0),
    ],
)
def test_the_rig_pulls_so_slowly_that_forty_bursts_are_elastic(
    kind: str, taken_s: float, measured_s: float, lasts_s: float
) -> None:
    machine = MachineOf(kind)
    assert machine.specimen.duration_s == 137.0
    for k in range(6):
        assert machine.specimen.programme.pull is not None and machine.specimen.programme.pull.told is None
        machine.measure(k, START + 10 + taken_s * k, START + 11 + measured_s * k)
    begins, yields, ends = machine.specimen.programme.knots_s
    assert begins == pytest.approx(11 + 5 * measured_s + 0.5 + 0.1) and ends - begins == pytest.approx(
        lasts_s
    )
    assert machine.specimen.yield_s == pytest.approx(yields)
    bursts = (yields - begins) / max(taken_s, measured_s)
    assert bursts >= 40 or lasts_s == 150.0
    machine.measure(7, START + 100, START + 100)  # told once
    assert machine.specimen.programme.knots_s == (begins, yields, ends)
    assert float(machine.specimen.axial_strain(begins)) == 0.0
    assert float(machine.specimen.programme.strain(ends)) == pytest.approx(8e-3)


def test_a_test_of_a_given_length_is_pulled_in_what_is_left_of_it() -> None:
    machine = MachineOf("uniform", 20.0)
    machine.measure(0, START + 3, START + 4)
    begins, _, ends = machine.specimen.programme.knots_s
    assert (begins, ends) == pytest.approx((4.6, 19.0)) and machine.specimen.duration_s == pytest.approx(20.0)


@pytest.mark.parametrize(("fps", "width"), [(4.9, "320"), (5.0, None), (30.0, None)])
def test_the_picture_is_as_large_as_the_machine_renders(
    fps: float, width: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hw_mocks.sim_camera.fps_on_this_machine", lambda address: fps)
    auto, given = (
        load_config(None, {"camera.address": f"sim:hole?fps={rate}&bits=12", "load.address": "sim:"})
        for rate in ("auto", "10")
    )
    settings = dict(parse_address(demo.fitting(auto).camera.address).settings)
    assert settings.get("width") == width and settings.get("hole") == (width and "30")
    assert demo.fitting(auto).load.address == ("sim:?rate=20" if width else "sim:")
    assert demo.fitting(given) == given


def figures_of(modulus: Figure) -> Any:
    known = evaluate(RunState.new(1.0).history, RunState.new(1.0).loads, load_config(None, {}).specimen)
    return replace(known, E=modulus, elastic_strain="eyy of the region")


@pytest.mark.parametrize(
    ("value", "agrees", "words"),
    [
        (61.4, True, "within its interval"),
        (62.4, True, "off by 2.0 times"),
        (63.4, False, "off by 4.0 times"),
    ],
)
def test_the_modulus_is_held_against_that_of_what_was_measured(
    value: float, agrees: bool, words: str
) -> None:
    """The strain of a region with a hole in it is larger than that of the material: 61.4 GPa are right there."""
    screen, specimen = RecordingScreen(), MachineOf("hole").specimen
    lines = screen.lines
    modulus = Figure(value * 1e9, (value - 0.5) * 1e9, (value + 0.5) * 1e9)
    assert demo._print_modulus(figures_of(modulus), specimen, (61.4e9, 0.327), screen) is agrees
    assert words in lines[0] and "true 61.4 GPa there" in lines[0] and "true 0.327 there" in lines[1]
