"""Search for the cheapest method and substeps with a small enough largest error in the probe episodes.

A probe episode is a run with given start and motor torques, for which a reference solution is known.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from integrators import Method
from pendulum_env.auto.costs import Table, control_cost, step_cost
from pendulum_env.auto.probes import Probe, ProbeMotions
from pendulum_env.common.progress import Progress
from pendulum_env.engine.machine import ANGLE, INDEX, TURNS, TWO_PI, Machine
from pendulum_env.engine.shape import DIVERGED
from pendulum_env.engine.spec import RunSpec
from pendulum_env.engine.starts import fewest_substeps
from pendulum_env.truth.answer import Truth

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

    ``motions`` computes reference solutions in the scene. ``machines`` holds the simulators used so far, by method and,
    in scenes with gusts, which depend on the number of steps, also by substeps.
    """

    motions: ProbeMotions
    probe: Probe
    machines: dict[tuple[str, int], Machine]
    truth: Truth | None = None

    def solved(self, error: float) -> tuple[ProbeEpisode, int]:
        """Return the episode with a reference solution, and the number of its states with at most this error [rad]."""
        truth = self.motions.motion(self.probe, error)
        return replace(self, truth=truth), int(np.count_nonzero(truth.error <= error))

    def follow(self, method: Method, substeps: int) -> Iterator[tuple[float, float]]:
        """Yield the angle after each control step of a run with this method, until the episode ends.

        An angle is a pair: the angle from the nearer of bottom and top [rad], and the number of turns.
        """
        scene = self.motions.scene
        key = (method.name, substeps if any(effect.memory for effect in scene.effects) else 0)
        if key not in self.machines:
            self.machines[key] = RunSpec.of(
                scene, method, diagnostics=(), backend="python", substeps=substeps).machine()
        machine, h = self.machines[key], self.motions.dt / substeps
        state = machine.state(self.probe.angle, self.probe.velocity, self.probe.uniform)
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
    """The search for the cheapest method with an error of at most ``goal`` [rad] in all probe episodes ``cases``, which
    are short runs made for this search.

    The first method that is tried runs all of them. Others run only those in ``hard``, the five (HARD) in which it had
    the largest errors; the cheapest accurate method then runs all. If no method is accurate enough, ``least`` is the
    smallest error that was measured in the hardest episode [rad].
    """

    cases: list[ProbeEpisode]
    hard: list[ProbeEpisode]
    goal: float
    table: Table
    least: float = math.inf

    def run(self, methods: Mapping[str, Method], tell: Progress) -> list[Candidate]:
        """Return the accurate methods that cost at most 1.25 times the cheapest, sorted by cost and then by error."""
        scene, best = self.cases[0].motions.scene, math.inf
        phase, small = self.cases[0].motions.dt * scene.omega0, min(self.goal, 0.5)
        candidates: list[Candidate] = []

        def guess(method: Method) -> float:
            substeps = max(fewest_substeps(method, scene), math.ceil(phase * small ** (-1.0 / method.order)))
            return control_cost(method, scene, substeps, self.table)

        for done, method in enumerate(sorted(methods.values(), key=guess)):
            tell(done / len(methods), method.name)
            price = step_cost(method, scene, self.table)
            extra = control_cost(method, scene, 1, self.table) - price
            most = MOST_SUBSTEPS if best == math.inf else min(
                MOST_SUBSTEPS, math.floor((MARGIN * best - extra) / price))
            found = self._fewest(method, fewest_substeps(method, scene), most, bounded=best < math.inf)
            if found is not None:
                candidates.append(Candidate(method.name, *found, extra + found[0] * price))
                best = min(best, candidates[-1].cost)
                if len(self.hard) == len(self.cases) > HARD:
                    self.hard = sorted(self.cases, key=lambda case: -case.error(method, found[0]))[:HARD]
        candidates.sort(key=lambda one: (one.cost, one.error, one.method))
        if not candidates:
            return []
        errors = [case.error(methods[candidates[0].method], candidates[0].substeps) for case in self.cases]
        if max(errors) > self.goal:
            self.hard = [case for case, error in zip(self.cases, errors, strict=True)
                         if error > self.goal or case in self.hard]
            return self.run(methods, tell)
        candidates[0] = replace(candidates[0], error=max(errors))
        return [one for one in candidates if one.cost <= MARGIN * best]

    def _fewest(self, method: Method, least: int, most: int, bounded: bool) -> tuple[int, float] | None:
        """Return the fewest substeps that make a method accurate enough, and its error; None if ``most`` are too few.

        ``least`` is the smallest number allowed. With ``bounded``, ``most`` substeps are tried first; otherwise the
        substeps are doubled until they suffice.
        """
        if most < least:
            return None
        low, high, goal = least - 1, most, self.goal
        if not bounded:
            high, stalls, before = least, 0, math.inf
            while (error := self.hard[0].error(method, high)) > goal:
                self.least = min(self.least, error)
                stalls = stalls + 1 if error > STALLED * before else 0
                if stalls == 3 or 2 * high > most:
                    return None
                low, high, before = high, 2 * high, error
        while True:
            hardest, count = self.hard[0], high
            if hardest.error(method, high, goal) <= goal:
                while count - low > 1:
                    middle = (low + count) // 2
                    low, count = (middle, count) if hardest.error(method, middle, goal) > goal else (low, middle)
                error = self._worst(method, count)
                if error <= goal:
                    return count, error
            low = count
            if low == high:
                if high == most:
                    return None
                high = min(most, 2 * high)

    def _worst(self, method: Method, substeps: int) -> float:
        """Return the method's largest error in the hardest probe episodes, or the first error above the goal.

        The episode with an error above the goal is moved to the front, because it probably rejects other methods
        quickly, too.
        """
        worst = 0.0
        for i, case in enumerate(self.hard):
            worst = max(worst, case.error(method, substeps, self.goal))
            if worst > self.goal:
                self.hard.insert(0, self.hard.pop(i))
                break
        return worst
