"""Search for the cheapest method and substeps whose largest error in the probe episodes is small enough."""

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
"""Methods that cost up to this many times the cheapest are also measured, and reported as the next best."""
HARD = 5
"""Number of the most difficult episodes, by which most methods are judged."""
STALLED = 0.7
"""If doubling the substeps three times in a row leaves more than this share of the error, rounding dominates."""


@dataclass
class ProbeEpisode:
    """A probe episode and its reference solution, if that is known.

    Machines are reused, by method and, for scenes with gusts, which depend on the steps, also by substeps.
    """

    scene: Scene
    probe: Probe
    truth: Truth | None
    dt: float
    machines: dict[tuple[str, int], Machine]

    def follow(self, method: Method, substeps: int) -> Iterator[tuple[float, float]]:
        """Yield (angle from the nearer of bottom and top, turns) after each whole control step, until the episode ends.
        """
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
        """Return the largest error of a run's angle [rad], or the first beyond ``most``; inf if the run ends too early.
        """
        assert self.truth is not None
        expected = list(zip(self.truth.angle.tolist(), np.asarray(self.truth.turns).tolist(), strict=True))
        worst, done, last = 0.0, 0, len(expected) - 1
        for row, true in zip(self.follow(method, substeps), expected[1:], strict=False):
            worst, done = max(worst, _distance(row, true)), done + 1
            if worst > most:
                return worst
        return worst if done >= last - 1 else math.inf

    def doubt(self, method: Method, substeps: int) -> float:
        """Return the largest change of the motion by one more substep [rad], in place of an unknown error."""
        pairs = zip(self.follow(method, substeps), self.follow(method, substeps + 1), strict=False)
        return max((_distance(row, other) for row, other in pairs), default=0.0)


def _distance(row: tuple[float, float], other: tuple[float, float]) -> float:
    """Return the difference of two angles [rad], each given as angle and whole turns."""
    return abs(row[0] - other[0] + TWO_PI * (row[1] - other[1]))


@dataclass(frozen=True)
class Candidate:
    """A method with the fewest substeps that it needs, its error and its ``cost`` per control step, in steps of rk4."""

    method: str
    substeps: int
    error: float
    cost: float


@dataclass
class Search:
    """The search for the cheapest method whose error in all episodes is at most ``goal`` [rad].

    Most methods are judged by the HARD episodes in which the first method did worst, the winner by all of them.
    ``least`` is the smallest error that the first methods reached in a hard episode, if none reaches the goal.
    """

    cases: list[ProbeEpisode]
    goal: float
    table: Table
    least: float = math.inf
    _hard: list[ProbeEpisode] = field(default_factory=list)

    def run(self, methods: Mapping[str, Method], tell: Callable[[float, str], None]) -> list[Candidate]:
        """Return the methods that cost at most MARGIN times the cheapest, sorted by cost and then by error."""
        if not self._hard:
            self._hard = list(self.cases)
        scene, best = self.cases[0].scene, math.inf
        candidates: list[Candidate] = []
        for done, method in enumerate(self._ordered(methods.values(), scene)):
            tell(done / len(methods), method.name)
            price = step_cost(method, scene, self.table)
            extra = control_cost(method, scene, 1, self.table) - price
            most = min(MOST_SUBSTEPS, math.floor((MARGIN * best - extra) / price)) if best < math.inf else (
                MOST_SUBSTEPS)
            least = fewest_substeps(method, scene)
            if most < least:
                continue
            result = self._fewest(method, least, most, bounded=best < math.inf)
            if result is not None:
                substeps, error = result
                candidates.append(Candidate(method.name, substeps, error, extra + substeps * price))
                best = min(best, candidates[-1].cost)
                self._harden(method, substeps)
        candidates.sort(key=lambda one: (one.cost, one.error, one.method))
        if not candidates:
            return []
        errors = [case.error(methods[candidates[0].method], candidates[0].substeps) for case in self.cases]
        if max(errors) > self.goal:
            self._hard = [case for case, error in zip(self.cases, errors, strict=True)
                          if error > self.goal or case in self._hard]
            return self.run(methods, tell)
        candidates[0] = replace(candidates[0], error=max(errors))
        return [one for one in candidates if one.cost <= MARGIN * best]

    def add(self, cases: list[ProbeEpisode]) -> None:
        """Add probe episodes to the search, to be run before the others."""
        self.cases = [*cases, *self.cases]
        self._hard = [*cases, *self._hard]

    def _harden(self, method: Method, substeps: int) -> None:
        """Judge the other methods only by the HARD episodes in which this method has the largest errors."""
        if len(self._hard) == len(self.cases) > HARD:
            errors = {id(case): case.error(method, substeps) for case in self.cases}
            self._hard = sorted(self.cases, key=lambda case: -errors[id(case)])[:HARD]

    def _ordered(self, methods: Iterable[Method], scene: Scene) -> list[Method]:
        """Return the methods sorted by their estimated cost, with as many substeps as their order suggests."""
        phase, small = self.cases[0].dt * scene.omega0, min(self.goal, 0.5)

        def guess(method: Method) -> float:
            substeps = max(fewest_substeps(method, scene), math.ceil(phase * small ** (-1.0 / method.order)))
            return control_cost(method, scene, substeps, self.table)

        return sorted(methods, key=guess)

    def _worst(self, method: Method, substeps: int, most: float) -> float:
        """Return the largest error of all hard episodes, or the first beyond ``most``.

        The episode with that first error is moved to the front.
        """
        worst = 0.0
        for i, case in enumerate(self._hard):
            worst = max(worst, case.error(method, substeps, most))
            if worst > most:
                self._hard.insert(0, self._hard.pop(i))
                break
        return worst

    def _fewest(self, method: Method, least: int, most: int, bounded: bool) -> tuple[int, float] | None:
        """Return the fewest substeps that make a method accurate enough, and its error; None if ``most`` is too few.

        ``bounded``: True if ``most`` is small enough to be tried first; otherwise substeps are doubled until they
        suffice.
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
        """Return the fewest substeps above ``low`` that suffice in the hardest probe episode; None if ``high`` do not.
        """
        case, goal = self._hard[0], self.goal
        if case.error(method, high, goal) > goal:
            return None
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (middle, high) if case.error(method, middle, goal) > goal else (low, middle)
        return high
