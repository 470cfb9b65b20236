"""``phasedic batch --chunk``: a long session in chunks by several workers has the results of one replay."""

from __future__ import annotations

import contextlib
import os
import signal
from pathlib import Path

import numpy as np
import pytest

from live.cli import main
from live.results import Strain
from tests.live.ended import code_of
from tests.live.replay.batch.running import is_gone, parts, pid_of, rows, started
from tests.live.ui.waiting import until

SETTINGS = ["--zoi", "48", "--step", "16"]
CHUNK = ["--chunk", "10", "--workers", "2"]


@pytest.fixture(scope="module")
def whole(long: Path) -> Path:
    out = long.parent.with_name("whole")
    assert main(["replay", str(long), *SETTINGS, "--no-view", "--no-rrd", "--out", str(out)]) == 0
    return out


@pytest.fixture(scope="module")
def cut(long: Path) -> Path:
    out = long.parent.with_name("cut")
    assert main(["batch", str(long), *SETTINGS, *CHUNK, "--out", str(out)]) == 0
    return out


@pytest.mark.slow
def test_as_the_whole(whole: Path, cut: Path) -> None:
    with Strain.open(whole / "strain.h5") as one, Strain.open(cut / "long" / "strain.h5") as other:
        assert len(one.time_s) == 310
        assert np.any(other.maps("u")[90:] != one.maps("u")[90:])  # it was cut indeed
        for name in ("frame", "last_frame", "n_valid", "lost", "time_s", "force_N", "noise_GL"):
            np.testing.assert_array_equal(other.values[name], one.values[name], err_msg=name)
        np.testing.assert_array_equal(other.maps("status"), one.maps("status"))
        for name in ("u", "exx", "eyy", "exy"):
            sigma = np.nanmedian(one.maps(f"sigma_{name}"))
            assert np.nanmax(np.abs(other.maps(name) - one.maps(name))) < 0.005 * sigma, name
            # They are stored to 0.2 %.
            np.testing.assert_allclose(other.maps(f"sigma_{name}"), one.maps(f"sigma_{name}"), rtol=4e-3)
        for name in ("exx", "eyy", "exy"):
            error = other.values[f"sigma_{name}"] / one.values[f"sigma_{name}"] - 1
            assert np.abs(error).max() < 1e-3  # of the means, which the kernel knows more of


@pytest.mark.slow
def test_files_are_those_of_a_replay(whole: Path, cut: Path) -> None:
    one, other = ((folder / "strain.csv").read_text().splitlines() for folder in (whole, cut / "long"))
    assert one[0] == other[0]
    assert len(one) == len(other) == 311
    assert "joined of 3 chunks" in (cut / "long" / "replay.txt").read_text(encoding="utf-8")
    assert [row["instants"] for row in rows(cut)] == ["310"]
    assert sorted(path.name for path in cut.iterdir()) == ["long", "summary.csv", "summary.parquet"]


def working(out: Path) -> list[Path]:
    return [part for place in out.glob(".*.chunks") for part in parts(place)]


@pytest.mark.slow
def test_killed_in_the_middle(long: Path, tmp_path: Path) -> None:
    """The chunks that are whole are not done again."""
    out = tmp_path / "out"
    words = (long, *SETTINGS, "--step", "4", *CHUNK, "--out", out)
    caller = started(*words)
    until(lambda: len(list(out.glob(".long.*.chunks/0*/batch.json"))) > 0)
    whole = [path.stat().st_mtime_ns for path in out.glob(".long.*.chunks/0000/batch.json")]
    caller.kill()
    caller.wait()
    left = working(out)
    until(lambda: all(is_gone(pid_of(part)) for part in left))
    assert not (out / "long").exists()
    caller = started(*words)
    until(lambda: any(not is_gone(pid_of(part)) for part in working(out)))
    first = [path.stat().st_mtime_ns for path in out.glob(".long.*.chunks/0000/batch.json")]
    assert not whole or first == whole
    with contextlib.suppress(ProcessLookupError, StopIteration):  # where it has just ended
        os.kill(next(pid for pid in map(pid_of, working(out)) if not is_gone(pid)), signal.SIGKILL)
    assert caller.wait(120) == 0
    assert [row["instants"] for row in rows(out)] == ["310"]
    assert sorted(path.name for path in out.iterdir()) == ["long", "summary.csv", "summary.parquet"]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--chunk", "0"], "--chunk: '0': give a number above 0"),
        (["--chunk", "nan"], "--chunk: 'nan': give a number above 0"),
        (["--chunk", "9", "--as-measured"], "leave --chunk out"),
    ],
)
def test_what_is_refused(
    long: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], says: str
) -> None:
    assert code_of(["batch", str(long), *words, "--out", str(tmp_path / "out")]) == 2
    assert says in capsys.readouterr().err
