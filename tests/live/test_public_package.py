"""``phasedic`` as a package: every name is there and typed, quick to import, and a clash is named."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import phasedic

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("name", phasedic.__all__)
def test_a_public_name_is_there(name: str) -> None:
    assert getattr(phasedic, name) is getattr(phasedic, name)


def test_the_types_are_those_of_the_names() -> None:
    tree = ast.parse((ROOT / "phasedic" / "__init__.pyi").read_text())
    typed = {
        (alias.name, node.module)
        for node in tree.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if alias.asname == alias.name
    }
    assert typed == set(phasedic._PLACES.items())


def test_an_unknown_name_is_refused_with_those_that_exist() -> None:
    with pytest.raises(AttributeError, match=r"no 'Kernel'; it has .*PhaseKernel"):
        _ = phasedic.Kernel  # type: ignore[attr-defined]


def test_importing_loads_nothing() -> None:
    code = "import sys, phasedic; print(*{'numpy', 'live', 'analysis', 'cv2', 'asyncio'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True)
    assert done.stdout.strip() == ""


@pytest.mark.parametrize("theirs", ["analysis.py", "live/__init__.py"])
def test_a_module_that_hides_ours_is_named(tmp_path: Path, theirs: str) -> None:
    (tmp_path / theirs).parent.mkdir(exist_ok=True)
    (tmp_path / theirs).touch()
    (tmp_path / "script.py").write_text("import phasedic\nfrom phasedic import PhaseKernel\n")
    run = [sys.executable, str(tmp_path / "script.py")]
    done = subprocess.run(run, env={"PYTHONPATH": str(ROOT)}, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    name = theirs.partition("/")[0].removesuffix(".py")
    wanted = (
        f"ImportError: {tmp_path / theirs} hides phasedic's package {name}: rename it, or move the script"
    )
    assert done.stderr.splitlines()[-1] == wanted


def test_a_replay_needs_no_whole_configuration() -> None:
    with pytest.raises(TypeError, match="give a mapping"):
        phasedic.replay("shots", phasedic.load_config(None, {}))


def test_a_test_that_cannot_begin_ends_the_loop_with_its_message(tmp_path: Path) -> None:
    settings = {"camera.address": str(tmp_path / "gone*.png"), "output.dir": str(tmp_path / "out")}
    with pytest.raises(phasedic.DataError, match="no image there"):
        list(phasedic.measurements(settings))
