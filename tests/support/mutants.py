"""Mutants: methods that take wrong steps under a right name, to see which hard cases notice them.

Each method of RELATIVES gets the step of a relative of lower order, a coefficient that is slightly wrong, and a wrong
sign; splittings also lose a drag. ``python tests/support/mutants.py`` prints the table of mutants by cases.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from copy import copy
from dataclasses import dataclass, fields
from fractions import Fraction
from typing import Any
from unittest.mock import patch

import numpy as np
from forty_digits import fits

from integrators import METHODS, Method
from pendulum_env.engine.machine import offers
from pendulum_env.hard_cases.case import Case
from pendulum_env.hard_cases.run import CASES, MOTIONS

RELATIVES = {
    "heun": "forward_euler", "kutta3": "heun", "rk4": "kutta3", "dopri5": "rk4", "verner6": "dopri5",
    "dop853": "verner7", "verner9": "verner8", "gauss4": "radau3", "gauss6": "gauss4", "radau5": "gauss4",
    "velocity_verlet": "symplectic_euler", "suzuki4": "ruth3", "yoshida6a": "suzuki4", "kahan_li8": "kahan_li6",
    "sofroniou_spaletta10": "kahan_li8", "dprkn8": "dprkn6", "dprkn12": "dprkn8", "ab4": "ab3", "bdf4": "bdf3",
    "quinlan_tremaine12": "quinlan_tremaine10",
}
"""Method -> its nearest relative of lower order."""
EIGHTH = Fraction(1, 10**8)
"""Relative change of a coefficient of methods of order 8 and more."""
FLOWS, ROW = "flows", "b"


@dataclass(frozen=True)
class Mutant:
    """A method with a wrong step: the method, what is wrong, and what it was made from."""

    method: Method
    fault: str


def altered(method: Method, **values: Any) -> Method:
    """Return a method with other values of its fields, without the checks that would refuse them."""
    other = copy(method)
    names = {field.name for field in fields(method)}  # type: ignore[arg-type]
    for name in [name for name in vars(other) if name not in names]:
        del other.__dict__[name]
    for name, value in values.items():
        object.__setattr__(other, name, value)
    return other


def changed(method: Any, change: Callable[[Fraction], Fraction]) -> Method:
    """Return a method with one coefficient changed, that of the largest size; weights still sum to one."""
    if hasattr(method, FLOWS):
        parts = [(i, flow) for i, flow in enumerate(method.flows) if flow[0] == "kick"]
        i, (kind, part) = max(parts, key=lambda one: abs(one[1][1]))
        k = min((j for j, _ in parts if j != i), key=lambda j: abs(method.flows[j][1]), default=i)
        flows, moved = list(method.flows), change(part) - part
        flows[i] = (kind, part + moved)
        if k != i:
            flows[k] = (kind, flows[k][1] - moved)
        return altered(method, flows=tuple(flows))
    row = next(name for name in ("bbar", "b", "alpha", "beta") if hasattr(method, name))
    if row == "alpha":
        row = "beta" if hasattr(method, "beta") else "alpha"
    values = list(getattr(method, row))
    i = max(range(len(values)), key=lambda j: abs(values[j]))
    values[i] = change(values[i])
    return altered(method, **{row: tuple(values)})


def lower(name: str) -> Mutant:
    """Return the mutant of a method that takes the step of its nearest relative of lower order."""
    relative = METHODS[RELATIVES[name]]
    return Mutant(altered(relative, name=name), f"the step of {relative.name}")


def smallest(name: str) -> float:
    """Return the smallest error that a case allows a method."""
    return min(motion.allowed(METHODS[name]) for motion in MOTIONS.values() if fits(motion, METHODS[name]))


def mutants(name: str) -> Iterator[Mutant]:
    """Yield the mutants of a method; a coefficient is changed by 100 times the smallest error that a case allows."""
    method: Any = METHODS[name]
    yield lower(name)
    bound = smallest(name)
    size = EIGHTH if method.order >= 8 else Fraction(100.0 * bound)
    yield Mutant(changed(method, lambda x: x * (1 + size)), f"a coefficient {float(size):.1g} larger")
    yield Mutant(changed(method, lambda x: -x), "a coefficient of the wrong sign")
    drags = [i for i, flow in enumerate(getattr(method, FLOWS, ())) if flow[0] == "drag"]
    if drags:
        rest = tuple(flow for i, flow in enumerate(method.flows) if i != drags[0])
        yield Mutant(altered(method, flows=rest), "a drag left out")


def noticed(case: Case, mutant: Mutant) -> bool:
    """Return True if a mutant's outcome in a case is not one that the case allows its method.

    The check that would refuse its coefficients before they run is left out.
    """
    with np.errstate(all="ignore"), patch("integrators.analysis.conditions.check_order"):
        return not case.as_expected(METHODS[mutant.method.name], case.tried(mutant.method))


def rows(cases: Sequence[Case] = CASES) -> Iterator[tuple[str, str, list[str]]]:
    """Yield each mutant's method, its fault, and the names of the cases that notice it."""
    for name in RELATIVES:
        for mutant in mutants(name):
            fitting = [case for case in cases if METHODS[name].needs <= offers(case.scene)]
            yield name, mutant.fault, [case.name for case in fitting if noticed(case, mutant)]


def main() -> None:
    """Print which cases notice each mutant."""
    for method, fault, cases in rows():
        print(f"{method:22} {fault:40} {len(cases):3}  {', '.join(cases)}", flush=True)


if __name__ == "__main__":
    main()
