"""Records: named tuples of arrays that Python gives to kernels, which hand each other one address.

numba hands a named tuple down as all that it holds, each field of each array by itself: up to a thousand arguments a
call, which are packed and unpacked in every function on the way. That was half of what LLVM was given to optimise.
Here a record is laid down once, where Python calls, and a kernel that reads a field of it loads that field. A named
tuple that a kernel makes is one as numba has it.

The type is added to numba in its public way, but for names that stand inside it (`NEEDED`, see `compiler`). Nothing
writes to a record, and its address is marked as one that nobody else writes through (`linking`): fields are loaded
once, before loops, as arguments are.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import typeof, types
from numba.extending import (
    NativeValue,
    infer_getattr,
    lower_getattr_generic,
    models,
    register_model,
    typeof_impl,
    unbox,
)

NEEDED: tuple[tuple[Any, tuple[str, ...]], ...] = ()
"""What of numba is needed here: names by where they are; empty where it cannot be imported."""

try:
    from numba.core import cgutils, imputils
    from numba.core.typing.templates import AttributeTemplate

    NEEDED = (
        (cgutils, ("gep_inbounds", "alloca_once_value")),
        (imputils, ("impl_ret_borrowed",)),
        (AttributeTemplate, ("resolve",)),
    )
except ImportError:  # another numba
    AttributeTemplate: Any = object  # type: ignore[no-redef]


class Record(types.Type):  # type: ignore[misc]
    """The numba type of a record: a class of named tuples, and the types of its fields in order."""

    def __init__(self, named_tuple: Any, fields: tuple[Any, ...]) -> None:
        self.named_tuple, self.fields = named_tuple, fields
        parts = ", ".join(f"{name}: {field}" for name, field in zip(named_tuple._fields, fields, strict=True))
        super().__init__(name=f"{named_tuple.__module__}.{named_tuple.__qualname__}({parts})")


class RecordLayout(ir.LiteralStructType):  # type: ignore[misc]
    """How a record lies in memory; a class of its own, so that its address can be told from others."""


def is_address(kind: Any) -> bool:
    """Return whether an LLVM type is the address of a record."""
    return isinstance(getattr(kind, "pointee", None), RecordLayout)


def are_records(named_tuple: Any) -> None:
    """Let named tuples of a class that Python gives to kernels be records."""
    typeof_impl.register(named_tuple)(_type_of)


def _type_of(value: Any, context: Any) -> Record:
    return Record(type(value), tuple(typeof(field) for field in value))


@register_model(Record)
class _RecordModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, record: Record) -> None:
        parts = [manager.lookup(field).get_value_type() for field in record.fields]
        super().__init__(manager, record, ir.PointerType(RecordLayout(parts)))


class _Fields(AttributeTemplate):  # type: ignore[misc]
    key = Record

    def generic_resolve(self, record: Record, name: str) -> Any:
        names = record.named_tuple._fields
        return record.fields[names.index(name)] if name in names else None


if NEEDED:
    infer_getattr(_Fields)


@lower_getattr_generic(Record)  # type: ignore[untyped-decorator]
def _field(context: Any, builder: Any, record: Record, address: Any, name: str) -> Any:
    place = record.named_tuple._fields.index(name)
    value = builder.load(cgutils.gep_inbounds(builder, address, 0, place))
    return imputils.impl_ret_borrowed(context, builder, record.fields[place], value)


@unbox(Record)  # type: ignore[untyped-decorator]
def _laid_down(record: Record, value: Any, context: Any) -> Any:
    """Write what a named tuple holds to the stack of the function that Python calls, and give its arrays back."""
    held = types.NamedTuple(record.fields, record.named_tuple)
    native = context.unbox(held, value)
    address = cgutils.alloca_once_value(context.builder, native.value)

    def give_back() -> None:
        if native.cleanup is not None:
            native.cleanup()
        if context.context.enable_nrt:
            context.context.nrt.decref(context.builder, held, native.value)

    return NativeValue(address, is_error=native.is_error, cleanup=give_back)
