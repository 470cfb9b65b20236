"""Readings by value: ports, devices, calibrations, scales, studies, and both sides."""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from acquire.load_sample import LoadFlag, LoadSample
from analysis.evaluate import TwoSides
from live.commands import devices, identify
from live.commands.init import _stable
from live.commands.load_calibrate import _raw, _unfit
from live.commands.map import _warn_of_motion
from live.commands.sides import _strains as side_lines
from live.commands.study import _curve, _figures, _section
from live.replay.study import StudySetting
from live.results.run_folder import open_run
from tests.live.made_run import make_run
from tests.live.made_up import in_ascii


def test_a_port_is_asked_question_after_question(monkeypatch: pytest.MonkeyPatch) -> None:
    line = SimpleNamespace(baud=9600, bytesize=8, parity="N")
    questions = [SimpleNamespace(data=b"a", line=line, protocol=name) for name in ("one", "two", "three")]
    monkeypatch.setattr(identify.identify, "questions", lambda device: questions)
    finding = SimpleNamespace(address="/dev/x?protocol=two", remark="look")
    monkeypatch.setattr(identify.identify, "ask", lambda q: finding if q.protocol == "two" else None)
    said: list[str] = []
    assert identify._ask_all("/dev/x", said.append) == 0
    assert said[1] == "  b'a'  at 9600 8N1 (one)"
    assert said[4:] == [
        "  one: no answer",
        "  two: answers",
        "use  --load '/dev/x?protocol=two'",
        "note: look",
    ]
    monkeypatch.setattr(identify.identify, "ask", lambda q: None)
    assert identify._ask_all("/dev/x", said.append) == 6 and said[-1].startswith("no answer; check cable")


def test_the_devices_are_listed(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    camera = SimpleNamespace(text=lambda: "a camera\n  its format")
    for cameras, ports, heads in (([camera], [SimpleNamespace(text=lambda: "a port")], ("cameras:", "serial ports:")),
                                  ([], [], ("cameras: none found", "serial ports: none found"))):  # fmt: skip
        monkeypatch.setattr("acquire.camera.list_cameras", lambda found=cameras: found)
        monkeypatch.setattr("acquire.serial_line.ports.list_serial_ports", lambda found=ports: found)
        monkeypatch.setattr("analysis.threads", lambda: 7)
        assert devices.command(argparse.Namespace(report=None, settings=False)) == 0
        lines = capsys.readouterr().out.splitlines()
        assert lines[0].startswith(heads[0]) and any(line.startswith(heads[1]) for line in lines)
        assert lines[-1] == "threads that measure: 7" and ("  its format" in lines) == (
            "a port" in lines
        ) == bool(cameras)


def test_readings_that_give_no_point_of_a_calibration() -> None:
    still = [LoadSample(k / 10, 5.0) for k in range(10)]
    assert _unfit(still) == "" and _unfit(still[:2]) == ""
    assert _unfit([LoadSample(0.0, math.nan)]) == _unfit([]) == "no reading had a value"
    for flag in (LoadFlag.OVERLOAD, LoadFlag.UNDERLOAD):
        assert _unfit([*still, replace(still[0], flags=flag)]) == "the cell was in overload or saturated"
    assert _unfit([LoadSample(k / 10, 5.0 * k) for k in range(10)]) == "the load moved, by 45 on the line"


def test_a_cell_is_calibrated_as_it_sends() -> None:
    assert _raw("/dev/x?unit=g&baud=9600&gain=3&sign=-1&capacity=5") == "/dev/x?baud=9600&gain=1&sign=1"
    assert _raw("/dev/x") == "/dev/x?gain=1&sign=1"


@pytest.mark.parametrize(("address", "stable", "found"), [
    ("/dev/video0?fps=5", "/dev/v4l/by-id/x", "/dev/v4l/by-id/x?fps=5"), ("/dev/video0?fps=5", "", "/dev/video0?fps=5"),
    ("/dev/video0?fps=5", "aravis:x?fps=5", "aravis:x?fps=5"), ("/dev/video0", "/dev/v4l/by-id/x", "/dev/v4l/by-id/x"),
])  # fmt: skip
def test_the_address_that_stays(address: str, stable: str, found: str) -> None:
    assert _stable(address, stable) == found


def studied(vsg: float, order: int = 1, **more: Any) -> Any:
    values = {"noise": 1e-4 / vsg, "seen": 2e-3, "sigma": 3e-5} | more
    return SimpleNamespace(setting=StudySetting(32, 8, order, "gaussian"), vsg=vsg, **values)


def test_the_figures_of_a_study_are_in_um_m() -> None:
    noise, strain = _figures([studied(40.0), studied(20.0), studied(30.0, 2)])
    assert [line.label for line in noise.curves] == ["order 1, gaussian", "order 2, gaussian"]
    assert noise.curves[0].x.tolist() == [20, 40] and noise.curves[0].y.tolist() == pytest.approx([5.0, 2.5])
    assert noise.curves[0].sigma is None and [line.colour for line in noise.curves] == [0, 1]
    assert strain.curves[0].y.tolist() == pytest.approx([2000, 2000])
    assert strain.curves[0].sigma is not None and strain.curves[0].sigma.tolist() == pytest.approx([30, 30])
    assert _curve("a", [studied(1.0)], "seen", 4).colour == 4
    text = _section(SimpleNamespace(found=studied(20.0)))  # type: ignore[arg-type]
    assert text == '[measure]\nzoi = 32\nstep = 8\norder = 1\nwindow = "gaussian"\n'


def test_the_strains_of_both_sides_at_the_end() -> None:
    one = TwoSides(np.arange(3.0), np.array([0.0, 2e-3, math.nan]), np.array([0.0, -1e-4, math.nan]),
                   np.array([1e-6, 2e-6, math.nan]))  # fmt: skip
    nothing = replace(one, mean=np.full(3, math.nan))
    head, line = side_lines(SimpleNamespace(courses={"axial": one, "lost": nothing}))  # type: ignore[arg-type]
    assert (
        in_ascii(line).split() == ["axial", "2000", "+-", "2", "um/m", "-100", "+-", "2", "um/m"]
        and "front minus mean" in head
    )


def test_a_map_over_a_later_picture_is_misplaced_by_the_motion(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with open_run(make_run(tmp_path, [0.0, 0.01, 0.1], session=False)) as run:
        _warn_of_motion(run.strain, 1)
        assert capsys.readouterr().out == ""
        _warn_of_motion(run.strain, 2)
    assert "moved by up to 8 px" in capsys.readouterr().out
