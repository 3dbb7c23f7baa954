"""Warnings that name a remedy: before a run, of steps beyond a method's stability limit; after a run, of a failed step.

The stability of a step is computed from the method, as the growth of a small swing in one step
(:func:`integrators.analysis.linear.spectral_radius`). Two remedies are computed: a step at which the swing does not
grow, and the cheapest registered method that has the needed stability property, fits the scene, and is stable at the
present step. Formulas of effects that do not hold at the speeds of a run are named, too (:class:`Validity`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from integrators import Method
from pendulum_env.common.checks import warn
from pendulum_env.common.many import Many, plain
from pendulum_env.engine.machine import BY_ANGLE, INDEX, TWO_PI, Machine, fitting
from pendulum_env.engine.problem import moving
from pendulum_env.engine.reading import arguments
from pendulum_env.engine.shape import DIVERGED, STOP_REASONS, TOO_SHORT
from pendulum_env.engine.starts import at_most
from pendulum_env.physics.effects import Effect
from pendulum_env.physics.flow import braking, damping_rate, natural_rate, terminal_speed
from pendulum_env.physics.scene import Scene

SHORT = 0.11, 0.03
"""omega0 h and gamma h up to which every method of the registry is stable, as the tests verify."""
DOUBLED = math.log(2.0)
"""Logarithm of the growth factor of a swing at which a step counts as unstable."""
LATER = 1000.0
"""Number of periods within which a swing must not double, if shorter steps would keep it from growing."""
LONG = 0.4
"""omega0 h or gamma h above which slow growth (see LATER) counts as instability.

The growth of, say, Euler's method at shorter steps is its truncation error.
"""
GREENE = math.sqrt(0.971635406)
"""Largest omega0 h at which the standard map still has an invariant orbit (Greene 1979, J. Math. Phys. 20, 1183).

The standard map is one kick by full gravity and one drift per step.
"""
PART = 0.5
"""Part of a turn that a step may turn the rod without a warning.

