"""Numerical methods for ``q'' = a(t, q, v)``: tables that check themselves, and one way to run them all.

>>> import integrators
>>> integrators.get("rk4").order
4
>>> sol = integrators.solve(lambda t, q, v: -q, 1.0, 0.0, [0.0, 1.0], method="rk4", h=0.01)
>>> round(float(sol.q[-1]), 6)
0.540302
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from types import MappingProxyType

from integrators.errors import LONGEST, shown
from integrators.families.adams import ADAMS
from integrators.families.backward_differences import BACKWARD
from integrators.families.energy_preserving import ENERGY_PRESERVING, DiscreteGradient
from integrators.families.exact_flow import EXACT, Exact
from integrators.families.force_gradient import FORCE_GRADIENT, ForceGradient
from integrators.families.multistep import Multistep
from integrators.families.nystrom import EmbeddedNystrom, Nystrom
from integrators.families.second_order import STOERMER, SYMMETRIC
from integrators.families.structural import STRUCTURAL
from integrators.families.taylor import TAYLOR, Taylor, named_order
from integrators.method import Embedded, Extension, Method, MethodError, RungeKutta, Splitting, System
from integrators.moved import MOVED, keep_old_paths
from integrators.solving.adaptive import StepSizeError
from integrators.solving.solve import Solution, solve
from integrators.steps.estimates import has_estimates
from integrators.steps.unroll import unroll
from integrators.tables.collocation import COLLOCATION
from integrators.tables.compositions import COMPOSITIONS
from integrators.tables.general_splittings import GENERAL
from integrators.tables.implicit import IMPLICIT
from integrators.tables.nystrom import NYSTROM
from integrators.tables.nystrom_high import NYSTROM_HIGH
from integrators.tables.nystrom_splittings import NYSTROM_SPLITTINGS
from integrators.tables.runge_kutta import EXPLICIT
from integrators.tables.runge_kutta_embedded import EMBEDDED
from integrators.tables.splitting import SPLITTING
from integrators.tables.verner import VERNER
from integrators.tables.verner_high import VERNER_HIGH

keep_old_paths(MOVED)

COMPOSED = (*GENERAL, *COMPOSITIONS, *NYSTROM_SPLITTINGS)
_ALL: tuple[Method, ...] = (
    *EXPLICIT[:1], *IMPLICIT[:1], *SPLITTING, *EXPLICIT[1:], *EMBEDDED, *VERNER, *VERNER_HIGH, *IMPLICIT[1:],
    *COLLOCATION, *ENERGY_PRESERVING, *COMPOSED, *FORCE_GRADIENT, *NYSTROM, *NYSTROM_HIGH, *ADAMS, *BACKWARD,
    *STOERMER, *SYMMETRIC, *STRUCTURAL, *EXACT, *TAYLOR,
)

PAIRS = tuple(method for method in _ALL if has_estimates(method) and not isinstance(method, Taylor))
"""Embedded pairs: they estimate their errors, so that a tolerance can choose their steps, as of Taylor series."""

METHODS: Mapping[str, Method] = MappingProxyType({method.name: method for method in _ALL})
"""Every method by name, simple ones first; other names of the same method are in :data:`ALIASES`."""

ALIASES: Mapping[str, str] = MappingProxyType({alias: m.name for m in _ALL for alias in m.aliases})
"""Other names -> the name in :data:`METHODS`."""


def get(name: str) -> Method:
    """The method of this name or alias; ``taylor2`` to ``taylor30`` are Taylor series of these orders.

    Raises MethodError for an unknown name, with the nearest ones.
    """
    found = METHODS.get(ALIASES.get(name, name)) if isinstance(name, str) else None
    if found is None and isinstance(name, str):
        found = named_order(name)
    if found is None:
        words = [*METHODS, *ALIASES] if isinstance(name, str) else []
        near = difflib.get_close_matches(name[:LONGEST] if words else "", words, n=3, cutoff=0.5)
        hint = f"; did you mean {' or '.join(near)}?" if near else f"; there are {', '.join(METHODS)}."
        raise MethodError(f"There is no integrator {shown(name)}{hint}")
    return found


def fitting(system: System) -> dict[str, Method]:
    """The methods whose needs a system meets, by name; MethodError for what is no System."""
    if not isinstance(system, System):
        raise MethodError(f"system must be an integrators.System, not {shown(system)}.")
    offered = system.offers()
    return {name: method for name, method in METHODS.items() if method.needs <= offered}


__all__ = [
    "ALIASES",
    "METHODS",
    "DiscreteGradient",
    "Embedded",
    "EmbeddedNystrom",
    "Exact",
    "Extension",
    "ForceGradient",
    "Method",
    "MethodError",
    "Multistep",
    "Nystrom",
    "RungeKutta",
    "Solution",
    "Splitting",
    "StepSizeError",
    "System",
    "Taylor",
    "fitting",
    "get",
    "solve",
    "unroll",
]
