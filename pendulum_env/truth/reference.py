"""Reference solutions of scenes: the closed form if there is one, else independent solutions of high order.

Studies compare runs with them. Each reference solution has an error estimate and a text on its origin.
:func:`phase_errors` computes how early or late a run is compared with it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pendulum_env.engine.kernels import resolve
from pendulum_env.engine.machine import TWO_PI
from pendulum_env.engine.rollout import rollout
from pendulum_env.engine.wrap import half_turns, side_of, without_half_turns
from pendulum_env.physics import exact
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import number
from pendulum_env.truth.answer import Array, Truth
from pendulum_env.truth.pieces import (
    COLUMNS,
    PieceError,
    SceneEquation,
    dormand_prince,
    extrapolated,
    path,
    problem_of,
)

ROUNDING = 1e-15
"""Closed forms have the error ``ROUNDING (4 + omega0 t)`` [rad], the rounding of the phase."""
STEPPED = "rk4"
"""Method of :func:`true_motion` for reference solutions at very many times."""
FINE = 5e-4
"""Step of :func:`true_motion`, times omega0."""
MOST = {"compiled": 30_000_000, "python": 200_000}
"""Maximum number of steps of :func:`true_motion` by backend."""
MARKS = 24
"""Number of times at which :func:`reference` checks :func:`true_motion`."""
TOLERANCE = 1e-6
"""Largest difference of two solutions [rad] with which they count as a reference solution."""
SLOWEST = 1e-3
"""Phase errors are nan where the motion is slower than this fraction of its largest speed in phase space."""


class StudyError(ValueError):
    """Error raised for invalid input of a study, or for a reference solution that cannot be computed."""


def reference(scene: Scene, angle: float, velocity: float, times: ArrayLike) -> Truth:
    """Return the reference solution of a scene without control, from a start at time 0.

    There are closed forms for ``theta'' + gamma theta' + omega0² theta = 0``, ``theta'' + omega0² sin(theta) = 0`` and
    drag alone. All other motions are computed with Gragg's extrapolated midpoint rule of order 10 and checked with
    Dormand & Prince's method of order 8; their largest difference is the error estimate. Both divide the motion at
    every zero of the velocity, where quadratic drag has a kink and dry friction jumps or sticks, so that each piece is
    smooth.

    Args:
        scene: any scene.
        angle, velocity: start [rad, rad/s].
        times: times [s], none below 0, not decreasing.

    Raises SceneError for a start that is not finite; StudyError for times that are negative or decrease, a scene with
    gusts, or a motion that does not stay finite. Without a closed form it takes about 30 ms per period.

    Sources: Gragg 1965, SIAM J. Numer. Anal. 2, 384; Hairer, Norsett & Wanner 1993, sections II.5 and II.9.
    """
    q, v = number(angle, "angle", unit="rad"), number(velocity, "velocity", unit="rad/s")
    marks = np.atleast_1d(np.asarray(times, dtype=float))
    if marks.ndim != 1 or marks.size == 0 or not (np.all(np.isfinite(marks)) and marks[0] >= 0.0):
        raise StudyError("The times of a reference solution must be a list of finite numbers [s], none below 0.")
    if np.any(np.diff(marks) < 0.0):
        raise StudyError("The times of a reference solution must not decrease.")
    exact_solution = closed_form(scene, q, v, marks)
    if exact_solution is not None:
        return exact_solution
    _refuse_clip(scene, q, v)
    rounding = ROUNDING * (4.0 + scene.omega0 * float(marks[-1]))
    problem, halves = motion_of(scene), half_turns(q) if scene.periodic else 0.0
    problem.hold({"side": side_of(0.5 * halves)})
    start = (without_half_turns(q, halves), v)  # from the nearer of bottom and top, to keep digits near the top
    try:
        main = np.array(path(problem, extrapolated(), start, marks.tolist()))
    except PieceError as error:
        raise StudyError(str(error)) from None
    check = np.array(path(problem, dormand_prince, start, marks.tolist()))
    if not (np.all(np.isfinite(main)) and np.all(np.isfinite(check))):
        raise StudyError(f"The motion of '{scene.name}' from {q:g} rad and {v:g} rad/s does not stay finite.")
    difference = float(np.max(np.abs(main[:, 0] - check[:, 0])))
    how = f"Gragg's extrapolation, order {2 * COLUMNS}; Dormand & Prince's order 8 differs by {difference:.1g} rad"
    return Truth(marks, main[:, 0] + TWO_PI * (0.5 * halves), main[:, 1], max(difference, rounding), how)


def _refuse_clip(scene: Scene, q: float, v: float) -> None:
    """Raise StudyError for a start [rad, rad/s] from which the speed may reach the bound at which a scene clips it."""
    bound = min((scene.coefficients[effect.limit] for effect in scene.effects if effect.limit), default=math.inf)
    if math.hypot(v, 2.0 * scene.omega0 * math.sin(0.5 * q)) > bound:
        raise StudyError(f"The scene '{scene.name}' clips the velocity at {bound:g} rad/s after every step, so that no "
                         "motion is the true one; start it slower, or leave the effect clip out.")


def closed_form(scene: Scene, angle: float, velocity: float, times: Array) -> Truth | None:
    """Return the closed form of a scene's motion at times [s] from a valid start [rad, rad/s], or None."""
    names = {effect.name for effect in scene.effects if not (effect.kind == "inertia" or effect.idle)}
    for allowed, form, how in CLOSED:
        solution = form(times, angle, velocity, scene.coefficients) if names <= allowed else None
        if solution is not None:
            rounding = ROUNDING * (4.0 + scene.omega0 * float(times[-1]))
            return Truth(times, np.asarray(solution[0]), np.asarray(solution[1]), rounding, how, closed=True)
    return None


