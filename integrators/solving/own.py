"""A user's step function as a method: its observed order, the known method that it equals, and usual mistakes.

The step is tried on the pendulum ``theta'' = -sin(theta) - gamma omega + F cos(2 t)``, with damping and drive if the
step takes velocity and time. Its order is the slope of log error against log step. It equals a method of
:data:`integrators.METHODS` if single steps of both agree. A step that does not follow the equation as dt goes to 0 is
refused; if it would equal a known method without one of :data:`MISTAKES`, the message says which.
"""

from __future__ import annotations

import inspect
import math
import re
import textwrap
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from integrators.errors import MethodError, shown
from integrators.families.own_step import OwnStep, StepFunction
from integrators.method import Method
from integrators.registry import ALIASES, METHODS
from integrators.solving.stepper import Step, stepper
from integrators.system import System

ARGUMENTS = "theta, omega, dt, acceleration"
DEGREE = math.pi / 180.0
GAMMA, FORCE, RATE = 0.25, 1.5, 2.0
"""Damping rate, and strength and rate of the drive, of the pendulum on which steps are tried."""
START = (0.25, 0.75, 0.5)
"""Time, angle and velocity at the start of the measurement of the order."""
SPAN, COUNTS = 1.0, (8, 16, 32, 64, 128)
"""Duration of that measurement, and its numbers of steps."""
ROUNDED = 1e-12
"""Smallest error from which an order is measured; smaller ones may be rounding."""
PROBES = ((0.25, 0.9, 0.7, 0.75), (0.5, -2.0, 1.1, 0.4), (0.0, 0.3, -1.6, 0.6))
"""Time, angle, velocity and step of the single steps that are compared: long steps, in which methods differ clearly."""
EQUAL = 1e-9
"""Largest difference of two steps that count as equal."""


def from_step(step: StepFunction | str, order: int | None = None) -> OwnStep:
    """Return a step that you wrote as a method, which everything takes that takes a method of this package.

    The method's ``summary`` says which known method the step equals, and its observed order.

    Args:
        step: function ``step(theta, omega, dt, acceleration)`` that returns the new ``(theta, omega)``; or the text of
            its definition; or the text of its lines alone, which change ``theta`` and ``omega``. It calls
            ``acceleration(theta, omega)`` for the angular acceleration [rad/s²] at the start of the step, and
            ``acceleration(theta, omega, dt/2)`` for that at the time dt/2 later. ``acceleration(theta)`` is for scenes
            without damping. Angles are in radians.
        order: the order that the step should have; None: the observed order.

    A step of arithmetic and of functions such as ``np.sin`` is compiled like any other method; one with ``if``,
    ``while`` or ``%`` is interpreted.

    Raises MethodError for a step that fails, that does not return two numbers, that never calls ``acceleration``, whose
    results differ between two equal calls, or that does not follow ``theta'' = acceleration`` as dt goes to 0; the
    message names usual mistakes. Also for an ``order`` above the observed one.
    """
    if order is not None and (isinstance(order, bool) or not isinstance(order, int) or order < 1):
        raise MethodError(f"order must be a whole number from 1, or None, not {shown(order)}.")
    function, name = _function_of(step)
    usage = _usage(function)
    observed = _observed_order(function, PLAIN)
    if not observed > 0.5:
        raise MethodError(f"{name}: {_diagnosis(function)}")
    reached = round(observed)
    if order is not None and order > reached:
        raise MethodError(f"{name}: the step has the observed order {observed:.2f}, not {shown(order)}; it "
                          f"{_likeness(function, usage, name, reached)[1]}.")
    known, likeness = _likeness(function, usage, name, reached)
    summary = f"{likeness}; {_orders(function, usage, observed)}"
    own = name if name not in METHODS and name not in ALIASES else f"own_{name}"
    area, back = _structure(function)
    method = OwnStep(
        name=own, order=reached if order is None else order, source="your own step", summary=summary, function=function,
        forces=usage.calls, takes_velocity=usage.velocity, preserves_area=area, reversible=back, equals=known,
        observed_order=observed,
    )
    # A step that asks for the type of its numbers may do something else with recording numbers.
    system = BOTH.system if usage.velocity else DRIVEN.system
    mine, theirs = _steps(_stepper(function, system)), _steps(stepper(method, system)[0])
    if mine is not None and theirs is not None and all(map(_near, mine, theirs)):
        return method
    return replace(method, recordable=False)


