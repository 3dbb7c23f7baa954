"""Measurement of one run of a work-precision study: errors, number of force evaluations and computing time."""

from __future__ import annotations

import json
import math
import platform
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cached_property, lru_cache
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

import integrators
from integrators import Method
from pendulum_env.engine.generate import program
from pendulum_env.engine.kernels import interpreted
from pendulum_env.engine.machine import NOWHERE, UNSEEN, VELOCITY, Machine
from pendulum_env.engine.runs import RecordSchedule, recorded, result_of
from pendulum_env.engine.spec import RunSpec
from pendulum_env.engine.timing import run_time
from pendulum_env.physics.scene import Scene
from pendulum_env.study.compare.drift import evaluations
from pendulum_env.truth.answer import Truth
from pendulum_env.truth.reference import accelerations, phase_errors, reference

Array = NDArray[np.float64]

SHORTEST = 2e-4
"""Shortest timing [s]; shorter runs are repeated within one timing."""
LONG = 1e-2
"""A run that takes longer [s] is timed while its records are made, which take less than a hundredth of that."""
FIRST_ORDER = 0.25
"""Largest error, as a fraction of the motion's size, for which a phase error is defined."""
SPARSE = 7
"""Adaptive runs are compared at every SPARSE-th record only, because their steps have to end there."""
SAMPLES = 32
"""Number of single steps along a run in which the force evaluations of implicit methods are counted."""


@dataclass(frozen=True)
class Setting:
    """Setting that all runs of a work-precision study share: scene, start, duration and times of comparison.

    Attributes:
        scene, angle, velocity: scene and start of the runs [rad, rad/s].
        duration: length of a run [s].
        records: number of records, the equally spaced times after the start at which runs are compared with the
            reference solution.
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
        """Time [s] between two records, the times at which runs are compared with the reference solution."""
        return self.duration / self.records

    def backend_of(self, method: Method) -> Any:
        """Return the backend of a method's runs: "python" where a step calls functions that cannot be compiled."""
        return "python" if method.python_functions else self.backend

    def shared(self) -> dict[str, Any]:
        """Return the setting as a dict of JSON types: the part of :func:`measure`'s argument that all runs share."""
        return {**{entry.name: getattr(self, entry.name) for entry in fields(self)}, "scene": self.scene.to_dict()}

    @cached_property
    def truth(self) -> Truth:
        """Reference solution at the start and at all times at which runs are compared with it."""
        return reference(self.scene, self.angle, self.velocity, self.times)

    @cached_property
    def pull(self) -> NDArray[np.float64]:
        """Angular acceleration of the reference solution [rad/s²] at all times at which runs are compared with it."""
        return accelerations(self.scene, self.times, self.truth)

    @cached_property
    def times(self) -> NDArray[np.float64]:
        """Start of the runs and all later times at which they are compared with the reference solution [s]."""
        return np.arange(self.records + 1, dtype=np.float64) * self.gap


@lru_cache(maxsize=4)
def setting_of(text: str) -> Setting:
    """Return the :class:`Setting` that a JSON text describes.

    Settings are cached, so that a worker process computes each reference solution only once.
    """
    values = json.loads(text)
    return Setting(**{**values, "scene": Scene.from_dict(values["scene"])})


@lru_cache(maxsize=512)
def _machine(text: str, method: Method, rtol: float | None) -> Machine:
    """Return the machine, the compiled program of a scene with a method, that simulates the runs of a study.

    ``text`` is the JSON text of the study's :class:`Setting`. Machines are cached.
    """
    place = setting_of(text)
    machine = RunSpec.of(place.scene, method, backend=place.backend_of(method), rtol=rtol).machine()
    machine.advance(machine.state(place.angle, place.velocity), 0.0, 1.0, 0)  # compiles the program
    return machine


