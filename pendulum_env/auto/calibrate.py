"""The measurement behind ``integrator="auto"`` and its result, the choice of a method.

A probe episode is a run with given start and motor torques, in which the errors of all methods are measured.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from integrators import MethodError
from pendulum_env.auto.costs import Table as Costs
from pendulum_env.auto.probes import ProbeMotions, probes
from pendulum_env.auto.search import MARGIN, Candidate, ProbeEpisode, Search
from pendulum_env.common.progress import Progress, told_by
from pendulum_env.common.texts import Table
from pendulum_env.engine.machine import Machine, fitting
from pendulum_env.physics.scene import Scene

SAFETY = 4.0
"""Factor by which errors in probe episodes must stay below the requested accuracy. A small error grows more than
x-fold with a probability of about 1/x, so about one other episode in SAFETY times the number of probe episodes exceeds
the accuracy.
"""
PART = 4.0
"""Factor by which the reference solution must be more accurate than the errors that it measures."""
ROUNDING = 3e-15
"""Rounding error of an episode [rad], divided by the growth factor of a small error in it."""
DOUBTS, DOUBTED = 24, 4
"""Number of further probe episodes, the most sensitive first, that the chosen method runs, and number of the worst of
these that are compared with a reference solution.
"""
OFTEN = 0.05
"""Fraction of episodes in which the accuracy cannot be reached, above which a warning is given."""
HOPELESS = 0.01
"""If a better accuracy than this cannot be reached in whole episodes [rad], it is guaranteed up to a horizon only."""


class AccuracyError(MethodError):
    """Error of a requested accuracy that is not a positive number, or that no method can reach."""


class Chosen(str):
    """The name of an automatically chosen method, as text.

    ``why`` gives the reasons for the choice in words, ``choice`` the measured numbers.
    """

    why: str = ""
    choice: Choice


@dataclass(frozen=True)
class Choice:
    """An automatically chosen method with its substeps, and the accuracy for which it was chosen.

    For starts of the scene's usual run and of the tasks, and torques that do not depend on the motion, the angle's
    error stays at most ``accuracy`` at the end of each control step up to ``horizon``, as long as a small error has not
    grown more than ``growth``-fold. This statement is measured, not proven: ``error`` is at most a quarter of the
    accuracy, so about one in ``4 tried`` other episodes may be worse. It holds for open-loop torques: a policy that
    holds the bob upright hides errors that grow as exp(omega0 t).

    Attributes:
        method, substeps: the chosen method and its steps in a control step.
        accuracy: the requested accuracy [rad]; ``dt``, ``steps``: control step [s], and control steps in an episode.
        error: the largest error in all probe episodes, the runs in which methods were compared [rad].
        horizon: time up to which the accuracy holds [s]; inf for whole episodes.
        growth: growth of a small error up to which the accuracy holds; ``share``: share of episodes with larger growth.
        judged, tried: number of probe episodes that methods ran, and number of episodes from which these were selected
            as the most sensitive to errors.
        cost: cost of a control step, in units of a step of rk4; ``table`` is the origin of the costs, "shipped" or
            "measured here".
        others: the methods that cost up to a quarter more: method, substeps, error and cost of each.
        limits: sentences on the cases in which the accuracy is not guaranteed.
    """

    method: str
    substeps: int
    accuracy: float
    dt: float
    steps: int
    error: float
    horizon: float
    growth: float
    share: float
    judged: int
    tried: int
    cost: float
    table: str
    others: tuple[Candidate, ...]
    limits: tuple[str, ...]

    @property
    def why(self) -> str:
        """Return the reasons for the automatic choice, and the cases in which the accuracy is not guaranteed, as text.
        """
        span = min(self.horizon, self.dt * self.steps)
        plural = "s" * (self.substeps > 1)
        times = "that come with the package" if self.table == "shipped" else self.table
        reasons = (
            f"{self.method} with {self.substeps} substep{plural} has an error of at most {self.error:.2g} rad over "
            f"{span:g} s in {self.judged} test episodes, the most sensitive of {self.tried}; the requested accuracy is "
            f"{self.accuracy:g} rad; a control step takes as long as {self.cost:.3g} steps of rk4, by the times of "
            f"steps {times}"
        )
        if self.share:
            reasons += (f"; in {100.0 * self.share:.2g} % of these episodes errors grow to more than {self.growth:.1g} "
                        "times their size, so that the accuracy may not be reached there")
        if self.others:
            one = self.others[0]
            reasons += (f"; the next best method, {one.method} with {one.substeps} "
                        f"substep{'s' * (one.substeps > 1)}, takes {one.cost / self.cost:.2f} times as long")
        return " ".join([f"{reasons}.", *self.limits])

    @property
    def ranking(self) -> Table:
        """Return the chosen method and the next cheapest ones as a table, with substeps, error and cost."""
        ranked: tuple[Choice | Candidate, ...] = (self, *self.others)
        head = ("method", "substeps", "worst probe error / rad", "cost / rk4 steps", "relative cost")
        return Table(head, tuple((one.method, str(one.substeps), f"{one.error:.1e}", f"{one.cost:.3g}",
                                  f"{one.cost / self.cost:.2f}") for one in ranked))

    @property
    def name(self) -> Chosen:
        """Return the chosen method's name, a text with the reasons for the choice in its attribute ``why``."""
        chosen = Chosen(self.method)
        chosen.why, chosen.choice = self.why, self
        return chosen


