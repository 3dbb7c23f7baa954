"""Reference solutions in smooth pieces, which end at every zero of the velocity, located to rounding.

At a zero of the velocity quadratic drag has a kink and dry friction jumps or sticks, so that methods of high order lose
accuracy in a step across it. Studies and the choice of a method compare runs with these solutions.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

import integrators
from integrators import Method
from pendulum_env.engine.generate import program
from pendulum_env.engine.kernels import interpreted
from pendulum_env.physics.scene import Scene
from pendulum_env.truth.answer import Array

State = tuple[float, float]
Advance = Callable[["SceneEquation", float, State, float, float], State]
"""``advance(problem, t, (q, v), end, direction)`` returns (q, v) at ``end``; friction acts against ``direction``."""
Attempt = Callable[["SceneEquation", float, State, float, float, float], tuple[State, State]]
"""``attempt(problem, t, (q, v), span, direction, a)`` returns the best (q, v) after ``span`` and one to compare."""


COLUMNS = 5
"""Number of extrapolated midpoint rules, with 2, 4, ..., 2 COLUMNS steps: order 2 COLUMNS. More amplify rounding."""
SMALLEST = 30
"""Maximum number of times that a span is halved."""
LOOKS = 16
"""Times per piece at which the torques on a bob at rest are compared with the limit of dry friction."""


class PieceError(ValueError):
    """Error raised for a reference solution that cannot be computed, because its torques change too fast."""


@dataclass(frozen=True)
class SceneEquation:
    """Equation of motion of a scene under a constant control.

    Attributes:
        acceleration: ``a(t, q, v, direction)`` [rad/s²].
        limit: largest acceleration by dry friction [rad/s²].
        longest: a time in which the velocity changes its sign at most once [s].
        names, extra: names and values of the arguments that the scene's functions take after t, q and v.
        dry: True if these functions also take the direction of dry friction, as the last argument.
    """

    acceleration: Callable[[float, float, float, float], float]
    limit: float
    longest: float
    names: tuple[str, ...]
    extra: list[float]
    dry: bool

    def hold(self, values: Mapping[str, float]) -> None:
        """Set arguments of the scene's functions, such as the control; names that they do not take are ignored."""
        for i, name in enumerate(self.names):
            self.extra[i] = values.get(name, self.extra[i])


def problem_of(scene: Scene, functions: Mapping[str, Any] | None = None) -> SceneEquation:
    """Return the equation of motion of a scene with control, gusts and motor at zero.

    ``functions`` maps names of functions in the generated source, such as ``sin``, to their replacements.
    """
    generated = program(scene, integrators.get("rk4"), ())
    acceleration = interpreted(generated.text, generated.title, functions)["acceleration"]
    values, dry = scene.coefficients, next((effect.dry for effect in scene.effects if effect.dry), "")
    at_rest = dict.fromkeys((*generated.shape.remembered, "control"), 0.0)
    extra = [{**values, **at_rest, "side": 1.0}[name] for name in generated.shape.extra]

    def sliding(t: float, q: float, v: float, direction: float) -> float:
        return float(acceleration(t, q, v, *extra, direction))

    def smooth(t: float, q: float, v: float, direction: float) -> float:
        return float(acceleration(t, q, v, *extra))

    fastest = max(scene.omega0, *(values[effect.beat] for effect in scene.effects if effect.beat), 0.0)
    longest = math.pi / (12.0 * fastest) if fastest else math.inf
    limit = values[dry] if dry else 0.0
    return SceneEquation(sliding if dry else smooth, limit, longest, generated.shape.extra, extra, bool(dry))


def path(problem: SceneEquation, advance: Advance, state: State, marks: Iterable[float], t: float = 0.0) -> list[State]:
    """Return angle and velocity at the times ``marks`` [s], in order, from ``state`` at time ``t`` on."""
    rows = []
    for mark in marks:
        while t < mark:
            end = mark if mark - t <= problem.longest else t + problem.longest
            t, state = _piece(problem, advance, t, state, end)
        rows.append(state)
    return rows


def _piece(problem: SceneEquation, advance: Advance, t: float, state: State, end: float) -> tuple[float, State]:
    """Advance a motion to the time ``end``, or only to the first zero of the velocity; return time and state.

    A bob that dry friction holds stays at rest until the torques exceed the limit.
    """
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


def _breakaway(problem: SceneEquation, t: float, q: float, end: float) -> float:
    """Return the time at which the torques on a bob held by dry friction exceed its limit; ``end`` if they do not."""
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


# --- two ways to advance --------------------------------------------------------------------------------------------