def measure(point: Mapping[str, Any], methods: Mapping[str, Method] | None = None) -> dict[str, Any]:
    """Measure the time of one run of a work-precision study and, at its first timing, its errors and force evaluations.

    Args:
        point: dict with the entries of the :class:`Setting` and of the run: "method" (a name), either "substeps"
            (number of steps between two records) or "rtol", "repeat" (0 for the first timing), and "given" with hashes
            of ``methods``.
        methods: methods that are not in the registry, by name.

    Returns a dict with "time" [s]. With repeat 0 it also has "dt" [s], "steps", "angle_error", "end_error",
    "phase_error" [rad], "energy_error", "evaluations" and "stop_reason", see :class:`CostPoint`, and "machine" and
    "versions".
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
    state, begun = machine.state(place.angle, place.velocity), perf_counter()
    states, reason = recorded(machine, state, RecordSchedule(dt, steps, every))
    seconds = perf_counter() - begun
    result = result_of(machine, states, reason, dt, state)
    host = {"machine": machine_name(), "versions": versions()}
    if result.stop_reason:
        return {"dt": dt, "steps": steps, "stop_reason": str(result.stop_reason), **host}
    taken = result.steps or steps
    truth, pull = place.truth[::stride], place.pull[::stride]
    errors = np.abs(result.angle - truth.angle)
    phases = np.abs(phase_errors(place.scene.omega0, truth, pull, result.angle, result.velocity))
    along = np.isfinite(phases).any() and np.max(errors) <= FIRST_ORDER * np.max(np.abs(truth.angle))
    largest = float(np.nanmax(phases)) if along else math.nan
    if machine.tolerance:
        counted = float(evaluations(result) or math.nan) if has_evaluations(method) else math.nan
    else:
        counted = steps * evaluations_per_step(machine, result.angle, result.velocity, result.dt)
    return {
        "time": seconds if seconds >= LONG else _timed(machine, place, dt, steps),
        "dt": dt if run["rtol"] is None else place.duration / taken,
        "steps": taken,
        "angle_error": float(np.max(errors)),
        "end_error": float(errors[-1]),
        "phase_error": largest,
        "energy_error": float(np.max(np.abs(result.energy_residual))) / energy_scale(place.scene, result.energy)[0],
        "evaluations": counted,
        "stop_reason": "",
        **host,
    }


def _timed(machine: Machine, place: Setting, dt: float, steps: int) -> float:
    """Return the wall time of one run [s]; for a short run the mean over several, for a reliable timing."""
    once, _ = run_time(machine, place.angle, place.velocity, dt, steps)
    if once >= SHORTEST:
        return once
    return run_time(machine, place.angle, place.velocity, dt, steps, math.ceil(SHORTEST / once))[0]


@lru_cache(maxsize=1)
def machine_name() -> str:
    """Return the name of the processor and the operating system."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        named = next(line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        named = platform.processor()
    return f"{named or 'unknown processor'}, {platform.machine()}, {platform.system()}"


@lru_cache(maxsize=1)
def versions() -> str:
    """Return the versions of numpy, numba and scipy, which determine speed and rounding."""
    from importlib.metadata import PackageNotFoundError, version

    texts = []
    for name in ("numpy", "numba", "scipy"):
        try:
            texts.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            texts.append(f"no {name}")
    return ", ".join(texts)


# --- energy errors and force evaluations -----------------------------------------------------------------------------


def energy_scale(scene: Scene, energy: Any) -> tuple[float, str]:
    """Return the energy [J] by which energy errors of a study are divided, and its name.

    In conservative scenes this is the energy at the start, counted from the bottom; in other scenes it is ``m g L``.
    Without gravity it is the energy at the start, or the largest energy of the run if the start has none.
    """
    moved = [effect for effect in scene.of_kind("drive") if effect.torque and not effect.controlled]
    weight = scene.restoring
    if (scene.of_kind("dissipative") or moved) and weight > 0.0:
        return weight, "m g L"
    start = float(energy[0])
    return (start, "the energy at the start") if start > 0.0 else (float(np.max(energy)), "the largest energy")


def has_evaluations(method: Method) -> bool:
    """Return False for methods that use a Taylor series or a closed form instead of force evaluations."""
    return not method.needs & {"taylor", "exact_flow"}


def evaluations_per_step(machine: Machine, angle: Array, velocity: Array, h: float) -> float:
    """Return the force evaluations per step of ``h`` [s]: declared for explicit methods, counted for implicit ones.

    An implicit method takes single steps from 32 states of a run with angles ``angle`` [rad] and velocities
    ``velocity`` [rad/s]. Steps in which the velocity changes sign do not count. Evaluations that begin a multistep
    method's history do not count. The result is nan if all steps are excluded, and for methods without force
    evaluations.
    """
    method, scene = machine.method, machine.scene
    if not has_evaluations(method):
        return math.nan
    if not method.implicit:
        return float(method.evaluations)
    code, calls = program(scene, method, ()), [0]
    force = "mean_acceleration" if "mean" in method.needs else "acceleration"
    original = interpreted(code.text, code.title)[force]

    def counted(*arguments: float) -> float:
        calls[0] += 1
        return float(original(*arguments))

    advance = interpreted(code.text, code.title, {force: counted})["run"]
    states, counts = RunSpec.of(scene, method, diagnostics=(), backend="python").machine(), []
    chosen = np.linspace(0, len(angle) - 1, SAMPLES).astype(int)
    for q, v in zip(angle[chosen], velocity[chosen], strict=True):
        state = states.state(float(q), float(v))
        for _ in range(1 + bool(method.memory)):  # the first step of a multistep method begins its history
            calls[0] = 0
            advance(state, states.parameters, 0.0, h, 1, 1, math.inf, NOWHERE, UNSEEN)
        if state[VELOCITY] * v > 0.0:
            counts.append(calls[0])
    return sum(counts) / len(counts) if counts else math.nan
