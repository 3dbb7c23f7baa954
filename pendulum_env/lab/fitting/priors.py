"""Prior probabilities of fitted parameters, for a posterior."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.lab.fitting.model import Model, unit_of
from pendulum_env.physics.units import SceneError, nearest, number, several, shown

Array = NDArray[np.float64]

FLAT, LOG, NORMAL = "flat", "log", "normal"
FORMS = "(low, high), ('log', low, high) or ('normal', mean, error)"


@dataclass(frozen=True)
class Prior:
    """Prior probability density of one parameter.

    Attributes:
        low, high: ends of the range outside which the density is 0; infinite for none.
        kind: "flat", "log" for a density 1/x, flat in the logarithm of the parameter, or "normal".
        mean, error: mean and standard deviation of the normal density.
    """

    low: float
    high: float
    kind: str = FLAT
    mean: float = 0.0
    error: float = math.inf

    def log(self, x: Array) -> Array:
        """Return the logarithm of the density, up to a constant, at values of the parameter; -inf outside its range."""
        inside = (x >= self.low) & (x <= self.high)
        if self.kind == LOG:
            return np.where(inside, -np.log(np.where(inside, x, 1.0)), -math.inf)
        return np.where(inside, -0.5 * ((x - self.mean) / self.error) ** 2, -math.inf)

    @property
    def bounded(self) -> bool:
        """True if the density is proper, so that it alone gives the parameter a finite error."""
        return self.kind == NORMAL or math.isfinite(self.high - self.low)

    @property
    def moments(self) -> tuple[float, float]:
        """Mean and standard deviation of a bounded density, of a flat one over its range; (0, inf) of any other."""
        if self.kind == NORMAL:
            return self.mean, self.error
        wide = (self.high - self.low) / math.sqrt(12.0)
        return (0.5 * (self.low + self.high) if math.isfinite(wide) else 0.0), wide

    @property
    def text(self) -> str:
        """The density in words, such as "flat from 0.3 to 0.4"."""
        ends = f"from {self.low:g} to {self.high:g}"
        if self.kind == NORMAL:
            return f"normal, {self.mean:g} ± {self.error:g}" + (f", above {self.low:g}" if self.low > -math.inf else "")
        if self.kind == LOG:
            return f"flat in the logarithm {ends}"
        return f"flat {ends}" if math.isfinite(self.high) else f"flat above {self.low:g}" if (
            math.isfinite(self.low)) else "flat"


def priors_of(model: Model, given: Mapping[str, Any] | None) -> tuple[Prior, ...]:
    """Return the prior of every fitted parameter of a model, in the order of ``model.names``.

    ``given`` are priors by the parameter's name, in full or without its effect ("gamma" for "linear_drag.gamma"):
    ``(low, high)`` is flat, ``("log", low, high)`` is flat in the logarithm, ``("normal", mean, error)`` is a normal
    distribution. A parameter without an entry has a flat prior above its physical bound, which is 0 for all but the
    start and the sensor's zero.

    Raises SceneError for an unknown name and for a range that is upside down or below the bound.
    """
    if given is not None and not isinstance(given, Mapping):
        raise SceneError(f"priors must be a dict of name -> {FORMS}, not {shown(given)}.")
    least = dict(zip(model.names, model.least.tolist(), strict=True))
    own = {name: Prior(low, math.inf) for name, low in least.items()}
    short = {name.rpartition(".")[2]: name for name in model.names}
    for key, entry in (given or {}).items():
        name = short.get(key, key) if isinstance(key, str) else key
        if name not in own:
            raise SceneError(f"priors has {shown(key)}, which is not a fitted parameter{nearest(key, short)}")
        own[name] = _prior(key, entry, least[name], unit_of(model.scene, name))
    return tuple(own.values())


def _prior(name: str, entry: Any, least: float, unit: str) -> Prior:
    """Return the prior that an entry of ``priors`` describes; ``least`` is the parameter's physical bound."""
    words = several(entry, f"the prior of {name}", f"the form {FORMS}")
    kind = words[0] if words and isinstance(words[0], str) else FLAT
    pair = words[1:] if words and isinstance(words[0], str) else words
    if kind not in (FLAT, LOG, NORMAL) or len(pair) != 2:
        raise SceneError(f"The prior of {name} must have the form {FORMS}, not {shown(entry)}.")
    if kind == NORMAL:
        mean = number(pair[0], f"the mean of the prior of {name}", unit=unit)
        error = number(pair[1], f"the error of the prior of {name}", above=0.0, unit=unit)
        return Prior(least, math.inf, NORMAL, mean, error)
    low, high = (number(x, f"an end of the prior of {name}", unit=unit) for x in pair)
    if kind == LOG:
        number(low, f"the lower end of the log prior of {name}", above=0.0, unit=unit)
    if math.isfinite(least):
        number(low, f"the lower end of the prior of {name}", least=least, unit=unit)
    number(high, f"the upper end of the prior of {name}", above=low, unit=unit)
    return Prior(low, high, kind)
