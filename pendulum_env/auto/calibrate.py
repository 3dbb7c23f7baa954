"""The measurement behind ``integrator="auto"``: probe episodes, their reference solutions, and the search for a method.

A probe episode is a run with given start and motor torques, in which the errors of all methods are measured.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from integrators import Method
from pendulum_env.auto.costs import Table
from pendulum_env.auto.probes import probes
from pendulum_env.auto.promise import AccuracyError, Choice
from pendulum_env.auto.search import MARGIN, Candidate, ProbeEpisode, Search
from pendulum_env.common.progress import Progress
from pendulum_env.engine.machine import Machine, fitting
from pendulum_env.physics.scene import Scene
from pendulum_env.truth.probes import ProbeMotions

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


def calibrate(
    scenes: Sequence[Scene], accuracy: float, dt: float, steps: int, table: Table, words: str, tell: Progress
) -> Choice:
    """Run probe episodes (given starts and torques), and choose the cheapest method that is accurate in all of them.

    The arguments and errors are those of :func:`pendulum_env.auto.choice.choose`, and ``words`` is the origin of
    the table of step costs, "shipped" or "measured here".
    """
    goal, count = accuracy / SAFETY, len(scenes)
    most = goal / (PART * ROUNDING)
    tell(0.0, "probe episodes")
    probe_sets = [probes(scene, dt, steps, lambda done: tell(0.2 * done, "probe episodes")) for scene in scenes]
    growths = sorted(probe.growth for tried in probe_sets for probe in tried.every)
    middle = growths[len(growths) // 2]
    hopeless = middle > most
    least = 2.0 * SAFETY * PART * ROUNDING * middle
    if hopeless and least < HOPELESS:
        raise AccuracyError(_below(scenes[0], accuracy, least))
    cases: list[ProbeEpisode] = []
    spare: list[tuple[ProbeMotions, ProbeEpisode]] = []
    lost, reach = sum(growth > most for growth in growths), steps
    for i, (scene, tried) in enumerate(zip(scenes, probe_sets, strict=True)):
        motions, machines = ProbeMotions(scene, dt), dict[tuple[str, int], Machine]()
        selected = list(tried.plain) if hopeless else tried.up_to(most)
        for j, probe in enumerate(selected):
            tell(0.2 + 0.2 * (i + j / len(selected)) / count, "reference")
            truth = motions.motion(probe, goal / PART)
            fine = int(np.count_nonzero(truth.error <= goal / PART))
            if hopeless:
                reach = min(reach, fine - 1)
            elif fine <= len(probe.controls):
                lost += 1
                continue
            cases.append(ProbeEpisode(scene, probe, truth, dt, machines))
        rest = () if hopeless else (probe for probe in tried.chosen if probe.growth <= most and probe not in selected)
        spare += [(motions, ProbeEpisode(scene, probe, None, dt, machines)) for probe in rest]
    spare.sort(key=lambda one: -one[1].probe.growth)
    if reach < 1 or not cases:
        raise AccuracyError(_below(scenes[0], accuracy, least))
    cases = [replace(case, truth=case.truth[: reach + 1]) for case in cases if case.truth is not None]
    search, methods, judged = Search(cases, goal, table), fitting(scenes[0]), 0.4
    ranked: list[Candidate] = []
    while True:
        start, before = judged, ranked
        retried = {one.method: methods[one.method] for one in before}
        ranked = search.run(retried, _quiet) if retried else []
        if not ranked or ranked[0].cost > MARGIN * before[0].cost:  # else the other methods are still more expensive
            ranked = search.run(methods, lambda done, text: tell(start + 0.5 * (1.0 - start) * done, text))  # noqa: B023
        if not ranked:
            raise AccuracyError(_below(scenes[0], accuracy, SAFETY * search.least))
        judged += 0.5 * (1.0 - judged)
        tell(judged, "all episodes")
        worst, gone = _doubted(spare, methods[ranked[0].method], ranked[0].substeps, goal)
        lost += gone
        search.add(worst)
        error = max((case.error(methods[ranked[0].method], ranked[0].substeps) for case in worst), default=0.0)
        if error <= goal:
            ranked[0] = replace(ranked[0], error=max(error, ranked[0].error))
            break
    best, *others = ranked
    covered = most
    if not hopeless:
        ends = [(case.error(methods[best.method], best.substeps), case.probe.growth) for case in search.cases]
        rate = max(error / growth for error, growth in ends)
        covered = min(max(growth for _, growth in ends), goal / rate if rate else math.inf)
        lost = max(lost, sum(growth > covered for growth in growths))
    horizon, share = math.inf if reach == steps else reach * dt, lost / len(growths)
    return Choice(
        method=best.method, substeps=best.substeps, accuracy=accuracy, dt=dt, steps=steps, error=best.error,
        horizon=horizon, growth=covered, share=share, judged=len(search.cases), tried=len(growths), cost=best.cost,
        table=words, others=tuple(others),
        limits=tuple(_limits(scenes[0], accuracy, horizon, dt * steps, covered, share)),
    )


def _quiet(_done: float, _text: str) -> None:
    """Ignore a progress report, given by the fraction done and a text."""


def _doubted(
    spare: list[tuple[ProbeMotions, ProbeEpisode]], method: Method, substeps: int, goal: float
) -> tuple[list[ProbeEpisode], int]:
    """Return further probe episodes that the chosen method may not follow accurately, with reference solutions added.

    They are the episodes of ``spare`` whose motion changes the most if the method takes one more substep. The second
    result is the number of those whose reference solution is not accurate enough.
    """
    doubts = {id(case): case.doubt(method, substeps) for _, case in spare[:DOUBTS]}
    spare.sort(key=lambda one: -doubts.get(id(one[1]), -1.0))
    checked, gone = [], 0
    for motions, case in spare[:DOUBTED]:
        truth = motions.motion(case.probe, goal / PART)
        if len(truth.time) <= len(case.probe.controls) or truth.error_estimate > goal / PART:
            gone += 1
        else:
            checked.append(replace(case, truth=truth))
    del spare[:DOUBTED]
    return checked, gone


def _below(scene: Scene, accuracy: float, least: float) -> str:
    """Return the error message for an accuracy that no method reaches.

    It names the smallest accuracy that can be reached, ``least`` [rad], rounded up to two digits.
    """
    digits = 10.0 ** (math.floor(math.log10(least)) - 1) if 0.0 < least < math.inf else 0.0
    limit = f"the smallest accuracy that can be reached is about {math.ceil(1.1 * least / digits) * digits:.1e} rad"
    return (f"An accuracy of {accuracy:g} rad cannot be reached in double precision over an episode of the scene "
            f"'{scene.name}'; {limit if digits else 'no smallest accuracy is known'}.")


def _limits(
    scene: Scene, accuracy: float, horizon: float, episode: float, growth: float, share: float
) -> list[str]:
    """Return sentences on the cases in which ``integrator="auto"`` does not guarantee the requested accuracy."""
    limits = []
    if horizon < episode:
        limits.append(f"Errors of the scene '{scene.name}' grow so fast that {accuracy:g} rad is reached up to "
                      f"{horizon:g} s of an episode's {episode:g} s only; beyond, double precision is not enough.")
    elif share > OFTEN:
        limits.append(f"In {100.0 * share:.0f} % of the test episodes of '{scene.name}', where the bob lingers near "
                      f"the top or the motion is chaotic, small errors grow more than {growth:.1g}-fold; the accuracy "
                      f"of {accuracy:g} rad is reached in the other episodes only.")
    if any(effect.dry for effect in scene.effects):
        limits.append(f"The scene '{scene.name}' has dry friction, so no method keeps its order where the bob sticks "
                      "or slips: the accuracy is certain for the test episodes only.")
    if any(effect.draws for effect in scene.effects):
        limits.append(f"The scene '{scene.name}' has gusts: the accuracy is that of the motion in the same gusts, "
                      "measured in a dozen random samples of them.")
    return limits
