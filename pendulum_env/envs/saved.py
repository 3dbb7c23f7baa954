"""Checks of an environment's saved state before it is restored."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from operator import index
from typing import Any

import numpy as np

from pendulum_env.engine.machine import Machine
from pendulum_env.engine.shape import LARGEST
from pendulum_env.engine.spec import RunSpec
from pendulum_env.engine.starts import checked_control
from pendulum_env.envs.randomize import check_parameters
from pendulum_env.envs.switch import HALF
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, number, shown

KEYS = ("made_for", "state", "action", "trail", "random")
"""Keys of an environment's saved state."""
COUNTS = ("index", "taken", "rejected", "slackened", "phase", "status")
"""Numbers of a state that count something and so are whole; see FRACTIONS."""
FRACTIONS = ("index", "slackened")
"""Counts of steps that may have a fraction on a wire, which can go slack within a step."""
ENDLESS = ("quality_factor", "error_estimate")
"""Quantities that may be inf: a quality factor without losses, an error estimate that is unknown."""
MOST = float(LARGEST)
"""Largest angle [rad] and velocity [rad/s] in a saved state."""
MOST_COUNT = 2.0**53
"""Largest counter, such as a number of steps, in a saved state."""
MOST_TURNS = 2.0**50
"""Largest number of full turns in a saved state; beyond, floats cannot represent half turns."""
MOST_WORD = 4294967086.0
"""Largest random whole number in a state with gusts; see :mod:`pendulum_env.physics.random`."""
PCG = ("PCG64", "PCG64DXSM")
"""Random generators of numpy whose saved states are checked number by number."""


def checked_state(
    saved: Mapping[str, Any], made_for: Mapping[str, Any], machine: Machine
) -> tuple[list[float] | None, float, list[float]]:
    """Check a state that ``get_state`` saved; return its numbers, the last action, and the trail behind the bob.

    Args:
        saved: saved state that is to be restored.
        made_for: scene, integrator and step of the environment that restores it.
        machine: simulator of the environment that restores the state.

    Raises SceneError if it is not the state of an environment with this scene, integrator and step.
    """
    check_made_for(saved, KEYS, made_for, "an environment")
    share = checked_control(saved["action"], "action")
    if not isinstance(saved["trail"], (list, tuple, deque, np.ndarray)):
        raise SceneError(f"trail must be a list of angles [rad], not {shown(saved['trail'])}.")
    trail = [number(angle, "trail", unit="rad") for angle in saved["trail"]]
    if any(abs(angle) > MOST for angle in trail):
        raise SceneError(f"trail in a state to restore must be within -{MOST:g} and {MOST:g} rad.")
    if saved["state"] is None:
        return None, share, trail
    values = _numbers(saved["state"], machine.names)
    columns = {name: np.array([value]) for name, value in by_name(values, machine.names).items()}
    check_numbers(columns, machine.scene, machine.drawn, machine.hold)
    state = machine.array(values)
    try:
        with np.errstate(all="ignore"):
            machine.advance(state, share, made_for["step"], 0)
        valid = all(math.isfinite(value) or (name in ENDLESS and value == math.inf)
                    for name, value in zip(machine.names, map(float, state), strict=True))
    except ArithmeticError:
        valid = False
    if not valid:
        raise SceneError("The state to restore is not that of a run: some numbers computed from it are not finite.")
    return values, share, trail


def identity(spec: RunSpec, scene: Scene, tolerance: Mapping[str, float]) -> dict[str, Any]:
    """Return the scene, method and step of an environment, which a state to be restored must have too."""
    compensated = {"compensated": True} if spec.compensated else {}
    return {"scene": scene.to_dict(), "integrator": str(spec.integrator), "step": spec.h, "substeps": spec.hold,
            **tolerance, **compensated}


def check_made_for(saved: Any, keys: Iterable[str], made_for: Mapping[str, Any], where: str) -> None:
    """Raise SceneError unless a saved state is a dict with these keys, saved where ``made_for`` had these values."""
    if not isinstance(saved, Mapping) or any(key not in saved for key in keys):
        raise SceneError(f"A state to restore must be the dict that get_state returned, with {', '.join(keys)}.")
    theirs = saved["made_for"]
    for name, value in made_for.items():
        if not isinstance(theirs, Mapping) or not _same(theirs.get(name), value):
            raise SceneError(f"The state to restore is of {where} with another {name}.")


def checked_parameters(saved: Any, scene: Scene) -> dict[str, float]:
    """Return the parameters of the episode in a saved state, by name; empty if the episode had the scene's own.

    Raises SceneError for values that are not those of numbers of the scene.
    """
    given = saved.get("parameters", {}) if isinstance(saved, Mapping) else {}
    if not isinstance(given, Mapping):
        raise SceneError(f"parameters in a state to restore must be a dict of numbers, not {shown(given)}.")
    check_parameters(given, scene, f"parameters in a state to restore: the scene '{scene.name}' has no parameter")
    return {name: number(value, name) for name, value in given.items()}


