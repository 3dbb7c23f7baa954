"""Basins of attraction of a driven scene: for each start of a grid, the attractor that its motion ends in."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators import Method
from pendulum_env.common.checks import shown
from pendulum_env.common.progress import Progress, told_by, with_bar
from pendulum_env.common.provenance import provenance
from pendulum_env.common.results import Column, Columns, Result, one_line
from pendulum_env.common.texts import Table
from pendulum_env.engine.kernels import Backend
from pendulum_env.engine.motion import drive_rate
from pendulum_env.engine.settings import SceneLike
from pendulum_env.engine.spec import RunSpec
from pendulum_env.engine.threads import MOST_THREADS, cores
from pendulum_env.physics.damping import Damping
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, naming_keywords, number, whole_number
from pendulum_env.study.section import (
    ANGLE,
    MOST,
    REPEATS,
    STEPS,
    TRANSIENT,
    VELOCITY,
    WANTED,
    checked_scene,
    state_points,
    wrapped,
)

__all__ = ["Basins", "basins"]

Array = NDArray[np.float64]

SIZE, MOST_SIZE = 300, 4000
"""Default and largest number of starts along each side of the grid."""
LAST = 2 * REPEATS + 1
"""Number of states of each run that are compared."""
CLOSE = 1e-3
"""Largest distance of two states of one attractor [rad, and rad/s over the drive's rate]."""
UNSETTLED, STOPPED = 0, -1
"""Numbers in ``which`` of a motion that does not repeat, and of a run that ended early."""


@dataclass(frozen=True, repr=False)
class Basins(Result):
    """The attractor of each start of a grid.

    Attributes:
        scene, method: the scene and the name of the method.
        transient, steps: periods of the drive before attractors are compared, and steps per period.
        angle: starting angles [rad], shape (size,).
        velocity: starting velocities [rad/s], shape (size,).
        which: array (velocities, angles): number of the attractor from 1 on, 0 for a motion that does not repeat
            (chaos, or a long transient), -1 for a run that ended early.
        attractors: for each attractor an array (periods, 2) of its states (angle [rad], velocity [rad/s]), one for each
            period of the drive, in the order of time. The attractor with the largest basin is the first.
    """

    scene: Scene
    method: str
    transient: int
    steps: int
    angle: Array
    velocity: Array
    which: NDArray[np.intp]
    attractors: tuple[Array, ...]

    def __repr__(self) -> str:
        size = f"{len(self.velocity)} x {len(self.angle)} starts"
        return one_line(self, f"{self.scene.name}, {self.method}, {size}, {len(self.attractors)} attractors")

    def origin(self) -> Mapping[str, str]:
        """Return scene, method, steps and transient, and the states of every attractor."""
        return provenance(
            Scene=self.scene.to_dict(), Method=self.method, StepsPerPeriod=self.steps, TransientPeriods=self.transient,
            Attractors=[states.tolist() for states in self.attractors])

    def tables(self) -> Mapping[str, Columns]:
        """Return the number of the attractor of every start, as of ``which``."""
        angle, velocity = np.meshgrid(self.angle, self.velocity)
        return {"basins": {"angle_rad": Column(angle.ravel().tolist(), "rad"),
                           "velocity_rad_per_s": Column(velocity.ravel().tolist(), "rad/s"),
                           "attractor": Column(self.which.ravel().tolist())}}

    def grid(self) -> Sequence[str]:
        """Return the columns that number the starts."""
        return ("angle_rad", "velocity_rad_per_s")

    def share(self, number: int) -> float:
        """Return the share of the starts that end in an attractor, 0 to 1; see ``which`` for its number."""
        return float(np.mean(self.which == number))

    @property
    def table(self) -> Table:
        """Table of the attractors: their period, a state of each, and the share of the starts."""
        rows = [(str(i), f"{len(states)} period{'s' * (len(states) > 1)}", f"{states[0, 0]:.4f}", f"{states[0, 1]:.4f}",
                 percent(self.share(i))) for i, states in enumerate(self.attractors, start=1)]
        rows += [("-", word, "", "", percent(share)) for word, place in (
            ("does not repeat", UNSETTLED), ("ended early", STOPPED)) if (share := self.share(place))]
        return Table(("attractor", "repeats after", "angle [rad]", "velocity [rad/s]", "basin"), tuple(rows))


def percent(share: float) -> str:
    """Return a share of the starts as percent; a small one is not rounded to 0."""
    return f"{100.0 * share:.1f} %" if share >= 0.0005 else "< 0.1 %"


@with_bar("basins")
def basins(
    scene: SceneLike = "chaotic",
    *,
    integrator: str | Method = "rk4",
    damping: Damping = "scene",
    size: int = SIZE,
    angles: tuple[float, float] = (-math.pi, math.pi),
    velocities: tuple[float, float] = (-3.0, 3.0),
    transient: int = TRANSIENT,
    steps: int = STEPS,
    num_threads: int | None = None,
    backend: Backend = "auto",
    progress: Progress | bool | None = None,
    **parameters: Any,
) -> Basins:
    """Return the basins of attraction of a scene with one periodic drive.

    A grid of ``size`` x ``size`` starts is simulated, from the middles of equal cells. After ``transient`` periods of
    the drive, two runs have the same attractor if their states at whole periods repeat after equal numbers of periods
    (up to 16) and the last state of one is a state of the other, to 1e-3 rad (Grebogi, Ott & Yorke 1987, Science 238,
    632).

    Args:
        scene: preset name, dict, Scene, or a scene's JSON file.
        integrator, damping, backend: as in :func:`pendulum_env.rollout`.
        size: number of starts along each side.
        angles, velocities: lowest and highest start [rad, rad/s].
        transient: periods of the drive before attractors are compared.
        steps: steps of the method per period of the drive.
        num_threads: number of threads; None uses every core. The results are equal bit by bit.
        progress: True shows a progress bar, False none; by default a notebook shows one for work over 1.5 s. A
            function is called with the fraction done and a word for it.
        **parameters: single parameters of the scene, such as ``drive_torque=1.2``.

    Raises SceneError or MethodError for invalid arguments, and for a scene with no drive or with several.
    """
    with naming_keywords(basins):
        place = checked_scene(scene, damping, parameters)
        size = whole_number(size, "size", MOST_SIZE)
        columns, lines = _middles(angles, "angles", "rad", size), _middles(velocities, "velocities", "rad/s", size)
        steps, transient = whole_number(steps, "steps", MOST), whole_number(transient, "transient", MOST, least=0)
        threads, tell = cores() if num_threads is None else whole_number(
            num_threads, "num_threads", MOST_THREADS), told_by(progress)
    q, v = (start.ravel() for start in np.meshgrid(columns, lines))
    rate = drive_rate(place, WANTED)
    h = 2.0 * math.pi / rate / steps
    spec = RunSpec.of(scene, integrator, damping, parameters, angle=q, velocity=v, dt=h, every=steps, diagnostics=(),
                      duration=(transient + 2 * REPEATS) * steps * h, backend=backend)
    spec.tell()
    runs = spec.runs(threads)
    last = np.empty((0, 2, len(q)))
    for rows in runs.rows(tell):
        last = np.concatenate([last, rows[-LAST:, [ANGLE, VELOCITY]]])[-LAST:]
    angle = wrapped(last[:, 0]) if place.periodic else last[:, 0]
    states = np.stack([angle, last[:, 1]], axis=-1)
    which, attractors = _sorted_out(states, state_points(angle, last[:, 1] / rate))
    return Basins(place, spec.method.name, transient, steps, columns, lines, which.reshape(size, size), attractors)


def _middles(ends: Any, name: str, unit: str, size: int) -> Array:
    """Return the middles of ``size`` equal cells between two ends; SceneError unless the first end is the lower one."""
    try:
        low, high = ends
        if isinstance(ends, (str, bytes)):
            raise TypeError
    except (TypeError, ValueError):
        raise SceneError(f"{name} must be two numbers [{unit}], the lowest first, not {shown(ends)}.") from None
    first, last = number(low, name, unit=unit), number(high, name, unit=unit)
    if not first < last or not math.isfinite(last - first):
        raise SceneError(f"{name} must be two numbers [{unit}], the lowest first, not {first:g} and {last:g}.")
    return first + (last - first) * (np.arange(size) + 0.5) / size


def _sorted_out(states: Array, points: Array) -> tuple[NDArray[np.intp], tuple[Array, ...]]:
    """Return the number of each run's attractor, and the states of the attractors, by the size of their basins.

    ``states`` are the last states of the runs at whole periods of the drive, an array (periods, runs, 2); ``points``
    the same in coordinates whose distances do not depend on turns, with velocities in units of the drive's rate.
    """
    whole = np.isfinite(points).all(axis=(0, 2))
    period = np.zeros(points.shape[1], dtype=np.intp)
    for k in range(REPEATS, 0, -1):
        gap = np.abs(points[k:] - points[:-k]).max(axis=(0, 2))
        period[whole & (gap < CLOSE)] = k
    which = np.where(whole, UNSETTLED, STOPPED).astype(np.intp)
    found: list[Array] = []
    left = np.flatnonzero(period)
    while left.size:
        k, cycle = period[left[0]], points[-period[left[0]] :, left[0]]
        near = np.abs(points[-1, left][:, None] - cycle).max(axis=2).min(axis=1) < CLOSE
        same = near & (period[left] == k)
        found.append(states[-k:, left[0]])
        which[left[same]] = len(found)
        left = left[~same]
    order = np.argsort([-np.count_nonzero(which == i) for i in range(1, len(found) + 1)], kind="stable")
    number_of = np.zeros(len(found) + 1, dtype=np.intp)
    number_of[order + 1] = np.arange(1, len(found) + 1)
    return np.where(which > 0, number_of[which], which), tuple(found[i] for i in order)
