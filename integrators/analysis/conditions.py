"""Residuals of the order conditions, order by order, of any method; those of splitting methods in 60 digits.

A product of flows is a sum over words: ``exp(x1 A) exp(x2 B) ...`` has one coefficient for each word in A and B. A
splitting has order p if the coefficients of all words of n <= p letters are ``1/n!``, as in ``exp(A + B)``
(Hairer, Lubich & Wanner 2006, III.5). For damped problems, the flow of the drag is a third letter.

For velocity-free forces, fewer conditions suffice: those of Nyström methods, one for each tree in which forces depend
on angles only (Hairer, Norsett & Wanner 1993, II.14; Sanz-Serna & Calvo 1994, section 7.3).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from decimal import Decimal, localcontext
from functools import lru_cache
from math import factorial, prod
from typing import Any

import numpy as np

from integrators.analysis.multistep_linear import order_defects
from integrators.analysis.nystrom_trees import NystromCondition, nystrom_conditions
from integrators.analysis.trees import Condition, dense_conditions, order_conditions
from integrators.families.force_gradient import ForceGradient
from integrators.families.splitting import DRAG, DRIFT, KICK
from integrators.method import Method, MethodError
from integrators.registry import METHODS, named

Flows = Sequence[tuple[str, Decimal]]
Tree = tuple[Any, ...]
"""A derivative of the force, as the tuple of its factors: VELOCITY, or a tree that stands for a change of the angle."""
VELOCITY: Tree = ("v",)
"""The leaf of a tree: the velocity itself."""


def splitting_order(method: Method, *, damped: bool = False, rounding: float = 1e-33) -> int:
    """Return the order of a splitting by its order conditions, at most one above its declared order.

    Args:
        method: a composition of kicks, drifts and drags.
        damped: True to include the exact flow of the drag.
        rounding: violations up to this size count as rounding of the table.

    Raises MethodError as :func:`violations` does.
    """
    orders = range(1, method.order + 2)
    broken = (order for order in orders if max(violations(method, order, damped=damped)) > rounding)
    return next(broken, method.order + 2) - 1


def violations(method: Method, order: int, *, damped: bool = False) -> list[float]:
    """Return the size of the residual of each order condition of a splitting at one order, computed in 60 digits.

    A kick may use the gradient of the force. Raises MethodError for a method with other parts than kicks, drifts and
    drags, and if ``damped`` for a method that cannot treat drag.
    """
    if isinstance(method, ForceGradient):
        with localcontext() as context:
            context.prec = 60
            parts = [(kind, *(Decimal(x.numerator) / x.denominator for x in row)) for kind, *row in method.flows]
            return [float(abs(gap)) for gap in tree_gaps(parts, order)]
    if not method.sub_flows or not {kind for kind, _ in method.sub_flows} <= {KICK, DRIFT, DRAG}:
        raise MethodError(f"{method.name} is not a composition of kicks, drifts and exact drag flows, as needed here.")
    special = "velocity_free" in method.needs
    if damped and special:
        raise MethodError(f"{method.name} cannot treat drag, so damped=True is not possible.")
    letters = (KICK, DRIFT, DRAG) if damped else (KICK, DRIFT)
    with localcontext() as context:
        context.prec = 60
        flows = [(kind, Decimal(x.numerator) / x.denominator) for kind, x in method.sub_flows if kind in letters]
        gaps = tree_gaps(flows, order) if special else word_gaps(flows, letters, order)
        return [float(abs(gap)) for gap in gaps]


def word_gaps(flows: Flows, letters: Sequence[str], length: int) -> list[Decimal]:
    """Return the coefficients of all words of one length in a composition of flows, minus the exact ``1/length!``.

    A word is a sequence of letters, one letter for each kind of flow (kick, drift, drag).
    """
    sums = [np.full((len(letters),) * n, Decimal(0), dtype=object) for n in range(length + 1)]
    sums[0][()] = Decimal(1)
    for kind, x in flows:
        letter = letters.index(kind)
        powers = [Decimal(1)]
        for n in range(1, length + 1):
            powers.append(powers[-1] * x / n)
        for n in range(length, 0, -1):
            for k in range(1, n + 1):
                ending: Any = (..., *[letter] * k)
                sums[n][ending] += sums[n - k] * powers[k]
    return [value - Decimal(1) / factorial(length) for value in sums[length].ravel()]


def tree_gaps(flows: Sequence[tuple[Any, ...]], order: int) -> list[Decimal]:
    """Return the differences between a splitting's and the exact coefficients of all trees of one order.

    The coefficients belong to the Taylor series of the velocity, and of the angle for trees one order smaller. A kick
    adds the product of a tree's branches to its coefficient in the velocity; a drift adds the coefficients of the
    velocity to those of the angle. A kick by ``f + c h² f f'``, with c as third entry of its flow, also adds c times
    the change of that product if the force f is added to the angle.
    """
    all_trees = [tree for n in range(1, order + 1) for tree in trees(n)]
    angle = dict.fromkeys([VELOCITY, *all_trees], Decimal(0))
    velocity = {**angle, VELOCITY: Decimal(1)}
    for kind, x, *gradient in flows:
        if kind == DRIFT:
            angle = {tree: share + x * velocity[tree] for tree, share in angle.items()}
        else:
            force = {tree: prod((angle[child] for child in tree), start=Decimal(1)) for tree in all_trees}
            force[VELOCITY] = Decimal(0)
            for tree in all_trees:
                velocity[tree] += x * force[tree]
                for i, child in enumerate(tree if any(gradient) else ()):
                    others = (angle[other] for k, other in enumerate(tree) if k != i)
                    velocity[tree] += x * gradient[0] * force[child] * prod(others, start=Decimal(1))
    smaller = trees(order - 1) if order > 1 else (VELOCITY,)
    return [
        *(velocity[tree] - Decimal(1) / density(tree) for tree in trees(order)),
        *(angle[tree] - Decimal(1) / (density(tree) * order) for tree in smaller),
    ]


@lru_cache(maxsize=32)
def trees(order: int) -> tuple[Tree, ...]:
    """Return all trees of one order for velocity-free forces, in which every vertex is a force that depends on angles.

    There are 1, 1, 2, 3, 6, 10, 20, ... of the orders 1, 2, 3, ...
    """
    children = [VELOCITY, *(tree for n in range(1, order - 1) for tree in trees(n))]

    def fillings(room: int, start: int) -> Iterator[Tree]:
        if room == 0:
            yield ()
        for i, child in enumerate(children[start:], start):
            if weight(child) <= room:
                yield from ((child, *rest) for rest in fillings(room - weight(child), i))

    return tuple(fillings(order - 1, 0))


def weight(tree: Tree) -> int:
    """Return the power of the time with which a tree's term enters the angle in the Taylor series of the motion."""
    return 1 if tree == VELOCITY else 2 + sum(weight(child) for child in tree)


