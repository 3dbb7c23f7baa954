"""Problems q'' = a(t, q, v) of two published test sets, with their solutions at the end.

D and E are classes of DETEST (Hull, Enright, Fellen & Sedgwick 1972, SIAM J. Numer. Anal. 9, 603), PLEI and VDPOL of
the test set of Bari (Mazzia & Magherini 2008, Test Set for IVP Solvers). Functions use only arithmetic and ``lib``,
which is numpy or jax.numpy, so that every program gets the same formula.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

Acceleration = Callable[[Any, Any, Any, Any], Any]


@dataclass(frozen=True)
class Problem:
    """Acceleration a(lib, t, q, v), start, last time, and q at the end; None where no solution is published.

    ``free`` is True if a does not depend on v, and ``stiff`` for a stiff problem.
    """

    acceleration: Acceleration
    q: Any
    v: Any
    end: float
    truth: Any
    free: bool = False
    stiff: bool = False


def attracted(lib: Any, t: Any, q: Any, v: Any) -> Any:
    return -q / lib.sqrt(q[0] * q[0] + q[1] * q[1]) ** 3


def orbit(eccentricity: float) -> Problem:
    """Two bodies (DETEST D1 to D5), which Kepler's equation solves."""
    e, mean = eccentricity, 20.0
    anomaly = mean
    for _ in range(60):
        anomaly -= (anomaly - e * math.sin(anomaly) - mean) / (1.0 - e * math.cos(anomaly))
    truth = [math.cos(anomaly) - e, math.sqrt(1.0 - e * e) * math.sin(anomaly)]
    return Problem(attracted, [1.0 - e, 0.0], [0.0, math.sqrt((1.0 + e) / (1.0 - e))], 20.0, truth, free=True)


def seven_stars(lib: Any, t: Any, q: Any, v: Any) -> Any:
    """The Pleiades: star j of mass j draws the others; q holds the seven x, then the seven y."""
    x, y, mass = q[:7], q[7:], lib.arange(1.0, 8.0)
    dx, dy = x[None, :] - x[:, None], y[None, :] - y[:, None]
    distance = dx * dx + dy * dy + lib.eye(7)  # of a star to itself 1, where the difference is 0
    pull = mass[None, :] / distance**1.5
    return lib.concatenate([lib.sum(pull * dx, 1), lib.sum(pull * dy, 1)])


PLEIADES = [0.3706139143970502, 3.237284092057233, -3.222559032418324, 0.6597091455775310, 0.3425581707156584,
            1.562172101400631, -0.7003092922212495, -3.943437585517392, -3.271380973972550, 5.225081843456543,
            -2.590612434977470, 1.198213693392275, -0.2429682344935824, 1.091449240428980]

PROBLEMS: dict[str, Problem] = {
    "D1": orbit(0.1),
    "D3": orbit(0.5),
    "D5": orbit(0.9),
    "E1": Problem(lambda lib, t, q, v: -(v / (t + 1.0) + (1.0 - 0.25 / (t + 1.0) ** 2) * q),
                  0.6713967071418030, 0.09540051444747446, 20.0, math.sqrt(2.0 / (21.0 * math.pi)) * math.sin(21.0)),
    "E2": Problem(lambda lib, t, q, v: (1.0 - q * q) * v - q, 2.0, 0.0, 20.0, None),
    "E3": Problem(lambda lib, t, q, v: q * q * q / 6.0 - q + 2.0 * lib.sin(2.78535 * t), 0.0, 0.0, 20.0, None, True),
    "E4": Problem(lambda lib, t, q, v: 0.032 - 0.4 * v * v, 30.0, 0.0, 20.0,
                  30.0 + 2.5 * math.log(math.cosh(0.4 * math.sqrt(0.08) * 20.0))),
    "E5": Problem(lambda lib, t, q, v: lib.sqrt(1.0 + v * v) / (25.0 - t), 0.0, 0.0, 20.0,
                  0.5 * (25.0 * math.log(5.0) - (625.0 - 25.0) / 50.0)),
    "PLEI": Problem(seven_stars, [3.0, 3.0, -1.0, -3.0, 2.0, -2.0, 2.0, 3.0, -3.0, 2.0, 0.0, 0.0, -4.0, 4.0],
                    [0.0, 0.0, 0.0, 0.0, 0.0, 1.75, -1.5, 0.0, 0.0, 0.0, -1.25, 1.0, 0.0, 0.0], 3.0, PLEIADES, True),
    "VDPOL": Problem(lambda lib, t, q, v: 1000.0 * (1.0 - q * q) * v - q, 2.0, 0.0, 2000.0, 1.706167732170483,
                     stiff=True),
}
"""Name of a problem -> the problem. E2 and E3 have no closed form; the benchmark compares two programs there."""


def state(problem: Problem) -> np.ndarray[Any, Any]:
    """Return q and v at the start as one array, for programs for y' = f(t, y)."""
    return np.concatenate([np.atleast_1d(problem.q), np.atleast_1d(problem.v)]).astype(float)