def calibrate(
    scenes: Sequence[Scene], accuracy: float, dt: float, steps: int, costs: Costs, words: str, tell: Progress
) -> Choice:
    """Run probe episodes (given starts and torques), and choose the cheapest method that is accurate in all of them.

    The arguments and errors are those of :func:`pendulum_env.auto.choice.choose`, and ``words`` is the origin of
    the table of step costs, "shipped" or "measured here".
    """
    goal = accuracy / SAFETY
    most = goal / (PART * ROUNDING)
    tell(0.0, "probe episodes")
    probe_sets = [probes(scene, dt, steps, lambda done: tell(0.2 * done, "probe episodes")) for scene in scenes]
    growths = sorted(probe.growth for tried in probe_sets for some in tried for probe in some)
    middle = growths[len(growths) // 2]
    hopeless = middle > most
    least = 2.0 * SAFETY * PART * ROUNDING * middle
    if hopeless and least < HOPELESS:
        raise AccuracyError(_below(scenes[0], accuracy, least))
    cases: list[ProbeEpisode] = []
    spare: list[ProbeEpisode] = []
    lost, reach = sum(growth > most for growth in growths), steps
    for i, (scene, tried) in enumerate(zip(scenes, probe_sets, strict=True)):
        motions, machines = ProbeMotions(scene, dt), dict[tuple[str, int], Machine]()
        selected = tried.plain if hopeless else tried.up_to(most)
        for j, probe in enumerate(selected):
            tell(0.2 + 0.2 * (i + j / len(selected)) / len(scenes), "reference")
            case, fine = ProbeEpisode(motions, probe, machines).solved(goal / PART)
            if hopeless:
                reach = min(reach, fine - 1)
            if hopeless or fine > len(probe.controls):
                cases.append(case)
            else:
                lost += 1
        if not hopeless:
            spare += [ProbeEpisode(motions, probe, machines) for probe in tried.chosen
                      if probe.growth <= most and probe not in selected]
    if reach < 1 or not cases:
        raise AccuracyError(_below(scenes[0], accuracy, least))
    spare.sort(key=lambda case: -case.probe.growth)
    cases = [replace(case, truth=case.truth[: reach + 1]) for case in cases if case.truth is not None]
    search, methods, judged = Search(cases, [*cases], goal, costs), fitting(scenes[0]), 0.4
    ranked: list[Candidate] = []
    error = math.inf
    while error > goal:
        start, before = judged, ranked
        ranked = search.run({one.method: methods[one.method] for one in before}, told_by(None)) if before else []
        if not ranked or ranked[0].cost > MARGIN * before[0].cost:  # else the other methods are still more expensive
            ranked = search.run(methods, lambda done, text: tell(start + 0.5 * (1.0 - start) * done, text))  # noqa: B023
        if not ranked:
            raise AccuracyError(_below(scenes[0], accuracy, SAFETY * search.least))
        judged += 0.5 * (1.0 - judged)
        tell(judged, "all episodes")
        method, substeps = methods[ranked[0].method], ranked[0].substeps
        spare[:DOUBTS] = sorted(spare[:DOUBTS], key=lambda case: -case.doubt(method, substeps))
        doubted = [case.solved(goal / PART) for case in spare[:DOUBTED]]
        del spare[:DOUBTED]
        worst = [case for case, fine in doubted if fine > len(case.probe.controls)]
        lost += len(doubted) - len(worst)
        search.cases, search.hard = [*worst, *search.cases], [*worst, *search.hard]
        error = max((case.error(method, substeps) for case in worst), default=0.0)
    best, *others = ranked
    covered = most
    if not hopeless:
        ends = [(case.error(method, best.substeps), case.probe.growth) for case in search.cases]
        rate = max(error / growth for error, growth in ends)
        covered = min(max(growth for _, growth in ends), goal / rate if rate else math.inf)
        lost = max(lost, sum(growth > covered for growth in growths))
    horizon, share = math.inf if reach == steps else reach * dt, lost / len(growths)
    return Choice(
        method=best.method, substeps=best.substeps, accuracy=accuracy, dt=dt, steps=steps,
        error=max(error, best.error), horizon=horizon, growth=covered, share=share, judged=len(search.cases),
        tried=len(growths), cost=best.cost, table=words, others=tuple(others),
        limits=tuple(limits_of(scenes[0], accuracy, horizon, dt * steps, covered, share)),
    )


def _below(scene: Scene, accuracy: float, least: float) -> str:
    """Return the error message for an accuracy that no method reaches.

    It names the smallest accuracy that can be reached, ``least`` [rad], rounded up to two digits.
    """
    digits = 10.0 ** (math.floor(math.log10(least)) - 1) if 0.0 < least < math.inf else 0.0
    limit = f"the smallest accuracy that can be reached is about {math.ceil(1.1 * least / digits) * digits:.1e} rad"
    return (f"An accuracy of {accuracy:g} rad cannot be reached in double precision over an episode of the scene "
            f"'{scene.name}'; {limit if digits else 'no smallest accuracy is known'}.")


def limits_of(
    scene: Scene, accuracy: float, horizon: float, episode: float, growth: float, share: float
) -> list[str]:
    """Return sentences on the cases in which ``integrator="auto"`` does not guarantee the requested accuracy."""
    cut, name = horizon < episode, f"'{scene.name}'"
    sentences = {
        f"Errors of the scene {name} grow so fast that {accuracy:g} rad is reached up to {horizon:g} s of an episode's "
        f"{episode:g} s only; beyond, double precision is not enough.": cut,
        f"In {100.0 * share:.0f} % of the test episodes of {name}, where the bob lingers near the top or the motion is "
        f"chaotic, small errors grow more than {growth:.1g}-fold; the accuracy of {accuracy:g} rad is reached in the "
        "other episodes only.": share > OFTEN and not cut,
        f"The scene {name} has dry friction, so no method keeps its order where the bob sticks or slips: the accuracy "
        "is certain for the test episodes only.": any(effect.dry for effect in scene.effects),
        f"The scene {name} has gusts: the accuracy is that of the motion in the same gusts, measured in a dozen random "
        "samples of them.": any(effect.draws for effect in scene.effects),
    }
    return [sentence for sentence, holds in sentences.items() if holds]
