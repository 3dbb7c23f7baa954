"""Posterior distribution of fitted parameters, sampled by emcee from walkers that start around the fit."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.checks import warn
from pendulum_env.common.progress import Progress, telling_of
from pendulum_env.common.provenance import output_folder, provenance, write_csv
from pendulum_env.common.results import Plotted, one_line
from pendulum_env.common.texts import Table
from pendulum_env.lab.checked import RecordingError
from pendulum_env.lab.fitting.intervals import (
    MOST_DRAWS,
    Fitted,
    Interval,
    Scatter,
    between_quantiles,
    keywords_of,
    scatter_of,
)
from pendulum_env.lab.fitting.model import ZERO, unit_of
from pendulum_env.lab.fitting.priors import LogDensity, Prior, priors_of
from pendulum_env.lab.fitting.statistics import split_r
from pendulum_env.lab.measures import Measurement
from pendulum_env.physics.units import SceneError, file_path, one_of, whole_number

Array = NDArray[np.float64]

ENOUGH, MIXED = 50.0, 1.05
"""A chain is long enough from this number of autocorrelation times on, if R-hat is below the second number (Foreman-
Mackey et al. 2013, PASP 125, 306; Gelman et al. 2013, Bayesian Data Analysis, section 11.4)."""
BURNT = 5.0
"""Number of autocorrelation times after which the start no longer matters; these steps are discarded."""
FEWEST = 10
"""Smallest number of steps of an interrupted chain that is returned."""
ABOUT_FIT, ABOUT_SAMPLE, ALONG = 0.2, 0.3, 0.5
"""Shares of the proposals: about the fit, about the sample so far, and along the difference of two walkers (ter Braak
2006, Stat. Comput. 16, 239). Together they give 11 to 18 times as many independent samples in the same time as emcee's
stretch move (three fits, 1500 steps)."""
WARM, LONGEST, LEARNT = 0.2, 300, 10
"""Warm-up: its share of the steps, its largest number of steps, and the smallest number of its samples per parameter,
from the second half of which proposals about the sample are made afterwards."""
TAILS = 6
"""Degrees of freedom of the independent proposals, whose tails must be wider than the posterior's."""
RIDGE = 1e-8
"""Added to the diagonal of correlations, so that their inverse exists."""
AGAIN = 20
"""Number of draws of an independent proposal, of which the first within the priors' ranges is taken."""
RARE, CLOSER, TRIES = 1e-3, 0.7, 100
"""Walkers start where a normal distribution has the probability 1 - RARE. While few draws are there, further draws are
closer to the fit by the factor CLOSER; at most TRIES rounds are drawn."""
SKEWED = 1.3
"""A parameter counts as not Gaussian if one side of its 95 % interval is this many times longer than the other."""
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
        seed: seed of the random numbers.
    """

    fit: Fitted
    chain: Array
    log_density: Array
    acceptance: Array
    priors: tuple[Prior, ...]
    asked: int
    seed: int

    def __repr__(self) -> str:
        steps, walkers, _ = self.chain.shape
        return one_line(self, f"{self.fit.recording.source}, {walkers} walkers, {steps} steps, {len(self.names)} "
                        "parameters")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in the order of the last axis of ``chain``."""
        return self.fit.solution.model.names

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the parameters, in the order of ``names``."""
        return tuple(self.fit.recording.unit if name == ZERO else unit_of(self.fit.solution.model.scene, name)
                     for name in self.names)

    @property
    def warm(self) -> int:
        """Number of first steps, after which the proposals were adapted to the sample."""
        return min(warm_up(self.asked), len(self.chain) // 2)

    @cached_property
    def autocorrelation_time(self) -> Array:
        """Integrated autocorrelation time of every parameter [steps], an array: 2 steps of a chain that are further
        apart count as independent (Goodman & Weare 2010, Commun. Appl. Math. Comput. Sci. 5, 65). It is at least 1, and
        the length of the chain if a walker never moved. Raises RecordingError if emcee, which computes it, is missing.
        """
        needs_emcee()
        from emcee.autocorr import integrated_time

        with np.errstate(divide="ignore", invalid="ignore"):  # a walker that never moved
            times = integrated_time(self.chain[self.warm:], tol=0)
        return np.where(np.isfinite(times), np.maximum(times, 1.0), float(len(self.chain) - self.warm))

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
        return between_quantiles(self.samples[:, self.fit.place(name)], level)

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
            of_fit = Measurement(float(self.fit.solution.values[i]), math.sqrt(self.fit.errors.covariance[i, i]), "")
            digits = max(0, 1 - math.floor(math.log10(one.error))) if one.error > 0.0 else 6
            ends = (self.interval(name, level) for level in LEVELS)
            rows.append((
                name.rpartition(".")[2], one.unit, _bare(of_fit), _bare(one),
                f"{self.median[i]:.{digits}f}", *(f"{end.low:.{digits}f} to {end.high:.{digits}f}" for end in ends),
                f"{self.autocorrelation_time[i]:.1f}"))
        return Table(("parameter", "unit", "fit", "posterior", "median", *heads, "tau"), tuple(rows))

    @property
    def text(self) -> str:
        """Summary in sentences: size of the sample, acceptance, likelihood, priors, non-Gaussian parameters."""
        steps, walkers, _ = self.chain.shape
        tau = float(np.max(self.autocorrelation_time))
        covariance, plain = (np.diag(one) for one in (self.fit.errors.covariance, self.fit.errors.plain))
        wider = np.sqrt(covariance) / np.sqrt(np.maximum(plain, 1e-300))
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

        The ``.zip`` file, which ``pendulum_env.load`` reads, has the posterior with its fit and its recording. The
        ``.csv`` file has the samples that are not discarded, one in every autocorrelation time, with a column for every
        parameter and the logarithm of the density.

        Raises SceneError for another ending, and for a fit that no ``.zip`` file can keep, OutputError if the file
        cannot be written.
        """
        place = file_path(path, "path")
        if one_of(place.suffix, "format of a posterior with the ending", (".csv", ".zip")) == ".zip":
            return super().save(place)
        output_folder(place.parent)
        origin = provenance(recording=self.fit.recording.source, scene=self.fit.scene.to_dict(), seed=self.seed,
                            walkers=self.chain.shape[1], steps=len(self.chain), steps_asked=self.asked,
                            priors={name: one.text for name, one in zip(self.names, self.priors, strict=True)})
        kept = slice(self.discarded, None, math.ceil(float(np.max(self.autocorrelation_time))))
        columns = (*(f"{name} [{unit}]" for name, unit in zip(self.names, self.units, strict=True)), "log_density")
        rows = np.concatenate([self.chain[kept], self.log_density[kept, :, None]], axis=2)
        write_csv(place, columns, rows.reshape(-1, len(columns)).tolist(), origin)
        return place

    def to_arviz(self) -> Any:
        """Return the samples that are not discarded as ArviZ data, an xarray ``DataTree``, for ``arviz.summary``,
        ``arviz.ess`` or ``arviz.plot_trace``.

        Its group "posterior" has an array ``(chain, draw)`` for every parameter, one chain for each walker, with the
        parameter's unit; the group "sample_stats" has the logarithm of the density as "lp". ArviZ before 1.0 takes it
        by ``arviz.InferenceData.from_datatree``. Raises RecordingError if arviz-base is not installed.
        """
        try:
            from arviz_base import from_dict
        except ImportError:
            raise RecordingError("data for ArviZ need arviz-base; pip install 'lab-pendulum[arviz]'") from None
        rows = self.chain[self.discarded:].swapaxes(0, 1)
        tree = from_dict({"posterior": {name: rows[..., i] for i, name in enumerate(self.names)},
                          "sample_stats": {"lp": self.log_density[self.discarded:].T}})
        for name, unit in zip(self.names, self.units, strict=True):
            tree["posterior"][name].attrs["units"] = unit
        return tree


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
    own = priors_of(fit.solution.model, priors)
    names = fit.solution.model.names
    if count < 2 * len(names):
        raise SceneError(f"walkers must be at least {2 * len(names)}, twice the {len(names)} fitted parameters, not "
                         f"{count}.")
    if not fit.grade.usable:
        raise RecordingError(f"{fit.recording.source}: no posterior of a fit that is not usable. {fit.grade.text}")
    errors = np.sqrt(np.diag(fit.errors.covariance))
    lost = [name for name, error, one in zip(names, errors, own, strict=True)
            if not (math.isfinite(error) or one.bounded)]
    if lost:
        raise RecordingError(f"{fit.recording.source}: the recording does not determine {', '.join(lost)}; give a "
                             f"prior with a range, as in priors={{{lost[0]!r}: (0.1, 0.2)}}.")
    needs_emcee()
    import emcee

    density, source = LogDensity(fit, own), np.random.default_rng(key)
    ends = np.array([(one.low, one.high) for one in own]).T
    centre, scale, correlations = _normal(fit, own)
    jump = proposals(centre, scale, correlations, *ends)
    start = _start(fit, density, lambda: jump(np.tile(centre, (4 * count, 1)), source)[0], centre, count)
    learnt, warm = emcee.moves.MHMove(jump), warm_up(length)
    moves = [(emcee.moves.MHMove(jump), ABOUT_FIT), (learnt, ABOUT_SAMPLE), (emcee.moves.DEMove(), ALONG)]
    sampler = emcee.EnsembleSampler(count, len(names), density, moves=moves, vectorize=True)
    sampler.random_state = np.random.RandomState(key).get_state()
    with telling_of(progress, "posterior") as tell:
        try:
            for i, _ in enumerate(sampler.sample(start, iterations=length, skip_initial_state_check=True)):
                tell((i + 1) / length, f"step {i + 1} of {length}")
                if i + 1 == warm:
                    rows = sampler.get_chain(discard=warm // 2, flat=True)
                    if len(rows) > LEARNT * len(names) and (rows.std(axis=0) > 0.0).all():
                        learnt.get_proposal = proposals(rows.mean(axis=0), rows.std(axis=0),
                                                        np.atleast_2d(np.corrcoef(rows, rowvar=False)), *ends)
        except KeyboardInterrupt:
            if sampler.backend.iteration < FEWEST:
                raise
            warn(f"The posterior was interrupted after {sampler.backend.iteration} of {length} steps; these are "
                 "returned.")
    found = Posterior(fit, np.array(sampler.get_chain()), np.array(sampler.get_log_prob()),
                      np.array(sampler.acceptance_fraction), own, length, key)
    if found.problem:
        warn(found.problem)
    return found


def _start(fit: Fitted, density: LogDensity, draw: Callable[[], Array], centre: Array, count: int) -> Array:
    """Return the walkers' first parameters: draws with a density that is not too small.

    The smallest density is that beyond which a normal distribution has the probability 0.001 (RARE). Where it excludes
    nine draws in ten, the next draws are closer to the centre. Raises RecordingError if there are too few.
    """
    from scipy.stats import chi2

    depth, scale = 0.5 * float(chi2.isf(RARE, len(centre))), 1.0
    rows, logs = centre[None], density(centre)
    for _ in range(TRIES):
        fresh = centre + scale * (draw() - centre)
        rows, logs = np.concatenate([rows, fresh]), np.concatenate([logs, density(fresh)])
        good = logs >= logs.max() - depth
        scale *= CLOSER if np.count_nonzero(good[-len(fresh):]) < 0.1 * len(fresh) else 1.0
        rows, logs = rows[good], logs[good]
        if len(rows) > count and np.isfinite(logs).all():
            return np.asarray(rows[-count:])
    raise RecordingError(f"{fit.recording.source}: hardly any parameters within the priors' ranges fit the recording")


def warm_up(steps: int) -> int:
    """Return the number of first steps after which the proposals are adapted to the sample, of a number of steps."""
    return min(round(WARM * steps), LONGEST)


def proposals(
    centre: Array, scale: Array, correlations: Array, low: Array, high: Array
) -> Callable[[Array, Any], tuple[Array, Array]]:
    """Return a function that proposes parameters from Student's t, which do not depend on the present ones (Tierney
    1994, Ann. Stat. 22, 1701).

    ``centre``, ``scale`` and ``correlations`` describe the distribution; ``low`` and ``high`` are the ends of the
    priors' ranges. The function takes rows of parameters and a source of random numbers; it returns the proposals, and
    the logarithms of the ratios of their densities.
    """
    from scipy.stats import multivariate_t

    wide = multivariate_t(shape=correlations + RIDGE * np.eye(len(scale)), df=TAILS)

    def jump(rows: Array, random: Any) -> tuple[Array, Array]:
        many = wide.rvs(AGAIN * len(rows), random_state=random).reshape(AGAIN, *rows.shape)
        inside = ((centre + scale * many >= low) & (centre + scale * many <= high)).all(axis=2)
        drawn = many[inside.argmax(axis=0), np.arange(len(rows))]
        return centre + scale * drawn, np.asarray(wide.logpdf((rows - centre) / scale) - wide.logpdf(drawn))

    return jump


def _normal(fit: Fitted, priors: tuple[Prior, ...]) -> tuple[Array, Array, Array]:
    """Return mean, standard deviations and correlations of a normal distribution like the posterior.

    It is the product of the fit's normal distribution and of each bounded prior's; their inverse covariances add. A
    parameter that the recording does not determine has its fitted value and the width of its prior.
    """
    errors = np.sqrt(np.diag(fit.errors.covariance))
    means, widths = np.array([one.moments for one in priors]).T
    scale = np.where(np.isfinite(errors), np.maximum(errors, 1e-150), widths)
    means = np.where(np.isfinite(errors), means, fit.solution.values)
    told = np.linalg.inv(fit.correlations + RIDGE * np.eye(len(scale))) * np.outer(
        np.isfinite(errors), np.isfinite(errors))
    also = np.diag((scale / widths) ** 2)
    covariance = np.linalg.inv(told + also)
    mean = fit.solution.values + scale * (covariance @ also @ ((means - fit.solution.values) / scale))
    sizes = np.sqrt(np.diag(covariance))
    low, high = np.array([(one.low, one.high) for one in priors]).T
    return np.clip(mean, low, high), scale * sizes, covariance / np.outer(sizes, sizes)
