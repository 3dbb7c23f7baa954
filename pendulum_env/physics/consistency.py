"""Comparison of what an effect declares, its derivatives, potential, flow and stiffness, with its torque.

A user's effect is tried before it is used, at drawn states, once for each set of coefficients. The package's own
effects are tried by the tests.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from random import Random
from typing import Any, NamedTuple

from pendulum_env.common.checks import SceneError, shown

STATES = 60
"""Number of states at which an effect is tried; the first is at rest at the bottom, the others are drawn."""
RELATIVE = 1e-6
"""Largest relative difference between a declared value and that of the torque."""
ROUNDING = 1e-12
"""Rounding of a difference of two values, over the larger of their sizes."""

State = Mapping[str, float]
Function = Callable[..., Any]
Estimate = tuple[float, float]
"""A value that was computed from the torque, and the size of its error."""


class Declared(NamedTuple):
    """What an effect declares: the functions that are compared with its torque, and what they depend on."""

    name: str
    kind: str
    memory: tuple[str, ...]
    torque: Function | None
    by_angle: Function | None
    by_velocity: Function | None
    by_speed: Function | None
    potential: Function | None
    store: Function | None
    mean: Function | None
    mean_by_end: Function | None
    flow: Function | None


def declared_by(effect: Any) -> Declared:
    """Return what an effect declares."""
    return Declared(*(getattr(effect, name) for name in Declared.__annotations__))


def check_functions(effect: Any, coefficients: Mapping[str, float], omega0: float) -> None:
    """Check the functions of an effect against its torque at STATES states.

    ``coefficients`` are those of the scene, ``omega0`` is its angular frequency [1/s], the scale of velocities.

    Raises SceneError for a function that fails, that is not finite, that takes an unknown argument, or that contradicts
    the torque. Where the torque has a kink or a jump, nothing is compared.
    """
    if all(isinstance(value, (int, float)) for value in (*coefficients.values(), omega0)):
        check_declared(declared_by(effect), tuple(coefficients.items()), float(omega0))


@lru_cache(maxsize=256)
def check_declared(effect: Declared, coefficients: tuple[tuple[str, float], ...], omega0: float) -> None:
    """Check the functions of an effect with these coefficients; raises SceneError as :func:`check_functions`."""
    name = effect.name
    for state in states(effect.memory, omega0):
        for role, declared, (value, error), said in compared(effect, {**state, **dict(coefficients)}):
            if not (math.isfinite(declared) and math.isfinite(value)):
                raise SceneError(f"The {role} of the effect {name} must be finite: it is {declared!r} at "
                                 f"{_place(effect, state)}, where {said} is {value!r}.")
            if abs(declared - value) > RELATIVE * (abs(declared) + abs(value)) + error:
                raise SceneError(f"The {role} of the effect {name} contradicts its torque: it is {declared:.6g} at "
                                 f"{_place(effect, state)}, where {said} is {value:.6g}.")


def states(memory: tuple[str, ...], omega0: float) -> Iterator[State]:
    """Yield the states at which an effect is tried, as values of the arguments of its functions."""
    draw, fast = Random(53), 5.0 * max(omega0, 1.0)
    for number in range(STATES):
        drawn = {"angle": draw.uniform(-math.pi, math.pi), "velocity": draw.uniform(-fast, fast),
                 "time": draw.uniform(0.0, 10.0), "control": draw.uniform(-1.0, 1.0), "side": draw.choice((-1.0, 1.0)),
                 "spread": draw.uniform(0.05, 1.0), **{one: draw.uniform(-1.0, 1.0) for one in memory}}
        rest = {"angle": 0.0, "velocity": 0.0, "time": 0.0, "control": 0.0, "side": 1.0}
        yield drawn if number else {**drawn, **rest}


def compared(effect: Declared, values: State) -> Iterator[tuple[str, float, Estimate, str]]:
    """Yield, for everything that an effect declares, its name, its value at a state, that of the torque, and what the
    latter is in words.
    """
    torque = effect.torque
    if torque is None:
        return

    def at(role: str, function: Callable[..., float], **changes: float) -> float:
        return _value(effect.name, role, function, {**values, **changes})

    def of_torque(**changes: float) -> float:
        return at("torque", torque, **changes)

    v, angle = values["velocity"], values["angle"]
    whole = of_torque()
    yield "torque", whole, (whole, 0.0), "the torque"
    by_velocity = slope(lambda x: of_torque(velocity=x), v)
    if effect.by_angle:
        yield ("derivative by_angle", at("by_angle", effect.by_angle), slope(lambda x: of_torque(angle=x), angle),
               "the torque's slope by angle")
    if effect.by_velocity:
        yield ("derivative by_velocity", at("by_velocity", effect.by_velocity), by_velocity,
               "the torque's slope by velocity")
    if effect.by_speed:
        speed = 1.5 * abs(v) + 0.1
        change, error = slope(lambda x: of_torque(speed=x), speed)
        yield ("derivative by_speed", at("by_speed", effect.by_speed, speed=speed), (speed * change, speed * error),
               "the speed times the torque's slope by speed")
    for role, potential in (("potential", effect.potential), ("store", effect.store)):
        if potential:
            change, error = slope(lambda x, role=role, f=potential: at(role, f, angle=x), angle)  # type: ignore[misc]
            yield f"slope of the {role}", change, (-whole, error), "minus the torque"
    if effect.mean:
        yield ("mean", at("mean", effect.mean), mean_over(lambda x: of_torque(angle=x), angle, values["spread"]),
               "the torque's mean over the angles")
    if effect.mean and effect.mean_by_end:
        mean, spread = effect.mean, values["spread"]
        yield ("derivative mean_by_end", at("mean_by_end", effect.mean_by_end),
               slope(lambda x: at("mean", mean, angle=angle + x, spread=spread + x), 0.0),
               "the slope of its mean at the end")
    if effect.flow:
        rest = 0.0 if effect.kind == "dissipative" else of_torque(velocity=0.0)
        duration = min(0.1, 0.3 / abs(by_velocity[0])) if math.isfinite(by_velocity[0]) and by_velocity[0] else 0.1
        yield ("flow", at("flow", effect.flow, duration=duration),
               followed(lambda x: of_torque(velocity=x) - rest, v, duration),
               f"the velocity after {duration:.3g} s under the torque")


def check_stiffness(effect: Any, declared: float, coefficients: Mapping[str, float], inertia: float) -> None:
    """Check a conservative effect's restoring torque per angle at rest [N m/rad]; SceneError if the torque has another.
    """
    value = stiffness_at_rest(effect, coefficients, inertia)
    if abs(declared - value) > RELATIVE * (abs(declared) + abs(value)) + ROUNDING * inertia:
        raise SceneError(f"The restoring_stiffness of the effect {effect.name} contradicts its torque: it is "
                         f"{declared:.6g} N m/rad, where the torque's slope at rest gives {value:.6g} N m/rad; leave "
                         "it out, then it is computed.")


def stiffness_at_rest(effect: Any, coefficients: Mapping[str, float], inertia: float) -> Any:
    """Return minus the slope of an effect's torque by angle, on a bob at rest at the bottom [N m/rad]."""
    values = {**next(states(effect.memory, 1.0)), **coefficients}
    if effect.by_angle:
        return -inertia * _value(effect.name, "by_angle", effect.by_angle, values)
    change, _ = slope(lambda x: _value(effect.name, "torque", effect.torque, {**values, "angle": x}), 0.0)
    return -inertia * change


