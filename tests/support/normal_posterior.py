"""A posterior whose samples are drawn from the fit's normal distribution, which takes no simulation."""

from __future__ import annotations

from typing import Any

import numpy as np

from pendulum_env.lab import Posterior
from pendulum_env.lab.fitting.priors import priors_of


def normal_posterior(fit: Any, steps: int = 200, walkers: int = 32) -> Posterior:
    """Return a posterior of independent normal samples, with none below a bound."""
    chain = np.random.default_rng(0).multivariate_normal(fit.values, fit.covariance, (steps, walkers))
    chain = np.maximum(chain, fit.model.least)
    return Posterior(fit, chain, np.zeros((steps, walkers)), np.full(walkers, 0.5), priors_of(fit.model, None),
                     steps, 0)
