"""The motion of a scene: in closed form where there is one, else by independent solutions of high order.

Truth for the studies. Each brings an estimate of its own error and a sentence on its origin. :func:`phase_errors` says
how early or late a run is along it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pendulum_env.engine.kernels import resolve
from pendulum_env.engine.machine import TWO_PI
from pendulum_env.engine.rollout import rollout
from pendulum_env.engine.wrap import half_turns, side_of, without_half_turns
from pendulum_env.physics import exact
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import number
from pendulum_env.truth.answer import Truth
from pendulum_env.truth.pieces import COLUMNS, PieceError, Problem, State, extrapolated, path, problem_of

Array = NDArray[np.float64]

ROUNDING = 1e-15
"""The closed forms are good to ``ROUNDING (4 + omega0 t)`` [rad]: the rounding of the phase."""
STEPPED = "rk4"
"""The method of motions at very many times, whose every step is known."""
FINE = 5e-4
"""Its step, times omega0."""
MOST = {"compiled": 30_000_000, "python": 200_000}
"""Steps that it may take."""
MARKS = 24
"""Times at which a second solution checks it."""
TOLERANCE = 1e-6
"""Two solutions further apart than this [rad] are no truth."""
SLOWEST = 1e-3
"""Where the motion is slower than this part of its fastest, early and late mean little, and are not looked at."""


class StudyError(ValueError):
    """A question that a study cannot answer, or numbers that cannot be had."""


Reference = Truth
"""The name of before, in scripts and pickles."""


def reference(scene: Scene, angle: float, velocity: float, times: ArrayLike) -> Truth:
    """The motion of a scene, with no control, from a start at time 0.

    Closed form: ``theta'' + gamma theta' + omega0² theta = 0``, ``theta'' + omega0² sin(theta) = 0`` and drag alone.
    Everything else: Gragg's extrapolated midpoint rule of order 10, and Dormand & Prince's method of order 8 as the
    check; their largest difference is the error estimate. Both cut the run at every zero of the velocity, where
    quadratic drag has a kink and dry friction jumps or sticks, so that each piece is smooth.

    Args:
        scene: any scene.
        angle, velocity: start [rad, rad/s].
        times: [s], none below 0, not decreasing.

    Raises SceneError for a start that is not finite, StudyError for times that do not increase from 0, a scene with
    gusts or a motion that leaves the finite range. Takes about 30 ms per period where there is no closed form.

    Sources: Gragg 1965, SIAM J. Numer. Anal. 2, 384; Hairer, Norsett & Wanner 1993, sections II.5 and II.9.
    """
    q, v = number(angle, "angle", unit="rad"), number(velocity, "velocity", unit="rad/s")
    marks = np.atleast_1d(np.asarray(times, dtype=float))
    if marks.ndim != 1 or marks.size == 0 or not (np.all(np.isfinite(marks)) and marks[0] >= 0.0):
        raise StudyError("The times of a reference must be a list of finite numbers [s], none of them below 0.")
    if np.any(np.diff(marks) < 0.0):
        raise StudyError("The times of a reference must not decrease.")
    known = closed_form(scene, q, v, marks)
    if known is not None:
        return known
    rounding = ROUNDING * (4.0 + scene.omega0 * float(marks[-1]))
    problem, halves = motion_of(scene), half_turns(q) if scene.periodic else 0.0
    problem.hold({"side": side_of(0.5 * halves)})
    start = (without_half_turns(q, halves), v)  # from the nearer of bottom and top, where it keeps its digits
    try:
        main = np.array(path(problem, extrapolated(), start, marks.tolist()))
    except PieceError as error:
        raise StudyError(str(error)) from None
    check = np.array(path(problem, _dormand_prince, start, marks.tolist()))
    if not (np.all(np.isfinite(main)) and np.all(np.isfinite(check))):
        raise StudyError(f"The motion of '{scene.name}' from {q:g} rad and {v:g} rad/s leaves the finite range.")
    difference = float(np.max(np.abs(main[:, 0] - check[:, 0])))
    how = f"Gragg's extrapolation, order {2 * COLUMNS}; Dormand & Prince's order 8 differs by {difference:.1g} rad"
    return Truth(marks, main[:, 0] + TWO_PI * (0.5 * halves), main[:, 1], max(difference, rounding), how)


def closed_form(scene: Scene, angle: float, velocity: float, times: Array) -> Truth | None:
    """The same where the scene has a closed form, for a sound start [rad, rad/s] and times [s]; else None."""
    names = {effect.name for effect in scene.effects if effect.kind != "inertia"} - {"motor"}
    for allowed, form, how in CLOSED:
        found = form(times, angle, velocity, scene.coefficients) if names <= allowed else None
        if found is not None:
            rounding = ROUNDING * (4.0 + scene.omega0 * float(times[-1]))
            return Truth(times, np.asarray(found[0]), np.asarray(found[1]), rounding, how, closed=True)
    return None


# --- closed forms ---------------------------------------------------------------------------------------------------


def _linear(t: Array, q: float, v: float, values: dict[str, float]) -> Any:
    return exact.linear(t, q, v, math.sqrt(values.get("spring_rate", 0.0)), values.get("linear_drag_rate", 0.0))


def _pendulum(t: Array, q: float, v: float, values: dict[str, float]) -> Any:
    return exact.pendulum(t, q, v, math.sqrt(values["gravity_rate"])) if values["gravity_rate"] else None


def _drag(t: Array, q: float, v: float, values: dict[str, float]) -> Any:
    way, speed = exact.drag_only(t, v, values.get("linear_drag_rate", 0.0), values.get("quadratic_drag_rate", 0.0))
    return q + way, speed


CLOSED: tuple[tuple[frozenset[str], Callable[..., Any], str], ...] = (
    (frozenset({"small_angle_gravity", "linear_drag"}), _linear, "closed form of the damped harmonic oscillator"),
    (frozenset({"gravity"}), _pendulum, "closed form in Jacobi's elliptic functions"),
    (frozenset({"linear_drag", "quadratic_drag"}), _drag, "closed form of drag alone"),
)
"""Effects that a closed form covers, the form, and its name; the form gives None where it does not hold after all."""


# --- at very many times ---------------------------------------------------------------------------------------------


def true_motion(scene: Scene, angle: float, velocity: float, time: Array) -> Truth:
    """The motion of a scene from an angle [rad] and a velocity [rad/s], with no control, at evenly spaced times [s].

    Closed form where :func:`reference` has one. Else rk4 (Kutta 1901) at a step of ``FINE / omega0`` or less, which the
    solutions of :func:`reference` confirm at ``MARKS`` times: the largest difference is the error, and beyond
    ``TOLERANCE`` there is no truth. Unknown after a wire goes slack.
    """
    names = {effect.name for effect in scene.effects} - {"motor"}
    if any(names <= allowed for allowed, *_ in CLOSED):
        found = reference(scene, angle, velocity, time)
        angles, speeds = _while_taut(scene, found.angle, found.velocity)
        return replace(found, angle=angles, velocity=speeds)
    parts = _parts(scene, time)
    step = float(time[1]) / parts
    run = rollout(scene, integrator=STEPPED, angle=angle, velocity=velocity, dt=step, every=parts,
                  duration=float(time[-1]), diagnostics=(), warn=False)
    reached = min(len(run.time), len(time)) - (1 if run.stop_reason else 0)
    angles, speeds = np.full((2, len(time)), math.nan)
    angles[:reached], speeds[:reached] = run.angle[:reached], run.velocity[:reached]
    marks = np.unique(np.linspace(0, reached - 1, min(MARKS, reached)).astype(int))
    try:
        check = reference(scene, angle, velocity, time[marks])
    except StudyError as reason:
        return _unknown(time, f"none: {reason}")
    error = max(float(np.max(np.abs(angles[marks] - check.angle))), check.error_estimate)
    if run.stop_reason == "diverged" or not error <= TOLERANCE:
        return _unknown(time, f"none: rk4 at {step:.3g} s and an independent solution differ by {error:.2g} rad")
    how = f"rk4 at {step:.3g} s, confirmed to {error:.1g} rad by another: {check.how}"
    return Truth(time, angles, speeds, error, how)


def _parts(scene: Scene, time: Array) -> int:
    """Steps of the numerical truth from one time to the next."""
    wanted = math.ceil(float(time[1]) * max(scene.omega0, 1.0) / FINE)
    return max(1, min(max(8, wanted), MOST[resolve("auto")] // len(time)))


def _while_taut(scene: Scene, angle: Array, velocity: Array) -> tuple[Array, Array]:
    """The motion up to where a wire would have to push."""
    gravity = scene.coefficients.get("gravity_rate")
    if scene.body.suspension == "rod" or gravity is None:
        return angle, velocity
    slack = np.maximum.accumulate(velocity * velocity + gravity * np.cos(angle) < 0.0)
    return np.where(slack, math.nan, angle), np.where(slack, math.nan, velocity)


def _unknown(time: Array, why: str) -> Truth:
    nothing = np.full(len(time), math.nan)
    return Truth(time, nothing, nothing, math.nan, why)


# --- the check ------------------------------------------------------------------------------------------------------


def motion_of(scene: Scene) -> Problem:
    """The scene's equation of motion without control; StudyError for gusts, which decide it by a seed."""
    if any(effect.draws for effect in scene.effects):
        raise StudyError(f"The scene '{scene.name}' has gusts, decided by a seed: no one motion is to compare with.")
    return problem_of(scene, {"sin": math.sin, "cos": math.cos})


