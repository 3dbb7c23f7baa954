"""Tests of generated programs: equal bits interpreted and compiled, and no code of effects absent from the scene."""

from __future__ import annotations

import math
import re
import subprocess
import sys
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from choice import FITS, FULL, pairs
from given_effects import scene_of

import integrators
from pendulum_env import SCENES, Scene, SceneError, rollout
from pendulum_env.engine import kernels
from pendulum_env.engine.generate import batch_program, program
from pendulum_env.engine.kernels import EngineError, functions
from pendulum_env.engine.layout import BLOCK
from pendulum_env.engine.machine import ANGLE, TURNS, TWO_PI, VELOCITY, Machine, fitting
from pendulum_env.engine.reading import ProgramError
from pendulum_env.engine.runs import RecordSchedule, recorded
from pendulum_env.engine.wrap import half_turns, side_of, without_half_turns
from pendulum_env.physics.effects import EFFECTS, Effect, Gravity
from pendulum_env.physics.flow import quality_factor
from pendulum_env.tasks import TASKS
from pendulum_env.truth.reference import reference

SEED = 3
EVERY = [case for case in product(SCENES, integrators.METHODS) if case in FITS]


def compiled_pairs() -> list[tuple[str, str]]:
    """Return scenes and methods that are also compiled, which takes a second each.

    Each method in one scene, mostly that of its million steps, whose program tests/hard_cases/test_hard_cases.py then
    finds in the cache; one method of each class, explicit and implicit, in "lab", which has most effects; rk4 in every
    scene. ``LAB_PENDULUM_GRID=full`` takes each method in each scene.
    """
    if FULL:
        return EVERY
    found = {("lab", "rk4"): None}
    first: dict[Any, str] = {}
    for name, method in fitting(SCENES["lab"]).items():
        first.setdefault((type(method), method.implicit), name)
    found |= dict.fromkeys(("lab", name) for name in first.values())
    for name, method in integrators.METHODS.items():
        places = ("vacuum", "lab") if method.symplectic else ("textbook", "vacuum", "lab")
        found[next(scene for scene in places if (scene, name) in FITS), name] = None
    return [*(found | dict.fromkeys((scene, "rk4") for scene in SCENES))]


COMPILED = compiled_pairs()
WRITTEN = pairs((list(SCENES), list(integrators.METHODS)))
STEPS = 2_000


def run(scene: str, method: str, backend: Any, steps: int = STEPS, **options: Any) -> tuple[list[float], int]:
    """Return the state after many steps, and the stop code."""
    machine = Machine(SCENES[scene], method, backend=backend, **options)
    state = machine.state(SCENES[scene].run.angle, SCENES[scene].run.velocity)
    code = machine.advance(state, 0.375, 0.004, steps)
    return [float(value) for value in state], code


def test_how_many_combinations(record_property: Any) -> None:
    print(f"\n{len(EVERY)} of {len(SCENES)} scenes x {len(integrators.METHODS)} methods fit; slow tests run them all")
    print(f"{len(COMPILED)} of them are compiled")
    assert {method for _, method in EVERY} == {method for _, method in COMPILED}
    assert {scene for scene, _ in EVERY} == {scene for scene, _ in COMPILED}


@pytest.mark.slow
@pytest.mark.parametrize("scene", [
    name if name == "lab" else pytest.param(name, marks=pytest.mark.slow)
    for name in SCENES])
