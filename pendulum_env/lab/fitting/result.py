"""Results of fits: the parameters of one model with standard errors and its scene, and a comparison of several models.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.progress import Progress
from pendulum_env.common.provenance import provenance
from pendulum_env.common.results import Column, Columns, columns_of, one_line
from pendulum_env.common.texts import Table, clean
from pendulum_env.lab.checked import RecordingError, side
from pendulum_env.lab.fitting.base import FitResult
from pendulum_env.lab.fitting.candidates import shapes
from pendulum_env.lab.fitting.errors import Errors, errors_of, noise_beside
from pendulum_env.lab.fitting.grade import EXCESS, Fault, Grade, as_fault, graded, of_lost, of_misfit, of_remedies
from pendulum_env.lab.fitting.intervals import (
    Bootstrap,
    Interval,
    Scatter,
    bootstrap,
    profile,
    sample,
    scatter_of,
)
from pendulum_env.lab.fitting.model import SCALE, START, ZERO, Model, unit_of
from pendulum_env.lab.fitting.posterior import Posterior, posterior
from pendulum_env.lab.fitting.remedies import NUMERICAL, OUTLIERS, Remedy
from pendulum_env.lab.fitting.shooting import FitSolution
from pendulum_env.lab.fitting.statistics import (
    DEPENDENT,
    FOUND,
    RunsTest,
    bic,
    chi_squared_p,
    correlation_time,
    reading_error,
    runs_test,
)
from pendulum_env.lab.measures import Measurement
from pendulum_env.lab.noise import scatter_level
from pendulum_env.lab.recording import Recording, in_words
from pendulum_env.lab.turning import turning_points
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.sensor import Sensor
from pendulum_env.physics.units import SceneError, number, one_of, several, shown

Array = NDArray[np.float64]

ALIKE, RULED_OUT = 6.0, 10.0
"""Models count as alike if their information criteria differ by less than the first value, and a model is ruled out
from the second on (Kass & Raftery 1995, J. Am. Stat. Assoc. 90, 773: "strong" and "very strong" evidence)."""
VERDICTS = ((ALIKE, "alike"), (RULED_OUT, "unlikely"), (math.inf, "ruled out"))
"""Upper limit of the difference to the best model's criterion, and the verdict on a model below this limit."""
SMALLEST = 1e-6
"""Smallest probability p that is shown as a number."""
NEEDLESS = "needless"
"""Verdict on a model that fits as closely as the best or contains it, but has more parameters than this justifies."""


