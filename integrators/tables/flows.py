"""From published coefficients to sub-flows: mirroring, completing to whole steps, and placing the drag.

Published tables list kicks and drifts. Where they are of order p for any two flows, the same numbers make a method of
order p from any basic step and its adjoint (McLachlan 1995, SIAM J. Sci. Comput. 16, 151; Hairer, Lubich & Wanner 2006,
section III.3): kicks are cut in two, and what drag there is acts between the parts. Forces are not evaluated more
often, and without drag the parts are one kick again. The drag's part of a step has negative fractions where kicks have.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import cycle

from integrators.families.splitting import DRAG, DRIFT, KICK
from integrators.method import exact

Flows = tuple[tuple[str, Fraction], ...]
Number = int | str | Fraction
OTHER = {KICK: DRIFT, DRIFT: KICK}


def alternating(first: str, outer: Sequence[Number], inner: Sequence[Number]) -> Flows:
    """Kicks and drifts in turn, the outer ones of the kind ``first``; a last one of each kind completes the step."""
    rows = ((*part, 1 - sum(part, Fraction(0))) for part in (exact(*outer), exact(*inner)))
    return _interleaved(first, *rows)


def mirrored(first: str, outer: Sequence[Number], inner: Sequence[Number]) -> Flows:
    """A palindrome of kicks and drifts, by its first ones; one in the middle and two next to it complete the step.

    ``outer`` are of the kind ``first``. The one in the middle is so too where ``outer`` is longer than ``inner``, and
    of the other kind where both are as long.
    """
    outside, inside = exact(*outer), exact(*inner)
    outer_middle = len(outside) > len(inside)
    alone, paired = (outside, inside) if outer_middle else (inside, outside)
    middle, last = 1 - 2 * sum(alone, Fraction(0)), Fraction(1, 2) - sum(paired, Fraction(0))
    lone, pairs = (*alone, middle, *alone[::-1]), (*paired, last, last, *paired[::-1])
    rows = (lone, pairs) if outer_middle else (pairs, lone)
    return _interleaved(first, *rows)


def composed(*gammas: Number) -> Flows:
    """Steps of velocity Verlet of these fractions, then one that completes the step, then the same backwards."""
    half = exact(*gammas)
    drifts = (*half, 1 - 2 * sum(half, Fraction(0)), *half[::-1])
    kicks = [(x + y) / 2 for x, y in zip((Fraction(0), *drifts), (*drifts, Fraction(0)), strict=True)]
    return _interleaved(KICK, kicks, drifts)


def _interleaved(first: str, outer: Sequence[Fraction], inner: Sequence[Fraction]) -> Flows:
    kinds, turns = cycle((first, OTHER[first])), cycle((iter(outer), iter(inner)))
    return tuple((next(kinds), next(next(turns))) for _ in range(len(outer) + len(inner)))


def with_drag(flows: Flows) -> Flows:
    """The same with drag: steps ``drag, kick, drift`` and their adjoints ``drift, kick, drag`` in turn.

    Neighbouring drifts are one; so are drags, where they are exact flows, which :func:`integrators.unroll` is
    told.
    """
    found: list[tuple[str, Fraction]] = []
    left = Fraction(0)
    for kind, fraction in flows:
        rest = fraction - left
        if kind == DRIFT:
            found.append((DRIFT, fraction))
        else:
            found += [(KICK, left), (DRAG, left), (DRAG, rest), (KICK, rest)]
        left = rest
    return tuple(flow for flow in found if flow[1])
