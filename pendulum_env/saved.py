"""States to restore, checked as a whole before anything changes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from pendulum_env.physics.units import SceneError, number, shown

KEYS = ("made_for", "state", "action", "trail", "random")


def checked_state(
    saved: Mapping[str, Any], made_for: Mapping[str, Any], names: Sequence[str]
) -> tuple[list[float] | None, float, list[float]]:
    """State, action and trail of what ``get_state`` returned.

    Args:
        saved: what is to be restored.
        made_for: scene, integrator and step of the environment that wants it.
        names: of the numbers that its state has.

    Raises SceneError if it is not a state of such an environment.
    """
    if not isinstance(saved, Mapping) or any(key not in saved for key in KEYS):
        raise SceneError(f"A state to restore must be the dict that get_state returned, with {', '.join(KEYS)}.")
    theirs = saved["made_for"]
    for name, value in made_for.items():
        if not isinstance(theirs, Mapping) or theirs.get(name) != value:
            raise SceneError(f"The state to restore is of an environment with another {name}.")
    values = saved["state"]
    if values is not None and not (len(values) == len(names) and all(map(_possible, names, values))):
        raise SceneError(f"A state of this environment has {len(names)} finite numbers, not {shown(values)}.")
    share = number(saved["action"], "action")
    trail = [number(angle, "trail", unit="rad") for angle in saved["trail"]]
    return None if values is None else [float(value) for value in values], share, trail


def _possible(name: str, value: float) -> bool:
    """True for a finite number, for the quality factor without losses, and for an error that is not known."""
    endless = name in ("quality_factor", "error_estimate")
    return math.isfinite(float(value)) or (endless and float(value) == math.inf)
