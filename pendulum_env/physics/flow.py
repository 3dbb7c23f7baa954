"""Flow past the bob: Reynolds and Keulegan-Carpenter numbers, losses of a swing, quality factor."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping
from functools import cache

from pendulum_env.common.many import sqrt
from pendulum_env.physics.body import RigidBody
from pendulum_env.physics.drag_laws import LAWS
from pendulum_env.physics.medium import Medium
from pendulum_env.physics.surroundings import Loss, Surroundings

CLIFT_GAUVIN_LIMIT = LAWS["clift_gauvin"].most
"""Largest Reynolds number for which the default law of :func:`sphere_drag_coefficient` is valid."""

STOKES_LIMIT = 0.01
"""Reynolds number below which the standard drag curve is Stokes' law (Clift, Grace & Weber 1978, table 5.2)."""

REGIMES = (
    (1.0, "creeping flow: Stokes' linear drag holds"),
    (20.0, "Stokes' linear drag is already too small (by half at Re = 10); neither linear nor quadratic"),
    (500.0, "between linear and quadratic: the drag coefficient still falls with speed, use C_d(Re)"),
    (2.0e5, "the drag coefficient is nearly constant: drag is quadratic, Stokes' linear drag is far too small"),
)
"""Upper Reynolds number of each flow regime, and its consequence for damping (Clift, Grace & Weber 1978, chapter 5)."""

PHASES = 64
"""Number of points of a half swing at which its losses are evaluated."""
LEAST_AMPLITUDE = 1e-100
"""Smallest amplitude of a swing in these formulas; used in place of zero [rad]."""


def reynolds_number(speed: float, body: RigidBody, medium: Medium) -> float:
    """Return ``Re = rho |V| 2a / mu`` of the bob at ``speed`` [m/s].

    0 at rest and in vacuum; inf for a moving bob in a medium without viscosity.
    """
    inertia = medium.density * abs(speed) * 2.0 * body.radius
    if medium.viscosity == 0.0:
        return math.inf if inertia else 0.0
    return inertia / medium.viscosity


def boundary_layer(omega: float, medium: Medium) -> float:
    """Return the thickness ``delta = sqrt(2 nu/omega)`` [m] of the fluid that an oscillating wall drags along.

    ``omega`` is the wall's angular frequency [1/s]. Infinite in a medium without density. Source: Stokes 1851; Landau &
    Lifshitz, Fluid Mechanics, section 24.
    """
    inertia = medium.density * omega
    return sqrt(2.0 * medium.viscosity / inertia) if inertia > 0.0 else math.inf


def sphere_drag_coefficient(reynolds: float, law: str = "clift_gauvin") -> float:
    """Return C_d of a sphere at a Reynolds number, by one of :data:`pendulum_env.physics.drag_laws.LAWS`.

    Raises ValueError for a Reynolds number outside the law's range.
    """
    return LAWS[law].coefficient(reynolds)


def regime(reynolds: float) -> str:
    """Return a sentence on the flow past the bob at a Reynolds number, and on the damping model that fits it."""
    for limit, meaning in REGIMES:
        if reynolds <= limit:
            return meaning
    return "the boundary layer turns turbulent and the drag coefficient drops: outside these models"


# --- of a swing -----------------------------------------------------------------------------------------------------


def natural_rate(scene: Surroundings) -> float:
    """Return the small-angle frequency omega0 [1/s]; 0 if the scene has no restoring torque."""
    return scene.omega0 if scene.of_kind("conservative") else 0.0


def bottom_speed(scene: Surroundings, amplitude: float) -> float:
    """Return the speed of the bob at the bottom [m/s] for an amplitude [rad], without losses: ``2 omega0 L sin(A/2)``.
    """
    return 2.0 * scene.omega0 * scene.body.reach * abs(math.sin(0.5 * amplitude))


def keulegan_carpenter(scene: Surroundings, amplitude: float) -> float:
    """Return the Keulegan-Carpenter number ``pi A_x/a``: the width of a swing over the bob's radius.

    ``amplitude`` [rad] is A, and ``A_x = L A``. Above about 1 the flow separates and the drag is that of steady flow,
    C_d(Re); below, that of an oscillating boundary layer. Source: Keulegan & Carpenter 1958, J. Res. Natl. Bur. Stand.
    60, 423.
    """
    return math.pi * scene.body.reach * abs(amplitude) / scene.body.radius


def braking(scene: Surroundings) -> tuple[Loss, ...]:
    """Return the effects that slow a swing down without control: dissipative ones, and motors that brake."""
    return tuple(effect for effect in scene.effects
                 if effect.kind == "dissipative" or (effect.kind == "drive" and effect.flow))


