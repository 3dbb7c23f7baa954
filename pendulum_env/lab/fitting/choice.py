"""Which damping a recording calls for, and what it cannot tell apart."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from pendulum_env.lab.fitting.candidates import shapes
from pendulum_env.lab.fitting.statistics import common_bic
from pendulum_env.lab.measures import Measurement
from pendulum_env.lab.turning import turning_points
from pendulum_env.physics.units import SceneError, number, one_of, several, shown

if TYPE_CHECKING:
    from pendulum_env.common.tables import Table
    from pendulum_env.lab.fitting.result import Fit

ALIKE, RULED_OUT = 6.0, 10.0
"""Differences of the criterion below which models count as alike, and from which as ruled out (Kass & Raftery 1995, J.
Am. Stat. Assoc. 90, 773: "strong" and "very strong" evidence)."""
STRUCTURE = 5.0
"""Standard deviations by which the number of runs in a residual may differ from what independence lets expect."""
EXCESS = 2.0
"""Times the readings' own scatter from which a residual is called a misfit."""
VERDICTS = ((ALIKE, "alike"), (RULED_OUT, "unlikely"), (math.inf, "ruled out"))
NEEDLESS = "needless"
"""Verdict on a model that is as close as the best, or contains it, with more numbers than that is worth."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """Models of one recording, compared by the Bayesian information criterion.

    ``n' ln(RSS/n) + k ln n'`` with the number n' of readings that count as independent, one for all models: that of
    the one with the least squares. So a misfit that lasts through the recording is not counted anew in every reading;
    see :mod:`pendulum_env.lab.fitting.statistics`. Of models of which one contains the other, and that follow alike,
    the simpler is the better.

    When can a recording tell? Where the best fit of the wrong model to what the right one does is off by m (root mean
    square) and a reading by sigma, the difference grows as ``n ln(1 + (m/sigma)²) + dk ln n`` with n independent
    readings and dk more numbers in the wrong model than in the right one: it passes 10 where m is above
    ``sigma sqrt((10 - dk ln n)/n)``. It scatters by twice its root from one recording to the next, so 33 make sure of
    10. A swing of linear damping and its fit by quadratic with Coulomb's differ by 0.004 degrees in 25 s from 34
    degrees at a damping rate of 0.03 1/s; its fits by one of them alone by 0.11 degrees.

    Attributes:
        fits: the best first.
        delta_bic: of each fit, to the best.
    """

    fits: tuple[Fit, ...]
    delta_bic: tuple[float, ...]

    @classmethod
    def of(cls, fits: Sequence[Fit]) -> Comparison:
        """The comparison of fits to one recording."""
        scores = common_bic(fits)
        order = sorted(range(len(fits)), key=lambda i: (fits[i].solution.lost, scores[i]))
        return cls(tuple(fits[i] for i in order), tuple(scores[i] - scores[order[0]] for i in order))

    @property
    def best(self) -> Fit:
        """The first of ``fits``."""
        return self.fits[0]

    @property
    def alike(self) -> tuple[str, ...]:
        """Models that the recording cannot tell from the best: less than 6 behind."""
        return self._judged("alike")

    @property
    def unlikely(self) -> tuple[str, ...]:
        """Models from 6 to 10 behind the best."""
        return self._judged("unlikely")

    @property
    def ruled_out(self) -> tuple[str, ...]:
        """Models 10 or more behind the best, and those that do not follow the swings; not the ``needless`` ones."""
        return self._judged("ruled out")

    @property
    def needless(self) -> tuple[str, ...]:
        """Models 6 or more behind that are as close, or have the best's dampings and more: with numbers that nothing
        calls for."""
        return self._judged(NEEDLESS)

    def __getitem__(self, name: str) -> Fit:
        """The fit of a model; SceneError for one that was not compared."""
        names = [found.damping for found in self.fits]
        return self.fits[names.index(one_of(name, "compared model", names))]

    def _judged(self, verdict: str) -> tuple[str, ...]:
        return tuple(found.damping for found, said in zip(self.fits[1:], self.verdicts[1:], strict=True)
                     if said == verdict)

    @cached_property
    def verdicts(self) -> tuple[str, ...]:
        """"best", "alike", "unlikely", "ruled out" or "needless", of each fit."""
        own = set(self.best.model.damping)
        found = []
        for one, delta in zip(self.fits, self.delta_bic, strict=True):
            word = next(word for limit, word in VERDICTS if delta < limit or limit == math.inf)
            more = delta >= ALIKE and (own < set(one.model.damping) or one.rms <= self.best.rms)
            found.append(VERDICTS[-1][1] if one.solution.lost else NEEDLESS if more else word)
        return ("best", *found[1:])

    def spread(self, name: str) -> float:
        """How far models that cannot be told from the best put a parameter from the best's value, at most.

        0 where no such model has it. SceneError for a name that the best model has not fitted.
        """
        value = self.best.parameters[one_of(name, "fitted parameter", self.best.names)].value
        values = [self[model].parameters[name].value for model in self.alike if name in self[model].names]
        return max((abs(other - value) for other in values), default=0.0)

    def measured(self, name: str) -> Measurement:
        """The best model's value with the model's uncertainty in its error: ``sqrt(error² + spread²)``.

        Raises SceneError for a name that was not fitted.
        """
        own = self.best.parameters[one_of(name, "fitted parameter", self.best.names)]
        return Measurement(own.value, math.hypot(own.error, self.spread(name)), own.unit)

    @property
    def text(self) -> str:
        """What the recording calls for, what it cannot tell apart, what it rules out, in sentences."""
        return " ".join(self._sentences())

    def _sentences(self) -> list[str]:
        best = self.best
        if best.solution.lost:
            return [f"No model follows all swings; the closest is {_called(best.damping)}, {_rms(best)}."]
        if len(self.fits) == 1:
            return [f"{_called(best.damping)} is the only model compared, {_rms(best)}.", *self._structure()]
        said = [f"The recording calls for {_called(best.damping)}, {_rms(best)}."]
        if self.alike:
            said.append(f"It cannot tell {_listed(self.alike)} from it.")
        if self.unlikely:
            said.append(f"Unlikely: {_listed(self.unlikely)}.")
        if self.ruled_out:
            out = [f"{name} (" + ("does not follow the swings" if self[name].solution.lost else
                                  f"{math.degrees(self[name].rms):.3g} degrees") + ")" for name in self.ruled_out]
            said.append(f"It rules out {_listed(out)}.")
        if self.needless:
            said.append(f"As close, with more numbers than it calls for: {_listed(self.needless)}.")
        used = {name for found in self.fits for name in found.model.damping}
        for first, names in shapes().items():
            if len(names) > 1 and used & set(names):
                said.append(f"The dampings {_listed(names)} have the same torque: no recording tells them apart, and "
                            f"{first} stands for all of them.")
        return said + self._structure()

    def _structure(self) -> list[str]:
        """That even the best model leaves something, if it does."""
        best = self.best
        excess = math.sqrt(best.chi2 / best.degrees_of_freedom)
        if excess < EXCESS and abs(best.runs.z) < STRUCTURE:
            return []
        return [f"No model follows it to its noise: {best.damping} leaves {math.degrees(best.rms):.3g} degrees where a "
                f"reading is good to {math.degrees(best.noise):.2g} (runs test: z = {best.runs.z:.3g})."]

    @property
    def table(self) -> Table:
        """A row for each model, the best first."""
        from pendulum_env.common.tables import Table

        head = ("model", "numbers", "rms [deg]", "largest [deg]", "envelope [deg]", "delta BIC", "runs z", "verdict")
        rows = []
        for one, delta, verdict in zip(self.fits, self.delta_bic, self.verdicts, strict=True):
            largest = float(np.max(np.abs(one.residual)))
            degrees = (math.degrees(one.rms), math.degrees(largest), math.degrees(envelope_misfit(one)))
            rows.append((one.damping, str(len(one.names)), *(f"{x:.3g}" for x in degrees), f"{delta:.1f}",
                         f"{one.runs.z:.1f}", verdict))
        return Table(head, tuple(rows))


def envelope_misfit(fit: Fit) -> float:
    """Largest difference of amplitude at a turning point, recording minus model [rad].

    The residual's mean over a sixth of the half swing about each turning point of the recording, so noise counts
    little.
    """
    points = turning_points(fit.recording)
    if len(points.time) < 2:
        return float(np.max(np.abs(fit.residual)))
    reach = float(np.median(np.diff(points.time))) / 12.0
    ends = np.searchsorted(fit.recording.time, [points.time - reach, points.time + reach])
    means = [abs(float(np.mean(fit.residual[first:last]))) for first, last in ends.T if last > first]
    return max(means, default=0.0)


def measured(fit: Fit, name: str) -> Measurement:
    """A fitted number with the model's uncertainty in its error, where models were compared."""
    return fit.parameters[name] if fit.comparison is None else fit.comparison.measured(name)


