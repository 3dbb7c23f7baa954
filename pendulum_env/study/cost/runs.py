"""One run of a study, measured: its errors and their units, its force evaluations, its wall time.

Workers of a cost study call :func:`measure`, from and to plain numbers.
"""

from __future__ import annotations

import json
import math
import platform
import time
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import integrators
from integrators import Method
from integrators.steps.estimates import evaluations_tried
from pendulum_env.engine.generate import program
from pendulum_env.engine.kernels import interpreted
from pendulum_env.engine.machine import NOWHERE, UNSEEN, VELOCITY, Machine
from pendulum_env.engine.rollout import Rollout, rollout
from pendulum_env.engine.spec import RunSpec
from pendulum_env.physics.scene import Scene
from pendulum_env.truth.answer import Truth
from pendulum_env.truth.reference import accelerations, phase_errors, reference

Array = NDArray[np.float64]

SHORTEST = 2e-4
"""A timing lasts at least this long [s]: short runs are repeated in it."""
FIRST_ORDER = 0.25
"""Part of the motion up to which an error has a part along it that says how late the run is."""
SPARSE = 7
"""Runs with adapted steps are looked at in every so many'th record: their steps are cut there."""
SAMPLES = 32
"""Single steps, spread over a run, in which the evaluations of implicit methods are counted."""


@dataclass(frozen=True)
class Setting:
    """What all runs of a study share.

    Attributes:
        scene, angle, velocity: what runs, from where [rad, rad/s].
        duration: of a run [s]; ``records``: how many follow the start.
        backend: "compiled" or "python".
    """

    scene: Scene
    angle: float
    velocity: float
    duration: float
    records: int
    backend: Any

    @property
    def gap(self) -> float:
        """Time from one record to the next [s]."""
        return self.duration / self.records

    def shared(self) -> dict[str, Any]:
        """In plain numbers, as :func:`measure` takes it."""
        return {**{entry.name: getattr(self, entry.name) for entry in fields(self)}, "scene": self.scene.to_dict()}

    @cached_property
    def truth(self) -> Truth:
        """The motion at the start and at each record."""
        return reference(self.scene, self.angle, self.velocity, self.times)

    @cached_property
    def pull(self) -> NDArray[np.float64]:
        """Acceleration of the reference [rad/s²]."""
        return accelerations(self.scene, self.times, self.truth)

    @cached_property
    def times(self) -> NDArray[np.float64]:
        return np.arange(self.records + 1, dtype=np.float64) * self.gap


@lru_cache(maxsize=4)
def setting_of(text: str) -> Setting:
    """The setting of this JSON text; the reference is found once in each process."""
    values = json.loads(text)
    return Setting(**{**values, "scene": Scene.from_dict(values["scene"])})


@lru_cache(maxsize=512)
def _machine(text: str, method: Method, rtol: float | None) -> Machine:
    """A machine that is compiled."""
    place = setting_of(text)
    machine = RunSpec.of(place.scene, method, backend=place.backend, rtol=rtol).machine()
    _started(machine, place)
    return machine


def _started(machine: Machine, place: Setting) -> Any:
    """A start with its energies filled in."""
    state = machine.state(place.angle, place.velocity)
    machine.advance(state, 0.0, 1.0, 0)
    return state


def measure(point: Mapping[str, Any], methods: Mapping[str, Method] | None = None) -> dict[str, Any]:
    """One timing of one run; where "repeat" is 0, its errors and evaluations too.

    Args:
        point: a Setting in plain numbers; "method", a name; "substeps" from one record to the next, or "rtol";
            "repeat"; "given", which tells apart those of ``methods``.
        methods: those that are not in the registry.

    Returns "time" [s]. With repeat 0 also "dt" [s], "steps", "angle_error", "end_error", "phase_error" [rad],
    "energy_error", "evaluations" and "stop_reason", in the words of CostPoint, and the "machine" with its versions.
    """
    own = dict(point)
    run = {name: own.pop(name, None) for name in ("method", "substeps", "rtol", "repeat", "given")}
    text = json.dumps(own, sort_keys=True)
    place, name = setting_of(text), run["method"]
    method = (methods or {}).get(name) or integrators.get(name)
    machine, stride = _machine(text, method, run["rtol"]), 1 if run["rtol"] is None else SPARSE
    every = run["substeps"] or 1
    dt, steps = place.gap * stride / every, place.records // stride * every
    if run["repeat"]:
        return {"time": _timed(machine, place, dt, steps)}
    found = rollout(
        place.scene, integrator=method, angle=place.angle, velocity=place.velocity, dt=dt, every=every,
        duration=place.duration, rtol=run["rtol"], backend=place.backend, warn=False,
    )
    host = {"machine": machine_name(), "versions": versions()}
    if found.stop_reason:
        return {"dt": dt, "steps": steps, "stop_reason": str(found.stop_reason), **host}
    taken = found.steps or steps
    truth, pull = place.truth[::stride], place.pull[::stride]
    errors = np.abs(found.angle - truth.angle)
    phases = np.abs(phase_errors(place.scene.omega0, truth, pull, found.angle, found.velocity))
    along = np.isfinite(phases).any() and np.max(errors) <= FIRST_ORDER * np.max(np.abs(truth.angle))
    largest = float(np.nanmax(phases)) if along else math.nan
    return {
        "time": _timed(machine, place, dt, steps),
        "dt": dt if run["rtol"] is None else place.duration / taken,
        "steps": taken,
        "angle_error": float(np.max(errors)),
        "end_error": float(errors[-1]),
        "phase_error": largest,
        "energy_error": float(np.max(np.abs(found.energy_residual))) / energy_scale(place.scene, found.energy)[0],
        "evaluations": _evaluations(machine, found, steps),
        "stop_reason": "",
        **host,
    }


