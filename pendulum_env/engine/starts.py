"""What a run is asked for, checked: its length, its start, its methods, its file."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from integrators import Method, MethodError
from integrators.solving.solve import MOST_STEPS
from pendulum_env.engine.each import WHOLE
from pendulum_env.engine.machine import find_method
from pendulum_env.engine.streams import MOST_SEED
from pendulum_env.physics.arrays import float_array
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, file_path, number, several, shown

Array = NDArray[np.float64]

LARGEST_ANGLE = {True: 1e8, False: 1e100}
"""Angles a start may have [rad], periodic scenes and others: the sine is accurate to 8e8, a square must be finite."""
ENOUGH = 4
"""Control steps of so many times a multistep method's past are long enough for it."""
MOST_ROWS = 100_000_000
"""States that one call may record, all runs together: some 10 GB."""
LARGEST_VELOCITY = 1e9
"""Velocity that a start may have [rad/s]."""


def checked_steps(duration: float, h: float) -> int:
    """Steps of ``h`` in a run of ``duration`` [s], rounded up; SceneError for more than MOST_STEPS."""
    count = duration / h if h > 0.0 else math.inf
    if not count <= MOST_STEPS:
        raise SceneError(
            f"A run of {duration:g} s in steps of {h:g} s takes {count:.3g} steps, more than the {MOST_STEPS:.0e} that "
            "can be; take longer steps or a shorter run."
        )
    return max(1, math.ceil(count - 1e-9 - 1e-12 * count))


def check_count(count: int) -> None:
    """Raise SceneError for more states to record than MOST_ROWS."""
    if count > MOST_ROWS:
        most = f"at most {MOST_ROWS}; raise every, shorten the run, or give a file."
        raise SceneError(f"{count} states are too many to record, {most}")


def checked_control(control: Any, name: str = "control") -> float:
    """A share of the motor's torque; SceneError if it is no number within -1 and 1."""
    share = number(control, name)
    if abs(share) > 1.0:
        raise SceneError(f"{name} must be within -1 and 1, not {share!r}.")
    return share


def checked_start(scene: Scene, angle: ArrayLike, velocity: ArrayLike) -> tuple[Array, Array]:
    """Angle [rad] and velocity [rad/s] of starts, as two arrays of one shape, ``()`` for two numbers.

    Raises SceneError for what is no finite number, beyond LARGEST_ANGLE or LARGEST_VELOCITY, of shapes that do not fit
    together, or of an energy that is not finite.
    """
    q0, v0 = _start(angle, "angle", "rad"), _start(velocity, "velocity", "rad/s")
    try:
        q, v = np.broadcast_arrays(q0, v0)
    except ValueError:
        raise SceneError(f"angle and velocity must have one shape, not {q0.shape} and {v0.shape}.") from None
    most = (float(np.max(np.abs(q))), float(np.max(np.abs(v))))
    limits = (LARGEST_ANGLE[scene.periodic], LARGEST_VELOCITY)
    for name, value, limit, unit in zip(("angle", "velocity"), most, limits, ("rad", "rad/s"), strict=True):
        if value > limit:
            raise SceneError(f"{name} must be within -{limit:g} and {limit:g} {unit} at the start, not {value!r}.")
    rate = scene.omega0 * (1.0 + most[0])
    if not math.isfinite(scene.inertia * (most[1] * most[1] + rate * rate)):
        raise SceneError(f"The energy of a start from {most[0]:g} rad and {most[1]:g} rad/s must be finite; it is not.")
    return q, v


def checked_methods(integrators: Iterable[str | Method], scene: Scene) -> list[Method]:
    """The methods, each fitting the scene and none twice; MethodError otherwise, and for none at all."""
    return none_twice(find_method(name, scene) for name in listed_methods(integrators))