def against(fit: Fit, told: Mapping[str, tuple[float, float]]) -> dict[str, float]:
    """Fitted numbers less those told otherwise, in standard deviations of the difference.

    ``(fitted - told) / sqrt(error² + spread² + told error²)``.

    Args:
        told: value and standard error by name, in the parameter's unit, such as ``{"length": (0.65, 0.01)}``.

    Raises SceneError for a name that was not fitted, and for what is no value with an error.
    """
    found = {}
    for name, pair in told.items():
        one_of(name, "fitted parameter", fit.names)
        own = measured(fit, name)
        both = several(pair, name, "a value and its standard error")
        if len(both) != 2:
            raise SceneError(f"{name} must be a value and its standard error, not {shown(pair)}.")
        value = number(both[0], name, unit=own.unit)
        error = number(both[1], f"{name}'s error", above=0.0, unit=own.unit)
        found[name] = (own.value - value) / math.hypot(own.error, error)
    return found


def _called(damping: str) -> str:
    return damping.replace("+", " and ") if damping != "none" else "no damping"


def _rms(found: Fit) -> str:
    return f"which leaves {math.degrees(found.rms):.3g} degrees (root mean square)"


def _listed(words: Sequence[str]) -> str:
    """Words joined by commas and a last "and"."""
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
