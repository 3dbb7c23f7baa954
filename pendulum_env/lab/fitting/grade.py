"""Grade of a fit: whether the model follows the recording, what would mend it, and how good the fit is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from pendulum_env.lab.fitting.remedies import Remedy
from pendulum_env.lab.measures import envelope_rate
from pendulum_env.lab.turning import TurningPoints

Array = NDArray[np.float64]

GROWS, DRIVEN = 0.005, 0.05
"""Growth of a swing over an earlier one, as a share of the largest swing, that is mentioned; and growth from which on a
recording is not a free swing."""
STEADY = 5000.0
"""Lowest quality factor at which swings count as steady. Air alone makes that of a laboratory pendulum smaller."""
VISIBLE = 0.05
"""Smallest steady amplitude, as a share of the largest, that counts as driven."""
LASTS = 9
"""Number of successive swings whose median shows the growth that lasts."""
LOST = 0.05
"""Share of the squared angles in readings that the model does not follow, from which on a fit is not usable."""
NOISE_ONLY, EXCESS = 1.3, 2.0
"""Residuals below the first number of errors of a reading are called noise, and from the second on a misfit."""
MISSED = 0.05
"""Root mean square of the residuals, as a share of that of the swing, from which on a misfit makes a fit not usable."""
UNEVEN = 2.0
"""A misfit at the start or at the end is named if it exceeds that of the whole recording by this factor."""


class Fault(NamedTuple):
    """A reason against a fit: a clause that can follow "because"; ``serious`` if the fit is then not usable."""

    text: str
    serious: bool


class Grade(NamedTuple):
    """Grade of a fit: usable without any reason against it or remedy, and not usable with a serious reason.

    Attributes:
        faults: the reasons against the fit.
        follows: sentence on how closely the model follows the recording; "" if that was not judged.
        remedies: sentences on faults of the recording that explain a misfit, with the options that remove them.
    """

    faults: tuple[Fault, ...] = ()
    follows: str = ""
    remedies: tuple[str, ...] = ()

    @property
    def usable(self) -> bool:
        """False if one of the reasons is serious, so that no number of the fit should be used."""
        return not any(fault.serious for fault in self.faults)

    @property
    def conclusive(self) -> bool:
        """True if the fit is usable and no fault of the recording explains a misfit; else models of damping cannot be
        told apart."""
        return self.usable and not self.remedies

    @property
    def word(self) -> str:
        """The grade in a few words: "usable", "usable with exceptions" or "not usable"."""
        if not self.usable:
            return "not usable"
        return "usable with exceptions" if self.faults or self.remedies else "usable"

    @property
    def text(self) -> str:
        """Sentences: whether the model follows the recording, the remedies, and the verdict."""
        return " ".join([*([self.follows] if self.follows else []), *self.remedies, self.verdict])

    @property
    def verdict(self) -> str:
        """Sentence on how good the fit is, with the reasons."""
        reasons = "; ".join(fault.text for fault in self.faults if fault.serious or self.usable)
        if not self.usable:
            return f"The fit is not usable, because {reasons}."
        if reasons:
            return f"The fit is usable, except that {reasons}."
        return "The fit is usable, but better without this fault." if self.remedies else "The fit is usable."


def of_swings(points: TurningPoints, omega: float, damped: bool) -> list[Fault]:
    """Return the signs in a recording's turning points that it is not a free swing: swings that grow or stay equal.

    Args:
        points: turning points about the equilibrium.
        omega: angular frequency of the swings [rad/s].
        damped: True if a free swing must decay; False for a swing in vacuum, or one that is fitted without damping.
    """
    share, when, lasting = growth(points)
    rate = envelope_rate(points)
    faults = []
    if share > GROWS:
        text = (f"the swings grow by {100.0 * share:.3g} % of the largest until {when:.4g} s, which damping cannot "
                "cause: check for a drive, a push, a second release or bad readings")
        steadily = -0.5 * rate.value * float(points.time[-1] - points.time[0])  # growth of the envelope
        faults.append(Fault(text, lasting > DRIVEN or (steadily > DRIVEN and rate.value < -2.0 * rate.error)))
    if not damped or any(fault.serious for fault in faults) or (faults and rate.value < -2.0 * rate.error):
        return faults
    if (quality := steady(points, omega)) > STEADY:
        faults.append(Fault(f"the swings do not decay (their quality factor is above {quality:.2g}): the pendulum is "
                            "driven, or simulated without damping", True))
    elif settled(points):
        end = slice(len(points.time) // 2, None)
        size, since = math.degrees(float(np.median(points.amplitude[end]))), float(points.time[end][0])
        faults.append(Fault(f"the swings settle at {size:.3g} degrees and do not decay after {since:.4g} s, which no "
                            "damping causes: the pendulum is driven", True))
    return faults


def growth(points: TurningPoints) -> tuple[float, float, float]:
    """Return the largest growth of a swing over an earlier one, as a share of the largest swing, its time [s], and the
    largest growth that lasts for several swings.

    Growth by less than 5 standard errors counts as 0. The size of a swing is the sum of two successive amplitudes,
    which an error of the zero does not change. The growth that lasts is that of the median of nine successive
    sizes, which a bad reading does not change.
    """
    size = points.amplitude[1:] + points.amplitude[:-1]
    error = np.hypot(points.error[1:], points.error[:-1])
    gain = _gain(size, error)
    lasting = _gain(median_filter(size, LASTS, mode="nearest"), error) if len(size) > LASTS else gain
    at = int(np.argmax(gain))
    return float(gain[at] / size.max()), float(points.time[at]), float(lasting.max() / size.max())


def _gain(size: Array, error: Array) -> Array:
    """Return the growth of every swing over the smallest one before it; 0 if it is below 5 standard errors."""
    least = np.maximum.accumulate(np.where(size <= np.minimum.accumulate(size), np.arange(len(size)), 0))
    gain = size - size[least]
    return np.where(gain > 5.0 * np.hypot(error, error[least]), gain, 0.0)


def steady(points: TurningPoints, omega: float) -> float:
    """Return the lowest quality factor that agrees with swings of equal size; 0 if they decay."""
    rate, error = _decay(points, slice(None))
    return 0.0 if rate > 2.0 * error else omega / max(rate + 2.0 * error, 2.0 * error, 1e-300)


def settled(points: TurningPoints) -> bool:
    """Return True if swings decay at first, and in the second half much less than any damping can cause.

    The damping rate of no damping falls faster with the amplitude than that of quadratic drag, which is proportional to
    it. The rate in the second half must be below half of what this gives, by two of its errors.
    """
    half = len(points.time) // 2
    if half < 3:
        return False
    (first, its_error), (last, error) = _decay(points, slice(half)), _decay(points, slice(half, None))
    size, end = (float(np.median(points.amplitude[part])) for part in (slice(half), slice(half, None)))
    seen = first > 3.0 * its_error and end > VISIBLE * float(points.amplitude.max())
    return seen and last + 2.0 * error < 0.5 * first * end / size


def _decay(points: TurningPoints, part: slice) -> tuple[float, float]:
    """Return the damping rate of a part of a swing and its error [1/s].

    The error allows for one error of an amplitude that is equal in successive swings, because a coarse sensor rounds
    them in the same way.
    """
    rate, time = envelope_rate(points, part), points.time[part]
    alike = 2.0 * float(np.median(points.error[part] / points.amplitude[part])) / float(time[-1] - time[0])
    return rate.value, math.hypot(rate.error, 2.0 * alike)


def of_lost(damping: str, followed: float, time: Array, swing: Array) -> list[Fault]:
    """Return a list with the stretch at the end of a recording that a model does not follow, if there is one.

    It is serious if the stretch has over 5 % (LOST) of the sum of the squared angles, because readings tell about the
    parameters in proportion to these.

    Args:
        damping: name of the model.
        followed: time up to which the model follows the swings [s].
        time: times of the recording [s].
        swing: angles of the recording about the equilibrium [rad].
    """
    after = time > followed
    if not after.any():
        return []
    share = float(swing[after] @ swing[after]) / max(float(swing @ swing), 1e-300)
    if share > LOST:
        return [Fault(f"the model {damping} follows the recording only until {followed:.4g} s", True)]
    size = math.degrees(float(np.max(np.abs(swing[after]))))
    return [Fault(f"the model {damping} does not follow the readings after {followed:.4g} s, which are within "
                  f"{size:.2g} degrees of the equilibrium", False)]


def of_misfit(
    damping: str, residual: Array, noise: float, swing: float, sign: str, explained: bool
) -> tuple[str, list[Fault]]:
    """Return a sentence on how closely a model follows a recording, and a list with its misfit if there is one.

    A misfit exceeds the error of a reading by a factor of 2 (EXCESS). It is serious if it is over 5 % (MISSED) of the
    swing. The sentence names the start or the end if the misfit is largest there.

    Args:
        damping: name of the model.
        residual: readings minus model, in the unit ``sign``.
        noise: error of a reading, in that unit.
        swing: root mean square of the readings about the equilibrium, in that unit.
        sign: the unit, such as "°".
        explained: True if a fault of the recording explains the misfit.
    """
    rms = float(np.sqrt(np.mean(residual**2)))
    times = f"{_factor(rms / noise)} times the error of a reading ({noise:.2g}{sign})" if noise > 0.0 else (
        "without noise")
    if rms < NOISE_ONLY * noise:
        return (f"The model {damping} follows the recording to within the noise: its residual is {rms:.3g}{sign} rms, "
                f"the error of a reading {noise:.2g}{sign}."), []
    if rms < EXCESS * noise:
        return f"The model {damping} follows the recording: its residual is {rms:.3g}{sign} rms, {times}.", []
    parts = np.array_split(residual, 10)
    first, last = (float(np.sqrt(np.mean(part**2))) for part in (parts[0], parts[-1]))
    where = "".join(f"; in the {name} tenth it is {own:.2g}{sign}" for name, own in (("first", first), ("last", last))
                    if own > UNEVEN * rms)
    if rms > MISSED * swing:
        share = f"{rms / swing:.0%} of" if rms < swing else "more than"
        return (f"The model {damping} does not follow the recording: its residual is {rms:.3g}{sign} rms, {times} and "
                f"{share} the swing{where}.", [Fault("the model does not follow the recording", True)])
    return (f"The model {damping} follows the recording only to {rms:.3g}{sign} rms, {times}{where}.",
            [Fault("the misfit is larger than the noise, which the errors allow for" + (
                "" if explained else ", and no single fault of the recording explains it"), False)])


def _factor(ratio: float) -> str:
    """Return a ratio as text with two digits, without a power of ten."""
    return f"{ratio:.2g}" if ratio < 100.0 else f"{ratio:.0f}"


def of_remedies(remedies: Sequence[Remedy], noise: float = math.inf) -> tuple[str, ...]:
    """Return sentences on the faults that explain a misfit, the one that explains most first, with their options.

    The last one says if they leave a misfit of more than the error of a reading, ``noise``, in its unit.
    """
    sentences = []
    for i, one in enumerate(remedies):
        before, after = ("or ", "; the recording does not tell which") if one.instead else ("besides, " * (i > 0), "")
        first = f"{before}{one.sentence}{after}"
        sentences.append(f"{first[0].upper()}{first[1:]}.")
    left = min((one.left for one in remedies), default=0.0)
    if left > EXCESS * noise > 0.0:
        times = f"{_factor(left / noise)} times the error of a reading"
        sentences.append(f"That leaves {times}, so something else is wrong, too.")
    return tuple(sentences)


def as_fault(left_out: str) -> Fault:
    """Return a sentence on a check that was left out as a reason, which is not serious."""
    return Fault(f"{left_out[0].lower()}{left_out[1:].removesuffix('.')}", False)


def graded(faults: Sequence[Fault], follows: str = "", remedies: tuple[str, ...] = ()) -> Grade:
    """Return the grade for a list of reasons, the serious ones first, and what :func:`of_misfit` and
    :func:`of_remedies` say."""
    return Grade(tuple(sorted(faults, key=lambda fault: not fault.serious)), follows, remedies)
