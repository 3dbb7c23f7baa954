"""Results of fits: one model's numbers with standard errors and its scene, and models of one recording compared."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.progress import Progress
from pendulum_env.common.tables import Table
from pendulum_env.lab.fitting.candidates import shapes
from pendulum_env.lab.fitting.errors import Errors, errors_of
from pendulum_env.lab.fitting.intervals import Bootstrap, Interval, bootstrap, place_of, profile, sample, student
from pendulum_env.lab.fitting.model import START, Model, unit_of
from pendulum_env.lab.fitting.shooting import Solution
from pendulum_env.lab.fitting.statistics import (
    FOUND,
    RunsTest,
    bic,
    chi_squared_p,
    correlation_time,
    reading_error,
    runs_test,
)
from pendulum_env.lab.measures import Measurement
from pendulum_env.lab.recording import Recording
from pendulum_env.lab.turning import turning_points
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, number, one_of, several, shown

Array = NDArray[np.float64]

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
class Fit:
    """Least squares of one model to a recording.

    Attributes:
        recording: as fitted: from the release on.
        solution: of the least squares.
        sigma: standard deviation of one reading that the fit was weighted with [rad].
        comparison: with the other models, where several were fitted.
        rest: how much longer the bob was recorded at rest, which was not fitted [s].
    """

    recording: Recording
    solution: Solution
    sigma: float
    comparison: Comparison | None = None
    rest: float = 0.0

    @property
    def model(self) -> Model:
        """The scene and what of it is free."""
        return self.solution.model

    @property
    def damping(self) -> str:
        """The dampings of the model, as ``damping=`` takes them."""
        return self.model.title

    @property
    def names(self) -> tuple[str, ...]:
        """What was fitted, in the order of ``values`` and ``covariance``."""
        return self.model.names

    @property
    def values(self) -> Array:
        """The fitted numbers, an array in the units and the order that ``parameters`` has."""
        return self.solution.values

    @property
    def residual(self) -> Array:
        """Recording minus model [rad], an array at ``recording.time``."""
        return self.solution.residual

    @property
    def rms(self) -> float:
        """Root mean square of the residual [rad]."""
        return float(np.sqrt(np.mean(self.residual**2)))

    @property
    def degrees_of_freedom(self) -> int:
        """Readings less fitted numbers."""
        return len(self.residual) - len(self.values)

    @cached_property
    def noise(self) -> float:
        """Standard deviation of one reading [rad], quantum included, from what sets readings off their neighbours."""
        return reading_error(self.recording.time, self.residual)

    @property
    def chi2(self) -> float:
        """Sum of ``(residual / noise)²``: near ``degrees_of_freedom`` if there is nothing but noise."""
        squares = float(self.residual @ self.residual)
        return squares / self.noise**2 if self.noise > 0.0 else math.inf if squares else 0.0

    @property
    def p_value(self) -> float:
        """Chance of a chi2 at least as large, were the residual independent noise.

        The noise comes from the same readings, so that ``chi2 / degrees_of_freedom`` scatters as if of 0.62 times as
        many degrees of freedom; that is taken into account.
        """
        return chi_squared_p(FOUND * self.chi2, FOUND * self.degrees_of_freedom)

    @cached_property
    def runs(self) -> RunsTest:
        """Are the signs of the residual in random order?"""
        return runs_test(self.residual)

    @cached_property
    def correlation_time(self) -> float:
        """Readings that count as one in the residual's sum of squares."""
        return correlation_time(self.residual)

    @property
    def n_effective(self) -> float:
        """Readings that count as independent: all over ``correlation_time``."""
        return len(self.residual) / self.correlation_time

    @property
    def bic(self) -> float:
        """Bayesian information criterion; see :func:`pendulum_env.lab.fitting.statistics.bic`, and for several fits
        :func:`pendulum_env.lab.fitting.result.common_bic`."""
        return bic(float(self.residual @ self.residual), len(self.residual), len(self.values), self.n_effective)

    @cached_property
    def errors(self) -> Errors:
        """Covariance, its degrees of freedom, and how it was found."""
        return errors_of(self.solution, self.recording.quantum)

    @property
    def how(self) -> str:
        """How the standard errors were made, in a sentence."""
        return self.errors.how

    @property
    def covariance(self) -> Array:
        """Covariance matrix of ``values``, in their units."""
        return self.errors.covariance

    @property
    def correlations(self) -> Array:
        """Correlations of ``values``, each within [-1, 1]; 0 beside a parameter without a finite error."""
        errors = np.sqrt(np.diag(self.covariance))
        product = np.outer(errors, errors)
        with np.errstate(divide="ignore", invalid="ignore"):
            found = np.where(np.isfinite(product) & (product > 0.0), self.covariance / product, 0.0)
        np.fill_diagonal(found, 1.0)
        return np.clip(found, -1.0, 1.0)

    def correlation(self, first: str, second: str) -> float:
        """Correlation of two parameters; RecordingError for names that were not fitted."""
        return float(self.correlations[place_of(self, first), place_of(self, second)])

    def interval(self, name: str, level: float = 0.95) -> Interval:
        """``value ± t error`` with Student's t, cut at the bound of a number that cannot be negative.

        Raises RecordingError for a name that was not fitted.
        """
        return student(self, name, level)

    def profile(self, name: str, level: float = 0.95, progress: Progress | bool = False) -> Interval:
        """The same by the profile of the likelihood: all others are fitted anew at each value that is tried.

        Slower, and right where the sum of squares is no parabola. See
        :func:`pendulum_env.lab.fitting.intervals.profile`. Raises RecordingError for a name that was not fitted.
        """
        return profile(self, name, level, progress)

    def bootstrap(self, n: int = 200, seed: int = 0, progress: Progress | bool = False) -> Bootstrap:
        """Fits to ``n`` recordings made of the model's motion and residuals in another order, in blocks.

        See :func:`pendulum_env.lab.fitting.intervals.bootstrap`. Ctrl-C ends it with what it has, and a warning.
        """
        return bootstrap(self, n, seed, progress)

    def sample(self, n: int, seed: int = 0, *, start: bool = False) -> dict[str, Any]:
        """``n`` scenes as likely as this one, as keywords: ``gym.make_vec("LabPendulum-v0", num_envs=n,
        vectorization_mode="vector_entry_point", **fit.sample(n))``.

        Args:
            start: True adds "angle" and "velocity" at time 0, for ``rollout(**fit.sample(n, start=True))``.

        Returns the scene, and an array of n values for each fitted number of it, from the normal distribution of
        ``covariance`` where no number is below its bound 0. Raises RecordingError where there is no such distribution.
        """
        return sample(self, n, seed, start)

    def against(self, **told: tuple[float, float]) -> dict[str, float]:
        """Fitted numbers less those told otherwise, over the standard deviation of the difference, as in
        ``fit.against(length=(0.65, 0.01))``; see :func:`pendulum_env.lab.fitting.result.against`."""
        return against(self, told)

    @cached_property
    def parameters(self) -> dict[str, Measurement]:
        """Each fitted number with its standard error and unit."""
        errors = np.sqrt(np.diag(self.covariance))
        return {name: Measurement(float(value), float(error), unit_of(self.model.scene, name))
                for name, value, error in zip(self.names, self.values, errors, strict=True)}

    @cached_property
    def scene(self) -> Scene:
        """The scene with the fitted numbers, whose usual run is the recorded one."""
        found = self.model.scene_with(self.values)
        angle, velocity = (self.parameters[name].value for name in START[:2])
        period = math.tau / found.omega0
        duration = float(self.recording.time[-1]) + self.rest
        run = {"angle": angle, "velocity": velocity, "duration": duration, "dt": float(f"{period / 100.0:.2g}")}
        return found.replace(name=f"fitted to {self.recording.source}", run={**found.to_dict()["run"], **run})


# --- models compared -------------------------------------------------------------------------------------------------


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
        head = ("model", "numbers", "rms [deg]", "largest [deg]", "envelope [deg]", "delta BIC", "runs z", "verdict")
        rows = []
        for one, delta, verdict in zip(self.fits, self.delta_bic, self.verdicts, strict=True):
            largest = float(np.max(np.abs(one.residual)))
            degrees = (math.degrees(one.rms), math.degrees(largest), math.degrees(envelope_misfit(one)))
            rows.append((one.damping, str(len(one.names)), *(f"{x:.3g}" for x in degrees), f"{delta:.1f}",
                         f"{one.runs.z:.1f}", verdict))
        return Table(head, tuple(rows))


def common_bic(fits: Sequence[Fit]) -> list[float]:
    """The criterion of several fits to one recording, with one n' for all.

    ``n'`` is that of the fit with the least squares: the residuals of the others hold misfit on top, which is what they
    are to be judged by and would lower the weight of the evidence. Only differences of these numbers mean anything.
    """
    best = min(fits, key=lambda one: float(one.residual @ one.residual))
    return [bic(float(one.residual @ one.residual), len(one.residual), len(one.names), best.n_effective)
            for one in fits]


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
