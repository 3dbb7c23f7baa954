"""Taylor coefficients of a scene's motion as source, from the plain functions of its effects alone.

Their torques are run once with numbers that record what is done with them (:mod:`integrators.steps.tracing`); the
recorded operations become straight lines (:mod:`integrators.steps.recurrences`). Nothing is known here of any single
effect.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cache, reduce
from operator import add
from types import FunctionType
from typing import Any

from integrators.families.taylor import add_twins, results_of_series
from integrators.steps.recurrences import CALLS, Writer, times_reciprocal
from integrators.steps.tracing import Trace, Traced, TraceError, cos, exp, log, power, sin
from pendulum_env.engine.problem import Problem, moving, slipping
from pendulum_env.engine.source import Plain, arguments
from pendulum_env.physics import elementary
from pendulum_env.physics.effects import Effect

RECORDED: dict[Plain, Plain] = {
    elementary.sin: sin, elementary.cos: cos, elementary.exp: exp, elementary.log: log, elementary.power: power
}
"""Functions of effects -> those that record."""
WRITTEN = {**CALLS, "sqrt": "power({}, 0.5)"}
SINGULAR = {"log": "logarithm", "power": "power", "sqrt": "root"}
"""Functions that have no Taylor series where their argument is 0, as a speed is at every turning point."""
QUARTER = 1.5707963267948966


class Recorder:
    """The numbers that torques are called with, by name: the motion, and symbols that stay as they are in a step.

    With ``still`` the time alone moves on.
    """

    def __init__(self, periodic: bool, still: bool = False) -> None:
        self.trace = Trace()
        self.periodic = periodic
        q, v = (self.trace.leaf("steady", name) if still else self.trace.leaf(name, 0) for name in "qv")
        self.named: dict[str, Traced] = {"time": self.trace.leaf("t"), "tilt": q, "velocity": v, "slip": v}

    def get(self, name: str) -> Traced:
        """The number of this name; the angle is that from the bottom."""
        if name not in self.named:
            if name == "speed":
                self.named[name] = abs(self.get("velocity"))
            elif name == "angle":
                turned = (1.0 - self.get("side")) * QUARTER
                self.named[name] = self.get("tilt") + turned if self.periodic else self.get("tilt")
            else:
                fixed = name == "side" and not self.periodic
                self.named[name] = self.trace.leaf("steady", "1.0" if fixed else name)
        return self.named[name]

    def call(self, function: Plain) -> Traced:
        """What a torque makes of them; TypeError where it does more than can be recorded."""
        found = self.trace.lift(_recording(function)(*(self.get(name) for name in arguments(function))))
        if found is None:
            raise TraceError("a result that is no number cannot be recorded")
        return found

    def value(self, place: int) -> str:
        """A steady leaf as source."""
        value = self.trace.operations[place].value
        return value if isinstance(value, str) else repr(float(value))


def _recording(function: Plain) -> Plain:
    """A plain function with those that it calls replaced by such as record."""
    if function in RECORDED:
        return RECORDED[function]
    if not isinstance(function, FunctionType):
        return function
    named = {name: function.__globals__[name] for name in function.__code__.co_names if name in function.__globals__}
    replaced = {name: _recording(value) for name, value in named.items() if isinstance(value, FunctionType)}
    return FunctionType(function.__code__, {**function.__globals__, **replaced}, function.__name__)


@cache
def _fault(function: Plain, periodic: bool) -> str:
    """Why a torque cannot be recorded, or ""."""
    recorder = Recorder(periodic)
    try:
        recorder.call(function)
    except (TypeError, AttributeError, ValueError) as fault:
        return str(fault)
    sizes: set[int] = set()
    for place, operation in enumerate(recorder.trace.operations):
        if operation.name == "abs" or not sizes.isdisjoint(operation.operands):
            sizes.add(place)
            if operation.name in SINGULAR:
                return f"a {SINGULAR[operation.name]} of the speed is taken, which has no series at rest"
    return ""


def untraceable(effects: Iterable[Effect], periodic: bool) -> str:
    """Which effect has no Taylor series and why, as a sentence; "" if all have."""
    effects = tuple(effects)
    if moving(effects):
        drag = next(effect.name for effect in effects if slipping(effect))
        mover = next(effect.name for effect in effects if effect.wind_x or effect.wind_y)
        return f"The torque of {drag} has no Taylor series at rest in the medium that {mover} moves."
    for effect in effects:
        if effect.torque and (fault := _fault(effect.torque, periodic)):
            return f"The torque of {effect.name} has no Taylor series: in it, {fault}."
    return ""


def by_time(functions: Iterable[Plain | None], periodic: bool) -> tuple[list[str], str]:
    """Return the derivative by time of a sum of functions in one place: lines before it, and its name."""
    recorder = Recorder(periodic, still=True)
    total: Any = reduce(add, (recorder.call(function) for function in functions if function))
    add_twins(recorder.trace)
    writer = Writer(recorder.trace, [], recorder.value, WRITTEN, times_reciprocal)
    writer.write(2, 0)
    return _with_one(writer.lines), writer.coefficient(total, 1)


def _with_one(lines: Sequence[str]) -> list[str]:
    """Return the lines, after the rate of time where they name it."""
    return [*(["one = 1.0"] if any("one" in line for line in lines) else []), *lines]


def series(problem: Problem) -> str:
    """Write the Taylor coefficients of the motion and of the quadratures."""
    order, shape = problem.method.order, problem.shape
    recorder = Recorder(shape.periodic)
    torques = {effect.name: recorder.call(effect.torque) for effect in problem.torques if effect.torque}
    total: Any = reduce(add, torques.values()) if torques else recorder.trace.leaf("steady", 0.0)
    if shape.slides:
        total = total - recorder.get("direction") * recorder.get(shape.dry)
    rates = _rates(problem, recorder, torques)
    add_twins(recorder.trace)
    writer = Writer(recorder.trace, [total], recorder.value, WRITTEN, times_reciprocal)
    writer.write(order, order)
    results = [writer.of_motion("q", 0, k) for k in range(2, order + 1)]
    results += [writer.of_motion("v", 0, k) for k in range(1, order + 1)]
    for rate in rates.values():
        places = [(writer.coefficient(rate, k), k + 1) for k in range(order)]
        results += [times_reciprocal(text, k) if k > 1 and text != "0" else text for text, k in places]
    names = results_of_series(order, list(rates))
    ends = [f"{name} = {'0.0' if text == '0' else text}" for name, text in zip(names, results, strict=True)]
    lines = [*_with_one(writer.lines), *ends, f"return {', '.join(names)}"]
    return problem.define("series", "t, q, v", lines, problem.forces)


def _rates(problem: Problem, recorder: Recorder, torques: Mapping[str, Traced]) -> dict[str, Traced]:
    """Return the quadratures' rates: torque times velocity, from the torques by effect."""
    rates: dict[str, Traced] = {}
    for name in problem.shape.quadratures:
        work = name == "work"
        chosen = problem.drives if work else [effect for effect in problem.drags if problem.heat_of(effect) == name]
        terms = [torques[effect.name] for effect in chosen]
        if problem.shape.slides and problem.heat_of(problem.dry) == name:
            terms.append(-recorder.get("direction") * recorder.get(problem.shape.dry))
        power = recorder.get("velocity") * reduce(add, terms)
        rates[name] = power if work else -power
    return rates
