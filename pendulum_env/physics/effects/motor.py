"""A torque motor on the pivot's shaft."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from pendulum_env.physics.effects.effect import Effect, Kind
from pendulum_env.physics.effects.quadratic_drag import sinh_over
from pendulum_env.physics.elementary import exp
from pendulum_env.physics.surroundings import Surroundings
from pendulum_env.physics.units import SceneError, si


def motor_torque(control: float, motor_rate: float) -> float:
    return control * motor_rate


def motor_store(tilt: float, control: float, motor_rate: float) -> float:
    return -control * motor_rate * tilt


def lagging_torque(motor_share: float, motor_rate: float) -> float:
    return motor_share * motor_rate


def lagging_store(tilt: float, motor_share: float, motor_rate: float) -> float:
    return -motor_share * motor_rate * tilt


def motor_advance(motor_state: float, control: float, span: float, motor_decay: float) -> tuple[float, float]:
    """Return the state of a lagging motor after ``span`` seconds of constant control, and its mean over ``span``.

    The state is the motor's torque as a share of its largest; it solves ``state' = motor_decay (control - state)``.
    """
    x = motor_decay * span
    remaining = exp(-x)
    near = x < 2.0
    mean = exp(-0.5 * x) * sinh_over(0.5 * x) if near else (1.0 - remaining) / x
    return control + (motor_state - control) * remaining, control + (motor_state - control) * mean


@dataclass(frozen=True)
class Motor(Effect):
    """A torque motor on the shaft: torque = control * max_torque, control in [-1, 1].

    Per inertia: ``control motor_rate``. The motor needs a rod: a wire cannot carry torque. A motor weaker than m g L
    cannot lift the bob directly and has to swing it up. With a ``lag`` the motor's share of ``max_torque`` follows the
    control by ``lag share' = control - share``, from 0. This is advanced exactly, once per control step, and the mean
    share acts during the step.
    """

    max_torque: float = si(0.05, "N m", "torque at full control", above=0.0)
    lag: float = si(0.0, "s", "time constant with which the torque follows the control; 0 for at once", least=0.0)

    name: ClassVar[str] = "motor"
    kind: ClassVar[Kind] = "drive"
    exclusive: ClassVar[str] = "motor"
    number_name: ClassVar[str] = "u/(omega0² A)"
    equation: ClassVar[str] = "+ {motor_rate:.6g} control"
    source: ClassVar[str] = "Spong 1995, IEEE Control Systems 15 (1), 49"
    torque = staticmethod(motor_torque)
    store = staticmethod(motor_store)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.lag:
            memory = ("motor_state", "motor_share")
            vars(self).update(torque=lagging_torque, store=lagging_store, memory=memory, advance=motor_advance)

    def check(self, scene: Surroundings) -> None:
        if scene.body.suspension == "wire":
            raise SceneError("A wire cannot carry a motor's torque; use suspension='rod' or leave the motor out.")

    def coefficients(self, scene: Surroundings) -> dict[str, float]:
        rates = {"motor_rate": self.max_torque / scene.inertia}
        return {**rates, "motor_decay": 1.0 / self.lag} if self.lag else rates

    def number(self, scene: Surroundings, amplitude: float) -> float:
        restoring = scene.omega0**2 * abs(amplitude)
        return self.coefficients(scene)["motor_rate"] / restoring if restoring else math.inf

    def predicted(self, scene: Surroundings, amplitude: float) -> tuple[float, float]:
        """Return the relative changes of period and amplitude due to a constant full torque of the motor.

        This torque u (per inertia) moves the centre of the swing to u/omega0², which changes the amplitude. The
        period's change, and with a lag both changes, are unknown: nan.
        """
        if self.lag:
            return math.nan, math.nan
        return math.nan, abs(1.0 - 2.0 * self.number(scene, amplitude)) - 1.0