# --- closed forms ---------------------------------------------------------------------------------------------------


def _linear(t: Array, q: float, v: float, values: dict[str, float]) -> Any:
    """Return the exact angle and velocity of a scene's damped harmonic oscillator at times t."""
    square = values.get("spring_rate", values.get("fibre_rate", 0.0))
    return exact.linear(t, q, v, math.sqrt(square), values.get("linear_drag_rate", 0.0))


def _drag(t: Array, q: float, v: float, values: dict[str, float]) -> Any:
    """Return angle and velocity of a bob under drag alone (no gravity) at times t."""
    way, speed = exact.drag_only(t, v, values.get("linear_drag_rate", 0.0), values.get("quadratic_drag_rate", 0.0))
    return q + way, speed


CLOSED: tuple[tuple[frozenset[str], Callable[..., Any], str], ...] = (
    (frozenset({"small_angle_gravity", "linear_drag"}), _linear, "closed form of the damped harmonic oscillator"),
    (frozenset({"fibre", "linear_drag"}), _linear, "closed form of the damped harmonic oscillator"),
    (frozenset({"gravity"}),
     lambda t, q, v, x: exact.pendulum(t, q, v, math.sqrt(x["gravity_rate"])) if x["gravity_rate"] else None,
     "closed form in Jacobi's elliptic functions"),
    (frozenset({"linear_drag", "quadratic_drag"}), _drag, "closed form of drag alone"),
)
"""Effects that a closed form covers, its function, and its name; the function returns None if it does not apply."""


# --- at very many times ---------------------------------------------------------------------------------------------


def true_motion(scene: Scene, angle: float, velocity: float, time: Array) -> Truth:
    """Return the reference solution of a scene without control at many evenly spaced times [s].

    The start is ``angle`` [rad] and ``velocity`` [rad/s]. If :func:`reference` has no closed form, the solution is rk4
    (Kutta 1901) at a step of about ``FINE / omega0``, checked against :func:`reference` at ``MARKS`` times. The largest
    difference is the error; if it exceeds ``TOLERANCE``, the motion is unknown (nan), as it is after a wire goes slack.
    """
    names = {effect.name for effect in scene.effects if not effect.idle}
    if any(names <= allowed for allowed, *_ in CLOSED):
        solution = reference(scene, angle, velocity, time)
        angles, speeds = _while_taut(scene, solution.angle, solution.velocity)
        return replace(solution, angle=angles, velocity=speeds)
    parts = _parts(scene, time)
    step = float(time[1]) / parts
    run = rollout(scene, integrator=STEPPED, angle=angle, velocity=velocity, dt=step, every=parts,
                  duration=float(time[-1]), diagnostics=(), warn=False)
    reached = min(len(run.time), len(time)) - (1 if run.stop_reason else 0)
    if not reached:
        return _unknown(time, f"none: {run.ending}")
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
    how = f"rk4 at {step:.3g} s, confirmed to {error:.1g} rad by another solution: {check.how}"
    return Truth(time, angles, speeds, error, how)


