"""The examples run and print what their texts promise, and their guard stops a machine."""

from __future__ import annotations

import json
import re
import runpy
import socket
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from examples import stop_machine
from examples.batch import main as batch
from examples.documents import SETTINGS, Documents
from examples.finished_run import main as finished_run
from examples.plain_loop import main as plain_loop
from examples.stop_machine import NotAlive, values
from live.cli import main as phasedic
from phasedic import run as phasedic_run
from tests.live.made_run import PULLED, make_run
from tests.live.shots import write_shots


def test_a_finished_run_is_read_and_exported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = make_run(tmp_path)
    assert finished_run(str(folder)) == 0
    printed = capsys.readouterr().out
    assert f"S1: {len(PULLED)} measurements, force up to 4210 N" in printed
    assert "pictures: 128 x 96 px" in printed
    assert (folder / "from_python" / "report.html").is_file()
    with np.load(folder / "from_python" / "strain.npz") as held:
        assert held["v"].shape[0] == len(PULLED)


def test_the_notebook_runs_cell_by_cell(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", None)
    runpy.run_module("examples.notebook", run_name="__main__")
    printed = capsys.readouterr().out
    modulus = re.search(r"E = ([0-9.]+) GPa from 5 instants", printed)
    assert float(modulus[1]) == pytest.approx(70, rel=0.01)
    assert re.search(r"<StrainField 11 x 15 ZOIs, 165 of 165 with a value; mean exx -0.0018", printed)
    assert "<Strain strain.h5: 5 instants of 11 x 15 ZOIs, engineering strain>" in printed
    assert list(tmp_path.glob("phasedic-*/report.html"))


def test_a_loop_is_left_and_the_test_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert plain_loop(until=3e-4) > 5
    assert re.search(r"\+3\d\d \+- \d+ um/m\s*$", capsys.readouterr().out)
    assert len(list(tmp_path.glob("runs/*/strain.h5"))) == 1


def test_a_test_as_documents(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    kept: list[tuple[str, dict[str, Any]]] = []
    outcome = phasedic_run(SETTINGS, [Documents([lambda name, document: kept.append((name, document))])])
    assert outcome.exit_code == 0
    names = [name for name, _ in kept]
    assert names[:3] == ["start", "descriptor", "event"] and names[-1] == "stop"
    assert kept[-1][1]["num_events"] == {"primary": names.count("event")}
    assert [document["seq_num"] for name, document in kept if name == "event"] == [*range(1, len(names) - 2)]
    assert all(0 <= document["data"]["strain"] < 0.02 for name, document in kept if name == "event")


def test_a_batch_measures_all_compares_them_and_goes_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runs, out = tmp_path / "runs", tmp_path / "out"
    for name in ("a", "b"):
        shots = write_shots(tmp_path / name, (128, 160), [1e-3 * k for k in range(4)])
        quiet = ["--zoi", "48", "--burst", "1", "--no-view", "--no-rrd", "--out", str(runs / name)]
        assert phasedic(["run", "--camera", str(shots), *quiet]) == 0
    (runs / "broken").mkdir()
    (runs / "broken" / "session.h5").write_bytes(b"no session")
    assert batch(str(runs), str(out), "--zoi", "32", "--step", "16") == 4
    printed = capsys.readouterr().out
    assert printed.count(": measured (exit code 0)") == 2
    assert "broken/session.h5: failed (exit code 4)" in printed
    assert (out / "all.html").is_file()
    batch(str(runs), str(out), "--zoi", "32", "--step", "16")
    assert capsys.readouterr().out.count("measured already") == 2


def line(axial: float | None, force: float | None = 10.0, **more: Any) -> bytes:
    return (
        json.dumps({"axial": axial, "age_s": 0.1, "force_N": force, "state": "live", **more}).encode() + b"\n"
    )


@pytest.mark.parametrize(
    ("last", "why"),
    [
        (line(None, state="old"), r"axial is not known any more \(old\)"),
        (line(2e-3, None), "force_N is not known any more"),
        (b"HOLD\n", "an alarm: HOLD"),
        (b'{"axial":', "closed"),
        (b"", "closed"),
    ],
)
def test_it_stops_on_what_is_not_a_known_value(last: bytes, why: str) -> None:
    here, there = socket.socketpair()
    with here, there:
        here.sendall(line(None, None) + line(None) + line(1e-3) + line(1e-3) + last)
        here.shutdown(socket.SHUT_WR)
        lines = values(there)
        assert [next(lines)["axial"] for _ in range(2)] == [1e-3, 1e-3], "it waits for the first values"
        with pytest.raises(NotAlive, match=why):
            next(lines)


def test_it_stops_on_silence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stop_machine, "SILENCE_S", 0.05)
    here, there = socket.socketpair()
    with here, there:
        here.sendall(line(1e-3))
        lines = values(there)
        assert next(lines)["axial"] == 1e-3
        with pytest.raises(NotAlive, match=r"no line for 0\.05 s"):
            next(lines)


def test_without_a_load_cell_there_is_no_force_to_wait_for() -> None:
    here, there = socket.socketpair()
    with here, there:
        here.sendall(b'{"axial":0.001,"age_s":0.1}\n')
        assert next(values(there))["axial"] == 1e-3
