"""load-check, identify, load-calibrate and recover, as a person uses them; the viewer opens at the port of the view."""

from __future__ import annotations

import argparse
import io
import socket
import threading
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import pytest

from acquire.clock import ClockPair
from acquire.errors import ConfigError, DataError
from acquire.load_cell.calibration import load
from acquire.serial_line import identify as identify_module
from hw_mocks.indicator import AsciiIndicator, Sensing
from hw_mocks.indicator_server import IndicatorServer
from live.cli import main
from live.commands import identify, load_calibrate, load_check, recover, run
from live.commands.consumers import standard_consumers
from live.config.loading import load_config
from live.pipeline.consumer import RunInfo
from live.pipeline.run_state import RunState
from live.ui.rerun import view as viewer
from live.ui.terminal.screen import TerminalScreen
from tests.acquire.session.test_damage import abandoned
from tests.live.made_up import CAMERA, START, make_grid
from tests.live.streaming import Published
from tests.live.ui.waiting import LONG_S, until


class Bench:
    """A simulated indicator whose load can be changed."""

    def __init__(self) -> None:
        self.load_N = self.per_s = 0.0
        sensing = Sensing(lambda t: self.load_N + self.per_s * (t % 1.0), lambda t: t, 80.0, 0.5, 1000.0)
        self.server = IndicatorServer(AsciiIndicator(0.1, style="plain"), sensing)


@pytest.fixture
def bench() -> Iterator[Bench]:
    bench = Bench()
    yield bench
    bench.server.close()


def test_load_check_says_ready(bench: Bench) -> None:
    lines: list[str] = []
    arguments = argparse.Namespace(load=f"{bench.server.path}?unit=N&baud=115200", seconds=1.0)
    assert load_check.command(arguments, lines.append) == 0
    assert lines[-1] == "ready" and any(line.startswith("rate") for line in lines)


def test_load_check_of_a_silent_port_says_not_ready() -> None:
    lines: list[str] = []
    arguments = argparse.Namespace(load="loop://?unit=N&wait=0.2", seconds=0.2)
    assert load_check.command(arguments, lines.append) == 6
    assert lines[-1] == "not ready" and any("nothing came" in line for line in lines)


def test_identify_proposes_an_address_that_works(bench: Bench) -> None:
    lines: list[str] = []
    arguments = argparse.Namespace(device=bench.server.path, ask=False)
    assert identify.command(arguments, lines.append) == 0
    assert any(line.startswith(f"use  --load '{bench.server.path}?protocol=ascii") for line in lines)


def test_identify_without_asking_sends_nothing_and_gives_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(identify_module, "SPEEDS", (9600,))
    monkeypatch.setattr(identify_module.listen, "__kwdefaults__", {**LISTEN, "seconds": 0.2})
    lines: list[str] = []
    arguments = argparse.Namespace(device="loop://", ask=False)
    assert identify.command(arguments, lines.append) == 6
    assert any("silence" in line for line in lines) and "--ask" in lines[-1]


LISTEN = dict(identify_module.listen.__kwdefaults__ or {})


def calibrate(bench: Bench, folder: Path, accept: str, **known: float | None) -> tuple[int, list[str]]:
    loads = iter([0.0, 100.0, 0.0, 0.0])
    lines: list[str] = []

    def answer(question: str) -> str:
        lines.append(question)
        if question.startswith("accept"):
            return accept
        bench.load_N = next(loads)
        return ""

    arguments = argparse.Namespace(
        load=f"{bench.server.path}?unit=N&wait=1", out=str(folder / "cal.toml"), seconds=0.4, yes=False,
        **{"mass": None, "force": None, **known},
    )  # fmt: skip
    return load_calibrate.command(arguments, lines.append, answer), lines


def test_calibrating_with_a_known_force(bench: Bench, tmp_path: Path) -> None:
    code, lines = calibrate(bench, tmp_path, "yes", force=200.0)
    found = load(str(tmp_path / "cal.toml"))
    assert code == 0 and "residual" in " ".join(lines)
    assert found.gain == pytest.approx(2.0, rel=0.02) and len(found.points) == 3


def test_a_calibration_not_accepted_leaves_no_file(bench: Bench, tmp_path: Path) -> None:
    code, _ = calibrate(bench, tmp_path, "no", mass=10.0)
    assert code == 6 and list(tmp_path.iterdir()) == []


def test_a_load_that_moves_is_no_point_of_a_calibration(bench: Bench, tmp_path: Path) -> None:
    bench.per_s = 500.0
    with pytest.raises(DataError, match="3 times the load moved"):
        calibrate(bench, tmp_path, "yes", force=200.0)


