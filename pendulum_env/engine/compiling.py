"""How numba compiles a generated program: every function is optimised once, inside the function that Python calls.

By itself numba optimises each function together with all that it calls, and translates it to machine code. In a
generated program, functions call each other several levels deep and are always inlined, so the innermost would be
optimised at every level, and only the code of the outermost is used. Here the inner functions stay as they are until
the outermost is optimised. That takes three quarters of the time, and no bit of a result depends on it, because no
pass of the optimiser may change a floating-point operation. Short functions are written in place of their calls before
that; see :mod:`pendulum_env.engine.folding`. In runs of one pendulum, sums of long Taylor series are paired; see
:mod:`pendulum_env.engine.pairs`. Passes of numba for parts of Python that no generated program has are left out. All
three are done only in programs without functions of a user.

numba has no public way to choose this, so that this module replaces methods of its class CodeLibrary, a method of its
class BaseFunction while a program is compiled, and its function ``ensure_blas`` while the first one is prepared.
"""

from __future__ import annotations

import gc
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from numba.core import codegen, compiler, types
from numba.core.compiler_lock import global_compiler_lock
from numba.core.types.functions import BaseFunction

from pendulum_env.engine.folding import folded
from pendulum_env.engine.kernels import TEXT
from pendulum_env.engine.pairs import NAME, paired, two_sums

__all__ = ["LEFT_OUT", "SIGNATURES", "Entry", "Inlined", "Separate", "load_array_functions", "remembered_types"]


LEFT_OUT = {
    "WithLifting", "InlineClosureLikes", "RewriteDynamicRaises", "MakeFunctionToJitFunction", "LiteralUnroll",
    "FindLiterallyCalls", "LiteralPropagationSubPipelinePass", "RewriteSemanticConstants", "DeadBranchPrune",
    "InlineInlinables", "InlineOverloads", "NopythonRewrites", "AnnotateTypes", "DumpParforDiagnostics",
}
"""Names of numba's passes that change nothing in a generated program. They are for blocks ``with``, closures,
exceptions, branches that are known before the program runs, tuples of several types, and operations on whole arrays;
``AnnotateTypes`` is for printing, and ``DumpParforDiagnostics`` for ``parallel=True``."""


def load_array_functions() -> None:
    """Import numba's functions of arrays without scipy.linalg, which would take a tenth of the first compilation.

    numba imports scipy.linalg to see if it is there, and once more wherever a function needs it; no program does.
    """
    if "numba.np.arraymath" in sys.modules:
        return
    from numba.np import linalg

    import_them = linalg.ensure_blas
    linalg.ensure_blas = lambda: None
    try:
        from numba.np import arraymath
    finally:
        linalg.ensure_blas = import_them
    arraymath.ensure_blas = import_them


SIGNATURES: dict[tuple[Any, ...], Any] = {}
"""Signatures that numba has found, by function, context and types of the arguments."""


@contextmanager
def remembered_types() -> Iterator[None]:
    """Have numba search only once for the types of an operation on numbers or arrays, while one thread compiles.

    For each ``a + b``, numba tries ten templates, those of NumPy among them, and a program has the same few operations
    hundreds of times. What is compiled stays the same. Functions that numba compiles from Python, such as ``max``, are
    searched each time: there are several of them, one for each set of options.
    """

    def signature(self: Any, context: Any, args: Any, kws: Any) -> Any:
        if kws or not all(isinstance(kind, (types.Number, types.Boolean, types.Array)) for kind in args):
            return search(self, context, args, kws)
        key = self, context, args
        if key in SIGNATURES:
            return SIGNATURES[key]
        found = search(self, context, args, kws)
        if self.get_impl_key(found) is self.typing_key:
            SIGNATURES[key] = found
        return found

    with global_compiler_lock:
        search = BaseFunction.get_call_type
        BaseFunction.get_call_type = signature  # type: ignore[method-assign]
        try:
            yield
        finally:
            BaseFunction.get_call_type = search  # type: ignore[method-assign]


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
    fewer: dict[str, Any] = {"__name__": names["__name__"], NAME: two_sums, TEXT: text}
    exec(compile(text, function.__code__.co_filename, "exec"), fewer)
    return fewer[function.__name__].py_func


class _Shorter(compiler.Compiler):  # type: ignore[misc]
    """numba's compiler without the imports and passes that a generated program does not need."""

    def __init__(self, *given: Any, **named: Any) -> None:
        load_array_functions()
        super().__init__(*given, **named)

    def define_pipelines(self) -> Any:
        pipelines = super().define_pipelines()
        if TEXT in self.state.func_id.func.__globals__:
            for pipeline in pipelines:
                pipeline.passes = [one for one in pipeline.passes if one[0].__name__ not in LEFT_OUT]
        return pipelines


class Entry(_Shorter):
    """numba's compiler for the functions of a program that Python calls, with all that they inline."""

    def compile_extra(self, function: Any) -> Any:
        """Compile without looking for garbage in between, which would take some 5 % of the time."""
        collects = gc.isenabled()
        gc.disable()
        try:
            with remembered_types():
                return super().compile_extra(_rewritten(function))
        finally:
            if collects:
                gc.enable()

    def define_pipelines(self) -> Any:
        self.state.library = _Optimised(self.state.targetctx.codegen(), "entry")
        self.state.library.enable_object_caching()
        return super().define_pipelines()


class Inlined(_Shorter):
    """numba's compiler for the functions of a program that its other functions inline."""

    def define_pipelines(self) -> Any:
        self.state.library = _Unoptimised(self.state.targetctx.codegen(), "inlined")
        return super().define_pipelines()


class Separate(Inlined):
    """numba's compiler for inlined functions whose arrays never overlap, so that nothing has to check this."""

    def define_pipelines(self) -> Any:
        self.state.flags.noalias = True
        return super().define_pipelines()
