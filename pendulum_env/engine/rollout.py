"""Runs of a scene from given starts: arrays in, arrays out."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from integrators import Method, MethodError
from integrators.solve import MOST_STEPS
from pendulum_env.engine.kernels import Backend
from pendulum_env.engine.machine import ANGLE, INDEX, TURNS, TWO_PI, UNSEEN, VELOCITY, Machine, find_method
from pendulum_env.engine.shape import STOP_REASONS
from pendulum_env.physics.damping import Damping, build_scene
from pendulum_env.physics.energy import Ledger
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, number

Array = NDArray[np.float64]

MOST_ROWS = 100_000_000
"""States that one call may record, all runs together: some 10 GB."""
LARGEST_ANGLE = {True: 1e8, False: 1e100}
"""Angles a start may have [rad], periodic scenes and others: the sine is accurate to 8e8, a square must be finite."""
LARGEST_VELOCITY = 1e9
"""Velocity that a start may have [rad/s]."""


@dataclass(frozen=True)
class Rollout:
    """A run: arrays of shape ``(times,)``, or ``(runs, times)`` if started from an array of angles.

    Attributes:
        time: [s], shape ``(times,)``: multiples of ``every`` steps, then the end. A single run that stopped early ends
            where it stopped.
        angle: unwrapped, from the downward vertical [rad].
        velocity: [rad/s].
        ledger: kinetic, potential, work, heat, residual [J].
        heat_by_effect: heat of each dissipative effect [J], where ``diagnostics`` asked for it.
        stop_reason: "" if it ran to its end, else "diverged", "speed_limit" or "slack"; a tuple of them for a batch,
            whose values at times after a stop are nan.
        stop_time: time of the last step that was taken [s]; an array of the starts' shape for a batch.
        scene, method, dt: what ran.
    """

    time: Array
    angle: Array
    velocity: Array
    ledger: Ledger
    stop_reason: str | tuple[str, ...]
    stop_time: float | Array
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
        damping: as in :func:`pendulum_env.physics.damping.with_damping`; the parameters change what it left.
        angle, velocity: start [rad, rad/s]; numbers, or arrays for a batch; by default the scene's usual run.
        duration: [s]; by default the usual run's. Rounded up to whole steps.
        dt: the integrator's step [s]; by default the usual run's.
        every: record every so many steps, and the last.
        control: constant share of the motor's torque, within [-1, 1].
        diagnostics: "energy" and "heat_by_effect", or () for neither work nor heat.
        speed_limit: |velocity| at which a run ends with "speed_limit" [rad/s].
        backend: "auto", "compiled" or "python"; same bits.
        **parameters: single parameters of the scene, such as ``length=0.5``.

    Returns a Rollout. A run that leaves the finite range, or whose energy residual is beyond all sense, ends there
    with ``stop_reason`` "diverged", and what it had found before is kept.

    Raises SceneError or MethodError for anything that cannot be.
    """
    place = build_scene(scene, damping, parameters)
    machine = Machine(place, integrator, diagnostics, backend)
    h = number(place.run.dt if dt is None else dt, "dt", above=0.0, unit="s")
    length = number(place.run.duration if duration is None else duration, "duration", above=0.0, unit="s")
    steps = checked_steps(length, h)
    share = checked_control(control)
    if isinstance(every, bool) or not isinstance(every, (int, np.integer)) or every < 1:
        raise SceneError(f"every must be a whole number of steps from 1, not {every!r}.")
    limit = math.inf if speed_limit == math.inf else number(speed_limit, "speed_limit", above=0.0, unit="rad/s")
    q0, v0 = checked_start(
        place, place.run.angle if angle is None else angle, place.run.velocity if velocity is None else velocity
    )
    stride = min(int(every), steps)
    rows, rest = 1 + steps // stride, steps % stride
    count = (rows + (rest > 0)) * q0.size
    if count > MOST_ROWS:
        raise SceneError(f"{count} states are too many to record, at most {MOST_ROWS}; raise every or shorten the run.")
    grid = np.minimum(stride * np.arange(rows + (rest > 0)), steps).astype(np.float64)
    runs = [
        simulate(machine, q, v, h=h, rows=rows, every=stride, rest=rest, control=share, speed_limit=limit)
        for q, v in zip(q0.ravel().tolist(), v0.ravel().tolist(), strict=True)
    ]
    if q0.ndim == 0:
        states, reason = runs[0]
        return _result(machine, states, reason, float(states[-1, INDEX]) * h, h, states[:, INDEX] * h)
    whole = np.full((len(runs), len(grid), machine.width), np.nan)
    for target, (states, _) in zip(whole, runs, strict=True):
        target[: len(states)] = states
    whole[whole[..., INDEX] != grid] = np.nan
    ends: Array = np.array([states[-1, INDEX] * h for states, _ in runs]).reshape(q0.shape)
    reasons = tuple(reason for _, reason in runs)
    return _result(machine, whole.reshape(*q0.shape, len(grid), -1), reasons, ends, h, grid * h)


