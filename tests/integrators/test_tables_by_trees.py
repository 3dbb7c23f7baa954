"""Order conditions of Verner's and Fine's tables, and of every dense output, in 60 digits, with trees made here.

A tree is a root with subtrees. Its elementary weight is ``Phi_i = prod_s W_i(s)``. A subtree s under an argument v
gives ``W_i = sum_j a_ij Phi_j(s)``; under an argument q of a Nyström table it gives ``sum_j A_ij Phi_j(s)``, and the
initial velocity gives ``c_i``. Weights b are of order p if ``sum_i b_i Phi_i(t) = 1/gamma(t)`` for all trees up to
order p (Butcher 1963; Hairer, Norsett & Wanner 1993, II.2 and II.14).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import cache
from typing import Any, NamedTuple

import mpmath
import pytest

import integrators
from integrators.families.nystrom import Nystrom
from integrators.families.runge_kutta import RungeKutta

DIGITS, SMALL = 60, mpmath.mpf("1e-33")
VERNER = ("verner6", "verner7", "verner8", "verner9")
FINE = ("fine4", "fine5")
DENSE = [name for name, method in integrators.METHODS.items() if isinstance(method, RungeKutta) and method.dense]


class Tree(NamedTuple):
    """A root with its branches, in one fixed order."""

    branches: tuple[Branch, ...]


class Branch(NamedTuple):
    """A subtree and the argument of the force that it stands under; None is the initial velocity, under q."""

    by_q: bool
    tree: Tree | None


@cache
def order(tree: Tree) -> int:
    """Return the number of factors h, in the tree's term of v."""
    return 1 + sum(size(branch) for branch in tree.branches)


@cache
def size(branch: Branch) -> int:
    """Return the number of factors h that a branch brings; an integration of v to q brings one."""
    return branch.by_q + (order(branch.tree) if branch.tree else 0)


@cache
def density(tree: Tree) -> int:
    """Return gamma: the product of the numbers of factors h at each integration."""
    result = order(tree)
    for branch in tree.branches:
        result *= (density(branch.tree) if branch.tree else 1) * (size(branch) if branch.by_q else 1)
    return result


@cache
def trees(most: int, nystrom: bool) -> tuple[Tree, ...]:
    """Return all trees with this order; with ``nystrom``, those of q'' = f(t, q, v), else those of y' = f(y)."""
    twigs = [Branch(False, tree) for n in range(1, most) for tree in trees(n, nystrom)]
    if nystrom:
        twigs += [Branch(True, None)] * (most > 1)
        twigs += [Branch(True, tree) for n in range(1, most - 1) for tree in trees(n, nystrom)]

    def bundles(left: int, first: int) -> Iterator[tuple[Branch, ...]]:
        if not left:
            yield ()
        for i in range(first, len(twigs)):
            if size(twigs[i]) <= left:
                yield from ((twigs[i], *rest) for rest in bundles(left - size(twigs[i]), i))

    return tuple(Tree(bundle) for bundle in bundles(most - 1, 0))


def numbers(row: Sequence[Any]) -> list[Any]:
    """Return exact fractions as mpmath numbers."""
    return [mpmath.mpf(x.numerator) / x.denominator for x in row]


class Table:
    """A table in mpmath numbers: rows for v, and for a Nyström table rows for q and places c."""

    def __init__(self, by_v: Any, by_q: Any = (), c: Any = ()) -> None:
        self.by_v, self.by_q, self.c = [numbers(row) for row in by_v], [numbers(row) for row in by_q], numbers(c)
        self.known: dict[Tree, list[Any]] = {}

    def weights(self, tree: Tree) -> list[Any]:
        """Return Phi_i of every stage."""
        if tree not in self.known:
            result = [mpmath.mpf(1)] * len(self.by_v)
            for branch in tree.branches:
                below = self.weights(branch.tree) if branch.tree else []
                rows = self.by_q if branch.by_q else self.by_v
                result = [
                    x * (sum((a * y for a, y in zip(rows[i], below, strict=False)), mpmath.mpf(0)) if below
                         else self.c[i])
                    for i, x in enumerate(result)
                ]
            self.known[tree] = result
        return self.known[tree]

    def defect(self, row: Sequence[Any], most: int, place: bool = False, theta: Any = 1) -> Any:
        """Return the largest defect of the conditions of one order; with ``place`` those of q."""
        total = mpmath.mpf(0)
        for tree in trees(most - place, bool(self.c)):
            exact = mpmath.mpf(theta) ** most / (density(tree) * (most if place else 1))
            found = sum((b * x for b, x in zip(row, self.weights(tree), strict=False)), mpmath.mpf(0))
            total = max(total, abs(found - exact))
        return total


