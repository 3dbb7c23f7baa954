"""Least-squares fits of whole trajectories to a recording.

A first fit follows hundreds of cycles, because it fits ever longer parts from the start of the recording. A refit,
which starts close to the solution, fits all readings at once. If several models are fitted to one recording, one
model's solution gives starting values for others.

In robust fits, single readings that are far off count less, by the soft L1 loss. The loss
of a residual r with the standard deviation sigma is ``2 c² (sqrt(1 + (r/(c sigma))²) - 1)``, close to ``r²``
for small residuals and to ``|r|`` for large ones. With c = 1.345, Gaussian readings are used with 95 % of the
efficiency of least squares (Huber 1981, Robust Statistics). The readings are then pulled towards the model, to
``model + psi(r) / mean(psi')`` with the derivative ``psi`` of the loss: least squares of these has the parameters of
the robust fit, and its usual formulas give their standard errors (Bickel 1976, Scand. J. Stat. 3, 145; Street, Carroll
& Ruppert 1988, Am. Stat. 42, 152).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from pendulum_env.common.progress import Progress, told_by
from pendulum_env.lab.fitting import core
from pendulum_env.lab.fitting.core import search
from pendulum_env.lab.fitting.model import (
    ANGLE,
    GRAVITY,
    LENGTH,
    SCALE,
    SENSOR,
    START,
    TILT,
    VELOCITY,
    ZERO,
    Model,
)
from pendulum_env.lab.fitting.start import Measured, visible
from pendulum_env.lab.fitting.statistics import reading_error
from pendulum_env.lab.recording import Recording, in_words, part_of, with_readings
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import DAMPINGS
from pendulum_env.physics.units import SceneError

Array = NDArray[np.float64]

FIRST, LONGER, LEAST_LONGER = 4.0, 8.0, 1.4
"""Length, in periods, of the first part of the recording that is fitted; largest and smallest factor by which the next
part is longer."""
ASTRAY, SMALL = 0.5, 0.02
"""A model has lost a swing if it is off by the first share of the swing's amplitude. Amplitudes below the second share
of the largest one are replaced by that share."""
PATIENCE = 2
"""Number of successive parts that the model may fail to follow, before the rest is fitted roughly at once."""
NUDGE, ASIDE = 6e-6, 1e-7
"""Relative changes of a parameter for central differences (the cube root of the rounding unit) and for one-sided ones.
"""
BEYOND = 10.0
"""Residual [rad] that is assumed after a trial trajectory has stopped early."""
ROUGH, FINE = {"ftol": 1e-4, "xtol": 1e-6, "max_nfev": 20}, {"ftol": 1e-7, "xtol": 1e-8, "max_nfev": 60}
"""Termination of the least-squares search, for a part of the recording and for all of it."""
CLOSEST = 1e-11
"""Predicted relative fall of the last step of a fit, as :data:`core.CLOSE`: it ends within 1e-6 of the errors."""
SEARCHED, LEAST_SEEN, WORTH = 6_000, 50, 4
"""A search of a long recording takes every n-th reading: at least SEARCHED readings, and LEAST_SEEN per period. If n is
below WORTH, it takes all."""
WORSE = 1e-6
"""A model is fitted again if its sum of squares exceeds that of a simpler model it contains by more than this share."""
HINT = 1e-3
"""Starting value of the dampings that a simpler model lacks, as a share of their scale, if a fit is repeated from the
simpler model's solution."""


@dataclass(frozen=True, eq=False)
class FitSolution:
    """Result of the least-squares fit of a model to a recording.

    Attributes:
        model: the fitted model.
        values: fitted parameters, in the order of ``model.names``.
        residual: recording minus model at every time; 10 (BEYOND) after the model's run has stopped early [rad].
        jacobian: derivatives of the model's angles by the parameters, shape ``(times, names)``.
        velocity: velocity of the model at every time [rad/s].
        followed: time up to which the model follows the swings: its angles are off by less than half the amplitude
            (ASTRAY); the last time if it follows all [s].
    """

    model: Model
    values: Array
    residual: Array
    jacobian: Array
    velocity: Array
    followed: float

    @property
    def lost(self) -> bool:
        """True if the model does not follow all swings, because its phase or its amplitude is far off."""
        return self.followed < float(self.model.time[-1])

    @property
    def squares(self) -> float:
        """Sum of squares of the residual."""
        return float(self.residual @ self.residual)


