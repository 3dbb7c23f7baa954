"""Whole numbers in memory that several threads read and change at once, and arrays at addresses that these hold.

Each access is one indivisible operation in the order of the program (sequentially consistent), so that what a thread
wrote before it changed such a number is seen by a thread that has read the change.
"""

from __future__ import annotations

from typing import Any

from numba import types
from numba.extending import intrinsic

__all__ = ["add", "floats", "load", "store"]

ORDER = "seq_cst"


def _at(context: Any, builder: Any, kind: Any, array: Any, index: Any) -> Any:
    """Return the address of the number ``array[index]``."""
    return builder.gep(context.make_array(kind)(context, builder, array).data, [index])


@intrinsic
def load(typing: Any, array: Any, index: Any) -> Any:
    """Return ``array[index]``."""
    def written(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.load_atomic(_at(context, builder, signature.args[0], *arguments), ORDER, 8)

    return types.int64(array, types.int64), written


@intrinsic
def store(typing: Any, array: Any, index: Any, value: Any) -> Any:
    """Set ``array[index]`` to ``value``."""
    def written(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        *place, new = arguments
        builder.store_atomic(new, _at(context, builder, signature.args[0], *place), ORDER, 8)
        return context.get_dummy_value()

    return types.none(array, types.int64, types.int64), written


@intrinsic
def add(typing: Any, array: Any, index: Any, value: Any) -> Any:
    """Add ``value`` to ``array[index]`` and return the number that was there before."""
    def written(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        *place, more = arguments
        return builder.atomic_rmw("add", _at(context, builder, signature.args[0], *place), more, ORDER)

    return types.int64(array, types.int64, types.int64), written


@intrinsic
def floats(typing: Any, address: Any, size: Any) -> Any:
    """Return the array of ``size`` float32 numbers that begins at an address in memory."""
    def written(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        from numba.np.arrayobj import populate_array  # 0.2 s, which machine code from the cache does without

        begin, count = arguments
        found, word = context.make_array(signature.return_type)(context, builder), context.get_constant(types.intp, 4)
        populate_array(found, data=builder.inttoptr(begin, found.data.type), shape=[count], strides=[word],
                       itemsize=word, meminfo=None)
        return found._getvalue()

    return types.Array(types.float32, 1, "C")(types.int64, types.int64), written
