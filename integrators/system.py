"""What a problem may offer a method."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from integrators.errors import MethodError, shown

Acceleration = Callable[[Any, Any, Any], Any]


@dataclass(frozen=True)
class System:
    """What a problem ``q'' = a(t, q, v)`` offers to a method; only ``acceleration`` is always there.

    Raises MethodError for what is no function, and switches that are neither True nor False.

    Attributes:
        acceleration: ``a(t, q, v)``, everything that acts.
        force: ``f(t, q)``, the part that does not depend on the velocity. None: ``a`` itself where
            ``velocity_free``, else ``a(t, q, 0)``, which is right where all dissipation vanishes at rest.
        velocity_free: True if ``a`` ignores ``v``.
        dissipative_flow: ``v1 = D(t, q, v, h)``, the exact solution of ``v' = a(t, q, v) - f(t, q)`` at
            frozen ``(t, q)``: what a splitting method applies instead of putting drag into its kicks. Splittings of
            orders above 2 ask for negative h, too; nan says that there is no such past.
        one_way: True if that flow cannot run backwards at all, as where friction sticks.
        jacobian: ``(da/dq, da/dv)`` at ``(t, q, v)``, for Newton's method in implicit methods.
        mean_acceleration: ``a(t, q, v)`` with its conservative part averaged over the angles from ``q - s`` to
            ``q + s``, a function of ``(t, q, v, s)``: minus the potential's difference over 2 s, without cancelling.
        mean_jacobian: its derivatives: that by q plus that by s, and that by v.
        taylor_coefficients: ``[q_0, ..., q_n] = C(t, q, v, n)``, of the motion ``q(t + h) = sum_k q_k h**k``;
            :func:`integrators.families.taylor.coefficients` makes it from a plain function.
        exact_flow: ``q1, v1 = E(t, q, v, h)``, the solution itself after the time h, in closed form.
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
                sound, what = isinstance(value, (bool, np.bool_)), "True or False"
            else:
                sound, what = callable(value) or (value is None and name != "acceleration"), "a function"
            if not sound:
                raise MethodError(f"{name} must be {what}, not {shown(value)}.")

    def offers(self) -> frozenset[str]:
        """Names of what this system has, in the words that methods use for what they need."""
        found = {"acceleration"}
        if self.velocity_free or self.dissipative_flow is not None:
            found.add("split")
        if self.velocity_free:
            found.add("velocity_free")
        if self.velocity_free or not self.one_way:
            found.add("reversible")
        if not self.one_way:
            found.add("smooth")
        if self.jacobian is not None:
            found.add("jacobian")
        if self.mean_acceleration is not None and self.mean_jacobian is not None:
            found.add("mean")
        if self.exact_flow is not None:
            found.add("exact_flow")
        if self.taylor_coefficients is not None:
            found.add("taylor")
        return frozenset(found)


NEEDS: dict[str, str] = {
    "acceleration": "an acceleration a(t, q, v)",
    "split": "forces free of the velocity, or the exact flow of the dissipation (dissipative_flow)",
    "velocity_free": "forces free of the velocity",
    "reversible": "dissipation, if any, that can also be run backwards (its sub-steps are not all positive)",
    "smooth": "forces without the stops of dry friction, at which a memory of earlier steps would end",
    "jacobian": "the derivatives of the acceleration (jacobian)",
    "taylor": "the Taylor coefficients of the motion (taylor_coefficients)",
    "exact_flow": "the motion itself in closed form (exact_flow)",
    "mean": "the mean of the conservative forces between two angles (mean_acceleration, mean_jacobian)",
}
"""What a method can ask of a system, in words for messages and tables."""
