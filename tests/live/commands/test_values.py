"""Commands by value: outputs of a test and their channels, its view, and the truth of the demo."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from acquire.clock import ClockPair
from acquire.errors import ConfigError
from acquire.load_sample import LoadSample
from acquire.serial_line.ports import LineSettings
from analysis import Roi, ZoiGrid
from live.commands import consumers, demo
from live.commands.consumers import OUTPUT_NAME, signals_of
from live.commands.demo import MeansCollector, ZoiTruth, middle_of
from live.config.loading import Config, load_config
from live.pipeline.run_state import RunState
from live.pipeline.screen import Screen
from live.results.sides.channels import JointChannels
from tests.live.made_run import UTC_START
from tests.live.made_up import CAMERA, START, make_grid, make_measurement

LINE = {"gauges.mid": {"kind": "line", "start": [20, 20], "end": [20, 70]}}


class Said(Screen):
    """Keeps the lines."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def print(self, text: str = "") -> None:
        self.lines.append(text)


# -- outputs of a test ----------------------------------------------------------------------------


class Out:
    """A strain output that only keeps what it was made of."""

    name, ended = "an output", False

    def __init__(self, *made: Any) -> None:
        self.made = made

    def end(self) -> str:
        self.ended = True
        return ""


def about(config: Config, **more: Any) -> Any:
    known = {"config": config, "start": ClockPair(START, UTC_START), "end": lambda reason: None, "camera": CAMERA,
             "grid": make_grid(), "folder": Path("run")}  # fmt: skip
    return SimpleNamespace(**{**known, **more})


def test_no_outputs_of_a_replay() -> None:
    config = load_config(None, {"strain_out.udp": "127.0.0.1:5005"})
    assert signals_of(about(config, end=None), RunState.new(1.0), Said(), None) == []


def test_each_output_is_opened_at_its_address(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("UdpOut", "SerialOut", "TcpOut"):
        monkeypatch.setattr(consumers, name, Out)
    monkeypatch.setattr(
        "live.config.listen_address.ListenAddress.listen", lambda self, name: (name, self.port)
    )
    given = {"strain_out.udp": "127.0.0.1:5005", "strain_out.serial": "/dev/ttyUSB1?baud=9600",
             "strain_out.tcp": "127.0.0.1:5006", **LINE}  # fmt: skip
    screen = Said()
    found: list[Any] = list(signals_of(about(load_config(None, given)), RunState.new(1.0), screen, None))
    tcp, udp, serial = found
    assert (tcp.made[0], tcp.made[1]) == ((OUTPUT_NAME, 5006), "")
    assert udp.made[:2] == ("127.0.0.1", 5005)
    assert serial.made[0] == LineSettings("/dev/ttyUSB1", 9600) and screen.lines == ["an output"] * 3
    usual = signals_of(
        about(load_config(None, {"strain_out.serial": "/dev/ttyUSB1"})), RunState.new(1.0), Said(), None
    )
    assert usual[0].made[0] == LineSettings("/dev/ttyUSB1", 115200)  # type: ignore[attr-defined]


def test_an_output_that_fails_closes_those_before(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Out] = []
    monkeypatch.setattr(consumers, "UdpOut", lambda *given: made.append(Out(*given)) or made[-1])  # type: ignore[func-returns-value]
    given = {"strain_out.udp": "127.0.0.1:5005", "strain_out.serial": "/dev/ttyUSB1?bauds=9600"}
    with pytest.raises(ConfigError):
        signals_of(about(load_config(None, given)), RunState.new(1.0), Said(), None)
    assert [one.ended for one in made] == [True]


def test_the_channels_of_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Any] = []
    monkeypatch.setattr(consumers, "LineFormat", lambda *given: made.append(given))
    state = RunState.new(1.0)
    consumers._lines(about(load_config(None, LINE)), state, None)
    consumers._lines(about(load_config(None, LINE)), state, JointChannels())
    consumers._lines(about(load_config(None, {"strain_out.channels": ["force_N", "eyy"]})), state, None)
    plain, joint, chosen = (given[1] for given in made)
    assert plain == (*consumers.DEFAULT_CHANNELS, "gauge_mid", "sigma_gauge_mid")
    assert joint[: len(plain)] == plain and {"mean_axial", "bending_gauge_mid"} <= set(joint)
    assert tuple(chosen) == ("force_N", "eyy")


def test_alarms_see_the_machine_and_both_sides(monkeypatch: pytest.MonkeyPatch) -> None:
    config, state = load_config(None, {"alarm": [{"channel": "axial", "above": 0.01}]}), RunState.new(1.0)
    machine = lambda self, now: {"disk_min": now, "mean_axial": 0.0}  # noqa: E731
    monkeypatch.setattr(type(state.health), "channels", machine)
    made: list[Any] = []
    monkeypatch.setattr(consumers, "AlarmWatch", lambda *given, **more: made.append((given, more)))

    class Joint(JointChannels):
        lost = "why"  # type: ignore[assignment]

        def read(self, start: float) -> dict[str, float]:
            return {"mean_axial": start}

    for joint in (None, Joint()):
        signals_of(about(config), state, Said(), joint)
    (alone, nothing), (both, more) = made
    assert len(alone[0]) == len(both[0]) == 1 and not nothing
    assert alone[2](5.0) == {"disk_min": 5.0, "mean_axial": 0.0}
    assert both[2](5.0) == {"disk_min": 5.0, "mean_axial": START} and more["lost"]() == "why"
    assert both[3:] == alone[3:] == (state.alarms, state.event_log)


