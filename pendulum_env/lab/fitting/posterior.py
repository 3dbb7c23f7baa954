"""Posterior distribution of fitted parameters, sampled by emcee from walkers that start around the fit."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.progress import Progress, telling_of
from pendulum_env.common.provenance import output_folder, provenance, write_csv
from pendulum_env.common.replacing import replacing
from pendulum_env.common.shown import Plotted, one_line
from pendulum_env.common.tables import Table
from pendulum_env.common.warn import warn
from pendulum_env.lab.checked import RecordingError
from pendulum_env.lab.decoding import contents, decoding, opened, unpacked
from pendulum_env.lab.fitting.density import LogDensity
from pendulum_env.lab.fitting.intervals import (
    MOST_DRAWS,
    Fitted,
    Interval,
    Scatter,
    keywords_of,
    level_of,
    place_of,
    scatter_of,
)
from pendulum_env.lab.fitting.model import ZERO, unit_of
from pendulum_env.lab.fitting.priors import Prior, priors_of
from pendulum_env.lab.fitting.statistics import integrated_time, split_r
from pendulum_env.lab.measures import Measurement
from pendulum_env.physics.units import SceneError, file_path, one_of, shown, whole_number

Array = NDArray[np.float64]

ENOUGH, MIXED = 50.0, 1.05
"""A chain is long enough from this number of autocorrelation times on, if R-hat is below the second number (Foreman-
Mackey et al. 2013, PASP 125, 306; Gelman et al. 2013, Bayesian Data Analysis, section 11.4)."""
BURNT = 5.0
"""Number of autocorrelation times after which the start no longer matters; these steps are discarded."""
FEWEST = 10
"""Smallest number of steps of an interrupted chain that is returned."""
JUMPS, ALONG, ACROSS = 0.3, 0.6, 0.1
"""Shares of the proposals: independent of the present parameters, along the difference of two walkers, and towards
another walker (snooker)."""
TAILS = 6.0
"""Degrees of freedom of the independent proposals, whose tails must be wider than the posterior's."""
WARM, LONGEST, LEARNT = 0.2, 300, 10
"""Warm-up: its share of the steps, its largest number of steps, and the smallest number of its samples per parameter.
Independent proposals come from the fit's errors before its end, and from the samples of its second half afterwards."""
AGAIN = 20
"""Most draws of an independent proposal until one is within the priors' ranges."""
RARE, CLOSER, TRIES = 1e-3, 0.7, 100
"""Walkers start where a normal distribution has the probability 1 - RARE. While few draws are there, further draws are
closer to the fit by the factor CLOSER; at most TRIES rounds are drawn."""
SKEWED = 1.3
"""A parameter counts as not Gaussian if one side of its 95 % interval is this many times longer than the other."""
NEAR = 1e-3
"""The fit of a loaded posterior is that of the saved one if its values differ by less than this share of their errors
and of themselves."""
LEVELS = (0.68, 0.95)
"""Levels of the intervals in tables."""


