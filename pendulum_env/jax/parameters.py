"""Numbers of a program from a scene whose parameters are JAX arrays, such as a length to be differentiated by.

Bodies and effects compute a program's coefficients from their parameters in plain Python. A parameter given as a JAX
array goes through these formulas as a :class:`TracedNumber`: a value that conditions look at, and the array itself.
While JAX traces, the array has no value yet; conditions then look at the scene's own value of the parameter.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from pendulum_env.common.many import Many, Operator, PartedError, Twinned, twin_of
from pendulum_env.engine.machine import numbers_of
from pendulum_env.engine.problem import program_parts
from pendulum_env.engine.source import constants_text, copied, with_callees
from pendulum_env.jax.elementary import ELEMENTARY
from pendulum_env.jax.programs import ROUNDED, functions
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, shown

NEAR_ZERO = 1e-3
"""Value of a parameter that is compared with 0, to see if conditions in formulas tell them apart."""


class TracedNumber(Twinned):
    """A number with a value for conditions, and as its twin the JAX array with which formulas compute."""

    __slots__ = ()

    def combined(self, operation: Operator, left: Any, right: Any) -> Any:
        if any(isinstance(one, float) and abs(one) > ROUNDED for one in (left, right)) and operation is operator.add:
            raise TypeError("it rounds, by adding a large number")
        return super().combined(operation, left, right)

    def mapped(self, function: np.ufunc) -> TracedNumber:
        return TracedNumber(function(self.values), getattr(jnp, function.__name__)(self.twin))

    def through(self, formula: Callable[..., Any], further: tuple[float, ...]) -> TracedNumber:
        value = np.array([formula(float(one), *further) for one in self.values])
        return TracedNumber(value, on_arrays(formula)(self.twin, *further))

    def refined(self, further: Any) -> TracedNumber:
        return TracedNumber(self.values, further.twin)


# Python asks the right operand first only if its class defines the reflected operator itself.
for _name in ("add", "sub", "mul", "truediv", "pow"):
    setattr(TracedNumber, f"__r{_name}__", getattr(Many, f"__r{_name}__"))


@lru_cache(maxsize=64)
def on_arrays(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a plain function of floats, such as a law of drag, as a function of JAX arrays."""
    if function.__name__ in ELEMENTARY:
        return ELEMENTARY[function.__name__]
    copies = with_callees([function])
    program = functions(constants_text(copies) + copied(copies, ""))
    return lambda *arguments: program.call(function.__name__, *arguments)


def is_array(value: Any) -> bool:
    """Return True for a number that JAX may trace: one of its arrays or tracers."""
    return isinstance(value, jax.Array)


def with_parameters(scene: Scene, parameters: Mapping[str, Any]) -> Scene:
    """Return a scene with other values of its parameters, some of which may be JAX arrays.

    Raises SceneError for a name that the scene does not have, for a value out of range, for an array in place of a
    parameter that has no number, and where a formula cannot compute with an array.
    """
    given = {name: value for name, value in parameters.items() if not is_array(value)}
    scene = scene.replace(**given) if given else scene
    arrays = {name: value for name, value in parameters.items() if is_array(value)}
    if not arrays:
        return scene
    usual = scene.parameters()
    numbers = {name: TracedNumber(_value(name, value, scene, usual), value) for name, value in arrays.items()}
    try:
        with np.errstate(all="ignore"):
            changed = scene.replace(**numbers)
            numbers_of(changed)
    except PartedError:
        raise SceneError(f"The scene '{scene.name}' needs different formulas for the values of {', '.join(arrays)} in "
                         "this batch; call rollout for each group, or use jax.vmap.") from None
    except TypeError as error:
        raise SceneError(f"The scene '{scene.name}' has a formula that cannot compute with a JAX array as "
                         f"{' or '.join(arrays)} ({error}); give it as a number.") from None
    for name in arrays:
        if isinstance(arrays[name], jax.core.Tracer) and not _value(name, arrays[name], scene, usual).any():
            _check_zero(scene, name)
    if program_parts(changed) != program_parts(scene):
        raise SceneError(f"The scene '{scene.name}' with these values of {', '.join(arrays)} needs another program; "
                         "give them as numbers.")
    return changed


def _value(name: str, array: Any, scene: Scene, usual: Mapping[str, Any]) -> Any:
    """Return the value of a parameter at which conditions are decided, as an array of numbers."""
    if not isinstance(array, jax.core.Tracer):
        return np.ravel(np.asarray(array, dtype=np.float64))
    value = usual.get(name, usual.get(name.rpartition(".")[2]))
    if value is None and name not in usual:
        scene.replace(**{name: NEAR_ZERO})  # raises the error for an unknown name
    if not isinstance(value, float):
        raise SceneError(f"The parameter {name} of the scene '{scene.name}' is {shown(value)}, and JAX needs a number "
                         f"at which to trace; give the scene one first, as in rollout(scene.replace({name}=...)).")
    return np.array([value])


def _check_zero(scene: Scene, name: str) -> None:
    """Raise SceneError if a parameter that is 0 in the scene has other formulas, or another program, at other values.
    """
    sides = []
    with jax.ensure_compile_time_eval(), np.errstate(all="ignore"):
        for value in (0.0, NEAR_ZERO):
            try:
                place = scene.replace(**{name: TracedNumber(np.array([value]), jnp.asarray(NEAR_ZERO))})
                sides.append((program_parts(place), [float(one) for one in numbers(place).values()]))
            except SceneError:
                pass
    if len(sides) == 2 and sides[0][0] == sides[1][0] and np.allclose(sides[0][1], sides[1][1], 1e-6, equal_nan=True):
        return
    raise SceneError(f"The parameter {name} of the scene '{scene.name}' is 0, where other formulas hold than at other "
                     f"values; give the scene another one first, as in rollout(scene.replace({name}=...)).")


def numbers(scene: Scene) -> dict[str, Any]:
    """Return the numbers of a scene that programs take as parameters by name, floats or JAX arrays."""
    with np.errstate(all="ignore"):
        return {name: twin_of(value) for name, value in numbers_of(scene).items()}