def test_the_view_of_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Any] = []
    monkeypatch.setattr(consumers, "View", lambda setup, **more: made.append((setup, more)))
    given = {**LINE, "specimen.area_mm2": 40.0, "specimen.axis": "x", "view.light": True, "view.rrd": True,
             "load.address": "none:", "view.strain_range": 0.02, "view.scale": "automatic"}  # fmt: skip
    consumers._view(about(load_config(None, given)), RunState.new(1.0), Said())
    usual = {"load.address": "sim:", "view.port": 9999, "view.rrd": False}
    consumers._view(about(load_config(None, usual)), RunState.new(1.0), Said())
    (light, more), (plain, other) = made
    assert (light.width, light.height, light.bits, light.start_monotonic) == (128, 96, 12, START)
    assert (light.area_m2, light.axis, light.strain_range, light.scale) == (
        pytest.approx(40e-6),
        "x",
        0.02,
        "automatic",
    )
    assert (light.picture_hz, light.light, light.with_load) == (1.0, True, False) and set(light.outlines) == {
        "mid"
    }
    assert more["rrd"] == Path("run") / "view.rrd"
    assert (plain.picture_hz, plain.with_load, plain.axis, plain.scale) == (5.0, True, "y", "symmetric")
    assert (other["port"], other["rrd"]) == (9999, None)


@pytest.mark.parametrize(
    ("spawn", "opens", "words"),
    [
        (True, True, "the viewer opens in its own window"),
        (True, False, "(no display)"),
        (False, True, "(view.spawn is off)"),
    ],
)
def test_the_viewer_is_opened_or_how_to_is_told(
    monkeypatch: pytest.MonkeyPatch, spawn: bool, opens: bool, words: str
) -> None:
    monkeypatch.setattr(consumers, "spawn_viewer", lambda port, tell: object() if opens else None)
    screen = Said()
    view: Any = SimpleNamespace(port=9876, instructions="watch: a\nlater: b")
    consumers._announce(view, spawn, screen, lambda text: None)
    assert words in screen.lines[0]
    assert screen.lines[1:] == ([] if spawn and opens else ["  watch: a", "  later: b"])


# -- the demo -------------------------------------------------------------------------------------


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
    ratios, lines = np.full((100, 2, 3), 0.5), list[str]()
    ratios[within:, 0] = 1.01
    ratios[:beyond, 1, 0] = 1.01
    errors = np.tile([3e-6, -4e-6, 0.0], (100, 1))
    assert demo._print_strain(ratios, errors, lines.append) is agreed
    assert "error 3.00, 4.00, 0.00 µm/m rms in 100 instants" in lines[0]
    assert (
        f"{within:.1f}% of these 300 values within 0.05% of the strain + 3 sigma, {beyond} beyond" in lines[1]
    )
    ratios[0, 1, 0] = math.nan
    assert demo._print_strain(ratios, errors, lines.append) is False
    assert demo._print_strain(np.zeros(0), np.zeros(0), lines.append) is False
    assert lines[-1].endswith("no instant of the elastic part was measured")


def test_the_demo_compares_the_elastic_part_with_its_truth() -> None:
    state, lines = RunState.new(1.0), list[str]()
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
    code = demo.compare(outcome, collector, config, lines.append)
    assert code == 5 and any("exit code 5: E was not measured" in line for line in lines)
    assert any("100.0% of these 6 values" in line for line in lines)
    assert "  force: mean error +2.00 N, scatter 1.00 N in 2 samples" in lines
    assert any(line.endswith("true 70 GPa") for line in lines) and any(
        line.endswith("true 0.3") for line in lines
    )
    collector.measurements = [measured(2.0, 0.01)]
    assert demo.compare(outcome, collector, config, lines.append) == 1
    collector.measurements, outcome.exit_code = [measured(2.0, 0.0)], 130
    assert demo.compare(outcome, collector, config, lines.append) == 0


def test_the_rig_of_the_demo() -> None:
    arguments = argparse.Namespace(specimen="hole", fps=None, **{"output.seconds": None})
    given = demo._defaults(arguments)
    assert given["camera.address"] == "sim:hole?bits=12&fps=auto&buffers=64&section_mm2=40"
    assert (given["specimen.width_mm"], given["specimen.thickness_mm"], given["load.address"]) == (
        20.0,
        2.0,
        "sim:",
    )
    arguments = argparse.Namespace(specimen="hole", fps=12.5, **{"output.seconds": 7.0})
    assert "fps=12.5&" in demo._defaults(arguments)["camera.address"]
    assert demo._defaults(arguments)["camera.address"].endswith("&seconds=7")
