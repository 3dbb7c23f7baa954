"""How numba compiles a generated program: every function is optimised once, inside the function that Python calls.

By itself numba optimises each function together with all that it calls, and translates it to machine code. In a
generated program, functions call each other several levels deep and are always inlined, so the innermost would be
optimised at every level, and only the code of the outermost is used. Here the inner functions stay as they are until
the outermost is optimised. That takes three quarters of the time, and no bit of a result depends on it, because no
pass of the optimiser may change a floating-point operation. Short functions are written in place of their calls before
that; see :mod:`pendulum_env.engine.folding`. In runs of one pendulum, sums of long Taylor series are paired; see
:mod:`pendulum_env.engine.pairs`. Both are left out in programs with functions of a user.

numba has no public way to choose this, so that this module replaces methods of its class CodeLibrary.
"""

from __future__ import annotations

import gc
from collections.abc import Callable
from typing import Any

from numba.core import codegen, compiler

from pendulum_env.engine.folding import folded
from pendulum_env.engine.kernels import TEXT
from pendulum_env.engine.pairs import NAME, paired, two_sums

__all__ = ["Entry", "Inlined", "Separate"]


class _Unloaded:
    """numba's code generator for functions that are not loaded: they have no variable that could be set."""

    def __init__(self, generator: Any) -> None:
        self._generator = generator

    def __getattr__(self, name: str) -> Any:
        return getattr(self._generator, name)

    def set_env(self, name: str, value: Any) -> None:
        """Do nothing: ``name`` is the variable of a function with the objects of Python that it uses, such as None."""


class _Optimised(codegen.JITCodeLibrary):  # type: ignore[misc]
    """Code of a function that Python calls, with all that it inlines: optimised once, as a whole."""

    def _optimize_functions(self, module: Any) -> None:
        module.data_layout = self._codegen._data_layout

    def _optimize_final_module(self) -> None:
        passes = self._codegen._module_pass_manager()
        if isinstance(passes, tuple):  # numba 0.62 and later
            passes[0].run(self._final_module, passes[1])
        else:
            passes.run(self._final_module)


class _Unoptimised(_Optimised):
    """Code of a function that others inline: neither optimised nor translated to machine code."""

    @property
    def codegen(self) -> Any:
        return _Unloaded(self._codegen)

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Return 0: the function has no machine code."""
        return 0


def _rewritten(function: Callable[..., Any]) -> Any:
    """Return a function of a program, whose short functions are written in place of their calls.

    In runs of one pendulum, pairs of sums are calls of ``two_sums``.
    """
    names = function.__globals__
    if TEXT not in names:
        return function
    text = folded(names[TEXT])
    if function.__name__ == "run":
        text = paired(text)
    fewer: dict[str, Any] = {"__name__": names["__name__"], NAME: two_sums}
    exec(compile(text, function.__code__.co_filename, "exec"), fewer)
    return fewer[function.__name__].py_func


class Entry(compiler.Compiler):  # type: ignore[misc]
    """numba's compiler for the functions of a program that Python calls, with all that they inline."""

    def compile_extra(self, function: Any) -> Any:
        """Compile without looking for garbage in between, which would take some 5 % of the time."""
        collects = gc.isenabled()
        gc.disable()
        try:
            return super().compile_extra(_rewritten(function))
        finally:
            if collects:
                gc.enable()

    def define_pipelines(self) -> Any:
        self.state.library = _Optimised(self.state.targetctx.codegen(), "entry")
        self.state.library.enable_object_caching()
        return super().define_pipelines()


class Inlined(compiler.Compiler):  # type: ignore[misc]
    """numba's compiler for the functions of a program that its other functions inline."""

    def define_pipelines(self) -> Any:
        self.state.library = _Unoptimised(self.state.targetctx.codegen(), "inlined")
        return super().define_pipelines()


class Separate(Inlined):
    """numba's compiler for inlined functions whose arrays never overlap, so that nothing has to check this."""

    def define_pipelines(self) -> Any:
        self.state.flags.noalias = True
        return super().define_pipelines()
