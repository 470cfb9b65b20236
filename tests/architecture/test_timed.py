"""A test in real time is tried once more where it fails, with a warning; another one is not."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

CONFTEST = Path(__file__).parents[1] / "conftest.py"
SETTINGS = '[tool.pytest.ini_options]\nmarkers = ["timed: in real time"]\nfilterwarnings = ["error"]\n'
TESTS = """
import pytest

TRIES = dict.fromkeys(("busy", "slow", "plain"), 0)

@pytest.fixture(scope="module")
def fresh():
    return list()

def tried(name, fresh):
    TRIES[name] += 1
    fresh.append(name)
    return TRIES[name]

@pytest.mark.timed
def test_busy(fresh):
    assert tried("busy", fresh) == 2
    assert fresh == ["busy"]

@pytest.mark.timed
def test_slow(fresh):
    assert tried("slow", fresh) > 2

def test_plain(fresh):
    assert tried("plain", fresh) == 2

def test_how_often():
    assert TRIES == {"busy": 2, "slow": 2, "plain": 1}
"""


def test_a_timed_test_is_tried_once_more(tmp_path: Path) -> None:
    (tmp_path / "conftest.py").write_text(CONFTEST.read_text(encoding="utf-8"), encoding="utf-8")
    (tmp_path / "pyproject.toml").write_text(SETTINGS, encoding="utf-8")
    (tmp_path / "test_them.py").write_text(TESTS, encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-q", "-rA"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=200)
    assert done.returncode == 1, done.stdout + done.stderr
    lines = done.stdout.splitlines()
    assert lines[-1].startswith("2 failed, 2 passed")
    assert {line.split()[1].partition("::")[2] for line in lines if line.startswith("PASSED")} == {
        "test_busy", "test_how_often"
    }  # fmt: skip
    again = [line.rpartition("::")[2] for line in lines if line.startswith("WARNING: tried again")]
    assert again == ["test_busy", "test_slow"]