class SwingResiduals:
    """Residuals of a model of a free swing, for :mod:`core <pendulum_env.lab.fitting.core>`, in standard deviations.

    Attributes:
        model: the model.
        angle: readings, at ``model.time``.
        sigma: their standard deviations, an array, or 1 for residuals in their unit.
        least: lower bounds of the parameters, an array.
    """

    def __init__(self, model: Model, angle: Array, sigma: Array | float = 1.0) -> None:
        self.model, self.angle, self.sigma, self.least = model, angle, sigma, model.least
        self._latest: tuple[bytes, Array] = b"", angle

    def sizes(self, values: Array) -> Array:
        """Return, for every parameter, a change that would be large, an array; see :func:`sizes`."""
        return sizes(self.model, values)

    def residual(self, values: Array, ahead: bool = False) -> Array:
        """Return readings minus model in standard deviations, an array; ``ahead``: True for the slopes in the same
        batch. A reading after the model's run has stopped early is 10 rad (BEYOND) off."""
        if ahead:
            shown, slopes = linearised(self.model, values)
            self._latest = values.tobytes(), slopes
        else:
            shown = self.model.angles(values)[0]
        return np.asarray(np.nan_to_num(self.angle - shown, nan=BEYOND) / self.sigma)

    def slopes(self, values: Array, central: bool = False) -> Array:
        """Return the derivatives of the model in standard deviations, ``(readings, parameters)``."""
        if not central and self._latest[0] != values.tobytes():
            self.residual(values, ahead=True)
        slopes = jacobian(self.model, values) if central else self._latest[1]
        return np.asarray(slopes / np.reshape(self.sigma, (-1, 1)))


def solve(
    model: Model,
    angle: Array,
    sigma: Array,
    start: Array,
    progress: Progress | None = None,
    pause: int = 0,
    every: int = 1,
) -> FitSolution:
    """Fit a model to readings: minimise ``sum(((angle - model) / sigma)**2)``, starting from the values ``start``.

    First, the fit uses the part of the recording that the model with the starting values follows, but at least 4
    periods. Then it extends to the readings that the fitted model follows beyond this part, and so on. In this way the
    phase is never off by half a turn when a longer part is fitted.

    Args:
        model: the model to fit.
        angle, sigma: readings and their standard deviations [rad], at ``model.time``.
        start: starting values of the parameters.
        progress: function that is called with the fraction done and a short text; None for none.
        pause: number of readings to fit before any later ones. After dry friction has stopped the bob, the angle of
            rest agrees with many separate values of the friction, so the swings must first decide which one is right.
        every: n to search with every n-th reading only. The last steps take all.
    """
    tell, part = told_by(progress), replace(model, time=model.time[::every])
    total, pause, readings, weights = len(part.time), pause // every, angle[::every], sigma[::every]
    values = np.maximum(start, model.least)
    period = math.tau / model.scene_with(values).omega0
    floor = max(int(np.searchsorted(part.time, FIRST * period)), 4 * len(model.names))
    done, most, beyond = 0, total, -1
    while done < total:
        reach = followed(part, values, readings, weights)
        beyond = beyond + 1 if reach < floor else 0
        count = total if beyond > PATIENCE else min(total, most, max(reach, floor))
        count = pause if done < pause < count else count
        tell(0.9 * count / total, f"{model.title}: {part.time[count - 1]:.3g} s")
        how = FINE if count in (pause, total) and beyond <= PATIENCE else ROUGH
        values = search(SwingResiduals(part.until(count), readings[:count], weights[:count]), values, how)
        done, floor, most = count, math.ceil(LEAST_LONGER * count), math.ceil(LONGER * count)
    tell(1.0, model.title)
    solution = solution_at(model, values, angle, sigma)
    if solution.lost:
        return solution
    values, _ = core.refit(SwingResiduals(model, angle), values, solution.jacobian, close=CLOSEST, fresh=True)
    again = solution_at(model, values, angle, sigma)
    return solution if _worse(again, solution) else again


