"""Result of a fit of driven logs: parameters with errors, a scene, the sensor's settings, and predictions of logs."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.provenance import provenance
from pendulum_env.common.results import Column, Columns, columns_of, one_line
from pendulum_env.common.saved import Savable
from pendulum_env.common.texts import LONGEST, listed
from pendulum_env.lab.checked import RecordingError, one_number
from pendulum_env.lab.driven.log import DRIVES, DrivenLog
from pendulum_env.lab.driven.problem import BOUNDS, DrivenSolution
from pendulum_env.lab.driven.windows import DELAY, DRIVE, DRY, LAG, RATES, STIFFNESS, VISCOUS, ZERO, Windows, start_at
from pendulum_env.lab.fitting.base import FitResult
from pendulum_env.lab.fitting.core import derivatives
from pendulum_env.lab.fitting.grade import Fault, Grade
from pendulum_env.lab.fitting.intervals import Scatter
from pendulum_env.lab.measures import upper_limit
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import BearingFriction, CoulombFriction, Gravity, Motor
from pendulum_env.physics.scene import Run, Scene
from pendulum_env.physics.sensor import Sensor
from pendulum_env.physics.units import shown, whole_number

Array = NDArray[np.float64]

CONSTANTS = {"action": ("max_torque", "N m"), "torque": ("torque_scale", "1"), "current": ("motor_constant", "N m/A")}
"""Kind of drive -> name and unit of the torque for one unit of the drive."""
NEAR_START = 0.02
"""Readings from which the start of a prediction is taken: within this share of the period of small swings."""
WEAK = 3.0
"""A drive whose effect is below this number of standard errors does not visibly move the pendulum."""
MOST_LOST = 0.3
"""Largest share of the logs' duration that may be left out of a usable fit."""
FINEST = 16
"""Most integration steps in a control step of an environment with the fitted delay."""
DRAWS = 1000
"""Draws from which the parameters of episodes are taken."""
TRIALS = 100
"""Draws from the normal distribution for every sample, until all are within their bounds."""


@dataclass(frozen=True, eq=False, repr=False)
class DrivenPrediction(Savable):
    """Open-loop prediction of a log: the fitted pendulum, simulated from one start under the drive of the log.

    Attributes:
        time: time since the start of the prediction [s].
        angle, recorded: predicted and recorded angle [rad].
    """

    time: Array
    angle: Array
    recorded: Array

    def __repr__(self) -> str:
        return one_line(self, f"{len(self.time)} readings in {self.time[-1]:.4g} s")

    @property
    def error(self) -> Array:
        """Predicted minus recorded angle at every time [rad], not wrapped."""
        return np.asarray(self.angle - self.recorded)

    def error_after(self, seconds: float) -> float:
        """Return the size of the error of the angle after a time [rad]; RecordingError beyond the prediction's end."""
        at = one_number(seconds, "seconds", least=0.0)
        if at > self.time[-1]:
            raise RecordingError(f"the prediction lasts {self.time[-1]:.4g} s, got {at:g} s")
        return abs(float(np.interp(at, self.time, self.error)))


