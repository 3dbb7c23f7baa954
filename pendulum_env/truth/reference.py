"""What a run ought to give: the closed form where the scene has one, else two independent high-order solutions.

Truth for the studies. Every reference brings an estimate of its own error, and a sentence on how it was found.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pendulum_env.engine.machine import TWO_PI
from pendulum_env.engine.wrap import half_turns, side_of, without_half_turns
from pendulum_env.physics import exact
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import number
from pendulum_env.truth.pieces import COLUMNS, PieceError, Problem, State, extrapolated, path, problem_of

Array = NDArray[np.float64]

ROUNDING = 1e-15
"""The closed forms are good to ``ROUNDING (4 + omega0 t)`` [rad]: the rounding of the phase."""


class StudyError(ValueError):
    """A question that a study cannot answer, or numbers that cannot be had."""


@dataclass(frozen=True)
class Reference:
    """A motion to compare with.

    Attributes:
        angle, velocity: [rad, rad/s], unwrapped, one entry per time.
        error_estimate: of the angle, the largest over the times [rad].
        how: where it comes from, as a sentence for figures.
    """

    angle: Array
    velocity: Array
    error_estimate: float
    how: str


def reference(scene: Scene, angle: float, velocity: float, times: ArrayLike) -> Reference:
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
    return Reference(main[:, 0] + TWO_PI * (0.5 * halves), main[:, 1], max(difference, rounding), how)


def closed_form(scene: Scene, angle: float, velocity: float, times: Array) -> Reference | None:
    """The same where the scene has a closed form, for a sound start [rad, rad/s] and times [s]; else None."""
    names = {effect.name for effect in scene.effects if effect.kind != "inertia"} - {"motor"}
    for allowed, form, how in CLOSED:
        found = form(times, angle, velocity, scene.coefficients) if names <= allowed else None
        if found is not None:
            rounding = ROUNDING * (4.0 + scene.omega0 * float(times[-1]))
            return Reference(np.asarray(found[0]), np.asarray(found[1]), rounding, how)
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
