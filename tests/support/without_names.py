"""Every name of numba or llvmlite that the package uses is removed in turn; what runs then, and with which bits.

Prints one line for each name: the backend, the number of warnings, and a digest of what runs and of a frame. The first
line is that of the whole numba. Each name has a process of its own, with an empty cache. Names are found in the sources
of the engine; words of the command line choose some of them.
"""

from __future__ import annotations

import ast
import hashlib
import importlib
import os
import sys
import tempfile
import traceback
import warnings
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import gymnasium as gym
import numpy as np
import pygame  # noqa: F401  before the processes divide, which saves each of them the time

from pendulum_env import rollout
from pendulum_env.engine import kernels
from pendulum_env.render import Apparatus, View, frame

MODULES = ("atomic", "compiling", "kernels", "lanes", "llvm")
"""Modules of the engine that import numba; "PREAMBLE" of kernels is one, too."""
LIBRARY, GENERATOR = "numba.core.codegen:JITCodeLibrary", "numba.core.codegen:JITCPUCodegen"
OF_CLASSES = (
    *(f"{LIBRARY}.{name}" for name in (
        "_codegen", "_final_module", "_finalized", "_optimize_functions", "_optimize_final_module",
        "_finalize_final_module", "_finalize_dynamic_globals", "codegen", "enable_object_caching",
        "get_pointer_to_function")),
    *(f"{GENERATOR}.{name}" for name in ("_data_layout", "_module_pass_manager", "magic_tuple", "set_env")),
    "numba.core.compiler:CompileResult._reduce", "numba.core.compiler:CompileResult._rebuild",
    "numba.core.compiler:CompilerBase.compile_extra", "numba.core.compiler:Compiler.define_pipelines",
    "numba.core.dispatcher:Dispatcher._cache", "numba.core.dispatcher:Dispatcher.targetoptions",
    "numba.core.dispatcher:Dispatcher.py_func", "numba.core.runtime:rtsys.initialize",
    "numba.core.cgutils:_StructProxy._getvalue", "numba.core.base:BaseContext.make_array",
)
"""Names that the engine uses of objects, which their classes have."""


def imported() -> Iterator[str]:
    """Yield the names that the engine takes from modules of numba, as "module:name"."""
    folder = Path(str(kernels.__file__)).parent
    texts = [(folder / f"{module}.py").read_text("utf-8") for module in MODULES]
    for text in (*texts, kernels.PREAMBLE):
        tree, modules = ast.parse(text), {}
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and str(node.module).startswith("numba"):
                for alias in node.names:
                    yield f"{node.module}:{alias.name}"
                    modules[alias.name] = f"{node.module}.{alias.name}"
        for node in ast.walk(tree):
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in modules:
                place = modules[node.value.id]
                if place in sys.modules or place == "numba.core.cgutils.ir":
                    yield f"{place}:{node.attr}"


class Gone:
    """An attribute that cannot be read or set, in place of one that objects have."""

    def __get__(self, *_: object) -> Any:
        raise AttributeError("gone")

    __set__ = __get__


def remove(name: str) -> None:
    """Remove a name, "module:name" or "module:class.name"."""
    module, _, path = name.partition(":")
    *classes, last = path.split(".")
    if not classes:
        replace_module(module, last)
        return
    place: Any = importlib.import_module(module)
    for one in classes:
        place = getattr(place, one)
    place = place if isinstance(place, type) else type(place)
    for one in (place, *place.__mro__):
        if last in vars(one):
            delattr(one, last)
    setattr(place, last, Gone())


def replace_module(module: str, gone: str = "", **new: Any) -> None:
    """Put a copy without a name, and with others, in a module's place; what numba has imported keeps the module."""
    above, _, own = module.rpartition(".")
    copy, found = ModuleType(module), sys.modules.get(module) or getattr(sys.modules[above], own)
    vars(copy).update({**vars(found), **new})
    vars(copy).pop(gone, None)
    if f"{module}.{gone}" in sys.modules or not hasattr(found, gone):
        sys.modules[f"{module}.{gone}"] = None  # type: ignore[assignment]
    if module in sys.modules:
        sys.modules[module] = copy
        if above:
            setattr(sys.modules[above], own, copy)
    else:
        replace_module(above, **{own: copy})


def outcome() -> str:
    """Run programs of one and of several pendulums and paint a frame; return backend, warnings and a digest."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        several = gym.make_vec("pendulum_env:LabPendulum-v0", num_envs=3, num_threads=2, integrator="symplectic_euler",
                               diagnostics=())
        several.reset(seed=1)
        parts = [rollout("vacuum", integrator="symplectic_euler", duration=0.02, diagnostics=()).angle,
                 *several.step(np.full((3, 1), 0.5, np.float32))[:2],
                 frame(Apparatus(length=0.353, bob_radius=0.0107, suspension="wire"), View(0.0, 0.5), size=64)]
    digest = hashlib.sha256(b"".join(np.ascontiguousarray(part).tobytes() for part in parts)).hexdigest()[:16]
    text = "; ".join(sorted({str(one.message).partition("; programs")[0] for one in caught}))
    return f"{kernels.resolve()} {len(caught)} {digest} {text}"


def main() -> None:
    import numba.core.codegen
    import numba.np.arrayobj
    import numba.np.npyimpl  # noqa: F401  modules that numba would import later keep what they import now

    names = [*dict.fromkeys((*imported(), *OF_CLASSES))]
    for name in ("nothing", *(names if len(sys.argv) < 2 else sys.argv[1:])):
        assert name in ("nothing", *names), name
        sys.stdout.flush()
        child = os.fork()
        if not child:
            with tempfile.TemporaryDirectory() as folder:
                os.environ["LAB_PENDULUM_CACHE"] = folder
                try:
                    if name != "nothing":
                        remove(name)
                    print(name, outcome(), flush=True)
                except BaseException:
                    print(name, traceback.format_exc(limit=-3).replace("\n", " "), flush=True)
            os._exit(0)
        os.waitpid(child, 0)


if __name__ == "__main__":
    main()
