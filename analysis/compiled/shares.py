"""Sharing work among threads as they come for it.

numba gives each thread its half beforehand; beside another busy program, or the threads of a live test, the thread
that lost its core for a while is waited for. Here each takes the next piece when it has done one, and a thread that
is held up has done less in the end. What is computed does not depend on who does it.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core import types
from numba.core.imputils import impl_ret_untracked
from numba.extending import intrinsic

SHARES = 256
"""For so many threads at most there is work: one that finds none left is done at once."""


@intrinsic
def next_piece(_typing: Any, counter: Any) -> Any:
    """The number of the next piece, from 0 on; ``counter`` (1,) int64 is counted up, by one thread at a time."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array = context.make_array(signature.args[0])(context, builder, arguments[0])
        before = builder.atomic_rmw("add", array.data, ir.Constant(ir.IntType(64), 1), "monotonic")
        return impl_ret_untracked(context, builder, types.int64, before)

    return types.int64(counter), generate
