"""load-check, identify, load-calibrate and recover, as a person uses them."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import pytest

from acquire.errors import ConfigError, DataError
from acquire.load_cell.calibration import load
from acquire.serial_line import identify as identify_module
from hw_mocks.ascii_indicator import AsciiIndicator
from hw_mocks.indicator_output import Sensing
from hw_mocks.indicator_server import IndicatorServer
from live.commands import identify, load_calibrate, load_check, recover
from tests.acquire.session.test_recover import abandoned


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
    said: list[str] = []
    arguments = argparse.Namespace(load=f"{bench.server.path}?unit=N&baud=115200", seconds=1.0)
    assert load_check.command(arguments, said.append) == 0
    assert said[-1] == "ready" and any(line.startswith("rate") for line in said)


def test_load_check_of_a_silent_port_says_not_ready() -> None:
    said: list[str] = []
    arguments = argparse.Namespace(load="loop://?unit=N&wait=0.2", seconds=0.2)
    assert load_check.command(arguments, said.append) == 6
    assert said[-1] == "not ready" and any("nothing came" in line for line in said)


def test_identify_proposes_an_address_that_works(bench: Bench) -> None:
    said: list[str] = []
    arguments = argparse.Namespace(device=bench.server.path, ask=False)
    assert identify.command(arguments, said.append) == 0
    assert any(line.startswith(f"use  --load '{bench.server.path}?protocol=ascii") for line in said)


def test_identify_without_asking_sends_nothing_and_gives_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(identify_module, "SPEEDS", (9600,))
    monkeypatch.setattr(identify_module.listen, "__kwdefaults__", {**LISTEN, "seconds": 0.2})
    said: list[str] = []
    arguments = argparse.Namespace(device="loop://", ask=False)
    assert identify.command(arguments, said.append) == 6
    assert any("silence" in line for line in said) and "--ask" in said[-1]


LISTEN = dict(identify_module.listen.__kwdefaults__ or {})


def calibrate(bench: Bench, folder: Path, accept: str, **known: float | None) -> tuple[int, list[str]]:
    loads = iter([0.0, 100.0, 0.0, 0.0])
    said: list[str] = []

    def answer(question: str) -> str:
        said.append(question)
        if question.startswith("accept"):
            return accept
        bench.load_N = next(loads)
        return ""

    arguments = argparse.Namespace(
        load=f"{bench.server.path}?unit=N&wait=1", out=str(folder / "cal.toml"), seconds=0.4,
        **{"mass": None, "force": None, **known},
    )  # fmt: skip
    return load_calibrate.command(arguments, said.append, answer), said


def test_calibrating_with_a_known_force(bench: Bench, tmp_path: Path) -> None:
    code, said = calibrate(bench, tmp_path, "yes", force=200.0)
    found = load(str(tmp_path / "cal.toml"))
    assert code == 0 and "residual" in " ".join(said)
    assert found.gain == pytest.approx(2.0, rel=0.02) and len(found.points) == 3


def test_a_calibration_not_accepted_leaves_no_file(bench: Bench, tmp_path: Path) -> None:
    code, _ = calibrate(bench, tmp_path, "no", mass=10.0)
    assert code == 6 and list(tmp_path.iterdir()) == []


def test_a_load_that_moves_is_no_point_of_a_calibration(bench: Bench, tmp_path: Path) -> None:
    bench.per_s = 500.0
    with pytest.raises(DataError, match="3 times the load moved"):
        calibrate(bench, tmp_path, "yes", force=200.0)


def test_calibrating_needs_one_known_load(bench: Bench, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="--mass in kg, or --force in N"):
        calibrate(bench, tmp_path, "yes")


def test_recover(tmp_path: Path) -> None:
    said: list[str] = []
    path = abandoned(tmp_path / "killed.h5")
    assert recover.command(argparse.Namespace(session=str(path), out=None), said.append) == 0
    assert "6 frames" in said[0] and (tmp_path / "killed.recovered.h5").exists()
