"""Checks of the actions that an agent gives to an environment."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

SINGLE = np.dtype(np.float32)


class ActionError(ValueError):
    """Error for an action that is not one finite number in an array of shape (1,)."""


def torque_share(action: Any) -> float:
    """Return an action as a share of the motor's largest torque, clipped to [-1, 1].

    Raises ActionError for another shape, or a value that is not a finite number.
    """
    if type(action) is np.ndarray and action.shape == (1,):
        share = action.item()
        if type(share) is float and -1.0 <= share <= 1.0:
            return share
    return _checked(_array(action, "An action must have the shape (1,)"))


def _array(values: Any, wanted: str) -> NDArray[Any]:
    """Return values as an array; ActionError, which begins with the words ``wanted``, for rows of different lengths."""
    try:
        return np.asarray(values)
    except ValueError:
        raise ActionError(f"{wanted}, not rows of different lengths.") from None


def _checked(action: NDArray[Any]) -> float:
    """Return an action as a share of the motor's largest torque, clipped to [-1, 1]; ActionError for an invalid one."""
    if action.shape != (1,):
        raise ActionError(f"An action must have the shape (1,), not {action.shape}.")
    if action.dtype.kind not in "fiu":
        raise ActionError(f"An action must be a real number, not {action[0]!r}.")
    share = float(action[0])
    if not math.isfinite(share):
        raise ActionError(f"An action must be a finite number, not {share}; numbers beyond -1 and 1 are clipped.")
    return 1.0 if share > 1.0 else -1.0 if share < -1.0 else share


def checked_actions(actions: Any, size: int, later: bool = False) -> NDArray[Any]:
    """Return the actions of ``size`` environments, not yet clipped: float32 unchanged, others as float64.

    Raises ActionError for another shape than ``(size, 1)``, or values that are not finite, with their indices. With
    ``later``, float32 actions may be not finite, because the program looks at them.
    """
    shares: NDArray[Any]
    if type(actions) is np.ndarray and actions.dtype == SINGLE and actions.shape == (size, 1):
        shares = actions.ravel()
        if later or 0 not in np.isfinite(shares).tobytes():  # quicker than all() for small arrays
            return shares
    wanted = f"Actions of {size} environments must have the shape ({size}, 1)"
    array = _array(actions, wanted)
    if array.shape != (size, 1):
        raise ActionError(f"{wanted}, not {array.shape}.")
    if array.dtype.kind not in "fiu":
        raise ActionError(f"Actions must be real numbers, not of the type {array.dtype}.")
    single = array.dtype == np.float32
    shares = np.ascontiguousarray(array.reshape(size), dtype=np.float32 if single else np.float64)
    finite = np.isfinite(shares)
    if not finite.all():
        bad = np.flatnonzero(~finite)
        places = ", ".join(str(place) for place in bad[:5]) + (", ..." if bad.size > 5 else "")
        raise ActionError(f"Actions must be finite numbers; those of the environments {places} are not.")
    return shares
