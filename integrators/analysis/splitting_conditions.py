"""Order conditions of splittings, evaluated in 60 digits: what every smooth problem asks of a table.

A product of flows is a sum over words: ``exp(x1 A) exp(x2 B) ...`` has for each word in A and B one coefficient,
and a splitting has order p where those of all words of n <= p letters are those of ``exp(A + B)``, ``1/n!``
(Hairer, Lubich & Wanner 2006, III.5). With the drag's flow as a third letter the same holds for damped problems.

For velocity-free forces fewer conditions suffice: those of Nystroem methods, one for each tree in which forces stand
on angles only (Hairer, Norsett & Wanner 1993, II.14; Sanz-Serna & Calvo 1994, section 7.3).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from decimal import Decimal, localcontext
from functools import lru_cache
from math import factorial, prod
from typing import Any

import numpy as np

from integrators.families.splitting import DRAG, DRIFT, KICK
from integrators.method import Method, MethodError

Flows = Sequence[tuple[str, Decimal]]
Tree = tuple[Any, ...]
"""A derivative of the force, by what fills its places: VELOCITY, or the angle that another tree leads to."""
VELOCITY: Tree = ("v",)


def splitting_order(method: Method, *, damped: bool = False, rounding: float = 1e-33) -> int:
    """The order of a splitting by its order conditions, looked for up to one above what it declares.

    Args:
        method: a composition of kicks, drifts and drags.
        damped: whether the drag's flow is one of the parts.
        rounding: violations up to this are taken for the rounding of the table.

    Raises MethodError as :func:`violations` does.
    """
    orders = range(1, method.order + 2)
    broken = (order for order in orders if max(violations(method, order, damped=damped)) > rounding)
    return next(broken, method.order + 2) - 1


def violations(method: Method, order: int, *, damped: bool = False) -> list[float]:
    """How far each condition of just this order is from being met, computed in 60 digits.

    Raises MethodError for a method with other parts than kicks, drifts and drags, and for one that takes no drag
    where ``damped``.
    """
    if not method.sub_flows or not {kind for kind, _ in method.sub_flows} <= {KICK, DRIFT, DRAG}:
        raise MethodError(f"{method.name} is no composition of kicks, drifts and exact drags, which these are for.")
    special = "velocity_free" in method.needs
    if damped and special:
        raise MethodError(f"{method.name} takes no drag, so that it has no order with it.")
    letters = (KICK, DRIFT, DRAG) if damped else (KICK, DRIFT)
    with localcontext() as context:
        context.prec = 60
        flows = [(kind, Decimal(x.numerator) / x.denominator) for kind, x in method.sub_flows if kind in letters]
        gaps = tree_gaps(flows, order) if special else word_gaps(flows, letters, order)
        return [float(abs(gap)) for gap in gaps]


def word_gaps(flows: Flows, letters: Sequence[str], length: int) -> list[Decimal]:
    """Coefficients of all words of one length in the product of the flows, minus ``1/length!``."""
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


def tree_gaps(flows: Flows, order: int) -> list[Decimal]:
    """Coefficients of all trees of one order in the velocity, and of the next smaller in the angle, minus the true.

    A kick adds to a tree's share in the velocity what its places hold; a drift carries the shares into the angle.
    """
    known = [tree for n in range(1, order + 1) for tree in trees(n)]
    angle = dict.fromkeys([VELOCITY, *known], Decimal(0))
    velocity = {**angle, VELOCITY: Decimal(1)}
    for kind, x in flows:
        if kind == DRIFT:
            angle = {tree: share + x * velocity[tree] for tree, share in angle.items()}
        else:
            for tree in known:
                velocity[tree] += x * prod((angle[child] for child in tree), start=Decimal(1))
    smaller = trees(order - 1) if order > 1 else (VELOCITY,)
    return [
        *(velocity[tree] - Decimal(1) / density(tree) for tree in trees(order)),
        *(angle[tree] - Decimal(1) / (density(tree) * order) for tree in smaller),
    ]


@lru_cache(maxsize=32)
def trees(order: int) -> tuple[Tree, ...]:
    """All trees of one order: 1, 1, 2, 3, 6, 10, 20, ... of them."""
    children = [VELOCITY, *(tree for n in range(1, order - 1) for tree in trees(n))]

    def fillings(room: int, start: int) -> Iterator[Tree]:
        if room == 0:
            yield ()
        for i, child in enumerate(children[start:], start):
            if weight(child) <= room:
                yield from ((child, *rest) for rest in fillings(room - weight(child), i))

    return tuple(fillings(order - 1, 0))


def weight(tree: Tree) -> int:
    """The power of the time with which the tree enters an angle."""
    return 1 if tree == VELOCITY else 2 + sum(weight(child) for child in tree)


def density(tree: Tree) -> int:
    """One over the tree's coefficient in the true velocity; its power of the time is ``weight - 1``."""
    if tree == VELOCITY:
        return 1
    return (weight(tree) - 1) * prod(density(child) * weight(child) for child in tree)