def density(tree: Tree) -> int:
    """Return 1/c for the coefficient c of a tree's term ``c t**(weight - 1)`` in the exact velocity's Taylor series."""
    if tree == VELOCITY:
        return 1
    return (weight(tree) - 1) * prod(density(child) * weight(child) for child in tree)


HOLDS = 1e-7
"""Largest residual of an order condition that may be rounding, of coefficients given as floats or to seven digits."""


def order_residuals(method: str | Method, order: int | None = None) -> tuple[float, ...]:
    """Return the largest residual of a method's order conditions, for every order from 1 up to ``order``.

    A method has order p if the first p residuals vanish up to the rounding of its table. The conditions belong to
    rooted trees for a Butcher tableau, to Nyström trees for a Nyström tableau, to words or trees for a composition of
    flows, and to polynomials for a multistep method; see :class:`integrators.Method`.

    Args:
        method: name or Method.
        order: the highest order; None: one more than the method declares.

    Raises MethodError for an unknown name, and for a method without such coefficients. The order of such a method can
    be measured with :func:`integrators.analysis.measured.observed_order`.
    """
    chosen = named(method)
    coefficients = (chosen.tableau, chosen.nystrom_tableau, chosen.sub_flows, chosen.characteristic)
    if not any(coefficients) and not isinstance(chosen, ForceGradient):
        raise MethodError(
            f"{chosen.name} states no coefficients that have order conditions; measure its order with observed_order.")
    highest = chosen.order + 1 if order is None else order
    if chosen.sub_flows or isinstance(chosen, ForceGradient):
        return tuple(max(violations(chosen, size)) for size in range(1, highest + 1))
    if chosen.characteristic:
        return tuple(float(abs(defect)) for defect in order_defects(chosen, highest))
    conditions = order_conditions(chosen, highest) if chosen.tableau else nystrom_conditions(chosen, highest)
    return _by_order(conditions)


@lru_cache(maxsize=256)
def check_order(method: Method) -> None:
    """Raise MethodError if the coefficients of a method contradict the order that it declares.

    A condition holds if its residual is at most :data:`HOLDS`. The declared orders of embedded formulas and of dense
    output are checked, too. Methods that state no coefficients are left out, and so are those of
    :data:`integrators.METHODS`, which tests check to 33 digits.
    """
    if METHODS.get(method.name) is method:
        return
    for formula in method.formulas:
        try:
            residuals = order_residuals(formula, formula.order)
        except MethodError:  # no coefficients that have order conditions
            continue
        _check(formula.name, formula.order, residuals)
    if method.dense is not None and method.tableau is not None:
        _check(f"{method.name}, dense output", method.dense.order, _by_order(dense_conditions(method)))


def _check(name: str, order: int, residuals: Sequence[float]) -> None:
    """Raise MethodError if one of the residuals, for orders from 1 on, is more than :data:`HOLDS`."""
    reached = next((size for size, gap in enumerate(residuals) if not gap <= HOLDS), order)
    if reached < order:
        raise MethodError(
            f"{name}: the coefficients have order {reached}, not {order} as declared: a condition of order "
            f"{reached + 1} is off by {residuals[reached]:.2g}; correct the coefficients or declare order {reached}.")


def _by_order(conditions: Sequence[Condition | NystromCondition]) -> tuple[float, ...]:
    """Return the largest residual of the conditions of each order, from order 1 on."""
    return tuple(float(max(abs(x.defect) for x in conditions if x.order == size))
                 for size in range(1, max(x.order for x in conditions) + 1))
