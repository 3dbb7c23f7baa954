"""What a motion is after very many periods: the closed form, or two compiled solutions of high order."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

import integrators
from integrators import Method
from pendulum_env.engine.generate import program
from pendulum_env.engine.kernels import Backend
from pendulum_env.engine.machine import ANGLE, INDEX, TURNS, TWO_PI, UNSEEN, VELOCITY, Machine, fitting, offers
from pendulum_env.engine.problem import moving
from pendulum_env.engine.shape import STOP_REASONS
from pendulum_env.engine.source import arguments
from pendulum_env.physics.effects.coulomb_friction import CoulombFriction
from pendulum_env.physics.scene import Scene
from pendulum_env.truth.answer import Truth
from pendulum_env.truth.reference import ROUNDING, StudyError, closed_form

Array = NDArray[np.float64]
Tell = Callable[[float, str], None]

SERIES = "taylor20"
"""What a motion is followed with where the scene allows; else the method of the highest order."""
STEPS = 24
"""Steps of it in a period of the fastest that happens in the scene."""
FINER = 4
"""The other method takes so many steps to each of these."""
DEAD = 1e-12
"""The motion has died out where its speed is this part of what it was at first."""
AT_ONCE = 2**20
"""Steps between two looks at the keyboard."""


class LongTruth(Protocol):
    """A motion, known near some times.

    Attributes:
        how: where it comes from.
        died: how many of the marks there are until it has died out, that one included; all if it has not.
    """

    how: str
    died: int

    def at(self, times: Array) -> Truth:
        """The motion at increasing times [s], with an error for each."""
        ...


def long_truth(
    scene: Scene, angle: float, velocity: float, marks: Array, reach: float, backend: Backend, tell: Tell
) -> LongTruth:
    """The motion from a start, to be asked for times up to ``reach`` [s] before each of ``marks`` [s].

    Where there is no closed form: a Taylor series of order 20 and the method of the highest order otherwise, both with
    compensated sums; their largest difference in the period before a time is the truth's own error. Where a drag has a
    kink at rest, dry friction of no size is added, so that their steps are cut at every zero of the velocity.

    Raises StudyError for a scene with gusts and a motion that does not reach the last mark.
    """
    if closed_form(scene, angle, velocity, np.zeros(1)) is not None:
        return _Closed(scene, angle, velocity, marks)
    return Pair(scene, angle, velocity, marks, reach, backend, tell)


def followers(scene: Scene) -> tuple[Method, Method]:
    """The two explicit one-step methods of the highest order that fit a scene, those with backward flows left out."""
    series = integrators.get(SERIES)
    kept = [method for method in fitting(scene).values() if method.family != series.family
            and not (method.implicit or method.memory or "split" in method.needs or math.isinf(method.order))]
    kept.sort(key=lambda method: -method.order)
    first, second = [*([series] if series.needs <= offers(scene) else []), *kept][:2]
    return first, second


def cut_at_turns(scene: Scene) -> Scene:
    """The scene with dry friction of no size, where a drag that depends on |velocity| has a kink at rest."""
    kinked = any(effect.torque and "speed" in arguments(effect.torque) for effect in scene.effects)
    if not kinked or moving(scene.effects) or any(effect.dry for effect in scene.effects):
        return scene
    return scene.with_effects([*scene.effects, CoulombFriction(friction_torque=0.0)])


class _Closed:
    """A closed form; its error is the rounding of the phase."""

    def __init__(self, scene: Scene, angle: float, velocity: float, marks: Array) -> None:
        self._scene, self._start = scene, (angle, velocity)
        found = self._form(np.linspace(0.0, marks[0], STEPS))
        self.how, first = found.how, float(np.max(np.abs(found.velocity)))
        self.died = len(marks)
        for i, mark in enumerate(marks):
            if np.max(np.abs(self._form(np.linspace(mark - marks[0], mark, STEPS)).velocity)) <= DEAD * first:
                self.died = i + 1
                break

    def _form(self, times: Array) -> Truth:
        found = closed_form(self._scene, *self._start, times)
        assert found is not None
        return found

    def at(self, times: Array) -> Truth:
        return replace(self._form(times), error=ROUNDING * (4.0 + self._scene.omega0 * times))


class Pair:
    """Two solutions, of which the first is kept at every step before a mark, and goes on from there."""

    def __init__(
        self, scene: Scene, angle: float, velocity: float, marks: Array, reach: float, backend: Backend, tell: Tell
    ) -> None:
        if program(scene, integrators.get("rk4"), ()).shape.drawn:
            raise StudyError(f"The scene '{scene.name}' has gusts, decided by a seed: there is no one motion.")
        scene, values = cut_at_turns(scene), scene.coefficients
        fastest = max(scene.omega0, *(abs(values[effect.beat]) for effect in scene.effects if effect.beat), 0.0)
        self._h = TWO_PI / fastest / STEPS
        main, check = followers(scene)
        self._machine = Machine(scene, main, (), backend, compensated=True)
        other = Machine(scene, check, (), backend, compensated=True)
        spans = self._spans(marks, reach)
        whole = (1.0 + FINER) * float(spans[-1][1])

        def told(steps: float) -> None:
            tell(steps / whole, "what the motion is")

        self._rows = _followed(self._machine, angle, velocity, self._h, 1, spans, told)
        self._steps = self._rows[:, INDEX]
        last = float(self._steps[-1])
        spans = [span for span in spans if span[1] <= last]
        rows = _followed(other, angle, velocity, self._h / FINER, FINER, spans, lambda n: told(last + n), -1.0)
        self.died = sum(math.ceil(mark / self._h) <= last for mark in marks)
        apart = np.abs(_angle(self._rows) - _angle(rows))
        padded = np.concatenate([np.full(STEPS - 1, apart[0]), apart])
        self._own = sliding_window_view(padded, STEPS).max(axis=-1) + ROUNDING * (4.0 + self._steps * self._h * fastest)
        self.how = f"{main.name} with {STEPS} steps a period, checked by {check.name} with {STEPS * FINER}"

    def _spans(self, marks: Array, reach: float) -> list[tuple[int, int]]:
        """Steps between which rows are kept, in order and without overlaps."""
        found: list[tuple[int, int]] = []
        for mark in marks:
            low, high = max(0, math.floor((mark - reach) / self._h) - 1), math.ceil(mark / self._h)
            low = max(low, found[-1][1]) if found else low
            found += [(low, high)] if high > low else []
        return found

    def at(self, times: Array) -> Truth:
        places = np.searchsorted(self._steps * self._h, times, side="right") - 1
        rows = np.array([self._on(self._rows[i], float(t)) for i, t in zip(places, times, strict=True)])
        own = self._own[np.minimum(places + 1, len(self._own) - 1)]
        return Truth(times, _angle(rows), rows[:, VELOCITY], own, self.how)

    def _on(self, row: Array, time: float) -> Array:
        """The motion at a time less than a step after a row."""
        machine, h = self._machine, time - row[INDEX] * self._h
        if not h > 0.0:
            return row
        state = machine.state(0.0, 0.0)
        state[: machine.width] = row if machine.compiled else row.tolist()
        state[INDEX] = row[INDEX] * self._h / h
        machine.advance(state, 0.0, h, 1)
        return np.asarray(state[: machine.width], dtype=float)


def _angle(rows: Array) -> Array:
    return np.asarray(rows[:, ANGLE] + TWO_PI * rows[:, TURNS])


def _followed(
    machine: Machine, angle: float, velocity: float, h: float, every: int, spans: list[tuple[int, int]],
    told: Callable[[float], None], dead: float = DEAD,
) -> Array:
    """Rows of a run between these multiples of ``every`` steps, their ends included, until the motion has died out."""
    state, first = machine.state(angle, velocity), 0.0
    found: list[Array] = []
    for (_, before), (low, high) in pairwise([(0, 0), *spans]):
        on(machine, state, h, (low - before) * every, told)
        out = np.empty((high - low + 1, machine.width))
        code = machine.run(state, machine.parameters, 0.0, h, high - low, every, math.inf, out, UNSEEN)
        _check(machine, code, state, h)
        found.append(out if not found or low > before else out[1:])
        speed = float(np.max(np.abs(out[:, VELOCITY])))
        first = first or speed
        if speed <= dead * first:
            break
    return np.concatenate(found)


def on(machine: Machine, state: object, h: float, steps: int, told: Callable[[float], None]) -> int:
    """So many steps more, told now and then how many were made in all; why they ended, or 0."""
    code = 0
    while steps > 0 and not code:
        code = machine.advance(state, 0.0, h, min(steps, AT_ONCE))
        steps -= AT_ONCE
        told(float(state[INDEX]))  # type: ignore[index]
    return code


def _check(machine: Machine, code: int, state: object, h: float) -> None:
    if code:
        at = float(state[INDEX]) * h  # type: ignore[index]
        raise StudyError(f"The motion of '{machine.scene.name}' ends at {at:.4g} s: {STOP_REASONS[code]}.")
