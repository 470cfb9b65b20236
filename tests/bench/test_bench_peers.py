"""The rows of other engines: a failure is reported, the absent are named, the points are those of the truth."""

from __future__ import annotations

import json
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from analysis import Roi, ZoiGrid
from tests.bench import __main__ as bench
from tests.bench import peers
from tests.bench.peers import Peer
from tests.paper import others
from tests.paper.others import Points

SECTION = "Beside other engines, on the same pair"
X, Y = np.meshgrid(np.arange(48.0, 300, 8), np.arange(48.0, 200, 8))


def row_of(peer: Peer, quiet: bool = True) -> dict[str, object]:
    report = bench.Report(quiet)
    bench._peer(report, peer)
    assert json.loads(json.dumps(report.values)) == report.values
    (row,) = report.values[SECTION]
    return row


def test_row_of_an_engine_that_is_wrong_and_misses_a_point() -> None:
    u = bench._true_map(X, Y) + 0.01
    u[3, 4] = np.nan
    row = row_of(Peer("quick", lambda: Points(X, Y, u), "as called"))
    assert row["points"] == X.size - 1
    assert row["mean error px"] == pytest.approx(0.01)
    assert row["scatter px"] == pytest.approx(0, abs=1e-9)
    assert row["note"] == "as called"


def test_the_tables_are_written_as_a_page(tmp_path: Path) -> None:
    report = bench.Report(quiet=True)
    report.add("Command line", {"phasedic --help s": 0.0625})
    report.add("Command line", {"phasedic --help s": 1234.5})
    bench.write(report, live=False, folder=tmp_path)
    lines = (tmp_path / "bench.md").read_text(encoding="utf-8").splitlines()
    assert lines[0] == "# Speed of the kernel"
    assert lines[-4:] == ["| phasedic --help s |", "|---|", "| 0.0625 |", "| 1,234 |"]


def test_a_program_that_fails_leaves_its_row(capsys: pytest.CaptureFixture[str]) -> None:
    def broken() -> Points:
        raise OSError("libGL.so.1 | not\nthere")

    row = row_of(Peer("pyvale, 33 px", broken, optional=True), quiet=False)
    assert row["points"] == 0
    assert row["note"] == "failed: OSError: libGL.so.1 / not there"
    table = capsys.readouterr().out.strip().splitlines()
    assert table[-1].startswith("| pyvale, 33 px | 0 |")
    assert table[-1].count("|") == table[-2].count("|")


def test_an_engine_that_is_always_there_may_not_fail() -> None:
    def broken() -> Points:
        raise ValueError("window")

    with pytest.raises(ValueError, match="window"):
        row_of(Peer("OpenCV", broken))


def test_a_program_that_finds_nothing() -> None:
    row = row_of(Peer("SUN-DIC, 33 px", lambda: Points(X, Y, np.full(X.shape, np.nan)), optional=True))
    assert row["points"] == 0
    assert row["points/s"] == ""


def test_the_absent_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(others, "find_spec", lambda name: None)
    assert peers.missing() == ["pyvale", "SUN-DIC"]
    assert list(peers.programs(np.zeros((64, 64)), np.zeros((64, 64)))) == []


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("module", ["pyvale", "sundic"])
def test_programs_measure_the_points_of_the_grid(module: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if find_spec(module) is None:  # not imported here: pyvale opens a log file wherever that is done
        pytest.skip(f"{module} is not installed")
    from tests.accuracy.truth import Speckle, affine, digitise

    shape, rng, pattern = (200, 240), np.random.default_rng(1), Speckle(2.0, 3)
    pair = [digitise(pattern.at(*affine(shape, u=u)), 8, 0.0, rng) for u in (0.0, 0.25)]
    monkeypatch.setattr(others, "find_spec", lambda name: object() if name == module else None)
    monkeypatch.setattr(peers.numba, "get_num_threads", lambda: 1)  # SUN-DIC without Ray
    (program,) = peers.programs(*pair)
    found = program.run()
    grid = ZoiGrid.cover(Roi(32, 32, shape[1] - 64, shape[0] - 64), 33, 8)
    assert found.x.shape == grid.shape
    np.testing.assert_array_equal(found.x[0], grid.x)
    np.testing.assert_array_equal(found.y[:, 0], grid.y)
    assert np.nanmean(found.u) == pytest.approx(0.25, abs=5e-3)
