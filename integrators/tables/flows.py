"""Conversion of published splitting coefficients to sub-flows: symmetry, completion of the step, and drag flows.

Published tables list kicks and drifts. If they have order p for any two flows, their numbers also give a method of
order p from any basic step and its adjoint (McLachlan 1995, SIAM J. Sci. Comput. 16, 151; Hairer, Lubich & Wanner 2006,
section III.3): each kick is divided in two, and drag acts between the parts. This needs no more force evaluations, and
without drag the two parts are one kick again. Like kicks, drag flows can have negative fractions of the step.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import cycle

from integrators.families.splitting import DRAG, DRIFT, KICK
from integrators.method import exact, total

Flows = tuple[tuple[str, Fraction], ...]
Number = int | str | Fraction
OTHER = {KICK: DRIFT, DRIFT: KICK}


def alternating(first: str, outer: Sequence[Number], inner: Sequence[Number]) -> Flows:
    """Return a splitting of alternating kicks and drifts that begins with the kind ``first``.

    ``outer`` has the fractions of that kind, ``inner`` those of the other kind.

    One more kick and one more drift are added, so that the fractions of each kind sum to 1.
    """
    rows = ((*part, 1 - total(part)) for part in (exact(*outer), exact(*inner)))
    return _interleaved(first, *rows)


def mirrored(first: str, outer: Sequence[Number], inner: Sequence[Number]) -> Flows:
    """Return a symmetric splitting, kicks and drifts in turn, from the fractions of its first half.

    ``outer`` has the fractions of the kind ``first``, ``inner`` those of the other kind. The middle flow and the two
    next to it follow, because the fractions of each kind sum to 1. The middle flow is of the kind ``first`` if
    ``outer`` is longer than ``inner``, and of the other kind if both have the same length.
    """
    outside, inside = exact(*outer), exact(*inner)
    outer_middle = len(outside) > len(inside)
    alone, paired = (outside, inside) if outer_middle else (inside, outside)
    middle, last = 1 - 2 * total(alone), Fraction(1, 2) - total(paired)
    lone, pairs = (*alone, middle, *alone[::-1]), (*paired, last, last, *paired[::-1])
    rows = (lone, pairs) if outer_middle else (pairs, lone)
    return _interleaved(first, *rows)


def composed(*gammas: Number) -> Flows:
    """Return a symmetric composition of velocity Verlet steps, as kicks and drifts.

    ``gammas`` are the lengths of the steps before the middle one, as fractions of the whole step.
    """
    half = exact(*gammas)
    drifts = (*half, 1 - 2 * total(half), *half[::-1])
    kicks = [(x + y) / 2 for x, y in zip((Fraction(0), *drifts), (*drifts, Fraction(0)), strict=True)]
    return _interleaved(KICK, kicks, drifts)


def _interleaved(first: str, outer: Sequence[Fraction], inner: Sequence[Fraction]) -> Flows:
    """Return kicks and drifts in turn, as pairs (kind, fraction of the step), beginning with the kind ``first``.

    ``outer`` are its fractions, ``inner`` those of the other kind: equally many, or one fewer.
    """
    kinds, turns = cycle((first, OTHER[first])), cycle((iter(outer), iter(inner)))
    return tuple((next(kinds), next(next(turns))) for _ in range(len(outer) + len(inner)))


def with_drag(flows: Flows) -> Flows:
    """Insert exact drag flows into a splitting of kicks and drifts.

    The orders ``drag, kick, drift`` and ``drift, kick, drag`` then alternate. Neighbouring drifts are combined.
    :func:`integrators.unroll` combines neighbouring drags if they are exact flows.
    """
    parts: list[tuple[str, Fraction]] = []
    left = Fraction(0)
    for kind, fraction in flows:
        rest = fraction - left
        if kind == DRIFT:
            parts.append((DRIFT, fraction))
        else:
            parts += [(KICK, left), (DRAG, left), (DRAG, rest), (KICK, rest)]
        left = rest
    return tuple(flow for flow in parts if flow[1])
