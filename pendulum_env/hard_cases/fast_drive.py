"""Hard cases: fast drives: Kapitza's pendulum at the edges of stability, a torque that jumps, and gusts."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from pendulum_env.hard_cases.case import Case, follows, foreseen, unit
from pendulum_env.hard_cases.predicted import Motion
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import (
    Gravity,
    Gusts,
    LinearDrag,
    Motor,
    QuadraticDrag,
    SmallAngleGravity,
    VerticalDrive,
    Wind,
)
from pendulum_env.physics.medium import Medium
from pendulum_env.physics.scene import Scene
from pendulum_env.truth.answer import Array

GROUP = "fast drive"

# --- Kapitza's pendulum at the edges of stability --------------------------------------------------------------------

SHAKEN, SLOWNESS = 20.0, 0.05
"""Angular frequency of the pivot [rad/s], and the ratio of omega0 to it."""
LOWER, UPPER = 0.07078795806129157, 0.45821858211327277
"""Amplitudes b/L of the pivot between which the upright position is stable, to 16 digits.

They solve a_0(2 b/L) = -4 ratio² = b_1(2 b/L) with Mathieu's characteristic values a_0 and b_1.
"""
PERIODS, TILT = 8, 1e-6
"""Periods of the run, and initial tilt [rad]."""


def edge(share: float) -> str:
    """Return the name of the case of Kapitza's upright pendulum with the pivot amplitude b/L = ``share``."""
    name, limit = ("lower", LOWER) if share < 0.2 else ("upper", UPPER)
    where = "at" if share == limit else f"{abs(share / limit - 1.0):.0%} {'below' if share < limit else 'above'}"
    return f"upright, {where} the {name} edge"


def _kapitza(share: float) -> Case:
    """Return the case of Kapitza's upright pendulum with the pivot amplitude b/L = ``share``."""
    scene = unit("a pivot shaken fast", Gravity(), VerticalDrive(vertical_amplitude=share, vertical_rate=SHAKEN),
                 gravity=(SLOWNESS * SHAKEN) ** 2)
    motion = Motion(edge(share), scene, edge(share), math.pi - TILT, 0.0, 2.0 * math.pi / SHAKEN * PERIODS,
                    marks=PERIODS, growth=5e4, largest=TILT, pace=SHAKEN, goal=1e-4, angles=True, sensitive=True)
    return foreseen(
        GROUP, motion,
        "Close to the limit of stability errors grow as the square of the time and may make a stable motion grow.",
        "the tilt after each period of the pivot is Chebyshev's T_n of half the trace of Mathieu's equation; the "
        "error is that of the method's formula",
        "Hill 1886, Acta Math. 8, 1; Whittaker & Watson 1927, 19.42; edges: McLachlan 1947; DLMF 28.17")


# --- a motor that changes sign each step ----------------------------------------------------------------------------

ANSWER = 0.05
"""Full torque over m g L, which is the equilibrium angle under full torque [rad]."""
PUSHED = unit("small angles with a motor", SmallAngleGravity(), Motor(max_torque=ANSWER * 9.81))


def torqued(name: str, shares: Array, phase: float, start: float, most: int) -> Motion:
    """Return the motion of a small swing under fractions of the full torque, with 1 to ``most`` steps for each.

    ``phase`` is omega0 times the time of one torque; the motion starts at rest at ``start`` [rad].
    """
    return Motion(name, PUSHED, "linear", start, 0.0, phase * len(shares), marks=len(shares), most=most,
                  torques=tuple(ANSWER * shares), largest=start + ANSWER)


def _flipping(name: str, phase: float, most: int, why: str, each: str) -> Case:
    """Return the case of full torque that changes its sign after ``phase``/omega0, in 1 to ``most`` steps."""
    shares = np.where(np.arange(60) % 2, -1.0, 1.0)
    motion = torqued(name, shares, phase, 0.3, most)
    return foreseen(GROUP, motion, why, f"a rotation for each {each}; the error is that of the method's formula",
                    "rotations about the equilibrium angle (Landau & Lifshitz 1976, section 22)")


# --- gusts ----------------------------------------------------------------------------------------------------------

LENGTH, MASS, RADIUS, DENSITY, C_D, LINEAR = 0.353, 0.0027, 0.02, 1.2, 0.45, 0.1
BODY, AIR = Body(length=LENGTH, mass=MASS, radius=RADIUS), Medium("air", DENSITY, 1.8e-5)
WIND, GUST, GUST_TIME = 3.0, 1.0, 0.5
"""Steady wind and standard deviation of gusts [m/s], and correlation time of gusts [s]."""
SEED, CONTROL, COUNT, TURNED = 7, 0.1, 50, 0.5
"""Seed, control step [s], number of control steps, and initial angle [rad]."""


def in_wind(scene: Scene, count: int) -> Motion:
    """Return the motion of a scene whose wind changes ``count`` times."""
    return Motion(scene.name, scene, scene.name, TURNED, 0.0, CONTROL * scene.omega0 * count, marks=count, growth=10.0,
                  pace=2.0, goal=1e-5, most=64, sensitive=True)


SHARES = (0.9 * LOWER, LOWER, 1.1 * LOWER, 0.97 * UPPER, UPPER, 1.03 * UPPER)
"""Amplitudes b/L of the pivot on both sides of the stability edges."""
GUSTY = in_wind(Scene("gusts", BODY, AIR, gravity=9.81,
                      effects=(Gravity(), QuadraticDrag(drag_coefficient=C_D), LinearDrag(gamma=LINEAR), Wind(WIND),
                               Gusts(gust_speed=GUST, gust_time=GUST_TIME))), COUNT)

CASES = (
    *(_kapitza(share) for share in SHARES),
    _flipping("torque changing sign each control step", 2.0, 64,
              "The force jumps at each control step, and its mean is nearly zero.", "control step"),
    _flipping("torque changing sign each step", 0.5, 1,
              "The force jumps at each step, so that forces of earlier steps say nothing about the next step.", "step"),
    foreseen(GROUP, GUSTY,
             "Gusts change the wind speed at random at each control step and not between, so that the force jumps.",
             "Taylor series in 40 digits in each control step, with gusts computed independently, as scipy's DOP853 "
             "finds them; the error is that of the method's formula",
             "Uhlenbeck & Ornstein 1930; L'Ecuyer 1999; Hairer, Norsett & Wanner 1993, II.5",
             partial(follows, GUSTY, seed=SEED)),
)