@dataclass(frozen=True, eq=False, repr=False)
class DrivenFit(FitResult):
    """Fit of one pendulum and motor to logs of driven runs.

    Attributes:
        logs: the logs.
        solution: the fit in the numbers of the equation of motion.
        gravity: gravity [m/s²].
        known: the quantity that was given to set the scale of all torques, "inertia", "moment" or "mass";
            "torque" if the log's torques set it, "" if a mass of 1 kg was assumed.
        value: value of the known quantity.
        peak: largest torque of the scene's motor [N m]; None: the largest of the logs.
    """

    logs: tuple[DrivenLog, ...]
    solution: DrivenSolution
    gravity: float
    known: str
    value: float
    peak: float | None = None

    def __repr__(self) -> str:
        return one_line(self, f"{self.source}, rms {self.solution.rms:.2g} rad")

    @property
    def source(self) -> str:
        """Names of the logs in at most 100 characters; of many, the first ones and the number of others."""
        return listed([log.source for log in self.logs])

    @property
    def kind(self) -> str:
        """Kind of the drive: "action", "torque" or "current"."""
        return self.logs[0].kind

    def _of(self, rates: Array) -> dict[str, float]:
        """Return the fitted parameters by name, from the numbers of the equation of motion."""
        stiffness, viscous, dry, drive, delay, lag, zero = rates.tolist()
        inertia = {"inertia": self.value, "moment": self.value * self.gravity / stiffness, "torque": 1.0 / drive,
                   }.get(self.known, self.value * (self.gravity / stiffness) ** 2)
        values = {"length": self.gravity / stiffness, "inertia": inertia, "moment": inertia * stiffness / self.gravity,
                  "bearing_viscosity": inertia * viscous, "friction_torque": inertia * dry,
                  CONSTANTS[self.kind][0]: inertia * drive, "delay": delay, "lag": lag, "zero": zero}
        left_out = {self.known} if self.known in values else set()
        left_out |= {CONSTANTS[self.kind][0]} if self.known == "torque" else set()
        return {name: value for name, value in values.items() if name not in left_out}

    @cached_property
    def _slopes(self) -> Array:
        """Derivatives of all parameters by the fitted numbers of the equation of motion, by central differences."""
        free, rates = list(self.solution.free), self.solution.rates

        def found(rows: Array) -> Array:
            every = np.tile(rates, (len(rows), 1))
            every[:, free] = rows
            return np.array([[*self._of(row).values()] for row in every])

        steps = 1e-5 * np.maximum(np.abs(rates[free]), 1e-3)
        return derivatives(found, rates[free], steps, np.full(len(free), -math.inf), central=True)[1]

    @cached_property
    def _fitted(self) -> list[int]:
        """Places of the parameters that depend on a fitted number."""
        return np.flatnonzero(np.abs(self._slopes).max(axis=1)).tolist()

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the fitted parameters, in the order of ``values`` and ``covariance``."""
        names = tuple(self._of(self.solution.rates))
        return tuple(names[i] for i in self._fitted)

    @cached_property
    def values(self) -> Array:
        """Values of the fitted parameters, an array."""
        return np.array(list(self._of(self.solution.rates).values()))[self._fitted]

    @cached_property
    def covariance(self) -> Array:
        """Covariance matrix of the fitted parameters, by their derivatives with respect to the equation's numbers."""
        slopes = self._slopes[self._fitted]
        return np.asarray(slopes @ self.solution.covariance @ slopes.T)

    @property
    def units(self) -> dict[str, str]:
        """Units of the fitted parameters by name."""
        units = {"length": "m", "inertia": "kg m^2", "moment": "kg m", "bearing_viscosity": "N m s",
                 "friction_torque": "N m", "delay": "s", "lag": "s", "zero": "rad", **dict([CONSTANTS[self.kind]])}
        return {name: units[name] for name in self.names}

    @property
    def least(self) -> Array:
        """Lower bounds of the fitted parameters, an array: 0, but -inf for the zero and the delay of a measured drive.
        """
        free = {"zero"} if DELAY in BOUNDS[self.kind] else {"zero", "delay"}
        return np.array([-math.inf if name in free else 0.0 for name in self.names])

    @property
    def freedom(self) -> float:
        """Degrees of freedom of Student's t for intervals."""
        return self.solution.freedom

    @property
    def residual(self) -> Array:
        """Reading minus model of each reading of the windows [rad], an array."""
        return self.solution.residual

    @cached_property
    def quantum(self) -> float:
        """Step between readings of the encoder [rad]; 0 if the logs show none."""
        return max(log.quantum for log in self.logs)

    @cached_property
    def noise(self) -> float:
        """Standard deviation of a reading of the angle before its rounding [rad], from successive residuals."""
        whole = float(np.median(self.solution.sigma))
        return math.sqrt(max(whole * whole - self.quantum * self.quantum / 12.0, 0.0))

    @property
    def settings(self) -> dict[str, Any]:
        """Delays and sensor of the bench, as JSON: ``observation_delay`` and ``action_delay`` [s], and ``sensor`` with
        quantum, noise, offset [rad], scale and rate [Hz].

        A log determines only the sum of both delays, which is given as ``action_delay``. A measured torque's delay
        belongs to its recording and not to the motor, and is left out.
        """
        rate = 1.0 / min(float(np.median(np.diff(log.time))) for log in self.logs)
        delay = 0.0 if DRIVES[self.kind].measured else float(self.solution.rates[DELAY])
        sensor = {"quantum": self.quantum, "noise": self.noise, "offset": float(self.solution.rates[ZERO]),
                  "scale": 1.0, "rate": float(f"{rate:.4g}")}
        return {"observation_delay": 0.0, "action_delay": delay, "sensor": sensor}

    @property
    def environment(self) -> dict[str, Any]:
        """Keywords for ``gym.make("LabPendulum-v0", ...)``: the bench with its sensor and its delay.

        The control step is the time between readings; there is one reading for each, so that the sensor has no rate of
        its own. The observation is "encoder", with a velocity from readings. The delay of an action is rounded to whole
        integration steps, of which there are as many as make the rounding smaller than a quarter of the delay's error,
        at most 16.
        """
        settings, dt = self.settings, self.scene.run.dt
        delay = max(settings["action_delay"], 0.0)
        error = self.parameters["delay"].error if "delay" in self.names else 0.0
        late = {n: round(delay * n / dt) * dt / n for n in range(1, FINEST + 1)}
        substeps = next((n for n in late if abs(late[n] - delay) <= 0.25 * error), FINEST if delay else 1)
        sensor = Sensor(**{**settings["sensor"], "rate": None})
        return {"scene": self.scene, "dt": dt, "substeps": substeps, "observation": "encoder", "sensor": sensor,
                "action_delay": late[substeps]}

    @cached_property
    def scatter(self) -> Scatter:
        """Distribution of the scene's parameters for ``gym.make(..., scene=found.scene, randomize=found)``: a draw is
        one of 1000 of :meth:`sample`. Raises RecordingError if hardly any draw is within the bounds.
        """
        columns = {name: values for name, values in self.sample(DRAWS).items() if name != "scene" and np.ptp(values)}
        rows = np.stack([*columns.values()], axis=1)
        own = self._scene_values(self.solution.rates)
        return Scatter(tuple(columns), np.array([own[name] for name in columns]), np.atleast_2d(np.cov(rows.T)),
                       np.full(len(columns), -math.inf), rows)

    @cached_property
    def scene(self) -> Scene:
        """The fitted pendulum and its motor as a scene: a point mass with the same period and moment of inertia."""
        return self._scene(self.solution.rates)

    def _scene(self, rates: Array) -> Scene:
        own = self._scene_values(rates)
        dt = float(f"{min(float(np.median(np.diff(log.time))) for log in self.logs):.3g}")
        longest = max(float(log.time[-1] - log.time[0]) for log in self.logs)
        effects = (Gravity(), BearingFriction(bearing_viscosity=own["bearing_viscosity"]),
                   CoulombFriction(friction_torque=own["friction_torque"]),
                   Motor(max_torque=own["max_torque"], lag=own["lag"]))
        name = f"fitted to {listed([log.source for log in self.logs], LONGEST - len('fitted to '))}"
        return Scene(name, Body(length=own["length"], mass=own["mass"], radius=own["length"] / 20.0), effects=effects,
                     gravity=self.gravity, run=Run(angle=0.0, dt=dt, duration=longest))

    def _scene_values(self, rates: Array) -> dict[str, float]:
        """Return length, mass, friction and motor of the scene for given numbers of the equation of motion."""
        length = self.gravity / rates[STIFFNESS]
        own = self._of(rates)
        inertia = own.get("inertia", self.value)
        largest = max(float(np.abs(log.drive).max()) for log in self.logs) if self.kind != "action" else 1.0
        peak = inertia * float(rates[DRIVE]) * largest if self.peak is None else self.peak
        return {"length": float(length), "mass": float(inertia / length**2),
                "bearing_viscosity": float(inertia * rates[VISCOUS]), "friction_torque": float(inertia * rates[DRY]),
                "max_torque": float(peak), "lag": float(rates[LAG])}

    def sample(self, n: int, seed: int = 0) -> dict[str, Any]:
        """Draw ``n`` random scenes that agree with this fit, as keywords for ``gym.make_vec`` or ``rollout``.

        Returns the scene, and arrays of n values of length, mass, friction and motor, from the normal distribution of
        the equation's numbers within their bounds. Raises SceneError for a number or seed out of range, RecordingError
        if hardly any draw is within the bounds.
        """
        count, source = whole_number(n, "n"), np.random.default_rng(whole_number(seed, "seed", least=0))
        free, rates = list(self.solution.free), self.solution.rates
        least = np.array([BOUNDS[self.kind].get(place, 1e-9 if place in (STIFFNESS, DRIVE) else -math.inf)
                          for place in free])
        covariance = self.solution.covariance
        if (at := np.flatnonzero(rates[free] <= least)).size:  # those at their bounds stay there
            rest = np.setdiff1d(np.arange(len(free)), at)
            part = covariance[np.ix_(rest, at)] @ np.linalg.pinv(covariance[np.ix_(at, at)], hermitian=True)
            covariance = covariance[np.ix_(rest, rest)] - part @ covariance[np.ix_(at, rest)]
            free, least = [free[i] for i in rest], least[rest]
        rows: list[Array] = []
        for _ in range(TRIALS):
            drawn = source.multivariate_normal(rates[free], covariance, count)
            rows += list(drawn[(drawn >= least).all(axis=1)])
            if len(rows) >= count:
                break
        else:
            raise RecordingError("hardly any random draw is within the bounds of 0; the logs determine too little")
        scenes = []
        for row in rows[:count]:
            one = rates.copy()
            one[free] = row
            scenes.append(self._scene_values(one))
        fixed = {"lag"} if LAG not in free else set()
        return {"scene": self.scene, **{name: np.array([scene[name] for scene in scenes]) for name in scenes[0]
                                        if name not in fixed}}

    def predict(self, log: DrivenLog, start: float | None = None, duration: float | None = None) -> DrivenPrediction:
        """Simulate a log's motion under its own drive, with this fit's numbers, from readings near the start alone.

        The start is a parabola through the readings within 2 % of a period of small swings.

        Args:
            log: a log with a drive of the same kind.
            start: time in the log at which the prediction starts [s]; None: its first reading.
            duration: length of the prediction [s]; None: to the end of the log.

        Raises RecordingError for another kind of drive, and for times outside of the log.
        """
        if not isinstance(log, DrivenLog) or log.kind != self.kind:
            raise RecordingError(f"log must be a DrivenLog with the drive {self.kind!r}, got {shown(log)}")
        first = float(log.time[0]) if start is None else one_number(start, "start")
        last = float(log.time[-1]) if duration is None else first + one_number(duration, "duration", above=0.0)
        low, high = float(log.time[0]), float(log.time[-1])
        if not low <= first < last <= high + 1e-9 * (high - low):
            raise RecordingError(f"{log.source}: a prediction from {first:g} to {last:g} s must lie within the log, "
                                 f"{low:g} to {high:g} s")
        omega0 = math.sqrt(self.solution.rates[STIFFNESS])
        windows = Windows.of((log,), 10.0 * (last - first), omega0, first - float(log.time[0]),
                             float(log.time[-1]) - last)
        if not windows.places:
            raise RecordingError(f"{log.source}: a prediction from {first:g} to {last:g} s has too few readings; give "
                                 "a longer duration or an earlier start")
        begin = np.array([[start_at(log, first, NEAR_START * math.tau / omega0)]])
        angle = windows.angles(self.solution.rates[None, :], begin)[0]
        place = windows.places[0]
        time = log.time[place.first : place.last] - first
        return DrivenPrediction(time, angle, windows.angle)

    @cached_property
    def grade(self) -> Grade:
        """Grade of the fit: usable, usable with exceptions, or not usable, with the reasons; see its ``text``."""
        solution, faults = self.solution, []
        drive = solution.free.index(DRIVE) if DRIVE in solution.free else None
        if drive is not None and solution.rates[DRIVE] < WEAK * math.sqrt(solution.covariance[drive, drive]):
            faults.append(Fault(f"the {self.kind} does not visibly move the pendulum: its effect is below {WEAK:g} "
                                "standard errors", True))
        if solution.lost:
            spans = ", ".join(f"{self.logs[i].source} {first:.3g} to {last:.3g} s" for i, first, last in solution.lost)
            share = sum(last - first for _, first, last in solution.lost) / sum(
                float(log.time[-1] - log.time[0]) for log in self.logs)
            faults.append(Fault(f"the {self.kind} does not explain {100.0 * share:.2g} % of the logs, which are left "
                                f"out, for example because a hand pushes ({spans})", share > MOST_LOST))
        if any(solution.torque_noise):
            span = solution.windows.h * solution.windows.steps
            faults.append(Fault(f"the residual, {solution.rms:.2g} rad within {span:.2g} s, is larger than the "
                                "sensor's error, probably because of torques missing from the logs; the errors of the "
                                "parameters allow for them",
                                False))
        return Grade(tuple(faults))

    @property
    def limits(self) -> str:
        """Sentences on the quantities that these logs cannot determine, and on the assumptions made instead."""
        sentences = []
        if self.known == "torque":
            sentences.append("All torques, the moment of inertia and the moment of the mass are in units of the log's "
                             "torque: if it is 20 % too large, so are they. Give inertia= or moment= to fit its scale.")
        elif not self.known:
            sentences.append("The motion shows torques only per moment of inertia; a mass of 1 kg at the fitted length "
                             "is assumed; give mass=, inertia= or moment=.")
        if DELAY in self.solution.free:
            late = "A negative delay means that its column is late. " if DRIVES[self.kind].measured else ""
            sentences.append(f"Delays of the {self.kind} and of the angle show only as their sum. {late}".strip())
        if LAG in self.solution.free and abs(self.correlation("delay", "lag")) > 0.95:
            sentences.append("Delay and lag are hard to tell apart here; their sum is better known than each of them.")
        return " ".join(sentences)

    @property
    def text(self) -> str:
        """The result in a few sentences: grade, parameters at their bounds, and limits of the logs."""
        bounds = (f"{name}: {self.parameter_text(name)}." for name in self.at_bound)
        return "\n".join(filter(None, (self.grade.text, *bounds, self.limits)))

    @property
    def details(self) -> str:
        """Sentences on what the result is based on: windows and residual, sensor."""
        windows, sensor = self.solution.windows, self.settings["sensor"]
        return "\n".join((
            f"{len(windows.places)} windows of about {windows.h * windows.steps:.3g} s: residual "
            f"{math.degrees(self.solution.rms):.3g}° rms, the error of a reading is "
            f"{math.degrees(float(np.median(self.solution.sigma))):.2g}°.",
            f"Sensor: quantum {math.degrees(sensor['quantum']):.4g}°, noise {math.degrees(sensor['noise']):.2g}°, zero "
            f"{math.degrees(sensor['offset']):.3g}°, {sensor['rate']:g} readings per second."))

    def origin(self) -> dict[str, str]:
        """Return logs, grade, scene and versions, which are written into output files."""
        return provenance(recording=[log.source for log in self.logs],
                          notes=[note for log in self.logs for note in log.notes],
                          grade=self.grade.text, scene=self.scene.to_dict())

    def tables(self) -> dict[str, Columns]:
        """Return the tables of the fit: parameters; log, window, time, reading and residual."""
        ends = [self.interval(name) for name in self.names]
        windows, residual = self.solution.windows, self.residual
        rows = [(windows.logs[window.log].source, number, *row)
                for number, (window, part) in enumerate(zip(windows.places, windows.slices, strict=True))
                for row in zip(windows.logs[window.log].time[window.first : window.last].tolist(),
                               windows.angle[part].tolist(), residual[part].tolist(), strict=True)]
        units = {"log": "", "window": "", "time_s": "s", "recorded_rad": "rad", "residual_rad": "rad"}
        return {"parameters": self.parameter_columns({"low": Column([one.low for one in ends]),
                                                      "high": Column([one.high for one in ends])}, {}),
                "residuals": columns_of(units, rows)}

    def to_dict(self, **more: Any) -> dict[str, Any]:
        """Return parameters, settings and grade as a dict that JSON can hold; a parameter at its bound has the limit
        ``below`` which it is with 95 %. ``more`` are further keys."""
        limits = {name: {"below": upper_limit(self.parameters[name], self.freedom)} for name in self.at_bound}
        return {"parameters": {name: {"value": one.value, "error": one.error, "unit": one.unit, **limits.get(name, {})}
                               for name, one in self.parameters.items()},
                "rates": dict(zip(RATES, self.solution.rates.tolist(), strict=True)), **self.settings,
                "grade": self.grade.text, "limits": self.limits, **more}
