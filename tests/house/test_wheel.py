"""A built wheel holds every room and its data, and ``phasedic`` runs from it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from zipfile import ZipFile

import pytest

from tests.house.rooms import PACKAGES

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.slow


def pip(*arguments: str, cwd: Path) -> None:
    command = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check", *arguments]
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def files_of(package: str) -> set[str]:
    """All that stands in the sources, modules and data."""
    found = (
        path for path in (ROOT / package).rglob("*") if path.is_file() and "__pycache__" not in path.parts
    )
    return {path.relative_to(ROOT).as_posix() for path in found}


def backend_is_here() -> bool:
    """setuptools of the ``test`` extra; without it pip fetches its own."""
    try:
        return int(version("setuptools").split(".")[0]) >= 77
    except PackageNotFoundError:
        return False


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built from a copy: a build folder of long ago would bring back what has been moved."""
    work = tmp_path_factory.mktemp("wheel")
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, work)
    for package in PACKAGES:
        shutil.copytree(ROOT / package, work / package, ignore=shutil.ignore_patterns("__pycache__"))
    here = ["--no-build-isolation"] if backend_is_here() else []
    pip("wheel", "--no-deps", *here, "--wheel-dir", "dist", ".", cwd=work)
    (made,) = (work / "dist").glob("phasedic-*.whl")
    return made


@pytest.fixture(scope="module")
def installed(wheel: Path) -> Path:
    target = wheel.parent / "installed"
    pip("install", "--no-deps", "--target", str(target), str(wheel), cwd=wheel.parent)
    return target


@pytest.mark.parametrize("package", PACKAGES)
def test_every_room_is_in_the_wheel(wheel: Path, package: str) -> None:
    with ZipFile(wheel) as file:
        held = {name for name in file.namelist() if name.startswith(f"{package}/")}
    assert held == files_of(package)


@pytest.mark.parametrize("command", [["-m", "live.cli"], ["bin/phasedic"]])
def test_phasedic_runs_from_the_wheel(installed: Path, command: list[str]) -> None:
    """From a folder in which there are no sources."""
    run = [sys.executable, *(str(installed / word) if "/" in word else word for word in command), "--help"]
    there = {**os.environ, "PYTHONPATH": str(installed)}
    done = subprocess.run(run, cwd=installed.parent, env=there, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "characterise" in done.stdout


def test_it_is_the_wheel_that_runs(installed: Path) -> None:
    there = {**os.environ, "PYTHONPATH": str(installed)}
    code = "import live.cli; print(live.cli.__file__)"
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=installed.parent,
        env=there,
        capture_output=True,
        text=True,
        check=True,
    )
    assert Path(done.stdout.strip()) == installed / "live" / "cli.py"
