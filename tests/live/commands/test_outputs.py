"""Outputs of a test with their channels and alarms, and its view."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from acquire.clock import ClockPair
from acquire.errors import ConfigError
from acquire.serial_line.ports import LineSettings
from live.commands import consumers
from live.commands.consumers import OUTPUT_NAME, signals_of
from live.config.loading import Config, load_config
from live.pipeline.run_state import RunState
from live.results.sides import JointChannels
from tests.live.made_run import UTC_START
from tests.live.made_up import CAMERA, START, make_grid
from tests.live.screens import RecordingScreen

SAID = "an output: strains and forces to all; it takes no commands"
LINE = {"gauges.mid": {"kind": "line", "start": [20, 20], "end": [20, 70]}}


class Out:
    """A strain output that only keeps what it was made of."""

    name, to_whom, ended = "an output", "to all", False

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
    assert signals_of(about(config, end=None), RunState.new(1.0), RecordingScreen(), None) == []


def test_each_output_is_opened_at_its_address(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("UdpOut", "SerialOut", "TcpOut"):
        monkeypatch.setattr(consumers, name, Out)
    monkeypatch.setattr(
        "live.config.listen_address.ListenAddress.listen", lambda self, name: (name, self.port)
    )
    given = {"strain_out.udp": "127.0.0.1:5005", "strain_out.serial": "/dev/ttyUSB1?baud=9600",
             "strain_out.tcp": "127.0.0.1:5006", **LINE}  # fmt: skip
    screen = RecordingScreen()
    found: list[Any] = list(signals_of(about(load_config(None, given)), RunState.new(1.0), screen, None))
    tcp, udp, serial = found
    assert (tcp.made[0], tcp.made[1]) == ((OUTPUT_NAME, 5006), "")
    assert udp.made[:2] == ("127.0.0.1", 5005)
    assert serial.made[0] == LineSettings("/dev/ttyUSB1", 9600) and screen.lines == [SAID] * 3
    usual = signals_of(
        about(load_config(None, {"strain_out.serial": "/dev/ttyUSB1"})),
        RunState.new(1.0),
        RecordingScreen(),
        None,
    )
    assert usual[0].made[0] == LineSettings("/dev/ttyUSB1", 115200)  # type: ignore[attr-defined]


def test_an_output_that_fails_closes_those_before(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Out] = []
    monkeypatch.setattr(consumers, "UdpOut", lambda *given: made.append(Out(*given)) or made[-1])  # type: ignore[func-returns-value]
    given = {"strain_out.udp": "127.0.0.1:5005", "strain_out.serial": "/dev/ttyUSB1?bauds=9600"}
    with pytest.raises(ConfigError):
        signals_of(about(load_config(None, given)), RunState.new(1.0), RecordingScreen(), None)
    assert [one.ended for one in made] == [True]


def test_the_channels_of_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Any] = []
    monkeypatch.setattr(consumers, "LineFormat", lambda *given: made.append(given))
    state = RunState.new(1.0)
    consumers._lines(about(load_config(None, LINE)), state, None)
    consumers._lines(about(load_config(None, LINE)), state, JointChannels())
    consumers._lines(about(load_config(None, {"strain_out.channels": ["force_N", "eyy"]})), state, None)
    plain, joint, chosen = (given[1] for given in made)
    default = [name for name in consumers.DEFAULT_CHANNELS if name != "stress_MPa"]
    assert plain == [*default, "gauge_mid", "sigma_gauge_mid"], "no section, no stress"
    assert joint[: len(plain)] == plain and {"mean_axial", "bending_gauge_mid"} <= set(joint)
    assert tuple(chosen) == ("force_N", "eyy")


def test_alarms_see_the_machine_and_both_sides(monkeypatch: pytest.MonkeyPatch) -> None:
    config, state = load_config(None, {"alarm": [{"channel": "axial", "above": 0.01}]}), RunState.new(1.0)
    made: list[Any] = []
    monkeypatch.setattr(consumers, "AlarmWatch", lambda *given, **more: made.append((given, more)))
    both = JointChannels()
    for joint in (None, both):
        signals_of(about(config), state, RecordingScreen(), joint)
    for (alarms, values, watched), _ in made:
        assert (len(alarms), values.start, watched) == (1, START, state)
    assert [more["joint"] for _, more in made] == [None, both]


def test_the_view_of_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Any] = []
    monkeypatch.setattr(consumers, "View", lambda setup, **more: made.append((setup, more)))
    given = {**LINE, "specimen.area_mm2": 40.0, "specimen.axis": "x", "view.light": True, "view.rrd": True,
             "load.address": "none:", "view.strain_range": 0.02, "view.scale": "symmetric"}  # fmt: skip
    consumers._view(about(load_config(None, given)), RunState.new(1.0), RecordingScreen())
    usual = {"load.address": "sim:", "view.port": 9999, "view.rrd": False}
    consumers._view(about(load_config(None, usual)), RunState.new(1.0), RecordingScreen())
    (light, more), (plain, other) = made
    assert (light.width, light.height, light.bits, light.start_monotonic) == (128, 96, 12, START)
    assert (light.area_m2, light.axis, light.strain_range, light.scale) == (
        pytest.approx(40e-6),
        "x",
        0.02,
        "symmetric",
    )
    assert (light.picture_hz, light.light, light.with_load) == (1.0, True, False) and set(light.outlines) == {
        "mid"
    }
    assert more["rrd"] == Path("run") / "view.rrd"
    assert (plain.picture_hz, plain.with_load, plain.axis, plain.scale) == (5.0, True, "y", "automatic")
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
    screen = RecordingScreen()
    view: Any = SimpleNamespace(port=9876, instructions="watch: a\nlater: b")
    consumers._announce(view, spawn, screen, lambda text: None)
    assert words in screen.lines[0]
    assert screen.lines[1:] == ([] if spawn and opens else ["  watch: a", "  later: b"])
