"""The measurement behind a choice: probe episodes, what they ought to give, and the search."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from integrators import Method
from pendulum_env.auto.costs import Table
from pendulum_env.auto.probes import probes
from pendulum_env.auto.promise import AccuracyError, Choice
from pendulum_env.auto.search import MARGIN, Case, Found, Search
from pendulum_env.common.progress import Progress
from pendulum_env.engine.machine import Machine, fitting
from pendulum_env.physics.scene import Scene
from pendulum_env.truth.probes import ProbeMotions

SAFETY = 4.0
"""Probe errors stay so many times below the accuracy. Growth beyond x has a probability of about 1/x, so that among
others about one episode in SAFETY times those tried is worse than all of them by more than this."""
PART = 4.0
"""The reference has to be so many times better than what it judges."""
ROUNDING = 3e-15
"""What rounding comes to in an episode, for each unit of growth [rad]."""
DOUBTS, DOUBTED = 24, 4
"""Episodes beside, the most sensitive first, that the method chosen runs; of them, the worst judged with a truth."""
OFTEN = 0.05
"""A part of the episodes that cannot be kept to the accuracy, from which on a warning says so."""
HOPELESS = 0.01
"""If this is the least that could be promised for whole episodes [rad], a horizon is told instead."""


def calibrate(
    scenes: Sequence[Scene], accuracy: float, dt: float, steps: int, table: Table, words: str, tell: Progress
) -> Choice:
    """Measure probe episodes and choose a method; see :func:`pendulum_env.auto.choice.choose`."""
    goal, count = accuracy / SAFETY, len(scenes)
    most = goal / (PART * ROUNDING)
    tell(0.0, "probe episodes")
    found = [probes(scene, dt, steps, lambda done: tell(0.2 * done, "probe episodes")) for scene in scenes]
    growths = sorted(probe.growth for tried in found for probe in tried.every)
    middle = growths[len(growths) // 2]
    hopeless = middle > most
    least = 2.0 * SAFETY * PART * ROUNDING * middle
    if hopeless and least < HOPELESS:
        raise AccuracyError(_below(scenes[0], accuracy, least))
    cases: list[Case] = []
    spare: list[tuple[ProbeMotions, Case]] = []
    lost, reach = sum(growth > most for growth in growths), steps
    for i, (scene, tried) in enumerate(zip(scenes, found, strict=True)):
        motions, machines = ProbeMotions(scene, dt), dict[tuple[str, int], Machine]()
        kept = list(tried.plain) if hopeless else tried.kept(most)
        for j, probe in enumerate(kept):
            tell(0.2 + 0.2 * (i + j / len(kept)) / count, "reference")
            truth = motions.motion(probe, goal / PART)
            fine = int(np.count_nonzero(truth.error <= goal / PART))
            if hopeless:
                reach = min(reach, fine - 1)
            elif fine <= len(probe.controls):
                lost += 1
                continue
            cases.append(Case(scene, probe, truth, dt, machines))
        rest = () if hopeless else (probe for probe in tried.chosen if probe.growth <= most and probe not in kept)
        spare += [(motions, Case(scene, probe, None, dt, machines)) for probe in rest]
    spare.sort(key=lambda one: -one[1].probe.growth)
    if reach < 1 or not cases:
        raise AccuracyError(_below(scenes[0], accuracy, least))
    cases = [replace(case, truth=case.truth[: reach + 1]) for case in cases if case.truth is not None]
    search, methods, judged = Search(cases, goal, table), fitting(scenes[0]), 0.4
    ranked: list[Found] = []
    while True:
        begun, before = judged, ranked
        again = {one.method: methods[one.method] for one in before}
        ranked = search.run(again, _quiet) if again else []
        if not ranked or ranked[0].cost > MARGIN * before[0].cost:  # else what cost more costs no less now
            ranked = search.run(methods, lambda done, what: tell(begun + 0.5 * (1.0 - begun) * done, what))  # noqa: B023
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


def _quiet(_done: float, _what: str) -> None:
    """No report."""


def _doubted(
    spare: list[tuple[ProbeMotions, Case]], method: Method, substeps: int, goal: float
) -> tuple[list[Case], int]:
    """Of episodes without a truth, those that one substep more changes the most, now with one; how many have none."""
    doubts = {id(case): case.doubt(method, substeps) for _, case in spare[:DOUBTS]}
    spare.sort(key=lambda one: -doubts.get(id(one[1]), -1.0))
    found, gone = [], 0
    for motions, case in spare[:DOUBTED]:
        truth = motions.motion(case.probe, goal / PART)
        if len(truth.time) <= len(case.probe.controls) or truth.error_estimate > goal / PART:
            gone += 1
        else:
            found.append(replace(case, truth=truth))
    del spare[:DOUBTED]
    return found, gone


def _below(scene: Scene, accuracy: float, least: float) -> str:
    """An error's words; the least is rounded up to two digits."""
    digits = 10.0 ** (math.floor(math.log10(least)) - 1) if 0.0 < least < math.inf else 0.0
    said = f"{math.ceil(1.1 * least / digits) * digits:.1e} rad" if digits else "nothing"
    return (f"An accuracy of {accuracy:g} rad is below what double precision can give over an episode of the scene "
            f"'{scene.name}'; the least that can be promised is about {said}.")


def _limits(
    scene: Scene, accuracy: float, horizon: float, episode: float, growth: float, share: float
) -> list[str]:
    """What is not promised, in sentences."""
    said = []
    if horizon < episode:
        said.append(f"Errors of the scene '{scene.name}' grow so fast that {accuracy:g} rad is promised up to "
                    f"{horizon:g} s of an episode's {episode:g} s only; beyond, no method in double precision can.")
    elif share > OFTEN:
        said.append(f"In {100.0 * share:.0f} % of the probe episodes of '{scene.name}', those that linger near the top "
                    f"or are chaotic, small errors grow more than {growth:.1g}-fold; {accuracy:g} rad is promised for "
                    "the others.")
    if any(effect.dry for effect in scene.effects):
        said.append(f"The scene '{scene.name}' has dry friction, whose stops and slips no order of a method covers: "
                    "the error was measured on probe episodes, and nothing is promised beyond them.")
    if any(effect.draws for effect in scene.effects):
        said.append(f"The scene '{scene.name}' has gusts: the accuracy is that of the motion in the same gusts, "
                    "measured in a dozen realisations of them.")
    return said
