"""Damped splittings for any two flows, step by step, against sub-flows that are applied here in 40 digits."""

from __future__ import annotations

from typing import Any

import mpmath
import pytest

from integrators import System, solve
from integrators.tables.splittings import GENERAL

STEPS = 5


def force(t: Any, q: Any) -> Any:
    return mpmath.cos(2 * t) - mpmath.sin(q)


def linear(v: Any, h: Any) -> Any:
    """The flow of v' = -v/4."""
    return v * mpmath.exp(-h / 4)


def quadratic(v: Any, h: Any) -> Any:
    """The flow of v' = -(3/8) |v| v."""
    return v / (1 + mpmath.mpf(3) / 8 * abs(v) * h)


DRAGS = {"linear": (linear, lambda v: v / 4), "quadratic": (quadratic, lambda v: mpmath.mpf(3) / 8 * abs(v) * v)}


@pytest.mark.parametrize("number", range(len(GENERAL)))
@pytest.mark.parametrize("law", DRAGS)
def test_steps_are_the_sub_flows_in_their_order(number: int, law: str) -> None:
    """Time goes on with the drifts; drag and kicks act at fixed time and angle; drags on end are one flow."""
    method, (drag, slowing) = GENERAL[number], DRAGS[law]
    with mpmath.workdps(40):
        h = mpmath.mpf(1) / 16
        system = System(lambda t, q, v: force(t, q) - slowing(v), force=force,
                        dissipative_flow=lambda t, q, v, span: drag(v, span))
        made = solve(system, mpmath.mpf("0.5"), mpmath.mpf(1), [1 + i * h for i in range(STEPS + 1)], method=method,
                     h=h * (1 + mpmath.mpf("1e-30")))
        start, q, v = mpmath.mpf(1), mpmath.mpf("0.5"), mpmath.mpf(1)
        for i in range(STEPS):
            t = start + i * h
            for kind, fraction in method.flows:
                share = h * mpmath.mpf(fraction.numerator) / fraction.denominator
                if kind == "kick":
                    v += share * force(t, q)
                elif kind == "drift":
                    q, t = q + share * v, t + share
                else:
                    assert kind == "drag"
                    v = drag(v, share)
            assert abs(made.q[i + 1] - q) < mpmath.mpf("1e-36"), (i, method.name)
            assert abs(made.v[i + 1] - v) < mpmath.mpf("1e-36"), (i, method.name)
