"""Nyström trees and the order conditions of Nyström methods (Hairer, Norsett & Wanner 1993, section II.14).

Every vertex of a tree is a force, written as the tuple of what it depends on through one derivative each:
``("q", None)`` the position, as it moves at the velocity; ``("q", tree)`` the position, as that force moves it;
``("v", tree)`` the velocity, as that force changes it. Without the last kind they are the special trees, which are all
there are for forces free of the velocity. With

::

    Phi_i(tree) = prod over the root's dependences of   c_i,   sum_j a_ij Phi_j(sub),   sum_j av_ij Phi_j(sub)

a method has order p where ``b . Phi = 1/gamma`` for every tree of order at most p, and ``(n + 1) bbar . Phi = 1/gamma``
for every tree of order n below p. Time is a position that moves at the velocity 1.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from math import lcm, prod
from typing import Any

from integrators.families.nystrom import EmbeddedNystrom
from integrators.method import Method, MethodError, Row
from integrators.registry import named

Tree = tuple[Any, ...]
Child = tuple[str, Any]


@dataclass(frozen=True)
class NystromCondition:
    """One order condition of one method.

    Attributes:
        of: "q", "v", or "sum" for a quadrature that rides along.
        tree: the Nyström tree.
        order: the power of h in the result that it settles.
        defect: left side minus right side, exact.
    """

    of: str
    tree: Tree
    order: int
    defect: Fraction


@lru_cache(maxsize=64)
def nystrom_trees(order: int, special: bool = False) -> tuple[Tree, ...]:
    """All trees of this order: 1, 2, 6, 18, 60, 204, ...; special ones: 1, 1, 2, 3, 6, 10, 20, 36, 72, 137, ..."""
    return () if order < 1 else tuple(_forests(order - 1, order - 1, special, 0))


@lru_cache(maxsize=64)
def _children(order: int, special: bool) -> tuple[Child, ...]:
    """What a force can depend on, of this order in h."""
    alone: tuple[Child, ...] = (("q", None),) if order == 1 else ()
    through = tuple(("q", tree) for tree in nystrom_trees(order - 1, special))
    return (*alone, *through, *(() if special else (("v", tree) for tree in nystrom_trees(order, special))))


def _forests(order: int, largest: int, special: bool, first: int) -> Iterable[Tree]:
    """Multisets of dependences of this order together, none above ``largest``, nor before ``first`` among those."""
    if order == 0:
        yield ()
        return
    for size in range(min(order, largest), 0, -1):
        children = _children(size, special)
        for index in range(first if size == largest else 0, len(children)):
            for rest in _forests(order - size, size, special, index):
                yield (children[index], *rest)


@lru_cache(maxsize=4096)
def order_of(tree: Tree) -> int:
    """The power of h that a force brings into the velocity."""
    return 1 + sum(_order_of_child(child) for child in tree)


def _order_of_child(child: Child) -> int:
    kind, sub = child
    return (kind == "q") + (order_of(sub) if sub is not None else 0)


@lru_cache(maxsize=4096)
def density(tree: Tree) -> int:
    """``gamma``: the order times the densities of all that the force depends on."""
    below = (_order_of_child((kind, sub)) * density(sub) if kind == "q" else density(sub)
             for kind, sub in tree if sub is not None)
    return order_of(tree) * prod(below)


def quadrature_trees(order: int) -> Iterable[Tree]:
    """Trees of this order of a rate linear in the velocity, in a problem whose forces are free of it."""
    for size in range(1, order):
        for tree in nystrom_trees(size, True):
            for others in _forests(order - 1 - size, order - 1 - size, True, 0):
                yield (*others, ("v", tree))


def nystrom_conditions(
    method: str | Method, order: int | None = None, *, embedded: EmbeddedNystrom | None = None
) -> tuple[NystromCondition, ...]:
    """The conditions on a Nyström method for all trees up to an order, in exact arithmetic.

    Those of q, of v, and, where the forces do not use V_i, of quadratures with rates linear in v; elsewhere a
    quadrature has the conditions of v.

    Args:
        method: name or Method.
        order: the highest order; None: the method's declared order.
        embedded: weights to be tested instead of the method's own; quadratures are left out then.

    Raises MethodError for an unknown name, or a method that is not a Nyström table.
    """
    chosen = named(method)
    if chosen.nystrom_tableau is None:
        raise MethodError(f"{chosen.name}: Nyström trees are for Nyström tables, not {chosen.family} methods.")
    highest = (chosen.order if order is None else order) if embedded is None else (order or embedded.order)
    c, a, bbar, b, av = chosen.nystrom_tableau
    weights = (bbar, b) if embedded is None else (embedded.bbar, embedded.b)
    special, values = "velocity_free" in chosen.needs, _Values(c, a, av, weights)
    found = []
    for size in range(1, highest + 1):
        for tree in nystrom_trees(size, special):
            if size < highest:
                found.append(NystromCondition("q", tree, size + 1, values.defect(0, tree, size + 1)))
            if weights[1] is not None:
                found.append(NystromCondition("v", tree, size, values.defect(1, tree, 1)))
        if special and embedded is None:
            sums = quadrature_trees(size)
            found += [NystromCondition("sum", tree, size, values.defect(1, tree, 1)) for tree in sums]
    return tuple(found)


class _Values:
    """``Phi`` of one method, in whole numbers, which need no common divisors."""

    def __init__(self, c: Row, a: Sequence[Row], av: Sequence[Row], weights: Sequence[Row | None]) -> None:
        rows = [*a, *av, c, *(row for row in weights if row is not None)]
        self.scale = lcm(*(x.denominator for row in rows for x in row))
        self.c = self.whole(c)
        self.tables = {"q": [self.whole(row) for row in a], "v": [self.whole(row) for row in av]}
        self.weights = [None if row is None else self.whole(row) for row in weights]
        self.known: dict[Child, list[int]] = {("q", None): self.c}

    def whole(self, row: Sequence[Fraction]) -> list[int]:
        return [int(x * self.scale) for x in row]

    def factors(self, tree: Tree) -> int:
        """How many coefficients stand in each product of ``Phi``."""
        return sum(1 + (self.factors(sub) if sub is not None else 0) for _, sub in tree)

    def below(self, child: Child) -> list[int]:
        if child not in self.known:
            inner = self.phi(child[1])
            self.known[child] = [
                sum(x * y for x, y in zip(row, inner, strict=True) if x) for row in self.tables[child[0]]
            ]
        return self.known[child]

    def phi(self, tree: Tree) -> list[int]:
        """Times ``scale`` to the power of :meth:`factors`."""
        children = [self.below(child) for child in tree]
        return [prod(child[i] for child in children) for i in range(len(self.c))]

    def defect(self, which: int, tree: Tree, share: int) -> Fraction:
        """Weights times ``Phi``, minus what it should be."""
        line = self.weights[which] or []
        total = sum(x * y for x, y in zip(line, self.phi(tree), strict=True) if x)
        return Fraction(total, self.scale ** (1 + self.factors(tree))) - Fraction(1, share * density(tree))