In half a turn, the torque of gravity runs through its whole range, and from there on the ends of a step do not show
which way the rod turned.
"""
HALVINGS, FEW = 40, 4
"""Most halvings of a step in the search for a stable one; most diverged runs of a batch that are examined."""
TRIED = 20
"""Number of steps that a remedy must take without diverging."""
OVERFLOWN = 1e100
"""|velocity| from which a single step may overflow the range of floats [rad/s]."""


def growth_per_period(method: Method, omega0_h: float, gamma_h: float) -> float:
    """Return the log of the factor by which a small swing's amplitude grows in one period, or in one longer step.

    Without a restoring torque (omega0 h = 0) there is no period; the growth is then that over 1000 steps (LATER).
    """
    from integrators.analysis.linear import spectral_radius

    try:
        with np.errstate(all="ignore"):
            radius = spectral_radius(method, omega0_h, gamma_h)
    except (ValueError, ArithmeticError):  # the step fails on the oscillator: no growth is known
        return 0.0
    return math.log(max(radius, 1e-300)) * (max(TWO_PI / omega0_h, 1.0) if omega0_h > 0.0 else LATER)


@lru_cache(maxsize=1024)
def beyond_limit(method: Method, omega0_h: float, gamma_h: float) -> bool:
    """Return True if a step of the method is unstable for a small swing.

    It is unstable if the swing doubles in one period. For omega0 h or gamma h above 0.4 (LONG) it is also unstable if
    the swing doubles within 1000 periods (LATER), while shorter steps would keep it from growing.
    """
    growth = growth_per_period(method, omega0_h, gamma_h)
    if growth * LATER <= DOUBLED:
        return False
    if growth > DOUBLED:
        return True
    parts = (2.0**-k for k in range(1, 7))
    return max(omega0_h, gamma_h) > LONG and any(
        growth_per_period(method, part * omega0_h, part * gamma_h) <= 1e-9 for part in parts)


def beyond_map(method: Method, scene: Scene, omega0_h: float) -> bool:
    """Return True if a symplectic method with one force evaluation per step may let the energy of a swing grow.

    For an undamped pendulum such a method is the standard map, which bounds the energy only as long as an invariant
    orbit exists, up to omega0 h = 0.986 (GREENE).
    """
    one_kick = method.symplectic and not method.implicit and method.evaluations == 1 and not method.exact
    return one_kick and scene.periodic and not scene.of_kind("dissipative") and omega0_h > GREENE


def fastest(scene: Scene, angle: float, velocity: float, slowed: bool) -> float:
    """Return an upper bound of the angular velocity of a run without drives [rad/s].

    ``angle`` [rad] and ``velocity`` [rad/s] are the initial condition. With ``slowed`` the bound takes the losses into
    account and is smaller.
    """
    fall = 2.0 * natural_rate(scene) * math.sin(0.5 * min(abs(angle), math.pi))
    free = math.hypot(velocity, fall)
    return max(abs(velocity), min(free, terminal_speed(scene) / scene.body.reach)) if slowed else free


def too_long(
    method: Method, scenes: Iterable[Scene], h: float, angle: float | None = None, velocity: float | None = None
) -> Iterator[str]:
    """Yield a warning if steps of ``h`` [s] are unstable, and one if a step may turn the rod too far (PART of a turn).

    Each names the first such scene and a remedy. The speed is bounded by the energy of the start; drives and wind,
    which may add energy, do not count. Of a scene in which the steps are unstable, only that is said.

    Args:
        angle, velocity: largest initial values [rad, rad/s], by default those of the scene's usual run.
    """
    unstable = turning = ""
    for scene in scenes:
        start = scene.run.angle if angle is None else angle, scene.run.velocity if velocity is None else velocity
        z, limit = natural_rate(scene) * h, turning_speed(method, scene, h)
        lossy = bool(braking(scene))
        long = fast = True
        for slowed in (False, True):
            speed = fastest(scene, *start, slowed)
            g = h * max(damping_rate(scene, speed), damping_rate(scene, 0.0)) if lossy else 0.0
            long = long and not (z <= SHORT[0] and g <= SHORT[1]) and _beyond(method, scene, z, g)
            fast = fast and speed > limit
            if not (long or fast):
                break
        if long:
            unstable = unstable or _long_step_warning(method, scene, h, z, g)
        elif fast:
            cause = f"from its start, a bob reaches up to {speed:.3g} rad/s"
            turning = turning or turning_warning(scene, h, speed, cause)
    yield from filter(None, (unstable, turning))


def turning_speed(method: Method, scene: Scene, h: float) -> float:
    """Return the |velocity| from which a step of ``h`` [s] turns the rod by more than PART of a turn [rad/s].

    It is inf for an exact method, and where the torque does not change with the angle or does not repeat after a turn.
    """
    effects = scene.effects
    turned = any(effect.torque and not BY_ANGLE.isdisjoint(arguments(effect.torque)) for effect in effects)
    changes = scene.periodic and (turned or moving(effects))
    return PART * TWO_PI / h if changes and not method.exact else math.inf


def turning_warning(scene: Scene, h: float, speed: float, cause: str) -> str:
    """Return the warning that a step of ``h`` [s] at ``speed`` [rad/s] turns the rod too far, with its ``cause``."""
    turn = h * speed / TWO_PI
    turns = f"{turn:.2f}" if turn < 100.0 else f"{turn:.3g}"
    return (
        f"A step of {h:g} s turns the rod by up to {turns} turns in the scene '{scene.name}' ({cause}), and the torque "
        "in between is not resolved: the motion can be wrong even where the energy residual is 0. Take steps of "
        f"{at_most(h * PART / turn)} s or less, which turn it by at most {PART:g} of a turn."
    )


def _beyond(method: Method, scene: Scene, z: float, g: float) -> bool:
    """Return True if a step of the method is unstable in the scene.

    The step is given by omega0 h = ``z`` and gamma h = ``g``, where omega0 is the frequency of small swings and gamma
    the damping rate.
    """
    return beyond_limit(method, z, g) or beyond_map(method, scene, z)


def _long_step_warning(method: Method, scene: Scene, h: float, z: float, g: float) -> str:
    """Return the text of the warning that steps of ``h`` [s] are unstable.

    The step has omega0 h = ``z`` and gamma h = ``g``.
    """
    parts = 1
    while parts < 2**HALVINGS and _beyond(method, scene, z / parts, g / parts):
        parts += max(1, parts // 16)
    if _beyond(method, scene, z / parts, g / parts):
        return _beyond_all_steps(method, scene, h, max(z, g))
    growth = growth_per_period(method, z, g)
    outcome = "a swing's energy would not stay bounded"
    if beyond_limit(method, z, g):
        factor = f"{math.exp(growth):.3g}-fold" if growth < 20.0 else "beyond all bounds"
        span = "step" if z > TWO_PI else "period"
        outcome = f"a small swing would grow {factor} in a {span}" if z else "speed would grow under drag"
    able = _able(scene, drag=g > z)
    other = next((other for other in able if not _beyond(other, scene, z, g)), None)
    instead = f", or {_praised(other)}" if other else ""
    return (
        f"Steps of {h:g} s are too long for {method.name} in the scene '{scene.name}' (omega0 h = {z:.3g}, gamma h = "
        f"{g:.3g}): {outcome}; take steps of {at_most(h / parts)} s or less ({parts} times as many substeps)"
        f"{instead}."
    )


def _beyond_all_steps(method: Method, scene: Scene, h: float, ratio: float) -> str:
    """Return the warning that no step can follow the motion; ``ratio`` is ``h`` over the motion's time scale."""
    return (
        f"Steps of {h:g} s are too long for {method.name} in the scene '{scene.name}', which moves on a time scale of "
        f"{h / ratio:.3g} s: even {2.0**HALVINGS:.2g} times as many substeps would be too few; check the scene's "
        "parameters."
    )


