"""Rooted trees and the order conditions of Runge-Kutta methods and their dense output (Butcher 2016, chapter 3).

A tree is the tuple of the branches at its root: ``()`` is a single vertex, ``((), ())`` a root with two leaves. A
method has order p if ``b . Phi(t) = 1/gamma(t)`` for every tree of at most p vertices.
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
    """Order condition of a Runge-Kutta method for one rooted tree.

    Attributes:
        tree: the rooted tree t.
        order: its number of vertices.
        defect: ``b . Phi(t) - 1/gamma(t)``, exact; zero if the condition holds.
    """

    tree: Tree
    order: int
    defect: Fraction


@lru_cache(maxsize=32)
def rooted_trees(order: int) -> tuple[Tree, ...]:
    """Return all rooted trees with ``order`` vertices; there are 1, 1, 2, 4, 9, 20, 48, 115, 286, 719, ... of them."""
    return () if order < 1 else tuple(_forests(order - 1, order - 1))


def _forests(vertices: int, largest: int) -> Iterable[Tree]:
    """Yield all multisets of rooted trees with this many vertices in total, none larger than ``largest``."""
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
    """Return the number of vertices of a rooted tree, which is the order of its condition."""
    return 1 + sum(vertices_of(child) for child in tree)


@lru_cache(maxsize=4096)
def density(tree: Tree) -> int:
    """Return the density ``gamma(t)`` of a rooted tree: its number of vertices times the densities of its branches."""
    return vertices_of(tree) * prod(density(child) for child in tree)


@lru_cache(maxsize=4096)
def symmetry(tree: Tree) -> int:
    """Return the symmetry ``sigma(t)`` of a rooted tree: the number of its automorphisms."""
    groups = (len(list(equal)) for _, equal in groupby(sorted(tree)))
    return prod(symmetry(child) for child in tree) * prod(factorial(size) for size in groups)


def order_conditions(
    method: str | Method, order: int | None = None, *, weights: Sequence[Fraction] | None = None
) -> tuple[Condition, ...]:
    """Return the order conditions of a Runge-Kutta method for all trees of at most ``order`` vertices, exactly.

    Args:
        method: name or Method.
        order: vertices of the largest trees; None: the method's declared order.
        weights: weights to use instead of the method's ``b``, for instance those of an embedded formula.

    Raises MethodError for an unknown name, or a method that is not a Runge-Kutta table.
    """
    chosen = named(method)
    if chosen.tableau is None:
        raise MethodError(
            f"{chosen.name}: only Runge-Kutta tables have rooted trees, {chosen.family} methods have none.")
    a, weights_of_method = chosen.tableau
    b = weights_of_method if weights is None else tuple(weights)
    scale = lcm(*(x.denominator for row in (*a, b) for x in row))
    end = [int(x * scale) for x in b]
    conditions = []
    for tree, size, phi in elementary_weights(a, scale, chosen.order if order is None else order):
        total = Fraction(sum(x * y for x, y in zip(end, phi, strict=True)), scale**size)
        conditions.append(Condition(tree, size, total - Fraction(1, density(tree))))
    return tuple(conditions)


def elementary_weights(
    a: Sequence[Sequence[Fraction]], scale: int, order: int
) -> Iterable[tuple[Tree, int, list[int]]]:
    """Yield each rooted tree t of at most ``order`` vertices with its elementary weights at the stages.

    One item consists of the tree, its number n of vertices, and the list of ``Phi_i(t) scale**(n - 1)`` for the stages
    i. ``scale`` is a common denominator of the Butcher table ``a``; zeros above the diagonal of ``a`` may be left out.
    """
    table = [[int(x * scale) for x in row] for row in a]
    stages = range(len(a))
    slopes: dict[Tree, list[int]] = {}

    def below(tree: Tree) -> list[int]:
        """Return ``A Phi(t)`` for a tree t, times ``scale**vertices``: integers, which are faster than fractions.

        ``A`` is the Butcher table and ``Phi(t)`` the elementary weights of t.
        """
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
    """Return the size of a Runge-Kutta method's leading error term: ``sqrt(sum (d/sigma(t))**2)`` over trees t.

    ``d = b . Phi(t) - 1/gamma(t)``, and sigma is the tree's :func:`symmetry`.
    Dormand & Prince 1980 compare methods by this norm.

    Args:
        method: name or Method.
        order: vertices of the trees; None: one more than the declared order.
        weights: weights to use instead of the method's ``b``.

    Raises MethodError like :func:`order_conditions`.
    """
    chosen = named(method)
    size = chosen.order + 1 if order is None else order
    terms = (c for c in order_conditions(chosen, size, weights=weights) if c.order == size)
    return sqrt(sum((c.defect / symmetry(c.tree)) ** 2 for c in terms))


def dense_conditions(method: str | Method, order: int | None = None) -> tuple[Condition, ...]:
    """Return the order conditions of a Runge-Kutta table's dense output for all trees of at most ``order`` vertices.

    They are evaluated in exact arithmetic:

    ``sum_i b_i(theta) Phi_i(t) = theta**n/gamma(t)`` for trees of n vertices (Hairer, Norsett & Wanner 1993,
    section II.6). The defect is the largest difference between the two polynomials' Bernstein coefficients.

    Args:
        method: name or Method.
        order: vertices of the largest trees; None: the declared order of the dense output.

    Raises MethodError for an unknown name, or a method whose dense output is Hermite interpolation.
    """
    chosen = named(method)
    extension = chosen.dense
    if extension is None or chosen.tableau is None:
        raise MethodError(f"{chosen.name}: its dense output is Hermite interpolation, which has no order conditions.")
    largest = extension.order if order is None else order
    degree = max(largest, len(extension.b[0]))
    polynomials = [_elevated(row, degree) for row in extension.b]
    table = (*chosen.tableau[0], *extension.a)
    scale = lcm(*(x.denominator for row in (*table, *polynomials) for x in row))
    columns = [[int(x * scale) for x in column] for column in zip(*polynomials, strict=True)]
    conditions = []
    for tree, size, phi in elementary_weights(table, scale, largest):
        share = comb(degree, size) * density(tree)
        defects = (
            Fraction(sum(x * y for x, y in zip(column, phi, strict=True)), scale**size) - Fraction(comb(j, size), share)
            for j, column in enumerate(columns, 1)
        )
        conditions.append(Condition(tree, size, max(abs(defect) for defect in defects)))
    return tuple(conditions)


def _elevated(row: Sequence[Fraction], degree: int) -> tuple[Fraction, ...]:
    """Return the Bernstein coefficients of a polynomial when its degree is written one higher (Farin 2002, 6.1)."""
    while len(row) < degree:
        n, points = len(row) + 1, (Fraction(0), *row, Fraction(0))
        row = [Fraction(j, n) * points[j - 1] + Fraction(n - j, n) * points[j] for j in range(1, n + 1)]
    return tuple(row)