@dataclass(frozen=True, eq=False, repr=False)
class Posterior(Plotted):
    """Sample of the posterior distribution of a fit's parameters.

    Attributes:
        fit: the fit from which the walkers started.
        chain: parameters of all walkers after every step, ``(steps, walkers, parameters)``, in the order of ``names``.
        log_density: logarithm of the posterior density, up to a constant, ``(steps, walkers)``.
        acceptance: share of accepted proposals, an array of walkers.
        priors: prior of every parameter, in the order of ``names``.
        asked: number of steps that were requested; an interrupted chain is shorter.
        warm: number of first steps, after which the proposals were adapted to the posterior.
        seed: seed of the random numbers.
    """

    fit: Fitted
    chain: Array
    log_density: Array
    acceptance: Array
    priors: tuple[Prior, ...]
    asked: int
    warm: int
    seed: int

    def __repr__(self) -> str:
        steps, walkers, _ = self.chain.shape
        return one_line(self, f"{self.fit.recording.source}, {walkers} walkers, {steps} steps, {len(self.names)} "
                        "parameters")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in the order of the last axis of ``chain``."""
        return self.fit.names

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the parameters, in the order of ``names``."""
        return tuple(self.fit.recording.unit if name == ZERO else unit_of(self.fit.model.scene, name)
                     for name in self.names)

    @cached_property
    def autocorrelation_time(self) -> Array:
        """Integrated autocorrelation time of every parameter [steps], an array: 2 steps of a chain that are further
        apart count as independent (Goodman & Weare 2010, Commun. Appl. Math. Comput. Sci. 5, 65).
        """
        return integrated_time(self.chain[self.warm:])

    @property
    def discarded(self) -> int:
        """Number of first steps that are left out, because they depend on the start: at least ``warm`` and 5
        autocorrelation times, but at most half of the chain.
        """
        burnt = max(self.warm, math.ceil(BURNT * float(np.max(self.autocorrelation_time))))
        return min(burnt, len(self.chain) // 2)

    @cached_property
    def samples(self) -> Array:
        """Parameters of all walkers after every step that is not discarded, ``(samples, parameters)``."""
        return self.chain[self.discarded:].reshape(-1, len(self.names))

    @property
    def independent(self) -> float:
        """Number of independent samples: all samples divided by the longest autocorrelation time."""
        return len(self.samples) / float(np.max(self.autocorrelation_time))

    @cached_property
    def r_hat(self) -> Array:
        """Potential scale reduction of every parameter, an array; near 1 if all walkers have the same distribution in
        the first and the second half (Gelman et al. 2013, Bayesian Data Analysis, section 11.4).
        """
        return split_r(self.chain[self.discarded:])

    @property
    def problem(self) -> str:
        """Sentence on a chain that is too short or whose walkers disagree; "" for a good one."""
        steps, longest = len(self.chain) - self.warm, float(np.max(self.autocorrelation_time))
        worst, away = self.names[int(np.argmax(self.r_hat))], float(np.max(self.r_hat))
        if steps < ENOUGH * longest:
            needed = 100 * math.ceil(1.5 * ENOUGH * longest / 100.0)
            return (f"The chain is too short: {steps} steps after the warm-up are {steps / longest:.2g} "
                    f"autocorrelation times, and at least {ENOUGH:g} are needed; give steps={needed}.")
        if away > MIXED:
            return (f"The walkers disagree about {worst}: R-hat is {away:.3g}, and at most {MIXED:g} is allowed; give "
                    "more steps.")
        return ""

    @property
    def mean(self) -> Array:
        """Means of the parameters, an array."""
        return np.asarray(self.samples.mean(axis=0))

    @property
    def median(self) -> Array:
        """Medians of the parameters, an array."""
        return np.asarray(np.median(self.samples, axis=0))

    @property
    def std(self) -> Array:
        """Standard deviations of the parameters, an array."""
        return np.asarray(self.samples.std(axis=0, ddof=1))

    @property
    def covariance(self) -> Array:
        """Covariance matrix of the parameters."""
        return np.asarray(np.atleast_2d(np.cov(self.samples, rowvar=False)))

    @property
    def parameters(self) -> dict[str, Measurement]:
        """Mean, standard deviation and unit of every parameter, by name."""
        return {name: Measurement(float(mean), float(error), unit)
                for name, mean, error, unit in zip(self.names, self.mean, self.std, self.units, strict=True)}

    def interval(self, name: str, level: float = 0.95) -> Interval:
        """Return the interval of a parameter, in its unit, with equal probabilities beyond its ends.

        ``level`` is the probability [1] of the interval. Raises RecordingError for a name that was not fitted,
        SceneError for a level that is not between 0 and 1.
        """
        tail = 0.5 * (1.0 - level_of(level))
        low, high = np.quantile(self.samples[:, place_of(self.fit, name)], (tail, 1.0 - tail))
        return Interval(float(low), float(high))

    @property
    def scatter(self) -> Scatter:
        """Distribution of the scene's parameters for ``gym.make(..., scene=..., randomize=posterior)``: the samples."""
        return scatter_of(self.fit, self.covariance, self.samples)

    @property
    def skewed(self) -> tuple[str, ...]:
        """Names of the parameters that are clearly not Gaussian: one side of the 95 % interval is 1.3 times (SKEWED) as
        long as the other, as seen from the median.
        """
        low, middle, high = np.quantile(self.samples, (0.025, 0.5, 0.975), axis=0)
        ratio = (high - middle) / np.maximum(middle - low, 1e-300)
        return tuple(name for name, x in zip(self.names, ratio, strict=True) if not 1.0 / SKEWED < x < SKEWED)

    @property
    def table(self) -> Table:
        """Table of the parameters: value and error of the fit and of the posterior, intervals, autocorrelation time."""
        heads = (f"{100 * level:.0f} %" for level in LEVELS)
        rows = []
        for i, (name, one) in enumerate(self.parameters.items()):
            error = math.sqrt(self.fit.covariance[i, i])
            digits = max(0, 1 - math.floor(math.log10(one.error))) if one.error > 0.0 else 6
            ends = (self.interval(name, level) for level in LEVELS)
            rows.append((
                name.rpartition(".")[2], one.unit, _bare(Measurement(float(self.fit.values[i]), error, "")), _bare(one),
                f"{self.median[i]:.{digits}f}", *(f"{end.low:.{digits}f} to {end.high:.{digits}f}" for end in ends),
                f"{self.autocorrelation_time[i]:.1f}"))
        return Table(("parameter", "unit", "fit", "posterior", "median", *heads, "tau"), tuple(rows))

    @property
    def text(self) -> str:
        """Summary in sentences: size of the sample, acceptance, likelihood, priors, non-Gaussian parameters."""
        steps, walkers, _ = self.chain.shape
        tau = float(np.max(self.autocorrelation_time))
        wider = np.sqrt(np.diag(self.fit.covariance)) / np.sqrt(np.maximum(np.diag(self.fit.errors.plain), 1e-300))
        widened = [f"{name} by {x:.2g}" for name, x in zip(self.names, wider, strict=True) if 1.05 < x < math.inf]
        given = [f"{name} {prior.text}" for name, prior in zip(self.names, self.priors, strict=True)]
        return "\n".join(filter(None, (
            f"Posterior: {walkers} walkers, {steps} steps, the first {self.discarded} discarded; {len(self.samples)} "
            f"samples, worth {self.independent:.0f} independent ones (autocorrelation time up to {tau:.2g} steps, "
            f"R-hat up to {float(np.max(self.r_hat)):.4f}); {float(np.mean(self.acceptance)):.0%} of the proposals "
            "accepted.",
            self.problem,
            "Likelihood: normal errors of all readings, with their standard deviation sigma integrated out with the "
            "prior 1/sigma" + (f"; wider, as the errors of the fit are, in {', '.join(widened)}." if widened else "."),
            f"Priors: {'; '.join(given)}.",
            f"Not Gaussian: {', '.join(self.skewed)}; use the intervals." if self.skewed else "",
        )))

    def sample(self, n: int, seed: int = 0, *, start: bool = False) -> dict[str, Any]:
        """Draw ``n`` scenes from the posterior, as keywords: ``gym.make_vec("LabPendulum-v0", num_envs=n,
        vectorization_mode="vector_entry_point", **posterior.sample(n))``.

        Args:
            n: number of scenes.
            seed: seed of the random draws, a whole number from 0.
            start: True adds "angle" and "velocity" at time 0, for ``rollout(**posterior.sample(n, start=True))``.

        Returns the scene, and an array of n values for every fitted parameter of the scene. Draws are different samples
        as long as there are enough. Raises SceneError unless n and seed are whole numbers in their ranges.
        """
        count = whole_number(n, "n", MOST_DRAWS)
        source = np.random.default_rng(whole_number(seed, "seed", 2**63, least=0))
        drawn = source.choice(len(self.samples), count, replace=count > len(self.samples))
        return keywords_of(self.fit, self.samples[drawn], start)

    def save(self, path: str | Path) -> Path:
        """Write the sample with its origin, depending on the file's ending; return the path.

        The ``.zip`` file, which ``pendulum_env.load`` reads, has the posterior with its fit and its recording.
        The ``.npz`` file, which :meth:`load` reads, has the whole chain: "chain", "log_density", "acceptance", "names",
        "units", "discarded", "asked", "warm", "seed", the fitted values as "fit", the priors as "kinds" and "priors"
        (low, high, mean and error of each), and "origin", a JSON text. The ``.csv`` file has the samples that are not
        discarded, one in every autocorrelation time, with a column for every parameter and the logarithm of the
        density.

        Raises SceneError for another ending, and for a fit that no ``.zip`` file can keep, OutputError if the file
        cannot be written.
        """
        place = file_path(path, "path")
        if one_of(place.suffix, "format of a posterior with the ending", (".npz", ".csv", ".zip")) == ".zip":
            return super().save(place)
        output_folder(place.parent)
        origin = provenance(recording=self.fit.recording.source, scene=self.fit.scene.to_dict(), seed=self.seed,
                            walkers=self.chain.shape[1], steps=len(self.chain), steps_asked=self.asked,
                            priors={name: one.text for name, one in zip(self.names, self.priors, strict=True)})
        if place.suffix == ".csv":
            every = math.ceil(float(np.max(self.autocorrelation_time)))
            kept = slice(self.discarded, None, every)
            columns = (*(f"{name} [{unit}]" for name, unit in zip(self.names, self.units, strict=True)), "log_density")
            rows = np.concatenate([self.chain[kept], self.log_density[kept, :, None]], axis=2)
            write_csv(place, columns, rows.reshape(-1, len(columns)).tolist(), origin)
            return place
        kinds = [one.kind for one in self.priors]
        priors = [(one.low, one.high, one.mean, one.error) for one in self.priors]
        with replacing(place) as temporary, temporary.open("wb") as file:
            np.savez_compressed(file, chain=self.chain, log_density=self.log_density, acceptance=self.acceptance,
                                names=np.array(self.names), units=np.array(self.units),
                                discarded=np.array(self.discarded), asked=np.array(self.asked),
                                warm=np.array(self.warm), seed=np.array(self.seed), fit=self.fit.values,
                                kinds=np.array(kinds), priors=np.array(priors), origin=np.array(json.dumps(origin)))
        return place

    @classmethod
    def load(cls, path: str | Path, fit: Fitted) -> Posterior:
        """Return the sample in an ``.npz`` file that :meth:`save` wrote.

        Args:
            path: the file.
            fit: the fit of which the sample was drawn; the file does not contain it. A fit of the same model to the
                same recording gives it again.

        Raises SceneError for another object than a fit and another ending of the file, and RecordingError for a file
        that cannot be read or has no posterior, and for one of another fit.
        """
        place = file_path(path, "path")
        one_of(place.suffix, "format of a posterior to load with the ending", (".npz",))
        if not hasattr(fit, "solution") or not hasattr(fit, "recording"):
            raise SceneError(f"fit must be the fit of which the posterior was sampled, not {shown(fit)}.")
        with decoding(str(place), "a file that Posterior.save wrote"):
            archive = opened(str(place), io.BytesIO(contents(str(place))))
            chain, log_density, acceptance, names, asked, warm, seed, fitted, kinds, priors = (
                np.load(io.BytesIO(unpacked(str(place), archive, f"{name}.npy"))) for name in (  # no pickled objects
                    "chain", "log_density", "acceptance", "names", "asked", "warm", "seed", "fit", "kinds", "priors"))
            own = tuple(Prior(low, high, kind, mean, error)
                        for kind, (low, high, mean, error) in zip(kinds.tolist(), priors.tolist(), strict=True))
            numbers = int(asked), int(warm), int(seed)
            kept = {one.dtype.kind for one in (chain, log_density, acceptance, fitted)}
            shapes = (fitted.shape, (len(own),), chain.shape, acceptance.shape)
            wanted = (names.shape, names.shape, (*log_density.shape, len(names)), chain.shape[1:2])
            if kept != {"f"} or {names.dtype.kind, kinds.dtype.kind} != {"U"} or shapes != wanted:
                raise ValueError("arrays of other shapes or types")
        if tuple(names.tolist()) != tuple(fit.names):
            raise RecordingError(f"{place}: the posterior has the parameters {', '.join(names.tolist())}, the fit "
                                 f"{', '.join(fit.names)}")
        away = np.abs(fit.values - fitted) > NEAR * np.sqrt(np.diag(fit.covariance)) + NEAR * np.abs(fitted)
        if away.any():
            at = int(np.argmax(away))
            raise RecordingError(f"{place}: the posterior is of a fit with {fit.names[at]} {fitted[at]:.6g}, not "
                                 f"{fit.values[at]:.6g}; give the fit of the same recording")
        return cls(fit, chain, log_density, acceptance, own, *numbers)


def _bare(one: Measurement) -> str:
    """Return a value with its error as text, without a unit."""
    return str(one).removesuffix(one.unit).strip()


def needs_emcee() -> None:
    """Raise RecordingError if emcee, which samples posteriors, is not installed."""
    if find_spec("emcee") is None:
        raise RecordingError("a posterior needs emcee; pip install 'lab-pendulum[posterior]', or in a copy of the "
                             'project: pip install ".[posterior]"')


def posterior(
    fit: Fitted,
    walkers: int,
    steps: int,
    seed: int,
    priors: Mapping[str, Any] | None,
    progress: Progress | bool | None,
) -> Posterior:
    """Sample the posterior distribution of a fit's parameters; see :meth:`Fit.posterior`."""
    count = whole_number(walkers, "walkers", 2**20)
    length = whole_number(steps, "steps", MOST_DRAWS)
    key = whole_number(seed, "seed", 2**32 - 1, least=0)
    own = priors_of(fit.model, priors)
    if count < 2 * len(fit.names):
        raise SceneError(f"walkers must be at least {2 * len(fit.names)}, twice the {len(fit.names)} fitted "
                         f"parameters, not {count}.")
    if not fit.grade.usable:
        raise RecordingError(f"{fit.recording.source}: no posterior of a fit that is not usable. {fit.grade.text}")
    errors = np.sqrt(np.diag(fit.covariance))
    lost = [name for name, error, one in zip(fit.names, errors, own, strict=True)
            if not (math.isfinite(error) or one.bounded)]
    if lost:
        raise RecordingError(f"{fit.recording.source}: the recording does not determine {', '.join(lost)}; give a "
                             f"prior with a range, as in priors={{{lost[0]!r}: (0.1, 0.2)}}.")
    needs_emcee()
    import emcee

    density = LogDensity(fit, own)
    source = np.random.default_rng(key)
    ends = np.array([(one.low, one.high) for one in own]).T
    factor, warm = _factor(fit, own), min(round(WARM * length), LONGEST)
    start, jump = _start(fit, own, density, factor, count, source), Jump(fit.values, factor, *ends)
    moves = [(emcee.moves.MHMove(jump), JUMPS), (emcee.moves.DEMove(), ALONG),
             (emcee.moves.DESnookerMove(), ACROSS)]
    sampler = emcee.EnsembleSampler(count, len(fit.names), density, moves=moves, vectorize=True)
    sampler.random_state = np.random.RandomState(key).get_state()
    with telling_of(progress, "posterior") as tell:
        try:
            for i, _ in enumerate(sampler.sample(start, iterations=length, skip_initial_state_check=True)):
                tell((i + 1) / length, f"step {i + 1} of {length}")
                if i + 1 == warm:
                    jump.learn(sampler.get_chain(discard=warm // 2, flat=True))
        except KeyboardInterrupt:
            if sampler.backend.iteration < FEWEST:
                raise
            warn(f"The posterior was interrupted after {sampler.backend.iteration} of {length} steps; these are "
                 "returned.")
    chain = np.array(sampler.get_chain())
    found = Posterior(fit, chain, np.array(sampler.get_log_prob()), np.array(sampler.acceptance_fraction), own, length,
                      min(warm, len(chain) // 2), key)
    if found.problem:
        warn(found.problem)
    return found


def _factor(fit: Fitted, priors: tuple[Prior, ...]) -> Array:
    """Return a square root of the fit's covariance: normal numbers times it have the covariance.

    A parameter that the recording does not determine has the width of its prior and no correlation.
    """
    variances = np.array([variance if math.isfinite(variance) else (
        one.error if math.isfinite(one.error) else (one.high - one.low) / math.sqrt(12.0)) ** 2
        for variance, one in zip(np.diag(fit.covariance), priors, strict=True)])
    return _root(fit.correlations, np.sqrt(np.maximum(variances, 1e-300)))


def _start(
    fit: Fitted, priors: tuple[Prior, ...], density: LogDensity, factor: Array, count: int, source: np.random.Generator
) -> Array:
    """Return the walkers' first parameters: scattered as the fit's errors, but only where the density is not too small.

    The smallest density is that beyond which a normal distribution has the probability 0.001 (RARE). Where it excludes
    nine draws in ten, because the fit's errors are too wide for the posterior, the next draws are closer to the fit.

    Raises RecordingError if no draw has a density above 0.
    """
    from scipy.stats import chi2

    depth = 0.5 * float(chi2.isf(RARE, len(factor)))
    least = fit.model.least
    centre = np.array([one.nearest(value) for one, value in zip(priors, fit.values.tolist(), strict=True)])
    rows, logs, scale = centre[None], density(centre), 1.0
    for _ in range(TRIES):
        drawn = centre + scale * source.standard_normal((4 * count, len(factor))) @ factor
        drawn = np.where(drawn < least, 2.0 * np.where(np.isfinite(least), least, 0.0) - drawn, drawn)
        for column, one in zip(drawn.T, priors, strict=True):
            outside = (column < one.low) | (column > one.high)
            column[outside] = one.drawn(int(np.count_nonzero(outside)), source) if outside.any() else 0.0
        fresh = density(drawn)
        rows, logs = np.concatenate([rows, drawn]), np.concatenate([logs, fresh])
        good = logs >= logs.max() - depth
        rows, logs = rows[good], logs[good]
        if len(rows) > count and np.isfinite(logs).all():
            return np.asarray(rows[source.permutation(len(rows))[:count]])
        scale *= CLOSER if np.count_nonzero(good[-len(fresh):]) < 0.1 * len(fresh) else 1.0
    raise RecordingError(f"{fit.recording.source}: hardly any parameters within the priors' ranges fit the recording")


class Jump:
    """Proposals around a centre with a given covariance and wide tails, which do not depend on the present parameters
    (Tierney 1994, Ann. Stat. 22, 1701).

    Args:
        centre: mean of the proposals.
        factor: square root of their covariance; normal numbers times it have the covariance.
        low, high: ends of the ranges outside which nothing is proposed, arrays of parameters.
    """

    def __init__(self, centre: Array, factor: Array, low: Array, high: Array) -> None:
        self.centre, self.factor, self.inverse = centre, factor, np.linalg.inv(factor)
        self.low, self.high = low, high

    def learn(self, samples: Array) -> None:
        """Take mean and covariance from samples, ``(samples, parameters)``, if these are not degenerate."""
        scale = samples.std(axis=0)
        if len(samples) > LEARNT * samples.shape[1] and (scale > 0.0).all():
            root = _root(np.atleast_2d(np.corrcoef(samples, rowvar=False)), scale)
            self.centre, self.factor, self.inverse = samples.mean(axis=0), root, np.linalg.inv(root)

    def _density(self, rows: Array) -> Array:
        squares = np.sum(((rows - self.centre) @ self.inverse) ** 2, axis=1)
        return np.asarray(-0.5 * (TAILS + len(self.centre)) * np.log1p(squares / TAILS))

    def __call__(self, rows: Array, source: Any) -> tuple[Array, Array]:
        """Return a proposal for every row, and the logarithms of the ratios of the proposals' densities."""
        proposed, wanted = rows.copy(), np.arange(len(rows))
        for _ in range(AGAIN):
            wide = np.sqrt(source.chisquare(TAILS, (len(wanted), 1)) / TAILS)
            proposed[wanted] = self.centre + (source.standard_normal((len(wanted), rows.shape[1])) / wide) @ self.factor
            wanted = np.flatnonzero(((proposed < self.low) | (proposed > self.high)).any(axis=1))
            if not len(wanted):
                break
        return proposed, self._density(rows) - self._density(proposed)


def _root(correlations: Array, scale: Array) -> Array:
    """Return a square root of a covariance matrix from its correlations and standard deviations."""
    sizes, axes = np.linalg.eigh(correlations)
    return np.asarray((axes * np.sqrt(np.maximum(sizes, 1e-10))).T * scale)
