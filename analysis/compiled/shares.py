"""A loop in shares: one compiled function that runs any other one on all threads.

numba's own parallel loops are compiled anew for each body: its analysis, a kernel, the wrapper of the kernel and the
function around it, each with all the code of the body, which LLVM then translates four times. Here the threads call the
body by its address, with a pointer to its arguments, and the same bits come of it (November 2026). The iteration stays
with numba's own loops (``loops.parallel``): by address it takes 12 to 30 % longer, and what for was not found.
"""

from __future__ import annotations

from typing import Any

import numba
from llvmlite import ir
from numba import prange
from numba.core import cgutils, types
from numba.core.types.containers import UniTuple
from numba.extending import intrinsic

from analysis.compiled.loops import FAST, stamped
from analysis.compiled.threads import SHARES, caller, keep_apart

_SHARE = (types.voidptr, types.int64)
"""What a share is called with: the address of its arguments, and its number."""


@intrinsic
def _addresses(typing: Any, function: Any, arguments: Any) -> Any:
    """Addresses of ``function(*arguments, share)``, as it is called by ``_share_of``, and of its arguments.

    The arguments are valid until the function that this is called in returns.
    """
    inner = function.get_call_type(typing, (*arguments.types, types.int64), {})

    def generate(context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        convention, packed = context.call_conv, cgutils.alloca_once_value(builder, values[1])
        kind, module = convention.get_function_type(types.none, _SHARE), builder.module
        shared = ir.Function(module, kind, module.get_unique_name("phasedic_share"))
        shared.linkage = "internal"
        convention.decorate_function(shared, ["arguments", "share"], _SHARE)
        body = ir.IRBuilder(shared.append_basic_block("entry"))
        pointer, share = convention.get_arguments(shared)
        each = cgutils.unpack_tuple(body, body.load(body.bitcast(pointer, packed.type)))
        context.get_function(function, inner)(body, [*each, share])
        convention.return_value(body, context.get_dummy_value())
        size = context.get_value_type(types.intp)
        found = [builder.ptrtoint(shared, size), builder.ptrtoint(packed, size)]
        return context.make_tuple(builder, UniTuple(types.intp, 2), found)

    return UniTuple(types.intp, 2)(function, arguments), generate


@intrinsic
def _share_of(_typing: Any, address: Any, arguments: Any, share: Any) -> Any:
    """Do a share of a function by its address."""

    def generate(context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        convention = context.call_conv
        shared = builder.inttoptr(values[0], convention.get_function_type(types.none, _SHARE).as_pointer())
        pointer = builder.inttoptr(values[1], context.get_value_type(types.voidptr))
        convention.call_function(builder, shared, types.none, _SHARE, [pointer, values[2]])
        return context.get_dummy_value()

    return types.none(types.intp, types.intp, types.int64), generate


def _all_shares(address: int, arguments: int) -> None:
    calling = caller()
    for share in prange(SHARES):
        keep_apart(calling)
        _share_of(address, arguments, share)


_all_shares = stamped(
    numba.njit(_all_shares, error_model="numpy", fastmath=FAST, cache=True, nogil=True, parallel=True)
)


@numba.njit(inline="always")
def in_shares(function: Any, arguments: Any) -> None:
    """Call the compiled ``function(*arguments, share)`` for each ``share`` of SHARES, on all threads."""
    address, pointer = _addresses(function, arguments)
    _all_shares(address, pointer)


@numba.njit(inline="always")
def part_of(count: int, share: int) -> Any:
    """First and end of so many items that belong to a share, where all take equally long."""
    return count * share // SHARES, count * (share + 1) // SHARES
