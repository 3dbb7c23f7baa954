"""A scene's motion in pieces that are smooth, interpreted: cut at every zero of the velocity, to rounding.

There quadratic drag has a kink, and dry friction jumps or sticks, so that methods of high order lose theirs. What is
followed here serves as truth for studies and for the choice of a method.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import integrators
from integrators import Method
from pendulum_env.engine.generate import program
from pendulum_env.engine.kernels import interpreted
from pendulum_env.physics.scene import Scene

State = tuple[float, float]
Advance = Callable[["Problem", float, State, float, float], State]
"""``advance(problem, t, (q, v), end, direction)``: on to ``end``, with dry friction against ``direction``."""
Attempt = Callable[["Problem", float, State, float, float, float], tuple[State, State]]
"""``attempt(problem, t, (q, v), span, direction, a)``: the best result, and one to compare it with."""

COLUMNS = 5
"""Midpoint rules extrapolated, with 2, 4, ... 2 COLUMNS steps: order 2 COLUMNS. More of them amplify rounding."""
SMALLEST = 30
"""A span is halved at most so often."""
LOOKS = 16
"""So often per piece the torques on a bob at rest are compared with the limit of dry friction."""


class PieceError(ValueError):
    """A motion that cannot be followed."""


@dataclass(frozen=True)
class Problem:
    """The equation of motion of a scene under a control that holds.

    Attributes:
        acceleration: ``a(t, q, v, direction)`` [rad/s²].
        limit: bound of dry friction, per inertia.
        longest: a time in which the velocity turns but once [s].
        names, extra: what the scene's functions take behind t, q and v; values may be set in ``extra``.
        dry: True if they take the direction of dry friction behind that.
    """

    acceleration: Callable[[float, float, float, float], float]
    limit: float
    longest: float
    names: tuple[str, ...]
    extra: list[float]
    dry: bool

    def hold(self, values: Mapping[str, float]) -> None:
        """From now on with these values, of which only those count that the functions take."""
        for i, name in enumerate(self.names):
            self.extra[i] = values.get(name, self.extra[i])


def problem_of(scene: Scene, functions: Mapping[str, Any] | None = None) -> Problem:
    """A scene without control, gusts and motor at rest; ``functions`` replace those of the same name."""
    made = program(scene, integrators.get("rk4"), ())
    found = interpreted(made.text, made.title, functions)["acceleration"]
    values, dry = scene.coefficients, next((effect.dry for effect in scene.effects if effect.dry), "")
    still = dict.fromkeys((*made.shape.remembered, "control"), 0.0)
    extra = [{**values, **still, "side": 1.0}[name] for name in made.shape.extra]

    def sliding(t: float, q: float, v: float, direction: float) -> float:
        return float(found(t, q, v, *extra, direction))

    def smooth(t: float, q: float, v: float, direction: float) -> float:
        return float(found(t, q, v, *extra))

    fastest = max(scene.omega0, *(values[effect.beat] for effect in scene.effects if effect.beat), 0.0)
    longest = math.pi / (12.0 * fastest) if fastest else math.inf
    limit = values[dry] if dry else 0.0
    return Problem(sliding if dry else smooth, limit, longest, made.shape.extra, extra, bool(dry))


def path(problem: Problem, advance: Advance, state: State, marks: Iterable[float], t: float = 0.0) -> list[State]:
    """Angle and velocity at the marks [s], none before ``t``, not decreasing."""
    rows = []
    for mark in marks:
        while t < mark:
            end = mark if mark - t <= problem.longest else t + problem.longest
            t, state = _piece(problem, advance, t, state, end)
        rows.append(state)
    return rows


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


# --- two ways to advance --------------------------------------------------------------------------------------------


def halving(attempt: Attempt, agreement: float, enough: float = 0.0) -> Advance:
    """A span is halved until both results of an attempt agree to this part of what the motion could come to in it.

    ``enough``: a difference [rad, rad/s] that is small enough whatever the motion.

    Raises PieceError where SMALLEST times were not enough.
    """

    def advance(problem: Problem, t: float, state: State, end: float, direction: float, depth: int = 0) -> State:
        (q, v), span = state, end - t
        start = problem.acceleration(t, q, v, direction)
        push = abs(span) * (abs(start) + problem.limit)  # where dry friction lets go, the torques only just cancel
        sizes = abs(q) + abs(span * v) + abs(span) * push, (abs(v) + push) * (1.0 + abs(q))
        try:
            best, other = attempt(problem, t, state, span, direction, start)
            if all(abs(x - y) <= agreement * size + enough for x, y, size in zip(best, other, sizes, strict=True)):
                return best
        except (ArithmeticError, ValueError):  # overflow, or the sine of infinity: the span is far too long
            pass
        if depth == SMALLEST:
            raise PieceError(f"The motion cannot be followed beyond {t:g} s: its torques change too fast.")
        middle = 0.5 * (t + end)
        half = advance(problem, t, state, middle, direction, depth + 1)
        return advance(problem, middle, half, end, direction, depth + 1)

    return advance


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


def extrapolated(enough: float = 0.0) -> Advance:
    """Gragg's extrapolated midpoint rule of order ``2 COLUMNS``; Gragg 1965, SIAM J. Numer. Anal. 2, 384."""
    return halving(_midpoints, 1e-14, enough)


def doubled(scene: Scene, method: Method, enough: float = 0.0) -> Advance:
    """An explicit Runge-Kutta method of order 8 or 9, one step against two halves, of which the second result counts.

    An agreement to 1e-13 leaves an error some 2**order times smaller.
    """
    made = program(scene, method, ())
    step = interpreted(made.text, made.title)["step"]

    def attempt(
        problem: Problem, t: float, state: State, span: float, direction: float, _start: float
    ) -> tuple[State, State]:
        more = (*problem.extra, direction) if problem.dry else tuple(problem.extra)
        (q, v), half = state, 0.5 * span
        middle = step(t, q, v, half, *more)
        return step(t + half, *middle, half, *more), step(t, q, v, span, *more)

    return halving(attempt, 1e-13, enough)