def test_every_method_that_fits_goes_where_the_scene_goes(scene: str) -> None:
    """Check every method, interpreted, over ten steps of 0.05/rate: the error is within 4 0.05^order of a reference.

    At a turning point, where the second derivative of wire drag is infinite, all methods have an error of 1e-7 in the
    angle and five times that in the velocity, multistep methods one of 2e-5. In gusts, which have no reference
    solution, the reference is dop853 with a quarter of the step, over one control step.
    """
    place = SCENES[scene]
    rates = [place.coefficients[effect.beat] for effect in place.effects if effect.beat]
    rates.append(place.omega0 / quality_factor(place, place.run.angle + 0.1))
    h, start = 0.05 / max(place.omega0, *rates), (place.run.angle + 0.1, place.run.velocity + 0.2 * place.omega0)
    gusty = any(effect.draws for effect in place.effects)
    if gusty:
        fine = rollout(place, integrator="dop853", angle=start[0], velocity=start[1], dt=h / 4, duration=10 * h,
                       substeps=40, backend="python", seed=SEED)
        angle, velocity = fine.angle[-1], fine.velocity[-1]
    else:
        truth = reference(place, *start, [0.0, 10 * h])
        angle, velocity = truth.angle[-1], truth.velocity[-1]
    size = abs(start[0]) + abs(start[1]) / place.omega0
    methods = fitting(place)
    for name, method in methods.items():
        machine = Machine(place, method, backend="python", hold=10)
        state = machine.state(*start, np.random.Generator(np.random.PCG64(SEED)).random(len(machine.drawn)).tolist())
        assert machine.advance(state, 0.0, h, 10) == 0, name
        turn = 3e-5 if isinstance(method, integrators.Multistep) else 1e-6
        allowed = 4.0 * size * 0.05**method.order + (turn if place.has("wire_drag") else 1e-8)
        away = state[ANGLE] + TWO_PI * state[TURNS] - angle
        assert abs(away) < allowed, (name, away)
        assert abs(state[VELOCITY] - velocity) < allowed * place.omega0, (name, away)
    print(f"\n{scene}: {len(methods)} methods, all that fit")


@pytest.mark.parametrize(("scene", "method"), COMPILED)
def test_interpreted_and_compiled_give_the_same_bits(scene: str, method: str) -> None:
    assert run(scene, method, "python") == run(scene, method, "compiled")


@pytest.mark.quick("rk4")
@pytest.mark.parametrize("method", ["rk4", "velocity_verlet", "implicit_midpoint"])
def test_trajectory_and_advance_give_the_same_bits(method: str) -> None:
    machine = Machine(SCENES["sticky_bearing"], method)
    states, _ = recorded(machine, machine.state(0.5, 0.0), RecordSchedule(0.004, 500, 50), 0.375)
    state = machine.state(0.5, 0.0)
    machine.advance(state, 0.375, 0.004, 500)
    assert states[-1].tolist() == state.tolist()[: machine.width]


@pytest.mark.parametrize("diagnostics", [(), ("energy",), ("heat_by_effect",)])
def test_diagnostics_do_not_touch_the_motion(diagnostics: tuple[str, ...]) -> None:
    plain, _ = run("sticky_bearing", "rk4", "python", 2000, diagnostics=())
    watching, _ = run("sticky_bearing", "rk4", "python", 2000, diagnostics=diagnostics)
    assert plain[:6] == watching[:6]


# --- what the generated file holds ----------------------------------------------------------------------------------


def symbols(effect: type[Effect]) -> set[str]:
    """Return the names that occur only in programs with the effect: its functions and its coefficients."""
    roles = ("torque", "by_angle", "by_velocity", "potential", "flow", "radial", "wind_x", "wind_y", "advance")
    called = {getattr(effect, role).__name__ for role in roles if getattr(effect, role) is not None}
    owner = scene_of(effect.name)
    return called | set(owner.coefficients) | set(effect.memory)


def texts(scene: str, method: str) -> list[str]:
    """Return the programs of a scene with a method: for single runs, for environments with a task, and for batches."""
    task = TASKS["balance"]
    rest = (SCENES[scene], integrators.get(method), ("energy",), frozenset({"inertia"}))
    programs = (program(*rest[:2]), batch_program(*rest, task.goal), batch_program(*rest))
    return [each.text for each in programs]