def _able(scene: Scene, drag: bool) -> list[Method]:
    """Return the A-stable methods (with ``drag`` the L-stable ones) that fit the scene, the recommended one first.

    Exact methods come first, then one-step methods, then those of order 2 or more, then the cheaper ones.
    """
    able = [method for method in fitting(scene).values() if (method.l_stable if drag else method.a_stable)]
    return sorted(able, key=lambda method: (not method.exact, not method.one_step, method.order < 2,
                                            method.evaluations, -method.order))


def _praised(method: Method) -> str:
    """Return the method's name with the reason for which a warning about too long steps recommends it."""
    if method.exact:
        return f"{method.name}, which has no error in this scene"
    return f"{method.name}, which is stable at this step, though a step this long cannot be accurate"


def warn_of_stop(
    method: Method, scene: Scene, reason: str, h: float, state: Sequence[float], control: float = 0.0
) -> bool:
    """Warn if a run stopped because an implicit equation was not solved or a tolerance not met; return True then.

    Args:
        reason: the run's stop reason.
        h: the integrator's step [s].
        state: the last finite state: steps taken, angle [rad], turns, velocity [rad/s].
        control: the motor's torque as a fraction of its largest torque.
    """
    ratio = natural_rate(scene) * h
    if ratio > 2.0**HALVINGS and (method.implicit or reason == STOP_REASONS[TOO_SHORT]):
        warn(_beyond_all_steps(method, scene, h, ratio))
        return True
    if reason == STOP_REASONS[TOO_SHORT]:
        warn(
            f"A run with {method.name} in the scene '{scene.name}' stopped as {reason!r}: even the shortest step "
            "exceeds its tolerance; take a larger rtol and atol, or fixed steps (leave out rtol)."
        )
        return True
    index, angle, turns, velocity = (float(value) for value in state[:4])
    if reason != STOP_REASONS[DIVERGED] or not method.implicit or not abs(velocity) < OVERFLOWN:
        return False

    def solved(other: Method, step: float) -> bool:
        """Return True if the method ``other`` with this step can continue from the state at which the run stopped."""
        return _steps(other, scene, step, index, angle + TWO_PI * (turns % 1.0), velocity, control)

    if solved(method, h):
        return False
    least = math.ceil(math.log2(max(natural_rate(scene) * h, 2.0)))
    parts = next((2**k for k in range(least, HALVINGS) if solved(method, h / 2**k)), 0)
    other = next((other for other in _able(scene, False) if other.name != method.name and solved(other, h)), None)
    remedies = [*([f"steps of {at_most(h / parts)} s or less ({parts} times as many substeps)"] if parts else []),
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
    """Warn if a run of a batch stopped because an implicit equation was not solved or a tolerance not met.

    Return True then. ``reasons`` are pairs of a run's index and its stop reason; only the first four such runs (FEW)
    are examined.
    """
    told = (STOP_REASONS[TOO_SHORT], *((STOP_REASONS[DIVERGED],) if method.implicit else ()))
    lost = [(place, reason) for place, reason in reasons if reason in told]
    return any(warn_of_stop(method, scene_of(place), reason, h, state_of(place), control_of(place))
               for place, reason in lost[:FEW])


def _steps(
    method: Method, scene: Scene, h: float, index: float, angle: float, velocity: float, control: float
) -> bool:
    """Return True if 20 steps (TRIED) of a method from the given state stay finite.

    Multistep methods start there without a history.
    """
    machine = Machine(scene, method, (), "python")
    state = machine.state(angle, velocity)
    state[INDEX] = 0.0 if method.memory else index
    return machine.advance(state, control, h, TRIED) != DIVERGED


Array = NDArray[np.float64]

FASTER = tuple(1e-6 * 4.0**k for k in range(21))
"""Higher speeds that a driven bob may reach [m/s]."""


def beyond(scene: Scene, speed: float, control: bool) -> str:
    """Return the names of effects with formulas that do not hold at this speed of the bob [m/s], with reasons.

    The text is "" if all formulas hold, and for speed 0. If a drive or a wind acts, or may act with ``control``, the
    bob may get faster: then a formula is named only if it holds at no higher speed either. The speed of the wind does
    not count.
    """
    pushed = any(effect.kind == "medium" or (effect.kind == "drive" and (control or not effect.controlled))
                 for effect in scene.effects)
    faults = []
    for effect in scene.effects:
        reason = effect.outside(scene, speed) if speed else ""
        if reason and not (pushed and any(not effect.outside(scene, more) for more in FASTER if more > speed)):
            faults.append(f"{effect.name} ({reason})")
    return ", ".join(faults)


@dataclass
class Validity:
    """Check of the formulas in the scenes of runs; ``warning`` names those that do not hold in the first such run.

    A formula here is that of an effect, such as a drag law, which holds up to some speed. ``warning`` is "" as long as
    all formulas hold.

    Args:
        size, what: number of runs, and the word for one run in messages, such as "run" or "environment".
        angle, velocity: initial conditions [rad, rad/s], arrays of ``size``; None for those of each scene's usual run.
        control: False if no motor torque acts.
    """

    size: int = 1
    what: str = "run"
    angle: Array | None = None
    velocity: Array | None = None
    control: bool = True
    warning: str = field(default="", init=False)

    def clear(self, scene: Scene, places: NDArray[np.intp]) -> bool:
        """Return True if the formulas of all effects hold in the runs ``places``.

        The runs are given as one scene, in which parameters that differ are Many numbers (one value per run).
        """
        if self.warning or not any(type(effect).outside is not Effect.outside for effect in scene.effects):
            return True
        return not beyond(scene, Many(self._speeds(scene, places)), self.control)  # type: ignore[arg-type]

    def look(self, scene: Scene, places: Sequence[int]) -> None:
        """Check the effects' formulas for the runs ``places`` of one scene, and set ``warning`` if one does not hold.
        """
        if self.warning or not any(type(effect).outside is not Effect.outside for effect in scene.effects):
            return
        speeds = self._speeds(scene, np.asarray(places))
        if not any(beyond(scene, float(speed), self.control) for speed in {speeds.min(), speeds.max()}):
            return
        speeds = self._speeds(scene, np.asarray(places), slowed=True)
        if not any(beyond(scene, float(speed), self.control) for speed in {speeds.min(), speeds.max()}):
            return
        place, speed, fault = next(
            (place, speed, fault) for place, speed in zip(places, speeds.tolist(), strict=True)
            if (fault := beyond(scene, speed, self.control))
        )
        alike = self.angle is None and self.velocity is None and len(places) == self.size
        which = "" if alike or self.size == 1 else f"{self.what} {place} of {self.size}, in "
        self.warning = (
            f"In {which}the scene '{scene.name}', up to {speed:.3g} m/s at the bottom, formulas do not hold: {fault}."
        )

    def _speeds(self, scene: Scene, places: NDArray[np.intp], slowed: bool = False) -> Array:
        """Return upper bounds of the bob's speed [m/s] in the runs ``places``, without losses.

        With ``slowed`` they are bounded by the terminal speed, at which drag balances gravity.
        """
        angle = np.full(len(places), scene.run.angle) if self.angle is None else self.angle[places]
        velocity = np.full(len(places), scene.run.velocity) if self.velocity is None else self.velocity[places]
        start = np.abs(velocity * plain(scene.body.reach))
        speed: Array = np.hypot(start, plain(2.0 * scene.omega0 * scene.body.reach) * np.sin(0.5 * angle))
        if slowed:
            steepest = float(np.max(np.sin(np.minimum(np.abs(angle), 0.5 * math.pi))))
            speed = np.maximum(start, np.minimum(speed, terminal_speed(scene, steepest)))
        return speed
