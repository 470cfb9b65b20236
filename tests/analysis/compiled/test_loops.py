"""Compiled code is kept, found again by the next process, and thrown away when anything in it changes."""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import analysis
from analysis.compiled.loops import stamp

PACKAGE = Path(analysis.__file__).parent


COMPILING = ("analysis.compiled.loops", "analysis.compiled.vectors")


def imports_numba(module: Path) -> bool:
    """Whether a module imports numba, or what compiles with it, when it is imported itself."""
    nodes = ast.parse(module.read_text(encoding="utf-8")).body
    names = [n.module or "" for n in nodes if isinstance(n, ast.ImportFrom)]
    names += [alias.name for n in nodes if isinstance(n, ast.Import) for alias in n.names]
    return any(name.split(".")[0] == "numba" or name.startswith(COMPILING) for name in names)


COMPILED = sorted(m.relative_to(PACKAGE).as_posix() for m in PACKAGE.rglob("*.py") if imports_numba(m))
# Their constants are part of the compiled code.
CONSTANTS = ["fit/validity.py", "fit/bundles.py", "picture/splines.py"]


@pytest.fixture(scope="module")
def copied(tmp_path_factory: pytest.TempPathFactory) -> Path:
    ignore = shutil.ignore_patterns("__pycache__")
    return Path(shutil.copytree(PACKAGE, tmp_path_factory.mktemp("stamp") / "analysis", ignore=ignore))


def test_modules_with_compiled_code_were_found() -> None:
    assert {"compiled/loops.py", "compiled/vectors.py", "picture/warp.py", "follow/climb.py"} <= set(COMPILED)


@pytest.mark.parametrize("module", [*COMPILED, *CONSTANTS])
def test_a_change_of_any_module_with_compiled_code_changes_the_stamp(copied: Path, module: str) -> None:
    before = stamp(copied)
    assert stamp(copied) == before
    path = copied / module
    os.utime(path, (path.stat().st_atime, path.stat().st_mtime + 1))
    moved = stamp(copied)
    assert moved != before
    path.write_bytes(path.read_bytes() + b"\n")
    os.utime(path, (0, {name: at for name, at, _ in moved}[module]))
    assert stamp(copied) != moved


def test_what_is_not_compiled_is_not_stamped(copied: Path) -> None:
    assert not [name for name, _, _ in stamp(copied) if name.startswith(("field/", "kernel/", "evaluate/"))]


def test_a_second_process_compiles_nothing() -> None:
    code = (
        "import numpy as np\n"
        "from analysis import PhaseKernel, Roi, ZoiGrid\n"
        "from analysis.fit import iteration, sensitivity, verdict\n"
        "image = np.random.default_rng(0).normal(100, 20, (96, 96)).astype(np.float32)\n"
        "kernel = PhaseKernel(image, ZoiGrid.cover(Roi(8, 8, 80, 80), 32, 16), noise=1.0)\n"
        "kernel.measure(image, start=kernel.measure(image))\n"
        "for loop in (iteration.track.dispatcher, sensitivity.prepare.dispatcher, verdict.judge):\n"
        "    assert len(loop.signatures) == 1, loop\n"
        "    print(sum(loop.stats.cache_hits.values()), sum(loop.stats.cache_misses.values()))\n"
    )
    for _ in range(2):
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, cwd=PACKAGE.parent, check=False
        )
        assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["1", "0"] * 3
