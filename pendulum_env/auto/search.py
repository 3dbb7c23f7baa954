"""The cheapest method and substeps whose worst probe error is small enough."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from integrators import Method
from pendulum_env.auto.costs import Table, control_cost, step_cost
from pendulum_env.engine.machine import ANGLE, INDEX, TURNS, TWO_PI, Machine
from pendulum_env.engine.shape import DIVERGED
from pendulum_env.engine.spec import RunSpec
from pendulum_env.engine.starts import fewest_substeps
from pendulum_env.physics.scene import Scene
from pendulum_env.truth.answer import Truth
from pendulum_env.truth.probes import Probe

MOST_SUBSTEPS = 1024
MARGIN = 1.25
"""Methods that cost up to so many times the cheapest are followed to their errors, to be told as runners-up."""
HARD = 5
"""Cases that most candidates are judged by."""
STALLED = 0.7
"""Twice the substeps that leave more than this of the error are held up by rounding, if three times in a row."""


@dataclass
class Case:
    """One episode and what it ought to give, if that is known.

    Machines are kept by method, and by substeps where gusts count them.
    """

    scene: Scene
    probe: Probe
    truth: Truth | None
    dt: float
    machines: dict[tuple[str, int], Machine]

    def follow(self, method: Method, substeps: int) -> Iterator[tuple[float, float]]:
        """(angle from the nearer of bottom and top, turns) after each whole control step, until the episode ends."""
        key = (method.name, substeps if any(effect.memory for effect in self.scene.effects) else 0)
        machine = self.machines.get(key)
        if machine is None:
            machine = RunSpec.of(self.scene, method, diagnostics=(), backend="python", substeps=substeps).machine()
            self.machines[key] = machine
        state, h = machine.state(self.probe.angle, self.probe.velocity, self.probe.uniform), self.dt / substeps
        for k, share in enumerate(self.probe.controls, 1):
            code = machine.advance(state, share, h, substeps)
            if code == DIVERGED or state[INDEX] < k * substeps:
                return
            yield state[ANGLE], state[TURNS]
            if code:
                return

    def error(self, method: Method, substeps: int, most: float = math.inf) -> float:
        """The largest error of the angle [rad], or the first beyond ``most``; inf for one that ends too soon."""
        assert self.truth is not None
        expected = list(zip(self.truth.angle.tolist(), np.asarray(self.truth.turns).tolist(), strict=True))
        worst, done, last = 0.0, 0, len(expected) - 1
        for row, true in zip(self.follow(method, substeps), expected[1:], strict=False):
            worst, done = max(worst, _distance(row, true)), done + 1
            if worst > most:
                return worst
        return worst if done >= last - 1 else math.inf

    def doubt(self, method: Method, substeps: int) -> float:
        """By how much one substep more changes the motion at most [rad], where there is no truth to compare with."""
        pairs = zip(self.follow(method, substeps), self.follow(method, substeps + 1), strict=False)
        return max((_distance(row, other) for row, other in pairs), default=0.0)


def _distance(row: tuple[float, float], other: tuple[float, float]) -> float:
    """Between two angles [rad], of which turns are counted apart."""
    return abs(row[0] - other[0] + TWO_PI * (row[1] - other[1]))


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

    Most are judged by the HARD cases alone, those in which the first candidate did worst, the winner by all.
    ``least``: the smallest error that the first candidates came to in a hard case, where none does.
    """

    cases: list[Case]
    goal: float
    table: Table
    least: float = math.inf
    _hard: list[Case] = field(default_factory=list)

    def run(self, methods: Mapping[str, Method], tell: Callable[[float, str], None]) -> list[Found]:
        """Those within MARGIN of the cheapest, the cheapest first; of equal ones the more accurate."""
        if not self._hard:
            self._hard = list(self.cases)
        scene, best = self.cases[0].scene, math.inf
        found: list[Found] = []
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
                self._harden(method, substeps)
        found.sort(key=lambda one: (one.cost, one.error, one.method))
        if not found:
            return []
        errors = [case.error(methods[found[0].method], found[0].substeps) for case in self.cases]
        if max(errors) > self.goal:
            self._hard = [case for case, error in zip(self.cases, errors, strict=True)
                          if error > self.goal or case in self._hard]
            return self.run(methods, tell)
        found[0] = replace(found[0], error=max(errors))
        return [one for one in found if one.cost <= MARGIN * best]

    def add(self, cases: list[Case]) -> None:
        """More cases, which are asked first."""
        self.cases = [*cases, *self.cases]
        self._hard = [*cases, *self._hard]

    def _harden(self, method: Method, substeps: int) -> None:
        """Leave those cases alone in which the first candidate does best."""
        if len(self._hard) == len(self.cases) > HARD:
            errors = {id(case): case.error(method, substeps) for case in self.cases}
            self._hard = sorted(self.cases, key=lambda case: -errors[id(case)])[:HARD]

    def _ordered(self, methods: Iterable[Method], scene: Scene) -> list[Method]:
        """The most promising first: by the cost with as many substeps as their order may ask for."""
        phase, small = self.cases[0].dt * scene.omega0, min(self.goal, 0.5)

        def guess(method: Method) -> float:
            substeps = max(fewest_substeps(method, scene), math.ceil(phase * small ** (-1.0 / method.order)))
            return control_cost(method, scene, substeps, self.table)

        return sorted(methods, key=guess)

    def _worst(self, method: Method, substeps: int, most: float) -> float:
        """The largest error of all cases, or the first beyond ``most``, whose case is then asked first."""
        worst = 0.0
        for i, case in enumerate(self._hard):
            worst = max(worst, case.error(method, substeps, most))
            if worst > most:
                self._hard.insert(0, self._hard.pop(i))
                break
        return worst

    def _fewest(self, method: Method, least: int, most: int, bounded: bool) -> tuple[int, float] | None:
        """The fewest substeps that do, and the error with them; None where ``most`` do not.

        ``bounded``: whether ``most`` is little enough to be tried first; else substeps double until they do.
        """
        low, high = least - 1, most
        if not bounded:
            high, stalls, before = least, 0, math.inf
            while (error := self._hard[0].error(method, high)) > self.goal:
                self.least = min(self.least, error)
                stalls = stalls + 1 if error > STALLED * before else 0
                if stalls == 3 or 2 * high > most:
                    return None
                low, high, before = high, 2 * high, error
        while True:
            count = self._in_hardest(method, low, high)
            if count is not None:
                error = self._worst(method, count, self.goal)
                if error <= self.goal:
                    return count, error
            low = high if count is None else count
            if low == high:
                if high == most:
                    return None
                high = min(most, 2 * high)

    def _in_hardest(self, method: Method, low: int, high: int) -> int | None:
        """The fewest substeps above ``low`` that do in the hardest case; None where ``high`` do not."""
        case, goal = self._hard[0], self.goal
        if case.error(method, high, goal) > goal:
            return None
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (middle, high) if case.error(method, middle, goal) > goal else (low, middle)
        return high