def _parts(scene: Scene, time: Array) -> int:
    """Return the number of steps that the reference solution takes between neighbouring entries of ``time``."""
    wanted = math.ceil(float(time[1]) * max(scene.omega0, 1.0) / FINE)
    return max(1, min(max(8, wanted), MOST[resolve("auto")] // len(time)))


def _while_taut(scene: Scene, angle: Array, velocity: Array) -> tuple[Array, Array]:
    """Replace angle and velocity by nan from the time at which the pendulum's wire goes slack.

    A pendulum on a rod is returned unchanged.
    """
    gravity = scene.coefficients.get("gravity_rate")
    if scene.body.suspension == "rod" or gravity is None:
        return angle, velocity
    slack = np.maximum.accumulate(velocity * velocity + gravity * np.cos(angle) < 0.0)
    return np.where(slack, math.nan, angle), np.where(slack, math.nan, velocity)


def _unknown(time: Array, why: str) -> Truth:
    """Return a reference solution that is nan (not known) at all times, with the reason ``why``."""
    nothing = np.full(len(time), math.nan)
    return Truth(time, nothing, nothing, math.nan, why)


# --- the check ------------------------------------------------------------------------------------------------------


def refuse_gusts(scene: Scene) -> None:
    """Raise StudyError for a scene with gusts, whose motion depends on a seed."""
    if any(effect.draws for effect in scene.effects):
        raise StudyError(f"The scene '{scene.name}' has gusts, which depend on a seed: it has no unique motion.")


def motion_of(scene: Scene) -> SceneEquation:
    """Return a scene's equation of motion without control; raises StudyError for gusts, which depend on a seed."""
    refuse_gusts(scene)
    return problem_of(scene, {"sin": math.sin, "cos": math.cos})


# --- early and late -------------------------------------------------------------------------------------------------


def accelerations(scene: Scene, times: ArrayLike, truth: Truth) -> Array:
    """Return the acceleration [rad/s²] of a reference solution at each time [s]; 0 where dry friction holds the bob."""
    problem, marks = motion_of(scene), np.asarray(times, dtype=float)
    rows = zip(marks, truth.angle, truth.velocity, strict=True)
    return np.array([_acceleration(problem, float(t), float(q), float(v)) for t, q, v in rows])


def _acceleration(problem: SceneEquation, t: float, q: float, v: float) -> float:
    """Return the acceleration [rad/s²] at a state (q, v), with dry friction; 0 if dry friction holds the bob."""
    side = float(np.sign(v or problem.acceleration(t, q, 0.0, 0.0)))
    held = v == 0.0 and abs(problem.acceleration(t, q, 0.0, 0.0)) <= problem.limit
    return 0.0 if held else problem.acceleration(t, q, v, side)


def phase_errors(omega0: float, truth: Truth, pull: Array, angle: ArrayLike, velocity: ArrayLike) -> Array:
    """Return the phase error of a run [rad] at each time: its lead over the reference solution, times ``omega0``.

    The result is nan where the motion is too slow to define it.

    In the plane of ``(omega0 q, v)`` the motion has the direction ``(omega0 v, a)`` with the acceleration ``a``. The
    component of the error ``(omega0 dq, dv)`` in this direction gives the lead ``tau`` [s], to first order::

        tau = (omega0² dq v + dv a)/(omega0² v² + a²)        phase = omega0 tau

    On a harmonic oscillator with the right amplitude, ``phase`` is the sine of the run's phase lead.

    Args:
        omega0: angular frequency [rad/s]; if it is 0, the result is nan.
        truth: the reference solution.
        pull: its acceleration [rad/s²] from :func:`accelerations`.
        angle, velocity: the run at the times of the reference solution [rad, rad/s].
    """
    v = truth.velocity
    size = omega0 * omega0 * v * v + pull * pull
    fast = (size > 0.0) & (size >= SLOWEST * SLOWEST * np.max(size)) & (omega0 > 0.0)
    along = omega0 * omega0 * (np.asarray(angle) - truth.angle) * v + (np.asarray(velocity) - v) * pull
    return np.where(fast, omega0 * along / np.where(fast, size, 1.0), np.nan)
