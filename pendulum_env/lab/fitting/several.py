"""Several models of one recording, fitted one with the help of the other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.progress import Progress
from pendulum_env.lab.fitting.intervals import refit
from pendulum_env.lab.fitting.model import START, Model
from pendulum_env.lab.fitting.shooting import Solution, sizes, solution_at, solve
from pendulum_env.lab.fitting.start import Measured
from pendulum_env.lab.recording import Recording
from pendulum_env.physics.effects import DAMPINGS

Array = NDArray[np.float64]

WORSE = 1e-6
"""A model whose sum of squares is larger than a simpler one's by more than this share of it is fitted anew."""
HINT = 1e-3
"""What such a fit begins with for what the simpler model lacks, over what is just seen."""


def solve_all(models: Sequence[Model], swing: Recording, sigma: float, progress: Progress) -> list[Solution]:
    """Solutions of all models, in their order.

    The one with most dampings goes first, from what is measured; the others begin where it started, and with the
    damping that the envelope gives them. One that does worse than a model that it contains begins once more there.
    """
    measured = Measured.of(swing)
    weights = np.full(len(swing.time), sigma)
    last = int(np.searchsorted(swing.time, measured.points.time[-1]))
    found: dict[int, Solution] = {}
    leader: Solution | None = None
    for done, i in enumerate(sorted(range(len(models)), key=lambda i: -len(models[i].numbers))):

        def tell(fraction: float, what: str, done: int = done) -> None:
            progress((done + fraction) / len(models), what)

        model = models[i]
        start = measured.start(model)
        if leader is not None:
            start = _with(start, model, leader, (*START, *model.free))
        dry = any(DAMPINGS[name].dry for name in model.damping)
        found[i] = _settled(solve(model, swing.angle, weights, start, tell, pause=last if dry else 0), swing, weights)
        if leader is None and not found[i].lost:
            leader = found[i]
    for i in sorted(found, key=lambda i: len(models[i].numbers)):
        for j, simpler in enumerate(models):
            if set(simpler.damping) < set(models[i].damping) and _worse(found[i], found[j]):
                start = HINT * sizes(models[i], found[i].values)
                start = _with(start, models[i], found[j], simpler.names)
                again = _settled(solve(models[i], swing.angle, weights, start), swing, weights)
                found[i] = again if _worse(found[i], again) else found[i]
    return [found[i] for i in range(len(models))]


def _settled(found: Solution, swing: Recording, weights: Array) -> Solution:
    """The solution, or a better one next to it: where dampings that nothing calls for lie at their bounds, a search in
    a box of trust can end on the way. A model that does not follow has none."""
    if found.lost:
        return found
    values, squares = refit(found.model, swing.angle, found.values, found.jacobian)
    better = squares < float(found.residual @ found.residual) * (1.0 - WORSE)
    return solution_at(found.model, values, swing.angle, weights) if better else found


def _with(start: Array, model: Model, other: Solution, names: Sequence[str]) -> Array:
    """A start with these numbers of another model's solution."""
    known = dict(zip(other.model.names, other.values, strict=True))
    return np.array([known[name] if name in names and name in known else own
                     for name, own in zip(model.names, start, strict=True)])


def _worse(one: Solution, other: Solution) -> bool:
    """True if the first has clearly the larger sum of squares."""
    squares, theirs = (float(found.residual @ found.residual) for found in (one, other))
    return squares > theirs * (1.0 + WORSE)
