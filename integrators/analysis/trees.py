"""Rooted trees and the order conditions of Runge-Kutta methods and their dense output (Butcher 2016, chapter 3).

A tree is the tuple of the trees that hang from its root: ``()`` is the single vertex, ``((), ())`` the root with two
leaves. A method has order p where ``b . Phi(t) = 1/gamma(t)`` for every tree of at most p vertices.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from itertools import groupby
from math import comb, factorial, lcm, prod, sqrt
from typing import Any

from integrators.method import Method, MethodError
from integrators.registry import named

Tree = tuple[Any, ...]


@dataclass(frozen=True)
class Condition:
    """One order condition of one method: the tree, its number of vertices, and ``b . Phi(t) - 1/gamma(t)``, exact."""

    tree: Tree
    order: int
    defect: Fraction


@lru_cache(maxsize=32)
def rooted_trees(order: int) -> tuple[Tree, ...]:
    """All rooted trees with this many vertices: 1, 1, 2, 4, 9, 20, 48, 115, 286, 719, ..."""
    return () if order < 1 else tuple(_forests(order - 1, order - 1))


def _forests(vertices: int, largest: int) -> Iterable[Tree]:
    """Multisets of trees with this many vertices together, none larger than ``largest``; larger ones first."""
    if vertices == 0:
        yield ()
        return
    for size in range(min(vertices, largest), 0, -1):
        trees = rooted_trees(size)
        for index, tree in enumerate(trees):
            for rest in _forests(vertices - size, size):
                if not rest or vertices_of(rest[0]) < size or trees.index(rest[0]) >= index:
                    yield (tree, *rest)


@lru_cache(maxsize=4096)
def vertices_of(tree: Tree) -> int:
    """How many vertices a tree has: the order of its condition."""
    return 1 + sum(vertices_of(child) for child in tree)


@lru_cache(maxsize=4096)
def density(tree: Tree) -> int:
    """``gamma(t)``: vertices times the densities of what hangs from the root."""
    return vertices_of(tree) * prod(density(child) for child in tree)


@lru_cache(maxsize=4096)
def symmetry(tree: Tree) -> int:
    """``sigma(t)``: the number of ways to map a tree to itself."""
    groups = (len(list(same)) for _, same in groupby(sorted(tree)))
    return prod(symmetry(child) for child in tree) * prod(factorial(size) for size in groups)


def order_conditions(
    method: str | Method, order: int | None = None, *, weights: Sequence[Fraction] | None = None
) -> tuple[Condition, ...]:
    """The conditions for all trees of at most ``order`` vertices on a Runge-Kutta method, in exact arithmetic.

    Args:
        method: name or Method.
        order: the largest trees; None: the method's declared order.
        weights: instead of the method's ``b``, for instance an embedded row.

    Raises MethodError for an unknown name, or a method that is not a Runge-Kutta table.
    """
    chosen = named(method)
    if chosen.tableau is None:
        raise MethodError(f"{chosen.name}: rooted trees are for Runge-Kutta tables, not {chosen.family} methods.")
    a, own = chosen.tableau
    b = own if weights is None else tuple(weights)
    scale = lcm(*(x.denominator for row in (*a, b) for x in row))
    end = [int(x * scale) for x in b]
    found = []
    for tree, size, phi in elementary_weights(a, scale, chosen.order if order is None else order):
        total = Fraction(sum(x * y for x, y in zip(end, phi, strict=True)), scale**size)
        found.append(Condition(tree, size, total - Fraction(1, density(tree))))
    return tuple(found)


def elementary_weights(
    a: Sequence[Sequence[Fraction]], scale: int, order: int
) -> Iterable[tuple[Tree, int, list[int]]]:
    """Each tree of at most ``order`` vertices, their number n, and ``Phi_i(t) scale**(n - 1)`` of the stages i.

    ``scale`` is a common denominator of the table ``a``, whose rows may end at the diagonal.
    """
    table = [[int(x * scale) for x in row] for row in a]
    stages = range(len(a))
    slopes: dict[Tree, list[int]] = {}

    def below(tree: Tree) -> list[int]:
        """``A Phi(t)`` times ``scale**vertices``: in whole numbers, which need no common divisors."""
        if tree not in slopes:
            inner = weight(tree)
            slopes[tree] = [sum(x * y for x, y in zip(row, inner, strict=False) if x) for row in table]
        return slopes[tree]

    def weight(tree: Tree) -> list[int]:
        children = [below(child) for child in tree]
        return [prod(child[i] for child in children) for i in stages]

    for size in range(1, order + 1):
        for tree in rooted_trees(size):
            yield tree, size, weight(tree)


def principal_error(
    method: str | Method, order: int | None = None, *, weights: Sequence[Fraction] | None = None
) -> float:
    """The size of the leading error term: ``sqrt(sum (d/sigma(t))**2)`` over trees of one order.

    ``d = b . Phi(t) - 1/gamma(t)``, and sigma the tree's :func:`symmetry`.
    It is the norm by which Dormand & Prince 1980 compare methods.

    Args:
        method: name or Method.
        order: vertices of the trees; None: one more than the declared order.
        weights: instead of the method's ``b``.

    Raises MethodError like :func:`order_conditions`.
    """
    chosen = named(method)
    size = chosen.order + 1 if order is None else order
    terms = (c for c in order_conditions(chosen, size, weights=weights) if c.order == size)
    return sqrt(sum((c.defect / symmetry(c.tree)) ** 2 for c in terms))


def dense_conditions(method: str | Method, order: int | None = None) -> tuple[Condition, ...]:
    """The conditions for all trees of at most ``order`` vertices on a table's dense output, in exact arithmetic.

    ``sum_i b_i(theta) Phi_i(t) = theta**n/gamma(t)`` for trees of n vertices (Hairer, Norsett & Wanner 1993,
    section II.6). The defect is the largest difference of the two polynomials' coefficients in Bernstein's form.

    Args:
        method: name or Method.
        order: the largest trees; None: the declared order of the dense output.

    Raises MethodError for an unknown name, or a method whose dense output does not come from a table.
    """
    chosen = named(method)
    extension = chosen.dense
    if extension is None or chosen.tableau is None:
        raise MethodError(f"{chosen.name}: dense output is Hermite interpolation, which has no conditions on trees.")
    largest = extension.order if order is None else order
    degree = max(largest, len(extension.b[0]))
    polynomials = [_elevated(row, degree) for row in extension.b]
    table = (*chosen.tableau[0], *extension.a)
    scale = lcm(*(x.denominator for row in (*table, *polynomials) for x in row))
    columns = [[int(x * scale) for x in column] for column in zip(*polynomials, strict=True)]
    found = []
    for tree, size, phi in elementary_weights(table, scale, largest):
        whole = comb(degree, size) * density(tree)
        defects = (
            Fraction(sum(x * y for x, y in zip(column, phi, strict=True)), scale**size) - Fraction(comb(j, size), whole)
            for j, column in enumerate(columns, 1)
        )
        found.append(Condition(tree, size, max(abs(defect) for defect in defects)))
    return tuple(found)


def _elevated(row: Sequence[Fraction], degree: int) -> tuple[Fraction, ...]:
    """The same polynomial in Bernstein's form of a higher degree (Farin 2002, section 6.1)."""
    while len(row) < degree:
        n, points = len(row) + 1, (Fraction(0), *row, Fraction(0))
        row = [Fraction(j, n) * points[j - 1] + Fraction(n - j, n) * points[j] for j in range(1, n + 1)]
    return tuple(row)
