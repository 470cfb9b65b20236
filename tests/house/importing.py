"""Laws of who imports what. Each yields its breaches: file, line, and what to do."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise

from tests.house.sources import House, Import, Module, When, room_of


def breach(module: Module, line: int, text: str) -> str:
    """A line that an editor can jump to."""
    return f"{module.path}:{line}: {text}"


def strangers(house: House, rooms: Mapping[str, str], doors: Mapping[str, str]) -> Iterator[str]:
    """Imports of rooms that the importer's line in ``rooms`` does not name."""
    for module in house.values():
        room = room_of(module.name, rooms)
        allowed = {room, *rooms.get(room, "").split(), *doors.get(module.name, "").split()}
        for found in _ours(module, house):
            there = room_of(found.module, rooms)
            if not allowed & {"*", there, found.module}:
                line = rooms.get(room) or "none of ours"
                yield breach(
                    module, found.line, f"{room} may not import {found.module}; its line allows: {line}"
                )


def circles(house: House) -> Iterator[str]:
    """A circle of modules at run time, imports in functions counted: the first that is met."""
    graph = {name: {found.module: found for found in _run(module, house)} for name, module in house.items()}
    ring = _ring(graph)
    for one, other in pairwise(ring):
        text = f"imports {other} in the circle {' > '.join(ring)}; move what both need below both"
        yield breach(house[one], graph[one][other].line, text)


def circles_of_rooms(rooms: Mapping[str, str]) -> Iterator[str]:
    """A circle that the lines of ``rooms`` would allow."""
    ring = _ring({room: {room_of(word, rooms) for word in words.split()} for room, words in rooms.items()})
    if ring:
        yield f"rooms in a circle: {' > '.join(ring)}; one of these lines says too much"


def past_the_face(house: House, rooms: Mapping[str, str]) -> Iterator[str]:
    """Imports from outside a room that do not come through its face.

    Free are the modules of a room whose face exports nothing, those that the face exports as they are, and
    compiled ones (a face loads no numba).
    """
    for module in house.values():
        for found in _ours(module, house):
            room = room_of(found.module, rooms)
            face = house.get(room)
            if room == room_of(module.name, rooms) or face is None or not face.is_face or not face.exports:
                continue
            if found.module == room and found.name and found.name not in face.exports:
                yield breach(
                    module, found.line, f"{room} does not export {found.name}; add it to {face.path}"
                )
            elif found.module != room and not _free(house[found.module], face):
                what = found.name or "what you need"
                yield breach(
                    module, found.line, f"{found.module} is behind a face; import {what} from {room}"
                )


def libraries(house: House, rooms: Collection[str], homes: Mapping[str, str]) -> Iterator[str]:
    """Libraries imported outside the rooms that alone know them."""
    for module in house.values():
        for found in module.imports:
            home = homes.get(_top(found))
            if home is not None and room_of(module.name, rooms) not in home.split():
                yield breach(
                    module, found.line, f"only {home} may import {_top(found)}; ask there for what you need"
                )


def never(house: House, rules: Mapping[str, str], unless: Mapping[str, str]) -> Iterator[str]:
    """Imports that a room, and all rooms in it, must do without; ``unless`` says what a room may have all the same."""
    for room, words in rules.items():
        for module in _within(house, room):
            for found in module.imports:
                allowed = unless.get(module.name.rpartition(".")[0], "").split()
                if _top(found) in words.split() and _top(found) not in allowed:
                    yield breach(
                        module, found.line, f"{room} does without {_top(found)}; let the caller bring it"
                    )


def numba_at_import(house: House, compiled: tuple[str, ...]) -> Iterator[str]:
    """Numba loaded with a module that is not one of compiled loops."""
    for module in house.values():
        if module.name.endswith("_loops") or any(module.name.startswith(f"{room}.") for room in compiled):
            continue
        for found in module.imports:
            if _top(found) == "numba" and found.when is When.LOADING:
                text = "loads numba; put compiled loops in a *_loops.py and import that where it is called"
                yield breach(module, found.line, text)


def _ring(graph: Mapping[str, Iterable[str]]) -> list[str]:
    """The first circle of a graph, its first node again at the end; empty when there is none."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(reversed(error.args[1]))
    return []


def _ours(module: Module, house: House) -> Iterator[Import]:
    return (found for found in module.imports if found.module in house)


def _run(module: Module, house: House) -> Iterator[Import]:
    """What ``module`` runs of ours: the modules it imports, and the faces on the way to them."""
    for found in _ours(module, house):
        if found.when is not When.TYPING:
            parts = found.module.split(".")
            ways = (".".join(parts[:depth]) for depth in range(1, len(parts)))
            faces = (way for way in ways if way in house and not f"{module.name}.".startswith(f"{way}."))
            yield from (Import(found.line, face, "", found.when) for face in faces)
            yield found


def _free(target: Module, face: Module) -> bool:
    return target.is_compiled or target.name.removeprefix(f"{face.name}.") in face.exports


def _within(house: House, room: str) -> Iterator[Module]:
    return (module for name, module in house.items() if room_of(name, [room]))


def _top(found: Import) -> str:
    return found.module.split(".")[0]