def solution_at(model: Model, values: Array, angle: Array, sigma: Array) -> FitSolution:
    """Return the solution for given parameter values: residual, derivatives, velocity and the time up to which the
    model follows the swings.
    """
    angles, velocity = model.motion(values)
    residual = np.asarray(np.nan_to_num(angle - angles[0], nan=BEYOND))
    last = followed(model, values, angle, sigma, angles[0])
    if last < len(angle):  # readings may be worse at the end, where the model must then be off by more
        scatter = np.fmax(reading_error(model.time[last:], residual[last:]), sigma[last:])
        last = followed(model, values, angle, np.concatenate([sigma[:last], scatter]), angles[0])
    until = float(model.time[max(last - 1, 0)])
    return FitSolution(model, values, residual, jacobian(model, values), np.nan_to_num(velocity[0]), until)


def followed(model: Model, values: Array, angle: Array, sigma: Array, shown: Array | None = None) -> int:
    """Return the number of readings, from the first, to which a model with given parameter values stays close.

    ``shown`` are the model's angles; without them, they are simulated. A single reading that is far off counts as a bad
    reading; two in a row mean that the model has lost the swing.
    """
    theirs = model.angles(values)[0] if shown is None else shown
    size = _amplitude(model.time, angle - model.rest(values), math.tau / model.scene_with(values).omega0)
    off = np.nan_to_num(np.abs(angle - theirs), nan=BEYOND)
    astray = off > ASTRAY * np.maximum(size, SMALL * float(size.max())) + 10.0 * sigma
    both = astray[1:] & astray[:-1]
    return int(np.argmax(both)) if both.any() else len(angle)


def _amplitude(time: Array, angle: Array, period: float) -> Array:
    """Return the amplitude at every time, the largest |angle| within the surrounding three periods."""
    cells = np.floor(time / period).astype(np.intp)
    peaks = np.zeros(int(cells[-1]) + 3)
    np.maximum.at(peaks, cells + 1, np.abs(angle))
    near = np.maximum(np.maximum(peaks[:-2], peaks[2:]), peaks[1:-1])
    return np.asarray(near[cells])


def sizes(model: Model, values: Array) -> Array:
    """Return, for every parameter, a change that would be large, by which the fit scales the parameters.

    The scale of a damping parameter is its value, but at least the value at which the damping is just visible.
    """
    scene, given = model.scene_with(values), dict(zip(model.names, values, strict=True))
    swing = max(abs(given[ANGLE]), abs(given[VELOCITY]) / scene.omega0, 1e-3)
    known = {ANGLE: 0.1, VELOCITY: 0.1 * scene.omega0, ZERO: 0.01, SCALE: 0.01, TILT: 0.01,
             LENGTH: 1e-3 * scene.body.reach, GRAVITY: 1e-3 * scene.gravity}
    if not isinstance(scene.body, Body):
        known |= {name: 1e-3 * abs(given[name]) for name in model.free if name not in SENSOR}
    least = dict(zip(model.numbers, visible(scene, model.numbers, swing), strict=True))
    return np.array([known.get(name, max(abs(x), least.get(name, 1e-12))) for name, x in given.items()])


def linearised(model: Model, values: Array, central: bool = False) -> tuple[Array, Array]:
    """Return a model's readings, and their derivatives by its parameters, shape ``(times, names)``, from one batch.

    See :func:`core.derivatives`. Trial values at a bound of which no pendulum can be made, such as a length of 0, have
    no readings (nan) and derivatives 0.
    """
    try:
        steps = (NUDGE if central else ASIDE) * np.maximum(np.abs(values), sizes(model, values))
    except SceneError:
        return np.full(len(model.time), math.nan), np.zeros((len(model.time), len(values)))
    return core.derivatives(model.angles, values, steps, model.least, central)


