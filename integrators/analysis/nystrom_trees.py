"""Nyström trees and the order conditions of Nyström methods (Hairer, Norsett & Wanner 1993, section II.14).

Every vertex of a tree is a force, written as the tuple of its derivatives: ``("q", None)`` is a derivative by the
position, moved by the velocity; ``("q", tree)`` by the position, moved by the force that ``tree`` describes;
``("v", tree)`` by the velocity, changed by the force that ``tree`` describes. Special trees contain no ``"v"``; they
suffice for velocity-free forces. With

::

    Phi_i(tree) = prod over the root's dependences of   c_i,   sum_j a_ij Phi_j(sub),   sum_j av_ij Phi_j(sub)

a method has order p where ``b . Phi = 1/gamma`` for every tree of order at most p, and ``(n + 1) bbar . Phi = 1/gamma``
for every tree of order n below p. Time counts as a position with the velocity 1.
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
    """One order condition of a Nyström method, with the exact amount by which the method misses it.

    Attributes:
        of: the result that the condition is about: "q", "v", or "sum" for a quadrature (an integral such as work).
        tree: the Nyström tree.
        order: the power of h in that result.
        defect: left side minus right side, exact.
    """

    of: str
    tree: Tree
    order: int
    defect: Fraction


@lru_cache(maxsize=64)
def nystrom_trees(order: int, special: bool = False) -> tuple[Tree, ...]:
    """Return all Nyström trees of an order.

    With ``special``, trees are left out that occur only for velocity-dependent forces. There are 1, 2, 6, 18, 60, 204,
    ... trees, and 1, 1, 2, 3, 6, 10, 20, 36, 72, 137, ... special ones.
    """
    return () if order < 1 else tuple(_forests(order - 1, order - 1, special, 0))


@lru_cache(maxsize=64)
def _children(order: int, special: bool) -> tuple[Child, ...]:
    """Return all branches of order ``order`` in h that can hang from a vertex of a Nyström tree."""
    alone: tuple[Child, ...] = (("q", None),) if order == 1 else ()
    through = tuple(("q", tree) for tree in nystrom_trees(order - 1, special))
    return (*alone, *through, *(() if special else (("v", tree) for tree in nystrom_trees(order, special))))


def _forests(order: int, largest: int, special: bool, first: int) -> Iterable[Tree]:
    """Yield all multisets of branches with this total order, as Nyström trees with these branches at the root.

    No branch exceeds the order ``largest``; branches of that order come from index ``first`` on, to avoid duplicates.
    """
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
    """Return the order of a Nyström tree: the power of h with which its force enters the velocity."""
    return 1 + sum(_order_of_child(child) for child in tree)


def _order_of_child(child: Child) -> int:
    """Return the order in h of one branch of a Nyström tree."""
    kind, sub = child
    return (kind == "q") + (order_of(sub) if sub is not None else 0)


@lru_cache(maxsize=4096)
def density(tree: Tree) -> int:
    """Return the density ``gamma`` of a Nyström tree: its order times the densities of its branches."""
    below = (_order_of_child((kind, sub)) * density(sub) if kind == "q" else density(sub)
             for kind, sub in tree if sub is not None)
    return order_of(tree) * prod(below)


def quadrature_trees(order: int) -> Iterable[Tree]:
    """Yield the Nyström trees of order conditions on an integral of a rate that is linear in v, such as work.

    The trees have the given order and no further velocity-dependent force.
    """
    for size in range(1, order):
        for tree in nystrom_trees(size, True):
            for others in _forests(order - 1 - size, order - 1 - size, True, 0):
                yield (*others, ("v", tree))


def nystrom_conditions(
    method: str | Method, order: int | None = None, *, embedded: EmbeddedNystrom | None = None
) -> tuple[NystromCondition, ...]:
    """Return the order conditions of a Nyström method for all trees up to an order, in exact arithmetic.

    They are conditions on q and v and, for methods for velocity-free forces, on quadratures (integrals along a step,
    such as work) whose rates are linear in v. For other methods, quadratures have the conditions of v.

    Args:
        method: name or Method.
        order: the highest order; None: the method's declared order.
        embedded: weights to test instead of the method's own; quadratures are left out then.

    Raises MethodError for an unknown name, or a method that is not a Nyström table.
    """
    chosen = named(method)
    if chosen.nystrom_tableau is None:
        raise MethodError(
            f"{chosen.name}: Nyström order conditions exist only for Nyström tables, not for {chosen.family} methods.")
    highest = (chosen.order if order is None else order) if embedded is None else (order or embedded.order)
    c, a, bbar, b, av = chosen.nystrom_tableau
    weights = (bbar, b) if embedded is None else (embedded.bbar, embedded.b)
    special, values = "velocity_free" in chosen.needs, _Values(c, a, av, weights)
    conditions = []
    for size in range(1, highest + 1):
        for tree in nystrom_trees(size, special):
            if size < highest:
                conditions.append(NystromCondition("q", tree, size + 1, values.defect(0, tree, size + 1)))
            if weights[1] is not None:
                conditions.append(NystromCondition("v", tree, size, values.defect(1, tree, 1)))
        if special and embedded is None:
            sums = quadrature_trees(size)
            conditions += [NystromCondition("sum", tree, size, values.defect(1, tree, 1)) for tree in sums]
    return tuple(conditions)


class _Values:
    """Elementary weights ``Phi`` of a Nyström method, scaled to whole numbers, which are faster than fractions."""

    def __init__(self, c: Row, a: Sequence[Row], av: Sequence[Row], weights: Sequence[Row | None]) -> None:
        rows = [*a, *av, c, *(row for row in weights if row is not None)]
        self.scale = lcm(*(x.denominator for row in rows for x in row))
        self.c = self.whole(c)
        self.tables = {"q": [self.whole(row) for row in a], "v": [self.whole(row) for row in av]}
        self.weights = [None if row is None else self.whole(row) for row in weights]
        self.known: dict[Child, list[int]] = {("q", None): self.c}

    def whole(self, row: Sequence[Fraction]) -> list[int]:
        """Return coefficients of a Nyström table times the common denominator of the table, as integers."""
        return [int(x * self.scale) for x in row]

    def factors(self, tree: Tree) -> int:
        """Return the number of table coefficients in each product of ``Phi(tree)``.

        ``Phi`` in whole numbers is larger than ``Phi`` by the common denominator to this power.
        """
        return sum(1 + (self.factors(sub) if sub is not None else 0) for _, sub in tree)

    def below(self, child: Child) -> list[int]:
        """Return the factor that one branch contributes to ``Phi`` of a tree at each stage, as a whole number."""
        if child not in self.known:
            inner = self.phi(child[1])
            self.known[child] = [
                sum(x * y for x, y in zip(row, inner, strict=True) if x) for row in self.tables[child[0]]
            ]
        return self.known[child]

    def phi(self, tree: Tree) -> list[int]:
        """Return the elementary weight ``Phi`` of a tree at each stage, times ``scale**factors(tree)``."""
        children = [self.below(child) for child in tree]
        return [prod(child[i] for child in children) for i in range(len(self.c))]

    def defect(self, which: int, tree: Tree, share: int) -> Fraction:
        """Return the residual of a tree's order condition: weights times ``Phi``, minus its exact value.

        ``which`` selects the weights: 0 for those of q, 1 for those of v. The exact value is ``1/(share
        density(tree))``.
        """
        line = self.weights[which] or []
        total = sum(x * y for x, y in zip(line, self.phi(tree), strict=True) if x)
        return Fraction(total, self.scale ** (1 + self.factors(tree))) - Fraction(1, share * density(tree))
