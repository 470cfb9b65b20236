"""The rules of ``layers``, checked on our sources."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

from tests.architecture import imports, modules
from tests.architecture.layers import (
    COMPILED,
    EXCEPT,
    EXCEPTIONS,
    LAYERS,
    LIBRARIES,
    MANY_FILES,
    MAX_FILES,
    MAX_LINES,
    MEASURING,
    NEVER,
    PACKAGES,
    PRIVATE,
)
from tests.architecture.sources import Sources, package_of, read_sources

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def sources() -> Sources:
    return read_sources(ROOT, PACKAGES)


def none_of(violations: Iterable[str]) -> None:
    found = list(violations)
    assert not found, "\n" + "\n".join(found)


def test_every_package_has_its_line(sources: Sources) -> None:
    folders = {name for name, module in sources.items() if module.is_package}
    missing = {name for name in folders if not package_of(name, LAYERS) or name.count(".") == 1} - set(LAYERS)
    assert not missing, "a new package needs its line in tests/architecture/layers.py"
    assert set(LAYERS) <= set(sources), "a line without a package"


def crowded(sources: Sources) -> Iterable[str]:
    counted = {name: module for name, module in sources.items() if name.rpartition(".")[0] not in MANY_FILES}
    return modules.crowded(counted, MAX_FILES)


@pytest.mark.parametrize(
    "rule",
    [
        pytest.param(lambda _: imports.circles_of_packages(LAYERS), id="the lines make no circle"),
        pytest.param(
            lambda s: imports.forbidden(s, LAYERS, EXCEPTIONS), id="packages import what their line allows"
        ),
        pytest.param(imports.circles, id="no circle of modules"),
        pytest.param(lambda s: imports.libraries(s, LAYERS, LIBRARIES), id="libraries have a home"),
        # Numerics and the measuring path: no thread, file, device or clock. Nothing from a file is executed.
        pytest.param(lambda s: imports.never(s, NEVER, EXCEPT), id="what packages do without"),
        pytest.param(lambda s: imports.numba_at_import(s, COMPILED), id="compiled loops alone load numba"),
        pytest.param(modules.interfaces, id="interfaces hold imports alone"),
        pytest.param(crowded, id="no package is crowded"),
        pytest.param(modules.homonyms, id="a public class name means one class"),
        pytest.param(lambda s: modules.long_modules(s, MAX_LINES), id="no module is long"),
    ],
)
def test_the_sources_keep_the_rule(rule: Callable[[Sources], Iterable[str]], sources: Sources) -> None:
    none_of(rule(sources))


def test_analysis_opens_no_file(sources: Sources) -> None:
    numerics = (module for name, module in sources.items() if package_of(name, ["analysis", *MEASURING]))
    none_of(found for module in numerics for found in modules.calls(module, {"open"}))


def test_nothing_from_a_file_is_executed(sources: Sources) -> None:
    """A session of somebody else is data."""
    none_of(found for module in sources.values() for found in modules.calls(module, {"eval", "exec"}))
    none_of(found for module in sources.values() for found in modules.pickles(module))


def test_private_means_private(sources: Sources) -> None:
    checked = [module for name, module in sources.items() if not package_of(name, PRIVATE)]
    rules = (modules.private_reads, modules.private_imports)
    none_of(found for module in checked for rule in rules for found in rule(module))


def test_what_strings_name_is_there(sources: Sources) -> None:
    none_of(found for module in sources.values() for found in modules.dead_strings(module))


def test_the_command_is_there() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for target in project["scripts"].values():
        assert modules.why_missing(*target.split(":")) == ""


@pytest.mark.parametrize(
    ("module", "heavy"),
    [
        ("live.cli", "numpy scipy numba cv2 h5py rerun serial matplotlib"),
        ("analysis", "numba llvmlite cv2 h5py rerun serial matplotlib"),
        ("acquire.burst", "numba llvmlite cv2 h5py rerun serial matplotlib"),
    ],
)
def test_imports_nothing_heavy(module: str, heavy: str) -> None:
    """``phasedic --help`` answers at once because the libraries are imported when first used."""
    code = f"import sys, {module}; print(*sorted({set(heavy.split())!r} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True)
    assert done.stdout.strip() == "", f"import {module} loads what should be imported when first used"
