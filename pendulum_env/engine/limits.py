"""Warnings with a remedy: of steps beyond a method's limit before a run, of what stopped it after one.

Whether steps are too long is computed from the method itself, as the growth of a swing in one step
(:func:`integrators.analysis.linear.spectral_radius`), nowhere looked up. Remedies are computed, too: the step at which
it does not grow, and the cheapest method of the registry that has the property asked for, fits the scene, and does not
grow.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import lru_cache

import numpy as np

from integrators import Method
from pendulum_env.common.warn import warn
from pendulum_env.engine.machine import INDEX, TWO_PI, Machine, fitting
from pendulum_env.engine.shape import DIVERGED, STOP_REASONS, TOO_SHORT
from pendulum_env.engine.starts import at_most
from pendulum_env.physics.flow import damping_rate, natural_rate, terminal_speed
from pendulum_env.physics.scene import Scene

SHORT = 0.11, 0.03
"""omega0 h and gamma h up to which no method of the registry is beyond its limit; the tests hold it to that."""
DOUBLED = math.log(2.0)
LATER = 1000.0
"""Periods in which a swing that shorter steps keep from growing may not double."""
LONG = 0.4
"""omega0 h or gamma h from which that counts: the growth of, say, Euler's method at shorter steps is its error."""
GREENE = math.sqrt(0.971635406)
"""omega0 h up to which full gravity's kicks and drifts, the standard map, hold their orbits (Greene 1979, J. Math.
Phys. 20, 1183)."""
HALVINGS, FEW = 40, 4
TRIED = 20
"""Steps that a remedy has to survive, of at most 1/omega0."""
OVERFLOWN = 1e100
"""A velocity from which a step may leave the range of numbers by itself [rad/s]."""


def growth_per_period(method: Method, omega0_h: float, gamma_h: float) -> float:
    """Log of what a small swing's amplitude is multiplied by in a period; without a restoring torque in LATER steps."""
    from integrators.analysis.linear import spectral_radius

    try:
        with np.errstate(all="ignore"):
            radius = spectral_radius(method, omega0_h, gamma_h)
    except (ValueError, ArithmeticError):  # a step that fails on the oscillator says nothing of its limit
        return 0.0
    return math.log(max(radius, 1e-300)) * (2.0 * math.pi / omega0_h if omega0_h > 0.0 else LATER)


@lru_cache(maxsize=1024)
def beyond_limit(method: Method, omega0_h: float, gamma_h: float) -> bool:
    """True if a swing that should not grow doubles in a period; or, at longer steps than LONG, in many, and if shorter
    steps would keep it from growing."""
    growth = growth_per_period(method, omega0_h, gamma_h)
    if growth * LATER <= DOUBLED:
        return False
    if growth > DOUBLED:
        return True
    parts = (2.0**-k for k in range(1, 7))
    return max(omega0_h, gamma_h) > LONG and any(
        growth_per_period(method, part * omega0_h, part * gamma_h) <= 1e-9 for part in parts)


def beyond_map(method: Method, scene: Scene, omega0_h: float) -> bool:
    """True where one kick and one drift a step are the standard map beyond its last closed orbit."""
    one_kick = method.symplectic and not method.implicit and method.evaluations == 1
    return one_kick and scene.periodic and not scene.of_kind("dissipative") and omega0_h > GREENE


def fastest(scene: Scene, angle: float, velocity: float, slowed: bool) -> float:
    """A bound of the angular velocity of a run from this start where no drive acts, without losses or ``slowed`` by
    them [rad/s]."""
    fall = 2.0 * natural_rate(scene) * math.sin(0.5 * min(abs(angle), math.pi))
    free = math.hypot(velocity, fall)
    return max(abs(velocity), min(free, terminal_speed(scene) / scene.body.length)) if slowed else free


def too_long(
    method: Method, scenes: Iterable[Scene], h: float, angle: float | None = None, velocity: float | None = None
) -> Iterator[str]:
    """Say of the first scene in which steps of ``h`` [s] are beyond the method's limit what to use instead.

    Args:
        angle, velocity: the largest at the start [rad, rad/s], by default those of the scene's usual run.
    """
    for scene in scenes:
        start = scene.run.angle if angle is None else angle, scene.run.velocity if velocity is None else velocity
        z = natural_rate(scene) * h
        for slowed in (False, True):
            g = h * _damping(scene, fastest(scene, *start, slowed))
            if (z <= SHORT[0] and g <= SHORT[1]) or not _beyond(method, scene, z, g):
                break
        else:
            yield _said_of_long_steps(method, scene, h, z, g)
            return


def _damping(scene: Scene, speed: float) -> float:
    """The steepest slope of all losses up to this angular velocity [1/s]."""
    return max(damping_rate(scene, speed), damping_rate(scene, 0.0)) if scene.of_kind("dissipative") else 0.0


