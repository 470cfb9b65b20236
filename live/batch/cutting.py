"""A long session as chunks for several workers: where it is cut, and where what they give waits for the others.

The kernel of a chunk has not seen what came before it; the difference dies away within some instants, which are
measured before the chunk and thrown away. What waits lies in ``.NAME.KEY.chunks`` and goes once the test is whole.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquire.errors import PhasedicError
from live.batch.work import Task, is_session, key_of_chunk, parts, remove
from live.replay import open_material

RUN_IN = 20  # instants; after them 0.0004 sigma is left of a first difference of 0.011
LEAST = 100  # instants of a chunk, so that the run-in costs a fifth at most
_SUFFIX = ".chunks"


@dataclass(frozen=True, slots=True)
class Cut:
    """The chunks of a test; without any it is done whole, ``why`` where that is not for its shortness."""

    chunks: tuple[Task, ...] = ()
    why: str = ""


def cut(task: Task) -> Cut:
    """Chunks of about ``task.chunk_s`` of at least ``LEAST`` instants, each with its run-in."""
    assert task.chunk_s is not None
    if not is_session(task.source):
        return Cut(why="pictures are not cut")
    try:
        with open_material(task.request(task.folder)) as (material, _):
            times = material.times
    except PhasedicError:
        return Cut()  # the replay will tell
    if times is None:  # --as-measured, which the command refuses beside --chunk
        return Cut()
    edges = [0, *_edges(times, task.chunk_s), len(times)]
    pairs = list(itertools.pairwise(edges))
    return Cut(tuple(_chunk(task, k, a, b) for k, (a, b) in enumerate(pairs)) if len(pairs) > 1 else ())


def _edges(times: NDArray[np.float64], seconds: float) -> Iterator[int]:
    """Numbers of the bursts that chunks begin with, but for the first."""
    begun = 0
    for number in (np.flatnonzero(np.diff((times - times[:1]) // seconds)) + 1).tolist():
        if number - begun >= LEAST and len(times) - number >= LEAST:
            begun = number
            yield number


def _chunk(task: Task, number: int, first: int, stop: int) -> Task:
    begin = max(0, first - RUN_IN)
    chunk = dataclasses.replace(
        task,
        name=f"{number:04d}",
        of=task.name,
        out=str(_place(task)),
        numbers=(begin, stop),
        run_in=first - begin,
    )
    return dataclasses.replace(chunk, key=key_of_chunk(chunk))


def joined(task: Task, found: Cut) -> Task:
    """The task that makes one result of all chunks."""
    return dataclasses.replace(task, chunks=[str(chunk.folder) for chunk in found.chunks])


def _place(task: Task) -> Path:
    return Path(task.out) / f".{task.name}.{task.key[:12]}{_SUFFIX}"


def sweep_chunks(out: Path, done: set[str], missing: Mapping[str, Task]) -> None:
    """Remove the chunks of tests that are ``done``, and those of other settings of the ``missing``; none at work."""
    for path in sorted(out.glob(f".*{_SUFFIX}")):
        name = path.name[1:].removesuffix(_SUFFIX).rpartition(".")[0]
        outdated = name in done or (name in missing and path != _place(missing[name]))
        if outdated and all(part.is_stale for part in parts(path)):
            remove(path)
