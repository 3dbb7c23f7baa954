"""Predicted errors of methods in hard cases, by name, from 40-digit arithmetic that uses no code of the methods.

``predictions.json`` holds for each motion and method the number of steps per mark and the error that the method's
formula leaves in exact arithmetic. ``python tests/support/forty_digits.py`` computes it. A run's error may differ from
the predicted one by the share OFF and by rounding, and no more: a larger error is that of a wrong step, a smaller one
that of another method.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators import Method
from integrators.method import NEEDS
from pendulum_env.engine.machine import ANGLE, INDEX, TURNS, TWO_PI, VELOCITY, Machine, offers
from pendulum_env.engine.rollout import Rollout
from pendulum_env.engine.starts import ENOUGH
from pendulum_env.hard_cases.case import (
    ACCURATE,
    DIVERGED,
    STABLE,
    WRONG,
    Bound,
    Finding,
    Try,
    also,
    ran,
    sooner,
    stopped,
)
from pendulum_env.physics.scene import Scene
from pendulum_env.truth.steps import order_bound, rounding_factor

Array = NDArray[np.float64]
FILE = Path(__file__).with_name("predictions.json")
OFF = 0.02
"""Share of the predicted error by which an error may differ from it, besides rounding."""
TOO_LARGE = 100.0
"""Predicted error, relative to the motion, beyond which a run grows and may stop early."""
SMALL = 0.3
"""Largest allowed error, relative to the motion, of a run that counts as accurate."""
ULPS = 4.0
"""Rounding error allowed per step, in ulps, before it is multiplied by the growth of errors."""


@dataclass(frozen=True)
class Motion:
    """A motion whose error can be predicted, in units of time in which omega0 is 1.

    Attributes:
        equation: name of the equation of motion in ``tests/support/forty_digits.py``.
        angle, velocity: start [rad, omega0].
        time: duration, times omega0.
        marks: number of equal parts after which the motion is compared.
        growth: factor by which the motion amplifies rounding, relative to its size.
        from_top: True if errors are relative to the tilt from the top at the end, else to ``largest``.
        largest: size of the motion [rad].
        pace: largest rate of the motion; errors of the velocity are divided by it.
        goal: error at which steps are short enough.
        fewest, most: numbers of steps per mark to choose from.
        lacks: needs of methods that the motion does not meet, such as "velocity_free" under drag.
        torques: constant torque until each mark, in units of m g L, where methods start anew; () for none.
        back: True if the velocity is reversed at the middle.
        angles: True if only angles are compared.
        sensitive: True if coarse steps of methods with a history would amplify rounding.
    """

    equation: str
    angle: float
    velocity: float
    time: float
    marks: int = 1
    growth: float = 1.0
    from_top: bool = False
    largest: float = 1.0
    pace: float = 1.0
    goal: float = 1e-6
    fewest: int = 1
    most: int = 512
    lacks: frozenset[str] = frozenset()
    torques: tuple[float, ...] = ()
    back: bool = False
    angles: bool = False
    sensitive: bool = False

    def size(self, end: float) -> float:
        """Return the angle [rad] to which errors are relative, with the exact angle at the end."""
        return abs(math.pi - end) if self.from_top else self.largest

    def least(self, method: Method) -> int:
        """Return the fewest steps per mark of a method; a multistep method needs some times its history.

        It needs them in the whole motion or, where torques change or the motion is ``sensitive``, for each mark.
        """
        each = bool(self.torques) or self.sensitive
        past = ENOUGH * method.past if each else math.ceil(ENOUGH * method.past / self.marks)
        return self.fewest if self.most == 1 else max(self.fewest, past)

    def fits(self, method: Method) -> bool:
        """Return True if the motion is predicted for a method: it meets its needs, and the error is not zero."""
        return not method.exact and not method.needs & self.lacks


@cache
def _stored() -> dict[str, dict[str, tuple[int, float]]]:
    """Return the file of predictions."""
    values: dict[str, dict[str, tuple[int, float]]] = json.loads(FILE.read_text(encoding="utf-8"))
    return values


def steps_and_error(name: str, motion: Motion, method: Method) -> tuple[int, float]:
    """Return the steps per mark of a method in a motion of this name, and its predicted error.

    A method that is not in the file, such as one of the user's, takes the most steps, and its order is the bound.
    """
    if method.exact:
        return motion.fewest, 0.0
    if _known(name, method):
        count, error = _stored()[name][method.name]
        return int(count), float(error)
    z = motion.time / motion.marks / motion.most * motion.pace
    return motion.most, order_bound(method, z, motion.time * motion.pace * motion.growth)


def _known(name: str, method: Method) -> bool:
    """Return True if the file has a prediction for a method in a motion of this name."""
    return method.name in _stored().get(name, {})


def foretold(name: str, method: Method) -> bool:
    """Return True if the file has a prediction for a method in a motion of this name, and not one of growth."""
    return _known(name, method) and _stored()[name][method.name][1] < TOO_LARGE


def rounding(name: str, motion: Motion, method: Method) -> float:
    """Return the rounding error allowed for a method in a motion, relative to the motion's size."""
    count, _ = steps_and_error(name, motion, method)
    return ULPS * rounding_factor(method) * 2.0**-52 * (count * motion.marks + motion.time) * motion.growth


