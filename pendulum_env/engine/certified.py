"""A run, and an environment, beside another at half the step; see :mod:`pendulum_env.engine.certificate`.

The second one is the same program on another state, so that nothing more is compiled.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.engine.certificate import ESTIMATE, Past, Yardstick, endless, halved, motion_of
from pendulum_env.engine.each import frequency
from pendulum_env.engine.machine import (
    ANGLE,
    INDEX,
    NOWHERE,
    TURNS,
    TWO_PI,
    UNSEEN,
    VELOCITY,
    Machine,
    check_diagnostics,
    reported,
)
from pendulum_env.engine.shape import DIVERGED, STOP_REASONS
from pendulum_env.physics.units import truth

if TYPE_CHECKING:
    from pendulum_env.engine.rollout import Rollout

Array = NDArray[np.float64]

STRETCH = 2**14
"""Steps of a single run that are compared at a time."""
PAST = ("low", "high", "fastest")
"""What an environment keeps of its episode: range of the angle [rad], largest |velocity| [rad/s]."""


def yardstick_of(machine: Machine, h: float) -> Yardstick:
    """What differences of a machine's runs with steps of ``h`` [s] are measured by."""
    numbers = {**machine.scene.coefficients, "omega0": frequency(machine.scene)}
    return Yardstick.of(machine.scene, machine.method, h, numbers, machine.compensated, bool(machine.tolerance))


def parameters_of(machine: Machine, half: bool) -> Any:
    """A machine's parameters for a run that only the finite range ends, with its steps or with half of them."""
    given = dict(zip(machine.numbers, machine.parameters, strict=True))
    return machine.array((halved(given) if half else endless(given)).values())


def checked_estimate(diagnostics: Sequence[str], asked: Any) -> tuple[tuple[str, ...], bool]:
    """What programs report, and whether the error is to be estimated: asked for by itself, or in ``diagnostics``."""
    found = check_diagnostics(diagnostics)
    return reported(found), truth(asked, "estimate_error") or reported(found) != found


# --- single runs ----------------------------------------------------------------------------------------------------


def with_estimates(machine: Machine, start: Any, run: Rollout, control: float) -> Rollout:
    """A run of a machine from a state, with estimates of its error.

    The run is made again, and another at half the step, and the two are compared after every step. From where either
    leaves the finite range, inf, and at the end of a run that diverged.
    """
    h, marks = run.dt, np.rint(run.time / run.dt)
    runs = [(machine.array(start), parameters_of(machine, half), h / (1 + half), 1 + half) for half in (False, True)]
    yardstick, first = yardstick_of(machine, h), float(start[ANGLE]) + TWO_PI * float(start[TURNS])
    past = Past(np.array([first]), np.array([float(start[VELOCITY])]))
    found = np.full((2, len(marks)), math.inf)
    total, done = int(marks[-1]), 0
    while done < total or total == done == 0:
        count = min(STRETCH, total - done)
        columns = []
        for state, parameters, step, stride in runs:
            out = np.full((count + 1, machine.width), math.nan)
            machine.run(state, parameters, control, step, count, stride, math.inf, out, UNSEEN)
            reached = int(state[INDEX]) // stride - done
            columns.append((out[: reached + 1, ANGLE] + TWO_PI * out[: reached + 1, TURNS],
                            out[: reached + 1, VELOCITY]))
        rows = min(len(angle) for angle, _ in columns)
        angles, velocities = ([column[i][:rows, None] for column in columns] for i in (0, 1))
        index = np.arange(done, done + rows, dtype=np.float64)[:, None]
        judged = past.judged(yardstick, index, (angles[0], angles[1]), (velocities[0], velocities[1]))
        here = (marks >= done) & (marks < done + rows)
        found[:, here] = judged[(marks[here] - done).astype(np.intp), :, 0].T
        if rows <= count or total == 0:
            break
        done += count
    if run.stop_reason == STOP_REASONS[DIVERGED]:
        found[:, -1] = math.inf
    return replace(run, error_estimate=found[0], velocity_error_estimate=found[1])


# --- one environment ------------------------------------------------------------------------------------------------


class CertifiedMachine(Machine):
    """A machine whose state holds, behind its own numbers, those at half the step, PAST and the error estimate.

    ``run`` advances both; it records nothing. ``info`` has "error_estimate" beside the rest.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._run, self._told, self._own = self.run, self.info, len(self.names)
        self.names = (*self.names, *(f"half_{name}" for name in self.names), *PAST, ESTIMATE)
        self._half_parameters = parameters_of(self, half=True)
        self._unread = (*self.watched.values(), *range(self.phi, self._own))
        self._yardstick: Yardstick | None = None
        self.run, self.info = self._both, self._with_estimate

    def state(self, angle: float, velocity: float, uniform: Sequence[float] = ()) -> Any:
        own = super().state(angle, velocity, uniform)
        half = own[: self._own]
        unwrapped = float(half[ANGLE]) + TWO_PI * float(half[TURNS])
        return self.array([*half, *half, unwrapped, unwrapped, abs(velocity), 0.0])

    def _both(
        self, state: Any, parameters: Any, control: float, h: float, rows: int, every: int, speed_limit: float,
        out: Any, seen: Any,
    ) -> int:
        code = int(self._run(state, parameters, control, h, rows, every, speed_limit, out, seen))
        own, index = self._own, float(state[INDEX])
        half = state[own : 2 * own]
        more = int(2.0 * index - half[INDEX])
        if more > 0:
            self._run(half, self._half_parameters, control, 0.5 * h, 1, more, math.inf, NOWHERE, UNSEEN.copy())
            for place in self._unread:
                half[place] = 0.0
            state[own : 2 * own] = half
        low, high, fastest, before = (float(value) for value in state[2 * own :])
        angles, velocities = zip(*(motion_of(values) for values in (state, half)), strict=True)
        low, high, fastest = min(low, angles[0]), max(high, angles[0]), max(fastest, abs(velocities[0]))
        found, trusted = math.inf, False
        if code != DIVERGED and float(half[INDEX]) == 2.0 * index and before != math.inf:
            if self._yardstick is None or self._yardstick.h != h:
                self._yardstick = yardstick_of(self, h)
            found, _, trusted = self._yardstick(index, angles, velocities, high - low, fastest, min, max, math.sqrt)
        for place, value in enumerate((low, high, fastest, found if trusted else math.inf), 2 * own):
            state[place] = value
        return code

    def _with_estimate(self, values: list[float]) -> dict[str, float]:
        return {**self._told(values), ESTIMATE: values[-1]}


def machine_class(diagnostics: Sequence[str]) -> type[Machine]:
    """What runs one environment with these diagnostics."""
    return CertifiedMachine if "error" in check_diagnostics(diagnostics) else Machine
