"""Hard case: a difficult simulation, its reference solution with source, and the outcomes each method may have.

The allowed outcomes follow from theory; README.md beside this file lists those that were changed after a run. A case is
run with one method at a time and has one of five outcomes::

    accurate   the error is within the tolerance that follows from the method's order
    stable     not accurate, but bounded and of the right kind, as the case defines it
    diverged   the run stopped, reported divergence, and kept its last finite state
    refused    the scene does not meet a need of the method, which the rollout reported
    wrong      finite but false, or a crash: a failure for every method
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from integrators import METHODS, Method, MethodError
from integrators.method import NEEDS
from pendulum_env.engine.kernels import Backend
from pendulum_env.engine.machine import offers
from pendulum_env.engine.rollout import Rollout, rollout
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError

ACCURATE, STABLE, DIVERGED, REFUSED, WRONG = "accurate", "stable", "diverged", "refused", "wrong"
OUTCOMES = (ACCURATE, STABLE, DIVERGED, REFUSED, WRONG)

COMPILING = 2e5
"""Number of interpreted force evaluations that take about as long as compiling."""
NEWTON = 30.0
"""Cost of an evaluation of an implicit method, relative to an explicit one, with Newton's iterations and algebra."""
LOOSE = 0.1
"""Largest share of what it bounds that a tolerance may have without a reason."""


@dataclass(frozen=True)
class Bound:
    """A tolerance of a hard case beside the size of what it bounds.

    Attributes:
        of: the quantity that is compared with its reference solution.
        tolerance, size: largest error allowed, and size of the quantity in the same unit.
        why: reason for a tolerance of more than LOOSE of the size; "" if there is none.
    """

    of: str
    tolerance: float
    size: float
    why: str = ""

    @property
    def share(self) -> float:
        """Tolerance as a share of what it bounds; 0 if nothing may differ."""
        return self.tolerance / self.size if self.tolerance else 0.0

    @property
    def loose(self) -> bool:
        """True if the tolerance is more than LOOSE of what it bounds, to three digits: one of LOOSE adds rounding."""
        return not self.share <= LOOSE * 1.001


@dataclass(frozen=True)
class Finding:
    """Result of one method in one hard case.

    Attributes:
        outcome: one of OUTCOMES.
        error, tolerance: largest error against the reference solution, and the tolerance that follows from the
            method's order, in the unit of the case; nan if there is none.
        note: further information; for a failure the reason.
        stop_time: time at which the run stopped early [s], else nan.
        bounds: every tolerance that the run was judged by, beside the size of what it bounds.
    """

    outcome: str
    error: float = math.nan
    tolerance: float = math.nan
    note: str = ""
    stop_time: float = math.nan
    bounds: tuple[Bound, ...] = ()


Try = Callable[[Method], Finding]
"""Test function of a hard case: it runs a method and judges the result."""
Rule = Callable[[Method], frozenset[str]]
"""Function that returns the outcomes that a method may have in a hard case."""


@dataclass(frozen=True)
class Case:
    """Hard case: a difficult simulation with a known truth and the outcomes that a method may have.

    Attributes:
        name: short unique name.
        group: kind of difficulty.
        why: a sentence on why the case is hard.
        truth: what the reference solution is, and what counts as stable.
        source: source of the reference solution: author, year, or the derivation.
        scene: the simulated scene.
        may: function that returns the outcomes a method may have. "refused" is not among them: it is right if and
            only if the scene does not meet a need of the method.
        attempt: test function, which runs a method that fits the scene and returns a Finding.
        long: True if the case takes more than a few seconds with most methods.
        motion: name of the motion in ``predictions.json`` whose error the case expects; "" if it tests no accuracy.
    """

    name: str
    group: str
    why: str
    truth: str
    source: str
    scene: Scene
    may: Rule
    attempt: Try
    long: bool = False
    motion: str = ""

    def tried(self, method: Method) -> Finding:
        """Run a method in this hard case and return its result; an exception counts as WRONG."""
        missing = method.needs - offers(self.scene)
        if missing:
            return self._refused(method, " and ".join(NEEDS.get(need, need) for need in sorted(missing)))
        try:
            return self.attempt(method)
        except (ArithmeticError, ValueError, RuntimeError, TypeError) as error:
            return Finding(WRONG, note=f"{type(error).__name__}: {error}")

    def _refused(self, method: Method, needs: str) -> Finding:
        """Check that a rollout refuses a method whose needs the scene does not meet.

        The outcome is REFUSED, or WRONG if the method runs. ``needs`` is the text of the unmet needs.
        """
        try:
            rollout(self.scene, integrator=method, duration=1e-3, dt=1e-3, backend="python", warn=False)
        except MethodError:
            return Finding(REFUSED, note=f"needs {needs}")
        return Finding(WRONG, note=f"it ran although the scene does not offer {needs}")

    def as_expected(self, method: Method, finding: Finding) -> bool:
        """Return True if an outcome is allowed for a method in this case, or is a refusal because of an unmet need."""
        unmet = finding.outcome == REFUSED and not method.needs <= offers(self.scene)
        return unmet or finding.outcome in self.may(method)


def named(method: Method) -> Method:
    """Return the package's method of a method's name, from which bounds are computed; itself if the name is its own.

    So a wrong step that runs under the name of another method does not set its own bounds.
    """
    return METHODS.get(method.name, method)