@dataclass(frozen=True, eq=False, repr=False)
class Fit(FitResult):
    """Least-squares fit of one model to a recording.

    Attributes:
        recording: the fitted recording, from the release on.
        solution: parameters, residuals and derivatives of the least-squares fit.
        sigma: standard deviation of one reading, used as weight of the fit [rad].
        comparison: comparison with the other models; None if only one was fitted.
        rest: duration of the rest at the end of the recording that was not fitted [s].
        faults: signs that the recording is not a free swing, which are part of the ``grade``.
        remedies: faults of the recording that explain a misfit, the one that explains most first, each with a
            sentence, its option and its size; see :class:`pendulum_env.lab.fitting.remedies.Remedy`.
        subtracted: jumps of the zero that were subtracted from the recording before this fit.
    """

    recording: Recording
    solution: FitSolution
    sigma: float
    comparison: FitComparison | None = None
    rest: float = 0.0
    faults: tuple[Fault, ...] = ()
    remedies: tuple[Remedy, ...] = ()
    subtracted: tuple[Remedy, ...] = ()

    def __repr__(self) -> str:
        return one_line(self, f"{self.recording.source}, {self.damping} damping, rms {self.rms:.2g} "
                              f"{self.recording.unit}")

    @property
    def degrees(self) -> str:
        """Unit of residuals in texts and figures: "degrees"; "degrees/s" for gyroscopes, "m/s²" for accelerometers."""
        return in_words(self.recording, 0.0)[1]

    @property
    def sign(self) -> str:
        """Short form of the unit ``degrees``: "°", "°/s" or " m/s²", with the space before it."""
        return {"degrees": "°", "degrees/s": "°/s"}.get(self.degrees, f" {self.degrees}")

    def shown(self, residual: float) -> float:
        """Return a residual in the unit ``degrees``."""
        return in_words(self.recording, residual)[0]

    @property
    def swing(self) -> Array:
        """The recorded angle about the equilibrium [rad], an array; for a gyroscope the integral of its readings, for
        an accelerometer an estimate from them."""
        zero = 0.0 if self.recording.indirect else self.values[self.names.index(ZERO)]
        return np.asarray(self.recording.angle - zero)

    def motion(self, time: Array) -> tuple[Array, Array]:
        """Return the angle about the equilibrium [rad], as the sensor shows it, and the velocity [rad/s] of the model.

        ``time`` is an array of times since the release [s]; angle and velocity are arrays at these times.
        """
        values = np.where([name == ZERO for name in self.names], 0.0, self.values)
        angle, velocity = replace(self.model, time=time, rate=False, mount=None).motion(values)
        return angle[0], velocity[0]

    @cached_property
    def units(self) -> dict[str, str]:
        """Units of the fitted parameters by name."""
        return {name: self.recording.unit if name == ZERO else unit_of(self.model.scene, name) for name in self.names}

    @property
    def model(self) -> Model:
        """The fitted model: the scene and the names of its fitted parameters."""
        return self.solution.model

    @property
    def damping(self) -> str:
        """The dampings of the model, joined by "+" as in ``damping=``."""
        return self.model.title

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the fitted parameters, in the order of ``values`` and ``covariance``."""
        return self.model.names

    @property
    def values(self) -> Array:
        """Values of the fitted parameters, an array in the order of ``names``, in the units of ``parameters``."""
        return self.solution.values

    @property
    def residual(self) -> Array:
        """Recording minus model [rad], an array at ``recording.time``."""
        return self.solution.residual

    @property
    def degrees_of_freedom(self) -> int:
        """Degrees of freedom: the number of readings minus the number of fitted parameters."""
        return len(self.residual) - len(self.values)

    @cached_property
    def noise(self) -> float:
        """Standard deviation of one reading [rad], rounding included, from its scatter about neighbouring readings.

        It is at least that of a rounding error, quantum / sqrt(12), which neighbours that are rounded alike do not
        show.
        """
        quantum = self.recording.reading_quantum
        if not quantum:
            return reading_error(self.recording.time, self.residual)
        return math.hypot(noise_beside(self.recording.time, self.residual, quantum), quantum / math.sqrt(12.0))

    @property
    def _usual_noise(self) -> float:
        """Standard deviation of most readings [rad], which a few that are far off do not enlarge as they do ``noise``;
        at least the error of the simulated model."""
        seen = float(np.fmin(self.noise, scatter_level(self.recording.time, self.residual)))
        rounding, range_of = self.recording.reading_quantum / math.sqrt(12.0), float(np.ptp(self.recording.readings))
        return max(seen, rounding, NUMERICAL * range_of)

    @cached_property
    def rounded_alike(self) -> bool:
        """True if the readings scatter by less than half the sensor's step, so that neighbours are rounded alike."""
        quantum = self.recording.reading_quantum
        return noise_beside(self.recording.time, self.residual, quantum) < 0.5 * quantum

    @property
    def chi2(self) -> float:
        """Chi-squared, the sum of ``(residual / noise)²``; near ``degrees_of_freedom`` if residuals are only noise."""
        squares = float(self.residual @ self.residual)
        return squares / self.noise**2 if self.noise > 0.0 else math.inf if squares else 0.0

    @property
    def p_value(self) -> float:
        """Probability of a chi2 at least as large if the residuals are independent noise.

        The noise is estimated from the same readings. Therefore ``chi2 / degrees_of_freedom`` scatters like that of
        0.62 times as many degrees of freedom, which is taken into account. If neighbouring readings are rounded alike,
        the degrees of freedom are divided by ``correlation_time`` instead.
        """
        share = 1.0 / self.correlation_time if self.rounded_alike else FOUND
        return chi_squared_p(share * self.chi2, share * self.degrees_of_freedom)

    @cached_property
    def runs(self) -> RunsTest:
        """Runs test, which shows whether the signs of the residuals are in random order."""
        return runs_test(self.residual)

    @cached_property
    def correlation_time(self) -> float:
        """Correlation time of the residuals: the number of readings that count as one independent reading."""
        return correlation_time(self.residual)

    @property
    def n_effective(self) -> float:
        """Number of independent readings: all readings divided by ``correlation_time``."""
        return len(self.residual) / self.correlation_time

    @property
    def bic(self) -> float:
        """Bayesian information criterion of this fit; see :func:`pendulum_env.lab.fitting.statistics.bic`.

        To compare several fits, use :func:`pendulum_env.lab.fitting.result.common_bic`.
        """
        return bic(float(self.residual @ self.residual), len(self.residual), len(self.values), self.n_effective)

    @cached_property
    def errors(self) -> Errors:
        """Covariance matrix of the parameters, its degrees of freedom, and the method of its calculation.

        The sizes of jumps that were subtracted count as fitted, too."""
        jumps = [at for one in self.subtracted for at in np.flatnonzero(np.diff(one.change)).tolist()]
        steps = (np.arange(len(self.residual))[:, None] > jumps).astype(np.float64) if jumps else None
        return errors_of(self.solution, self.recording.readings, self.recording.reading_quantum, steps)

    @cached_property
    def grade(self) -> Grade:
        """Grade of the fit: whether the model follows, the ``remedies``, and usable or not, with the reasons; see its
        ``text``."""
        unit, size = self.shown(1.0), float(np.std(self.recording.readings - self.residual))
        single = sum((one.change for one in self.remedies if one.name == OUTLIERS), np.zeros(len(self.residual)))
        rms = (self.residual - single) * math.sqrt(len(self.residual) / self.degrees_of_freedom)
        found, left_out = side("the noise of the readings", lambda: (
            of_misfit(self.damping, unit * rms, unit * self._usual_noise, unit * size, self.sign, bool(self.remedies)),
            of_remedies(self.remedies, self._usual_noise)))
        (follows, misfit), remedies = found or (("", [as_fault(left_out)]), of_remedies(self.remedies))
        lost = of_lost(self.damping, self.solution.followed, self.recording.time, self.swing)
        serious = any(fault.serious for fault in (*self.faults, *lost))  # which says more than the size of the misfit
        return graded([*self.faults, *lost, *([] if serious else misfit)],
                      " ".join([follows, *of_remedies(self.subtracted)]).strip(), remedies)

    @property
    def how(self) -> str:
        """Sentence on how the standard errors were calculated."""
        return self.errors.how

    @property
    def covariance(self) -> Array:
        """Covariance matrix of the fitted parameters, in the order and the units of ``values``."""
        return self.errors.covariance

    @property
    def freedom(self) -> float:
        """Degrees of freedom of Student's t for intervals."""
        return self.errors.freedom

    @property
    def least(self) -> Array:
        """Lower bounds of the fitted parameters, an array: 0, but -inf for start, zero and tilt of the sensor."""
        return self.model.least

    def profile(self, name: str, level: float = 0.95, progress: Progress | bool | None = None) -> Interval:
        """Return the profile-likelihood interval of a parameter; all other parameters are fitted anew at every trial
        value.

        Slower than :meth:`interval`, but valid if the sum of squares is not a parabola. See
        :func:`pendulum_env.lab.fitting.intervals.profile`. Raises RecordingError for a name that was not fitted,
        SceneError for a level that is not between 0 and 1.
        """
        return profile(self, name, level, progress)

    def bootstrap(self, n: int = 200, seed: int = 0, progress: Progress | bool | None = None) -> Bootstrap:
        """Refit the model to ``n`` simulated recordings: its motion plus blocks of its residuals in random order.

        See :func:`pendulum_env.lab.fitting.intervals.bootstrap`. Ctrl-C returns the refits done so far, with a warning.
        """
        return bootstrap(self, n, seed, progress)

    @property
    def scatter(self) -> Scatter:
        """Distribution of the scene's parameters for ``gym.make(..., scene=fit.scene, randomize=fit)``: normal draws
        with the fit's covariance. Raises RecordingError if a parameter has no finite error.
        """
        return scatter_of(self, self.covariance)

    @property
    def sensor(self) -> Sensor:
        """The recording's sensor, for ``gym.make(..., sensor=found.sensor)``: its quantum and its noise without
        rounding [rad], its rate [Hz] and, if it was fitted, its scale.

        The zero of the recording is left out, as a sensor in use is set to 0 at the bottom.
        ``dataclasses.replace(found.sensor, rate=None)`` reads once before each observation.

        With ``dt=1/found.sensor.rate`` the environment reads once in each control step, as its rate must.

        Raises RecordingError for gyroscopes and accelerometers, which read no angles.
        """
        if self.recording.indirect:
            raise RecordingError(f"{self.recording.source}: the sensor reads {self.recording.unit}, not angles, so "
                                 "that no Sensor describes it")
        quantum = self.recording.reading_quantum or 0.0
        noise = math.sqrt(max(0.0, self.noise**2 - quantum**2 / 12.0))
        scale = float(self.values[self.names.index(SCALE)]) if SCALE in self.names else 1.0
        rate = float(1.0 / np.median(np.diff(self.recording.time)))
        return Sensor(quantum=quantum, noise=noise, rate=rate, scale=scale)

    def sample(self, n: int, seed: int = 0, *, start: bool = False) -> dict[str, Any]:
        """Draw ``n`` random scenes that agree with this fit, as keywords: ``gym.make_vec("LabPendulum-v0", num_envs=n,
        vectorization_mode="vector_entry_point", **fit.sample(n))``.

        Args:
            n: number of scenes.
            seed: seed of the random draws, a whole number from 0.
            start: True adds "angle" and "velocity" at time 0, for ``rollout(**fit.sample(n, start=True))``.

        Returns the scene, and an array of n values for every fitted parameter of the scene, from the normal
        distribution with ``covariance``, without values below a bound of 0. Raises RecordingError if a parameter has no
        finite error, or if hardly any draw is within the bounds.
        """
        return sample(self, n, seed, start)

    def posterior(
        self,
        walkers: int = 32,
        steps: int = 1500,
        seed: int = 0,
        priors: Mapping[str, Any] | None = None,
        progress: Progress | bool | None = None,
    ) -> Posterior:
        """Sample the posterior distribution of the parameters with emcee (``pip install "lab-pendulum[posterior]"``).

        The log likelihood is that of the fit, ``-n/2 ln(sum of squares)``: normal errors of the readings, with their
        standard deviation sigma integrated out with the prior 1/sigma. It is wider where the standard errors allow for
        slow changes of the residuals or rounding; see :class:`pendulum_env.lab.fitting.priors.LogDensity`. Start and
        zero are sampled with the other parameters. The walkers start around the fit.

        Args:
            walkers: number of chains that move together, at least twice the number of parameters.
            steps: number of steps of every walker.
            seed: seed of the random numbers, a whole number from 0; equal seeds give equal samples.
            priors: dict of a parameter's name, such as "length" or "gamma", to ``(low, high)`` for a flat prior,
                ``("log", low, high)`` for one flat in the logarithm, or ``("normal", mean, error)``. By default all
                priors are flat: above 0, but for the start and the zero without bound.
            progress: True shows a progress bar, False none; by default a notebook shows one for work over 1.5 s.

        Ctrl-C ends the sampling and returns the steps done so far, with a warning. Warns if the chain is too short.
        Raises RecordingError if emcee is missing, if the fit is not usable, and for a parameter without a finite error
        and without a prior range; SceneError for invalid values.
        """
        return posterior(self, walkers, steps, seed, priors, progress)

    def against(self, **told: tuple[float, float]) -> dict[str, float]:
        """Compare fitted parameters with independently measured values, as in ``fit.against(length=(0.65, 0.01))``.

        Returns fitted minus measured value in standard deviations of the difference; see
        :func:`pendulum_env.lab.fitting.result.against`.
        """
        return against(self, told)

    @cached_property
    def scene(self) -> Scene:
        """The scene with the fitted parameters; its default run starts and lasts as the recording."""
        scene = self.model.scene_with(self.values)
        angle, velocity = (self.parameters[name].value for name in START[:2])
        period = math.tau / scene.omega0
        duration = float(self.recording.time[-1]) + self.rest
        run = {"angle": angle, "velocity": velocity, "duration": duration, "dt": float(f"{period / 100.0:.2g}")}
        return scene.replace(name=clean(f"fitted to {self.recording.source}"), run={**scene.to_dict()["run"], **run})

    @property
    def source(self) -> str:
        """Name of the recording."""
        return self.recording.source

    @property
    def text(self) -> str:
        """The result in a few sentences: whether the model follows the recording and what may be wrong with that, and
        what it tells about the damping, if models were compared and the fit is good enough to judge them."""
        damping = self.comparison.verdict if self.comparison is not None and self.grade.conclusive else ""
        return "\n".join(filter(None, (self.grade.text, damping)))

    @property
    def details(self) -> str:
        """Sentences on what the result is based on: chi², whether the residual has a pattern, and how the standard
        errors were calculated."""
        order = "as often as by chance" if self.runs.p >= DEPENDENT else (
            "more often than by chance, as rounding can make it" if self.runs.z > 0.0 else
            "less often than by chance, as neighbouring readings are rounded alike"
            if self.rounded_alike and self.rms < EXCESS * self.noise else
            "less often than by chance: it has a pattern, which this model does not explain")
        return "\n".join((
            f"{self.damping} damping: residual {self.shown(self.rms):.3g}{self.sign} rms, the error of a reading is "
            f"{self.shown(self.noise):.2g}{self.sign}; chi² = {self.chi2:.5g} with {self.degrees_of_freedom} degrees "
            f"of freedom, {_chance(self.p_value)}.",
            f"The residual changes its sign {order} (runs test, {_chance(self.runs.p)}).",
            self.how, *(() if self.comparison is None else self.comparison.alike_by_shape)))

    def spreads(self) -> dict[str, float]:
        """Return, by name, the spread of the parameters over all models that fit about as well; {} without others."""
        return {} if self.comparison is None else {name: self.comparison.spread(name) for name in self.names}

    def origin(self, **more: Any) -> dict[str, str]:
        """Return recording, damping, grade, scene and versions, which are written into output files."""
        return provenance(recording=self.source, notes=list(self.recording.notes), damping=self.damping,
                          grade=self.grade.text, scene=self.scene.to_dict(), **more)

    def tables(self) -> dict[str, Columns]:
        """Return the tables of the fit: parameters; time, reading, model and residual; models compared."""
        swing, spreads = self.recording, self.spreads()
        unit = swing.unit.replace("/", "_per_").replace("^", "")
        columns = {"recorded": swing.readings, "model": swing.readings - self.residual, "residual": self.residual}
        found: dict[str, Columns] = {
            "parameters": self.parameter_columns({}, {"other_models": Column([*spreads.values()] or [""] * len(
                self.names))}),
            "residuals": {"time_s": Column(swing.time.tolist(), "s"), **{
                f"{name}_{unit}": Column(values.tolist(), swing.unit) for name, values in columns.items()}}}
        if self.comparison is not None:
            table = self.comparison.table
            found["models"] = columns_of(dict.fromkeys(table.head, ""), table.rows)
        return found


