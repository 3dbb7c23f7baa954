"""Least squares of whole trajectories.

A first fit survives hundreds of cycles by fitting ever longer beginnings of the recording; a refit starts close by; and
several models of one recording help each other.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.progress import Progress, told_by
from pendulum_env.lab.fitting.model import ANGLE, GRAVITY, LENGTH, SCALE, START, VELOCITY, ZERO, Model
from pendulum_env.lab.fitting.start import Measured, visible
from pendulum_env.lab.recording import Recording
from pendulum_env.physics.effects import DAMPINGS

Array = NDArray[np.float64]

FIRST, LONGER, LEAST_LONGER = 4.0, 8.0, 1.4
"""Periods of the first beginning that is fitted; how many times longer each next one is, at most and at least."""
ASTRAY, SMALL = 0.5, 0.02
"""A model has lost a swing where it is off by this share of the swing's amplitude; amplitudes below this share of the
largest count as that."""
PATIENCE = 2
"""Pieces in a row that may end beyond what the model follows, before the rest is fitted in one, roughly."""
NUDGE, ASIDE = 6e-6, 1e-7
"""Relative change of a parameter for central differences, the cube root of rounding, and for those on one side."""
BEYOND = 10.0
"""Residual [rad] that stands where a trial trajectory has ended."""
ROUGH, FINE = {"ftol": 1e-4, "xtol": 1e-6, "max_nfev": 20}, {"ftol": 1e-9, "xtol": 1e-10, "max_nfev": 60}
"""When the least squares of a beginning, and of the whole, are done."""
MOST = 25
"""Steps of a refit."""
CLOSE = 1e-6
"""A refit ends where a step takes so little off the sum of squares, as a share of the residual's variance."""
HONEST, NEAR = 0.8, 100.0
"""Derivatives are taken anew where the sum of squares fell by a smaller share of what they predicted, or as much more,
or by more variances of the residual."""
WORSE = 1e-6
"""A model whose sum of squares is larger than a simpler one's by more than this share of it is fitted anew."""
HINT = 1e-3
"""What such a fit begins with for what the simpler model lacks, over what is just seen."""


@dataclass(frozen=True, eq=False)
class Solution:
    """Least squares of a model.

    Attributes:
        values: parameters, as ``model.names``.
        residual: data minus model [rad], at every time.
        jacobian: of the model's angles by the parameters, shape ``(times, names)``.
        velocity: of the model at every time [rad/s].
        followed: time up to which the model follows the swings, by ``ASTRAY``; the last one if it follows all [s].
    """

    model: Model
    values: Array
    residual: Array
    jacobian: Array
    velocity: Array
    followed: float

    @property
    def lost(self) -> bool:
        """True if the model does not follow all swings: a phase slipped, or the amplitude is far off."""
        return self.followed < float(self.model.time[-1])


def solve(
    model: Model,
    angle: Array,
    sigma: Array,
    start: Array,
    progress: Progress | None = None,
    pause: int = 0,
) -> Solution:
    """Minimise ``sum(((angle - model) / sigma)**2)`` from ``start``.

    The fit begins with as much of the recording as the start follows, at least 4 periods, and goes on to what each fit
    follows beyond its own end; so no phase is ever off by half a turn where a longer piece is begun.

    Args:
        angle, sigma: readings and the standard deviation of each [rad], at ``model.time``.
        pause: readings that are fitted before any later ones. Where dry friction has stopped the bob, the angle that it
            rests at tells the friction very finely, but in many ways, so that the swing has to say first which.
    """
    tell, total = told_by(progress), len(model.time)
    values = np.maximum(start, model.least)
    period = math.tau / model.scene_with(values).omega0
    floor = max(int(np.searchsorted(model.time, FIRST * period)), 4 * len(model.names))
    done, most, beyond = 0, total, -1
    while True:
        reach = followed(model, values, angle, sigma)
        beyond = beyond + 1 if reach < floor else 0
        count = total if beyond > PATIENCE else min(total, most, max(reach, floor))
        count = pause if done < pause < count else count
        tell(0.9 * count / total, f"{model.title}: {model.time[count - 1]:.3g} s")
        how = FINE if count in (pause, total) and beyond <= PATIENCE else ROUGH
        values = _least_squares(model.until(count), angle[:count], sigma[:count], values, how)
        if count == total:
            break
        done, floor, most = count, math.ceil(LEAST_LONGER * count), math.ceil(LONGER * count)
    tell(1.0, model.title)
    return solution_at(model, values, angle, sigma)


def solution_at(model: Model, values: Array, angle: Array, sigma: Array) -> Solution:
    """What these values leave of the readings."""
    angles, velocity = model.motion(values)
    last = max(followed(model, values, angle, sigma, angles[0]) - 1, 0)
    return Solution(model, values, angle - angles[0], jacobian(model, values), velocity[0], float(model.time[last]))


def _least_squares(model: Model, angle: Array, sigma: Array, start: Array, how: Mapping[str, Any]) -> Array:
    """Parameters of the least squares within their bounds."""
    from scipy.optimize import least_squares

    seen: dict[bytes, Array] = {}

    def shown(x: Array) -> Array:
        if x.tobytes() not in seen:
            seen.clear()
            seen[x.tobytes()] = model.angles(x)[0]
        return seen[x.tobytes()]

    def misses(x: Array) -> Array:
        return np.asarray(np.nan_to_num(shown(x) - angle, nan=BEYOND) / sigma)

    def slopes(x: Array) -> Array:
        return jacobian(model, x, shown(x)) / sigma[:, None]

    found = least_squares(misses, start, slopes, bounds=(model.least, np.inf), x_scale=sizes(model, start),
                          method="dogbox", gtol=None, **how)
    return np.asarray(np.maximum(found.x, model.least))


