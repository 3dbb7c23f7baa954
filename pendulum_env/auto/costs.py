"""What a step costs, in steps of rk4: evaluations times what one costs in a method's class, and what is beside them.

The shipped table decides, so that every machine chooses the same; :func:`measure` makes a table anew.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping

from integrators import Method
from pendulum_env.engine.machine import Machine, fitting
from pendulum_env.engine.spec import RunSpec
from pendulum_env.engine.starts import restarting
from pendulum_env.physics.presets import SCENES
from pendulum_env.physics.scene import Scene

Table = Mapping[str, tuple[float, float]]
"""Class -> (cost of a step beside its evaluations, cost of an evaluation), in steps of rk4."""

UNIT, EVALUATION = "rk4", "RungeKutta"
"""The unit of cost, and the class whose evaluations stand for those with which a memory begins."""
MEASURED_IN = ("lab", "vacuum", "textbook")
"""A class is measured in the first of these that has it, against rk4 in the same scene."""
ROUNDS, STEPS, H = 30, 1000, 0.02
"""Timings of which the shortest counts, steps in each, and their length [s]."""

SHIPPED: Table = {
    "RungeKutta": (0.0, 0.265),
    "RungeKutta, implicit": (0.7, 1.75),
    "DiscreteGradient, implicit": (0.0, 4.08),
    "Splitting": (0.0, 0.415),
    "Splitting, drag flow": (0.0, 0.83),
    "ForceGradient": (0.0, 0.291),
    "Nystrom": (0.0, 0.42),
    "Adams": (0.04, 0.305),
    "BackwardDifference, implicit": (0.0, 2.36),
    "SecondOrder": (0.0, 0.6),
    "SecondOrder, implicit": (0.0, 2.27),
    "GeneralizedAlpha, implicit": (0.0, 2.25),
    "Exact": (0.0, 0.292),
    "Exact, periodic": (0.0, 25.0),
    "Taylor": (0.0, 2.84),
}
"""Shortest of 30 timings of 1000 compiled steps with the energy ledger, of every method in the scenes of MEASURED_IN on
one core of an x86-64 processor with AVX-512; then a line through each class. A step of rk4 took 68 ns in the lab."""


def class_of(method: Method, scene: Scene) -> str:
    """How a method works, as far as its cost goes: its Python class, with what adds to it in this scene."""
    words = {
        "implicit": method.implicit,
        "drag flow": "split" in method.needs and bool(scene.of_kind("dissipative")),
        "periodic": method.exact and scene.periodic,
    }
    return ", ".join([type(method).__name__, *(word for word, holds in words.items() if holds)])


def step_cost(method: Method, scene: Scene, table: Table) -> float:
    """One step, in steps of rk4."""
    beside, each = table[class_of(method, scene)]
    return beside + each * method.evaluations


def control_cost(method: Method, scene: Scene, substeps: int, table: Table) -> float:
    """One control step of so many substeps, in steps of rk4; with what a memory takes to begin anew in each."""
    again = method.beginning * table[EVALUATION][1] if restarting(scene) else 0.0
    return substeps * step_cost(method, scene, table) + again


def samples() -> dict[str, tuple[str, tuple[Method, ...]]]:
    """Class -> the scene it is measured in, and its members of the fewest and the most evaluations."""
    found: dict[str, tuple[str, tuple[Method, ...]]] = {}
    for name in MEASURED_IN:
        groups: dict[str, list[Method]] = {}
        for method in fitting(SCENES[name]).values():
            groups.setdefault(class_of(method, SCENES[name]), []).append(method)
        for kind, members in groups.items():
            ends = (min(members, key=lambda method: method.evaluations),
                    max(members, key=lambda method: method.evaluations))
            found.setdefault(kind, (name, tuple(dict.fromkeys(ends))))
    return found


def times(machines: Mapping[str, Machine], rounds: int = ROUNDS) -> dict[str, float]:
    """The shortest time of a step of each [s], going round them all in turn."""
    best = dict.fromkeys(machines, math.inf)
    for turn in range(rounds + 1):
        for name, machine in machines.items():
            state = machine.state(1.0, 0.0)
            begun = time.perf_counter()
            machine.advance(state, 0.3, H, STEPS)
            if turn:
                best[name] = min(best[name], (time.perf_counter() - begun) / STEPS)
    return best


def measure(tell: Callable[[float, str], None] = lambda _done, _what: None) -> dict[str, tuple[float, float]]:
    """The table of this machine, compiled; takes about a minute where nothing is compiled yet."""
    wanted, found = samples(), {}
    for place in MEASURED_IN:
        members = {method.name: method for name, group in wanted.values() if name == place for method in group}
        machines: dict[str, Machine] = {}
        for i, name in enumerate((UNIT, *members)):
            tell((MEASURED_IN.index(place) + 0.8 * i / (1 + len(members))) / len(MEASURED_IN), name)
            machines[name] = RunSpec.of(SCENES[place], name, backend="compiled").machine()
            machines[name].advance(machines[name].state(1.0, 0.0), 0.3, H, 1)
        best = times(machines)
        for kind, (name, group) in wanted.items():
            if name == place:
                found[kind] = _line([(method.evaluations, best[method.name] / best[UNIT]) for method in group])
    return found


def _line(points: list[tuple[int, float]]) -> tuple[float, float]:
    """Through one or two points, neither number below zero."""
    (few, low), (many, high) = points[0], points[-1]
    each = (high - low) / (many - few) if many > few else low / few
    beside = low - each * few
    return (beside, each) if beside > 0.0 and each > 0.0 else (0.0, high / many)
