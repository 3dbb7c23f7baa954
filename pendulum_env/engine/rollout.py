"""Runs of a scene from given starts: arrays in, arrays out."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from integrators import Method
from pendulum_env.engine.kernels import Backend
from pendulum_env.engine.loops import STOP_REASONS
from pendulum_env.engine.machine import ANGLE, INDEX, TURNS, TWO_PI, VELOCITY, Machine
from pendulum_env.physics.damping import Damping, with_damping
from pendulum_env.physics.energy import Ledger
from pendulum_env.physics.presets import find_scene
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, number

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Rollout:
    """A run: arrays of shape ``(times,)``, or ``(runs, times)`` if started from an array of angles.

    Attributes:
        time: [s], shape ``(times,)``; a single run that stopped early is as long as it lasted.
        angle: unwrapped, from the downward vertical [rad].
        velocity: [rad/s].
        ledger: kinetic, potential, work, heat, residual [J].
        heat_by_effect: heat of each dissipative effect [J], where ``diagnostics`` asked for it.
        stop_reason: "" if it ran to its end, else "diverged", "speed_limit" or "slack"; a tuple of them for a batch,
            whose values after a stop are nan.
        scene, method, dt: what ran.
    """

    time: Array
    angle: Array
    velocity: Array
    ledger: Ledger
    stop_reason: str | tuple[str, ...]
    scene: Scene
    method: Method
    dt: float
    heat_by_effect: Mapping[str, Array] = field(default_factory=dict)

    @property
    def energy(self) -> Array:
        """Kinetic plus potential energy [J]."""
        return np.asarray(self.ledger.energy)

    @property
    def energy_residual(self) -> Array:
        """Energy that the integrator added or lost [J]."""
        return np.asarray(self.ledger.residual)


def rollout(
    scene: str | Scene | Mapping[str, object] = "lab",
    *,
    integrator: str | Method = "rk4",
    damping: Damping = "scene",
    angle: ArrayLike | None = None,
    velocity: ArrayLike | None = None,
    duration: float | None = None,
    dt: float | None = None,
    every: int = 1,
    control: float = 0.0,
    diagnostics: Sequence[str] = ("energy",),
    speed_limit: float = math.inf,
    backend: Backend = "auto",
    **parameters: Any,
) -> Rollout:
    """Simulate a scene from a start.

    Args:
        scene: preset name, dict, Scene, or a scene's JSON file.
        integrator: name of a method, or a Method.
        damping: as in :func:`pendulum_env.physics.damping.with_damping`.
        angle, velocity: start [rad, rad/s]; numbers, or arrays for a batch; by default the scene's usual run.
        duration: [s]; by default the usual run's. Rounded up to whole steps.
        dt: the integrator's step [s]; by default the usual run's.
        every: record every so many steps.
        control: constant share of the motor's torque, within [-1, 1].
        diagnostics: "energy" and "heat_by_effect", or () for neither work nor heat.
        speed_limit: |velocity| at which a run ends with "speed_limit" [rad/s].
        backend: "auto", "compiled" or "python"; same bits.
        **parameters: single parameters of the scene, such as ``length=0.5``.

    Returns a Rollout. A run that leaves the finite range, or whose energy residual is beyond all sense, ends there
    with ``stop_reason`` "diverged", and what it had found before is kept.

    Raises SceneError or MethodError for anything that cannot be.
    """
    place = with_damping(find_scene(scene).replace(**parameters), damping)
    machine = Machine(place, integrator, diagnostics, backend)
    h = number(place.run.dt if dt is None else dt, "dt", above=0.0, unit="s")
    length = number(place.run.duration if duration is None else duration, "duration", above=0.0, unit="s")
    share = number(control, "control")
    if abs(share) > 1.0:
        raise SceneError(f"control must be within -1 and 1, not {share!r}.")
    if isinstance(every, bool) or not isinstance(every, (int, np.integer)) or every < 1:
        raise SceneError(f"every must be a whole number of steps from 1, not {every!r}.")
    q0 = _start(place.run.angle if angle is None else angle, "angle")
    v0 = _start(place.run.velocity if velocity is None else velocity, "velocity")
    try:
        starts = np.broadcast_arrays(q0, v0)
    except ValueError:
        raise SceneError(f"angle and velocity must have one shape, not {q0.shape} and {v0.shape}.") from None
    limit = math.inf if speed_limit == math.inf else number(speed_limit, "speed_limit", above=0.0, unit="rad/s")
    rows = math.ceil(length / h / every - 1e-9) + 1
    runs = [
        simulate(machine, float(q), float(v), h=h, rows=rows, every=int(every), control=share, speed_limit=limit)
        for q, v in zip(starts[0].ravel(), starts[1].ravel(), strict=True)
    ]
    if q0.ndim == 0 and v0.ndim == 0:
        states, reason = runs[0]
        return _result(machine, states, reason, h, states[:, INDEX] * h)
    whole = np.full((len(runs), rows, machine.width), np.nan)
    for target, (states, _) in zip(whole, runs, strict=True):
        target[: len(states)] = states
    time: Array = every * h * np.arange(rows, dtype=np.float64)
    return _result(machine, whole.reshape(*starts[0].shape, rows, -1), tuple(reason for _, reason in runs), h, time)


def _start(value: ArrayLike, name: str) -> Array:
    try:
        found = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise SceneError(f"{name} must be a number or an array of numbers, not {value!r}.") from None
    if found.size == 0 or not np.all(np.isfinite(found)):
        raise SceneError(f"{name} must hold at least one number, all of them finite, not {value!r}.")
    return found


def simulate(
    machine: Machine,
    angle: float,
    velocity: float,
    *,
    h: float,
    rows: int,
    every: int = 1,
    control: float = 0.0,
    speed_limit: float = math.inf,
) -> tuple[Array, str]:
    """States of one run of a machine, one row per ``every`` steps of ``h`` and the start; and why it stopped, or ""."""
    out = np.empty((rows, machine.width))
    state = machine.state(angle, velocity)
    code = machine.run(state, machine.parameters, control, h, rows - 1, every, speed_limit, out)
    states, reason = out[: 1 + math.ceil(state[INDEX] / every)], STOP_REASONS.get(code, "")
    if machine.diagnostics:
        ledger = machine.ledger(states, machine.ledger(states[0], 0.0).energy)
        absurd = np.flatnonzero(ledger.absurd(machine.scale))
        if absurd.size:
            states, reason = states[: absurd[0] + 1], "diverged"
    return states, reason


def _result(machine: Machine, states: Array, reason: str | tuple[str, ...], h: float, time: Array) -> Rollout:
    initial = machine.ledger(states[..., :1, :], 0.0).energy
    return Rollout(
        time=time,
        angle=states[..., ANGLE] + TWO_PI * states[..., TURNS],
        velocity=states[..., VELOCITY],
        ledger=machine.ledger(states, initial),
        heat_by_effect=machine.heat_by_effect(states),
        stop_reason=reason,
        scene=machine.scene,
        method=machine.method,
        dt=h,
    )
