"""Longest steps that stay bounded, by method: published, or worked out outside the package.

A method without an entry here has the limits that :mod:`integrators.analysis` computes from its coefficients; tests of
the contract hold those against the steps themselves.
"""

from __future__ import annotations

import math

from implicit_truths import LIMITS as IMPLICIT_LIMITS
from multistep_truths import LIMITS as MULTISTEP_LIMITS
from nystrom_truths import NYSTROM
from runge_kutta_truths import LIMITS
from splitting_truths import TRUTHS
from taylor_truths import LIMITS as SERIES_LIMITS

import integrators
from integrators.analysis import damping_limit, spectral_radius, stability_limit

# Largest omega0 h without growth on the undamped oscillator. Euler's: |1 + iz|² = 1 + z²; midpoint and Heun:
# |R(iz)|² = 1 + z⁴/4; RK4: 2 sqrt(2); symplectic Euler, Verlet: 2 (Hairer, Norsett & Wanner 1993, IV.2; Hairer,
# Lubich & Wanner 2006, I.5.2); implicit Euler and midpoint: A-stable.
OSCILLATOR_LIMIT = {
    "forward_euler": 0.0,
    "backward_euler": math.inf,
    "symplectic_euler": 2.0,
    "symplectic_euler_position_first": 2.0,
    "conformal_symplectic_euler": 2.0,
    "velocity_verlet": 2.0,
    "midpoint": 0.0,
    "heun": 0.0,
    "rk4": 2.0 * math.sqrt(2.0),
    **{name: limit for name, (limit, _) in LIMITS.items()},
    "implicit_midpoint": math.inf,
    **IMPLICIT_LIMITS,
    "discrete_gradient": math.inf,
}
# Largest gamma h without growth under linear drag alone: the real stability interval of explicit Runge-Kutta methods
# (Hairer & Wanner 1996, IV.2), 2 for a kick with explicit drag, none for exact flows and A-stable methods.
DRAG_LIMIT = {
    "forward_euler": 2.0,
    "backward_euler": math.inf,
    "symplectic_euler": 2.0,
    "symplectic_euler_position_first": math.inf,
    "conformal_symplectic_euler": math.inf,
    "velocity_verlet": math.inf,
    "midpoint": 2.0,
    "heun": 2.0,
    "rk4": 2.785293563405282,
    **{name: limit for name, (_, limit) in LIMITS.items()},
    "implicit_midpoint": math.inf,
    **IMPLICIT_LIMITS,
    "discrete_gradient": math.inf,
}
# Longer steps are stable again: at infinity they damp.
REGAINING = ("bdf3", "bdf4", "bdf5", "bdf6")
OSCILLATOR_LIMIT["chin4a"], DRAG_LIMIT["chin4a"] = 2.0 * math.sqrt(3.0), math.inf
OSCILLATOR_LIMIT["exact"] = DRAG_LIMIT["exact"] = math.inf
OSCILLATOR_LIMIT["taylor"], DRAG_LIMIT["taylor"] = SERIES_LIMITS
OSCILLATOR_LIMIT |= {name: truth.limit for name, truth in (*TRUTHS.items(), *NYSTROM.items())}
OSCILLATOR_LIMIT |= {name: limit for name, (limit, _) in MULTISTEP_LIMITS.items()}
DRAG_LIMIT |= {name: limit for name, (_, limit) in MULTISTEP_LIMITS.items()}
DRAG_LIMIT |= dict.fromkeys(TRUTHS, math.inf) | {name: truth.damping or 0.0 for name, truth in NYSTROM.items()}


def oscillator_limit(name: str) -> float:
    """Return the largest omega0 h without growth on the undamped oscillator."""
    return OSCILLATOR_LIMIT[name] if name in OSCILLATOR_LIMIT else stability_limit(name)


def drag_limit(name: str) -> float:
    """Return the largest gamma h without growth under linear drag alone; 0 for a method that takes no drag."""
    if name in DRAG_LIMIT:
        return DRAG_LIMIT[name]
    return 0.0 if "velocity_free" in integrators.get(name).needs else damping_limit(name)


def regains(name: str) -> bool:
    """Return whether steps far beyond the limit damp the oscillator."""
    return name in REGAINING if name in OSCILLATOR_LIMIT else spectral_radius(name, 1e3) < 1.0
