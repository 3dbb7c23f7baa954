"""Small programs of plain functions on floats, without a scene: the same bits interpreted and compiled."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators.steps.terms import docstring
from pendulum_env.common.sources import ours
from pendulum_env.engine.kernels import Backend, functions
from pendulum_env.engine.reading import arguments
from pendulum_env.engine.source import Plain, constants_text, copied, with_callees

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Kernel:
    """A program of functions on floats and loops over arrays.

    Attributes:
        text: the source.
        title: a name for file names and messages.
        python_functions: always (), as all of its functions can be compiled.
        own: True if it holds functions of a user.
    """

    text: str
    title: str
    python_functions: tuple[tuple[str, Plain], ...] = ()
    own: bool = False


def kernel(called: Sequence[Plain], loops: Sequence[str], title: str) -> Kernel:
    """Return a program that holds copies of the functions ``called``, of all that they call, and the ``loops``.

    ``loops`` are sources of functions, with the decorators ``@inline`` or ``@entry``.
    """
    copies = with_callees(called)
    body = "\n\n".join([copied(copies), *loops])
    head = f"{docstring(title)}\n" + ("from math import sqrt\n" if "sqrt(" in body else "")
    return Kernel("\n\n".join([head + constants_text(copies), body]), title, own=not all(map(ours, called)))


@lru_cache(maxsize=256)
def _loop_over(function: Plain, copies: tuple[Plain, ...]) -> Kernel:
    """Return the program of a loop that calls a function of floats for every element of arrays.

    ``copies`` are the functions that it holds, so that it is made anew if a constant of theirs has changed.
    """
    names = arguments(function)
    loop = "\n".join([
        "@entry",
        f"def fill(out, {', '.join(names)}):",
        "    for i in range(len(out)):",
        f"        out[i] = {function.__name__}({', '.join(f'{name}[i]' for name in names)})",
        "",
    ])
    return kernel([function], [loop], f"every {function.__name__}")


def elementwise(function: Plain, backend: Backend) -> Callable[..., Array]:
    """Return a function of arrays that calls a function of floats for every element; its arrays have one length.

    Raises EngineError for a backend that is not available.
    """
    fill: Callable[..., Any] = functions(_loop_over(function, tuple(with_callees([function]))), backend)["fill"]

    def over(*arrays: Array) -> Array:
        out = np.empty(len(arrays[0]))
        fill(out, *map(np.ascontiguousarray, arrays))
        return out

    return over
