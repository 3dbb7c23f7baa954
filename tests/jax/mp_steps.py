"""Steps of a generated program in 40-digit arithmetic, and differences of their results: the truth for derivatives.

The program is interpreted by Python on numbers of mpmath, with mpmath's elementary functions, so that nothing of JAX
has a part in it. Derivatives are central differences of 1e-12, exact to some 20 digits. The program's coefficients are
computed by the scene in floats; their derivatives by a parameter come from differences, extrapolated twice.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from mpmath import mp, mpf

from pendulum_env import Scene
from pendulum_env.engine.generate import program
from pendulum_env.engine.machine import numbers_of
from pendulum_env.engine.problem import program_parts
from pendulum_env.physics.units import SceneError

mp.dps = 40
DELTA = mpf(10) ** -12
ROUNDING = 5e-13
"""Error of :func:`slopes` by rounding, over the number and the parameter: some ulps over a step of 0.0025."""
ELEMENTARY = {"exp": mp.exp, "log": mp.log, "sin": mp.sin, "cos": mp.cos, "sqrt": mp.sqrt, "tanh": mp.tanh,
              "power": lambda x, y: x**y if x else mpf(0)}


def namespace(text: str) -> dict[str, Any]:
    """Return the functions of a program on numbers of 40 digits."""
    names: dict[str, Any] = {"inline": lambda function: function, "entry": lambda function: function}
    exec(text, names)
    names |= ELEMENTARY
    return names


class Steps:
    """Steps of a scene with a method as a function of (angle, velocity, step, controls, numbers)."""

    def __init__(self, scene: Scene, method: Any, count: int) -> None:
        source = program(scene, method, ("energy",))
        self.shape, self.names, self.count = source.shape, namespace(source.text), count

    def __call__(self, angle: Any, velocity: Any, h: Any, controls: Sequence[Any], numbers: Mapping[str, Any]) -> Any:
        """Return angle, velocity and the integrals of work and heat, per inertia, after all steps."""
        shape, names = self.shape, self.names
        given = {name: numbers[name] for name in shape.parameters}
        q, v, sums = angle, velocity, [mpf(0)] * len(shape.quadratures)
        memory: tuple[Any, ...] = ()
        last, held = None, dict.fromkeys(shape.remembered, mpf(0))
        for i in range(self.count):
            t, control = i * h, controls[i]
            if held:
                first = mpf(1 if i == 0 else 0)
                after = names["remember"](*held.values(), control, first, h, *given.values())
                held = dict(zip(held, after, strict=True))
            known = {**given, **held, "side": mpf(1), "control": control}
            extra = [known[name] for name in shape.extra]
            if shape.memory and (held or control is not last):
                memory = names["begin"](t, q, v, h, *extra)
                memory = memory if isinstance(memory, tuple) else (memory,)
                last = control
            q, v, *rest = names["step"](t, q, v, *memory, h, *extra)
            memory = tuple(rest[: len(shape.memory)])
            sums = [one + more for one, more in zip(sums, rest[len(shape.memory):], strict=True)]
        return [q, v, *sums]


def derivative(function: Callable[[Any], Sequence[Any]], at: Any) -> list[Any]:
    """Return the derivatives of some results by a number."""
    after, before = function(at + DELTA), function(at - DELTA)
    return [(one - other) / (2 * DELTA) for one, other in zip(after, before, strict=True)]


def slopes(scene: Scene, parameter: str, value: float) -> dict[str, tuple[float, float]] | None:
    """Return the derivatives of a scene's numbers by one of its parameters, and their errors by rounding.

    None where only one side of the parameter's value exists. Central differences of four steps, extrapolated
    (Richardson).
    """
    base = numbers_of(scene, False)
    tables = []
    for k in range(4):
        d = 0.02 * value / 2.0**k
        try:
            sides = [scene.replace(**{parameter: value + sign * d}) for sign in (1.0, -1.0)]
        except SceneError:
            return None
        if any(program_parts(side) != program_parts(scene) for side in sides):
            return None
        high, low = (numbers_of(side, False) for side in sides)
        tables.append(np.array([(high[name] - low[name]) / (2.0 * d) for name in base]))
    for power in (4.0, 16.0, 64.0):
        tables = [(power * fine - rough) / (power - 1.0) for rough, fine in pairwise(tables)]
    return {name: (float(slope), ROUNDING * abs(base[name] / value))
            for name, slope in zip(base, tables[0], strict=True)}
