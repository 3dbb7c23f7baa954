"""Tests for equal bits on all Pythons, processors and systems, by stored digests and by the machine code."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import same_bits
from compiled_code import library_calls
from same_bits import FEW, GROUPS, KEPT, KINDS, found, stored
from stored import stored as entries

import integrators
from pendulum_env import SCENES, rollout
from pendulum_env.engine import kernels
from pendulum_env.physics.effects import EFFECTS
from pendulum_env.tasks import TASKS

DECLARED = re.compile(r'^declare [^@]*@"?([\w.$]+)"?\(', re.MULTILINE)
ALLOWED = re.compile(
    r"(Py|_Py|NRT_|numba_|llvm\.(?!sin|cos|tan|exp(?!erimental\.noalias)|log|pow|fma|fmuladd|ldexp|frexp|round|rint)|"
    r"sqrt$|memset$|memcpy$)"
)
"""External symbols allowed in a program: those of Python and numba, and the square root, an IEEE 754 instruction.

LLVM's ``experimental.noalias`` is a mark for its optimiser, no function.
"""
FUSED = re.compile(r"\b(?:vfn?m(?:add|sub)\w+|fn?m(?:add|sub|la|ls))\b")
QUICK_KINDS = ("interpreted", "compensated", "adaptive")


def test_every_method_and_scene_that_was_ever_there_has_a_digest() -> None:
    """Check that all methods and scenes have stored digests; ``python tests/support/regenerate.py`` adds new ones."""
    assert KEPT.keys() == GROUPS.keys()
    for group in ("motion", "environment"):
        pairs = [sample.split("/") for sample in KEPT[group]]
        assert {method for _, method in pairs} >= {*entries("methods")}
        assert {scene for scene, method in pairs if method == "rk4"} >= {*entries("scenes")}
        assert {*FEW} <= KEPT[group].keys()
    for digests in KEPT.values():
        assert len({*digests.values()}) == len(digests), "two motions have one digest"


def test_no_entry_is_lost() -> None:
    registries = {"methods": integrators.METHODS, "scenes": SCENES, "effects": EFFECTS, "tasks": TASKS}
    lost = [(kind, name) for kind, registry in registries.items() for name in entries(kind) if name not in registry]
    assert not lost


@pytest.mark.parametrize("kind", [
    kind if kind in QUICK_KINDS else pytest.param(kind, marks=pytest.mark.slow) for kind in KINDS
])
@pytest.mark.filterwarnings("ignore")
def test_stored_digests(kind: str) -> None:
    """Check the stored digests of all samples interpreted, and of a few samples compiled."""
    here, wanted = found(kind, few=kind not in (*QUICK_KINDS, "environment")), stored(kind)
    different = [sample for sample, digest in here.items() if wanted[sample] != digest]
    print(f"\n{kind}: {len(here)} digests, {same_bits.machine()}")
    assert here.keys() >= {*FEW} & wanted.keys()
    assert not different


# --- other processors and libraries ---------------------------------------------------------------------------------


WIDTHS = {
    "generic x86-64": ("x86", {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}),
    "haswell": ("avx2", {"NUMBA_CPU_NAME": "haswell", "NUMBA_CPU_FEATURES": "+avx,+avx2,+fma,+bmi,+bmi2,+sse4.2"}),
    "skylake-avx512": ("avx512f", {
        "NUMBA_CPU_NAME": "skylake-avx512",
        "NUMBA_CPU_FEATURES": "+avx,+avx2,+fma,+bmi,+bmi2,+sse4.2,+avx512f,+avx512vl,+avx512dq,+avx512bw,"
                              "-prefer-256-bit"}),
    "numpy and libm without vectors": ("x86", {
        "NPY_DISABLE_CPU_FEATURES": "AVX512F AVX512CD AVX512_SKX AVX2 FMA3", "OPENBLAS_CORETYPE": "Prescott",
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-AVX,-FMA,-FMA4,-AVX2_Usable,-FMA_Usable",
        "NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}),
}
"""Simulated processors: the features that this machine needs for them, and their environment variables."""
COMPILED = ("compiled", "batch", "vector environment")
ASKED = ("driven/rk4", "sticky_bearing/velocity_verlet")

ASKING = """
import json, sys, warnings
sys.path.insert(0, sys.argv[1])
warnings.simplefilter("ignore")
import same_bits
kinds, samples = json.loads(sys.argv[2])
digests = {kind: {each: same_bits.GROUPS[same_bits.KINDS[kind]][kind](each) for each in samples} for kind in kinds}
import numpy as np
from pendulum_env.engine.kernels import PREAMBLE
space = {}
exec(PREAMBLE + '''
@entry
def widths(x):
    for i in range(x.size):
        x[i] = x[i]*x[i] + 0.5
''', space)
space["widths"](np.ones(64))
(text,) = space["widths"].inspect_asm().values()
print(json.dumps([same_bits.machine(), digests, [name for name in ("zmm", "ymm", "xmm") if name in text]]))
"""


def has(feature: str) -> bool:
    """Return True if this machine's processor has a feature."""
    import platform

    from llvmlite.binding import get_host_cpu_features

    intel = platform.machine().lower() in ("x86_64", "amd64")
    return intel and (feature == "x86" or bool(get_host_cpu_features().get(feature)))


