"""How numba compiles a generated program: every function is optimised once, inside the function that Python calls.

By itself numba optimises each function together with all that it calls, and translates it to machine code. In a
generated program, functions call each other several levels deep and are always inlined, so the innermost would be
optimised at every level, and only the code of the outermost is used. Here the inner functions stay as they are until
the outermost is optimised. That takes three quarters of the time, and no bit of a result depends on it, because no
pass of the optimiser may change a floating-point operation. In programs without functions of a user, most of the
arithmetic is not left to numba; see :mod:`pendulum_env.engine.llvm`.

numba has no public way to choose this, so that this module replaces methods of its class CodeLibrary, and its function
``ensure_blas`` while the first program is prepared. Importing this module fails for a numba that lacks one of these
names, or one of those by which machine code is stored.
"""

from __future__ import annotations

import gc
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from numba.core import codegen, compiler, serialize
from numba.core.runtime import rtsys

from pendulum_env.common.checks import warn_once
from pendulum_env.engine.lanes import width
from pendulum_env.engine.llvm import CALL, LlvmProgram, instructions
from pendulum_env.engine.source import TEXT

__all__ = ["Entry", "Inlined", "Separate", "load_array_functions", "rebuilt", "stored"]

_REDUCE, _REBUILD, _DUMPS = compiler.CompileResult._reduce, compiler.CompileResult._rebuild, serialize.dumps
_START_RUNTIME = rtsys.initialize


def stored(result: Any) -> bytes:
    """Return a compiled function pickled, in the form in which numba's own cache stores it."""
    return bytes(_DUMPS(_REDUCE(result)))


def rebuilt(parts: Sequence[Any], context: Any, allocates: bool) -> Any:
    """Return a compiled function from the unpickled parts of :func:`stored`, ready to run if it makes objects, too."""
    if allocates:  # other machine code needs nothing of numba's runtime
        _START_RUNTIME(context)
    return _REBUILD(context, *parts)


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


@contextmanager
def _rewritten(function: Callable[..., Any], given: Sequence[Any], features: str) -> Iterator[Any]:
    """Give a function of a program whose arithmetic is written as instructions, for arguments of these types, and for
    a processor with these features.
    """
    names = function.__globals__
    if TEXT not in names:
        yield function
        return
    program = LlvmProgram(names[TEXT], function.__name__, given, width(features))
    rest: dict[str, Any] = {"__name__": names["__name__"], CALL: instructions}
    # A name of its own: numba reads the lines of a file that is there, and those of the program's are others.
    exec(compile(program.text, f"<lab-pendulum {function.__name__}, as instructions>", "exec"), rest)
    try:
        yield rest[function.__name__].py_func
    finally:
        program.forget()


class _Prepared(compiler.Compiler):  # type: ignore[misc]
    """numba's compiler without imports that no generated program needs."""

    def __init__(self, *given: Any, **named: Any) -> None:
        load_array_functions()
        super().__init__(*given, **named)


class _Whole(_Prepared):
    """numba's compiler for a function that Python calls: optimised once, with all that it inlines."""

    def define_pipelines(self) -> Any:
        self.state.library = _Optimised(self.state.targetctx.codegen(), "entry")
        self.state.library.enable_object_caching()
        return super().define_pipelines()


class Entry(_Whole):
    """numba's compiler for a function that Python calls, after most of its arithmetic has been written as instructions.
    """

    def compile_extra(self, function: Any) -> Any:
        """Compile without looking for garbage in between, which would take some 5 % of the time."""
        _, _, features = self.state.targetctx.codegen().magic_tuple()
        collects = gc.isenabled()
        gc.disable()
        try:
            with _rewritten(function, self.state.args, features) as rewritten:
                return super().compile_extra(rewritten)
        except Exception as error:
            if TEXT not in function.__globals__:
                raise
            state = self.state
            result = _Whole(state.typingctx, state.targetctx, None, state.args, state.return_type, state.flags,
                            state.locals).compile_extra(function)
            warn_once(f"A program's arithmetic could not be written as instructions ({type(error).__name__}), so that "
                      "numba compiles all of it, which takes longer. The results are the same; please report it.")
            return result
        finally:
            if collects:
                gc.enable()


class Inlined(_Prepared):
    """numba's compiler for the functions of a program that its other functions inline."""

    def define_pipelines(self) -> Any:
        self.state.library = _Unoptimised(self.state.targetctx.codegen(), "inlined")
        return super().define_pipelines()


class Separate(Inlined):
    """numba's compiler for inlined functions whose arrays never overlap, so that nothing has to check this.

    :mod:`pendulum_env.engine.llvm` says the same of those that it writes.
    """

    def define_pipelines(self) -> Any:
        self.state.flags.noalias = True
        return super().define_pipelines()


for _own, _theirs in ((_Unloaded, codegen.JITCPUCodegen), (_Optimised, codegen.JITCodeLibrary),
                      (_Unoptimised, codegen.JITCodeLibrary), (_Whole, compiler.Compiler), (Entry, compiler.Compiler)):
    for _name in vars(_own):
        if not _name.startswith("__"):
            getattr(_theirs, _name)  # without a method of this name numba would go its own way