def _function_of(step: Any) -> tuple[StepFunction, str]:
    """Return a step function and its name, from a function or from the text of its lines; MethodError for others."""
    if isinstance(step, str):
        return _function_of(_written(step))
    if not callable(step):
        raise MethodError(f"step must be a function step({ARGUMENTS}) or the text of its lines, not {shown(step)}.")
    name = getattr(step, "__name__", "own_step")
    name = name if name.isidentifier() else "own_step"
    try:
        inspect.signature(step).bind(0.0, 0.0, 0.0, None)
    except TypeError:
        given = ", ".join(inspect.signature(step).parameters)
        raise MethodError(
            f"{name}: the step must take the four arguments ({ARGUMENTS}), not ({given}); acceleration(theta, omega) "
            "stands for the right side of your equation of motion."
        ) from None
    except ValueError:  # a function without a signature, written in C
        pass
    return step, name


def _written(text: str) -> Any:
    """Return the step function of a text: the function ``step`` that it defines, or one whose lines it is."""
    if re.search(r"^ *def ", text, flags=re.M):
        name, text = "step", textwrap.dedent(text)
    else:
        body = inspect.cleandoc(text).strip("\n").split("\n")
        name, text = "own_step", "\n    ".join([f"def own_step({ARGUMENTS}):", *body, "return theta, omega\n"])
    names: dict[str, Any] = {"np": np, "math": math}
    try:
        exec(compile(text, "<your step>", "exec"), names)
    except SyntaxError as error:
        raise MethodError(f"The lines of the step are not Python: {error}.") from None
    except (Exception, SystemExit) as error:  # sys.exit() in the text ends nothing but the text
        raise MethodError(f"The definition of the step failed with {type(error).__name__}: {error}.") from error
    if not callable(names.get(name)):
        raise MethodError(f"The text defines no function called step; begin it with def step({ARGUMENTS}):")
    return names[name]


# --- the step on a pendulum -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class StepCase:
    """A pendulum on which steps are tried; ``words`` say where a statement on it holds."""

    words: str
    gamma: float = 0.0
    force: float = 0.0

    @property
    def system(self) -> System:
        """The pendulum ``q'' = -sin(q) - gamma v + F cos(2 t)`` with what explicit and implicit methods may need."""
        gamma, strength = self.gamma, self.force

        def force(t: float, q: float) -> float:
            return strength * math.cos(RATE * t) - math.sin(q)

        flow = (lambda t, q, v, h: v * math.exp(-gamma * h)) if gamma else None
        return System(lambda t, q, v: force(t, q) - gamma * v, force, not gamma, flow,
                      jacobian=lambda t, q, v: (-math.cos(q), -gamma))


PLAIN = StepCase("without damping and drive")
DAMPED = StepCase("with damping", GAMMA)
DRIVEN = StepCase("with a drive", 0.0, FORCE)
BOTH = StepCase("with damping and drive", GAMMA, FORCE)


@dataclass(frozen=True)
class Usage:
    """What a step does with ``acceleration``.

    Attributes:
        calls: number of calls in one step.
        velocity, time: True if the step passes a velocity, and a time, to it.
    """

    calls: int
    velocity: bool
    time: bool


def _stepper(function: StepFunction, system: System) -> Step:
    """Return a user's step function on a system as ``step(t, q, v, h) -> (q, v)``, in floats."""

    def step(t: float, q: float, v: float, h: float) -> tuple[float, float]:
        def acceleration(theta: Any, omega: Any = v, after: Any = 0.0) -> Any:
            return system.acceleration(t + after, theta, omega)

        theta, omega = function(q, v, h, acceleration)
        return float(theta), float(omega)

    return step


def _usage(function: StepFunction) -> Usage:
    """Return what a step does with ``acceleration``; MethodError if it fails or returns no two numbers."""
    calls: list[tuple[Any, ...]] = []
    system = PLAIN.system

    def acceleration(theta: Any, *more: Any) -> Any:
        if len(more) > 2:
            raise MethodError(f"acceleration takes (theta, omega, time after the start), not {3 + len(more)} values.")
        calls.append((theta, *more))
        return system.acceleration(0.0, theta, 0.0)

    _, q, v = START
    results = []
    for _ in range(2):
        calls.clear()
        try:
            results.append(function(q, v, 0.125, acceleration))
        except MethodError:
            raise
        except (Exception, SystemExit) as error:
            raise MethodError(f"The step failed with {type(error).__name__}: {error}. It may use {ARGUMENTS}, and its "
                              "module's names; lines of text may use np and math.") from error
    try:
        pairs = [tuple(map(float, result)) for result in results]
        fine = all(len(pair) == 2 for pair in pairs)
    except (TypeError, ValueError):
        fine = False
    if not fine:
        raise MethodError(f"The step must return two numbers, the new theta and omega, not {shown(results[0])}.")
    if pairs[0] != pairs[1]:
        raise MethodError("The step must depend only on its arguments, but two equal calls gave "
                          f"{shown(pairs[0])} and {shown(pairs[1])}; a value must not be stored between steps.")
    if not calls:
        raise MethodError("The step never calls acceleration, so that it would move every scene in the same way; write "
                          "acceleration(theta, omega) in place of your formula for the angular acceleration.")
    return Usage(len(calls), any(len(call) > 1 for call in calls), any(len(call) > 2 for call in calls))


