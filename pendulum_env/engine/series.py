"""Generated source of the Taylor coefficients of a scene's motion.

The torque functions of the effects are called once with objects that behave as numbers and record all operations
(:mod:`integrators.steps.tracing`); the recorded operations become recurrences in straight-line code
(:mod:`integrators.steps.recurrences`). Effects need no code of their own for their Taylor series.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cache, reduce
from operator import add
from types import FunctionType
from typing import Any

from integrators.families.taylor import add_twins, results_of_series
from integrators.steps.recurrences import CALLS, RecurrenceWriter, times_reciprocal
from integrators.steps.tracing import Symbol, Trace, TraceError, cos, exp, log, power, sin, tanh
from pendulum_env.engine.problem import Problem, moving, slipping
from pendulum_env.engine.reading import arguments
from pendulum_env.engine.source import Plain, names_of, with_callees
from pendulum_env.physics import elementary
from pendulum_env.physics.effects import Effect

RECORDED: dict[Plain, Plain] = {
    elementary.sin: sin, elementary.cos: cos, elementary.exp: exp, elementary.log: log, elementary.power: power,
    elementary.tanh: tanh
}
"""Elementary function that torques call -> the function that records its call instead of computing its value."""
WRITTEN = {**CALLS, "sqrt": "power({}, 0.5)"}
"""Name of a recorded operation -> its source in a generated program."""
SINGULAR = {"log": "logarithm", "power": "power", "sqrt": "root"}
"""Functions without a Taylor series at 0, the value of the speed at every turning point -> their names in messages."""
QUARTER = 1.5707963267948966


class TorqueTracer:
    """Arguments for torque functions that record all operations with them, to derive the torque's Taylor series.

    Time, angle and velocity vary along a step (with ``still`` only the time); all other arguments are constants.
    """

    def __init__(self, periodic: bool, still: bool = False, trace: Trace | None = None) -> None:
        self.trace = Trace() if trace is None else trace
        self.periodic = periodic
        q, v = (self.trace.leaf("steady", name) if still else self.trace.leaf(name, 0) for name in "qv")
        self.named: dict[str, Symbol] = {"time": self.trace.leaf("t"), "tilt": q, "velocity": v, "slip": v}

    def get(self, name: str) -> Symbol:
        """Return the recording argument that stands for a torque function's parameter ``name``.

        The parameter "angle" is the angle from the bottom.
        """
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

    def call(self, function: Plain) -> Symbol:
        """Return the recorded result of a torque function. Raises TypeError if an operation cannot be recorded."""
        recorded = _recording(with_callees([function])[-1])
        result = self.trace.lift(recorded(*map(self.get, arguments(function))))
        if result is None:
            raise TraceError("a result that is not a number cannot be recorded")
        return result

    def value(self, place: int) -> str:
        """Return the source text of the constant that was recorded as operation number ``place``."""
        value = self.trace.operations[place].value
        return value if isinstance(value, str) else repr(float(value))


def _recording(function: Plain) -> Plain:
    """Return a copy of a torque function that records its calls of elementary functions, such as sin."""
    if function in RECORDED:
        return RECORDED[function]
    if not isinstance(function, FunctionType):
        return function
    named = {name: function.__globals__[name] for name in names_of(function.__code__) if name in function.__globals__}
    replaced = {name: _recording(value) for name, value in named.items() if isinstance(value, FunctionType)}
    return FunctionType(function.__code__, {**function.__globals__, **replaced}, function.__name__)


@cache
def _fault(function: Plain, periodic: bool) -> str:
    """Return the reason why a torque function has no Taylor series at velocity 0, or "" if it has one."""
    tracer = TorqueTracer(periodic)
    try:
        tracer.call(function)
    except (TypeError, AttributeError, ValueError) as fault:
        return str(fault)
    sizes: set[int] = set()
    for place, operation in enumerate(tracer.trace.operations):
        if operation.name == "abs" or not sizes.isdisjoint(operation.operands):
            sizes.add(place)
            if operation.name in SINGULAR:
                return f"a {SINGULAR[operation.name]} of the speed is taken, which has no series at rest"
    return ""


def untraceable(effects: Iterable[Effect], periodic: bool) -> str:
    """Return a sentence that names the first effect without a Taylor series and the reason; "" if there is none."""
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
    """Return the source lines of a time derivative, and the name of the variable that they set.

    It is the derivative, at a fixed angle, of the sum of the given functions.
    """
    tracer = TorqueTracer(periodic, still=True)
    total: Any = reduce(add, (tracer.call(function) for function in functions if function))
    add_twins(tracer.trace)
    writer = RecurrenceWriter(tracer.trace, [], tracer.value, WRITTEN, times_reciprocal)
    writer.write(2, 0)
    return _with_one(writer.lines), writer.coefficient(total, 1)


def _with_one(lines: Sequence[str]) -> list[str]:
    """Return the source lines, preceded by ``one = 1.0`` (the derivative of the time by itself) if they use this name.
    """
    return [*(["one = 1.0"] if any("one" in line for line in lines) else []), *lines]


def series(problem: Problem) -> str:
    """Write the source of ``series``: the Taylor coefficients of the motion and of the quadratures."""
    order, shape = problem.method.order, problem.shape
    tracer = TorqueTracer(shape.periodic)
    torques = {effect.name: tracer.call(effect.torque) for effect in problem.torques if effect.torque}
    total: Any = reduce(add, torques.values()) if torques else tracer.trace.leaf("steady", 0.0)
    if shape.slides:
        total = total - tracer.get("direction") * tracer.get(shape.dry)
    rates = _rates(problem, tracer, torques)
    add_twins(tracer.trace)
    writer = RecurrenceWriter(tracer.trace, [total], tracer.value, WRITTEN, times_reciprocal)
    writer.write(order, order)
    results = [writer.of_motion("q", 0, k) for k in range(2, order + 1)]
    results += [writer.of_motion("v", 0, k) for k in range(1, order + 1)]
    for rate in rates.values():
        places = [(writer.coefficient(rate, k), k + 1) for k in range(order)]
        results += [times_reciprocal(text, k) if k > 1 and text != "0" else text for text, k in places]
    names = results_of_series(order, list(rates))
    ends = [f"{name} = {'0.0' if text == '0' else text}" for name, text in zip(names, results, strict=True)]
    lines = [*_with_one(writer.lines), *ends, f"return {', '.join(names)}"]
    return problem.define("series", "t, q, v", lines, problem.shape.forces)


def _rates(problem: Problem, tracer: TorqueTracer, torques: Mapping[str, Symbol]) -> dict[str, Symbol]:
    """Return the rates of the quadratures: for work the power of the drives, for heat minus the power of the drags.

    The powers are torque times velocity, as recorded expressions by name of the quadrature.
    """
    rates: dict[str, Symbol] = {}
    for name in problem.shape.quadratures:
        work = name == "work"
        chosen = problem.drives if work else [effect for effect in problem.drags if problem.heat_of(effect) == name]
        terms = [torques[effect.name] for effect in chosen]
        if problem.shape.slides and problem.heat_of(problem.dry) == name:
            terms.append(-tracer.get("direction") * tracer.get(problem.shape.dry))
        power = tracer.get("velocity") * reduce(add, terms)
        rates[name] = power if work else -power
    return rates
