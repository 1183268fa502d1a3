"""Rows of numbers in no order, gathered into columns: four by four they are transposed in registers.

Copied number by number, a row takes as many stores as it has numbers, which is more than what is computed of it takes.
"""

from __future__ import annotations

from typing import Any

from numba import config, types
from numba.extending import intrinsic
from numpy.typing import NDArray

_FOUR = 4

# of pairs of rows: how numbers of two are interleaved, then halves of two pairs put together; in doubles, where vectors
# are two halves, no number changes its half in the first step
_PAIRS = {"double": ((0, 4, 2, 6), (1, 5, 3, 7)), "float": ((0, 4, 1, 5), (2, 6, 3, 7))}
_HALVES = ((0, 1, 4, 5), (2, 3, 6, 7))
_ORDER = {"double": (0, 2, 1, 3), "float": (0, 1, 2, 3)}


@intrinsic
def _transpose(
    typing_context: Any, rows: Any, which: Any, first: Any, column: Any, to: Any, place: Any, step: Any
) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        from llvmlite import ir

        source, index, target = (
            context.make_array(signature.args[k])(context, builder, arguments[k]) for k in (0, 1, 4)
        )
        kind = "float" if signature.args[0].dtype == types.float32 else "double"
        number = ir.FloatType() if kind == "float" else ir.DoubleType()
        doubles = ir.VectorType(ir.DoubleType(), _FOUR)
        word = ir.IntType(64)
        first, column, place, step = (arguments[k] for k in (2, 3, 5, 6))
        width = builder.extract_value(source.shape, 1)

        def mixed(a: Any, b: Any, order: tuple[int, ...]) -> Any:
            return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(ir.IntType(32), _FOUR), list(order)))

        loaded = []
        for k in range(_FOUR):
            row = builder.load(builder.gep(index.data, [builder.add(first, word(k))]))
            at = builder.gep(source.data, [builder.add(builder.mul(row, width), column)])
            four = builder.load(builder.bitcast(at, ir.VectorType(number, _FOUR).as_pointer()))
            four.align = 4 if kind == "float" else 8
            loaded.append(four)
        pairs = [mixed(loaded[k], loaded[k + 1], order) for order in _PAIRS[kind] for k in (0, 2)]
        columns = [mixed(pairs[k], pairs[k + 1], order) for k in (0, 2) for order in _HALVES]
        for k, found in enumerate(_ORDER[kind]):
            values = columns[found] if kind == "double" else builder.fpext(columns[found], doubles)
            at = builder.gep(target.data, [builder.add(place, builder.mul(step, word(k)))])
            builder.store(values, builder.bitcast(at, doubles.as_pointer()), align=8)
        return context.get_dummy_value()

    return types.void(rows, which, types.int64, types.int64, to, types.int64, types.int64), generate


def _number_by_number(
    rows: NDArray[Any], which: NDArray[Any], first: int, column: int, to: NDArray[Any], place: int, step: int
) -> None:
    for k in range(_FOUR):
        for row in range(_FOUR):
            to[place + k * step + row] = rows[which[first + row], column + k]


_settings: Any = config  # numba fills this module at run time
transpose_four: Any = _number_by_number if _settings.DISABLE_JIT else _transpose
"""transpose_four(rows, which, first, column, to, place, step) writes four numbers, from `column` on, of the four rows
which[first : first + 4] to `to`: of number k, those of all four rows from place + k step on."""
