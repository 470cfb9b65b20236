"""Rules of what stands in a module, and of how much stands in a package."""

from __future__ import annotations

import ast
import importlib
import re
from collections import Counter
from collections.abc import Collection, Iterator

from tests.architecture.imports import violation
from tests.architecture.sources import Module, Sources

# Public by Python's own convention, whatever the underscore says.
PUBLIC = {"_asdict", "_fields", "_make", "_replace"}
PUBLIC_PACKAGE = "phasedic"  # loads its names when they are first used, so it has code
_MODULE = r"(?:acquire|analysis|hw_mocks|live)(?:\.\w+)+"
_IN_A_STRING = re.compile(rf"({_MODULE})(?::(\w+))?")


def interfaces(sources: Sources) -> Iterator[str]:
    """Interfaces (``__init__``) with more than a docstring, imports and ``__all__`` (``live`` also its version)."""
    for interface in (m for m in sources.values() if m.is_package and m.name != PUBLIC_PACKAGE):
        if not ast.get_docstring(interface.tree):
            yield violation(interface, 1, "an interface begins with a docstring: the map of its package")
        imported = {(node.lineno, name) for node in interface.tree.body for name in _bound(node)}
        for line, name in sorted(imported):
            if name not in interface.exports:
                yield violation(
                    interface, line, f"an interface exports what it imports; add {name} to __all__"
                )
        for name in sorted(interface.exports - {name for _, name in imported}):
            yield violation(interface, 1, f"__all__ has {name}, which the interface does not import")
        for node in interface.tree.body[1:]:
            if not _belongs_in_an_interface(node, interface.name):
                text = "an interface holds a docstring, imports and __all__; move this to a module of the package"
                yield violation(interface, node.lineno, text)


def homonyms(sources: Sources) -> Iterator[str]:
    """Public class names that stand for more than one class."""
    places: dict[str, list[str]] = {}
    for module in sources.values():
        for node in module.tree.body:
            if isinstance(node, ast.ClassDef) and not _is_private(node.name):
                places.setdefault(node.name, []).append(module.path)
    for name, paths in sorted(places.items()):
        if len(paths) > 1:
            yield f"{name} names {len(paths)} classes: {', '.join(paths)}"


def crowded(sources: Sources, most: int) -> Iterator[str]:
    """Packages of more than ``most`` modules."""
    counts = Counter(name.rpartition(".")[0] for name, module in sources.items() if not module.is_package)
    for package, count in sorted(counts.items()):
        if count > most:
            yield f"{package.replace('.', '/')}: {count} modules, at most {most}; make a package of a subject"


def long_modules(sources: Sources, most: int) -> Iterator[str]:
    """Modules of more than ``most`` lines."""
    for module in sources.values():
        count = module.text.count("\n")
        if count > most:
            yield violation(
                module, most + 1, f"{count} lines, at most {most} (about 300 are enough); make two modules"
            )


def private_reads(module: Module) -> Iterator[str]:
    """Private attributes of anything but self, cls, super() and the class around."""
    for node, classes in _inside(module.tree, frozenset()):
        if isinstance(node, ast.Attribute) and _is_private(node.attr):
            owner = ast.unparse(node.value)
            if owner not in {"self", "cls", "super()", *classes} and node.attr not in PUBLIC:
                text = f"{owner}.{node.attr} is another's private attribute; make it public there"
                yield violation(module, node.lineno, text)


def private_imports(module: Module) -> Iterator[str]:
    """Private names taken from another module."""
    for found in module.imports:
        if _is_private(found.name):
            text = f"{found.name} is private to {found.module}; make it public there"
            yield violation(module, found.line, text)


def calls(module: Module, names: Collection[str]) -> Iterator[str]:
    """Calls of built-in functions that a package does without."""
    for node in ast.walk(module.tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in names:
            yield violation(module, node.lineno, f"calls {node.func.id}(), which this package does without")


def pickles(module: Module) -> Iterator[str]:
    """numpy allowed to unpickle."""
    for node in ast.walk(module.tree):
        if (
            isinstance(node, ast.keyword)
            and node.arg == "allow_pickle"
            and ast.unparse(node.value) != "False"
        ):
            yield violation(
                module, node.value.lineno, "allow_pickle executes what a file contains; it must be False"
            )


def dead_strings(module: Module) -> Iterator[str]:
    """``"module:function"``, ``("module", "function")`` and ``"module"`` in code that name nothing."""
    for line, target, name in _named(module.tree):
        why = why_missing(target, name)
        if why:
            yield violation(module, line, f"{why}; mend the name in the string")


def _named(tree: ast.AST) -> Iterator[tuple[int, str, str]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Tuple) and len(node.elts) == 2:
            first, second = (part.value if isinstance(part, ast.Constant) else None for part in node.elts)
            if isinstance(first, str) and isinstance(second, str) and re.fullmatch(_MODULE, first):
                yield node.lineno, first, second
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            found = _IN_A_STRING.fullmatch(node.value)
            if found:
                yield node.lineno, found[1], found[2] or ""


def why_missing(target: str, name: str) -> str:
    try:
        module = importlib.import_module(target)
    except ImportError as error:
        return f"{target!r} cannot be imported ({error})"
    return "" if not name or hasattr(module, name) else f"{target!r} has no {name!r}"


def _inside(node: ast.AST, classes: frozenset[str]) -> Iterator[tuple[ast.AST, frozenset[str]]]:
    """Every node with the names of the classes around it."""
    for child in ast.iter_child_nodes(node):
        yield child, classes
        yield from _inside(child, classes | {child.name} if isinstance(child, ast.ClassDef) else classes)


def _is_private(name: str) -> bool:
    return name.startswith("_") and not name.endswith("__")


def _bound(node: ast.stmt) -> list[str]:
    """The names that an import binds."""
    if isinstance(node, ast.Import | ast.ImportFrom):
        return [alias.asname or alias.name for alias in node.names]
    return []


def _belongs_in_an_interface(node: ast.stmt, name: str) -> bool:
    if isinstance(node, ast.Assign):
        targets = {ast.unparse(target) for target in node.targets}
        return targets == {"__all__"} or (name == "live" and targets == {"VERSION"})
    return isinstance(node, ast.Import | ast.ImportFrom)