@pytest.mark.slow
@pytest.mark.parametrize("name", WIDTHS)
def test_other_processors(name: str, tmp_path: Path) -> None:
    pytest.importorskip("numba")
    feature, variables = WIDTHS[name]
    if not has(feature):
        pytest.skip(f"this processor has no {feature}")
    own = {**os.environ, **variables, "LAB_PENDULUM_CACHE": str(tmp_path / "cache")}
    support = str(Path(__file__).parents[1] / "support")
    done = subprocess.run([sys.executable, "-c", ASKING, support, json.dumps([COMPILED, ASKED])],
                          capture_output=True, text=True, env=own)
    assert done.returncode == 0, done.stderr
    machine, digests, registers = json.loads(done.stdout.splitlines()[-1])
    print(f"\n{name}: {machine}, registers {registers}")
    wide = {"skylake-avx512": "zmm", "haswell": "ymm"}.get(name, "xmm")
    assert registers[0] == wide, "the processor's name had no effect"
    for kind, each in digests.items():
        assert each == {sample: stored(kind)[sample] for sample in ASKED}, kind


# --- no library's functions -----------------------------------------------------------------------------------------


def kinds(scene: str, method: str) -> list[Callable[[], Any]]:
    """Return functions that compile every kind of program: single runs (plain, adaptive, compensated) and batches."""
    run = partial(rollout, scene, integrator=method, backend="compiled", duration=0.02, dt=0.01, warn=False)
    watched = ("energy", "heat_by_effect", *(("tension", "flow") if SCENES[scene].medium.viscosity else ()))
    adapted = bool(getattr(integrators.get(method), "embedded", ()))
    make = partial(gym.make_vec, "LabPendulum-v0", num_envs=3, scene=scene, integrator=method, backend="compiled")
    return [
        partial(run, diagnostics=watched), partial(run, compensated=True),
        *([partial(run, rtol=1e-6)] if adapted else []), partial(run, angle=np.array([0.1, 0.2])),
        lambda: make().reset(seed=1),
    ]


@pytest.fixture
def compiled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[list[Any]]:
    """Return a list that receives all functions that the engine compiles during the test, without a cache."""
    functions: list[Any] = []
    make = kernels.compiled

    def recording(*given: Any, **named: Any) -> Any:
        functions.append(make(*given, **named))
        return functions[-1]

    monkeypatch.setenv("LAB_PENDULUM_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(kernels, "compiled", recording)
    kernels.forget()
    yield functions
    kernels.forget()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*restarts:UserWarning")
@pytest.mark.parametrize(("scene", "method", "every"), [
    ("windy", "dopri5", True), ("driven", "velocity_verlet", True), ("lab", "implicit_midpoint", False),
    ("sticky_bearing", "rk4", False), ("vacuum", "exact", False), ("exercise", "ab4", False), ("lab", "taylor", False),
    ("vacuum", "discrete_gradient", False),
])
def test_no_kernel_calls_a_library(scene: str, method: str, every: bool, compiled: list[Any]) -> None:
    """Check that the machine code of every kind of program uses only external symbols of a short list."""
    pytest.importorskip("numba")
    works = kinds(scene, method)
    for work in works if every else works[:1]:
        work()
    functions = [each for loaded in compiled for each in loaded.values() if getattr(each, "overloads", None)]
    entries = [each for each in functions if not each.targetoptions.get("no_cpython_wrapper")]
    assert len(entries) >= len(works if every else works[:1])
    for function in entries:
        for source, text in zip(function.inspect_llvm().values(), function.inspect_asm().values(), strict=True):
            declared = DECLARED.findall(source)
            assert "PyErr_SetString" in declared, "the search finds nothing"
            assert [name for name in declared if not ALLOWED.match(name)] == []
            assert [name for name in library_calls(function) if not re.match(r"(llvm\.)?sqrt(\.|$)", name)] == []
            assert not re.search(r"[$@ ]sqrtf?\b", text), "the square root is no instruction"
            assert not FUSED.search("\n".join(line for line in text.splitlines() if line.startswith("\t")))


def test_little_and_big_endian_have_one_digest() -> None:
    values = np.linspace(0.0, 1.0, 7)
    assert same_bits.digest(values) == same_bits.digest(values.astype(">f8"))
