"""What stands in the way of a bare machine is reported, and nothing of the host's own comes into it."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

from tests.bare import machine

ROOT = Path(__file__).parents[2]

MIRROR = "file:///mirror/debian"


@pytest.fixture
def means(monkeypatch: pytest.MonkeyPatch) -> None:
    """Root on Linux with debootstrap, but no debootstrap that succeeds."""
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.setattr(machine.os, "geteuid", lambda: 0)
    monkeypatch.setattr(machine.shutil, "which", lambda name: f"/usr/sbin/{name}")
    monkeypatch.setattr(machine, "mirror", lambda: MIRROR)
    monkeypatch.setattr("sys.argv", ["machine.py", "--suite", "forky", "--", "make", "demo", "test"])


def no(*_: object) -> str:
    return ""


@pytest.mark.parametrize(
    ("where", "what", "says"),
    [
        ("sys.platform", "darwin", "it needs Linux"),
        ("tests.bare.machine.os.geteuid", lambda: 1000, "sudo make bare-test"),
        ("tests.bare.machine.shutil.which", lambda name: None, "apt-get install debootstrap"),
    ],
)
def test_what_is_missing_is_reported_before_anything_is_made(
    where: str,
    what: object,
    says: str,
    means: None,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(where, what)
    monkeypatch.setattr(machine, "make", lambda machine: pytest.fail("it was made"))
    assert machine.main() == machine.NO_MACHINE
    assert says in capsys.readouterr().err


def test_a_mirror_that_is_not_reached_is_reported_and_nothing_is_left(
    means: None, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    def refused(argv: list[str], **_: object) -> subprocess.CompletedProcess[str]:
        return subprocess.CompletedProcess(argv, 1, "I: Retrieving Release\nE: cannot fetch it\n", "")

    monkeypatch.setattr(machine, "PLACE", tmp_path)
    monkeypatch.setattr(machine.subprocess, "run", refused)
    assert machine.main() == machine.NO_MACHINE
    heard = capsys.readouterr().err
    assert "no bare machine: `debootstrap " in heard and "forky" in heard and "E: cannot fetch it" in heard
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("status", [0, 2])
def test_the_status_is_that_of_the_command(
    status: int, means: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    commands: list[list[str]] = []

    def inside(root: Path, command: list[str]) -> int:
        commands.append(command)
        assert root.parent == tmp_path and root.stat().st_mode & 0o777 == 0o755
        return status

    monkeypatch.setattr(machine, "PLACE", tmp_path)
    monkeypatch.setattr(machine, "run_inside", inside)
    for step in ("make", "take_from_host", "check_python", "clone"):
        monkeypatch.setattr(machine, step, no)
    assert machine.main() == status
    assert commands == [["make", "demo", "test"]] and list(tmp_path.iterdir()) == []


def test_nothing_of_the_host_but_the_network(monkeypatch: pytest.MonkeyPatch) -> None:
    host = {"PHASEDIC_DATA": "/data", "DISPLAY": ":0", "PIP_FIND_LINKS": "/w", "PYTHONPATH": "/p"}
    for name, value in {**host, "https_proxy": "http://proxy:8080", "HOME": "/root"}.items():
        monkeypatch.setenv(name, value)
    there = machine.environment()
    assert not host.keys() & there.keys()
    assert there["https_proxy"] == "http://proxy:8080" and there["HOME"] == "/home/user"


@pytest.mark.parametrize(
    ("version", "said"), [("3.14.8", ""), ("3.15.0", "has Python 3.15.0 by now"), ("3.1", "3.1 by")]
)
def test_a_debian_with_another_python_is_refused(
    version: str, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(machine, "run", lambda *words: f"Python {version}\n")
    forky = machine.Machine("forky", Path("/nowhere"), MIRROR)
    if not said:
        machine.check_python(forky)
        return
    with pytest.raises(machine.NoMachine, match=said):
        machine.check_python(forky)


def test_a_debian_younger_than_debootstrap_is_made_as_the_others(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "trixie").touch()
    monkeypatch.setattr(machine, "SCRIPTS", tmp_path)
    assert machine.recipe("trixie") == [] and machine.recipe("forky") == [tmp_path / "sid"]


def test_the_versions_that_are_named_are_those_that_are_tried() -> None:
    """Python 3.11 is the machine's own in CI; the others come with the Debians of ``.ci/run``."""
    ci = (ROOT / ".ci/run").read_text(encoding="utf-8")
    tried = {"3.11", *(machine.PYTHONS[suite] for suite in re.findall(r"^bare (\w+)", ci, re.MULTILINE))}
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert set(re.findall(r"Python :: (3\.\d+)", project)) == tried
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    named = re.search(r"tested with\s+([\d., and]+)", readme)
    assert named is not None and set(re.findall(r"3\.\d+", named[1])) == tried