def allowed(name: str, motion: Motion, method: Method) -> float:
    """Return the largest error that is allowed for a method in a motion: the predicted one, or that of its order."""
    _, error = steps_and_error(name, motion, method)
    off = OFF if _known(name, method) else 0.0
    return (1.0 + off) * error + rounding(name, motion, method)


def expected(name: str, motion: Motion) -> Callable[[Method], frozenset[str]]:
    """Return the rule of a motion: ACCURATE where the allowed error is small, else STABLE.

    A run whose allowed error is larger than the motion may diverge, too.
    """

    def may(method: Method) -> frozenset[str]:
        most = allowed(name, motion, method)
        return frozenset({ACCURATE} if most <= SMALL else {STABLE} if most <= 1.0 else {STABLE, DIVERGED})

    return may


def held(name: str, motion: Motion, method: Method, error: Any, grain: float = 0.0) -> Finding:
    """Judge errors, relative to the motion's size: WRONG if the largest one is not the predicted error.

    A run whose error is as predicted is ACCURATE if that is small, else STABLE. ``grain`` is a rounding error that is
    allowed beside the usual one.
    """
    most, largest = allowed(name, motion, method) + grain, float(np.max(np.abs(error)))
    _, implied = steps_and_error(name, motion, method)
    known = _known(name, method)
    # A predicted error larger than the motion, as of a method that grows, is itself what the tolerance bounds.
    off = (Bound("the predicted error, relative to the motion", most - implied, max(1.0, implied)) if known
           else Bound("the motion, by the order", most, 1.0),)
    if not largest <= most:
        return Finding(WRONG, largest, most, "its error exceeds that of its formula in exact arithmetic", bounds=off)
    if known and largest < (1.0 - OFF) * implied - rounding(name, motion, method) - grain:
        why = "its error is smaller than that of its formula in exact arithmetic"
        return Finding(WRONG, largest, implied, why, bounds=off)
    return Finding(ACCURATE if most <= SMALL else STABLE, largest, most, bounds=off)


def ran_motion(scene: Scene, name: str, motion: Motion, method: Method, **options: Any) -> Rollout:
    """Run a method in a motion of a scene and return the run at its marks."""
    count, _ = steps_and_error(name, motion, method)
    h = motion.time / motion.marks / count / scene.omega0
    return ran(scene, method, dt=h, steps=count * motion.marks, every=count, angle=motion.angle,
               velocity=motion.velocity * scene.omega0, **options)


def unmet(scene: Scene) -> frozenset[str]:
    """Return the needs of methods that a scene does not meet, for ``Motion.lacks``."""
    return frozenset(NEEDS) - offers(scene)


def driven(scene: Scene, name: str, motion: Motion, method: Method) -> tuple[Array, Array] | Finding:
    """Run a method under the torques of a motion; return angle [rad] and velocity [rad/s] at the start and the marks.

    A run that stops early is returned as a Finding.
    """
    count, _ = steps_and_error(name, motion, method)
    h = motion.time / motion.marks / count / scene.omega0
    machine = Machine(scene, method, backend=sooner(method, count * motion.marks))
    full = next(effect.max_torque for effect in scene.effects if effect.controlled)  # type: ignore[attr-defined]
    share = scene.gravity * scene.weight_moment / full
    state = machine.state(motion.angle, motion.velocity * scene.omega0)
    rows = [(motion.angle, motion.velocity * scene.omega0)]
    for torque in motion.torques:
        if machine.advance(state, torque * share, h, count):
            return Finding(DIVERGED, stop_time=float(state[INDEX]) * h)
        rows.append((float(state[ANGLE]) + TWO_PI * float(state[TURNS]), float(state[VELOCITY])))
    angle, velocity = np.array(rows).T
    return angle, velocity


def formula_first(formula: Try, then: Try) -> Try:
    """Return a function that judges a method by ``then``, if ``formula`` does not judge it as wrong or diverged.

    ``formula`` tests a motion whose error is predicted; ``then`` a property, such as a growth or an angle at rest.
    """

    def attempt(method: Method) -> Finding:
        first = formula(method)
        return first if first.outcome in (WRONG, DIVERGED) else also(then(method), *first.bounds)

    return attempt


def followed(
    scene: Scene, name: str, motion: Motion, truth: Callable[[Any], Sequence[Any]], seed: int | None = None,
) -> Callable[[Method], Finding]:
    """Return a function that judges a method in a motion against ``truth``.

    That is a function of the times of the marks [s], zero first, that returns angles and velocities [rad/s] there.
    With a ``seed`` of gusts the wind changes at each mark.
    """

    def attempt(method: Method) -> Finding:
        if motion.torques:
            found = driven(scene, name, motion, method)
            if isinstance(found, Finding):
                return found
            angle, velocity = found
            time = np.arange(motion.marks + 1) * (motion.time / motion.marks / scene.omega0)
        else:
            count, _ = steps_and_error(name, motion, method)
            options = {} if seed is None else {"seed": seed, "substeps": count}
            run = ran_motion(scene, name, motion, method, **options)
            ended = stopped(run)
            if ended is not None:
                return ended
            time, angle, velocity = run.time, run.angle, run.velocity
        true = truth(time)
        error = np.abs(angle - true[0])
        if not motion.angles:
            error = np.maximum(error, np.abs(velocity - true[1]) / scene.omega0 / motion.pace)
        return held(name, motion, method, error / motion.size(float(true[0][-1])))

    return attempt
