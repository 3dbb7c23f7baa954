"""Leading errors of methods on the oscillator, from outside the package; most splittings are in splitting_truths."""

from __future__ import annotations

from typing import Any

from implicit_truths import RATIONAL, errors_of_rational
from multistep_truths import ERRORS
from nystrom_truths import NYSTROM
from runge_kutta_truths import STABILITY, errors_from_stability

# Local errors of angle and velocity (computed minus exact), growth rate and detuning on the oscillator, by
# hand: Runge-Kutta from log R(w) - w at w = iz (Hairer & Wanner 1996, IV.3); symplectic Euler and Verlet from
# cos(phi) = 1 - z**2/2, so phi = 2 asin(z/2) = z + z**3/24 (Hairer, Lubich & Wanner 2006, I.1 and I.5); Chin's from
# cos(phi) = 1 - z**2/2 + z**4/24 - z**6/864.
LEADING_ERRORS: dict[str, tuple[Any, ...]] = {
    "forward_euler": (("-1/2", 2), ("-1/2", 2), ("1/2", 1), ("-1/3", 2)),
    "backward_euler": (("1/2", 2), ("1/2", 2), ("-1/2", 1), ("-1/3", 2)),
    "symplectic_euler": (("1/2", 2), ("-1/2", 2), None, ("1/24", 2)),
    "symplectic_euler_position_first": (("-1/2", 2), ("1/2", 2), None, ("1/24", 2)),
    "conformal_symplectic_euler": (("1/2", 2), ("-1/2", 2), None, ("1/24", 2)),
    "velocity_verlet": (("-1/6", 3), ("1/12", 3), None, ("1/24", 2)),
    "position_verlet": (("1/12", 3), ("-1/6", 3), None, ("1/24", 2)),
    "midpoint": (("-1/6", 3), ("-1/6", 3), ("1/8", 3), ("1/6", 2)),
    "heun": (("-1/6", 3), ("-1/6", 3), ("1/8", 3), ("1/6", 2)),
    "ralston": (("-1/6", 3), ("-1/6", 3), ("1/8", 3), ("1/6", 2)),
    "two_stage": (("-1/6", 3), ("-1/6", 3), ("1/8", 3), ("1/6", 2)),
    "kutta3": (("-1/24", 4), ("-1/24", 4), ("-1/24", 3), ("1/30", 4)),
    "ssp_rk3": (("-1/24", 4), ("-1/24", 4), ("-1/24", 3), ("1/30", 4)),
    "bs3": (("-1/24", 4), ("-1/24", 4), ("-1/24", 3), ("1/30", 4)),
    "rk4": (("-1/120", 5), ("-1/120", 5), ("-1/144", 5), ("-1/120", 4)),
    "rk4_38": (("-1/120", 5), ("-1/120", 5), ("-1/144", 5), ("-1/120", 4)),
    "dopri5": (("1/3600", 6), ("1/3600", 6), ("-1/3600", 5), ("1/2100", 6)),
    **{name: errors_from_stability(*terms) for name, terms in STABILITY.items()},
    "implicit_midpoint": (("1/12", 3), ("1/12", 3), None, ("-1/12", 2)),
    "discrete_gradient": (("1/12", 3), ("1/12", 3), None, ("-1/12", 2)),
    "exact": (None, None, None, None),
    "chin4a": (("-1/720", 5), ("1/1080", 5), None, ("-1/4320", 4)),
    "taylor": errors_from_stability(12, "0", "0"),
    **{name: errors_of_rational(*terms) for name, terms in RATIONAL.items()},
    **{name: truth.errors for name, truth in NYSTROM.items()},
    **ERRORS,
}
