"""The laws of the house: which package may import what, and that help is quick to import."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
OURS = {"acquire", "analysis", "hw_mocks", "live"}
MAY_IMPORT = {
    "acquire": set(),
    "analysis": set(),
    "hw_mocks": {"acquire"},
    "live": {"acquire", "analysis"},
}
# The one door to the simulated devices, and those who ask them for the truth.
DOORS = {"live/rig.py", "live/demo.py", "live/characterise.py"}
# The numerics touch no file, thread, device or clock, and draw nothing.
NOT_IN_ANALYSIS = {
    "threading", "multiprocessing", "subprocess", "socket", "time", "datetime", "io",
    "rerun", "serial", "h5py", "asyncio", "queue", "select", "matplotlib",
}  # fmt: skip


def modules(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


def imported(path: Path) -> set[str]:
    """Top-level names that ``path`` imports at run time, wherever in the file."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            found.add(node.module.split(".")[0])
    return found


@pytest.mark.parametrize("package", sorted(OURS))
def test_imports_point_one_way(package: str) -> None:
    for path in modules(package):
        name = path.relative_to(ROOT).as_posix()
        allowed = MAY_IMPORT[package] | {package}
        if name in DOORS or name.startswith("live/characterise"):
            allowed = allowed | {"hw_mocks"}
        assert imported(path) & OURS <= allowed, name


def test_analysis_knows_only_arrays() -> None:
    for path in modules("analysis"):
        found = imported(path) & NOT_IN_ANALYSIS
        assert not found, f"{path.name} imports {found}"


def test_analysis_opens_no_file() -> None:
    for path in modules("analysis"):
        calls = {
            node.func.id
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
        }
        assert "open" not in calls, path.name


@pytest.mark.parametrize("package", sorted(OURS))
def test_nothing_from_a_file_is_executed(package: str) -> None:
    """No pickle, no eval, no exec: a session of somebody else is data."""
    for path in modules(package):
        assert not imported(path) & {"pickle", "marshal", "shelve", "dill"}, path.name
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                assert node.func.id not in {"eval", "exec"}, path.name
            if isinstance(node, ast.keyword) and node.arg == "allow_pickle":
                assert isinstance(node.value, ast.Constant) and node.value.value is False, path.name


def test_the_command_line_imports_nothing_heavy() -> None:
    """``phasedic --help`` answers at once because the libraries are imported when first used."""
    code = (
        "import sys, live.cli\n"
        "heavy = {'numpy', 'scipy', 'numba', 'cv2', 'h5py', 'rerun', 'serial', 'matplotlib'} & set(sys.modules)\n"
        "sys.exit(', '.join(sorted(heavy)) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.returncode == 0, done.stderr
