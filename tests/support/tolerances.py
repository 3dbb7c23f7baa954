"""Every tolerance of the catalogue of hard cases as a share of what it bounds.

``python tests/support/tolerances.py`` runs some methods of each order in every case, and prints for each quantity the
largest tolerance that a run was judged by, the size of what it bounds, and the reason of those above a tenth of it.
Methods may be named, "all" takes all of them, and ``--long`` also takes long cases.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator

import numpy as np

from integrators import METHODS, Method
from pendulum_env.hard_cases.case import ACCURATE, LOOSE, STABLE, Bound, Case, Finding
from pendulum_env.hard_cases.run import CASES, MatrixEntry

SOME = ("forward_euler", "backward_euler", "velocity_verlet", "heun", "ab3", "rk4", "bdf4", "kahan_li8", "dop853",
        "exact")
"""Methods of each order and kind, the first ones with the largest errors."""


def share(bound: Bound) -> float:
    """Return a tolerance as a share of what it bounds; 0 if nothing may differ."""
    return bound.tolerance / bound.size if bound.tolerance else 0.0


def loose(bound: Bound) -> bool:
    """Return True if a tolerance is more than LOOSE of what it bounds, to three digits: one of LOOSE adds rounding."""
    return not share(bound) <= LOOSE * 1.001


def unexplained(entry: MatrixEntry) -> list[str]:
    """Return a line for each tolerance of a run that is above LOOSE of what it bounds, without a reason.

    A complete run with a tolerance that does not say what it bounds has a line, too.
    """
    where, found = f"{entry.case.name}, {entry.method.name}", entry.finding
    lines = [f"{where}: {text(bound)}, and no reason" for bound in found.bounds if loose(bound) and not bound.why]
    if found.outcome in (ACCURATE, STABLE) and found.tolerance > 0.0 and not found.bounds:
        lines.append(f"{where}: the tolerance {found.tolerance:.3g} does not say what it bounds")
    return lines


def text(bound: Bound) -> str:
    """Return a tolerance, the size of what it bounds, and their ratio as text."""
    return f"{share(bound):8.2g} = {bound.tolerance:.2g}/{bound.size:.2g} of {bound.of}"


def largest(case: Case, methods: Iterable[Method]) -> Iterator[tuple[str, Bound]]:
    """Yield for each quantity of a case the method with the largest tolerance, and that tolerance."""
    worst: dict[tuple[str, str], tuple[str, Bound]] = {}
    for method in methods:
        with np.errstate(all="ignore"):
            found: Finding = case.tried(method)
        for bound in found.bounds:
            key = bound.of, bound.why
            if key not in worst or share(bound) > share(worst[key][1]):
                worst[key] = method.name, bound
    yield from worst.values()


def main() -> None:
    """Print the tolerances of all cases, and how many are above a tenth of what they bound."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    options.add_argument("methods", nargs="*", default=SOME, help=f"names of methods, or all [{' '.join(SOME)}]")
    options.add_argument("--long", action="store_true", help="also take long cases")
    given = options.parse_args()
    methods = [*METHODS.values()] if [*given.methods] == ["all"] else [METHODS[name] for name in given.methods]
    shown = wide = silent = 0
    for case in CASES:
        if case.long and not given.long:
            continue
        rows = [*largest(case, methods)]
        print(f"{case.group}: {case.name}{'' if rows else ': nothing may differ'}", flush=True)
        for name, bound in rows:
            shown, wide, silent = shown + 1, wide + loose(bound), silent + (loose(bound) and not bound.why)
            print(f"  {text(bound)} ({name}){f'; {bound.why}' if loose(bound) else ''}", flush=True)
    print(f"{shown} tolerances; {wide} above {LOOSE:.0%} of what they bound, {silent} of them without a reason.")


if __name__ == "__main__":
    main()
