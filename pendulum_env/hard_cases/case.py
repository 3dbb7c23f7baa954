"""What a hard case is: why it is hard, its truth with a source, and what each kind of method must do, written before.

A case is tried with one method at a time and ends in one of five ways::

    accurate   the truth is met to what the method's own order leaves
    stable     bounded and of the right kind, not accurate; what that means stands in the case
    diverged   the run stopped and said so, with its last finite state kept
    refused    the scene does not offer what the method declares that it needs
    wrong      finite and false, or a crash: a failure, whatever the method
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from integrators import Method, MethodError
from integrators.method import NEEDS
from pendulum_env.engine.kernels import Backend
from pendulum_env.engine.machine import offers
from pendulum_env.engine.rollout import Rollout, rollout
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError

ACCURATE, STABLE, DIVERGED, REFUSED, WRONG = "accurate", "stable", "diverged", "refused", "wrong"
OUTCOMES = (ACCURATE, STABLE, DIVERGED, REFUSED, WRONG)

COMPILING = 2e5
"""Force evaluations that take about as long interpreted as compiling does."""
NEWTON = 30.0
"""How much dearer an evaluation of an implicit method is: its sweeps, and its algebra."""


@dataclass(frozen=True)
class Finding:
    """How one method did in one case.

    Attributes:
        outcome: one of OUTCOMES.
        error, tolerance: the largest error against the truth, and what the method's own order leaves of it; nan where
            there is none. Their unit is the case's.
        note: what else there is to say; of a failure what was wrong.
        stop_time: when a run that stopped did so [s], else nan.
    """

    outcome: str
    error: float = math.nan
    tolerance: float = math.nan
    note: str = ""
    stop_time: float = math.nan


Try = Callable[[Method], Finding]
Rule = Callable[[Method], frozenset[str]]


@dataclass(frozen=True)
class Case:
    """One hard case.

    Attributes:
        name: unique, short.
        group: which kind of difficulty.
        why: why it is hard, a sentence.
        truth: what the truth is, and what counts as stable.
        source: where the truth comes from: author, year, or the derivation.
        scene: what is simulated.
        may: the outcomes that a method of this kind may have, written down before any run; "refused" need not be
            there: it is right where, and only where, the scene does not offer what the method needs.
        attempt: runs a method that fits, and judges it.
        long: takes more than a few seconds with most methods.
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

    def tried(self, method: Method) -> Finding:
        """What becomes of a method; a crash is a finding, too."""
        missing = method.needs - offers(self.scene)
        if missing:
            return self._refused(method, " and ".join(NEEDS.get(need, need) for need in sorted(missing)))
        try:
            return self.attempt(method)
        except (ArithmeticError, ValueError, RuntimeError, TypeError) as error:
            return Finding(WRONG, note=f"{type(error).__name__}: {error}")

    def _refused(self, method: Method, needs: str) -> Finding:
        """A need that is not met has to be refused by name, when the run is asked for."""
        try:
            rollout(self.scene, integrator=method, duration=1e-3, dt=1e-3, backend="python", warn=False)
        except MethodError:
            return Finding(REFUSED, note=f"needs {needs}")
        return Finding(WRONG, note=f"ran although the scene does not offer what it needs: {needs}")

    def as_expected(self, method: Method, finding: Finding) -> bool:
        """True if the outcome is one that was written down for this kind of method, or a refusal for an unmet need."""
        unmet = finding.outcome == REFUSED and not method.needs <= offers(self.scene)
        return unmet or finding.outcome in self.may(method)


def always(*outcomes: str) -> Rule:
    """The same for every method."""
    allowed = frozenset(outcomes)
    return lambda _method: allowed


def resolved(method: Method) -> frozenset[str]:
    """Order 1 cannot follow tens of radians with the steps that the others take: it may be just stable."""
    return frozenset({ACCURATE, STABLE} if method.order == 1 else {ACCURATE})


def known(allowed: Callable[[Method], float], most: float, *otherwise: str) -> Rule:
    """ACCURATE where the error that the method's order leaves is at most ``most``; else it says no more of errors, and
    the outcome must be one of the others."""
    return lambda method: frozenset({ACCURATE} if allowed(method) <= most else otherwise)


def sooner(method: Method, steps: float) -> Backend:
    """The backend that is sooner done with a run of so many steps where nothing is compiled yet; same bits."""
    work = steps * method.evaluations * (NEWTON if method.implicit else 1.0)
    return "python" if work < COMPILING else "auto"


def ran(scene: Scene, method: Method, *, dt: float, steps: int, **options: Any) -> Rollout:
    """A rollout of so many steps of ``dt`` [s]."""
    chosen = {"backend": sooner(method, steps), "warn": False, **options}
    return rollout(scene, integrator=method, dt=dt, duration=steps * dt, **chosen)


def stopped(run: Rollout) -> Finding | None:
    """DIVERGED for a run that named its divergence and kept a finite state, WRONG for one that kept none; else None."""
    if run.stop_reason != "diverged":
        return None if run.stop_reason == "" else Finding(WRONG, note=f"it stopped as {run.stop_reason!r}")
    kept = (run.angle, run.velocity, run.energy, run.energy_residual)
    end = float(run.time[-1])
    if not all(np.all(np.isfinite(values)) for values in kept):
        return Finding(WRONG, note="it diverged and kept values that are not finite", stop_time=end)
    return Finding(DIVERGED, stop_time=end)


def judged(run: Rollout, error: Any, tolerance: float, wrong: str = "") -> Finding:
    """A run by its errors: accurate within ``tolerance``; else stable, or wrong if ``wrong`` says why.

    A run that stopped is judged by :func:`stopped`, and its error not looked at.
    """
    return stopped(run) or graded(error, tolerance, wrong)


def graded(error: Any, tolerance: float, wrong: str = "", note: str = "") -> Finding:
    """The same of errors by themselves, whatever they were found from; ``note`` is said of what is not wrong."""
    largest, tolerance = float(np.max(np.abs(error))), float(tolerance)
    if not math.isfinite(largest):
        return Finding(WRONG, largest, tolerance, "values that are not finite came without a stop")
    if largest <= tolerance:
        return Finding(ACCURATE, largest, tolerance, note)
    return Finding(WRONG if wrong else STABLE, largest, tolerance, wrong or note)


def check_unique(cases: tuple[Case, ...]) -> tuple[Case, ...]:
    """The cases; SceneError if two have one name."""
    names = [case.name for case in cases]
    twice = {name for name in names if names.count(name) > 1}
    if twice:
        raise SceneError(f"Two hard cases are named {', '.join(sorted(twice))}; names must differ.")
    return cases