# --- models compared -------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class FitComparison:
    """Comparison of several models of one recording by the Bayesian information criterion.

    The criterion is ``n' ln(RSS/n) + k ln n'``. The number n' of independent readings is that of the model with the
    smallest sum of squares RSS and is used for all models, so a misfit that lasts through the recording does not count
    as new evidence in every reading; see :mod:`pendulum_env.lab.fitting.statistics`. If one model contains another and
    both fit equally well, the simpler one is better.

    When can a recording distinguish two models? Let the best fit of the wrong model to the right model's motion be off
    by m (root mean square), and let a reading have the error sigma. With n independent readings, and dk more parameters
    in the wrong model than in the right one, the criteria differ by about ``n ln(1 + (m/sigma)²) + dk ln n``, which
    exceeds 10 if m is above ``sigma sqrt((10 - dk ln n)/n)``. From one recording to the next, the difference scatters
    by twice its square root, so an expected difference of 33 makes sure of 10. For example, take a swing with linear
    damping of rate 0.03 1/s, 25 s long, from 34 degrees: its fit by quadratic plus Coulomb damping is off by 0.004
    degrees, its fit by one of the two alone by 0.11 degrees.

    Attributes:
        fits: the fits of all models, the best first.
        delta_bic: difference of every fit's criterion from that of the best.
    """

    fits: tuple[Fit, ...]
    delta_bic: tuple[float, ...]

    @classmethod
    def of(cls, fits: Sequence[Fit]) -> FitComparison:
        """Compare several fits to one recording and sort them, the best first."""
        scores = common_bic(fits)
        order = sorted(range(len(fits)), key=lambda i: scores[i])
        return cls(tuple(fits[i] for i in order), tuple(scores[i] - scores[order[0]] for i in order))

    @property
    def best(self) -> Fit:
        """The fit of the best model, the first of ``fits``."""
        return self.fits[0]

    @property
    def alike(self) -> tuple[str, ...]:
        """Names of the models that the recording cannot distinguish from the best: Bayesian information criterion less
        than 6 above the best one's.
        """
        return self._judged("alike")

    @property
    def drawn(self) -> tuple[Fit, ...]:
        """Fits to look at: those whose criterion is less than 10 above the best one's, and the closest of the models
        that are ruled out.
        """
        out = self.verdicts.index(VERDICTS[-1][1]) if self.ruled_out else 0
        return tuple(fit for i, fit in enumerate(self.fits) if self.delta_bic[i] < RULED_OUT or i == out)

    @property
    def unlikely(self) -> tuple[str, ...]:
        """Names of the unlikely models: Bayesian information criterion from 6 to 10 above that of the best model."""
        return self._judged("unlikely")

    @property
    def ruled_out(self) -> tuple[str, ...]:
        """Names of the models that are ruled out: Bayesian information criterion 10 or more above the best one's.
        Models with unnecessary parameters, ``needless``, are not among them.
        """
        return self._judged("ruled out")

    @property
    def needless(self) -> tuple[str, ...]:
        """Names of the models with unnecessary parameters: Bayesian information criterion 6 or more above the best
        one's, although they fit as closely or have the best model's dampings and more.
        """
        return self._judged(NEEDLESS)

    def __getitem__(self, name: str) -> Fit:
        """Return the fit of the model with a given name, such as "linear+quadratic"; SceneError for any other name."""
        names = [fit.damping for fit in self.fits]
        return self.fits[names.index(one_of(name, "compared model", names))]

    def _judged(self, verdict: str) -> tuple[str, ...]:
        """Return the names of all compared models but the best that have a given verdict, such as "unlikely"."""
        return tuple(fit.damping for fit, own in zip(self.fits[1:], self.verdicts[1:], strict=True)
                     if own == verdict)

    @cached_property
    def verdicts(self) -> tuple[str, ...]:
        """Verdict on every fit, in their order: "best", "alike" (cannot be distinguished from the best), "unlikely",
        "ruled out" or "needless" (has unnecessary parameters).
        """
        own = set(self.best.model.damping)
        verdicts = []
        for one, delta in zip(self.fits, self.delta_bic, strict=True):
            word = next(word for limit, word in VERDICTS if delta < limit or limit == math.inf)
            more = delta >= ALIKE and (own < set(one.model.damping) or one.rms <= self.best.rms)
            verdicts.append(NEEDLESS if more else word)
        return ("best", *verdicts[1:])

    def spread(self, name: str) -> float:
        """Return the largest difference of a parameter, in its unit, between the best model and the models ``alike``,
        which the recording cannot distinguish from it.

        The result is 0 if no model in ``alike`` has the parameter. Raises SceneError for a name that the best model
        does not fit.
        """
        value = self.best.parameters[one_of(name, "fitted parameter", self.best.names)].value
        values = [self[model].parameters[name].value for model in self.alike if name in self[model].names]
        return max((abs(other - value) for other in values), default=0.0)

    def measured(self, name: str) -> Measurement:
        """Return the best model's value of a parameter, with an error that includes differences between models.

        The error is ``sqrt(error² + spread²)``; see :meth:`spread`. Raises SceneError for a name that was not fitted.
        """
        own = self.best.parameters[one_of(name, "fitted parameter", self.best.names)]
        return Measurement(own.value, math.hypot(own.error, self.spread(name)), own.unit)

    @property
    def text(self) -> str:
        """Summary in sentences: the grade of the best fit, the ``verdict``, and dampings that no recording can tell
        apart. If the fit is not usable, or a fault of the recording explains a misfit, the grade alone: the misfit then
        decides which model fits best, not the damping.
        """
        grade = self.best.grade
        return " ".join([grade.text, *((self.verdict, *self.alike_by_shape) if grade.conclusive else ())])

    @property
    def verdict(self) -> str:
        """A sentence on the damping: the best model, and which others the recording can and cannot tell from it."""
        models = {one.damping: one.damping.replace("+", " + ").replace("none", "no damping") for one in self.fits}
        best = self.best.damping
        if len(models) == 1:
            return f"Damping: {models[best]}; no other model was fitted."
        close = [{*name.split("+")} for name in (best, *self.alike)]
        worse = {word: [models[name] for name in names if not any(fewer < {*name.split("+")} for fewer in close)]
                 for word, names in (("unlikely are", self.unlikely), ("it rules out", self.ruled_out))}
        return (f"Damping: {models[best]} fits best" + "".join(
            f"; {words} {_listed(names)}" for words, names in (
                ("the recording cannot tell it from", [models[name] for name in self.alike]), *worse.items()) if names)
            + ".")

    @property
    def alike_by_shape(self) -> tuple[str, ...]:
        """Sentences on dampings among the models whose torques have the shape of others' torques."""
        used = {name for fit in self.fits for name in fit.model.damping}
        return tuple(f"The dampings {_listed(names)} have torques of the same shape, so no recording can tell them "
                     f"apart; {first} stands for all of them."
                     for first, names in shapes().items() if len(names) > 1 and used & set(names))

    @property
    def table(self) -> Table:
        """Table of the compared models, one row each, the best first: residuals, the largest one at a turning point,
        information criterion, whether the residuals have a pattern (runs test), verdict.

        The table has no verdicts if not even the best fit is usable, or if a fault of the recording explains a misfit.
        """
        unit = self.best.degrees.replace("degrees", "deg")
        head = ("model", "parameters", f"rms [{unit}]", f"largest [{unit}]", "at turning points [deg]", "delta BIC",
                "pattern", "verdict")
        rows = []
        for one, delta, verdict in zip(self.fits, self.delta_bic, self.verdicts, strict=True):
            largest = float(np.max(np.abs(one.residual)))
            beside, _ = side("envelope", lambda one=one: envelope_misfit(one))  # type: ignore[misc]
            degrees = (one.shown(one.rms), one.shown(largest), math.nan if beside is None else math.degrees(beside))
            rows.append((one.damping, str(len(one.names)), *(f"{x:.3g}" if math.isfinite(x) else "-" for x in degrees),
                         f"{delta:.1f}", "no" if one.runs.p >= DEPENDENT else "yes", verdict))
        columns = len(head) if self.best.grade.conclusive else -1
        return Table(head[:columns], tuple(row[:columns] for row in rows))