def _observed_order(function: StepFunction, case: StepCase) -> float:
    """Return the slope of log error against log step, at the shortest steps above rounding; 0 if steps diverge."""
    step, true_step = _stepper(function, case.system), stepper(METHODS["dop853"], case.system)[0]
    ends = [_end(step, count) for count in COUNTS]
    truth = _end(true_step, 4 * COUNTS[0])
    errors = [math.hypot(q - truth[0], v - truth[1]) for q, v in ends]
    usable = [error for error in errors if error > ROUNDED]
    if not all(map(math.isfinite, errors)):
        return 0.0
    if len(usable) < 2:
        return float(METHODS["dop853"].order)
    return math.log2(usable[-2] / usable[-1])


def _end(step: Step, count: int) -> tuple[float, float]:
    """Return the state after ``count`` equal steps over the time SPAN; nan where a step fails."""
    t, q, v = START
    h = SPAN / count
    try:
        for i in range(count):
            q, v = step(t + i * h, q, v, h)[:2]
    except (ArithmeticError, ValueError):
        return math.nan, math.nan
    return q, v


def _structure(function: StepFunction) -> tuple[bool, bool]:
    """Return whether a step on the undamped pendulum preserves areas, and whether a step of -h undoes one of h."""
    step, d = _stepper(function, PLAIN.system), 1e-4
    area = back = True
    for t, q, v, h in PROBES:
        try:
            (qa, va), (qb, vb) = step(t, q + d, v, h), step(t, q - d, v, h)
            (qc, vc), (qd, vd) = step(t, q, v + d, h), step(t, q, v - d, h)
            again = step(t + h, *step(t, q, v, h), -h)
        except (ArithmeticError, ValueError):
            return False, False
        area &= abs(((qa - qb) * (vc - vd) - (qc - qd) * (va - vb)) / (4 * d * d) - 1.0) < 1e-6
        back &= _near(again, (q, v))
    return bool(area), bool(back)


# --- known methods --------------------------------------------------------------------------------------------------


def _steps(step: Step) -> list[tuple[float, float]] | None:
    """Return the results of single steps from all PROBES; None if one fails."""
    try:
        return [step(t, q, v, h)[:2] for t, q, v, h in PROBES]
    except (ArithmeticError, ValueError, MethodError):
        return None


def _near(one: Sequence[float], other: Sequence[float]) -> bool:
    return all(abs(x - y) <= EQUAL * (1.0 + abs(y)) for x, y in zip(one, other, strict=True))


def _equal_methods(function: StepFunction, case: StepCase, order: int) -> Iterator[Method]:
    """Yield the one-step methods of an order that give the same single steps as the function."""
    system = case.system
    mine = _steps(_stepper(function, system))
    for method in METHODS.values():
        if mine is None or method.order != order or not method.one_step or not method.needs <= system.offers():
            continue
        theirs = _steps(_of_method(method, system))
        if theirs is not None and all(map(_near, mine, theirs)):
            yield method


def _of_method(method: Method, system: System) -> Step:
    """Return single steps ``step(t, q, v, h) -> (q, v)`` of a method, which computes its memory anew in each."""
    step, begin = stepper(method, system)
    return lambda t, q, v, h: step(t, q, v, *begin(t, q, v, h), h)[:2]


def _likeness(function: StepFunction, usage: Usage, name: str, order: int) -> tuple[str, str]:
    """Return the name of the known method that a step equals, and words on it; "" and words if there is none."""
    cases = [*([BOTH] if usage.velocity and usage.time else []), *([DAMPED] if usage.velocity else []),
             *([DRIVEN] if usage.time else []), PLAIN]
    for case in cases:
        found = next(_equal_methods(function, case, order), None)
        if found is not None:
            where = "" if case is cases[0] else f" {case.words}"
            claimed = ALIASES.get(name, name)
            other = f", not {claimed}, although it is called so" if claimed in METHODS and claimed != found.name else ""
            return found.name, f"equals {found.name}{where}{other}: {found.summary}"
    return "", "equals no method of this package"


def _orders(function: StepFunction, usage: Usage, observed: float) -> str:
    """Return a sentence on the observed order of a step, and on that with damping or drive if it is lower."""
    words = [f"observed order {observed:.2f}"]
    for case, advice in (
        (DAMPED, "in every call of acceleration, give the velocity that belongs to the angle there"),
        (DRIVEN, "in every call of acceleration, give as third argument the time since the start of the step"),
    ):
        if case is DAMPED and not usage.velocity:
            continue
        here = _observed_order(function, case)
        if here < observed - 0.5:
            words.append(f"only {here:.2f} {case.words}: {advice}")
    return "; ".join(words)


