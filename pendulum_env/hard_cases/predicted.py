"""Motions in hard cases, and predicted errors of methods in them, from 40 digits that use no code of the methods.

``true_motions.json`` holds the exact angles and velocities at the marks of each motion, and ``predictions.json`` for
each motion and method the number of steps per mark and the error that the method's formula leaves in exact arithmetic.
``python tests/support/forty_digits.py`` computes both. A run's error may differ from
the predicted one by the share OFF and by rounding, and no more: a larger error is that of a wrong step, a smaller one
that of another method.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from integrators import Method
from pendulum_env.physics.scene import Scene
from pendulum_env.truth.answer import Array
from pendulum_env.truth.bounds import UNIT, order_bound, rounding_factor

FILE, TRUTHS = (Path(__file__).with_name(name) for name in ("predictions.json", "true_motions.json"))
OFF = 0.02
"""Share of the predicted error by which an error may differ from it, besides rounding."""
TOO_LARGE = 100.0
"""Predicted error, relative to the motion, beyond which a run grows and may stop early."""
ULPS = 4.0
"""Rounding error allowed per step, in ulps, before it is multiplied by the growth of errors."""


@dataclass(frozen=True)
class Motion:
    """A motion whose error can be predicted, in units of time in which omega0 is 1.

    Attributes:
        name: name in ``predictions.json``.
        scene: the simulated scene.
        equation: name of the equation of motion in ``tests/support/forty_digits.py``.
        angle, velocity: start [rad, omega0].
        time: duration, times omega0.
        marks: number of equal parts after which the motion is compared.
        growth: factor by which the motion amplifies rounding, relative to its size.
        from_top: True if errors are relative to the tilt from the top at the end, else to ``largest``.
        largest: size of the motion [rad].
        pace: largest rate of the motion; errors of the velocity are divided by it.
        goal: error at which steps are short enough.
        most: largest number of steps per mark to choose from.
        lacks: needs of methods that the motion does not meet, besides those that the scene does not meet.
        torques: constant torque until each mark, in units of m g L, where methods start anew; () for none.
        angles: True if only angles are compared.
        sensitive: True if coarse steps of methods with a history would amplify rounding.
        explicit: True if steps are so long that the equations of implicit methods have several solutions.
    """

    name: str
    scene: Scene
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
    most: int = 512
    lacks: frozenset[str] = frozenset()
    torques: tuple[float, ...] = ()
    angles: bool = False
    sensitive: bool = False
    explicit: bool = False

    def true(self) -> tuple[Array, Array]:
        """Return the exact angle [rad] and velocity [rad/s] at the start and at the marks."""
        angle, velocity = stored(TRUTHS)[self.name]
        return np.array([self.angle, *angle]), self.scene.omega0 * np.array([self.velocity, *velocity])

    def known(self, method: Method) -> bool:
        """Return True if the file has a prediction for a method."""
        return method.name in stored(FILE).get(self.name, {})

    def foretells(self, method: Method) -> bool:
        """Return True if the file has a prediction for a method, and not one of growth."""
        return self.known(method) and self.steps_and_error(method)[1] < TOO_LARGE

    def steps_and_error(self, method: Method) -> tuple[int, float]:
        """Return the steps per mark of a method, and its predicted error.

        A method that is not in the file, such as one of the user's, takes the most steps, and its order is the bound.
        """
        if method.exact:
            return 1, 0.0
        if self.known(method):
            count, error = stored(FILE)[self.name][method.name]
            return int(count), float(error)
        z = self.time / self.marks / self.most * self.pace
        return self.most, order_bound(method, z, self.time * self.pace * self.growth)

    def rounding(self, method: Method) -> float:
        """Return the rounding error allowed for a method, relative to the motion's size."""
        count, _ = self.steps_and_error(method)
        return ULPS * rounding_factor(method) * UNIT * (count * self.marks + self.time) * self.growth

    def allowed(self, method: Method) -> float:
        """Return the largest error that is allowed for a method: the predicted one, or that of its order."""
        _, error = self.steps_and_error(method)
        return (1.0 + (OFF if self.known(method) else 0.0)) * error + self.rounding(method)


@cache
def stored(file: Path) -> dict[str, Any]:
    """Return what FILE or TRUTHS holds by the name of the motion.

    Of TRUTHS these are the exact angles [rad] and velocities [omega0] at the marks.
    """
    values: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return values
