"""System: a problem ``q'' = a(t, q, v)`` and the functions that it offers to methods."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from integrators.errors import MethodError, shown

Acceleration = Callable[[Any, Any, Any], Any]


@dataclass(frozen=True)
class System:
    """Problem ``q'' = a(t, q, v)`` with the functions that methods may need; only ``acceleration`` is required.

    Raises MethodError for a function that is not callable, and for a switch that is neither True nor False.

    Attributes:
        acceleration: ``a(t, q, v)``, the complete acceleration.
        force: ``f(t, q)``, the part that does not depend on the velocity. None: ``a`` itself if
            ``velocity_free``, else ``a(t, q, 0)``, which is right if all dissipation vanishes at rest.
        velocity_free: True if ``a`` ignores ``v``.
        dissipative_flow: ``v1 = D(t, q, v, h)``, the exact solution of ``v' = a(t, q, v) - f(t, q)`` at
            frozen ``(t, q)``. Splitting methods apply it instead of putting drag into their kicks. Splittings of
            orders above 2 also call it with negative h; it returns nan if no earlier velocity leads to v.
        one_way: True if ``dissipative_flow`` cannot run backwards at all, for example because friction sticks.
        jacobian: ``(da/dq, da/dv)`` at ``(t, q, v)``, for Newton's method in implicit methods.
        mean_acceleration: ``a(t, q, v)`` with its conservative part averaged over the angles from ``q - s`` to
            ``q + s``, as a function of ``(t, q, v, s)``. The average is minus the difference of the potential over
            2 s, computed without cancellation.
        mean_jacobian: derivatives of ``mean_acceleration``: the one by q plus the one by s, and the one by v.
        taylor_coefficients: ``[q_0, ..., q_n] = C(t, q, v, n)`` of the motion ``q(t + h) = sum_k q_k h**k``;
            :func:`integrators.families.taylor.coefficients` makes this function from a plain acceleration.
        exact_flow: ``q1, v1 = E(t, q, v, h)``, the exact solution after the time h, in closed form.
    """

    acceleration: Acceleration
    force: Callable[[Any, Any], Any] | None = None
    velocity_free: bool = False
    dissipative_flow: Callable[[Any, Any, Any, Any], Any] | None = None
    one_way: bool = False
    jacobian: Callable[[Any, Any, Any], tuple[Any, Any]] | None = None
    mean_acceleration: Callable[[Any, Any, Any, Any], Any] | None = None
    mean_jacobian: Callable[[Any, Any, Any, Any], tuple[Any, Any]] | None = None
    exact_flow: Callable[[Any, Any, Any, Any], tuple[Any, Any]] | None = None
    taylor_coefficients: Callable[[Any, Any, Any, int], Sequence[Any]] | None = None

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if name in ("velocity_free", "one_way"):
                valid, allowed = isinstance(value, (bool, np.bool_)), "True or False"
            else:
                valid, allowed = callable(value) or (value is None and name != "acceleration"), "a function"
            if not valid:
                raise MethodError(f"{name} must be {allowed}, not {shown(value)}.")

    def offers(self) -> frozenset[str]:
        """Return the needs of methods that this system meets, as keys of :data:`NEEDS`."""
        offered = {"acceleration"}
        if self.velocity_free or self.dissipative_flow is not None:
            offered.add("split")
        if self.velocity_free:
            offered.add("velocity_free")
        if self.velocity_free or not self.one_way:
            offered.add("reversible")
        if not self.one_way:
            offered.add("smooth")
        if self.jacobian is not None:
            offered.add("jacobian")
        if self.mean_acceleration is not None and self.mean_jacobian is not None:
            offered.add("mean")
        if self.exact_flow is not None:
            offered.add("exact_flow")
        if self.taylor_coefficients is not None:
            offered.add("taylor")
        return frozenset(offered)


NEEDS: dict[str, str] = {
    "acceleration": "an acceleration a(t, q, v)",
    "split": "forces free of the velocity, or the exact flow of the dissipation (dissipative_flow)",
    "velocity_free": "forces free of the velocity",
    "reversible": "dissipation, if any, that can also run backwards (some sub-steps of the method are negative)",
    "smooth": "forces without dry friction, whose stops would interrupt the history of earlier steps",
    "jacobian": "the derivatives of the acceleration (jacobian)",
    "taylor": "the Taylor coefficients of the motion (taylor_coefficients)",
    "exact_flow": "the motion itself in closed form (exact_flow)",
    "mean": "the mean of the conservative forces between two angles (mean_acceleration, mean_jacobian)",
}
"""Need of a method -> description of it for messages and tables."""
