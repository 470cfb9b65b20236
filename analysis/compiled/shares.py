"""Sharing work among threads as they come for it.

numba gives each thread its half beforehand; beside another busy program, or the threads of a live test, the thread
that lost its core for a while is waited for. Here too each begins with a half of its own, since pieces side by side
have much in common that is in its cache by then; but it takes a piece at a time, and goes on with what others have
left. A thread that is held up has done less in the end. What is computed does not depend on who does it.

980 ZOIs of 64 px beside a program that takes half of one core: 22 ms a frame (median) in place of 69; beside one that
takes a whole core 27 in place of 90; alone the same (2 cores, November 2026). Loops of some nanoseconds a ZOI are not
shared: each start of the threads is one more wait for the slower.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core import types
from numba.core.imputils import impl_ret_untracked
from numba.extending import intrinsic

from analysis.compiled.loops import helper

SHARES = 64
"""Ranges that the pieces are cut into, whatever the number of threads; a thread begins with the first of its share of
them and goes through all. For so many threads at most there is work."""


@helper
def next_piece(counters: Any, share: int, pieces: int) -> Any:
    """The number of the next of so many pieces, from the range ``share`` on; -1 when all are taken.

    ``counters`` (SHARES,) int64, zero at first, says how many of each range are taken.
    """
    for i in range(SHARES):
        of = (share + i) % SHARES
        first, end = pieces * of // SHARES, pieces * (of + 1) // SHARES
        if counters[of] < end - first:
            piece = first + _counted_up(counters, of)
            if piece < end:
                return piece
    return -1


@intrinsic
def _counted_up(_typing: Any, counters: Any, index: Any) -> Any:
    """A counter's value before it is counted up, by one thread at a time."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array = context.make_array(signature.args[0])(context, builder, arguments[0])
        place = builder.gep(array.data, [arguments[1]])
        before = builder.atomic_rmw("add", place, ir.Constant(ir.IntType(64), 1), "monotonic")
        return impl_ret_untracked(context, builder, types.int64, before)

    return types.int64(counters, types.intp), generate
