"""The sources as the rules see them: modules, what each imports, and when."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from pathlib import Path


class When(Enum):
    """When an import happens."""

    LOADING = "with the module"
    CALLING = "in a function"
    TYPING = "for a type checker alone"


@dataclass(frozen=True, slots=True)
class Import:
    """One name from one module; ``name`` is empty where a module is taken whole."""

    line: int
    module: str
    name: str
    when: When


@dataclass(frozen=True, slots=True, eq=False)
class Module:
    """A file, named as it is imported; an interface has the name of its folder."""

    name: str
    path: str
    text: str
    tree: ast.Module
    imports: tuple[Import, ...]

    @property
    def is_package(self) -> bool:
        return self.path.endswith("__init__.py")

    @property
    def exports(self) -> set[str]:
        """The names in ``__all__``."""
        for node in self.tree.body:
            if isinstance(node, ast.Assign) and any(map(_is_all, node.targets)):
                return set(ast.literal_eval(node.value))
        return set()

    @property
    def is_compiled(self) -> bool:
        """Holds loops that numba compiles: such a module is imported by its own name."""
        return self.name.endswith("_loops") or any(
            found.module.startswith("analysis.compiled") and found.when is When.LOADING
            for found in self.imports
        )


Sources = Mapping[str, Module]


def read_sources(root: Path, packages: Iterable[str]) -> Sources:
    """All modules of ``packages`` by name."""
    trees = {
        _name(path.relative_to(root)): path
        for package in packages
        for path in sorted((root / package).rglob("*.py"))
    }
    return {name: _module(name, path, root, set(trees)) for name, path in trees.items()}


def package_of(name: str, packages: Iterable[str]) -> str:
    """The longest of ``packages`` that the module ``name`` is in; "" for none."""
    return max(
        (package for package in packages if name == package or name.startswith(f"{package}.")),
        key=len,
        default="",
    )


def _module(name: str, path: Path, root: Path, ours: set[str]) -> Module:
    text = path.read_text(encoding="utf-8")
    tree = ast.parse(text)
    place = name.split(".") if path.name == "__init__.py" else name.split(".")[:-1]
    imports = tuple(_imports(tree, When.LOADING, place, ours))
    return Module(name, path.relative_to(root).as_posix(), text, tree, imports)


def _name(path: Path) -> str:
    parts = path.with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _imports(node: ast.AST, when: When, place: list[str], ours: set[str]) -> Iterator[Import]:
    """The imports below ``node``; ``place`` is the package that relative ones start from."""
    if isinstance(node, ast.Import):
        yield from (Import(node.lineno, alias.name, "", when) for alias in node.names)
    elif isinstance(node, ast.ImportFrom):
        module = _absolute(node, place)
        for alias in node.names:
            whole = f"{module}.{alias.name}"
            taken = (whole, "") if whole in ours else (module, alias.name)
            yield Import(node.lineno, *taken, when)
    elif isinstance(node, ast.If) and _is_type_checking(node.test):
        yield from (found for child in node.body for found in _imports(child, When.TYPING, place, ours))
        yield from (found for child in node.orelse for found in _imports(child, when, place, ours))
    else:
        inside = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and when is When.LOADING
        for child in ast.iter_child_nodes(node):
            yield from _imports(child, When.CALLING if inside else when, place, ours)


def _absolute(node: ast.ImportFrom, place: list[str]) -> str:
    base = place[: len(place) + 1 - node.level] if node.level else []
    return ".".join([*base, *([node.module] if node.module else [])])


def _is_type_checking(test: ast.expr) -> bool:
    return ast.unparse(test) in {"TYPE_CHECKING", "typing.TYPE_CHECKING"}


def _is_all(target: ast.expr) -> bool:
    return isinstance(target, ast.Name) and target.id == "__all__"
