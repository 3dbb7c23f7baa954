"""Robust fits: single readings that are far off count less, by the soft L1 loss.

The loss of a residual r with the standard deviation sigma is ``2 c² (sqrt(1 + (r/(c sigma))²) - 1)``, close to ``r²``
for small residuals and to ``|r|`` for large ones. With c = 1.345, Gaussian readings are used with 95 % of the
efficiency of least squares (Huber 1981, Robust Statistics). The readings are then pulled towards the model, to
``model + psi(r) / mean(psi')`` with the derivative ``psi`` of the loss: least squares of these has the parameters of
the robust fit, and its usual formulas give their standard errors (Bickel 1976, Scand. J. Stat. 3, 145; Street, Carroll
& Ruppert 1988, Am. Stat. 42, 152).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.ndimage import median_filter

from pendulum_env.lab.fitting.core import search
from pendulum_env.lab.fitting.model import Array
from pendulum_env.lab.fitting.shooting import FINE, FitSolution, SwingResiduals
from pendulum_env.lab.recording import Recording, in_words, part_of, with_readings

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
