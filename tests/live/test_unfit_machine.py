"""A machine that measures a known pattern wrong: every command that measures refuses, with the libraries' versions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from analysis import self_test as machine
from analysis.kernel import solve
from analysis.picture.splines import tap_table
from live.cli import main
from live.replay.batch.task import Task, perform
from tests.live.shots import write_shots


@pytest.fixture
def break_taps(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[], None]]:
    """From then on the taps of the spline are wrong as those of an emulated machine were, in a new process."""

    def forget() -> None:
        machine._check_algebra.cache_clear()
        machine._check_measuring.cache_clear()

    def wrong(degree: int) -> object:
        return (tap_table(degree) * np.linspace(0.8, 1.1, 18)).astype(np.float32)

    def spoil() -> None:
        forget()
        monkeypatch.setattr(solve, "tap_table", wrong)

    yield spoil
    forget()


@pytest.fixture
def shots(tmp_path: Path) -> Path:
    return write_shots(tmp_path / "shots", (128, 160), [1e-4 * k for k in range(10)])


def refused(capsys: pytest.CaptureFixture[str], *words: str) -> None:
    assert main(words) == 6
    printed = capsys.readouterr().err
    assert "does not measure a known pattern right (self-test with ZOIs of" in printed
    assert f"nothing is measured with numpy {np.__version__} (BLAS and LAPACK: " in printed
    assert "Traceback" not in printed


@pytest.mark.parametrize(
    "words",
    [
        "run --camera SHOTS --zoi 48 --burst 1 --no-view --no-rrd --out OUT",
        "replay SHOTS --zoi 48 --burst 1 --no-view --no-rrd --out OUT",
        "check --camera SHOTS --zoi 48",
        "study SHOTS --zoi 32,48 --static 0,2 --loaded 5,8 --out OUT",
        "characterise --pattern SHOTS/a0.png --quick --out OUT",
    ],
)
def test_nothing_is_measured(
    words: str,
    shots: Path,
    tmp_path: Path,
    break_taps: Callable[[], None],
    capsys: pytest.CaptureFixture[str],
) -> None:
    break_taps()
    refused(capsys, *words.replace("SHOTS", str(shots)).replace("OUT", str(tmp_path / "out")).split())
    assert not list(tmp_path.rglob("strain.h5"))


def test_a_worker_of_a_batch(shots: Path, tmp_path: Path, break_taps: Callable[[], None]) -> None:
    break_taps()
    row = perform(Task("a", str(tmp_path / "out"), str(shots), overrides={"measure.zoi": 48})).values
    assert row["exit_code"] == 6 and "known pattern" in str(row)
    assert not list(tmp_path.rglob("strain.h5"))


def test_warming_up(break_taps: Callable[[], None], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["warm-up"]) == 0
    assert "self-test: a known pattern is measured right" in capsys.readouterr().out
    break_taps()
    refused(capsys, "warm-up")