def jacobian(model: Model, values: Array) -> Array:
    """Return the derivatives of a model's readings by its parameters, ``(times, names)``, by central differences."""
    return linearised(model, values, central=True)[1]


def refit(
    model: Model,
    angle: Array,
    start: Array,
    slopes: Array,
    which: NDArray[np.intp] | None = None,
    trust: float = 0.0,
) -> tuple[Array, float]:
    """Fit a model to readings [rad] again, starting close to the minimum; see :func:`core.refit`."""
    return core.refit(SwingResiduals(model, angle), start, slopes, which, trust)


# --- several models --------------------------------------------------------------------------------------------------


def solve_all(
    models: Sequence[Model], swing: Recording, measured: Measured, sigma: float, progress: Progress
) -> list[FitSolution]:
    """Fit all models to a swing and return their solutions, in the order of the models.

    ``measured`` has the turning points and the period of the swing, and ``sigma`` is the error of a reading. In a long
    recording, the search takes every n-th reading only, and a refit from its solution takes all readings.

    The model with the most dampings is fitted first, from measured starting values. The others take the start, the zero
    and the free parameters of the scene from its solution, and their damping from the envelope. A model that fits worse
    than a simpler model it contains is fitted again from the simpler model's solution.
    """
    weights = np.full(len(swing.time), sigma)
    last = int(np.searchsorted(swing.time, measured.points.time[-1]))
    step = float(np.median(np.diff(swing.time)))
    every = min(len(swing.time) // SEARCHED, int(measured.period / step / LEAST_SEEN))
    every = every if every >= WORTH else 1
    solutions: dict[int, FitSolution] = {}
    leader: FitSolution | None = None
    for done, i in enumerate(sorted(range(len(models)), key=lambda i: -len(models[i].numbers))):

        def tell(fraction: float, what: str, done: int = done) -> None:
            progress((done + fraction) / len(models), what)

        model = models[i]
        start = measured.start(model)
        if leader is not None:
            start = _with(start, model, leader, (*START, *model.free))
        dry = any(DAMPINGS[name].dry for name in model.damping)
        solutions[i] = solve(model, swing.readings, weights, start, tell, pause=last if dry else 0, every=every)
        if leader is None and not solutions[i].lost:
            leader = solutions[i]
    for i in sorted(solutions, key=lambda i: len(models[i].numbers)):
        for j, simpler in enumerate(models):
            if set(simpler.damping) < set(models[i].damping) and _worse(solutions[i], solutions[j]):
                start = HINT * sizes(models[i], solutions[i].values)
                start = _with(start, models[i], solutions[j], simpler.names)
                again = solve(models[i], swing.readings, weights, start)
                solutions[i] = again if _worse(solutions[i], again) else solutions[i]
    return [solutions[i] for i in range(len(models))]


def _with(start: Array, model: Model, other: FitSolution, names: Sequence[str]) -> Array:
    """Return starting values in which the named parameters are replaced by those of another model's solution."""
    known = dict(zip(other.model.names, other.values, strict=True))
    return np.array([known[name] if name in names and name in known else own
                     for name, own in zip(model.names, start, strict=True)])


def _worse(one: FitSolution, other: FitSolution) -> bool:
    """Return True if the first solution's sum of squares exceeds the second's by more than a millionth (WORSE)."""
    return one.squares > other.squares * (1.0 + WORSE)


CORNER = 1.345
"""Residual, in standard deviations, from which on a reading counts clearly less."""
OUTLIER = 5.0
"""Readings that are this many standard deviations off are counted in the note."""
WIDTH, SPIKE = 7, 10.0
"""Number of readings around a reading, and distance from their median, in usual distances, that makes it a spike."""
JUMP = 2.0
"""A step over n readings is a jump if it is more than n + JUMP usual steps, the 95 % quantile of all steps."""
ROUNDS, ENOUGH = 20, 1e-3
"""Largest number of fits, each with the noise of the one before, and change of the model, in standard deviations, at
which they end."""


def calmed(recording: Recording) -> Recording:
    """Return a recording whose spikes are replaced by the line between the readings beside them.

    A spike is a reading far from the median of the seven (WIDTH) around it.
    """
    return with_readings(recording, _without_spikes(recording.time, recording.readings),
                         _without_spikes(recording.time, recording.angle))


def _without_spikes(time: Array, values: Array) -> Array:
    """Return readings without spikes, and without runs between two jumps that are shorter than the parts beside them.
    """
    away = np.abs(values - median_filter(values, WIDTH, mode="nearest"))
    usual = max(1.4826 * float(np.median(away)), float(np.quantile(away, 0.75)), 1e-12 * float(np.ptp(values)))
    good = np.flatnonzero(away <= SPIKE * usual)
    usual = float(np.quantile(np.abs(np.diff(values[good])) / np.diff(good), 0.95, method="higher"))
    while True:
        steps = np.abs(np.diff(values[good]))
        parts = np.split(good, np.flatnonzero(steps > usual * (np.diff(good) + JUMP)) + 1)
        long = np.array([len(part) for part in parts])
        between = np.flatnonzero((long[1:-1] < long[:-2]) & (long[1:-1] < long[2:])) + 1
        if not len(between):
            return np.asarray(np.interp(time, time[good], values[good]))
        del parts[int(between[np.argmin(long[between])])]
        good = np.concatenate(parts)


def released(recording: Recording, above: float | str | None) -> Recording:
    """Return the free swing of a recording with spikes, as :meth:`Recording.released` and :meth:`Recording.kept` do
    without spikes.
    """
    start = calmed(recording).released()
    swing = recording
    if start.release is not None and recording.release is None:
        swing = part_of(recording, recording.time >= start.release, start.notes[-1], start.release,
                        release=start.release)
    shorter = calmed(swing).kept(above=above)
    kept = swing.time <= shorter.time[-1]
    return swing if kept.all() else part_of(swing, kept, shorter.notes[-1])


def pulled(swing: Recording, first: FitSolution) -> Recording:
    """Return a free swing with readings that are pulled towards the robust fit of a model, and with a note on them.

    A least-squares fit of these readings equals the robust fit. The noise is 1.4826 times the median residual, but at
    least that of rounding. ``first`` is the model's fit to the readings without spikes.
    """
    model, values = first.model, first.values
    readings, least = swing.readings, swing.reading_quantum / math.sqrt(12.0)
    shown, moved = model.angles(values)[0], math.inf
    for _ in range(ROUNDS):
        sigma = max(1.4826 * float(np.median(np.abs(readings - shown))), least, 1e-12 * float(np.ptp(readings)))
        if moved < ENOUGH * sigma:
            break
        values = search(SwingResiduals(model, readings), values, FINE, "soft_l1", CORNER * sigma)
        before, shown = shown, model.angles(values)[0]
        moved = float(np.sqrt(np.mean(np.square(shown - before))))
    away = readings - shown
    scaled = 1.0 + np.square(away / (CORNER * sigma))
    target = shown + away / np.sqrt(scaled) / float(np.mean(scaled**-1.5))
    far = np.abs(readings - shown) > OUTLIER * sigma
    worst = in_words(swing, float(np.max(np.abs(readings - shown))))
    note = (f"robust: {np.count_nonzero(far)} readings are more than {OUTLIER:g} standard deviations from the model, "
            f"by up to {worst[0]:.3g} {worst[1]}; soft L1 pulls all readings towards the model by their distance")
    angle = target if not swing.indirect else calmed(swing).angle
    return with_readings(replace(swing, notes=(*swing.notes, note)), target, angle)
