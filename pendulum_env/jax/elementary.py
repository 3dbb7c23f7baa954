"""Elementary functions of JAX arrays under the names that generated programs call, with derivatives at their edges.

Programs bring their own sine and exponential (:mod:`pendulum_env.physics.elementary`), which round by adding and
subtracting large numbers. A derivative of that is wrong, and a compiler may remove it, so that JAX's own functions
stand in their place here: values agree to rounding, not to the bit.

At zero, where a square root, a logarithm or a power has an infinite derivative or none, the derivative is 0 here, as
that of the absolute value is: a value that a condition does not choose must not make the derivative nan.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import jax.numpy as jnp


def sqrt(x: Any) -> Any:
    """Return the square root; its derivative at 0 is 0. nan below 0."""
    positive = x > 0.0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, x, 1.0)), jnp.where(x == 0.0, 0.0, jnp.nan))


def log(x: Any) -> Any:
    """Return the natural logarithm; -inf at 0 with derivative 0, nan below 0."""
    positive = x > 0.0
    return jnp.where(positive, jnp.log(jnp.where(positive, x, 1.0)), jnp.where(x == 0.0, -jnp.inf, jnp.nan))


def power(x: Any, y: Any) -> Any:
    """Return x**y for x >= 0; the derivatives at x = 0 are 0. nan below 0."""
    positive = x > 0.0
    at_zero = jnp.where(y > 0.0, 0.0, jnp.where(y == 0.0, 1.0, jnp.inf))
    edge = jnp.where(x == 0.0, at_zero, jnp.nan)
    return jnp.where(positive, jnp.exp(y * jnp.log(jnp.where(positive, x, 1.0))), edge)


ELEMENTARY: Mapping[str, Callable[..., Any]] = {
    "sin": jnp.sin, "cos": jnp.cos, "exp": jnp.exp, "log": log, "power": power, "sqrt": sqrt, "tanh": jnp.tanh,
    "sin_near_zero": lambda y, low: jnp.sin(y - low), "cos_near_zero": lambda y, low: jnp.cos(y - low),
}
"""Name of an elementary function in programs -> the function of JAX arrays."""
