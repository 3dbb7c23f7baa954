"""Programs typed sooner: numba is asked once, not each time, of which type a sum or a product of numbers is.

Most of the time that a program takes to compile is numba's search for the types of its operations: for each ``a + b``
it tries ten templates, those of NumPy among them. The answer follows from the types of the arguments, so that it is
kept for plain numbers and their arrays. What is compiled stays the same (engine/test_quick_typing.py).
"""

from __future__ import annotations

from contextlib import suppress
from typing import Any


def remember_types() -> None:
    """Keep the signatures that numba has found for operations on numbers and arrays, for as long as this process lives.

    Numba has no public way to do so. Where it is absent, or its own way has changed, nothing is done.
    """
    with suppress(ImportError, AttributeError):
        from numba.core import types
        from numba.core.types.functions import BaseFunction

        search = BaseFunction.get_call_type

        def signature(self: Any, context: Any, args: Any, kws: Any) -> Any:
            if kws or not all(isinstance(kind, (types.Number, types.Boolean, types.Array)) for kind in args):
                return search(self, context, args, kws)
            key = (self, context, args)
            if key not in KNOWN:
                KNOWN[key] = search(self, context, args, kws)
            return KNOWN[key]

        BaseFunction.get_call_type = signature


KNOWN: dict[Any, Any] = {}
"""Signatures by function, context and types of arguments."""
