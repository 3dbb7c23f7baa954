"""The same bits on every Python, processor and operating system: against stored digests, and in the machine code."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import same_bits
from same_bits import FEW, GROUPS, KINDS, SAMPLES, found, stored
from test_elementary import library_calls

import integrators
from pendulum_env import SCENES
from pendulum_env.engine.generate import Program, batch_program, program
from pendulum_env.engine.kernels import PREAMBLE
from pendulum_env.tasks import TASKS

LIBM = re.compile(r"\b(?:sin|cos|tan|exp2?|expm1|log|log1p|log2|log10|pow|fma|fmod|ldexp|frexp|hypot|cbrt|"
                  r"__svml_\w+|_ZGV\w+)f?(?:@PLT)?\b")
FUSED = re.compile(r"\b(?:vfn?m(?:add|sub)\w+|fn?m(?:add|sub|la|ls))\b")
QUICK_KINDS = ("interpreted", "compensated", "adaptive")


def test_every_method_and_scene_has_a_digest() -> None:
    assert {sample.split("/")[1] for sample in SAMPLES} == integrators.METHODS.keys()
    assert {sample.split("/")[0] for sample in SAMPLES} == SCENES.keys()
    kept = json.loads(same_bits.STORED.read_text(encoding="utf-8"))["digests"]
    assert {group: list(digests) for group, digests in kept.items()} == {
        group: list(samples) for group, (samples, _) in GROUPS.items()}
    for group in kept.values():
        assert len({*group.values()}) == len(group), "two motions have one digest"


@pytest.mark.parametrize("kind", [
    kind if kind in QUICK_KINDS else pytest.param(kind, marks=pytest.mark.slow) for kind in KINDS
])
@pytest.mark.filterwarnings("ignore")
def test_stored_digests(kind: str) -> None:
    """Interpreted kinds of every sample, compiled ones of a few."""
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
"""Processors to compile for, or whose libraries to use: what this one must have, and the environment variables."""
COMPILED = ("compiled", "batch", "vector environment")
ASKED = ("lab/rk4", "driven/rk4", "sticky_bearing/velocity_verlet")

ASKING = """
import json, sys, warnings
sys.path.insert(0, sys.argv[1])
warnings.simplefilter("ignore")
import same_bits
kinds, samples = json.loads(sys.argv[2])
digests = {kind: {each: same_bits.GROUPS[same_bits.KINDS[kind]][1][kind](each) for each in samples} for kind in kinds}
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
    """Whether this machine can run what needs it."""
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
    done = subprocess.run([sys.executable, "-c", ASKING, str(Path(__file__).parent), json.dumps([COMPILED, ASKED])],
                          capture_output=True, text=True, env=own)
    assert done.returncode == 0, done.stderr
    machine, digests, registers = json.loads(done.stdout.splitlines()[-1])
    print(f"\n{name}: {machine}, registers {registers}")
    wide = {"skylake-avx512": "zmm", "haswell": "ymm"}.get(name, "xmm")
    assert registers[0] == wide, "the processor's name had no effect"
    for kind, each in digests.items():
        assert each == {sample: stored(kind)[sample] for sample in ASKED}, kind


# --- no library's functions -----------------------------------------------------------------------------------------


def entries(made: Program) -> dict[str, Any]:
    """The compiled functions of a program that Python calls, each compiled for the types that the engine gives it."""
    import numba
    from numba import types

    space: dict[str, Any] = {}
    exec(PREAMBLE + made.text, space)
    f, i, row, table = types.float64, types.int64, types.float64[::1], types.float64[:, ::1]
    if hasattr(made, "layout"):
        rest = [f] * len(made.layout.shared)
        task = made.layout.task is not None
        name = "step_blocks" if task else "run_blocks"
        head = (table, row, i, i, i, f)
        flags = types.boolean[::1]
        hold = [i] if made.shape.remembered and not task else []
        middle = ((i, f, types.float32[:, ::1], types.float32[:, ::1], row, flags, flags, table) if task
                  else (i, i, f, types.float64[:, :, ::1], i, *hold))
        space[name].compile((*head, *middle, *rest))
    else:
        name = "run"
        space[name].compile((row, row, f, f, i, i, f, table, numba.float32[::1]))
    return {name: space[name]}


def programs(scene: str, method: str) -> dict[str, Program]:
    """One of each kind: single runs, with their reports; adaptive; compensated; batches of runs, and with a task."""
    place, chosen, task = SCENES[scene], integrators.get(method), TASKS["balance"]
    watched = ("energy", "heat_by_effect", "tension", "flow")
    many = (place, chosen, ("energy",), frozenset({"inertia"}))
    made: dict[str, Program] = {
        "single": program(place, chosen, watched),
        "compensated": program(place, chosen, ("energy",), compensated=True),
        "runs": batch_program(*many),
        "environments": batch_program(*many, (task.reward, task.lost)),
    }
    if getattr(chosen, "embedded", ()):
        made["adaptive"] = program(place, chosen, ("energy",), adaptive=True)
    return made


@pytest.mark.slow
@pytest.mark.parametrize(("scene", "method"), [
    ("windy", "dopri5"), ("water", "implicit_midpoint"), ("driven", "velocity_verlet"), ("vacuum", "exact"),
    ("sticky_bearing", "forest_ruth"), ("lab", "taylor"), ("exercise", "ab4"), ("vacuum", "discrete_gradient"),
])
def test_no_kernel_calls_a_library(scene: str, method: str) -> None:
    """Read in the machine code of each kind of program; what test_elementary.py looks for, and the names of vectors."""
    pytest.importorskip("numba")
    if method not in same_bits.FITS[scene]:
        pytest.skip("the method does not fit")
    for kind, made in programs(scene, method).items():
        for function in entries(made).values():
            (text,) = function.inspect_asm().values()
            code = "\n".join(line.partition("#")[0] for line in text.splitlines() if not line.startswith("\t."))
            assert not library_calls(function), kind
            assert not LIBM.search(code), (kind, LIBM.search(code))
            assert not FUSED.search(code), kind


def test_little_and_big_endian_have_one_digest() -> None:
    values = np.linspace(0.0, 1.0, 7)
    assert same_bits.digest(values) == same_bits.digest(values.astype(">f8"))