def listed_methods(integrators: Any) -> tuple[Any, ...]:
    """Names or methods as they are listed, or one text with commas between names; of a dict its names.

    Raises MethodError for anything else.
    """
    if isinstance(integrators, str):
        return tuple(name.strip() for name in integrators.split(","))
    try:
        named = [*integrators] if isinstance(integrators, Mapping) else integrators
        return several(named, "integrators", "names or methods")
    except SceneError as error:
        raise MethodError(str(error)) from None


def none_twice(found: Iterable[Method]) -> list[Method]:
    """The methods as a list; MethodError if one is there twice, or none at all."""
    methods = list(found)
    if not methods:
        raise MethodError("At least one integrator is needed, not none.")
    for i, method in enumerate(methods):
        if method.name in (earlier.name for earlier in methods[:i]):
            raise MethodError(f"The integrator {method.name} is named twice; each can be there once.")
    return methods


def checked_seeds(seed: Any, size: int) -> Sequence[int]:
    """Seeds of runs, each one more than that before; SceneError for a seed that is none."""
    if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or not 0 <= seed <= MOST_SEED - size + 1:
        raise SceneError(f"seed must be a whole number from 0 to 2**128 - 1 for the last run, not {shown(seed)}.")
    return range(int(seed), int(seed) + size)


def batch_shape(angle: Any, velocity: Any, parameters: Mapping[str, Any]) -> tuple[int, ...]:
    """The shape of a batch that these make together; () for one run."""
    given = {"angle": angle, "velocity": velocity, **parameters}
    shapes: dict[str, tuple[int, ...]] = {}
    for name, value in given.items():
        try:
            shapes[name] = () if name in WHOLE else np.shape(value)
        except ValueError:
            raise SceneError(f"{name} must be a number or an array of numbers, not {shown(value)}.") from None
    try:
        found: tuple[int, ...] = np.broadcast_shapes(*shapes.values())
    except ValueError:
        found_ones = ", ".join(f"{name} {shape}" for name, shape in shapes.items() if shape)
        raise SceneError(f"angle and velocity, and parameters, must have one shape, not {found_ones}.") from None
    if 0 in found:
        raise SceneError("angle and parameters must hold at least one number, not an empty array.")
    return found


def flat(value: Any, name: str, shape: tuple[int, ...]) -> Any:
    """A parameter's values of all runs, one after the other; a single value as it is."""
    return value if name in WHOLE or np.ndim(value) == 0 else np.broadcast_to(np.asarray(value), shape).ravel()


def npy_path(file: str | Path) -> Path:
    """Where a batch's records go; SceneError for another ending than ".npy"."""
    path = file_path(file, "file")
    if path.suffix != ".npy":
        raise SceneError(f"The file of a batch's records must end in .npy, not {shown(path.name)}.")
    return path


def given_start(value: ArrayLike | None, name: str, unit: str, shape: tuple[int, ...]) -> Array | None:
    """Starts of all runs, one after the other; None if none is given. SceneError for what is no finite number."""
    return None if value is None else np.broadcast_to(_start(value, name, unit), shape).ravel()


def _start(value: ArrayLike, name: str, unit: str) -> Array:
    try:
        found = float_array(value)
    except TypeError:
        raise SceneError(f"{name} must be a number or an array of numbers [{unit}], not {shown(value)}.") from None
    if found.size == 0 or not np.all(np.isfinite(found)):
        raise SceneError(f"{name} must hold at least one number, all of them finite [{unit}], not {shown(value)}.")
    return found


def at_most(value: float) -> str:
    """A positive number in two digits, rounded down."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1) if value > 1e-300 else 0.0
    return f"{math.floor(value / unit) * unit:.2g}" if unit else f"{value:.2g}"


def restarting(scene: Scene) -> bool:
    """True if the control, or what effects remember, may change at every control step, which ends a method's past."""
    return any(effect.controlled or effect.memory for effect in scene.effects)


def fewest_substeps(method: Method, scene: Scene) -> int:
    """Steps that a control step should have for a multistep method to be itself; 1 for other methods and scenes."""
    return ENOUGH * method.past if method.begun_by and restarting(scene) else 1