def _dormand_prince(problem: Problem, t: float, state: State, end: float, direction: float) -> State:
    """scipy's DOP853 at the tightest tolerance that it takes."""
    from scipy.integrate import DOP853

    def rates(time: float, y: Any) -> Array:
        return np.array([y[1], problem.acceleration(time, float(y[0]), float(y[1]), direction)])

    size = abs(state[0]) + (end - t) * abs(state[1])
    solver = DOP853(rates, t, np.array(state), end, rtol=3e-14, atol=1e-16 * (size or 1.0))
    while solver.status == "running":
        solver.step()
    return (float(solver.y[0]), float(solver.y[1])) if solver.status == "finished" else (math.nan, math.nan)


# --- early and late -------------------------------------------------------------------------------------------------


def accelerations(scene: Scene, times: ArrayLike, truth: Truth) -> Array:
    """Return the acceleration [rad/s²] of a reference at each time [s]; 0 where dry friction holds the bob."""
    problem, marks = motion_of(scene), np.asarray(times, dtype=float)
    rows = zip(marks, truth.angle, truth.velocity, strict=True)
    return np.array([_acceleration(problem, float(t), float(q), float(v)) for t, q, v in rows])


def _acceleration(problem: Problem, t: float, q: float, v: float) -> float:
    if v == 0.0 and problem.limit:
        free = problem.acceleration(t, q, 0.0, 0.0)
        return 0.0 if abs(free) <= problem.limit else problem.acceleration(t, q, 0.0, float(np.sign(free)))
    return problem.acceleration(t, q, v, float(np.sign(v)))