def common_bic(fits: Sequence[Fit]) -> list[float]:
    """Return the Bayesian information criteria of several fits to one recording, with one number n' of independent
    readings.

    ``n'`` is that of the fit with the smallest sum of squares. The residuals of the other fits also contain misfit,
    which is correlated and would lower the weight of the evidence against them. Only differences of the criteria have a
    meaning.
    """
    best = min(fits, key=lambda one: float(one.residual @ one.residual))
    return [bic(float(one.residual @ one.residual), len(one.residual), len(one.names), best.n_effective)
            for one in fits]


def envelope_misfit(fit: Fit) -> float:
    """Return the largest difference between recording and model at a turning point [rad].

    The residual is averaged over a sixth of the half swing about every turning point of the recording, which reduces
    the noise. For a gyroscope it is the largest difference at the passages, a quarter of a period later, divided by
    omega0; for an accelerometer it is divided by the range of its readings, in proportion to that of the angle.
    """
    points = turning_points(fit.recording)
    if len(points.time) < 2:
        return float(np.max(np.abs(fit.residual)))
    reach = float(np.median(np.diff(points.time))) / 12.0
    at, unit = points.time, 1.0
    if fit.recording.rate is not None:
        at, unit = at + 6.0 * reach, 1.0 / fit.scene.omega0
    elif fit.recording.force is not None:
        unit = 2.0 * float(points.amplitude.max()) / float(np.ptp(fit.recording.force))
    ends = np.searchsorted(fit.recording.time, [at - reach, at + reach])
    means = [unit * abs(float(np.mean(fit.residual[first:last]))) for first, last in ends.T if last > first]
    return max(means, default=0.0)


