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

import integrators
from pendulum_env.engine.generate import program
from pendulum_env.engine.kernels import interpreted
from pendulum_env.physics import exact
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import number

Array = NDArray[np.float64]
State = tuple[float, float]
Advance = Callable[["Problem", float, State, float, float], State]

ROUNDING = 1e-15
"""The closed forms are good to ``ROUNDING (4 + omega0 t)`` [rad]: the rounding of the phase."""
COLUMNS = 5
"""Midpoint rules extrapolated, with 2, 4, ... 2 COLUMNS steps: order 2 COLUMNS. More of them amplify rounding."""
SMALLEST = 30
"""A span is halved at most so often."""
LOOKS = 16
"""So often per piece the torques on a bob at rest are compared with the limit of dry friction."""


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
    problem = problem_of(scene)
    main = _path(problem, _extrapolated, (q, v), marks)
    check = _path(problem, _dormand_prince, (q, v), marks)
    if not (np.all(np.isfinite(main)) and np.all(np.isfinite(check))):
        raise StudyError(f"The motion of '{scene.name}' from {q:g} rad and {v:g} rad/s leaves the finite range.")
    difference = float(np.max(np.abs(main[:, 0] - check[:, 0])))
    how = f"Gragg's extrapolation, order {2 * COLUMNS}; Dormand & Prince's order 8 differs by {difference:.1g} rad"
    return Reference(main[:, 0], main[:, 1], max(difference, rounding), how)


def closed_form(scene: Scene, angle: float, velocity: float, times: Array) -> Reference | None:
    """The same where the scene has a closed form, for a start and times that are known to be sound; else None."""
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


# --- two solutions --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Problem:
    """``a(t, q, v, direction)``, the bound of dry friction, and a time in which the velocity turns but once."""

    acceleration: Callable[[float, float, float, float], float]
    limit: float
    longest: float


def problem_of(scene: Scene) -> Problem:
    made = program(scene, integrators.get("rk4"), ())
    if made.shape.drawn:
        raise StudyError(f"The scene '{scene.name}' has gusts, decided by a seed: no one motion is to compare with.")
    found = interpreted(made.text, made.title, {"sin": math.sin, "cos": math.cos})["acceleration"]
    values, dry = scene.coefficients, next((effect.dry for effect in scene.effects if effect.dry), "")
    still = dict.fromkeys((*made.shape.remembered, "control"), 0.0)
    extra = [{**values, **still, "side": 1.0}[name] for name in made.shape.extra]

    def sliding(t: float, q: float, v: float, direction: float) -> float:
        return float(found(t, q, v, *extra, direction))

    def smooth(t: float, q: float, v: float, direction: float) -> float:
        return float(found(t, q, v, *extra))

    fastest = max(scene.omega0, *(values[effect.beat] for effect in scene.effects if effect.beat), 0.0)
    longest = math.pi / (12.0 * fastest) if fastest else math.inf
    return Problem(sliding if dry else smooth, values[dry] if dry else 0.0, longest)


def _path(problem: Problem, advance: Advance, state: State, marks: Array) -> Array:
    """Angle and velocity at the marks, shape ``(times, 2)``."""
    rows, t = [], 0.0
    for mark in marks:
        while t < mark:
            end = mark if mark - t <= problem.longest else t + problem.longest
            t, state = _piece(problem, advance, t, state, float(end))
        rows.append(state)
    return np.array(rows, dtype=float)


def _piece(problem: Problem, advance: Advance, t: float, state: State, end: float) -> tuple[float, State]:
    """On to ``end``, or to the zero of the velocity before it; a bob that sticks stays."""
    q, v = state
    direction = math.copysign(1.0, v)
    if v == 0.0:
        other = problem.acceleration(t, q, 0.0, 0.0)
        if abs(other) <= problem.limit:
            return _breakaway(problem, t, q, end), state
        direction = math.copysign(1.0, other)
    q1, v1 = advance(problem, t, state, end, direction)
    if not direction * v1 < 0.0:
        return end, (q1, v1)
    low, high, part = t, end, end
    for _ in range(80):
        guess = part - v1 / (problem.acceleration(part, q1, v1, direction) or 1.0)
        guess = guess if low < guess < high else 0.5 * (low + high)
        if guess in (low, high, part):
            break
        part = guess
        q1, v1 = advance(problem, t, state, part, direction)
        if v1 == 0.0:
            break
        low, high = (part, high) if direction * v1 > 0.0 else (low, part)
    return part, (q1, 0.0)


def _breakaway(problem: Problem, t: float, q: float, end: float) -> float:
    """When a bob at rest is let go by dry friction, or ``end``; the other torques are looked at LOOKS times."""
    low = t
    for k in range(1, LOOKS + 1):
        high = t + (end - t) * k / LOOKS if k < LOOKS else end
        if abs(problem.acceleration(high, q, 0.0, 0.0)) > problem.limit:
            for _ in range(80):
                middle = 0.5 * (low + high)
                inside = abs(problem.acceleration(middle, q, 0.0, 0.0)) <= problem.limit
                low, high = (middle, high) if inside else (low, middle)
            return high
        low = high
    return end


def _extrapolated(problem: Problem, t: float, state: State, end: float, direction: float, depth: int = 0) -> State:
    """Gragg's rule over one span, which is halved until the last two columns of the scheme agree."""
    (q, v), span = state, end - t
    start = problem.acceleration(t, q, v, direction)
    push = abs(span) * (abs(start) + problem.limit)  # where dry friction lets go, the torques only just cancel
    sizes = abs(q) + abs(span * v) + abs(span) * push, (abs(v) + push) * (1.0 + abs(q))
    try:
        best, other = _midpoints(problem, t, state, span, direction, start)
        if all(abs(x - y) <= 1e-14 * size for x, y, size in zip(best, other, sizes, strict=True)):
            return best
    except (ArithmeticError, ValueError):  # overflow, or the sine of infinity: the span is far too long
        pass
    if depth == SMALLEST:
        raise StudyError(f"The motion cannot be followed beyond {t:g} s: its torques change too fast.")
    middle = 0.5 * (t + end)
    half = _extrapolated(problem, t, state, middle, direction, depth + 1)
    return _extrapolated(problem, middle, half, end, direction, depth + 1)


def _midpoints(
    problem: Problem, t: float, state: State, span: float, direction: float, start: float
) -> tuple[State, State]:
    """Midpoint rules with 2, 4, 6, ... steps, extrapolated to step zero: the best value and the next best."""
    f, (q, v) = problem.acceleration, state
    row: list[State] = []
    for n in range(2, 2 * COLUMNS + 1, 2):
        h = span / n
        q0, v0, q1, v1 = q, v, q + h * v, v + h * start
        for k in range(1, n):
            a = f(t + k * h, q1, v1, direction)
            q0, v0, q1, v1 = q1, v1, q0 + 2.0 * h * v1, v0 + 2.0 * h * a
        before, row = row, [(q1, v1)]
        for k, (old_q, old_v) in enumerate(before):
            weight = 1.0 / ((n / (n - 2.0 * (k + 1))) ** 2 - 1.0)
            row.append((row[k][0] + weight * (row[k][0] - old_q), row[k][1] + weight * (row[k][1] - old_v)))
    return row[-1], row[-2]


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
