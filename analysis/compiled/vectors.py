"""Explicit vectors of float32 in compiled loops: numba's own vectors leave half of the processor idle.

A loop over pixels that numba turns into vectors by itself first checks that its arrays do not overlap,
which for a row of 32 pixels takes as long as the row, and uses half of a 512-bit unit. With these
functions a compiled loop handles ``LANES`` pixels at a time, with + - * between vectors. Any array is
taken as flat memory, C order, and nothing is checked: index .. index + LANES must lie inside.

A row of 32 px took 62 ns in place of 175 (Xeon with AVX-512, numba 0.68, November 2026). Tried and rejected: 512-bit
vectors made by the compiler against LLVM's preference (3 to 10 % faster without rotation, 10 % slower with it); helpers
left to the compiler to inline (5.3 us an iteration, inlined by numba 3.3).
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

import llvmlite.binding as llvm
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.imputils import lower_builtin
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, models, register_model

from analysis.compiled.loops import FAST

PROCESSOR: str = llvm.get_host_cpu_name()
LANES: int = 16 if llvm.get_host_cpu_features().get("avx512f") else 8
FLAGS = tuple(sorted(FAST))
"""What the compiler may do with the order of sums."""
_FLOAT = ir.FloatType()
_VECTOR = ir.VectorType(_FLOAT, LANES)
_INT = ir.IntType(32)
_BYTES = ir.IntType(8).as_pointer()
_ALIGNMENT = 4
"""Bytes: a vector may start at any sample."""
_POINTER = 64
"""Bits of an address."""


def whole(size: int) -> int:
    """``size`` rounded up to whole vectors."""
    return (size + LANES - 1) // LANES * LANES


class Vector(types.Type):
    """Type of LANES float32 inside compiled code."""

    def __init__(self) -> None:
        super().__init__("Vector")


vector = Vector()


@register_model(Vector)
class _VectorModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, numba_type: Any) -> None:
        super().__init__(manager, numba_type, _VECTOR)


def _define(operation: Callable[..., Any], instruction: str) -> None:
    """Let ``operation`` take two vectors."""

    class Rule(AbstractTemplate):  # type: ignore[misc]
        def generic(self, arguments: Any, _keywords: Any) -> Any:
            if len(arguments) == 2 and all(isinstance(a, Vector) for a in arguments):
                return signature(vector, vector, vector)
            return None

    def lower(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return getattr(builder, instruction)(*arguments, flags=FLAGS)

    infer_global(operation)(Rule)
    lower_builtin(operation, Vector, Vector)(lower)


for _operation, _instruction in (
    (operator.add, "fadd"), (operator.iadd, "fadd"), (operator.sub, "fsub"), (operator.mul, "fmul"),
):  # fmt: skip
    _define(_operation, _instruction)


def address_of(context: Any, builder: Any, array_type: Any, array: Any, index: Any) -> Any:
    """For other intrinsics: where a vector lies that begins at the flat ``index`` of an array."""
    data = context.make_array(array_type)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [index]), _VECTOR.as_pointer())


def load_of(builder: Any, place: Any) -> Any:
    """For other intrinsics: the vector at an address."""
    return builder.load(place, align=_ALIGNMENT)


def store_of(builder: Any, value: Any, place: Any) -> None:
    """For other intrinsics: a vector written to an address."""
    builder.store(value, place, align=_ALIGNMENT)


def spread_of(builder: Any, value: Any) -> Any:
    """For other intrinsics: a float32 in every lane."""
    empty = ir.Constant(_VECTOR, ir.Undefined)
    first = builder.insert_element(empty, value, ir.Constant(_INT, 0))
    return builder.shuffle_vector(first, empty, ir.Constant(ir.VectorType(_INT, LANES), [0] * LANES))


def fused_of(builder: Any, a: Any, b: Any, c: Any) -> Any:
    """For other intrinsics: a b + c."""
    kind = ir.FunctionType(_VECTOR, [_VECTOR] * 3)
    add = cgutils.get_or_insert_function(builder.module, kind, f"llvm.fmuladd.v{LANES}f32")
    return builder.call(add, [a, b, c], fastmath=FLAGS)


@intrinsic
def load(_typing: Any, array: Any, index: Any) -> Any:
    """LANES samples of a float32 array from the flat ``index`` (uintp) on."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return load_of(builder, address_of(context, builder, signature.args[0], *arguments))

    return vector(array, types.uintp), generate