def orders(table: Table, row: Sequence[Any], most: int, place: bool = False) -> int:
    """Return the order of weights, at most ``most``."""
    return next((n - 1 for n in range(1 + place, most + 1) if table.defect(row, n, place) > SMALL), most)


def runge_kutta(name: str) -> RungeKutta:
    """Return a registered Runge-Kutta method by its name."""
    method = integrators.get(name)
    assert isinstance(method, RungeKutta)
    return method


def test_trees_are_as_many_as_published() -> None:
    """Rooted trees 1, 1, 2, 4, 9, 20, 48, 115, 286 (Hairer, Norsett & Wanner 1993, table II.2.1)."""
    assert [len(trees(n, False)) for n in range(1, 10)] == [1, 1, 2, 4, 9, 20, 48, 115, 286]
    assert len({*trees(9, False)}) == 286


@pytest.mark.parametrize("name", VERNER)
def test_verners_tables_have_their_orders(name: str) -> None:
    method = runge_kutta(name)
    with mpmath.workdps(DIGITS):
        table = Table(method.a)
        assert orders(table, numbers(method.b), method.order + 1) == method.order
        for pair in method.embedded:
            assert orders(table, numbers(pair.b), pair.order + 1) == pair.order


@pytest.mark.parametrize("name", DENSE)
def test_dense_output_has_its_order_and_no_higher_one(name: str) -> None:
    """At as many places as the polynomials have coefficients, so everywhere."""
    method = runge_kutta(name)
    assert method.dense is not None
    with mpmath.workdps(DIGITS):
        rows, dense = [numbers(row) for row in method.dense.b], method.dense
        table = Table((*method.a, *dense.a))
        degree, beyond = len(rows[0]), 0
        for step in range(1, degree + 1):
            theta = (step - mpmath.mpf(1) / 3) / degree
            form = [math.comb(degree, j) * theta**j * (1 - theta) ** (degree - j) for j in range(1, degree + 1)]
            b = [mpmath.fdot(row, form) for row in rows]
            assert max(table.defect(b, n, theta=theta) for n in range(1, dense.order + 1)) < SMALL
            beyond += dense.order < 9 and table.defect(b, dense.order + 1, theta=theta) > 1e-9
        assert beyond or dense.order == 9
        assert table.defect(numbers(method.b), method.order) < SMALL


@pytest.mark.parametrize("name", FINE)
def test_fines_tables_have_their_orders(name: str) -> None:
    """For forces that depend on the velocity: of the angle, of the velocity, and of the estimate."""
    method = integrators.get(name)
    assert isinstance(method, Nystrom)
    with mpmath.workdps(DIGITS):
        table = Table(method.av, method.a, method.c)
        found = [orders(table, numbers(row), method.order + 1, place) for row, place in (
            (method.bbar, True), (method.b, False))]
        assert min(found) == method.order
        for pair in method.embedded:
            rows = ((pair.bbar, True), *(((pair.b, False),) if pair.b else ()))
            assert min(orders(table, numbers(row), method.order, place) for row, place in rows) == pair.order


@pytest.mark.parametrize("name", VERNER)
def test_a_coefficient_that_is_off_in_its_30th_digit_is_seen(name: str) -> None:
    method = runge_kutta(name)
    with mpmath.workdps(DIGITS):
        table = Table(method.a)
        row = next(row for row in table.by_v[::-1] if len(row) > 3 and any(row))
        row[next(i for i, x in enumerate(row) if x)] += mpmath.mpf("1e-30")
        whole = max(table.defect(numbers(row), n) for row, p in (
            (method.b, method.order), *((pair.b, pair.order) for pair in method.embedded)) for n in range(1, p + 1))
        assert whole > SMALL
