"""The model that is fitted to a recording: a scene, the start of its motion, and a sensor with a zero and a scale.

``angle_i = zero + scale theta(t_i)`` at the times t_i of a recording, with theta simulated from the release on; for a
gyroscope theta' and for an accelerometer the specific force in place of theta. The start and the zero are always
fitted, the scale and parameters of the scene on request.

Between the equal steps of simulated runs, angles are cubic curves, for all runs of a batch at once.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.engine.rollout import rollout
from pendulum_env.lab.inertial import Mount
from pendulum_env.physics.damping import NONE, with_damping
from pendulum_env.physics.effects import DAMPINGS
from pendulum_env.physics.scene import Scene

Array = NDArray[np.float64]


def hermite(x: Array, step: float, derivative: int = 0) -> Array:
    """Return the cubic Hermite basis at ``x`` (0 to 1) between two steps, or its first or second derivative in time.

    The four rows of the result, shape ``(4, x)``, belong to the value and the slope at the first and the second step,
    which are ``step`` [s] apart.
    """
    if derivative == 2:
        bend = (12.0 * x - 6.0) / step**2
        return np.stack([bend, (6.0 * x - 4.0) / step, -bend, (6.0 * x - 2.0) / step])
    if derivative == 1:
        down = (6.0 * x * x - 6.0 * x) / step
        return np.stack([down, 3.0 * x * x - 4.0 * x + 1.0, -down, 3.0 * x * x - 2.0 * x])
    up = x * x * (3.0 - 2.0 * x)
    return np.stack([1.0 - up, step * x * (1.0 - x) ** 2, up, step * x * x * (x - 1.0)])


def between(time: Array, step: float, count: int, derivative: int = 0) -> Any:
    """Return the matrix that interpolates curves at given times from ``count`` values and slopes at equal steps.

    The product of the sparse matrix and the values above the slopes, shape ``(2 count, curves)``, is the cubic Hermite
    interpolation or its derivative, ``(times, curves)``.

    Args:
        time: times [s], from 0 on.
        step: time between two steps [s]; the first one is at 0.
        count: number of steps at which the curves are known.
        derivative: 0 for the curves, 1 or 2 for their derivatives in time.
    """
    from scipy.sparse import csr_array

    cell = np.clip((time / step).astype(np.intp), 0, count - 2)
    basis = hermite(time / step - cell, step, derivative)
    places = np.stack([cell, cell + count, cell + 1, cell + 1 + count], axis=1)
    ends = np.arange(0, 4 * len(time) + 1, 4)
    return csr_array((basis.T.ravel(), places.ravel(), ends), shape=(len(time), 2 * count))


def spline_slopes(values: Array, step: float) -> Array:
    """Return the slopes at equal steps of the cubic splines through ``values``, shape ``(steps, curves)``.

    The splines have continuous second derivatives, and third derivatives that are continuous at the second and at the
    last but one step ("not-a-knot"). Source: de Boor 1978, A Practical Guide to Splines, chapter IV.

    Args:
        values: values at the steps, at least four of them.
        step: time between two steps [s].
    """
    from scipy.linalg import solve_banded

    rises = np.diff(values, axis=0) / step
    right = np.empty_like(values)
    np.add(rises[1:], rises[:-1], out=right[1:-1])
    right[1:-1] *= 3.0
    right[0], right[-1] = 2.5 * rises[0] + 0.5 * rises[1], 2.5 * rises[-1] + 0.5 * rises[-2]
    bands = np.ones((3, len(values)))
    bands[1, 1:-1] = 4.0
    bands[0, 1] = bands[2, -2] = 2.0
    return np.asarray(solve_banded((1, 1), bands, right, overwrite_ab=True, overwrite_b=True, check_finite=False))


ANGLE, VELOCITY, ZERO = "angle", "velocity", "zero"
LENGTH, GRAVITY = "length", "gravity"
START = (ANGLE, VELOCITY, ZERO)
"""Parameters that every fit has besides those of the scene."""
SCALE = "scale"
DISTANCE = "sensor_distance"
TILT = "tilt"
"""Distance of an accelerometer from the pivot, which is fitted unless it is known, and the angle of its reading from
the rod, which is fitted if it feels a force across the rod."""
UNITS = {ANGLE: "rad", VELOCITY: "rad/s", ZERO: "rad", SCALE: "1", DISTANCE: "m", TILT: "rad"}
SENSOR = (*START, SCALE, DISTANCE, TILT)
"""Parameters of a fit that do not belong to the scene."""
METHOD = "tsit5"
STEPS = 64
"""Steps per small-angle period. With cubic Hermite interpolation between them, the error is below 4e-7 of the amplitude
up to 170 degrees."""
RATE_STEPS = 128
"""Steps per small-angle period for readings of a gyroscope or an accelerometer, as the derivatives of the interpolation
are less accurate."""
DECOY = 1e-3
"""Relative change of the parameters in an extra first run, so that no parameter is equal in all runs of a batch and the
compiled program takes all of them as arguments."""


@dataclass(frozen=True, eq=False)
class Model:
    """A scene and the parameters that are fitted.

    Attributes:
        scene: the scene with the model's dampings, and further dampings set to 0 so that models can share compiled
            code.
        damping: the model's dampings, by their names in ``damping=``.
        names: names of the fitted parameters: the start and the zero (START), "scale" if it is fitted, then parameters
            of the scene as :meth:`Scene.replace` names them.
        time: times of the recording [s], from 0.
        rate: True if the sensor is a gyroscope, whose readings are ``zero + scale theta'(t_i)`` [rad/s].
        mount: how an accelerometer is mounted, whose readings are ``zero + scale force(t_i)`` [m/s²]; None for others.
    """

    scene: Scene
    damping: tuple[str, ...]
    names: tuple[str, ...]
    time: Array
    rate: bool = False
    mount: Mount | None = None

    @classmethod
    def of(
        cls,
        scene: Scene,
        damping: tuple[str, ...],
        time: Array,
        free: tuple[str, ...] = (LENGTH,),
        program: tuple[str, ...] = (),
        rate: bool = False,
        mount: Mount | None = None,
    ) -> Model:
        """Return the model of a scene with the given dampings in place of the scene's own.

        Args:
            scene: the pendulum and its surroundings.
            damping: the model's dampings, by their names in ``damping=``.
            time: times of the recording [s], from 0.
            free: parameters to fit besides those of the dampings: parameters of the scene, or "scale".
            program: all dampings whose terms are compiled, including those of the model.
            rate: True for readings of a gyroscope.
            mount: how an accelerometer is mounted, for its readings.
        """
        wanted = idle(dict.fromkeys((*program, *damping)))
        own = [_fitted(name) for name in damping if DAMPINGS[name].fitted]
        known = mount is None or mount.distance is not None, mount is None or not mount.turned
        place = tuple(name for name, there in zip((DISTANCE, TILT), known, strict=True) if not there)
        return cls(with_damping(scene, wanted or NONE), damping, (*START, *free, *place, *own), time, rate, mount)

    @property
    def title(self) -> str:
        """The model's dampings joined by "+", as in ``damping=``; "none" without damping."""
        return "+".join(self.damping) or NONE

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the fitted parameters other than those of the start, the sensor's zero and the dampings."""
        own = {*START, *self.numbers}
        return tuple(name for name in self.names if name not in own)

    @property
    def numbers(self) -> tuple[str, ...]:
        """Names of the fitted damping parameters, one for every damping that has one."""
        return tuple(_fitted(name) for name in self.damping if DAMPINGS[name].fitted)

    @property
    def least(self) -> Array:
        """Lower bounds of the fitted parameters: 0, but no bound for the start, the sensor's zero and its tilt."""
        return np.array([-math.inf if name in (*START, TILT) else 0.0 for name in self.names])

    def until(self, count: int) -> Model:
        """Return the model restricted to the first ``count`` times of the recording."""
        return replace(self, time=self.time[:count])

    def angles(self, values: Array) -> Array:
        """Return the sensor's readings, shape ``(runs, times)``, for parameters of shape ``(runs, names)``.

        They are angles [rad], angular velocities [rad/s] of a gyroscope, or specific forces [m/s²] of an accelerometer,
        and nan after a run stopped early.
        """
        return self._seen(values, (0,))[0]

    def motion(self, values: Array) -> tuple[Array, Array]:
        """Return the sensor's readings and the derivatives in time of the motion they show, both ``(runs, times)``."""
        readings, rates = self._seen(values, (0, 1))
        return readings, rates

    def _seen(self, values: Array, derivatives: tuple[int, ...]) -> list[Array]:
        """Simulate runs and interpolate readings (derivative 0) or their rates (1) at the model's times."""
        rows = np.atleast_2d(values)
        step = self.step_for(rows[0])
        time, angle, velocity = self._runs(rows, step)
        ended = ~(np.isfinite(angle) & np.isfinite(velocity))
        curve, slope = np.where(ended, 0.0, angle).T, np.where(ended, 0.0, velocity).T
        if self.mount is not None:
            curve = self._forces(self.mount, curve, slope, step, rows)
            slope = spline_slopes(curve, step)
        ends = np.concatenate([curve, slope])
        last = np.searchsorted(time, self.time, side="right").clip(max=len(time) - 1) if ended.any() else None
        found = []
        for derivative in derivatives:
            seen = np.ascontiguousarray((between(self.time, step, len(time), derivative + self.rate) @ ends).T)
            if last is not None:
                seen[ended[:, last]] = math.nan
            if not derivative:
                seen *= rows[:, self.names.index(SCALE), None] if SCALE in self.names else 1.0
                seen += rows[:, self.names.index(ZERO), None]
            found.append(seen)
        return found

    def step_for(self, values: Array) -> float:
        """Return the step of a simulation with the given parameter values [s]."""
        return math.tau / self.scene_with(values).omega0 / (RATE_STEPS if self.rate or self.mount else STEPS)

    def nodes(self, values: Array, step: float) -> tuple[Array, Array, Array]:
        """Return the curves from which readings are interpolated: times of the steps [s], values and slopes there.

        The cubic Hermite interpolation of the curve has the sensor's readings as values or, of a gyroscope, as slopes.

        Args:
            values: parameters, shape ``(runs, names)``.
            step: step of the simulation [s], the same for all runs.

        Values and slopes have the shape ``(runs, steps)``; they are nan after a run stopped early.
        """
        rows = np.atleast_2d(values)
        time, angle, velocity = self._runs(rows, step)
        scale = rows[:, self.names.index(SCALE), None] if SCALE in self.names else 1.0
        zero = rows[:, self.names.index(ZERO), None]
        value, slope = scale * angle, scale * velocity
        if self.rate:
            return time, value + zero * time, slope + zero
        return time, value + zero, slope

    def _forces(self, mount: Mount, angle: Array, velocity: Array, step: float, rows: Array) -> Array:
        """Return the specific forces of simulated runs at an accelerometer after every step, ``(steps, runs)``.

        Accelerations are the slopes of a cubic spline through the velocities.
        """
        known = {GRAVITY: self.scene.gravity, DISTANCE: mount.distance, TILT: mount.tilt}
        own = [rows[:, self.names.index(name)] if name in self.names else value for name, value in known.items()]
        return np.asarray(mount.force(angle, velocity, spline_slopes(velocity, step), *own))

    def rest(self, values: Array) -> float:
        """Return the reading of the sensor at the equilibrium, for given parameter values."""
        given = dict(zip(self.names, values, strict=True))
        force = 0.0 if self.mount is None else self.mount.rest * given.get(GRAVITY, self.scene.gravity)
        return float(given[ZERO] + given.get(SCALE, 1.0) * force)

    def _runs(self, rows: Array, step: float) -> tuple[Array, Array, Array]:
        """Simulate a batch of runs; return the times of the steps [s], and angles and velocities, ``(runs, steps)``.

        The engine compiles a parameter as a constant if it is equal in all runs, and would compile a new program for
        every new set of constants. An extra run in front, whose parameters differ from all others, avoids equal
        parameters. It is the same in every call, because programs are cached by the scene of the first run.
        """
        given = dict(zip(self.names, rows.T, strict=True))
        start = [np.append(given[name][0], given[name]) for name in (ANGLE, VELOCITY)]
        numbers: dict[str, Any] = {
            name: np.append(value * (1.0 + DECOY) + 1e-9, given.get(name, np.full(len(rows), value)))
            for name, value in self._varied.items()
        }
        duration = max(float(self.time[-1]), step) + step
        run = rollout(self._on_rod, integrator=METHOD, angle=start[0], velocity=start[1], dt=step, duration=duration,
                      diagnostics=(), warn=False, num_threads=1, **numbers)
        return run.time, run.angle[1:], run.velocity[1:]

    @cached_property
    def _varied(self) -> dict[str, float]:
        """Values, by name and as in the model's scene, of all parameters that differ between the runs of a batch.

        These are the length (of other bodies than a bob, the measure that they name), the free parameters of the scene,
        and those of all compiled dampings.
        """
        own = [effect for effect in self.scene.effects if effect.kind == "dissipative" and effect.fitted]
        known = self.scene.parameters()
        varied = (self.scene.body.fitted, *self.free)
        values = {name: float(known[name] or 0.0) for name in varied if name not in SENSOR}
        return {**values, **{_fitted(effect.damping): float(getattr(effect, effect.fitted)) for effect in own}}

    @cached_property
    def _on_rod(self) -> Scene:
        """The model's scene with a rod as suspension, because fits do not model a slack wire."""
        return self.scene.replace(body=self.scene.body.taut())

    def scene_with(self, values: Array) -> Scene:
        """Return the model's scene with the given parameter values, and with only the dampings of the model."""
        own = {name: float(x) for name, x in zip(self.names, values, strict=True) if name not in SENSOR}
        return with_damping(self.scene, self.title).replace(**own)


def unit_of(scene: Scene, name: str) -> str:
    """Return the unit of a fitted parameter, such as "rad" or "1/s"; KeyError for an unknown name."""
    if name in UNITS:
        return UNITS[name]
    owners = {effect.name: effect for effect in scene.effects}
    part, _, own = name.rpartition(".")
    for owner in (owners[part],) if part in owners else (scene, scene.body, scene.medium, *scene.effects):
        for entry in fields(owner):  # type: ignore[arg-type]
            if entry.name == own and "unit" in entry.metadata:
                return str(entry.metadata["unit"])
    raise KeyError(name)


def _fitted(name: str) -> str:
    """Return the full name, as "linear_drag.gamma", of the parameter of a damping that a fit determines."""
    return f"{DAMPINGS[name].name}.{DAMPINGS[name].fitted}"


def idle(names: Iterable[str]) -> dict[str, dict[str, float]]:
    """Return named dampings as a dict for ``with_damping``, with the parameter that a fit determines, if any, set to 0.
    """
    return {name: {DAMPINGS[name].fitted: 0.0} if DAMPINGS[name].fitted else {} for name in names}
