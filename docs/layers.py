"""A graph without circles laid out in layers, arrows downwards and with few crossings; the same each time."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import pairwise

Graph = Mapping[str, frozenset[str]]
ROUNDS = 24


class Places(dict[str, tuple[float, float]]):
    """Node -> column and row; ``ways`` has the nodes made up for an arrow that passes rows."""

    def __init__(self) -> None:
        super().__init__()
        self.ways: dict[tuple[str, str], list[str]] = {}


def reduced(graph: Graph) -> Graph:
    """Without the arrows that follow from two others."""
    below = {node: _below(graph, node) for node in graph}
    return {
        node: frozenset(t for t in targets if not any(t in below[other] for other in targets - {t}))
        for node, targets in graph.items()
    }


def layers(graph: Graph) -> list[list[str]]:
    """The nodes in rows from the top, each as low as its arrows let it."""
    depth: dict[str, int] = {}

    def height(node: str) -> int:
        if node not in depth:
            depth[node] = 1 + max((height(target) for target in graph[node]), default=-1)
        return depth[node]

    top = max(height(node) for node in graph)
    return [sorted(node for node in graph if depth[node] == top - row) for row in range(top + 1)]


def placed(rows: list[list[str]], graph: Graph) -> Places:
    """Each node's place, in steps of one column and one row."""
    places = Places()
    rows, links = _with_ways(rows, graph, places.ways)
    _untangle(rows, links)
    columns = _columns(rows, links)
    left = min(columns.values())
    for number, row in enumerate(rows):
        places.update({node: (columns[node] - left, number) for node in row})
    return places


def _below(graph: Graph, node: str) -> frozenset[str]:
    return frozenset().union(*({target} | _below(graph, target) for target in graph[node]))


def _with_ways(
    rows: list[list[str]], graph: Graph, ways: dict[tuple[str, str], list[str]]
) -> tuple[list[list[str]], dict[str, list[str]]]:
    """Rows with a node made up wherever an arrow passes one, and the links from row to row."""
    row_of = {node: number for number, row in enumerate(rows) for node in row}
    full, links = [list(row) for row in rows], {node: list[str]() for node in row_of}
    for node in sorted(graph):
        for target in sorted(graph[node]):
            passed = range(row_of[node] + 1, row_of[target])
            way = [f"{node}>{target}@{number}" for number in passed]
            ways[node, target] = way
            for number, made in zip(passed, way, strict=True):
                full[number].append(made)
            for one, other in pairwise([node, *way, target]):
                links.setdefault(one, []).append(other)
    return full, links


def _untangle(rows: list[list[str]], links: Mapping[str, list[str]]) -> None:
    """Swap neighbours as long as arrows cross less for it."""
    for _ in range(ROUNDS):
        before = _crossings(rows, links)
        for row in rows:
            for place in range(len(row)):
                for other in range(place + 1, len(row)):
                    now = _crossings(rows, links)
                    row[place], row[other] = row[other], row[place]
                    if _crossings(rows, links) >= now:
                        row[place], row[other] = row[other], row[place]
        if _crossings(rows, links) == before:
            return


def _crossings(rows: list[list[str]], links: Mapping[str, list[str]]) -> float:
    """Crossings between all pairs of rows; long ways sideways count a little."""
    total = 0.0
    for upper, lower in pairwise(rows):
        at = {node: n for n, node in enumerate(lower)}
        ends = [(n, at[target]) for n, node in enumerate(upper) for target in links.get(node, [])]
        total += sum((a - c) * (b - d) < 0 for i, (a, b) in enumerate(ends) for c, d in ends[:i])
        total += 0.01 * sum(abs(a / len(upper) - b / len(lower)) for a, b in ends)
    return total


def _columns(rows: list[list[str]], links: Mapping[str, list[str]]) -> dict[str, float]:
    """Nodes above and below their neighbours, a column apart (half a one for a passing arrow)."""
    near: dict[str, list[str]] = {node: [] for row in rows for node in row}
    for node, targets in links.items():
        for target in targets:
            near[node].append(target)
            near[target].append(node)
    x = {node: float(n) for row in rows for n, node in enumerate(row)}
    for turn in range(ROUNDS):
        for row in rows if turn % 2 else reversed(rows):
            wish = [
                sum(x[other] for other in near[node]) / len(near[node]) if near[node] else x[node]
                for node in row
            ]
            x.update(zip(row, _apart(wish, [0.35 if "@" in node else 1.0 for node in row]), strict=True))
    return x


def _apart(wish: Iterable[float], widths: list[float]) -> list[float]:
    """The places nearest to ``wish``, in this order, that leave each node its width."""
    starts = [0.0]
    for one, other in pairwise(widths):
        starts.append(starts[-1] + (one + other) / 2)
    blocks: list[list[float]] = []
    for want, start in zip(wish, starts, strict=True):
        blocks.append([want - start])
        while len(blocks) > 1 and _mean(blocks[-2]) > _mean(blocks[-1]):
            blocks[-2:] = [blocks[-2] + blocks[-1]]
    shifts = [_mean(block) for block in blocks for _ in block]
    return [start + shift for start, shift in zip(starts, shifts, strict=True)]


def _mean(values: list[float]) -> float:
    return sum(values) / len(values)
