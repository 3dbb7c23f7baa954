"""Checks of the actions that an agent gives to an environment."""

from __future__ import annotations

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
    share = float(_checked(action, (1,), "An action")[0])
    return 1.0 if share > 1.0 else -1.0 if share < -1.0 else share


def checked_actions(actions: Any, size: int, later: bool = False) -> NDArray[Any]:
    """Return the actions of ``size`` environments, not yet clipped: float32 unchanged, others as float64.

    Raises ActionError for another shape than ``(size, 1)``, or values that are not finite, with their indices. With
    ``later``, float32 actions may be not finite, because the program looks at them.
    """
    if type(actions) is np.ndarray and actions.dtype == SINGLE and actions.shape == (size, 1):
        shares: NDArray[Any] = actions.ravel()
        if later or 0 not in np.isfinite(shares).tobytes():  # quicker than all() for small arrays
            return shares
    return np.ascontiguousarray(_checked(actions, (size, 1), f"Actions of {size} environments").reshape(size))


def _checked(actions: Any, shape: tuple[int, ...], whose: str) -> NDArray[Any]:
    """Return actions as an array of finite numbers, float32 unchanged, others as float64.

    Raises ActionError, which begins with ``whose``, for other values.
    """
    wanted = f"{whose} must have the shape {shape}"
    try:
        array = np.asarray(actions)
    except ValueError:
        raise ActionError(f"{wanted}, not rows of different lengths.") from None
    if array.shape != shape:
        raise ActionError(f"{wanted}, not {array.shape}.")
    if array.dtype.kind not in "fiu":
        raise ActionError(f"{whose} must have real numbers, not entries of the type {array.dtype}.")
    array = array if array.dtype == SINGLE else array.astype(np.float64)
    if (bad := np.flatnonzero(~np.isfinite(array))).size:
        places = ", ".join(str(place) for place in bad[:5]) + (", ..." if bad.size > 5 else "")
        those = f"; those of the environments {places} are not" if len(shape) > 1 else f", not {array[0]}"
        raise ActionError(f"{whose} must have finite numbers{those}; numbers beyond -1 and 1 are clipped.")
    return array
