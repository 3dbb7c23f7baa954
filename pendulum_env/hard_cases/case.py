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
from functools import partial
from typing import Any

import numpy as np

from integrators import METHODS, Method, MethodError
from integrators.method import NEEDS
from pendulum_env.engine.kernels import Backend
from pendulum_env.engine.machine import ANGLE, INDEX, TURNS, TWO_PI, VELOCITY, Machine, offers
from pendulum_env.engine.rollout import Rollout, rollout
from pendulum_env.hard_cases.predicted import OFF, Motion
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import Effect
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError
from pendulum_env.truth.answer import Array

ACCURATE, STABLE, DIVERGED, REFUSED, WRONG = "accurate", "stable", "diverged", "refused", "wrong"
OUTCOMES = (ACCURATE, STABLE, DIVERGED, REFUSED, WRONG)

COMPILING = 2e5
"""Number of interpreted force evaluations that take about as long as compiling."""
NEWTON = 30.0
"""Cost of an evaluation of an implicit method, relative to an explicit one, with Newton's iterations and algebra."""
LOOSE = 0.1
"""Largest share of what it bounds that a tolerance may have without a reason."""
SMALL = 0.3
"""Largest allowed error, relative to the motion, of a run that counts as accurate."""
EARTH = 9.81
"""Gravity [m/s²]."""


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


class FindingError(Exception):
    """Raised to end the test of a method with a finding."""

    def __init__(self, finding: Finding) -> None:
        super().__init__(finding.note)
        self.finding = finding


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
        motion: the motion whose predicted error the case expects; None if it tests no accuracy.
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
    motion: Motion | None = None

    def tried(self, method: Method) -> Finding:
        """Run a method in this hard case and return its result; an exception counts as WRONG."""
        missing = method.needs - offers(self.scene)
        if missing:
            return self._refused(method, " and ".join(NEEDS.get(need, need) for need in sorted(missing)))
        try:
            return self.attempt(method)
        except FindingError as end:
            return end.finding
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


def unit(name: str, *effects: Effect, gravity: float = EARTH, **settings: Any) -> Scene:
    """Return a scene with a bob of 1 kg at 1 m, in which torques equal angular accelerations."""
    return Scene(name, Body(length=1.0, mass=1.0), effects=effects, gravity=gravity, **settings)


def run_of(scene: Scene, method: Method, *, dt: float, steps: int, **options: Any) -> Rollout:
    """Run a rollout of ``steps`` steps of ``dt`` [s], which may stop early.

    ``options`` are further arguments of ``rollout``.
    """
    settings = {"backend": sooner(method, steps), "warn": False, **options}
    return rollout(scene, integrator=method, dt=dt, duration=steps * dt, **settings)


def ran(scene: Scene, method: Method, *, dt: float, steps: int, **options: Any) -> Rollout:
    """Return a rollout as :func:`run_of` does; one that stops early ends the test, see :func:`stopped`."""
    run = run_of(scene, method, dt=dt, steps=steps, **options)
    ended = stopped(run)
    if ended is not None:
        raise FindingError(ended)
    return run


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


def demand(holds: Any, note: str, error: float = math.nan, tolerance: float = math.nan) -> None:
    """End the test of a method as WRONG, with the reason ``note``, unless something holds."""
    if not holds:
        raise FindingError(Finding(WRONG, error, tolerance, note))


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


# --- motions with predicted errors ----------------------------------------------------------------------------------


def expected(motion: Motion, method: Method) -> frozenset[str]:
    """Return the outcomes allowed for a method in a motion: ACCURATE where the allowed error is small, else STABLE.

    A run whose allowed error is larger than the motion may diverge, too.
    """
    most = motion.allowed(method)
    return frozenset({ACCURATE} if most <= SMALL else {STABLE} if most <= 1.0 else {STABLE, DIVERGED})


def held(motion: Motion, method: Method, error: Any, grain: float = 0.0) -> Finding:
    """Judge errors, relative to the motion's size: WRONG if the largest one is not the predicted error.

    A run whose error is as predicted is ACCURATE if that is small, else STABLE. ``grain`` is a rounding error that is
    allowed beside the usual one.
    """
    most, largest = motion.allowed(method) + grain, float(np.max(np.abs(error)))
    _, implied = motion.steps_and_error(method)
    known = motion.known(method)
    # A predicted error larger than the motion, as of a method that grows, is itself what the tolerance bounds.
    off = (Bound("the predicted error, relative to the motion", most - implied, max(1.0, implied)) if known
           else Bound("the motion, by the order", most, 1.0),)
    why, tolerance = "", most
    if not largest <= most:
        why = "its error exceeds that of its formula in exact arithmetic"
    elif known and largest < (1.0 - OFF) * implied - motion.rounding(method) - grain:
        why, tolerance = "its error is smaller than that of its formula in exact arithmetic", implied
    outcome = WRONG if why else ACCURATE if most <= SMALL else STABLE
    return Finding(outcome, largest, tolerance, why, bounds=off)