@pytest.mark.parametrize(("scene", "method"), WRITTEN)
def test_a_kernel_holds_no_absent_effect_and_calls_only_itself(scene: str, method: str) -> None:
    """Check that a program has no code of absent effects, and calls only its own functions, built-ins and sqrt.

    In every scene every kind of method, and every method in one.
    """
    for text in texts(scene, method):
        words = set(re.findall(r"\w+", text))
        for name, effect in EFFECTS.items():
            if SCENES[scene].has(name):
                assert effect.kind == "inertia" or words & symbols(effect), f"{name} is missing"
            else:
                assert not words & symbols(effect), f"{name} is in the kernel"
        code = re.sub(r"#.*", "", re.sub(r'""".*?"""', "", text, flags=re.S))
        builtin = {"abs", "min", "max", "range", "len", "float", "int", "and", "or", "not", "if", "in", "U", "lanes",
                       "sqrt"}
        called = set(re.findall(r"(?<![\w.])(\w+)\(", code)) - builtin
        assert called <= set(re.findall(r"def (\w+)\(", code))
        assert "**" not in code
        assert "math." not in code


@pytest.mark.slow
def test_no_library_call_in_machine_code() -> None:
    """Check that compiled code calls no library; a program with math.sin shows that the search can find such calls."""
    from numba import njit

    space: dict[str, Any] = {}
    kernel = batch_program(SCENES["sticky_bearing"], integrators.get("velocity_verlet"), ("energy",), frozenset())
    exec(kernels.PREAMBLE + kernel.text, space)
    space["run_blocks"](np.zeros((1, 30 * BLOCK)), np.zeros(30 * BLOCK), 0, 1, 8, 0.1, 1, 1, 0.0,
                        np.zeros((1, 12, 8)), 0, *[1.0] * len(kernel.layout.shared))
    names = "(?:sin|cos|exp|log|pow|fma|fmod|ldexp|expm1)"
    foreign = re.compile(rf"\b(?:call|jmp)q?\s+\*?{names}f?\b|\${names}\b")
    for assembly in space["run_blocks"].inspect_asm().values():
        assert not foreign.search(assembly)
    libm = njit(lambda x: math.sin(x))
    libm(1.0)
    assert any(re.search(r"\$?sin\b", assembly) for assembly in libm.inspect_asm().values())


# --- turns ----------------------------------------------------------------------------------------------------------


def test_half_turns_keep_the_last_bits() -> None:
    """Check the reduction by half turns against 60 digits: its error is at most half an ulp of a quarter turn."""
    mp = pytest.importorskip("mpmath")
    with mp.workdps(60):
        for angle in (1.6, 3.2, -3.2, 7.0, 1000.0, -54321.0, 6283185.25):
            halves = half_turns(angle)
            truth = mp.mpf(angle) - mp.pi * int(halves)
            assert abs(truth) <= mp.pi / 2 * (1 + mp.mpf(10) ** -12)
            assert abs(without_half_turns(angle, halves) - truth) <= 1.2e-16
            side = side_of(0.5 * halves)
            assert abs(mp.sin(angle) - side * mp.sin(without_half_turns(angle, halves))) < 1.2e-16
        # Next to the top the error is at most half an ulp of the reduced angle: float(pi) is 1.22e-16 below pi.
        for angle in (math.pi, math.pi - 1e-9, -math.pi, math.pi + 1e-12):
            truth = mp.mpf(angle) - mp.pi * int(half_turns(angle))
            assert abs(without_half_turns(angle, half_turns(angle)) / truth - 1) < 2e-16
    assert half_turns(1.57) == 0.0
    assert [side_of(turns) for turns in (0.0, 0.5, 1.0, -0.5, -1.5, 2.0)] == [1.0, -1.0, 1.0, -1.0, -1.0, 1.0]


@pytest.mark.slow
def test_many_turns_lose_nothing() -> None:
    """Check that 10 000 free turns, exact in binary at 64 steps per turn, lose no bit of the wrapped angle."""
    scene = Scene(effects=(Gravity(),), gravity=0.0)
    h = 2.0**-6
    r = rollout(scene, integrator="velocity_verlet", angle=0.0, velocity=2 * math.pi, dt=h, duration=1e4, every=6400)
    assert r.angle[-1] == pytest.approx(2e4 * math.pi, rel=1e-12)


# --- an effect of one's own -----------------------------------------------------------------------------------------


