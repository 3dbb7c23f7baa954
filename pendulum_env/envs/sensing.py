"""Settings of observations and delays: kind of observation, sensor, delays of observations and actions."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from numpy.typing import NDArray

from pendulum_env.engine.sensing import SEEDS, MotionFields, Plan, Sensing, gain_of
from pendulum_env.engine.spec import RunSpec
from pendulum_env.envs.settings import USUAL_HISTORY, EpisodeSettings
from pendulum_env.physics.sensor import Sensor
from pendulum_env.physics.units import SceneError, number, shown

Array = NDArray[Any]

MOST_STEPS = 1000
"""Largest delay, in control steps."""
OBSERVED = "observed_angle"
"""Entry of ``info`` with the unwrapped angle that the sensor shows [rad]."""


def plan_of(given: EpisodeSettings, h: float, substeps: int) -> Plan | None:
    """Return the plan of readings and delays; None if observations show the true motion without delay.

    Args:
        given: settings of the environment.
        h: integrator's step [s].
        substeps: integration steps of a control step.

    Raises SceneError for an invalid setting.
    """
    kind, history = given.observation, given.history
    if kind != "history" and history is not None:
        raise SceneError(f"history={shown(history)} is for observation='history', not for {kind!r}.")
    seen = checked_delay(given.observation_delay, "observation_delay", h, substeps)
    acts = checked_delay(given.action_delay, "action_delay", h, substeps)
    device: Any = given.sensor
    if kind == "full" and device is None and seen == acts == (0, 0):
        return None
    device = device or Sensor()
    spacing, every = (substeps, 1) if device.rate is None else checked_rate(device.rate, h, substeps)
    between = spacing * every * h
    window = int(device.window) if kind == "encoder" else 1
    return Plan(
        kind=kind, history=history or (USUAL_HISTORY if kind == "history" else 1), substeps=substeps, spacing=spacing,
        every=every, follows=device.rate is None, window=window,
        filtered=kind == "encoder" and device.corner is not None,
        ideal=Sensor(rate=device.rate, window=device.window, corner=device.corner) == device,
        noisy=device.noise > 0.0, dropping=device.dropout > 0.0, rounding=device.quantum > 0.0,
        zeroed=device.zero == "at_start", seen_late=seen, acts_late=acts,
        numbers=(device.scale, device.offset, device.noise, device.quantum or 1.0, device.dropout,
                 gain_of(device.corner, between), between, window * between),
    )


def checked_delay(value: Any, name: str, h: float, substeps: int) -> tuple[int, int]:
    """Return a delay, or the ends of its range, in integration steps of ``h`` [s].

    Raises SceneError for delays below 0 or beyond 1000 control steps, that are not whole steps, or with reversed ends.
    """
    ends = value if isinstance(value, (tuple, list)) else (value, value)
    if len(ends) != 2:
        raise SceneError(f"{name} must be a delay or (low, high) [s], not {shown(value)}.")
    steps = []
    for end in ends:
        delay = number(end, name, least=0.0, unit="s") / h
        count = round(min(delay, 2.0**53))
        if abs(delay - count) > 1e-9 * max(1.0, delay):
            low = math.floor(delay)
            raise SceneError(f"{name} must be a whole number of steps of {h:.6g} s, such as {low * h:.6g} or "
                             f"{(low + 1) * h:.6g} s, not {end!r}; more substeps make the steps shorter.")
        if count > MOST_STEPS * substeps:
            raise SceneError(f"{name} must be at most {MOST_STEPS} control steps, {MOST_STEPS * substeps * h:.6g} s, "
                             f"not {end!r}.")
        steps.append(count)
    if steps[0] > steps[1]:
        raise SceneError(f"{name} must have the lower end first, not {shown(value)}.")
    return steps[0], steps[1]


def checked_rate(rate: float, h: float, substeps: int) -> tuple[int, int]:
    """Return the integration steps between two slots, and the slots between two readings, of a sensor with a rate.

    Raises SceneError for a rate whose readings are not at whole steps that divide a control step, or multiples of it.
    """
    period = 1.0 / (rate * h)
    count = round(min(max(period, 1.0), 2.0**53))
    if abs(period - count) <= 1e-9 * period and count <= MOST_STEPS * substeps:
        if substeps % count == 0:
            return count, 1
        if count % substeps == 0:
            return substeps, count // substeps
    fits = [n for n in range(1, substeps + 1) if substeps % n == 0] + [substeps * k for k in range(2, MOST_STEPS + 1)]
    near = sorted(fits, key=lambda n: abs(math.log(n / min(max(period, 1e-300), 1e300))))[:2]
    names = " or ".join(f"{1.0 / (n * h):.6g}" for n in sorted(near))
    raise SceneError(f"rate must give readings at whole steps of {h:.6g} s that divide a control step or are multiples "
                     f"of it, such as {names} Hz, not {rate:.6g} Hz; more substeps allow higher rates.")


def delays(bounds: tuple[int, int], uniform: Any) -> Any:
    """Return delays in integration steps, drawn with equal chances, from an array of random numbers in [0, 1)."""
    low, high = bounds
    return low + (uniform * (high - low + 1)).astype(int).clip(0, high - low)


# --- environments ---------------------------------------------------------------------------------------------------


def readings(
    spec: RunSpec, plan: Plan | None, place: MotionFields, remembers: bool, size: int, num_threads: int = 1
) -> Sensing | None:
    """Return the readings of environments; None if observations show the true motion.

    ``remembers`` is True for scenes with effects that have a state, such as a lagging motor. Raises SceneError for the
    diagnostic "error" with readings or actions within control steps.
    """
    if plan is None:
        return None
    if spec.estimate_error and len(plan.parts(remembers)) > 1:
        raise SceneError('The diagnostic "error" compares runs at the ends of control steps, so that it needs delays '
                         "of whole control steps, and a rate of one reading for each at most.")
    return Sensing(plan, place, size, remembers, spec.backend, num_threads)


def drawn_delays(plan: Plan, uniform: Callable[[], Array]) -> tuple[list[Any], dict[str, Array]]:
    """Draw the delays of an episode and the seeds of its sensor's noise, from ``uniform``.

    Return the arguments of :meth:`pendulum_env.engine.sensing.Sensing.begin` after the indices, and the delays that
    were drawn, by name [integration steps].
    """
    named: dict[str, Array] = {}
    drawn: list[Any] = []
    for name, bounds in (("observation_delay", plan.seen_late), ("action_delay", plan.acts_late)):
        drawn.append(None)
        if bounds[0] < bounds[1]:
            drawn[-1] = delays(bounds, uniform())
            named[name] = drawn[-1]
    return [*drawn, [uniform() for _ in SEEDS] if plan.draws else []], named