def swing_loss(effect: Loss, scene: Surroundings, amplitude: float) -> float:
    """Return the share of its amplitude [rad] that a harmonic swing loses per half swing to a dissipative effect.

    This is the energy lost over twice the energy of a swing at omega0, by the midpoint rule on the effect's torque
    (exact for linear drag, within 1e-6 for the others), with medium and pivot at rest. Infinite without a restoring
    torque.
    """
    size, omega, values = max(abs(amplitude), LEAST_AMPLITUDE), scene.omega0, effect.coefficients(scene)
    if omega == 0.0:
        return math.inf
    if effect.dry:
        return 2.0 * values[effect.dry] / (omega * omega) / size
    total, torque = 0.0, _still(effect, values)
    for i in range(PHASES):
        phase = math.pi * (i + 0.5) / PHASES
        angle, velocity = size * math.cos(phase), -size * omega * math.sin(phase)
        total -= torque(angle, velocity) / size * (velocity / size)
    return total * math.pi / PHASES / omega**3


def still_torque(effect: Loss, values: Mapping[str, float], angle: float, velocity: float) -> float:
    """Return a dissipative effect's torque divided by the moment of inertia, in a medium at rest [1/s²].

    Of a motor it is the torque without control.
    """
    return _still(effect, values)(angle, velocity)


def _still(effect: Loss, values: Mapping[str, float]) -> Callable[[float, float], float]:
    """Return a dissipative effect's torque of :func:`still_torque` as a function of angle and velocity."""
    own = effect.torque
    if own is None:
        dry = values[effect.dry]
        return lambda _angle, velocity: -math.copysign(dry, velocity)
    known: dict[str, float] = {"time": 0.0, "side": 1.0, "control": 0.0, **dict.fromkeys(effect.memory, 0.0), **values}
    names = _parameters(own)
    moving = {name for name in ("angle", "tilt", "velocity", "slip", "speed") if name not in values}

    def torque(angle: float, velocity: float) -> float:
        motion = {"angle": angle, "tilt": angle, "velocity": velocity, "slip": velocity, "speed": abs(velocity)}
        return own(*[motion[name] if name in moving else known[name] for name in names])

    return torque


@cache
def _parameters(function: Callable[..., object]) -> tuple[str, ...]:
    """Return the names of a function's parameters."""
    return tuple(inspect.signature(function).parameters)


def terminal_speed(scene: Surroundings, steepness: float = 1.0) -> float:
    """Return the speed at which all losses balance the weight where sin(angle) is ``steepness`` [m/s].

    A bob released at rest never gets faster than that. The relative error is 1e-9. Returns inf if the losses stay below
    the weight.
    """
    pull, values, brakes = scene.omega0**2 * steepness, scene.coefficients, braking(scene)
    low, high = 0.0, 1e9
    for _ in range(200):
        middle = 0.5 * (low + high) if low > 0.0 else high / 1024.0
        if high - low <= 1e-9 * high or high < 1e-30:
            break
        losses = -sum(still_torque(effect, values, 0.0, middle) for effect in brakes)
        low, high = (low, middle) if losses >= pull else (middle, high)
    return scene.body.reach * high if high < 1e9 else math.inf


def quality_factor(scene: Surroundings, amplitude: float) -> float:
    """Return the quality factor ``Q = omega0/gamma_eq`` of a swing of this amplitude [rad].

    ``gamma_eq`` is the linear damping rate that takes as much energy from a harmonic swing at omega0 as all dissipative
    effects together, dry friction and motors that brake without control included. Q is inf without losses and 0 without
    a restoring torque.
    """
    if natural_rate(scene) == 0.0:
        return 0.0
    loss = sum(swing_loss(effect, scene, amplitude) for effect in braking(scene))
    return 0.5 * math.pi / loss if loss > 0.0 else math.inf


def regime_of_damping(quality: float) -> str:
    """Return "underdamped", "critically damped" or "overdamped" for a quality factor above, at (to 1e-9) or below 1/2.
    """
    if math.isclose(quality, 0.5, rel_tol=1e-9):
        return "critically damped"
    return "underdamped" if quality > 0.5 else "overdamped"


def damping_rate(scene: Surroundings, velocity: float) -> float:
    """Return the slope of the damping torques per inertia with the speed, at an angular velocity [rad/s], in a medium
    at rest [1/s].

    It is ``gamma`` for linear drag and ``2 c |v|`` for quadratic drag. Dry friction is left out: it is constant except
    at rest.
    """
    values, near = scene.coefficients, 1e-4 * abs(velocity) or 1e-9
    slopes = (still_torque(effect, values, 0.0, velocity - near) - still_torque(effect, values, 0.0, velocity + near)
              for effect in braking(scene) if effect.torque)
    return max(sum(slopes) / (2.0 * near), 0.0)
