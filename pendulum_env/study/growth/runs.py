"""One method followed over very many periods, and looked at now and then."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pendulum_env.engine.machine import ANGLE, INDEX, TURNS, TWO_PI, UNSEEN, VELOCITY, Machine, simulate
from pendulum_env.engine.shape import STOP_REASONS
from pendulum_env.study.energy_scale import energy_scale
from pendulum_env.study.evaluations import SAMPLES, evaluations_per_step
from pendulum_env.truth.long_runs import LongTruth, on

Array = NDArray[np.float64]

ROWS = 24
"""States that are looked at around each time."""
TINY = 1e-100
"""Numbers of a state below this are taken for 0: a motion that dies out would end in numbers that processors are slow
with."""
ROUNDS = 3
"""So often the step of an implicit method is chosen anew, by the evaluations counted at the one before."""


@dataclass
class LongRun:
    """A machine, its start [rad, rad/s] and its step ``h`` [s]; ``period`` of small swings [s].

    Attributes:
        angle_error, own, energy_error: what was found around each mark: the largest angle error [rad], the truth's own
            [rad], and |energy residual| over the energy at the start, or over the largest where that is 0.
        stop_reason, stopped: why and when it ended early [s].
    """

    machine: Machine
    angle: float
    velocity: float
    h: float
    period: float
    angle_error: list[float] = field(default_factory=list)
    own: list[float] = field(default_factory=list)
    energy_error: list[float] = field(default_factory=list)
    stop_reason: str = ""
    stopped: float = math.inf

    @property
    def stride(self) -> int:
        """Steps between states that are looked at."""
        return max(1, math.floor(self.period / self.h / ROWS))

    @property
    def reach(self) -> float:
        """How long before a mark they begin: a period, or ROWS steps [s]."""
        return max(self.period, ROWS * self.h)

    @property
    def work(self) -> float:
        """About how long a simulated second takes, in force evaluations."""
        return self.machine.method.evaluations * (10.0 if self.machine.method.implicit else 1.0) / self.h

    def follow(self, marks: Array, truth: LongTruth, told: Callable[[float], None]) -> None:
        """Run to the last of the marks [s], told now and then of the time reached [s]; fills the lists as it goes."""
        machine, h = self.machine, self.h
        state = machine.state(self.angle, self.velocity)
        machine.advance(state, 0.0, h, 0)
        initial = most = float(machine.ledger(state, 0.0).energy)
        near = np.empty((0, 4))
        for mark in marks:
            end, now = round(mark / h), round(state[INDEX])
            rows = min(max(0, end - now), math.ceil(self.reach / h)) // self.stride
            code = on(machine, state, h, end - now - rows * self.stride, lambda steps: told(steps * h))
            out = np.empty((rows + 1, machine.width))
            if not code:
                code = machine.run(state, machine.parameters, 0.0, h, rows, self.stride, math.inf, out, UNSEEN)
            if code:
                self.stop_reason, self.stopped = STOP_REASONS[code], float(state[INDEX]) * h
                return
            near = near[near[:, 0] > end - math.ceil(self.reach / h)]
            if rows:
                angle, _, own = truth.at(out[1:, INDEX] * h)
                ledger = machine.ledger(out[1:], initial)
                error = np.abs(out[1:, ANGLE] + TWO_PI * out[1:, TURNS] - angle)
                near = np.concatenate([near, np.stack([out[1:, INDEX], error, own, np.abs(ledger.residual)], axis=-1)])
                most = max(most, float(np.max(ledger.energy)))
            largest = near[:, 1:].max(axis=0, initial=0.0)
            self.angle_error.append(float(largest[0]))
            self.own.append(float(largest[1]))
            self.energy_error.append(float(largest[2]) / energy_scale(machine.scene, (initial, most))[0])
            for i, value in enumerate(state):
                state[i] = value if abs(value) > TINY else 0.0
            told(float(state[INDEX]) * h)


def cost_of_step(machine: Machine, angle: float, velocity: float, period: float, h: float) -> float:
    """Force evaluations in a step of ``h`` [s], counted in two periods if implicit."""
    if not machine.method.implicit:
        return float(machine.method.evaluations)
    every = max(1, round(2.0 * period / h / SAMPLES))
    states, _ = simulate(machine, angle, velocity, h=h, rows=SAMPLES, every=every)
    found = evaluations_per_step(machine, states[:, ANGLE] + TWO_PI * states[:, TURNS], states[:, VELOCITY], h)
    return found if math.isfinite(found) else float(machine.method.evaluations)


def step_for(machine: Machine, angle: float, velocity: float, period: float, evaluations: float) -> float:
    """The step [s] with which a method takes so many force evaluations in a period."""
    each = float(machine.method.evaluations)
    for _ in range(ROUNDS if machine.method.implicit else 0):
        each = cost_of_step(machine, angle, velocity, period, period * each / evaluations)
    return period * each / evaluations
