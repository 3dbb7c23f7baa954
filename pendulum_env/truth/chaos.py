"""Reference numbers of the chaotic driven pendulum of Baker & Gollub, computed without this package.

The tests compute them again, with 40-digit Taylor series or with scipy's DOP853 and the first variation.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pendulum_env.truth.answer import Truth


class Doubling(NamedTuple):
    """Period doubling: the drive at which an orbit loses stability to one of twice its period.

    Attributes:
        periods: periods of the drive after which the orbit repeats.
        strength: strength of the drive at the doubling, to nine digits.
        published: published strength to four places; in the first doubling cut off, not rounded.
        orbit: state of the orbit at phase 0 of the drive.
        range: change of the strength up to which the orbit exists.
        slope: derivative of ``1 + trace + determinant`` of the Poincaré map's Jacobian by the strength, three digits.
    """

    periods: int
    strength: float
    published: float
    orbit: Truth
    range: float
    slope: float


class Exponent(NamedTuple):
    """Largest Lyapunov exponent [1/s].

    Attributes:
        value, error: the exponent and its standard error.
        scatter: standard deviation of the exponent of one motion over SPAN periods.
    """

    value: float
    error: float
    scatter: float

    def spread(self, periods: float) -> float:
        """Return the standard deviation [1/s] of an exponent that is measured over a number of periods of the drive."""
        return self.scatter * math.sqrt(SPAN / periods)


SPAN = 2000
"""Periods of the drive in which the scatter of an exponent was measured."""
SERIES = "Taylor series of order 36 in 40 digits, 48 steps a period; with 60 steps of order 40 it differs by 1e-27"
PERIOD = 3.0 * math.pi
"""Period of the drive [s]."""

_PERIODS: tuple[tuple[float, float, float, float, float], ...] = (
    (-6.308406913972585, 1.2975114936381074, 0.01308886781304984, 0.05902932223002471, 10.22),
    (-11.80306078723289, -0.025693720483862564, 0.734791402044317, -0.26425468198283625, 168.8),
    (-18.87079953329635, 1.3523333717260089, 0.011173434335475393, 0.003596338998300461, 13.76),
    (-23.34074155023236, 0.038819571427760866, 0.14471098583954292, 0.056214297215453526, 428.0),
    (-31.497160984876825, 1.4054639926998886, -0.017528298392326242, -0.35879963970948925, 1002.0),
    (-34.51062851759178, 0.910785723200408, -13.196641139651081, -10.022154783038555, 4.635e+4),
    (-37.582549644417384, 0.5926650858819171, 0.8155239933120233, 0.008469969761446807, 2294.0),
    (-44.04084481922072, 1.4213398781121904, 0.0027450522033721594, 0.11713141929048113, 338.3),
    (-46.34751279878069, 1.4606858228242028, 4.326900273378264, 3.1304990904506247, 1.553e+4),
    (-46.968089980048035, 0.9946585598498597, 73.22718964348303, 55.90880683072325, 2.68e+5),
    (-50.13861009167862, 0.5611556808959864, 18.933780880559354, -42.04206791499303, 1.341e+5),
    (-56.605133667781175, 1.4251790096699903, 2.793778459236977, 4.7932520887678205, 1.615e+4),
    (-58.75995386478556, 1.5701262285904192, 192.13126149664004, 133.9984570979321, 6.819e+5),
    (-57.26882821548308, 2.2642717754278285, 1931.1835273328245, 262.3726232327217, 5.673e+6),
    (-49.122289572394685, 1.8822463258741782, -968.0460020135513, 933.591337549296, 3.915e+6),
    (-46.40291802895571, 1.459688300372425, -889.2843747635072, -661.301686820147, 3.226e+6),
)
_COLUMNS = np.array(_PERIODS).T

MOTION = Truth(PERIOD * np.arange(1.0, len(_PERIODS) + 1.0), _COLUMNS[0], _COLUMNS[1], 4e-15, SERIES)
"""Chaotic motion from rest at 0.2 rad at drive strength 1.5, after 1, 2, ... periods of the drive, to rounding."""
BY_START = _COLUMNS[2:4].T
"""Derivatives of the angle and velocity of ``MOTION`` by the starting angle [1, 1/s]."""
AMPLIFIED = tuple(_COLUMNS[4].tolist())
"""Integral of |D(t) D(s)⁻¹| over s from 0 to t [s], in the Frobenius norm, after 1, 2, ... periods of the drive.

D(t) is the derivative of the state of ``MOTION`` at time t by the state at the start.
"""


def _orbit(angle: float, velocity: float, error: float) -> Truth:
    """Return a state on a periodic orbit as a reference; after one period it recurs to within ``error``."""
    return Truth(np.zeros(1), np.array([angle]), np.array([velocity]), error, "DOP853 brings it back")


DOUBLINGS = (
    Doubling(1, 1.0663728625, 1.0663, _orbit(-0.22147489973431525, 1.9596599331982114, 2e-8), 0.03, -35.3),
    Doubling(2, 1.0793139059, 1.0793, _orbit(-2.1149066599968838, 1.416524163977911, 2e-8), 0.005, -167.0),
)
"""Period doublings; published strengths from Taylor 2005, Classical Mechanics, table 12.1, and Baker & Gollub 1996."""

QUIET_STRENGTH, QUIET = 0.9, _orbit(-0.5602283290650862, 1.9335855133167923, 1e-11)
"""A drive strength at which the motion is periodic with the drive, and the state at phase 0 of the drive."""

EXPONENTS = {
    1.15: Exponent(0.09924, 0.00005, 0.00320),
    1.2: Exponent(0.13179, 0.00004, 0.00276),
    1.5: Exponent(0.11250, 0.00003, 0.00207),
}
"""Drive strength -> largest Lyapunov exponent.

Computed with ``python tests/support/exponents.py``: the mean over 2048 independent motions of 2000 periods each, by
RK4 and the first variation, and over 2048 others by two motions 1e-8 apart with SciPy's DOP853, see the README of
:mod:`pendulum_env.hard_cases`.
"""