def phase_errors(omega0: float, truth: Truth, pull: Array, angle: ArrayLike, velocity: ArrayLike) -> Array:
    """Return by how much a run is ahead of the reference, times ``omega0``, at each time [rad].

    It is nan where the motion is too slow to tell.

    In the plane of ``(omega0 q, v)`` the motion goes along ``(omega0 v, a)``, ``a`` the acceleration. The error
    ``(omega0 dq, dv)`` has there the part ::

        tau = (omega0² dq v + dv a)/(omega0² v² + a²)        phase = omega0 tau

    of which ``tau`` [s] is how early the run is, to first order in the error. On a harmonic oscillator whose amplitude
    is right it is the sine of the phase that the run is ahead by.

    Args:
        omega0: [rad/s]; where it is 0, all is nan.
        truth: the reference; ``pull``: its acceleration [rad/s²], as :func:`accelerations` gives it.
        angle, velocity: of the run, at the reference's times [rad, rad/s].
    """
    v = truth.velocity
    size = omega0 * omega0 * v * v + pull * pull
    known = (size > 0.0) & (size >= SLOWEST * SLOWEST * np.max(size)) & (omega0 > 0.0)
    along = omega0 * omega0 * (np.asarray(angle) - truth.angle) * v + (np.asarray(velocity) - v) * pull
    return np.where(known, omega0 * along / np.where(known, size, 1.0), np.nan)
