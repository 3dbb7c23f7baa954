"""Reference solutions after very many periods: the closed form, or two compiled solutions of high order."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

import integrators
from integrators import Method
from pendulum_env.engine.kernels import Backend
from pendulum_env.engine.machine import ANGLE, INDEX, TURNS, TWO_PI, UNSEEN, VELOCITY, Machine, fitting, offers
from pendulum_env.engine.problem import moving
from pendulum_env.engine.reading import arguments
from pendulum_env.engine.shape import STOP_REASONS
from pendulum_env.physics.effects.coulomb_friction import CoulombFriction
from pendulum_env.physics.scene import Scene
from pendulum_env.truth.answer import Array, Truth
from pendulum_env.truth.reference import ROUNDING, StudyError, closed_form
from pendulum_env.truth.reference import refuse_gusts as refuse_gusts

Tell = Callable[[float, str], None]

SERIES = "taylor20"
"""Method of the reference solution if the scene allows it; else the explicit method of the highest order."""
STEPS = 24
"""Steps of the reference solution per period of the fastest oscillation or drive in the scene."""
FINER = 4
"""Steps of the checking method for each step of the reference solution."""
DEAD = 1e-12
"""The motion counts as decayed when its speed is this fraction of the initial one."""
AT_ONCE = 2**20
"""Number of steps between two progress reports, at which the user can interrupt."""


def long_truth(
    scene: Scene, angle: float, velocity: float, marks: Array, reach: float, backend: Backend, tell: Tell
) -> LongTruth:
    """Return a reference solution for all times from ``reach`` [s] before each of ``marks`` [s] up to the mark.

    The start is ``angle`` [rad] and ``velocity`` [rad/s]; ``tell`` receives the progress. If there is no closed form,
    two solutions with compensated sums are computed: a Taylor series of order 20 and the other method of the highest
    order. Their largest difference in the period before a time is the estimated error. If the drag has a kink at rest,
    dry friction of strength zero is added, because the engine then ends a step at every zero of the velocity.

    Raises StudyError for a scene with gusts, and for a motion that does not reach the last mark.
    """
    if closed_form(scene, angle, velocity, np.zeros(1)) is not None:
        return _Closed(scene, angle, velocity, marks)
    return Pair(scene, angle, velocity, marks, reach, backend, tell)


def followers(scene: Scene) -> tuple[Method, Method]:
    """Return the two explicit one-step methods of the highest order that fit a scene, to compute a reference solution.

    The first is a Taylor series if it fits. Splittings are left out.
    """
    series = integrators.get(SERIES)
    candidates = [method for method in fitting(scene).values() if method.family != series.family
            and not (method.implicit or method.memory or "split" in method.needs or math.isinf(method.order))]
    candidates.sort(key=lambda method: -method.order)
    first, second = [*([series] if series.needs <= offers(scene) else []), *candidates][:2]
    return first, second


def cut_at_turns(scene: Scene) -> Scene:
    """Add dry friction of strength zero to a scene with quadratic drag.

    The engine then ends a step at every zero of the velocity, where quadratic drag has a kink.
    """
    kinked = any(effect.torque and "speed" in arguments(effect.torque) for effect in scene.effects)
    if not kinked or moving(scene.effects) or any(effect.dry for effect in scene.effects):
        return scene
    return scene.with_effects([*scene.effects, CoulombFriction(friction_torque=0.0)])


class _Closed:
    """Reference solution of a long run from a closed form, whose error is the rounding of the phase."""

    def __init__(self, scene: Scene, angle: float, velocity: float, marks: Array) -> None:
        self._scene, self._start = scene, (angle, velocity)
        solution = self._form(np.linspace(0.0, marks[0], STEPS))
        self.how, first = solution.how, float(np.max(np.abs(solution.velocity)))
        self.died = len(marks)
        for i, mark in enumerate(marks):
            if np.max(np.abs(self._form(np.linspace(mark - marks[0], mark, STEPS)).velocity)) <= DEAD * first:
                self.died = i + 1
                break

    def _form(self, times: Array) -> Truth:
        """Return the closed form of the scene's motion at these times [s]."""
        solution = closed_form(self._scene, *self._start, times)
        assert solution is not None
        return solution

    def at(self, times: Array) -> Truth:
        """Return the reference solution at increasing times [s], with an error for each time."""
        return replace(self._form(times), error=ROUNDING * (4.0 + self._scene.omega0 * times))


