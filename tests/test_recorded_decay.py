"""A scene of the stated geometry with fitted damping follows a filmed pendulum for all of its 71 swings.

The film: string 0.65 ± 0.01 m, bob 41.5 g, 116 s at 20 Hz from 40 degrees. Fitted by least squares of all 2330 angles
are the start, the length, the camera's zero, and two numbers of the damping at most.
"""

from __future__ import annotations

import math
import os
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import least_squares

from pendulum_env import Rollout, Scene, rollout
from pendulum_env.lab import Recording, period, small_amplitude_period, turning_points
from pendulum_env.physics.body import Body
from pendulum_env.physics.damping import with_damping
from pendulum_env.physics.effects import FiniteBob, Gravity
from pendulum_env.physics.medium import air

DATA = os.environ.get("LAB_PENDULUM_DATA", "")
pytestmark = pytest.mark.skipif(not DATA, reason="LAB_PENDULUM_DATA names no folder of real recordings")

STEEL = (3 * 0.0415 / (4 * math.pi * 7850)) ** (1 / 3)
"""Radius of a steel ball of the bob's mass, whose own is not stated [m]."""
STATED = Scene(
    "filmed", Body(length=0.65, mass=0.0415, radius=STEEL, suspension="wire"), air(20.0), (Gravity(), FiniteBob())
)
DAMPINGS: dict[str, tuple[tuple[str, str, float], ...]] = {
    "linear": (("linear", "gamma", 0.02),),
    "quadratic+coulomb": (("quadratic", "c", 0.02), ("coulomb", "friction_torque", 1e-4)),
    "linear+quadratic": (("linear", "gamma", 0.01), ("quadratic", "c", 0.02)),
}
"""Effects, their numbers, and a guess of the size of each."""


class Fit:
    """A damping's numbers and the rest, fitted; ``residual`` in degrees."""

    def __init__(self, damping: str) -> None:
        self.recording, self.numbers = recorded(), DAMPINGS[damping]
        swing = self.recording.centred()
        small = small_amplitude_period(period(swing), turning_points(swing).amplitude)
        sizes = [size for _, _, size in self.numbers]
        guess = np.array([*swing.angle[:1], -0.5, 9.81 * (small.value / math.tau) ** 2, 0.01, *sizes])
        for count in (400, len(self.recording.time)):
            found = least_squares(
                self.misses, guess, args=(count,), x_scale=np.array([0.1, 0.5, 1e-3, 0.01, *sizes]),
                bounds=([-1.0, -4.0, 0.6, -0.1, *(0.0 for _ in sizes)], [1.0, 4.0, 0.7, 0.1, *(1.0 for _ in sizes)]),
            )
            guess = found.x
        self.angle, self.velocity, self.length, self.zero = guess[:4]
        self.damping = dict(zip((effect for effect, _, _ in self.numbers), guess[4:], strict=True))
        self.residual = np.degrees(found.fun)
        variance = float(found.fun @ found.fun) / (len(found.fun) - len(guess))
        self.errors = np.sqrt(np.diag(np.linalg.inv(found.jac.T @ found.jac)) * variance)
        self.run = self.runs(guess, len(self.recording.time))

    def runs(self, values: Any, count: int) -> Rollout:
        angle, velocity, length, _, *sizes = values
        wanted = {effect: {name: float(size)} for (effect, name, _), size in zip(self.numbers, sizes, strict=True)}
        scene = with_damping(STATED, wanted).replace(length=float(length))
        return rollout(scene, integrator="rk4", angle=angle, velocity=velocity, dt=0.02, diagnostics=(),
                       duration=self.recording.time[count - 1] + 0.02, warn=False)

    def misses(self, values: Any, count: int) -> Any:
        run = self.runs(values, count)
        model = CubicHermiteSpline(run.time, run.angle, run.velocity)(self.recording.time[:count])
        return model + values[3] - self.recording.angle[:count]

    @property
    def rms(self) -> float:
        return float(np.sqrt(np.mean(self.residual**2)))


@lru_cache
def recorded() -> Recording:
    return Recording.read(Path(DATA) / "video_decay_65cm.txt")


@lru_cache
def fitted(damping: str) -> Fit:
    return Fit(damping)


@pytest.mark.parametrize("damping", ["quadratic+coulomb", pytest.param("linear+quadratic", marks=pytest.mark.slow)])
def test_two_numbers_of_damping_follow_the_whole_recording(damping: str) -> None:
    """Within half a degree rms from 39 down to 11 degrees, of readings that scatter by 0.08 degrees.

    What is left is in the envelope, 1 degree too wide in the first third and too narrow at the end.
    """
    found = fitted(damping)
    assert len(found.residual) == 2330
    assert found.rms < 0.48
    assert np.max(np.abs(found.residual)) < 2.0
    assert max(np.sqrt(np.mean(quarter**2)) for quarter in np.array_split(found.residual, 4)) < 0.75
    assert envelope_gap(found) < 1.15


def test_linear_damping_alone_does_not() -> None:
    """Twice the misfit: 1.8 times the rms, and 2.2 degrees in the envelope."""
    linear, best = fitted("linear"), fitted("quadratic+coulomb")
    assert 0.8 < linear.rms < 1.0
    assert linear.rms > 1.7 * best.rms
    assert envelope_gap(linear) > 1.9 * envelope_gap(best)


def envelope_gap(found: Fit) -> float:
    """Largest difference of the amplitudes of half swings, model and recording [degrees]."""
    ours, theirs = (turning_points(series).amplitude for series in (found.run, found.recording.centred()))
    count = min(len(ours), len(theirs))
    assert count >= 140
    return float(np.max(np.abs(np.degrees(ours[:count] - theirs[:count]))))


def test_the_period_is_that_of_the_recording() -> None:
    found = fitted("quadratic+coulomb")
    ours, theirs = period(found.run, 69), period(found.recording.centred(), 69)
    assert ours.value == pytest.approx(theirs.value, rel=1e-4)


@pytest.mark.slow
def test_the_length_is_the_string_and_the_ball() -> None:
    """0.6633 m at g = 9.81 m/s²: beyond the stated 0.65 ± 0.01 m if that is the whole length, within it if the string
    ends where a steel ball begins. Models of damping move it by far less than the stated uncertainty."""
    lengths = {name: fitted(name).length for name in DAMPINGS}
    assert all(length == pytest.approx(0.6633, abs=5e-4) for length in lengths.values())
    best = fitted("quadratic+coulomb")
    assert best.errors[2] < 3e-5
    assert 0.01 < best.length - 0.65 < 0.015
    assert abs(best.length - (0.65 + STEEL)) < 0.01


def test_the_drag_is_ten_times_a_steel_balls() -> None:
    """C_d times the cross-section, from the fitted number, is 1.7e-3 m²: a steel ball's is 1.7e-4 m². So the bob is no
    steel ball, or the string and what held it dragged too; the recording does not say. At C_d = 0.46 it is a sphere of
    34 mm radius."""
    found = fitted("quadratic+coulomb")
    area = 2.0 * 0.0415 * found.damping["quadratic"] / (air(20.0).density * found.length)
    ball = 0.46 * math.pi * STEEL**2
    assert area == pytest.approx(1.7e-3, rel=0.05)
    assert 8.0 < area / ball < 12.0
    assert math.sqrt(area / 0.46 / math.pi) == pytest.approx(0.034, abs=0.001)