def test_a_method_that_does_not_fit_is_refused_with_the_reason() -> None:
    class Cubic(Effect):
        name = "cubic_drag"
        kind = "dissipative"
        equation = "- {cubic_rate} theta'^3"
        source = "made up"
        torque = staticmethod(lambda velocity, cubic_rate: -cubic_rate * velocity * velocity * velocity)

        def coefficients(self, scene: Scene) -> dict[str, float]:
            return {"cubic_rate": 0.1}

    scene = Scene(effects=(Gravity(), Cubic()))
    for method, word in (("velocity_verlet", "exact flow of the dissipation"), ("backward_euler", "jacobian")):
        with pytest.raises(integrators.MethodError, match=word) as error:
            Machine(scene, method)
        assert "these fit: forward_euler" in str(error.value)
    assert "rk4" in fitting(scene)


def pull(angle: float, pull_rate: float) -> float:
    return -pull_rate * angle


def pull_by_angle(pull_rate: float) -> float:
    return -pull_rate


TAKEN = {"q": "rk4", "side": "rk4", "start": "backward_euler", "index": "velocity_verlet", "gravity": "rk4",
         "a": "velocity_verlet"}


@pytest.mark.parametrize("name", [*TAKEN, "whole"])
def test_a_coefficient_that_would_be_overwritten_is_refused(name: str) -> None:
    """Check that a coefficient with a name used in the step is refused, since it would silently get another value."""
    word = name

    @dataclass(frozen=True)
    class Named(Effect):
        name = "named"
        kind = "drive"
        equation = "- pull"
        source = "made up"
        torque = staticmethod(pull)
        by_angle = staticmethod(pull_by_angle)

        def coefficients(self, scene: Scene) -> dict[str, float]:
            return {"pull_rate": 0.1, word: 0.2}

    scene = Scene(effects=(Gravity(), Named()))
    if name in TAKEN:
        with pytest.raises(ProgramError, match=f"The coefficient name {name} is already used"):
            Machine(scene, TAKEN[name], backend="python")
    else:
        assert rollout(scene, duration=0.1, backend="python").stop_reason == ""


# --- backends and the cache -----------------------------------------------------------------------------------------


def test_unknown_backend() -> None:
    with pytest.raises(EngineError, match="there are auto, compiled, python"):
        Machine(SCENES["vacuum"], "rk4", backend="gpu")  # type: ignore[arg-type]