def followed(model: Model, values: Array, angle: Array, sigma: Array, shown: Array | None = None) -> int:
    """How many of the readings, from the first on, the model with these values follows; ``shown``: its angles. One
    that is astray alone is a bad reading."""
    theirs = model.angles(values)[0] if shown is None else shown
    zero = values[model.names.index(ZERO)]
    size = _amplitude(model.time, angle - zero, math.tau / model.scene_with(values).omega0)
    off = np.nan_to_num(np.abs(angle - theirs), nan=BEYOND)
    astray = off > ASTRAY * np.maximum(size, SMALL * float(size.max())) + 10.0 * sigma
    both = astray[1:] & astray[:-1]
    return int(np.argmax(both)) if both.any() else len(angle)


def _amplitude(time: Array, angle: Array, period: float) -> Array:
    """Largest |angle| within a period or two around each time, linear between."""
    cells = np.floor(time / period).astype(np.intp)
    peaks = np.zeros(int(cells[-1]) + 3)
    np.maximum.at(peaks, cells + 1, np.abs(angle))
    near = np.maximum(np.maximum(peaks[:-2], peaks[2:]), peaks[1:-1])
    return np.asarray(near[cells])


def sizes(model: Model, values: Array) -> Array:
    """What is a large change of each parameter; a damping's number counts at least as that at which it is just seen."""
    scene, given = model.scene_with(values), dict(zip(model.names, values, strict=True))
    swing = max(abs(given[ANGLE]), abs(given[VELOCITY]) / scene.omega0, 1e-3)
    known = {ANGLE: 0.1, VELOCITY: 0.1 * scene.omega0, ZERO: 0.01, SCALE: 0.01, LENGTH: 1e-3 * scene.body.length,
             GRAVITY: 1e-3 * scene.gravity}
    least = dict(zip(model.numbers, visible(scene, model.numbers, swing), strict=True))
    return np.array([known.get(name, max(abs(x), least.get(name, 1e-12))) for name, x in given.items()])


def jacobian(model: Model, values: Array, shown: Array | None = None) -> Array:
    """Derivatives of the angles by the parameters, shape ``(times, names)``, by differences in one batch.

    Central ones of second order, next to a bound one-sided ones; all one-sided where the angles at the values
    themselves are given, ``shown``: half the work, for steps of a search.
    """
    count, size = len(values), np.maximum(np.abs(values), sizes(model, values))
    if shown is not None:
        rows = model.angles(values + np.diag(ASIDE * size))
        return np.nan_to_num((rows - shown).T / (ASIDE * size))
    steps = np.diag(NUDGE * size)
    up, down = values + steps, np.maximum(values - steps, model.least)
    rows = model.angles(np.concatenate([up, down]))
    return np.nan_to_num((rows[:count] - rows[count:]).T / np.diagonal(up - down))


# --- from close by ---------------------------------------------------------------------------------------------------


def refit(
    model: Model,
    angle: Array,
    start: Array,
    slopes: Array,
    which: NDArray[np.intp] | None = None,
    trust: float = 0.0,
) -> tuple[Array, float]:
    """Least squares from close by, of some parameters: values and sum of squares.

    Gauss and Newton's steps within the bounds, with derivatives from where they were last taken as long as the sum of
    squares falls as these predict, and new ones at the end.

    Args:
        angle: readings [rad] at ``model.time``, of equal weights.
        slopes: derivatives of the angles near ``start``, ``(readings, parameters)``.
        which: places of the parameters that move; all by default. The others stay at ``start``.
        trust: where all the fall is what the given derivatives predicted at first, to this share of it, the model is
            linear enough to do without new ones.
    """
    from scipy.optimize import lsq_linear

    places = np.arange(len(start)) if which is None else which
    values = np.maximum(start, model.least)
    residual = _residual(model, angle, values)
    squares, fresh, falls = float(residual @ residual), False, [0.0, 0.0]
    size, q, r = _factors(slopes[:, places])
    for _ in range(MOST):
        low = (model.least - values)[places] * size
        target = q.T @ residual
        step = lsq_linear(r, target, bounds=(low, np.inf), method="bvls" if np.isfinite(low).any() else "trf").x
        predicted, fallen = float(target @ target) - float((target - r @ step) @ (target - r @ step)), 0.0
        if worth := predicted >= CLOSE * squares / len(residual):
            trial = values.copy()
            trial[places] = np.maximum(values[places] + step / size, model.least[places])
            missed = _residual(model, angle, trial)
            fallen = squares - float(missed @ missed)
            falls = [falls[0] or predicted, falls[1] + fallen]
            if fallen > 0.0:
                values, residual, squares = trial, missed, squares - fallen
        if fallen <= 0.0 and (fresh or (not worth and abs(falls[1] - falls[0]) < trust * falls[0])):
            break
        most = min(predicted / HONEST, NEAR * squares / len(residual))
        if fresh := not (fallen > 0.0 and HONEST * predicted <= fallen <= most):
            size, q, r = _factors(jacobian(model, values)[:, places])
    return values, squares


def _factors(slopes: Array) -> tuple[Array, Array, Array]:
    """Lengths of the columns, and QR of the columns at length 1."""
    size = np.sqrt(np.einsum("ij,ij->j", slopes, slopes))
    size = np.where(size > 0.0, size, 1.0)
    q, r = np.linalg.qr(slopes / size)
    return size, q, r


def _residual(model: Model, angle: Array, values: Array) -> Array:
    return np.asarray(np.nan_to_num(angle - model.angles(values)[0], nan=BEYOND))


# --- several models --------------------------------------------------------------------------------------------------


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