def _beyond(method: Method, scene: Scene, z: float, g: float) -> bool:
    return beyond_limit(method, z, g) or beyond_map(method, scene, z)


def _said_of_long_steps(method: Method, scene: Scene, h: float, z: float, g: float) -> str:
    parts = 1
    while parts < 2**HALVINGS and _beyond(method, scene, z / parts, g / parts):
        parts += max(1, parts // 16)
    growth = growth_per_period(method, z, g)
    what = "a swing's energy would not stay bounded"
    if beyond_limit(method, z, g):
        factor = f"{math.exp(growth):.3g}-fold" if growth < 20.0 else "beyond all bounds"
        what = f"a small swing would grow {factor} in a period" if z else "speed would grow under drag"
    able = _able(scene, drag=g > z)
    other = next((other for other in able if not _beyond(other, scene, z, g)), None)
    instead = f", or {_praised(other)}" if other else ""
    return (
        f"Steps of {h:g} s are too long for {method.name} in the scene '{scene.name}' (omega0 h = {z:.3g}, gamma h = "
        f"{g:.3g}): {what}; take steps of {at_most(h / parts)} s or less, as by {parts} times as many substeps"
        f"{instead}."
    )


def _able(scene: Scene, drag: bool) -> list[Method]:
    """The methods that fit and are L-stable, where drag decides, or A-stable: best those that are exact, then those of
    one step and of order 2 or more, then the cheaper ones."""
    able = [method for method in fitting(scene).values() if (method.l_stable if drag else method.a_stable)]
    return sorted(able, key=lambda method: (not method.exact, not method.one_step, method.order < 2,
                                            method.evaluations, -method.order))


def _praised(method: Method) -> str:
    """What there is to say of a method that takes steps as long as these."""
    if method.exact:
        return f"{method.name}, which has no error in this scene"
    return f"{method.name}, which is stable at this step, though no more accurate than so long a step can be"


def warn_of_stop(
    method: Method, scene: Scene, reason: str, h: float, state: Sequence[float], control: float = 0.0
) -> bool:
    """A UserWarning, and True, where a run stopped because an equation was not solved or a tolerance not met.

    Args:
        reason: why it stopped.
        h: the integrator's step [s].
        state: what was kept last: steps taken, angle [rad], turns, velocity [rad/s].
        control: the share of the motor's torque.
    """
    if reason == STOP_REASONS[TOO_SHORT]:
        warn(
            f"A run with {method.name} in the scene '{scene.name}' stopped as {reason!r}: no step meets its "
            "tolerance; take a larger rtol and atol, or steps of one length."
        )
        return True
    index, angle, turns, velocity = (float(value) for value in state[:4])
    if reason != STOP_REASONS[DIVERGED] or not method.implicit or not abs(velocity) < OVERFLOWN:
        return False

    def solved(other: Method, step: float) -> bool:
        return _steps(other, scene, step, index, angle + TWO_PI * (turns % 1.0), velocity, control)

    if solved(method, h):
        return False
    least = math.ceil(math.log2(max(natural_rate(scene) * h, 2.0)))
    parts = next((2**k for k in range(least, HALVINGS) if solved(method, h / 2**k)), 0)
    other = next((other for other in _able(scene, False) if other.name != method.name and solved(other, h)), None)
    remedies = [*([f"steps of {at_most(h / parts)} s or less, as by {parts} times as many substeps"] if parts else []),
                *([_praised(other)] if other else [])]
    warn(
        f"A run with {method.name} in the scene '{scene.name}' stopped as {reason!r}: Newton's method found no "
        f"solution for a step of {h:g} s; take {', or '.join(remedies) or 'another method'}."
    )
    return True


def warn_of_stops(
    method: Method, reasons: Iterable[tuple[int, str]], h: float, scene_of: Callable[[int], Scene],
    state_of: Callable[[int], Sequence[float]], control_of: Callable[[int], float],
) -> bool:
    """Do the same for runs at these places that stopped, of which the first FEW that diverged are looked at."""
    lost = [place for place, reason in reasons if reason == STOP_REASONS[DIVERGED]] if method.implicit else []
    return any(warn_of_stop(method, scene_of(place), STOP_REASONS[DIVERGED], h, state_of(place), control_of(place))
               for place in lost[:FEW])


def _steps(
    method: Method, scene: Scene, h: float, index: float, angle: float, velocity: float, control: float
) -> bool:
    """True if a method's steps from here stay in the range of numbers; methods with a memory begin it anew."""
    machine = Machine(scene, method, (), "python")
    state = machine.state(angle, velocity)
    state[INDEX] = 0.0 if method.memory else index
    return machine.advance(state, control, h, TRIED) != DIVERGED
