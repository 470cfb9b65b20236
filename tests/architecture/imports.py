"""Rules of who imports what. Each yields its violations: file, line, and what to do."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise

from tests.architecture.sources import Import, Module, Sources, When, package_of


def violation(module: Module, line: int, text: str) -> str:
    """A line that an editor can jump to."""
    return f"{module.path}:{line}: {text}"


def forbidden(sources: Sources, packages: Mapping[str, str], exceptions: Mapping[str, str]) -> Iterator[str]:
    """Imports of packages that the importer's line in ``packages`` does not name."""
    for module in sources.values():
        package = package_of(module.name, packages)
        allowed = {
            package,
            *packages.get(package, "").split(),
            *exceptions.get(module.name, exceptions.get(package, "")).split(),
        }
        for found in _ours(module, sources):
            there = package_of(found.module, packages)
            if not allowed & {"*", there, found.module}:
                line = packages.get(package) or "none of ours"
                yield violation(
                    module, found.line, f"{package} may not import {found.module}; its line allows: {line}"
                )


def circles(sources: Sources) -> Iterator[str]:
    """A circle of modules, imports in functions and for a type checker counted: the first that is met."""
    graph = {
        name: {found.module: found for found in _run(module, sources)} for name, module in sources.items()
    }
    cycle = _cycle(graph)
    for one, other in pairwise(cycle):
        text = f"imports {other} in the circle {' > '.join(cycle)}; move what both need below both"
        yield violation(sources[one], graph[one][other].line, text)


def circles_of_packages(packages: Mapping[str, str]) -> Iterator[str]:
    """A circle that the lines of ``packages`` would allow."""
    cycle = _cycle(
        {
            package: {package_of(word, packages) for word in words.split()}
            for package, words in packages.items()
        }
    )
    if cycle:
        yield f"packages in a circle: {' > '.join(cycle)}; one of these lines allows too much"


def libraries(sources: Sources, packages: Collection[str], homes: Mapping[str, str]) -> Iterator[str]:
    """Libraries imported outside the packages that alone may."""
    for module in sources.values():
        for found in module.imports:
            home = homes.get(_top(found))
            if home is not None and package_of(module.name, packages) not in home.split():
                yield violation(
                    module, found.line, f"only {home} may import {_top(found)}; ask there for what you need"
                )


def never(sources: Sources, rules: Mapping[str, str], unless: Mapping[str, str]) -> Iterator[str]:
    """Imports that a package or module does without; ``unless`` has what a package may import all the same."""
    for package, words in rules.items():
        for module in _within(sources, package):
            for found in module.imports:
                allowed = unless.get(module.name.rpartition(".")[0], "").split()
                if _top(found) in words.split() and _top(found) not in allowed:
                    yield violation(
                        module, found.line, f"{package} does without {_top(found)}; let the caller bring it"
                    )


def numba_at_import(sources: Sources, compiled: tuple[str, ...]) -> Iterator[str]:
    """Numba loaded with a module that is not one of compiled loops."""
    for module in sources.values():
        if module.name.endswith("_loops") or any(
            module.name.startswith(f"{package}.") for package in compiled
        ):
            continue
        for found in module.imports:
            if _top(found) == "numba" and found.when is When.LOADING:
                text = "loads numba; put compiled loops in a *_loops.py and import that where it is called"
                yield violation(module, found.line, text)


def _cycle(graph: Mapping[str, Iterable[str]]) -> list[str]:
    """The first circle of a graph, its first node again at the end; empty when there is none."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(reversed(error.args[1]))
    return []


def _ours(module: Module, sources: Sources) -> Iterator[Import]:
    return (found for found in module.imports if found.module in sources)


def _run(module: Module, sources: Sources) -> Iterator[Import]:
    """What ``module`` runs of ours: the modules it imports, and the interfaces on the way to them."""
    for found in _ours(module, sources):
        parts = found.module.split(".")
        ways = (".".join(parts[:depth]) for depth in range(1, len(parts)))
        parents = (way for way in ways if way in sources and not f"{module.name}.".startswith(f"{way}."))
        yield from (Import(found.line, parent, "", found.when) for parent in parents)
        yield found


def _within(sources: Sources, package: str) -> Iterator[Module]:
    return (module for name, module in sources.items() if package_of(name, [package]))


def _top(found: Import) -> str:
    return found.module.split(".")[0]