def always(*outcomes: str) -> Rule:
    """Return a function of a method that allows these outcomes for every method."""
    allowed = frozenset(outcomes)
    return lambda _method: allowed


def resolved(method: Method) -> frozenset[str]:
    """Return the outcomes allowed where steps resolve the motion: ACCURATE.

    STABLE is also allowed for methods of order 1, whose steps are too long for the tens of radians in these cases.
    """
    return frozenset({ACCURATE, STABLE} if method.order == 1 else {ACCURATE})


def known(allowed: Callable[[Method], float], most: float, *otherwise: str) -> Rule:
    """Return a function of a method that allows ACCURATE if its error bound is at most ``most``.

    If the bound is larger, the outcomes ``otherwise`` are allowed. ``allowed`` computes the error bound of a method.
    """
    return lambda method: frozenset({ACCURATE} if allowed(method) <= most else otherwise)


def sooner(method: Method, steps: float) -> Backend:
    """Return the backend that is faster for a run of ``steps`` steps, if the program is not compiled yet.

    Results are bit-identical with both backends.
    """
    work = steps * method.evaluations * (NEWTON if method.implicit else 1.0)
    return "python" if work < COMPILING else "auto"


def ran(scene: Scene, method: Method, *, dt: float, steps: int, **options: Any) -> Rollout:
    """Run a rollout of ``steps`` steps of ``dt`` [s]; ``options`` are further arguments of ``rollout``."""
    settings = {"backend": sooner(method, steps), "warn": False, **options}
    return rollout(scene, integrator=method, dt=dt, duration=steps * dt, **settings)


def stopped(run: Rollout) -> Finding | None:
    """Return the result (Finding) of a run that stopped early, or None for a complete run.

    The outcome is DIVERGED if the run reported divergence and all its values are finite, else WRONG.
    """
    if run.stop_reason != "diverged":
        return None if run.stop_reason == "" else Finding(WRONG, note=f"it stopped with the reason {run.stop_reason!r}")
    columns = (run.angle, run.velocity, run.energy, run.energy_residual)
    end = float(run.time[-1])
    if not all(np.all(np.isfinite(values)) for values in columns):
        return Finding(WRONG, note="it diverged and kept values that are not finite", stop_time=end)
    return Finding(DIVERGED, stop_time=end)


def judged(run: Rollout, error: Any, tolerance: float, wrong: str = "", *, size: float = 1.0,
           of: str = "the motion") -> Finding:
    """Judge a run by its errors: ACCURATE within ``tolerance``, else STABLE, or WRONG if ``wrong`` gives a reason.

    A run that stopped early is DIVERGED or WRONG whatever its error, see :func:`stopped`. ``size`` and ``of`` are those
    of :func:`graded`.
    """
    return stopped(run) or graded(error, tolerance, wrong, size=size, of=of)


def graded(error: Any, tolerance: float, wrong: str = "", note: str = "", *, size: float = 1.0,
           of: str = "the motion", why: str = "") -> Finding:
    """Judge errors: ACCURATE within ``tolerance``, else STABLE, or WRONG if ``wrong`` gives a reason.

    ``note`` is added to an outcome other than WRONG. Errors that are not finite are WRONG. ``of`` names the quantity
    that has these errors, and ``size`` is its size, 1 for relative errors; ``why`` is the reason for a tolerance of
    more than LOOSE of it.
    """
    largest, tolerance = float(np.max(np.abs(error))), float(tolerance)
    bounds = (Bound(of, tolerance, float(size), why),)
    if not math.isfinite(largest):
        note = "values are not finite although the run did not stop"
        return Finding(WRONG, largest, tolerance, note, bounds=bounds)
    if largest <= tolerance:
        return Finding(ACCURATE, largest, tolerance, note, bounds=bounds)
    return Finding(WRONG if wrong else STABLE, largest, tolerance, wrong or note, bounds=bounds)


def bounded(value: float, most: float, note: str, why: str) -> Finding:
    """Judge a value that may be anything up to ``most``: STABLE, else WRONG.

    ``note`` says what is bounded, and ``why`` that no more is known of it.
    """
    return Finding(STABLE if value <= most else WRONG, value, most, note, bounds=(Bound(note, most, most, why),))


def also(finding: Finding, *bounds: Bound) -> Finding:
    """Return a finding with further tolerances that the run was judged by."""
    return replace(finding, bounds=(*bounds, *finding.bounds))


def every(*findings: Finding) -> Finding:
    """Return the worst of several findings on one run, with the tolerances of all.

    WRONG is worst, then DIVERGED, STABLE and ACCURATE; of equal ones the error nearest to its tolerance.
    """
    def badness(one: Finding) -> tuple[int, float]:
        near = one.error / one.tolerance if one.tolerance > 0.0 else 0.0
        return OUTCOMES.index(one.outcome), near

    return replace(max(findings, key=badness), bounds=tuple(bound for one in findings for bound in one.bounds))


def check_unique(cases: tuple[Case, ...]) -> tuple[Case, ...]:
    """Return the hard cases unchanged; raises SceneError if two have one name."""
    names = [case.name for case in cases]
    repeated = {name for name in names if names.count(name) > 1}
    if repeated:
        raise SceneError(f"Two hard cases have the name {', '.join(sorted(repeated))}; names must differ.")
    return cases