@intrinsic
def load_samples(_typing: Any, array: Any, index: Any) -> Any:
    """LANES samples of a uint8, uint16 or float32 array from the flat ``index`` (uintp) on, as float32."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kind, (array, index) = signature.args[0], arguments
        place = builder.gep(context.make_array(kind)(context, builder, array).data, [index])
        each = context.get_data_type(kind.dtype)
        several = builder.bitcast(place, ir.VectorType(each, LANES).as_pointer())
        found = builder.load(several, align=kind.dtype.bitwidth // 8)
        return found if kind.dtype == types.float32 else builder.uitofp(found, _VECTOR)

    return vector(array, types.uintp), generate


@intrinsic
def address(_typing: Any, array: Any, index: Any) -> Any:
    """Where the flat ``index`` (uintp) of a float32 array lies in memory, for ``load_from``."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place = address_of(context, builder, signature.args[0], *arguments)
        return _opaque(builder, builder.ptrtoint(place, ir.IntType(_POINTER)))

    return types.uintp(array, types.uintp), generate


@intrinsic
def further(_typing: Any, place: Any, samples: Any) -> Any:
    """An address so many float32 (uintp) behind another."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        bytes_on = builder.mul(arguments[1], ir.Constant(arguments[1].type, _ALIGNMENT))
        return _opaque(builder, builder.add(arguments[0], bytes_on))

    return types.uintp(types.uintp, types.uintp), generate


def _opaque(builder: Any, value: Any) -> Any:
    """The same integer, of which the compiler forgets how it was made.

    Else it would add row and column anew in every load, and loads with an index register count twice
    where instructions are issued.
    """
    return builder.asm(ir.FunctionType(value.type, [value.type]), "", "=r,0", [value], False)


@intrinsic
def load_from(_typing: Any, place: Any, samples: Any) -> Any:
    """LANES samples so many float32 (a constant) behind an address."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        bytes_on = builder.mul(arguments[1], ir.Constant(arguments[1].type, _ALIGNMENT))
        return builder.load(
            builder.inttoptr(builder.add(arguments[0], bytes_on), _VECTOR.as_pointer()), align=_ALIGNMENT
        )

    return vector(types.uintp, types.uintp), generate


def _fetching(level: int) -> Any:
    """Prefetch of the cache line of a sample of a float32 array; any index (uintp) will do, it is not read."""

    @intrinsic
    def ask_for(_typing: Any, array: Any, index: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            place = builder.bitcast(address_of(context, builder, signature.args[0], *arguments), _BYTES)
            kind = ir.FunctionType(ir.VoidType(), [_BYTES, _INT, _INT, _INT])
            ask = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0i8")
            read, locality, data = (ir.Constant(_INT, i) for i in (0, 4 - level, 1))
            builder.call(ask, [place, read, locality, data])
            return context.get_dummy_value()

        return types.void(array, types.uintp), generate

    return ask_for


fetch_soon, fetch_later = _fetching(1), _fetching(2)
"""To the first level of the cache, for what is read next; to the second."""


@intrinsic
def store(_typing: Any, array: Any, index: Any, value: Any) -> Any:
    """Write a vector to a float32 array from the flat ``index`` (uintp) on."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        store_of(builder, arguments[2], address_of(context, builder, signature.args[0], *arguments[:2]))
        return context.get_dummy_value()

    return types.void(array, types.uintp, vector), generate


@intrinsic
def spread(_typing: Any, value: Any) -> Any:
    """A float32 in every lane."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return spread_of(builder, arguments[0])

    return vector(types.float32), generate


@intrinsic
def fused(_typing: Any, a: Any, b: Any, c: Any) -> Any:
    """a b + c in one instruction where the processor has it; a product used twice is not fused by itself."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return fused_of(builder, *arguments)

    return vector(vector, vector, vector), generate


@intrinsic
def above(_typing: Any, value: Any, limit: Any, yes: Any, no: Any) -> Any:
    """In each lane ``yes`` where value > limit, else ``no``."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.select(builder.fcmp_ordered(">", arguments[0], arguments[1]), *arguments[2:])

    return vector(vector, vector, vector, vector), generate


def _from_lane(first: int) -> Any:
    """LANES lanes of two vectors side by side, from the lane ``first`` on."""

    @intrinsic
    def lanes(_typing: Any, before: Any, after: Any) -> Any:
        def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
            each = ir.Constant(ir.VectorType(_INT, LANES), list(range(first, first + LANES)))
            return builder.shuffle_vector(*arguments, each)

        return vector(vector, vector), generate

    return lanes


ahead_1, ahead_2, ahead_4, ahead_8 = map(_from_lane, (1, 2, 4, 8))
"""Of a row of samples those so many further on, from a vector and the next one, ..."""
back_1, back_2, back_4, back_8 = (_from_lane(LANES - n) for n in (1, 2, 4, 8))
"""... and those so many back, from the vector before and a vector."""


@intrinsic
def total(_typing: Any, value: Any) -> Any:
    """Sum over the lanes, float32."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        kind = ir.FunctionType(_FLOAT, [_FLOAT, _VECTOR])
        add = cgutils.get_or_insert_function(builder.module, kind, f"llvm.vector.reduce.fadd.v{LANES}f32")
        return builder.call(add, [ir.Constant(_FLOAT, -0.0), arguments[0]], fastmath=FLAGS)

    return types.float32(vector), generate