def checked_steps(duration: float, h: float) -> int:
    """Steps of ``h`` in a run of ``duration`` [s], rounded up; SceneError for more than MOST_STEPS."""
    count = duration / h if h > 0.0 else math.inf
    if not count <= MOST_STEPS:
        raise SceneError(
            f"A run of {duration:g} s in steps of {h:g} s takes {count:.3g} steps, more than the {MOST_STEPS:.0e} that "
            "can be; take longer steps or a shorter run."
        )
    return max(1, math.ceil(count - 1e-9 - 1e-12 * count))


def checked_control(control: Any) -> float:
    """A share of the motor's torque; SceneError if it is no number within -1 and 1."""
    share = number(control, "control")
    if abs(share) > 1.0:
        raise SceneError(f"control must be within -1 and 1, not {share!r}.")
    return share


def checked_start(scene: Scene, angle: ArrayLike, velocity: ArrayLike) -> tuple[Array, Array]:
    """Angle [rad] and velocity [rad/s] of starts, as two arrays of one shape, ``()`` for two numbers.

    Raises SceneError for what is no finite number, beyond LARGEST_ANGLE or LARGEST_VELOCITY, of shapes that do not
    fit together, or of an energy that is not finite.
    """
    q0, v0 = _start(angle, "angle", "rad"), _start(velocity, "velocity", "rad/s")
    try:
        q, v = np.broadcast_arrays(q0, v0)
    except ValueError:
        raise SceneError(f"angle and velocity must have one shape, not {q0.shape} and {v0.shape}.") from None
    most = (float(np.max(np.abs(q))), float(np.max(np.abs(v))))
    limits = (LARGEST_ANGLE[scene.periodic], LARGEST_VELOCITY)
    for name, value, limit, unit in zip(("angle", "velocity"), most, limits, ("rad", "rad/s"), strict=True):
        if value > limit:
            raise SceneError(f"{name} must be within -{limit:g} and {limit:g} {unit} at the start, not {value!r}.")
    rate = scene.omega0 * (1.0 + most[0])
    if not math.isfinite(scene.inertia * (most[1] * most[1] + rate * rate)):
        raise SceneError(f"The energy of a start from {most[0]:g} rad and {most[1]:g} rad/s must be finite; it is not.")
    return q, v


def checked_methods(integrators: Iterable[str | Method], scene: Scene) -> list[Method]:
    """The methods, each fitting the scene and none twice; MethodError otherwise, and for none at all."""
    methods = [find_method(name, scene) for name in integrators]
    if not methods:
        raise MethodError("At least one integrator is needed, not none.")
    for i, method in enumerate(methods):
        if method.name in (earlier.name for earlier in methods[:i]):
            raise MethodError(f"The integrator {method.name} is named twice; each can be there once.")
    return methods


def _start(value: ArrayLike, name: str, unit: str) -> Array:
    try:
        given = np.asarray(value)
        if given.dtype.kind not in "iufO":
            raise TypeError
        found = given.astype(np.float64)
    except (TypeError, ValueError, OverflowError):
        raise SceneError(f"{name} must be a number or an array of numbers [{unit}], not {value!r}.") from None
    if found.size == 0 or not np.all(np.isfinite(found)):
        raise SceneError(f"{name} must hold at least one number, all of them finite [{unit}], not {value!r}.")
    return found


def simulate(
    machine: Machine,
    angle: float,
    velocity: float,
    *,
    h: float,
    rows: int,
    every: int = 1,
    rest: int = 0,
    control: float = 0.0,
    speed_limit: float = math.inf,
) -> tuple[Array, str]:
    """States of one run of a machine, and why it stopped, or "".

    There are ``rows`` states, the start and one after every ``every`` steps of ``h``, and one more after a ``rest`` of
    fewer steps, if any; where the run stops early, the last one is there.
    """
    out = np.empty((rows + (rest > 0), machine.width))
    state = machine.state(angle, velocity)
    code = machine.run(state, machine.parameters, control, h, rows - 1, every, speed_limit, out[:rows], UNSEEN)
    if rest and not code:
        code = machine.run(state, machine.parameters, control, h, 1, rest, speed_limit, out[rows - 1 :], UNSEEN)
    states, reason = out[: 1 + math.ceil(state[INDEX] / every)], STOP_REASONS.get(code, "")
    if machine.diagnostics:
        ledger = machine.ledger(states, machine.ledger(states[0], 0.0).energy)
        absurd = np.flatnonzero(ledger.absurd(machine.scale))
        if absurd.size:
            states, reason = states[: absurd[0] + 1], "diverged"
    return states, reason


def _result(
    machine: Machine, states: Array, reason: str | tuple[str, ...], end: float | Array, h: float, time: Array
) -> Rollout:
    initial = machine.ledger(states[..., :1, :], 0.0).energy
    return Rollout(
        time=time,
        angle=states[..., ANGLE] + TWO_PI * states[..., TURNS],
        velocity=states[..., VELOCITY],
        ledger=machine.ledger(states, initial),
        heat_by_effect=machine.heat_by_effect(states),
        stop_reason=reason,
        stop_time=end,
        scene=machine.scene,
        method=machine.method,
        dt=h,
    )