def halving(attempt: Attempt, agreement: float, enough: float = 0.0) -> Advance:
    """Return a function that advances a motion in spans of time, halved until two results of ``attempt`` agree.

    They agree if they differ by at most the fraction ``agreement`` of the possible change of the motion in the span,
    plus ``enough`` [rad, rad/s]. The function raises PieceError after SMALLEST halvings of one span.
    """

    def advance(problem: SceneEquation, t: float, state: State, end: float, direction: float, depth: int = 0) -> State:
        (q, v), span = state, end - t
        start = problem.acceleration(t, q, v, direction)
        push = abs(span) * (abs(start) + problem.limit)  # when the bob starts to slide, the torques nearly cancel
        sizes = abs(q) + abs(span * v) + abs(span) * push, (abs(v) + push) * (1.0 + abs(q))
        try:
            best, other = attempt(problem, t, state, span, direction, start)
            if all(abs(x - y) <= agreement * size + enough for x, y, size in zip(best, other, sizes, strict=True)):
                return best
        except (ArithmeticError, ValueError):  # overflow, or the sine of infinity: the span is far too long
            pass
        if depth == SMALLEST:
            raise PieceError(f"The reference solution ends at {t:g} s: the torques change too fast there.")
        middle = 0.5 * (t + end)
        half = advance(problem, t, state, middle, direction, depth + 1)
        return advance(problem, middle, half, end, direction, depth + 1)

    return advance


def _midpoints(
    problem: SceneEquation, t: float, state: State, span: float, direction: float, start: float
) -> tuple[State, State]:
    """Extrapolate results of the midpoint rule with 2, 4, 6, ... steps to a step of zero.

    Returns the best result and the second best, whose difference estimates the error.
    """
    f, (q, v) = problem.acceleration, state
    row: list[State] = []
    for n in range(2, 2 * COLUMNS + 1, 2):
        h = span / n
        q0, v0, q1, v1 = q, v, q + h * v, v + h * start
        for k in range(1, n):
            a = f(t + k * h, q1, v1, direction)
            q0, v0, q1, v1 = q1, v1, q0 + 2.0 * h * v1, v0 + 2.0 * h * a
        previous, row = row, [(q1, v1)]
        for k, (old_q, old_v) in enumerate(previous):
            weight = 1.0 / ((n / (n - 2.0 * (k + 1))) ** 2 - 1.0)
            row.append((row[k][0] + weight * (row[k][0] - old_q), row[k][1] + weight * (row[k][1] - old_v)))
    return row[-1], row[-2]


def extrapolated(enough: float = 0.0) -> Advance:
    """Return a function that advances a motion by Gragg's extrapolated midpoint rule of order ``2 COLUMNS``.

    ``enough`` is the accepted difference, see :func:`halving` (Gragg 1965, SIAM J. Numer. Anal. 2, 384).
    """
    return halving(_midpoints, 1e-14, enough)


def doubled(scene: Scene, method: Method, enough: float = 0.0) -> Advance:
    """Return a function that advances a motion by an explicit Runge-Kutta method of order 8 or 9.

    One step is compared with two half steps, whose result is used. Agreement to 1e-13 means an error about 2**order
    times smaller.
    """
    generated = program(scene, method, ())
    step = interpreted(generated.text, generated.title)["step"]

    def attempt(
        problem: SceneEquation, t: float, state: State, span: float, direction: float, _start: float
    ) -> tuple[State, State]:
        more = (*problem.extra, direction) if problem.dry else tuple(problem.extra)
        (q, v), half = state, 0.5 * span
        middle = step(t, q, v, half, *more)
        return step(t + half, *middle, half, *more), step(t, q, v, span, *more)

    return halving(attempt, 1e-13, enough)


def dormand_prince(problem: SceneEquation, t: float, state: State, end: float, direction: float = 0.0) -> State:
    """Advance a motion by Dormand & Prince's method of order 8 at the smallest tolerance of SciPy; nan if it fails.

    (Hairer, Norsett & Wanner 1993, II.5.)
    """
    from scipy.integrate import DOP853

    def rates(time: float, y: Any) -> Array:
        return np.array([y[1], problem.acceleration(time, float(y[0]), float(y[1]), direction)])

    size = abs(state[0]) + (end - t) * abs(state[1])
    solver = DOP853(rates, t, np.array(state), end, rtol=3e-14, atol=1e-16 * (size or 1.0))
    while solver.status == "running":
        solver.step()
    return (float(solver.y[0]), float(solver.y[1])) if solver.status == "finished" else (math.nan, math.nan)