class Pair:
    """Reference solution computed with two methods, near given times (marks).

    The first method's states are stored at every step near a mark; the second method checks them.
    """

    def __init__(
        self, scene: Scene, angle: float, velocity: float, marks: Array, reach: float, backend: Backend, tell: Tell
    ) -> None:
        refuse_gusts(scene)
        scene, values = cut_at_turns(scene), scene.coefficients
        fastest = max(scene.omega0, *(abs(values[effect.beat]) for effect in scene.effects if effect.beat), 0.0)
        self._h = TWO_PI / fastest / STEPS
        main, check = followers(scene)
        self._machine = Machine(scene, main, (), backend, compensated=True)
        other = Machine(scene, check, (), backend, compensated=True)
        spans = self._spans(marks, reach)
        all_steps = (1.0 + FINER) * float(spans[-1][1])

        def report(steps: float) -> None:
            tell(steps / all_steps, "computing the reference solution")

        self._rows = _followed(self._machine, angle, velocity, self._h, 1, spans, report)
        self._steps = self._rows[:, INDEX]
        last = float(self._steps[-1])
        spans = [span for span in spans if span[1] <= last]
        rows = _followed(other, angle, velocity, self._h / FINER, FINER, spans, lambda n: report(last + n), -1.0)
        self.died = sum(math.ceil(mark / self._h) <= last for mark in marks)
        difference = np.abs(_angle(self._rows) - _angle(rows))
        padded = np.concatenate([np.full(STEPS - 1, difference[0]), difference])
        self._own = sliding_window_view(padded, STEPS).max(axis=-1) + ROUNDING * (4.0 + self._steps * self._h * fastest)
        self.how = f"{main.name} with {STEPS} steps a period, checked by {check.name} with {STEPS * FINER}"

    def _spans(self, marks: Array, reach: float) -> list[tuple[int, int]]:
        """Return first and last step of every interval whose states are stored, in order and without overlap.

        An interval reaches from ``reach`` [s] before a mark to the mark.
        """
        spans: list[tuple[int, int]] = []
        for mark in marks:
            low, high = max(0, math.floor((mark - reach) / self._h) - 1), math.ceil(mark / self._h)
            low = max(low, spans[-1][1]) if spans else low
            spans += [(low, high)] if high > low else []
        return spans

    def at(self, times: Array) -> Truth:
        """Return the reference solution at increasing times [s], with an error for each time."""
        places = np.searchsorted(self._steps * self._h, times, side="right") - 1
        rows = np.array([self._on(self._rows[i], float(t)) for i, t in zip(places, times, strict=True)])
        own = self._own[np.minimum(places + 1, len(self._own) - 1)]
        return Truth(times, _angle(rows), rows[:, VELOCITY], own, self.how)

    def _on(self, row: Array, time: float) -> Array:
        """Return the state at a time [s], by a fraction of a step from the last stored state (``row``) before it."""
        machine, h = self._machine, time - row[INDEX] * self._h
        if not h > 0.0:
            return row
        state = machine.state(0.0, 0.0)
        state[: machine.width] = row if machine.compiled else row.tolist()
        state[INDEX] = row[INDEX] * self._h / h
        machine.advance(state, 0.0, h, 1)
        return np.asarray(state[: machine.width], dtype=float)


LongTruth = _Closed | Pair
"""Reference solution of a long run, known only near some given times (marks).

Its ``how`` says how it was computed, ``died`` is the number of marks up to and including the first one at which the
motion has decayed (all if it never has), and ``at(times)`` returns the solution at increasing times [s].
"""


def _angle(rows: Array) -> Array:
    """Return the total angle [rad], with whole turns, of stored states (one row per state)."""
    return np.asarray(rows[:, ANGLE] + TWO_PI * rows[:, TURNS])


def _followed(
    machine: Machine, angle: float, velocity: float, h: float, every: int, spans: list[tuple[int, int]],
    report: Callable[[float], None], dead: float = DEAD,
) -> Array:
    """Run a machine (compiled program of a scene with a method) and return its states in some intervals.

    One state is stored per ``every`` steps, as a row of an array. ``spans`` are pairs of first and last row number of
    the intervals. The run ends early when the motion has decayed.
    """
    state, first = machine.state(angle, velocity), 0.0
    blocks: list[Array] = []
    for (_, before), (low, high) in pairwise([(0, 0), *spans]):
        on(machine, state, h, (low - before) * every, report)
        out = np.empty((high - low + 1, machine.width))
        code = machine.run(state, machine.parameters, 0.0, h, high - low, every, math.inf, out, UNSEEN)
        if code:
            at = float(state[INDEX]) * h
            raise StudyError(f"The motion of '{machine.scene.name}' ends at {at:.4g} s: {STOP_REASONS[code]}.")
        blocks.append(out if not blocks or low > before else out[1:])
        speed = float(np.max(np.abs(out[:, VELOCITY])))
        first = first or speed
        if speed <= dead * first:
            break
    return np.concatenate(blocks)


def on(machine: Machine, state: object, h: float, steps: int, report: Callable[[float], None]) -> int:
    """Advance a machine (compiled program of a scene with a method) by ``steps`` steps.

    ``report`` is called with the number of steps taken so far. Returns the stop code, 0 if the run did not stop early.
    """
    code = 0
    while steps > 0 and not code:
        code = machine.advance(state, 0.0, h, min(steps, AT_ONCE))
        steps -= AT_ONCE
        report(float(state[INDEX]))  # type: ignore[index]
    return code