def measured(fit: Fit, name: str) -> Measurement:
    """Return a fitted parameter; if models were compared, its error includes the differences between them."""
    return fit.parameters[name] if fit.comparison is None else fit.comparison.measured(name)


def against(fit: Fit, told: Mapping[str, tuple[float, float]]) -> dict[str, float]:
    """Compare fitted parameters with independently measured values, in standard deviations of the difference.

    Returns ``(fitted - told) / sqrt(error² + spread² + told error²)`` for every name in ``told``; see
    :meth:`FitComparison.spread`.

    Args:
        fit: the fit.
        told: measured value and standard error by name, in the parameter's unit, such as ``{"length": (0.65, 0.01)}``.

    Raises SceneError for a name that was not fitted, and unless every entry is a value with a positive error.
    """
    differences = {}
    for name, pair in told.items():
        one_of(name, "fitted parameter", fit.names)
        own = measured(fit, name)
        both = several(pair, name, "a value and its standard error")
        if len(both) != 2:
            raise SceneError(f"{name} must be a value and its standard error, not {shown(pair)}.")
        value = number(both[0], name, unit=own.unit)
        error = number(both[1], f"{name}'s error", above=0.0, unit=own.unit)
        differences[name] = (own.value - value) / math.hypot(own.error, error)
    return differences


def _chance(p: float) -> str:
    """Return a probability as text."""
    return f"p = {p:.2g}" if p >= SMALLEST else f"p < {SMALLEST:g}"


def _listed(words: Sequence[str]) -> str:
    """Return words as a text, joined by commas and a last "and"."""
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
