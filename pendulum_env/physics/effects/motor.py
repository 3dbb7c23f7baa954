"""A motor on the pivot's shaft: the control that reaches it, and its torque at a speed."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, fields
from typing import Any, ClassVar

from pendulum_env.physics.effects.effect import Effect, Kind
from pendulum_env.physics.effects.quadratic_drag import sinh_over
from pendulum_env.physics.elementary import exp
from pendulum_env.physics.surroundings import Surroundings
from pendulum_env.physics.units import SceneError, choice, si

# --- the torque, with the control or with the motor's share of its torque ---------------------------------------------


def motor_torque(control: float, motor_rate: float) -> float:
    return control * motor_rate


def motor_store(tilt: float, control: float, motor_rate: float) -> float:
    return -control * motor_rate * tilt


def lagging_torque(motor_share: float, motor_rate: float) -> float:
    return motor_share * motor_rate


def lagging_store(tilt: float, motor_share: float, motor_rate: float) -> float:
    return -motor_share * motor_rate * tilt


def voltage_torque(control: float, velocity: float, motor_rate: float, motor_brake: float) -> float:
    return control * motor_rate - motor_brake * velocity


def lagging_voltage_torque(motor_share: float, velocity: float, motor_rate: float, motor_brake: float) -> float:
    return motor_share * motor_rate - motor_brake * velocity


def voltage_by_velocity(motor_brake: float) -> float:
    return -motor_brake


def voltage_flow(velocity: float, duration: float, motor_brake: float) -> float:
    return velocity * exp(-motor_brake * duration)


def within(value: float, low: float, high: float) -> float:
    """Return the number from ``low`` to ``high`` that is nearest to ``value``."""
    return low if value < low else high if value > high else value


def supplied(push: float, velocity: float, motor_stall: float, motor_brake: float) -> float:
    """Return the torque of a motor that is to give the torque ``push``, as far as its supply allows at a velocity."""
    back = motor_brake * velocity
    return within(push, -motor_stall - back, motor_stall - back)


def supplied_slope(push: float, velocity: float, motor_stall: float, motor_brake: float) -> float:
    """Return the derivative of :func:`supplied` by the velocity."""
    return -motor_brake if abs(push + motor_brake * velocity) > motor_stall else 0.0


def supplied_rest(push: float, velocity: float, duration: float, motor_stall: float, motor_brake: float) -> float:
    """Return the velocity after ``duration`` under the torque that the supply takes away from ``push``.

    Within the speeds at which the supply gives the whole torque it is the velocity itself; beyond, the distance to the
    nearest of these speeds decays exponentially.
    """
    near = within(velocity, -(motor_stall + push) / motor_brake, (motor_stall - push) / motor_brake)
    return near + (velocity - near) * exp(-motor_brake * duration)


def supplied_torque(
    control: float, velocity: float, motor_rate: float, motor_stall: float, motor_brake: float
) -> float:
    return supplied(control * motor_rate, velocity, motor_stall, motor_brake)


def lagging_supplied_torque(
    motor_share: float, velocity: float, motor_rate: float, motor_stall: float, motor_brake: float
) -> float:
    return supplied(motor_share * motor_rate, velocity, motor_stall, motor_brake)


def supplied_by_velocity(
    control: float, velocity: float, motor_rate: float, motor_stall: float, motor_brake: float
) -> float:
    return supplied_slope(control * motor_rate, velocity, motor_stall, motor_brake)


def lagging_supplied_by_velocity(
    motor_share: float, velocity: float, motor_rate: float, motor_stall: float, motor_brake: float
) -> float:
    return supplied_slope(motor_share * motor_rate, velocity, motor_stall, motor_brake)


def supplied_flow(
    control: float, velocity: float, duration: float, motor_rate: float, motor_stall: float, motor_brake: float
) -> float:
    return supplied_rest(control * motor_rate, velocity, duration, motor_stall, motor_brake)


def lagging_supplied_flow(
    motor_share: float, velocity: float, duration: float, motor_rate: float, motor_stall: float, motor_brake: float
) -> float:
    return supplied_rest(motor_share * motor_rate, velocity, duration, motor_stall, motor_brake)


# --- the control that reaches the motor -------------------------------------------------------------------------------


def motor_advance(motor_state: float, control: float, span: float, motor_decay: float) -> tuple[float, float]:
    """Return the state of a lagging motor after ``span`` seconds of constant control, and its mean over ``span``.

    The state is the motor's torque as a share of its largest; it solves ``state' = motor_decay (control - state)``.
    """
    x = motor_decay * span
    remaining = exp(-x)
    near = x < 2.0
    mean = exp(-0.5 * x) * sinh_over(0.5 * x) if near else (1.0 - remaining) / x
    return control + (motor_state - control) * remaining, control + (motor_state - control) * mean


def moved_towards(command: float, control: float, reach: float) -> float:
    """Return the number nearest to ``control`` that differs from ``command`` by at most ``reach``."""
    change = control - command
    return control if abs(change) <= reach else command + (reach if change > 0.0 else -reach)


def in_steps(command: float, levels: float) -> float:
    """Return the nearest multiple of ``1/levels``, at most 1 in size; ``command`` itself if ``levels`` is 0."""
    counted = (command * levels + 6755399441055744.0) - 6755399441055744.0
    return command if levels <= 0.0 else within(counted / levels, -1.0, 1.0)


def past_dead_zone(command: float, dead_zone: float) -> float:
    """Return 0 within ``dead_zone`` of 0, and beyond a share that grows linearly to 1 at full command."""
    size = (abs(command) - dead_zone) / (1.0 - dead_zone)
    return command if dead_zone <= 0.0 else 0.0 if size <= 0.0 else size if command > 0.0 else -size


def control_advance(
    motor_command: float, motor_state: float, control: float, span: float, motor_rise: float, motor_levels: float,
    motor_dead_zone: float, motor_decay: float,
) -> tuple[float, float, float]:
    """Return the command, the motor's state, and its mean share of the largest torque, for a control step of ``span``.

    The command follows the control at a limited rate, is rounded to steps, loses the dead zone, and is followed by a
    lagging motor. A coefficient of 0 leaves its part out, and then changes no bit of the others' results.
    """
    command = control if motor_rise <= 0.0 else moved_towards(motor_command, control, motor_rise * span)
    target = past_dead_zone(in_steps(command, motor_levels), motor_dead_zone)
    state, share = motor_advance(motor_state, target, span, motor_decay)
    lags = motor_decay > 0.0
    return command, state if lags else target, share if lags else target


def inverse(number: float) -> float:
    """Return 1 over a number, and 0 for 0, which stands for a limit that is off."""
    return 1.0 / number if number else 0.0


TORQUE, VOLTAGE = "torque", "voltage"
"""Quantities that the control of a motor may set."""
FUNCTIONS: dict[tuple[str, bool], dict[str, Any]] = {
    ("", True): {"torque": lagging_torque, "store": lagging_store},
    (VOLTAGE, False): {
        "torque": voltage_torque, "by_velocity": voltage_by_velocity, "flow": voltage_flow, "store": None},
    (VOLTAGE, True): {
        "torque": lagging_voltage_torque, "by_velocity": voltage_by_velocity, "flow": voltage_flow, "store": None},
    (TORQUE, False): {
        "torque": supplied_torque, "by_velocity": supplied_by_velocity, "flow": supplied_flow, "store": None},
    (TORQUE, True): {
        "torque": lagging_supplied_torque, "by_velocity": lagging_supplied_by_velocity, "flow": lagging_supplied_flow,
        "store": None},
}
"""Quantity that the control sets ("" without a no-load speed), and True if the motor has a memory -> the functions that
replace those of the class."""
EQUATIONS = {
    VOLTAGE: "+ {motor_rate:.6g} control - {motor_brake:.6g} theta'",
    TORQUE: "+ 0.5 |{motor_rate:.6g} control + {motor_brake:.6g} theta' + {motor_stall:.6g}| "
            "- 0.5 |{motor_rate:.6g} control + {motor_brake:.6g} theta' - {motor_stall:.6g}| "
            "- {motor_brake:.6g} theta'",
}
"""Quantity that the control sets -> the term of a motor with a no-load speed in the equation of motion."""
SWITCHES = ("lag", "ramp", "control_quantum", "dead_zone")
"""Parameters that the program of a scene leaves out where they are 0."""


@dataclass(frozen=True)
class Motor(Effect):
    """A motor on the shaft: torque = control * max_torque, control in [-1, 1], with limits of real drives as options.

    Per inertia: ``control motor_rate``. The motor needs a rod: a wire cannot carry torque. A motor weaker than m g L
    cannot lift the bob directly and has to swing it up.

    On its way to the motor, once per control step and in this order, the control may be slowed down (it moves by at
    most ``span/ramp`` in a control step of ``span`` seconds, from 0), rounded to multiples of ``control_quantum`` (and
    to at most 1), and stopped by a dead zone d: the share is 0 for ``|control| <= d`` and ``sign(control) (|control| -
    d)/(1 - d)`` beyond (Tao & Kokotovic 1996, Adaptive Control of Systems with Actuator and Sensor Nonlinearities).
    With a ``lag`` the motor's share of ``max_torque`` then follows by ``lag share' = control - share``,
    from 0; this is advanced exactly, and the mean share acts during the control step.

    With a ``no_load_speed`` w0, the motor's own voltage grows with the speed and leaves less of the supply for a
    current. Let M be ``max_torque``, S the stall torque and w the velocity:

    - ``control_sets="voltage"``: the plain DC motor on an amplifier, torque = M (control - w/w0), S = M. It brakes
      whenever it turns faster than the control asks for, also without control (Franklin, Powell & Emami-Naeini 2019,
      Feedback Control of Dynamic Systems, section 2.3).
    - ``control_sets="torque"``: a current controller gives the torque M control as long as the supply lasts: it stays
      between -S (1 + w/w0) and S (1 - w/w0) (Krishnan 2001, Electric Motor Drives, chapter 4). ``max_torque`` is the
      limit of the current, S that of the supply at rest.

    The work of the motor in the ledger is that of its shaft, torque times velocity: negative where the motor brakes.
    The heat of its winding is not part of the energy of the pendulum. Friction of motor and gear is friction of the
    bearing: add ``bearing_friction`` for the part that grows with the speed, ``coulomb_friction`` for the constant one.

    Splitting methods take the torque at rest in the kick, and the exact solution for the part that depends on the
    velocity. The torque has a kink where the supply begins to limit it, which costs methods of high order their order
    in the steps that cross it; it has no Taylor series. Raises SceneError for numbers that contradict each other.
    """

    max_torque: float = si(0.05, "N m", "torque at full control, at rest", above=0.0)
    lag: float = si(0.0, "s", "time constant with which the torque follows the control; 0 for at once", least=0.0)
    ramp: float = si(0.0, "s", "shortest time in which the control goes from 0 to 1; 0 for at once", least=0.0)
    control_quantum: float = si(
        0.0, "1", "step to whose multiples the control is rounded, at most 1; 0 for none", least=0.0)
    dead_zone: float = si(0.0, "1", "control up to which there is no torque, below 1", least=0.0)
    control_sets: str = choice(TORQUE, (TORQUE, VOLTAGE), "quantity of which the control is a share; see no_load_speed")
    no_load_speed: float | None = si(
        None, "rad/s", "speed at which full control gives no torque; none by default", above=0.0, optional=True)
    stall_torque: float | None = si(
        None, "N m", "torque at rest that the supply allows; max_torque by default", above=0.0, optional=True)

    name: ClassVar[str] = "motor"
    kind: ClassVar[Kind] = "drive"
    exclusive: ClassVar[str] = "motor"
    number_name: ClassVar[str] = "u/(omega0² A)"
    equation: ClassVar[str] = "+ {motor_rate:.6g} control"
    source: ClassVar[str] = (
        "Spong 1995, IEEE Control Systems 15 (1), 49; at a speed: Franklin, Powell & Emami-Naeini 2019, Feedback "
        "Control of Dynamic Systems, section 2.3; dead zone: Tao & Kokotovic 1996")
    torque = staticmethod(motor_torque)
    store = staticmethod(motor_store)

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_numbers()
        prepared = self._prepared
        if prepared:
            memory = ("motor_command", "motor_state", "motor_share")
            vars(self).update(memory=memory, advance=control_advance)
        elif self.lag:
            vars(self).update(memory=("motor_state", "motor_share"), advance=motor_advance)
        vars(self).update(FUNCTIONS.get((self._law, bool(self.memory)), {}))
        if self._law:
            vars(self).update(equation=EQUATIONS[self._law])

    @property
    def idle(self) -> bool:
        return self.no_load_speed is None

    @property
    def _prepared(self) -> bool:
        """Return True if the control is prepared once per control step by more than a lag."""
        return bool(self.ramp) or bool(self.control_quantum) or bool(self.dead_zone)

    @property
    def _law(self) -> str:
        """Return the quantity that the control sets, or "" for a motor whose torque does not depend on the speed."""
        return "" if self.no_load_speed is None else self.control_sets

    def _check_numbers(self) -> None:
        """Raise SceneError for numbers that contradict each other."""
        if self.dead_zone >= 1.0:
            raise SceneError(f"dead_zone must be below 1, full control, not {self.dead_zone:g}.")
        if self.control_quantum > 1.0:
            raise SceneError(f"control_quantum must be at most 1, full control, not {self.control_quantum:g}.")
        if self.no_load_speed is None:
            needing = "control_sets='voltage'" if self.control_sets == VOLTAGE else (
                "" if self.stall_torque is None else "stall_torque")
            if needing:
                raise SceneError(f"{needing} needs a no_load_speed, the speed at which full control gives no torque.")
        elif self.stall_torque is not None:
            if self.control_sets == VOLTAGE:
                raise SceneError("stall_torque goes with control_sets='torque'; with 'voltage' it is max_torque.")
            if self.stall_torque < self.max_torque:
                raise SceneError(f"stall_torque must be at least max_torque, {self.max_torque:g} N m, not "
                                 f"{self.stall_torque:g} N m.")

    def general(self, mixed: Collection[str]) -> Effect:
        return self if set(SWITCHES).isdisjoint(mixed) else MotorOfMany(
            **{entry.name: getattr(self, entry.name) for entry in fields(self)})

    def check(self, scene: Surroundings) -> None:
        if scene.body.suspension == "wire":
            raise SceneError("A wire cannot carry a motor's torque; use suspension='rod' or leave the motor out.")

    def coefficients(self, scene: Surroundings) -> dict[str, float]:
        rates = {"motor_rate": self.max_torque / scene.inertia}
        if self.no_load_speed is not None:
            stall = rates["motor_rate"] if self.stall_torque is None else self.stall_torque / scene.inertia
            rates |= {"motor_stall": stall} if self.control_sets == TORQUE else {}
            rates |= {"motor_brake": stall / self.no_load_speed}
        if self._prepared:
            return {**rates, "motor_rise": inverse(self.ramp), "motor_levels": inverse(self.control_quantum),
                    "motor_dead_zone": self.dead_zone, "motor_decay": inverse(self.lag)}
        return {**rates, "motor_decay": 1.0 / self.lag} if self.lag else rates

    def number(self, scene: Surroundings, amplitude: float) -> float:
        restoring = scene.omega0**2 * abs(amplitude)
        return self.coefficients(scene)["motor_rate"] / restoring if restoring else math.inf

    def predicted(self, scene: Surroundings, amplitude: float) -> tuple[float, float]:
        """Return the relative changes of period and amplitude due to a constant full torque of the motor.

        This torque u (per inertia) moves the centre of the swing to u/omega0², which changes the amplitude. The
        period's change, and both changes for a motor with further options, are unknown: nan.
        """
        if self.memory or self._law:
            return math.nan, math.nan
        return math.nan, abs(1.0 - 2.0 * self.number(scene, amplitude)) - 1.0


class MotorOfMany(Motor):
    """A motor of a batch in which a lag or another of SWITCHES is 0 for some members only, so that one program serves
    all."""

    def __repr__(self) -> str:
        return f"{Motor.__name__}({', '.join(self._changed())})"

    @property
    def _prepared(self) -> bool:
        return True
