"""Order conditions of splitting methods, evaluated in 60 digits.

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

from integrators.families.force_gradient import ForceGradient
from integrators.families.splitting import DRAG, DRIFT, KICK
from integrators.method import Method, MethodError

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