# --- numbers from a function ------------------------------------------------------------------------------------------


def slope(function: Callable[[float], Any], x: float) -> tuple[Any, Any]:
    """Return the slope of a function, by differences of order 4, and the size of its error, which is large at a kink.
    """
    h = 1e-3 * max(1.0, abs(x))
    (a, b, c), (d, e, f) = ([function(x + side * k * h) for k in (0.5, 1.0, 2.0)] for side in (-1.0, 1.0))
    fine, coarse = (8.0 * (d - a) - (e - b)) / (6.0 * h), (8.0 * (e - b) - (f - c)) / (12.0 * h)
    return fine, 4.0 * abs(coarse - fine) + ROUNDING * abs(d) / h


def mean_over(function: Callable[[float], float], x: float, spread: float) -> Estimate:
    """Return the mean of a function from ``x - spread`` to ``x + spread``, by Simpson's rule, and its error's size."""
    def simpson(count: int) -> float:
        h = spread / count
        inner = (function(x - spread + i * h) * (4.0 if i % 2 else 2.0) for i in range(1, 2 * count))
        return (function(x - spread) + math.fsum(inner) + function(x + spread)) / (6.0 * count)

    coarse, fine = simpson(6), simpson(12)
    return fine, 4.0 * abs(coarse - fine) + ROUNDING * (abs(function(x - spread)) + abs(function(x + spread)))


def followed(function: Callable[[float], float], v: float, duration: float) -> Estimate:
    """Return the solution of ``dv/dt = function(v)`` after a time, by the classical Runge-Kutta method, and the size of
    its error.
    """
    def solved(count: int) -> float:
        w, h = v, duration / count
        for _ in range(count):
            a = function(w)
            b = function(w + 0.5 * h * a)
            c = function(w + 0.5 * h * b)
            w += h / 6.0 * (a + 2.0 * b + 2.0 * c + function(w + h * c))
        return w

    coarse, fine = solved(2), solved(4)
    return fine, 4.0 * abs(coarse - fine) + ROUNDING * abs(v)


@lru_cache(maxsize=256)
def _arguments(function: Function) -> tuple[str, ...]:
    """Return the names of a function's arguments."""
    return tuple(inspect.signature(function).parameters)


def _value(name: str, role: str, function: Callable[..., float], values: State) -> float:
    """Return the value of an effect's function; SceneError where it fails."""
    if not callable(function):
        raise SceneError(f"The {role} of the effect {name} must be a function, not {shown(function)}.")
    v, angle = values["velocity"], values["angle"]
    known = {"tilt": angle, "half_sine": math.sin(0.5 * angle), "slip": v, "speed": abs(v), **values}
    wanted = _arguments(function)
    if unknown := [one for one in wanted if one not in known]:
        raise SceneError(f"The {role} of the effect {name} takes {unknown[0]}, which is neither a coefficient of the "
                         "scene nor a quantity such as angle, velocity or time.")
    try:
        return function(*(known[one] for one in wanted)) * 1.0
    except Exception as error:
        place = ", ".join(f"{one} {known[one]:.6g}" for one in wanted)
        raise SceneError(f"The {role} of the effect {name} fails at {place or 'any state'}: {type(error).__name__}, "
                         f"{error}.") from error


def _place(effect: Declared, state: State) -> str:
    """Return a state in words: the angle, the velocity and, where the torque takes them, further quantities."""
    taken = _arguments(effect.torque) if effect.torque else ()
    more = [f"{one} {value:.6g}" for one, value in state.items() if one in taken and one not in ("angle", "velocity")]
    return ", ".join([f"the angle {state['angle']:.6g} rad, the velocity {state['velocity']:.6g} rad/s", *more])
