"""Calibrating with known loads: the line, its residual, its file, and its use in an address."""

from __future__ import annotations

import math
from datetime import UTC, datetime
from pathlib import Path

import pytest

from acquire.addresses import parse_address
from acquire.errors import ConfigError, DataError
from acquire.load_cell.calibration import Point, fit, load, point, save
from acquire.serial_line.settings import read_settings
from tests.acquire.serial_line.fake_port import Bench

NOW = datetime(2026, 5, 9, 12, tzinfo=UTC)
POINTS = [Point(0.0, 100.0, 1.0, 100), Point(50.0, 1100.0, 1.0, 100), Point(0.0, 104.0, 1.0, 100)]


def test_the_line_and_its_residual() -> None:
    found = fit(POINTS, NOW)
    assert found.gain == pytest.approx(50 / 998)
    assert found.zero == pytest.approx(102.0)
    assert found.residual_N == pytest.approx(2 * 50 / 998)


def test_values_without_a_number_do_not_count() -> None:
    assert point(5.0, [1.0, math.nan, 3.0]) == Point(5.0, 2.0, 1.0, 2)
    with pytest.raises(DataError, match="no reading"):
        point(5.0, [math.nan])


@pytest.mark.parametrize(
    ("points", "words"),
    [
        (POINTS[:1], "two different loads"),
        ([POINTS[0], POINTS[2]], "two different loads"),
        ([Point(0, 100, 1, 10), Point(50, 100.1, 1, 10)], "do not change"),
    ],
)
def test_what_is_no_calibration(points: list[Point], words: str) -> None:
    with pytest.raises(DataError, match=words):
        fit(points)


def test_the_file_comes_back_and_is_never_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "cal.toml"
    found = fit(POINTS, NOW)
    save(found, path, r'/dev/ttyUSB0?protocol="odd"\n')
    assert load(str(path)) == found
    assert "2026-05-09T12:00:00+00:00" in path.read_text()
    with pytest.raises(DataError, match="not overwritten"):
        save(found, path, "")


def test_an_address_uses_it(tmp_path: Path) -> None:
    path = tmp_path / "cal.toml"
    save(fit(POINTS, NOW), path, "")
    bench = Bench([b"x\r\n", b"1100\r\n"], address=f"/dev/fake?calibration={path}")
    assert [s.force for s in bench.run()] == pytest.approx([50.0, 50.0][:1], abs=0.11)
    stored = bench.cell.info.settings["calibration"]
    assert stored["date"].startswith("2026-05-09") and len(stored["points"]) == 3


def test_a_calibration_carries_the_sign(tmp_path: Path) -> None:
    path = tmp_path / "cal.toml"
    save(fit([Point(0, 0.0, 0, 1), Point(10, -20.0, 0, 1)], NOW), path, "")
    bench = Bench([b"x\r\n", b"-20 N\r\n"], address=f"/dev/fake?protocol=mark10&calibration={path}")
    assert [s.force for s in bench.run()] == pytest.approx([10.0])
    with pytest.raises(ConfigError, match="leave out sign"):
        read_settings(parse_address(f"/dev/fake?sign=-1&calibration={path}"))


@pytest.mark.parametrize(
    "text", ["", "gain = 1", "gain = 0.0\nzero=0\nresidual_N=0\ndate='x'\npoints=[]", "[[["]
)
def test_another_file_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "cal.toml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=r"cal.toml"):
        load(str(path))


def test_a_missing_file_is_refused() -> None:
    with pytest.raises(ConfigError, match="No such file"):
        load("nowhere.toml")