def checked_random(saved: Any, own: np.random.BitGenerator) -> dict[str, Any]:
    """Check the saved state of a NumPy random generator, and return it.

    It must be of the same kind as the environment's generator ``own``. Raises SceneError for an invalid state.
    """
    name = type(own).__name__
    if not isinstance(saved, Mapping) or not _same(saved.get("bit_generator"), name):
        raise SceneError(f"random must be a state of the generator {name}, not {shown(saved)}.")
    restored: Any = type(own)()
    reason = "its numbers are out of range"
    try:
        # NumPy drops what is beyond its words, NumPy 1 takes numbers below 0, too, and an even increment is not random.
        fits = name not in PCG or (
            all(0 <= index(saved["state"][word]) < 2**128 for word in ("state", "inc"))
            and saved["state"]["inc"] % 2 == 1
            and index(saved["has_uint32"]) in (0, 1) and 0 <= index(saved["uinteger"]) < 2**32)
        if fits:
            restored.state = saved
    except (TypeError, ValueError, LookupError, ArithmeticError, AttributeError) as error:
        fits, reason = False, str(error)
    if not fits:
        raise SceneError(f"The random state to restore does not fit this environment's generator: {reason}.")
    return dict(saved)


def _same(theirs: Any, own: Any) -> bool:
    """Return True if two values are equal, and False if not or if the comparison fails, as it does for arrays."""
    try:
        return bool(theirs == own)
    except (TypeError, ValueError):
        return False


def _numbers(values: Any, names: Sequence[str]) -> list[float]:
    """Return a saved state's numbers as floats; raises SceneError if one is missing or not finite."""
    try:
        if not isinstance(values, (list, tuple, np.ndarray)) or len(values) != len(names):
            raise TypeError
        return [math.inf if name in ENDLESS and _same(value, math.inf) else number(value, name)
                for name, value in zip(names, values, strict=True)]
    except (TypeError, SceneError):
        raise SceneError(
            f"A state to restore in this environment must have {len(names)} finite numbers, not {shown(values)}."
        ) from None


def by_name(values: Sequence[float], names: Sequence[str]) -> dict[str, float]:
    """Return the numbers of a single environment's state by name.

    Reported quantities follow the state itself, partly under the same names: of two the first counts.
    """
    return dict(zip(reversed(names), reversed(values), strict=True))


def check_numbers(columns: Mapping[str, Any], scene: Scene, drawn: Sequence[str], hold: float) -> None:
    """Raise SceneError if saved states contain numbers that no run reaches, such as an angle out of range.

    ``columns`` are arrays with one number for each state, by the names of a single environment's state. ``drawn`` are
    the names of those that start as random whole numbers; ``hold`` is the number of steps in a control step. Numbers
    that the program computes anew from the others are not checked.
    """
    def check(name: str, good: Any, wanted: str) -> None:
        if not good.all():
            raise SceneError(f"{name} in a state to restore must be {wanted}, not {float(columns[name][~good][0])!r}.")

    most = {"angle": math.pi if scene.periodic else MOST, "turns": MOST_TURNS, "velocity": MOST}
    for name, column in columns.items():
        own = name.removeprefix(HALF)
        if own in most:
            check(name, abs(column) <= most[own], f"within -{most[own]:g} and {most[own]:g}")
        if own == "turns" and scene.periodic:
            check(name, column % 0.5 == 0.0, "a multiple of 1/2")
        if own in COUNTS or own in drawn:
            last = MOST_WORD if own in drawn else hold - 1 if own == "phase" else MOST_COUNT
            whole = (column % 1.0 == 0.0) | (own in FRACTIONS and scene.body.suspension == "wire")
            check(name, (column >= 0.0) & (column <= last) & whole, f"a whole number from 0 to {last:g}")
    if "half_index" in columns:
        check("half_index", columns["half_index"] <= 2.0 * np.ceil(columns["index"]), "at most twice index")


def check_form(saved: Any, form: Any, name: str, size: int) -> None:
    """Raise SceneError unless a part of a saved state of ``size`` environments has a form.

    A form is the kind of number of an array with one number for each environment, "u" for the words of random
    generators; None for what is checked elsewhere; a dict of the forms of parts; or a set of names, some of which may
    be left out, of columns of floats.
    """
    if isinstance(form, str):
        shape = (4, size) if form == "u" else (size,)
        if not isinstance(saved, np.ndarray) or saved.shape != shape or saved.dtype.kind != form:
            raise SceneError(f"{name} in a state to restore must be an array of the shape {shape}, not {shown(saved)}.")
    elif form is not None:
        some = not isinstance(form, Mapping)
        if not isinstance(saved, Mapping) or not {*saved} <= {*form} or (len(saved) < len(form) and not some):
            words = "of arrays, with names among" if some else "with"
            raise SceneError(f"{name} in a state to restore must be a dict {words} {', '.join(sorted(form))}.")
        for key, value in saved.items():
            check_form(value, "f" if some else form[key], key, size)
