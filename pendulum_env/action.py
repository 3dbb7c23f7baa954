"""What an agent may ask of the motor."""

from __future__ import annotations

import math
from typing import Any

import numpy as np


class ActionError(ValueError):
    """An action that is not one finite number in an array of shape (1,)."""


def torque_share(action: Any) -> float:
    """The action as a share of the motor's torque, clipped to [-1, 1].

    Raises ActionError for another shape, or a value that is not a finite number.
    """
    if getattr(action, "shape", None) != (1,):
        action = np.asarray(action)
        if action.shape != (1,):
            raise ActionError(f"An action must have the shape (1,), not {action.shape}.")
    if action.dtype.kind not in "fiu":
        raise ActionError(f"An action must be a real number, not {action[0]!r}.")
    share = float(action[0])
    if not math.isfinite(share):
        raise ActionError(f"An action must be finite, within -1 and 1, not {share}.")
    return 1.0 if share > 1.0 else -1.0 if share < -1.0 else share
