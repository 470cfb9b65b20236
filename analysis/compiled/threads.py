"""The threads of a loop: each kept on a core of its own, and the work shared among them as they come for it.

On Linux a worker that wakes up may be put on the core of the one that woke it, and stays there while another core
is idle: the scheduler moves it only some milliseconds later, and a frame is measured in that time. On two cores, a
frame every 30 ms, nine of ten were measured on one of them. Where the caller only waits (``layer``) its core is as
good as any: there a thread leaves the core on which another one has begun. Other systems need nothing.
OMP_PROC_BIND has the same effect, but it binds the calling thread too, and every thread and process that it starts.

numba gives each thread its half beforehand; beside another busy program, or the threads of a live test, the thread
that lost its core for a while is waited for. Here too each begins with a half of its own, since pieces side by side
have much in common that is in its cache by then; but it takes a piece at a time, and goes on with what others have
left. A thread that is held up has done less in the end. What is computed does not depend on who does it.

980 ZOIs of 64 px beside a program that takes half of one core: 22 ms a frame (median) in place of 69; beside one that
takes a whole core 27 in place of 90; alone the same (2 cores, November 2026). Loops of some nanoseconds a ZOI are not
shared: each start of the threads is one more wait for the slower.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.imputils import impl_ret_untracked
from numba.extending import intrinsic

from analysis.compiled.layer import caller_works
from analysis.compiled.loops import helper

LINUX = sys.platform == "linux"
SHARES = 64
"""Ranges that the pieces are cut into, whatever the number of threads; a thread begins with the first of its share of
them and goes through all. For so many threads at most there is work."""
_WORDS = 16
"""Of 64 bits: as many cores as the C library's own sets have."""
_INT, _LONG = ir.IntType(32), ir.IntType(64)


def _call(builder: Any, name: str, gives: Any, arguments: list[Any]) -> Any:
    kind = ir.FunctionType(gives, [argument.type for argument in arguments])
    return builder.call(cgutils.get_or_insert_function(builder.module, kind, name), arguments)


@intrinsic
def _thread(_typing: Any) -> Any:
    """Which thread this is."""
    return types.int64(), lambda _context, builder, _signature, _arguments: _call(
        builder, "pthread_self", _LONG, []
    )


@intrinsic
def _core(_typing: Any) -> Any:
    """On which core this thread runs."""
    return types.int32(), lambda _context, builder, _signature, _arguments: _call(
        builder, "sched_getcpu", _INT, []
    )


def _affinity(name: str) -> Any:
    """sched_getaffinity or sched_setaffinity of this thread, with a set as (_WORDS,) uint64; 0 where it is done."""

    @intrinsic
    def affinity(_typing: Any, cores: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
            this, size = ir.Constant(_INT, 0), ir.Constant(_LONG, 8 * _WORDS)
            return _call(builder, name, _INT, [this, size, data])

        return types.int32(cores), generate

    return affinity


_get_cores, _set_cores = _affinity("sched_getaffinity"), _affinity("sched_setaffinity")


@helper
def caller() -> Any:
    """The thread that calls a loop, its cores, and which thread has which of them; for ``keep_apart``."""
    cores, taken = np.zeros(_WORDS, np.uint64), np.zeros(64 * _WORDS, np.int64)
    if not LINUX or _get_cores(cores) != 0:
        return np.int64(0), cores, taken[:0]
    thread = _thread()
    if caller_works():
        taken[_core()] = thread
    return thread, cores, taken


@helper
def keep_apart(calling: Any) -> None:
    """Go to another core, if this is another thread than the one that has this core; and stay off that one.

    A caller that works has its core. One that only waits has none: its threads have the cores that they begin on.
    """
    thread, cores, taken = calling
    if not LINUX or taken.size == 0 or _thread() == thread:
        return
    core, this = _core(), _thread()
    if taken[core] == 0 and not caller_works():
        taken[core] = this
    if taken[core] == 0 or taken[core] == this:
        return
    others = cores.copy()
    others[core // 64] &= ~(np.uint64(1) << np.uint64(core % 64))
    if others.any():
        _set_cores(others)


@helper
def next_piece(counters: Any, share: int, pieces: int) -> Any:
    """The number of the next of so many pieces, from the range ``share`` on; -1 when all are taken.

    ``counters`` (SHARES,) int64, zero at first, has how many of each range are taken.
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
