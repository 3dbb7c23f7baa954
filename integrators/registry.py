"""Registry of all methods in one fixed order, with lookup by name and by what a system offers."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from types import MappingProxyType

from integrators.errors import LONGEST, shown
from integrators.families.adams import ADAMS
from integrators.families.backward_differences import BACKWARD
from integrators.families.energy_preserving import ENERGY_PRESERVING
from integrators.families.exact_flow import EXACT
from integrators.families.force_gradient import FORCE_GRADIENT
from integrators.families.second_order import STOERMER, SYMMETRIC
from integrators.families.structural import STRUCTURAL
from integrators.families.taylor import TAYLOR, named_order
from integrators.method import Method, MethodError, System
from integrators.tables.compositions import COMPOSITIONS
from integrators.tables.implicit import COLLOCATION, IMPLICIT
from integrators.tables.nystrom import NYSTROM
from integrators.tables.runge_kutta import EMBEDDED, EXPLICIT
from integrators.tables.splittings import GENERAL, NYSTROM_SPLITTINGS, SPLITTING
from integrators.tables.verner import VERNER

FIRST = ("forward_euler", "backward_euler")
"""Names of the methods that come first in lists; all others follow, table by table."""
_TABLES: tuple[Method, ...] = (
    *SPLITTING, *EXPLICIT, *EMBEDDED, *VERNER, *IMPLICIT, *COLLOCATION, *ENERGY_PRESERVING, *GENERAL, *COMPOSITIONS,
    *NYSTROM_SPLITTINGS, *FORCE_GRADIENT, *NYSTROM, *ADAMS, *BACKWARD, *STOERMER, *SYMMETRIC, *STRUCTURAL, *EXACT,
)
_ALL: tuple[Method, ...] = (*sorted(_TABLES, key=lambda method: method.name not in FIRST), *TAYLOR)

PAIRS = tuple(method for method in _TABLES if method.embedded_orders)
"""Embedded pairs, which estimate their errors, so that a tolerance can choose their steps."""

METHODS: Mapping[str, Method] = MappingProxyType({method.name: method for method in _ALL})
"""Every method by name, simple ones first; :data:`ALIASES` has their other names."""

ALIASES: Mapping[str, str] = MappingProxyType({alias: m.name for m in _ALL for alias in m.aliases})
"""Alias of a method -> its name in :data:`METHODS`."""


def get(name: str) -> Method:
    """Return the method with this name or alias; ``taylor2`` to ``taylor30`` are Taylor series of these orders.

    Raises MethodError for an unknown name, with the nearest known names.
    """
    method = METHODS.get(ALIASES.get(name, name)) if isinstance(name, str) else None
    if method is None and isinstance(name, str):
        method = named_order(name)
    if method is None:
        text, words = name[:LONGEST].lower() if isinstance(name, str) else "", [*METHODS, *ALIASES]
        near = " or ".join(difflib.get_close_matches(text, words, n=3, cutoff=0.5))
        some = ", ".join([*METHODS][:3])
        hint = f"did you mean {near}?" if near else f"there are {len(METHODS)}, such as {some}, in integrators.METHODS."
        raise MethodError(f"There is no integrator {shown(name)}; {hint}")
    return method


def named(method: str | Method) -> Method:
    """Return the method with this name, or a Method unchanged; raises MethodError for an unknown name."""
    return method if isinstance(method, Method) else get(method)


def fitting(system: System) -> dict[str, Method]:
    """Return all methods whose needs a system meets, as a mapping by name; MethodError if it is not a System."""
    if not isinstance(system, System):
        raise MethodError(f"system must be an integrators.System, not {shown(system)}.")
    offered = system.offers()
    return {name: method for name, method in METHODS.items() if method.needs <= offered}
