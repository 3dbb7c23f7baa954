"""The cheapest method and substeps whose worst probe error is small enough."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

from integrators import Method
from pendulum_env.auto.costs import Table, control_cost, step_cost
from pendulum_env.auto.probes import Probe
from pendulum_env.auto.truth import Rows, distance
from pendulum_env.engine.machine import ANGLE, INDEX, TURNS, Machine
from pendulum_env.engine.shape import DIVERGED
from pendulum_env.engine.starts import fewest_substeps
from pendulum_env.physics.scene import Scene

MOST_SUBSTEPS = 1024
MARGIN = 1.5
"""Methods that cost up to so many times the cheapest are followed to their errors, to be told as runners-up."""
STALLED = 0.7
"""Twice the substeps that leave more than this of the error are held up by rounding, if three times in a row."""


@dataclass
class Case:
    """One episode: what it is, what it ought to give, and how well a method did."""

    scene: Scene
    probe: Probe
    truth: Rows
    dt: float

    def error(self, method: Method, substeps: int, most: float = math.inf) -> float:
        """The largest error of the angle [rad], or the first beyond ``most``; inf for one that ends otherwise."""
        machine = Machine(self.scene, method, (), "python", hold=substeps)
        state, h = machine.state(self.probe.angle, self.probe.velocity, self.probe.uniform), self.dt / substeps
        worst, truth = 0.0, self.truth
        for k, share in enumerate(self.probe.controls[: len(truth) - 1], 1):
            code = machine.advance(state, share, h, substeps)
            if code == DIVERGED:
                return math.inf
            if state[INDEX] < k * substeps:
                return worst if k >= len(truth) - 2 else math.inf
            worst = max(worst, distance((state[ANGLE], state[TURNS]), truth[k]))
            if worst > most:
                break
            if code:
                return worst if k >= len(truth) - 2 else math.inf
        return worst


@dataclass(frozen=True)
class Found:
    """A method with as few substeps as it needs; ``cost`` per control step, in steps of rk4."""

    method: str
    substeps: int
    error: float
    cost: float


@dataclass
class Search:
    """Candidates, judged by cases; ``goal``: the largest error allowed [rad].

    ``least``: the smallest worst error that was seen, of all cases.
    """

    cases: list[Case]
    goal: float
    table: Table
    least: float = math.inf
    _hard: list[Case] = field(default_factory=list)

    def run(self, methods: Mapping[str, Method], tell: Callable[[float, str], None]) -> list[Found]:
        """Those within MARGIN of the cheapest, the cheapest first; of equal ones the first registered."""
        self._hard = list(self.cases)
        scene, found, best = self.cases[0].scene, [], math.inf
        for done, method in enumerate(self._ordered(methods.values(), scene)):
            tell(done / len(methods), method.name)
            price = step_cost(method, scene, self.table)
            beside = control_cost(method, scene, 1, self.table) - price
            most = min(MOST_SUBSTEPS, math.floor((MARGIN * best - beside) / price)) if best < math.inf else (
                MOST_SUBSTEPS)
            least = fewest_substeps(method, scene)
            if most < least:
                continue
            result = self._fewest(method, least, most, bounded=best < math.inf)
            if result is not None:
                substeps, error = result
                found.append(Found(method.name, substeps, error, beside + substeps * price))
                best = min(best, found[-1].cost)
        places = {name: i for i, name in enumerate(methods)}
        found.sort(key=lambda one: (one.cost, places[one.method]))
        return [one for one in found if one.cost <= MARGIN * best]

    def _ordered(self, methods: Iterable[Method], scene: Scene) -> list[Method]:
        """The most promising first: cost times goal**(-1/order), to which the substeps needed are proportional."""
        small = min(self.goal, 0.5)
        return sorted(methods, key=lambda method: step_cost(method, scene, self.table) * small ** (-1.0 / method.order))

    def _worst(self, method: Method, substeps: int, most: float) -> float:
        """The largest error of all cases, or the first beyond ``most``, whose case is then asked first."""
        worst = 0.0
        for i, case in enumerate(self._hard):
            worst = max(worst, case.error(method, substeps, most))
            if worst > most:
                self._hard.insert(0, self._hard.pop(i))
                return worst
        self.least = min(self.least, worst)
        return worst

    def _fewest(self, method: Method, least: int, most: int, bounded: bool) -> tuple[int, float] | None:
        """The fewest substeps that do, and the error with them; None where ``most`` do not.

        ``bounded``: whether ``most`` is little enough to be tried first; else substeps double until they do.
        """
        low, high, error = least - 1, least, math.inf
        if bounded and most > least:
            high = most
            error = self._worst(method, most, self.goal)
        else:
            stalls, before = 0, math.inf
            while (error := self._worst(method, high, math.inf)) > self.goal:
                stalls = stalls + 1 if error > STALLED * before else 0
                if stalls == 3 or 2 * high > most:
                    break
                low, high, before = high, 2 * high, error
        if error > self.goal:
            return None
        while high - low > 1:
            middle = (low + high) // 2
            other = self._worst(method, middle, self.goal)
            low, high, error = (middle, high, error) if other > self.goal else (low, middle, other)
        return high, error