def followed(motion: Motion, method: Method, angle: Array, velocity: Array, grain: float = 0.0) -> Finding:
    """Judge angles [rad] and velocities [rad/s] at a motion's start and marks by their difference from the true ones.

    The largest one, relative to the motion's size, must be the predicted error, see :func:`held`.
    """
    true = motion.true()
    error = np.abs(angle - true[0])
    if not motion.angles:
        error = np.maximum(error, np.abs(velocity - true[1]) / motion.scene.omega0 / motion.pace)
    size = abs(math.pi - true[0][-1]) if motion.from_top else motion.largest
    return held(motion, method, error / size, grain)


def ran_motion(motion: Motion, method: Method, **options: Any) -> Rollout:
    """Run a method in a motion and return the run at its marks; one that stops early ends the test."""
    count, _ = motion.steps_and_error(method)
    h = motion.time / motion.marks / count / motion.scene.omega0
    return ran(motion.scene, method, dt=h, steps=count * motion.marks, every=count, angle=motion.angle,
               velocity=motion.velocity * motion.scene.omega0, **options)


def driven(motion: Motion, method: Method) -> tuple[Array, Array]:
    """Run a method under the torques of a motion; return angle [rad] and velocity [rad/s] at the start and the marks.

    A run that stops early ends the test as DIVERGED.
    """
    scene, (count, _) = motion.scene, motion.steps_and_error(method)
    h = motion.time / motion.marks / count / scene.omega0
    machine = Machine(scene, method, backend=sooner(method, count * motion.marks))
    full = next(effect.max_torque for effect in scene.effects if effect.controlled)  # type: ignore[attr-defined]
    share = scene.gravity * scene.weight_moment / full
    state = machine.state(motion.angle, motion.velocity * scene.omega0)
    rows = [(motion.angle, motion.velocity * scene.omega0)]
    for torque in motion.torques:
        if machine.advance(state, torque * share, h, count):
            raise FindingError(Finding(DIVERGED, stop_time=float(state[INDEX]) * h))
        rows.append((float(state[ANGLE]) + TWO_PI * float(state[TURNS]), float(state[VELOCITY])))
    angle, velocity = np.array(rows).T
    return angle, velocity


def follows(motion: Motion, method: Method, fault: Callable[[Rollout], None] | None = None, grain: float = 0.0,
            seed: int | None = None) -> Finding:
    """Judge a method in a motion by its error at the marks, which must be as predicted.

    ``fault`` looks at the run first, and demands what else must hold. ``grain`` is a further rounding error. With the
    ``seed`` of gusts the wind changes at each mark.
    """
    if motion.torques:
        return followed(motion, method, *driven(motion, method), grain)
    gusts = {} if seed is None else {"seed": seed, "substeps": motion.steps_and_error(method)[0]}
    run = ran_motion(motion, method, **gusts)
    if fault is not None:
        fault(run)
    return followed(motion, method, run.angle, run.velocity, grain)


def let_go_at(time: float, run: Rollout) -> None:
    """Demand that in a run dry friction holds the bob until a time [s], and not a step more."""
    before, after = run.time <= time, run.time > time + run.dt
    demand(not (np.any(run.velocity[before]) or np.any(run.angle[before])), "the bob starts to slide too early")
    demand(np.all(run.velocity[after] > 0.0), "the bob starts to slide too late")


def right(found: Finding) -> tuple[Bound, ...]:
    """Return the tolerances of a finding; one that is WRONG ends the test."""
    if found.outcome == WRONG:
        raise FindingError(found)
    return found.bounds


def then(first: Try, second: Try, method: Method) -> Finding:
    """Judge a method by ``second``, unless ``first`` finds it wrong or diverged.

    ``first`` tests a motion whose error is predicted; ``second`` a property, such as a growth or an angle at rest.
    """
    bounds = right(first(method))
    return also(second(method), *bounds)


def foreseen(group: str, motion: Motion, why: str, truth: str, source: str, attempt: Try | None = None,
             may: Rule | None = None, long: bool = False, name: str = "") -> Case:
    """Return a hard case in which a method must err as predicted in a motion, after which it is named by default.

    The outcomes are those of the predicted error, unless ``may`` gives others; ``attempt`` tests more than the error.
    """
    return Case(name or motion.name, group, why, truth, source, motion.scene, may or partial(expected, motion),
                attempt or partial(follows, motion), long, motion)


def check_unique(cases: tuple[Case, ...]) -> tuple[Case, ...]:
    """Return the hard cases unchanged; raises SceneError if two have one name."""
    names = [case.name for case in cases]
    repeated = {name for name in names if names.count(name) > 1}
    if repeated:
        raise SceneError(f"Two hard cases have the name {', '.join(sorted(repeated))}; names must differ.")
    return cases
