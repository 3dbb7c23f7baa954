"""Draws of fitted numbers: from their covariance, for environments, and by the bootstrap."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.progress import Progress, telling_of
from pendulum_env.common.warn import warn
from pendulum_env.lab.checked import RecordingError
from pendulum_env.lab.fitting.intervals import Interval, level_of, place_of, refit
from pendulum_env.lab.fitting.model import SENSOR, START
from pendulum_env.physics.units import truth, whole_number

if TYPE_CHECKING:
    from pendulum_env.lab.fitting.result import Fit

Array = NDArray[np.float64]

LONG = 5.0
"""A block of the bootstrap is at least so many correlation times long."""
LINEAR = 0.02
"""Refits of the bootstrap do with the fit's derivatives where these predict the sum of squares to this share."""
MOST_DRAWS = 2**26
PATIENCE = 10_000
"""Most draws for each that is within the bounds."""


@dataclass(frozen=True, eq=False)
class Bootstrap:
    """Parameters fitted to recordings that might as well have been made.

    Attributes:
        fit: whose residuals were drawn.
        values: ``(refits, parameters)``.
        asked: refits that were asked for; fewer were made if they were interrupted.
        block: length of the blocks [readings].
    """

    fit: Fit
    values: Array
    asked: int
    block: int

    @property
    def names(self) -> tuple[str, ...]:
        """Of the parameters."""
        return self.fit.names

    @property
    def covariance(self) -> Array:
        """Of the parameters, from their scatter."""
        return np.asarray(np.cov(self.values, rowvar=False))

    def interval(self, name: str, level: float = 0.95) -> Interval:
        """Between the quantiles of the refits that leave the same share outside on either side.

        Raises RecordingError for a name that was not fitted, and where there are fewer than two refits beyond each end.
        """
        column, tail = self.values[:, place_of(self.fit, name)], 0.5 * (1.0 - level_of(level))
        if tail * len(column) < 1.0:
            needed = math.ceil(1.0 / tail)
            raise RecordingError(f"an interval of level {level:g} needs {needed} refits, there are {len(column)}")
        low, high = np.quantile(column, (tail, 1.0 - tail))
        return Interval(float(low), float(high))


def bootstrap(fit: Fit, n: int, seed: int, progress: Progress | bool) -> Bootstrap:
    """Refits to the model's motion plus residuals in another order.

    Residuals are drawn in blocks that may overlap (Künsch 1989, Ann. Stat. 17, 1217), of ``n^(1/3)`` readings or 5
    correlation times, whichever is longer, and grow by ``sqrt(n / (n - k))`` for the k parameters that took part of
    them up. Each refit starts from the fit. Rounding that is alike in all swings stays as it is, and makes no scatter
    here; the fit's own errors allow for it. Interrupted, it returns what there is, with a warning.
    """
    count, source = whole_number(n, "n", MOST_DRAWS), np.random.default_rng(whole_number(seed, "seed", 2**63, least=0))
    residual, readings = fit.residual, len(fit.residual)
    length = math.ceil(max(readings ** (1.0 / 3.0), LONG * fit.correlation_time))
    length = min(length, max(readings // 4, 1))
    grown = (residual - residual.mean()) * math.sqrt(readings / fit.degrees_of_freedom)
    motion = fit.recording.angle - residual
    starts, within = readings - length + 1, np.arange(length)
    found: list[Array] = []
    with telling_of(progress, "bootstrap") as tell:
        try:
            for i in range(count):
                tell(i / count, f"refit {i + 1} of {count}")
                first = source.integers(0, starts, math.ceil(readings / length))
                drawn = grown[(first[:, None] + within).ravel()[:readings]]
                found.append(refit(fit.model, motion + drawn, fit.values, fit.solution.jacobian, trust=LINEAR)[0])
        except KeyboardInterrupt:
            if len(found) < 2:
                raise
            warn(f"The bootstrap was interrupted after {len(found)} of {count} refits; these are returned.")
    return Bootstrap(fit, np.array(found), count, length)


def sample(fit: Fit, n: int, seed: int, start: bool) -> dict[str, Any]:
    """Scenes as likely as the fit's: keywords of ``gym.make_vec`` with n values of each fitted parameter.

    Drawn from the normal distribution of the fit's covariance, all parameters together, and drawn again where a number
    is below its bound 0: near it, the sample has the mean and covariance of the truncated distribution.

    Raises RecordingError where a parameter has no finite error, or hardly a draw is within the bounds.
    """
    count, source = whole_number(n, "n", MOST_DRAWS), np.random.default_rng(whole_number(seed, "seed", 2**63, least=0))
    errors = np.sqrt(np.diag(fit.covariance))
    if not np.isfinite(errors).all():
        lost = ", ".join(name for name, error in zip(fit.names, errors, strict=True) if not math.isfinite(error))
        raise RecordingError(f"{fit.recording.source}: nothing to draw {lost} from, as its error is not finite")
    scale = np.where(errors > 0.0, errors, 1.0)
    sizes, axes = np.linalg.eigh(fit.covariance / np.outer(scale, scale))
    spread = (axes * np.sqrt(np.maximum(sizes, 0.0))).T * scale
    rows, tried, kept = np.empty((0, len(errors))), 0, 0
    while kept < count:
        if tried > PATIENCE * (kept + 1):
            raise RecordingError(f"{fit.recording.source}: of {tried} draws only {kept} have no number below 0")
        draws = fit.values + source.standard_normal((2 * (count - kept) + 16, len(errors))) @ spread
        rows = np.concatenate([rows, draws[(draws >= fit.model.least).all(axis=1)]])
        tried, kept = tried + len(draws), len(rows)
    wanted = {*START[:2]} if truth(start, "start") else set()
    columns = {name: column.copy() for name, column in zip(fit.names, rows[:count].T, strict=True)
               if name not in SENSOR or name in wanted}
    return {"scene": fit.scene, **columns}