def _timed(machine: Machine, place: Setting, dt: float, steps: int) -> float:
    """Wall time of one run [s]; of a short one the mean over as many as a reliable timing takes."""
    once = _clock(machine, place, dt, steps, 1)
    return once if once >= SHORTEST else _clock(machine, place, dt, steps, math.ceil(SHORTEST / once))


def _clock(machine: Machine, place: Setting, dt: float, steps: int, runs: int) -> float:
    """Mean wall time of one run [s]."""
    start = machine.state(place.angle, place.velocity)
    state = machine.state(place.angle, place.velocity)
    begun = time.perf_counter()
    for _ in range(runs):
        state[:] = start
        machine.advance(state, 0.0, dt, steps)
    return (time.perf_counter() - begun) / runs


def _evaluations(machine: Machine, run: Rollout, calls: int) -> float:
    """Force evaluations of a run in so many steps of dt.

    Of adapted steps those taken, those tried in vain, and one where each step of dt begins.
    """
    if not machine.tolerance:
        return calls * evaluations_per_step(machine, run.angle, run.velocity, run.dt)
    if not has_evaluations(machine.method):
        return math.nan
    return float((run.steps + run.rejected) * evaluations_tried(run.method) + calls)


@lru_cache(maxsize=1)
def machine_name() -> str:
    """The processor, as the system names it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        named = next(line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        named = platform.processor()
    return f"{named or 'unknown processor'}, {platform.machine()}, {platform.system()}"


@lru_cache(maxsize=1)
def versions() -> str:
    """Versions of the packages that decide speed and rounding."""
    from importlib.metadata import PackageNotFoundError, version

    found = []
    for name in ("numpy", "numba", "scipy"):
        try:
            found.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            found.append(f"no {name}")
    return ", ".join(found)


# --- energy errors and force evaluations -----------------------------------------------------------------------------


def energy_scale(scene: Scene, energy: Any) -> tuple[float, str]:
    """What energy errors are measured in [J], and its name.

    The energy at the start, counted from the bottom, where the scene keeps energy; elsewhere ``m g L``. Without
    gravity it is the energy at the start there too, or the largest where that is 0.
    """
    moved = [effect for effect in scene.of_kind("drive") if effect.torque and not effect.controlled]
    weight = scene.gravity * scene.weight_moment
    if (scene.of_kind("dissipative") or moved) and weight > 0.0:
        return weight, "m g L"
    start = float(energy[0])
    return (start, "the energy at the start") if start > 0.0 else (float(np.max(energy)), "the largest energy")


def has_evaluations(method: Method) -> bool:
    """False for methods whose steps take a series or a closed form in place of force evaluations."""
    return not method.needs & {"taylor", "exact_flow"}


def evaluations_per_step(machine: Machine, angle: Array, velocity: Array, h: float) -> float:
    """Force evaluations per step of ``h`` [s]: declared by explicit methods, counted for implicit ones; nan for others.

    An implicit method takes single steps from SAMPLES of the states ``angle, velocity`` [rad, rad/s] of a run, of which
    those count that cross no turning point; nan if all do. What its memory takes to begin is not counted.
    """
    method, scene = machine.method, machine.scene
    if not has_evaluations(method):
        return math.nan
    if not method.implicit:
        return float(method.evaluations)
    made, calls = program(scene, method, ()), [0]
    force = "mean_acceleration" if "mean" in method.needs else "acceleration"
    original = interpreted(made.text, made.title)[force]

    def counted(*arguments: float) -> float:
        calls[0] += 1
        return float(original(*arguments))

    advance = interpreted(made.text, made.title, {force: counted})["run"]
    states, before, found = RunSpec.of(scene, method, diagnostics=(), backend="python").machine(), 0, []
    chosen = np.linspace(0, len(angle) - 1, SAMPLES).astype(int)
    for q, v in zip(angle[chosen], velocity[chosen], strict=True):
        state = states.state(float(q), float(v))
        if method.memory:
            advance(state, states.parameters, 0.0, h, 1, 1, math.inf, NOWHERE, UNSEEN)
            before = calls[0]
        advance(state, states.parameters, 0.0, h, 1, 1, math.inf, NOWHERE, UNSEEN)
        if state[VELOCITY] * v > 0.0:
            found.append(calls[0] - before)
        before = calls[0]
    return sum(found) / len(found) if found else math.nan