def test_the_environment_says_what_auto_means(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LAB_PENDULUM_BACKEND", "python")
    assert not Machine(SCENES["vacuum"], "rk4").compiled
    assert kernels.resolve("compiled") == "compiled"
    monkeypatch.setenv("LAB_PENDULUM_BACKEND", "compiled")
    assert kernels.resolve("auto") == "compiled"
    assert kernels.resolve("python") == "python"
    monkeypatch.setenv("LAB_PENDULUM_BACKEND", "numba")
    with pytest.raises(EngineError, match="must be one of auto, compiled, python, not 'numba'"):
        rollout("vacuum", duration=0.1)


def test_without_numba_one_warning_and_python(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "numba", None)
    kernels.forget()
    try:
        with pytest.warns(UserWarning, match="numba cannot be imported"):
            assert kernels.resolve("auto") == "python"
        with pytest.raises(EngineError, match="needs numba"):
            kernels.resolve("compiled")
    finally:
        kernels.forget()


CACHE_SCRIPT = """
import sys, warnings
from pendulum_env import rollout
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    r = rollout("vacuum", integrator="forward_euler", duration=1.0)
print(r.angle[-1].hex(), len(caught))
"""


def run_with_cache(folder: Path) -> list[str]:
    import os

    result = subprocess.run([sys.executable, "-c", CACHE_SCRIPT], capture_output=True, text=True, check=True,
                            env={**os.environ, "LAB_PENDULUM_CACHE": str(folder)})
    return result.stdout.split()


@pytest.mark.slow
def test_cache_cold_and_warm(tmp_path: Path) -> None:
    folder = tmp_path / "cache"
    cold = run_with_cache(folder)
    entries = sorted(path.name for path in folder.rglob("*.nb*"))
    assert entries
    assert run_with_cache(folder) == cold
    assert sorted(path.name for path in folder.rglob("*.nb*")) == entries, "a warm run compiled anew"


@pytest.mark.slow
def test_cache_damaged_and_unwritable(tmp_path: Path) -> None:
    folder = tmp_path / "cache"
    cold = run_with_cache(folder)
    (kernel,) = folder.glob("kernel_*.py")
    kernel.write_text(kernel.read_text()[:100])
    assert run_with_cache(folder) == cold
    blocked = tmp_path / "file"
    blocked.write_text("")
    assert run_with_cache(blocked) == [cold[0], "1"]


def test_programs_are_made_once() -> None:
    first = functions(program(SCENES["vacuum"], integrators.get("rk4")))
    assert functions(program(SCENES["vacuum"].replace(length=2.0), integrators.get("rk4"))) is not None
    assert functions(program(SCENES["vacuum"], integrators.get("rk4"))) is first


# --- rollout --------------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("interpreted")
def test_a_batch_is_its_single_runs() -> None:
    angles = np.array([[0.1, 1.0], [2.0, 3.0]])
    batch = rollout("vacuum", angle=angles, velocity=0.5, duration=1.0)
    assert batch.angle.shape == (2, 2, 101)
    for index in np.ndindex(2, 2):
        single = rollout("vacuum", angle=angles[index], velocity=0.5, duration=1.0)
        assert np.array_equal(batch.angle[index], single.angle)
        assert np.array_equal(batch.energy_residual[index], single.energy_residual)
    assert batch.stop_reason == ("",) * 4


@pytest.mark.usefixtures("interpreted")
def test_a_divergence_is_named_where_it_happened() -> None:
    r = rollout("textbook", integrator="forward_euler", dt=0.5, duration=1000.0)
    assert r.stop_reason == "diverged"
    assert 0.0 < r.time[-1] < 1000.0
    assert np.all(np.isfinite(r.energy_residual))


@pytest.mark.usefixtures("interpreted")
def test_a_wire_goes_slack_and_a_rod_pushes() -> None:
    """Check that a wire above the horizontal is slack at once while a rod pushes, by tension m (L v² + g cos theta)."""
    wire = SCENES["exercise_large"]
    assert rollout(wire, angle=2.0, duration=1.0).stop_reason == "slack"
    assert rollout(wire.replace(suspension="rod"), angle=2.0, duration=1.0).stop_reason == ""
    slow = rollout(wire, damping="none", angle=0.0, velocity=1.9 * wire.omega0, duration=2.0, dt=1e-4)
    assert slow.stop_reason == "slack"
    # From the bottom with v0 = 1.9 omega0 the wire goes slack at 3 cos theta = 2 - (v0/omega0)².
    assert math.cos(slow.angle[-1]) == pytest.approx((2.0 - 1.9**2) / 3.0, abs=2e-3)


BAD = {
    "dt": ({"dt": 0.0}, "dt must be"),
    "dt nan": ({"dt": math.nan}, "dt must be"),
    "duration": ({"duration": -1.0}, "duration must be"),
    "every": ({"every": 0}, "every must be a whole number"),
    "angle": ({"angle": math.nan}, "angle must hold"),
    "angle text": ({"angle": "up"}, "angle must be a number"),
    "shapes": ({"angle": [1.0, 2.0], "velocity": [1.0, 2.0, 3.0]}, "one shape"),
    "control": ({"control": 2.0}, "control must be between"),
    "speed limit": ({"speed_limit": 0.0}, "speed_limit must be"),
    "diagnostics": ({"diagnostics": ("heat",)}, "no diagnostic"),
    "diagnostics text": ({"diagnostics": "energy"}, "tuple of names"),
    "parameter": ({"lenght": 1.0}, "did you mean length?"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_gives_one_clear_error(case: str) -> None:
    options, words = BAD[case]
    with pytest.raises(SceneError, match=re.escape(words)):
        rollout("vacuum", **options)
