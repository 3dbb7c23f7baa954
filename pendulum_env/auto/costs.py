"""Cost of a step of a method, in units of a step of rk4.

The cost is the method's evaluations times a cost that its class has in common, plus a fixed cost of the class. The
table shipped with the package is the default, so that every computer chooses the same method; :func:`measure` makes a
table for this computer.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from integrators import Method
from pendulum_env.engine.machine import Machine, fitting
from pendulum_env.engine.spec import RunSpec
from pendulum_env.engine.starts import restarting
from pendulum_env.engine.timing import step_times
from pendulum_env.physics.flow import braking
from pendulum_env.physics.presets import SCENES
from pendulum_env.physics.scene import Scene

Table = Mapping[str, tuple[float, float]]
"""Class of methods -> (fixed cost of a step, cost of an evaluation), in units of a step of rk4."""

UNIT, EVALUATION = "rk4", "RungeKutta"
"""The method whose step is the unit of cost, and the class whose evaluations start multistep methods."""
MEASURED_IN = ("lab", "vacuum", "textbook")
"""Scenes for the measurement; a class of methods is measured, with rk4, in the first scene that it fits."""
ROUNDS, STEPS, H = 30, 1000, 0.02
"""Number of timings, of which the shortest counts, number of steps in each, and their length [s]."""

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
"""Costs of a step from the shortest of 30 timings of 1000 compiled steps with the energy ledger, of every method in the
scenes of MEASURED_IN on one core of an x86-64 processor with AVX-512; a line was fitted to each class. A step of rk4
took 68 ns in the lab.
"""
KINDS = frozenset(key.partition(",")[0] for key in SHIPPED)
"""Names of the method classes with measured costs."""


def class_of(method: Method, scene: Scene) -> str:
    """Return the name of a method's cost class, within which a step's cost depends on the number of evaluations only.

    It is made of the method's Python class, or the nearest base class with measured costs, and of properties that add
    to the cost in this scene.
    """
    names = [base.__name__ for base in type(method).__mro__]
    kind = next((name for name in names if name in KINDS), names[0])
    words = {
        "implicit": method.implicit,
        "drag flow": "split" in method.needs and bool(braking(scene)),
        "periodic": method.exact and scene.periodic,
    }
    return ", ".join([kind, *(word for word, holds in words.items() if holds)])


def step_cost(method: Method, scene: Scene, table: Table) -> float:
    """Return the cost of one step of a method in this scene, in units of a step of rk4."""
    fixed, slope = table[class_of(method, scene)]
    return fixed + slope * method.evaluations


def control_cost(method: Method, scene: Scene, substeps: int, table: Table) -> float:
    """Return the cost of a control step of ``substeps`` steps, in units of a step of rk4.

    It includes the restart of multistep methods, where they restart at every control step.
    """
    restart = method.beginning * table[EVALUATION][1] if restarting(scene) else 0.0
    return substeps * step_cost(method, scene, table) + restart


def samples() -> dict[str, tuple[str, list[Method]]]:
    """Return the methods to time: for each cost class, a scene and the members with the fewest and most evaluations.

    The keys are the names of the classes, the values pairs of a scene's name and one or two methods.
    """
    measured_in: dict[str, tuple[str, list[Method]]] = {}
    for name in MEASURED_IN:
        methods = list(fitting(SCENES[name]).values())
        for kind in dict.fromkeys(class_of(method, SCENES[name]) for method in methods):
            members = [method for method in methods if class_of(method, SCENES[name]) == kind]
            ends = (end(members, key=lambda method: method.evaluations) for end in (min, max))
            measured_in.setdefault(kind, (name, list(dict.fromkeys(ends))))
    return measured_in


def measure(tell: Callable[[float, str], None] = lambda _done, _text: None) -> dict[str, tuple[float, float]]:
    """Measure the table of step costs on this computer with compiled methods, in units of a step of rk4.

    The measurement takes about a minute if nothing is compiled yet.
    """
    wanted, costs = samples(), {}
    for i, place in enumerate(MEASURED_IN):
        groups = {kind: group for kind, (name, group) in wanted.items() if name == place}
        machines: dict[str, Machine] = {}
        for name in dict.fromkeys((UNIT, *(method.name for group in groups.values() for method in group))):
            tell((i + len(machines) / (2 + 2 * len(groups))) / len(MEASURED_IN), name)
            machines[name] = RunSpec.of(SCENES[place], name, backend="compiled").machine()
        best = step_times(machines, 1.0, 0.0, H, STEPS, rounds=ROUNDS, control=0.3)
        for kind, group in groups.items():
            costs[kind] = _line([(method.evaluations, best[method.name] / best[UNIT]) for method in group])
    return costs


def _line(points: list[tuple[int, float]]) -> tuple[float, float]:
    """Return intercept and slope of a line through one or two points (evaluations, cost), neither of them below zero.
    """
    (few, low), (many, high) = points[0], points[-1]
    slope = (high - low) / (many - few) if many > few else low / few
    fixed = low - slope * few
    return (fixed, slope) if fixed > 0.0 and slope > 0.0 else (0.0, high / many)