# --- mistakes -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Mistake:
    """A mistake in a step, and the change of the step that takes it back.

    Attributes:
        words: what is wrong and how to correct it.
        acceleration: function ``(acceleration, dt) -> acceleration`` that corrects what the step calls.
        result: function ``(theta, omega, dt, end) -> (theta, omega)`` that corrects what the step returns.
    """

    words: str
    acceleration: Callable[[Callable[..., Any], float], Callable[..., Any]] | None = None
    result: Callable[[float, float, float, tuple[float, float]], tuple[float, float]] | None = None

    def corrected(self, function: StepFunction) -> StepFunction:
        """Return the step without this mistake."""

        def step(theta: Any, omega: Any, dt: Any, acceleration: Callable[..., Any]) -> Any:
            changed = acceleration if self.acceleration is None else self.acceleration(acceleration, dt)
            end = tuple(map(float, function(theta, omega, dt, changed)))
            return end if self.result is None else self.result(theta, omega, dt, (end[0], end[1]))

        return step


MISTAKES = (
    Mistake("the velocity changes by acceleration instead of acceleration*dt: multiply by dt",
            acceleration=lambda a, dt: lambda *x: a(*x) * dt),
    Mistake("the angle changes by omega instead of omega*dt: multiply by dt",
            result=lambda q, v, dt, end: (q + (end[0] - q) * dt, end[1])),
    Mistake("dt is missing in both lines: the angle must change by omega*dt and the velocity by acceleration*dt",
            acceleration=lambda a, dt: lambda *x: a(*x) * dt,
            result=lambda q, v, dt, end: (q + (end[0] - q) * dt, end[1])),
    Mistake("the acceleration is subtracted: it already has its sign, so add it",
            acceleration=lambda a, dt: lambda *x: -a(*x)),
    Mistake("the angle is converted from degrees to radians, but theta is in radians already: leave the conversion out",
            acceleration=lambda a, dt: lambda theta, *x: a(theta / DEGREE, *x)),
    Mistake("the angle is converted from radians to degrees, but acceleration takes radians: leave the conversion out",
            acceleration=lambda a, dt: lambda theta, *x: a(theta * DEGREE, *x)),
    Mistake("the step works in degrees, but theta, omega and acceleration are in radians: leave the conversions out",
            acceleration=lambda a, dt: lambda theta, *x: a(theta / DEGREE, *x) * DEGREE),
    Mistake("the velocity is computed in degrees, but theta and omega are in radians: leave the conversion out",
            acceleration=lambda a, dt: lambda *x: a(*x) * DEGREE),
    Mistake("the angle is computed in degrees, but theta and omega are in radians: leave the conversion out",
            result=lambda q, v, dt, end: (end[0] * DEGREE, end[1])),
    Mistake("the change of the angle is converted to degrees, but theta is in radians: leave the conversion out",
            result=lambda q, v, dt, end: (q + (end[0] - q) * DEGREE, end[1])),
    Mistake("the velocity changes by acceleration*dt**2 instead of acceleration*dt: multiply by dt once",
            acceleration=lambda a, dt: lambda *x: a(*x) / dt),
    Mistake("both lines go back in time, which does not make the step a backward Euler: that has plus signs too, and "
            "takes omega and acceleration at the end of the step",
            result=lambda q, v, dt, end: (2.0 * q - end[0], 2.0 * v - end[1])),
    Mistake("the step returns the changes of theta and omega: return theta + change, omega + change",
            result=lambda q, v, dt, end: (q + end[0], v + end[1])),
    Mistake("the results are in the wrong order: return theta, omega", result=lambda q, v, dt, end: (end[1], end[0])),
)
"""Usual mistakes in a step."""


def _diagnosis(function: StepFunction) -> str:
    """Return what is wrong with a step that does not follow the equation of motion as dt goes to 0."""
    for mistake in MISTAKES:
        corrected = mistake.corrected(function)
        observed = _observed_order(corrected, PLAIN)
        found = next(_equal_methods(corrected, PLAIN, round(observed)), None) if observed > 0.5 else None
        if found is not None:
            return f"{mistake.words}. The step then equals {found.name}: {found.summary}."
    _, q, v = START
    end = _steps(_stepper(function, PLAIN.system))
    if end is None:
        return "the step fails on a pendulum with numbers of the size 1."
    dt = 2.0**-20
    theta, omega = _stepper(function, PLAIN.system)(0.0, q, v, dt)
    a = -math.sin(q)
    return (f"as dt goes to 0 the step does not follow theta'' = acceleration. From theta = {q} and omega = {v}, where "
            f"acceleration is {a:.4g}, theta changes by {(theta - q) / dt:.4g} dt instead of {v} dt, and omega by "
            f"{(omega - v) / dt:.4g} dt instead of {a:.4g} dt.")
