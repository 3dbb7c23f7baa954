"""Checks of a run's arguments: duration, initial conditions, speed limit, methods, seeds and output file."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from integrators import Method, MethodError
from integrators.solving.equal import MOST_STEPS
from pendulum_env.common.checks import float_array
from pendulum_env.common.many import Many
from pendulum_env.engine.machine import find_method
from pendulum_env.engine.random_streams import MOST_SEED
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, file_path, number, several, shown

Array = NDArray[np.float64]

LARGEST_ANGLE = {True: 1e8, False: 1e100}
"""Largest initial |angle| [rad] of periodic scenes (True) and others (False).

The sine is accurate up to 8e8 rad; elsewhere the square of the angle must be finite.
"""
WHOLE = ("effects",)
"""Parameters whose value is itself a sequence, so that a sequence is not one value per environment."""
ENOUGH = 4
"""Minimum number of substeps per control step, as a multiple of the history length of a multistep method."""
MOST_ROWS = 100_000_000
"""Largest number of states that one call may record, over all of its runs: some 10 GB."""
LARGEST_VELOCITY = 1e9
"""Largest initial |velocity| [rad/s]."""


def checked_steps(duration: float, h: float) -> int:
    """Return the number of steps of ``h`` [s] in a run of ``duration`` [s], rounded up.

    Raises SceneError for more steps than a run may have (MOST_STEPS).
    """
    count = duration / h if h > 0.0 else math.inf
    if not count <= MOST_STEPS:
        raise SceneError(
            f"A run of {duration:g} s in steps of {h:g} s takes {count:.3g} steps, more than the {MOST_STEPS:.0e} "
            "allowed; take longer steps or a shorter run."
        )
    return max(1, math.ceil(count - 1e-9 - 1e-12 * count))


def check_count(count: int) -> None:
    """Raise SceneError if a call would record more than 100 million states (MOST_ROWS) of all its runs."""
    if count > MOST_ROWS:
        most = f"at most {MOST_ROWS}; raise every, shorten the run, or give a file."
        raise SceneError(f"{count} states are too many to record, {most}")


def checked_control(control: Any, name: str = "control") -> float:
    """Return the control (motor torque as a fraction of its largest torque) as a float from -1 to 1.

    Raises SceneError for any other value.
    """
    share = number(control, name)
    if abs(share) > 1.0:
        raise SceneError(f"{name} must be between -1 and 1, not {share!r}.")
    return share


def frequency(scene: Scene) -> float:
    """Return the angular frequency omega0 of small swings of a scene [1/s], or 1 for a scene without gravity.

    Rewards use it as the unit of velocity.
    """
    return scene.omega0 or 1.0


def checked_limit(value: Any, scene: Scene | None = None) -> float:
    """Return the checked |velocity| that ends a run or, if a scene is given, an episode [rad/s].

    An episode's is 100 omega0 if ``value`` is None. Raises SceneError unless it is a number above 0; inf is no limit.
    """
    if value is None and scene is not None:
        value = 100.0 * frequency(scene)
    endless = isinstance(value, (float, Many)) and value == math.inf
    return math.inf if endless else number(value, "speed_limit", above=0.0, unit="rad/s")


def usual_start(scene: Scene, angle: float | None, velocity: float | None) -> tuple[float, float]:
    """Return the initial angle [rad] and velocity [rad/s] of one run; None is that of the scene's usual run.

    Raises SceneError for values that are not finite numbers.
    """
    return (number(scene.run.angle if angle is None else angle, "angle", unit="rad"),
            number(scene.run.velocity if velocity is None else velocity, "velocity", unit="rad/s"))


def checked_start(scene: Scene, angle: ArrayLike, velocity: ArrayLike) -> tuple[Array, Array]:
    """Return the initial angles [rad] and velocities [rad/s] as two arrays of one shape; ``()`` for two numbers.

    Raises SceneError for values that are not finite numbers or exceed the limits LARGEST_ANGLE and LARGEST_VELOCITY,
    for shapes that do not fit together, and for an energy that is not finite.
    """
    q0, v0 = start_values(angle, "angle", "rad"), start_values(velocity, "velocity", "rad/s")
    try:
        q, v = np.broadcast_arrays(q0, v0)
    except ValueError:
        raise SceneError(f"angle and velocity must have one shape, not {q0.shape} and {v0.shape}.") from None
    most = (float(np.max(np.abs(q))), float(np.max(np.abs(v))))
    limits = (LARGEST_ANGLE[scene.periodic], LARGEST_VELOCITY)
    for name, value, limit, unit in zip(("angle", "velocity"), most, limits, ("rad", "rad/s"), strict=True):
        if value > limit:
            raise SceneError(f"{name} must be between -{limit:g} and {limit:g} {unit} at the start, not {value!r}.")
    rate = scene.omega0 * (1.0 + most[0])
    if not math.isfinite(scene.inertia * (most[1] * most[1] + rate * rate)):
        raise SceneError(f"The energy of a start from {most[0]:g} rad and {most[1]:g} rad/s is not finite.")
    return q, v


def checked_methods(integrators: Method | Iterable[str | Method], scene: Scene) -> list[Method]:
    """Return the integration methods with these names for a scene.

    Raises MethodError for a method that does not fit the scene, a method named twice, and an empty list.
    """
    return none_twice(find_method(name, scene) for name in listed_methods(integrators))


def listed_methods(integrators: Any) -> tuple[Any, ...]:
    """Return a tuple of method names or Methods from a sequence, a comma-separated text, one Method, or a dict's keys.

    Raises MethodError for any other value.
    """
    if isinstance(integrators, Method):
        return (integrators,)
    if isinstance(integrators, str):
        return tuple(name.strip() for name in integrators.split(","))
    try:
        named = [*integrators] if isinstance(integrators, Mapping) else integrators
        return several(named, "integrators", "names or methods")
    except SceneError as error:
        raise MethodError(str(error)) from None


def none_twice(integrators: Iterable[Method]) -> list[Method]:
    """Return the methods as a list; MethodError if a method is named twice or if there are no methods."""
    methods = list(integrators)
    if not methods:
        raise MethodError("At least one integrator is needed; the list is empty.")
    for i, method in enumerate(methods):
        if method.name in (earlier.name for earlier in methods[:i]):
            raise MethodError(f"The integrator {method.name} is named twice; name each integrator once.")
    return methods


def checked_seeds(seed: Any, size: int) -> Sequence[int]:
    """Return the ``size`` consecutive seeds that begin with ``seed``; SceneError unless all are from 0 to 2**128 - 1.
    """
    if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or not 0 <= seed <= MOST_SEED - size + 1:
        raise SceneError(f"seed must be a whole number from 0 to 2**128 - {size}, not {shown(seed)}.")
    return range(int(seed), int(seed) + size)


def batch_shape(angle: Any, velocity: Any, parameters: Mapping[str, Any]) -> tuple[int, ...]:
    """Return the common shape of the initial conditions and parameters of a batch; () for a single run.

    Raises SceneError for shapes that do not broadcast together, for empty arrays and for values that are not numbers.
    """
    given = {"angle": angle, "velocity": velocity, **parameters}
    shapes: dict[str, tuple[int, ...]] = {}
    for name, value in given.items():
        try:
            shapes[name] = () if name in WHOLE else np.shape(value)
        except ValueError:
            raise SceneError(f"{name} must be a number or an array of numbers, not {shown(value)}.") from None
    try:
        common: tuple[int, ...] = np.broadcast_shapes(*shapes.values())
    except ValueError:
        arrays = ", ".join(f"{name} {shape}" for name, shape in shapes.items() if shape)
        raise SceneError(f"angle and velocity, and parameters, must have one shape, not {arrays}.") from None
    if 0 in common:
        raise SceneError("angle and parameters must hold at least one number, not an empty array.")
    return common


def flat(value: Any, name: str, shape: tuple[int, ...]) -> Any:
    """Return a parameter's values for all runs of a batch as a flat array.

    A single value for all runs is returned unchanged.
    """
    return value if name in WHOLE or np.ndim(value) == 0 else np.broadcast_to(np.asarray(value), shape).ravel()


def npy_path(file: str | Path) -> Path:
    """Return the path of the file for a batch's records; SceneError unless it ends in ".npy"."""
    path = file_path(file, "file")
    if path.suffix != ".npy":
        raise SceneError(f"The file of a batch's records must end in .npy, not {shown(path.name)}.")
    return path


