"""The laws between the rooms of ``analysis``: who imports whom, who loads numba, how long a module is."""

from __future__ import annotations

import ast
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import analysis

PACKAGE = Path(analysis.__file__).parent
MAY_IMPORT = {
    "field": set(),
    "compiled": set(),
    "picture": {"field", "compiled"},
    "follow": {"field", "compiled"},
    "evaluate": {"field"},
    "paper_estimator": {"field"},
    "fit": {"field", "compiled", "picture"},
    "kernel": {"field", "compiled", "picture", "fit", "follow"},
}
COMPILED = {"compiled", "picture", "fit", "follow"}
LONGEST, MOST_FILES = 370, 12
MODULES = [m for m in sorted(PACKAGE.rglob("*.py")) if m != PACKAGE / "__init__.py"]


def room(module: Path) -> str:
    return module.relative_to(PACKAGE).parts[0].removesuffix(".py")


def name(module: Path) -> str:
    return ".".join(("analysis", *module.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(
        ".__init__"
    )


def imported(tree: ast.Module) -> set[str]:
    """Modules, and names in them, that are imported anywhere in a module."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


TREES = {m: ast.parse(m.read_text(encoding="utf-8")) for m in MODULES}


def test_every_room_has_its_law() -> None:
    assert {room(m) for m in MODULES} == set(MAY_IMPORT)


@pytest.mark.parametrize("module", MODULES, ids=name)
def test_rooms_import_only_what_lies_below_them(module: Path) -> None:
    rooms = {i.split(".")[1] for i in imported(TREES[module]) if i.startswith("analysis.")}
    assert rooms <= MAY_IMPORT[room(module)] | {room(module)}


@pytest.mark.parametrize("module", MODULES, ids=name)
def test_a_room_with_a_face_is_entered_through_it(module: Path) -> None:
    faces = {
        r
        for r in MAY_IMPORT
        if (PACKAGE / r / "__init__.py").exists() and _exports(PACKAGE / r / "__init__.py")
    }
    for node in ast.walk(TREES[module]):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("analysis."):
            _, other, *inner = node.module.split(".")
            # Compiled modules are named by themselves, since no face loads numba.
            if other != room(module) and other in faces and inner:
                assert _loads_numba(PACKAGE / other / f"{inner[0]}.py"), f"{node.module} behind the face"


def _exports(face: Path) -> bool:
    return any(isinstance(n, ast.Assign) for n in ast.parse(face.read_text(encoding="utf-8")).body)


def _loads_numba(module: Path) -> bool:
    nodes = [n for n in TREES[module].body if isinstance(n, (ast.Import, ast.ImportFrom))]
    names = imported(ast.Module(body=list(nodes), type_ignores=[]))
    return any(n.split(".")[0] in {"numba", "llvmlite"} or n.startswith("analysis.compiled.") for n in names)


def test_no_module_imports_itself_in_a_circle() -> None:
    known = {name(m) for m in MODULES}
    graph = {}
    for module, tree in TREES.items():
        names = imported(tree)
        graph[name(module)] = {k for i in names for k in (i, i.rpartition(".")[0]) if k in known} - {
            name(module)
        }
    assert list(TopologicalSorter(graph).static_order())


def test_numba_is_loaded_only_where_loops_are_compiled() -> None:
    assert {room(m) for m in MODULES if _loads_numba(m)} == COMPILED
    code = "import sys, analysis\nsys.exit('numba' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], cwd=PACKAGE.parent, check=False)
    assert done.returncode == 0


def test_only_the_compiling_room_knows_llvm() -> None:
    for module, tree in TREES.items():
        if room(module) != "compiled":
            assert not {i for i in imported(tree) if i.startswith("llvmlite")}, name(module)


@pytest.mark.parametrize("module", MODULES, ids=name)
def test_a_module_can_be_read_in_one_go(module: Path) -> None:
    assert len(module.read_text(encoding="utf-8").splitlines()) <= LONGEST
    assert len(list(module.parent.glob("*.py"))) - 1 <= MOST_FILES


@pytest.mark.parametrize("module", MODULES, ids=name)
def test_nobody_reads_what_is_private_to_another(module: Path) -> None:
    classes = {n.name for n in TREES[module].body if isinstance(n, ast.ClassDef)} | {"self", "cls"}
    for node in ast.walk(TREES[module]):
        if isinstance(node, ast.Attribute) and node.attr.startswith("_") and not node.attr.startswith("__"):
            own = isinstance(node.value, ast.Name) and node.value.id in classes
            # numba has no public name for its cache.
            assert own or name(module) == "analysis.compiled.loops", f"{node.attr}, line {node.lineno}"
