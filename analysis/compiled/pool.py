"""Work of numpy and scipy on two threads, part by part: their functions let other threads run while they compute.

Threads that are started keep the priority of the one that starts them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from analysis.compiled.interruption import go_on

Part = TypeVar("Part")
Found = TypeVar("Found")
THREADS = 2


def each(work: Callable[[Part], Found], parts: Iterable[Part]) -> Iterator[Found]:
    """What ``work`` gives for each part, in their order; raises what it raises."""
    go_on()
    with ThreadPoolExecutor(THREADS) as pool:
        yield from pool.map(work, parts)


def do(work: Callable[[Part], object], parts: Iterable[Part]) -> None:
    """The same for work that gives nothing."""
    for _ in each(work, parts):
        pass
