"""Memory of bursts that is used again: only once nobody has the pictures, and from the first burst on."""

from __future__ import annotations

import numpy as np

from acquire.burst import BurstAccumulator, PictureMemory
from acquire.frame import Burst, Frame, frozen

SHAPE = (6, 7)


def bursts_of(memory: PictureMemory, n: int, *, held: int, total: int) -> list[tuple[Burst, float]]:
    """Bursts of n frames of one level each, with that level; each is dropped after ``held`` more."""
    accumulator = BurstAccumulator(n, memory=memory)
    kept: list[tuple[Burst, float]] = []
    for i in range(n * total):
        level = 3 * (i // n)
        image = frozen(np.full(SHAPE, level, np.uint8))
        burst = accumulator.add(Frame(image, i, i / 50, "device", 0, 8, i / 50))
        if burst is not None:
            kept = [*kept, (burst, float(level))][-held:]
            assert all((b.mean == level).all() for b, level in kept)
    return kept


def test_a_picture_stays_as_it_is_for_as_long_as_anybody_has_it() -> None:
    for n in (1, 2, 9):
        kept = bursts_of(PictureMemory(), n, held=5, total=40)
        assert [level for _, level in kept] == [105, 108, 111, 114, 117]


def test_memory_is_used_again() -> None:
    memory = PictureMemory()
    first = memory.take(SHAPE, np.float32)
    place = first.ctypes.data
    assert memory.take(SHAPE, np.float32).ctypes.data != place  # somebody has it
    first.flags.writeable = False
    del first
    again = memory.take(SHAPE, np.float32)
    assert again.ctypes.data == place and again.flags.writeable
    del again
    assert memory.take(SHAPE, np.uint32).ctypes.data != place
    assert memory.take((7, 6), np.float32).ctypes.data != place


def test_a_view_alone_keeps_its_memory() -> None:
    memory = PictureMemory()
    part = memory.take(SHAPE, np.float32)[2:, 1:].T
    raw = memoryview(memory.take(SHAPE, np.float32))
    part[:] = 1
    assert {memory.take(SHAPE, np.float32).ctypes.data for _ in range(3)}.isdisjoint(
        {part.base.ctypes.data, np.asarray(raw).ctypes.data}
    )


def test_what_was_prepared_is_enough() -> None:
    memory = PictureMemory()
    memory.prepare(4, SHAPE, np.float32)
    memory.prepare(4, SHAPE, np.bool_)
    ready = {id(array) for array in memory._arrays}
    bursts_of(memory, 2, held=3, total=30)
    assert {id(array) for array in memory._arrays} == ready