def given_start(value: ArrayLike | None, name: str, unit: str, shape: tuple[int, ...]) -> Array | None:
    """Return the initial angles or velocities of all runs as a flat array, or None if ``value`` is None.

    Raises SceneError for values that are not finite numbers.
    """
    return None if value is None else np.broadcast_to(start_values(value, name, unit), shape).ravel()


def start_values(value: ArrayLike, name: str, unit: str) -> Array:
    """Return initial angles or velocities as a float array; SceneError for values that are not finite numbers."""
    try:
        values = float_array(value)
    except TypeError:
        raise SceneError(f"{name} must be a number or an array of numbers [{unit}], not {shown(value)}.") from None
    if values.size == 0 or not np.all(np.isfinite(values)):
        raise SceneError(f"{name} must hold at least one number, all of them finite [{unit}], not {shown(value)}.")
    return values


def at_most(value: float) -> str:
    """Return a positive number as text with two significant digits, rounded down so that it is safe as an upper limit.
    """
    unit = 10.0 ** (math.floor(math.log10(value)) - 1) if value > 1e-300 else 0.0
    return f"{math.floor(value / unit) * unit:.2g}" if unit else f"{value:.2g}"


def restarting(scene: Scene) -> bool:
    """Return True if a multistep method must rebuild its history of past steps at every control step.

    That is so where the control or the internal state of an effect, such as gusts, may change from one control step to
    the next.
    """
    return any(effect.controlled or effect.memory for effect in scene.effects)


def fewest_substeps(method: Method, scene: Scene) -> int:
    """Return the smallest number of substeps per control step at which a multistep method is worthwhile.

    The number is 1 for one-step methods, and for scenes in which the method keeps its history between control steps.
    """
    return ENOUGH * method.past if method.begun_by and restarting(scene) else 1
