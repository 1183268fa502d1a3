"""Asking the processor for memory that will be read soon: rows in no order, which it cannot foresee."""

from __future__ import annotations

from typing import Any

from numba import config, types
from numba.extending import intrinsic
from numpy.typing import NDArray

_READ, _NEAR, _DATA = 0, 3, 1
"""Arguments of LLVM's prefetch: to be read, kept in the nearest cache, not code."""


@intrinsic
def _ask_for(typing_context: Any, array: Any, row: Any, column: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        from llvmlite import ir

        view = context.make_array(signature.args[0])(context, builder, arguments[0])
        place = builder.ptrtoint(view.data, ir.IntType(64))
        for axis in range(2):
            stride = builder.extract_value(view.strides, axis)
            place = builder.add(place, builder.mul(stride, arguments[1 + axis]))
        pointer = ir.IntType(8).as_pointer()
        word = ir.IntType(32)
        asks = ir.FunctionType(ir.VoidType(), [pointer, word, word, word])
        function = builder.module.declare_intrinsic("llvm.prefetch", [pointer], asks)
        builder.call(function, [builder.inttoptr(place, pointer), word(_READ), word(_NEAR), word(_DATA)])
        return context.get_dummy_value()

    return types.void(array, types.intp, types.intp), generate


def _nothing(rows: NDArray[Any], row: int, column: int) -> None:
    """Without a compiler there is nothing to ask for."""


_settings: Any = config  # numba fills this module at run time
prefetch: Any = _nothing if _settings.DISABLE_JIT else _ask_for
"""prefetch(rows, row, column) asks for the line of memory on which an entry of an array is; it changes no result."""
