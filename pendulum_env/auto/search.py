"""Search for the cheapest method and substeps with a small enough largest error in the probe episodes.

A probe episode is a run with given start and motor torques, for which a reference solution is known.
"""

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
"""Number of the episodes with the largest errors; most methods are run in these episodes only."""
STALLED = 0.7
"""If doubling the substeps three times in a row leaves more than this share of the error, rounding dominates."""


@dataclass
class ProbeEpisode:
    """A probe episode (run with given start and motor torques) and its reference solution, None if not computed yet.

    ``machines`` holds the simulators used so far, by method and, in scenes with gusts, which depend on the number of
    steps, also by substeps.
    """

    scene: Scene
    probe: Probe
    truth: Truth | None
    dt: float
    machines: dict[tuple[str, int], Machine]

    def follow(self, method: Method, substeps: int) -> Iterator[tuple[float, float]]:
        """Yield the angle after each control step of a run with this method, until the episode ends.

        An angle is a pair: the angle from the nearer of bottom and top [rad], and the number of turns.
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
        """Return the largest error of the angle [rad] in a run of this episode, or the first error above ``most``.

        The error is inf if the run ends before the reference solution.
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
        """Return the largest change of the angle if the method takes one more substep [rad].

        It indicates the error where no reference solution is known.
        """
        pairs = zip(self.follow(method, substeps), self.follow(method, substeps + 1), strict=False)
        return max((_distance(row, other) for row, other in pairs), default=0.0)


def _distance(row: tuple[float, float], other: tuple[float, float]) -> float:
    """Return the distance of two angles [rad], each given as angle from bottom or top [rad] and number of turns."""
    return abs(row[0] - other[0] + TWO_PI * (row[1] - other[1]))


@dataclass(frozen=True)
class Candidate:
    """A method with the fewest substeps that are accurate enough, its error [rad], and its cost per control step.

    The unit of ``cost`` is a step of rk4.
    """

    method: str
    substeps: int
    error: float
    cost: float


@dataclass
class Search:
    """The search for the cheapest method with an error of at most ``goal`` [rad] in all probe episodes, which
    are short runs made for this search.

    The first method that is tried runs all of them. Others run only the five (HARD) in which it had the largest errors;
    the cheapest accurate method then runs all. If no method is accurate enough, ``least`` is the smallest error that
    was measured in the hardest episode [rad].
    """

    cases: list[ProbeEpisode]
    goal: float
    table: Table
    least: float = math.inf
    _hard: list[ProbeEpisode] = field(default_factory=list)

    def run(self, methods: Mapping[str, Method], tell: Callable[[float, str], None]) -> list[Candidate]:
        """Return the accurate methods that cost at most 1.25 times the cheapest, sorted by cost and then by error."""
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
        """Add probe episodes to the search, which methods run before the earlier ones."""
        self.cases = [*cases, *self.cases]
        self._hard = [*cases, *self._hard]

    def _harden(self, method: Method, substeps: int) -> None:
        """Restrict the probe episodes for other methods to the five in which this method has the largest errors.
        """
        if len(self._hard) == len(self.cases) > HARD:
            errors = {id(case): case.error(method, substeps) for case in self.cases}
            self._hard = sorted(self.cases, key=lambda case: -errors[id(case)])[:HARD]

    def _ordered(self, methods: Iterable[Method], scene: Scene) -> list[Method]:
        """Return the methods sorted by their estimated cost, with the number of substeps estimated from their order."""
        phase, small = self.cases[0].dt * scene.omega0, min(self.goal, 0.5)

        def guess(method: Method) -> float:
            substeps = max(fewest_substeps(method, scene), math.ceil(phase * small ** (-1.0 / method.order)))
            return control_cost(method, scene, substeps, self.table)

        return sorted(methods, key=guess)

    def _worst(self, method: Method, substeps: int, most: float) -> float:
        """Return the method's largest error in the hardest probe episodes, or the first error above ``most``.

        The episode with an error above ``most`` is moved to the front, because it probably rejects other methods
        quickly, too.
        """
        worst = 0.0
        for i, case in enumerate(self._hard):
            worst = max(worst, case.error(method, substeps, most))
            if worst > most:
                self._hard.insert(0, self._hard.pop(i))
                break
        return worst

    def _fewest(self, method: Method, least: int, most: int, bounded: bool) -> tuple[int, float] | None:
        """Return the fewest substeps that make a method accurate enough, and its error; None if ``most`` are too few.

        ``least`` is the smallest number allowed. With ``bounded``, ``most`` substeps are tried first; otherwise the
        substeps are doubled until they suffice.
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
        """Return the fewest substeps, from ``low`` + 1 to ``high``, that are accurate enough in the hardest episode.

        The result is None if ``high`` substeps are not accurate enough.
        """
        case, goal = self._hard[0], self.goal
        if case.error(method, high, goal) > goal:
            return None
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (middle, high) if case.error(method, middle, goal) > goal else (low, middle)
        return high