def test_calibrating_in_simulation_without_a_terminal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO(""))
    words = ["load-calibrate", "--load", "sim:?noise_N=0.1", "--mass", "5", "--seconds", "0.4"]
    assert main([*words, "--out", str(tmp_path / "a.toml")]) == 2
    assert "run it in a terminal, or with --yes" in capsys.readouterr().err
    assert main([*words, "--out", str(tmp_path / "b.toml"), "--yes"]) == 0
    assert load(str(tmp_path / "b.toml")).gain == pytest.approx(1.0, rel=0.01)
    assert "simulated" in capsys.readouterr().out
    assert [path.name for path in tmp_path.iterdir()] == ["b.toml"]


@pytest.mark.slow
def test_the_simulated_rig_is_at_rest_before_a_run(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It began to pull after two seconds, and the checks of the README ended with NO-GO."""
    monkeypatch.setattr("live.commands.check.LISTEN_S", 0.5)
    moving = "sim:?seconds=4&hold=0.01"
    assert main(["load-check", "--load", moving, "--seconds", "1"]) == 0
    small = ["--roi", "all", "--zoi", "48", "--step", "48", "--reference-burst", "8"]
    camera = "sim:uniform?lockstep=yes&seconds=2&hold=0.01&end=0.01&fps=50&width=320&height=256"
    assert main(["check", "--camera", camera, "--load", "sim:", *small]) == 0
    assert "LOOK" not in capsys.readouterr().out


def test_calibrating_needs_one_known_load(bench: Bench, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="--mass in kg, or --force in N"):
        calibrate(bench, tmp_path, "yes")


def test_recover(tmp_path: Path) -> None:
    lines: list[str] = []
    path = abandoned(tmp_path / "killed.h5")
    assert recover.command(argparse.Namespace(session=str(path), out=None), lines.append) == 0
    assert "6 frames" in lines[0] and (tmp_path / "killed.recovered.h5").exists()


def test_the_port_that_is_told_is_the_one_that_is_served(tmp_path: Path) -> None:
    run_state = RunState.new(0.5)
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        wanted = taken.getsockname()[1]
        config = load_config(None, {"view.port": wanted, "view.rrd": False, "view.spawn": False})
        about = RunInfo(config, tmp_path, CAMERA, make_grid(), ClockPair(START, datetime.now(UTC)))
        consumers = standard_consumers(TerminalScreen())(about, run_state)
        outputs = Published(consumers, run_state)
        try:
            until(lambda: run_state.health.view_port is not None)
            port = run_state.health.view_port
            assert port is not None and port != wanted
            socket.create_connection(("127.0.0.1", port), LONG_S).close()
        finally:
            outputs.end()


def _program(folder: Path, words: str) -> Path:
    """In the place of the viewer."""
    program = folder / "rerun"
    program.write_text(f"#!/bin/sh\n{words}\n")
    program.chmod(0o755)
    return program


def test_what_is_opened(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    program = _program(tmp_path, f'echo "$@" > {tmp_path}/opened')
    monkeypatch.setattr(viewer, "viewer_binary", lambda: program)
    monkeypatch.setattr(run, "VIEWER_OPENS_S", 0.0)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.delenv("DISPLAY", raising=False)
    assert run._open_viewer(9881).line.startswith("no: no window") and not (tmp_path / "opened").exists()
    monkeypatch.setenv("DISPLAY", ":7")
    assert run._open_viewer(9881).line == "ok"
    until(lambda: (tmp_path / "opened").exists() and (tmp_path / "opened").read_text())
    assert (tmp_path / "opened").read_text().startswith("--connect rerun+http://127.0.0.1:9881/proxy ")


def test_a_viewer_without_its_libraries_names_their_packages(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    words = "Error: winit: os error at /usr/local/mod.rs:788: Failed to load one of xlib's shared libraries"
    program = _program(tmp_path, f'echo "\033[2mINFO\033[0m" >&2; echo "{words}" >&2; exit 1')
    monkeypatch.setattr(viewer, "viewer_binary", lambda: program)
    monkeypatch.setattr(run, "VIEWER_OPENS_S", 60.0)
    monkeypatch.setenv("DISPLAY", ":7")
    answer = run._open_viewer(9881).line
    assert answer == (
        "no: the viewer did not open (winit: Failed to load one of xlib's shared libraries); "
        f"on a Debian without desktop it needs: {viewer.VIEWER_PACKAGES}"
    )


@pytest.mark.parametrize("end", ["exit 0", "kill -TERM $$"])
def test_a_viewer_that_is_closed_is_no_trouble(
    end: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    program, told = _program(tmp_path, end), []
    monkeypatch.setattr(viewer, "viewer_binary", lambda: program)
    monkeypatch.setenv("DISPLAY", ":7")
    process = viewer.spawn_viewer(9881, told.append)
    until(lambda: not any(thread.name == "viewer" for thread in threading.enumerate()))
    assert process.returncode in (0, -15) and told == []
