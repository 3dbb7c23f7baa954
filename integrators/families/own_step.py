"""A step that a user wrote as a Python function, as a method: ``step(theta, omega, dt, acceleration)``.

The function is run once with numbers that record what is done with them, and the record is written as the source of the
step. A function whose course depends on its numbers (``if theta > pi``, ``while``, ``%``) has no such record; its step
calls the function itself, and can be interpreted but not compiled.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from hashlib import sha256
from types import CodeType
from typing import Any, ClassVar

from integrators.method import Method, System
from integrators.steps.straight_line import ATOM, Record, StraightLine
from integrators.steps.terms import Notation, definition
from integrators.steps.tracing import Symbol

StepFunction = Callable[[Any, Any, Any, Callable[..., Any]], Any]
"""``step(theta, omega, dt, acceleration) -> (theta, omega)``."""
CALLED = "own_step"
"""Name of the user's function in a step that calls it."""


class UnrecordableError(Exception):
    """Raised for a step function whose operations cannot be recorded once for all numbers."""


def _content(code: CodeType) -> tuple[Any, ...]:
    """Return what a function's code does: its instructions, constants and names, inner functions included."""
    constants = tuple(_content(one) if isinstance(one, CodeType) else one for one in code.co_consts)
    return code.co_code, constants, code.co_names


@dataclass(frozen=True, kw_only=True, repr=False)
class OwnStep(Method):
    """A method whose step is a user's function; :func:`integrators.from_step` makes it and measures its properties.

    Work and heat are integrated by a quadrature on the ends of each step: the trapezoidal rule, and for orders above 2
    Simpson's rule, with the middle of the step from the cubic through both ends.

    Attributes:
        function: ``step(theta, omega, dt, acceleration)``, see :func:`integrators.from_step`.
        forces: number of calls of ``acceleration`` in one step.
        takes_velocity: True if the step passes a velocity to ``acceleration``.
        preserves_area, reversible: True if the step was observed to be symplectic, and to be symmetric.
        recordable: False if the function does something else with recording numbers than with floats.
        equals: name of the method of this package that gives the same steps, "" for none.
        observed_order: slope of log error against log step, measured on a pendulum.
        digest: short text that differs between different steps.
    """

    function: StepFunction
    forces: int
    takes_velocity: bool
    preserves_area: bool = False
    reversible: bool = False
    recordable: bool = True
    equals: str = ""
    observed_order: float = 0.0
    digest: str = field(init=False, compare=False)

    family: ClassVar[str] = "own step"

    def __post_init__(self) -> None:
        super().__post_init__()
        code = getattr(self.function, "__code__", None)
        own = _content(code) if code is not None else self.function
        text = "\n".join(self.recorded or ()) or repr(own)
        object.__setattr__(self, "digest", sha256(text.encode()).hexdigest()[:12])

    def __repr__(self) -> str:
        return f"OwnStep({self.name!r}, order {self.order}, {self.summary!r}, {self.digest})"

    @property
    def fingerprint(self) -> str:
        return f"{type(self).__name__} {self.name} {self.digest}"

    @cached_property
    def recorded(self) -> tuple[str, ...] | None:
        """The lines of the step in double precision; None if its operations cannot be recorded."""
        try:
            return tuple(recorded_lines(self.function, Notation())) if self.recordable else None
        except UnrecordableError:
            return None

    @property
    def needs(self) -> frozenset[str]:
        return frozenset({"acceleration", *(() if self.takes_velocity else ("velocity_free",))})

    @property
    def evaluations(self) -> int:
        return self.forces

    @property
    def symplectic(self) -> bool:
        return self.preserves_area

    @property
    def symmetric(self) -> bool:
        return self.reversible

    @property
    def remark(self) -> str:
        rule = "the trapezoidal rule" if self.order <= 2 else "Simpson's rule"
        how = "" if self.recorded is not None else " Its steps are interpreted, which is slower than compiled ones."
        return f"{self.name} {self.summary}. Work and heat are computed by {rule} from the ends of each step.{how}"

    @property
    def rounding(self) -> Fraction:
        """Size of the rounding of a step's constants, which are floats such as 1/6."""
        return Fraction(1, 10**12)

    @property
    def python_functions(self) -> Mapping[str, Callable[..., Any]]:
        return {} if self.recorded is not None else {CALLED: self.function}

    def functions(self, system: System, like: Any) -> Mapping[str, Callable[..., Any]]:
        return self.python_functions

    def calls(self, quadratures: bool, adaptive: bool) -> tuple[str, ...]:
        return ("acceleration", *(("rates",) if quadratures else ()))

    def write_step(self, notation: Notation) -> str:
        lines = called_lines(notation) if self.recorded is None else recorded_lines(self.function, notation)
        sums = self._quadratures(notation)
        results = ["q_end", "v_end", *(f"sum_{name}" for name in notation.quadratures)]
        lines = [*lines, *sums, f"return {', '.join(results)}"]
        return definition(f"step(t, q, v, h{notation.more})", self.title, lines)

    def _quadratures(self, notation: Notation) -> list[str]:
        """Return the source lines that integrate work and heat over a step, from the states at both of its ends."""
        names, number, more = notation.quadratures, notation.number, notation.more
        if not names:
            return []
        half, quarter, eighth = (number(Fraction(1, n)) for n in (2, 4, 8))
        places = [("0", "t, q, v", Fraction(1, 2)), ("1", "t + h, q_end, v_end", Fraction(1, 2))]
        lines = []
        if self.order > 2:
            places = [("0", places[0][1], Fraction(1, 6)), ("1", places[1][1], Fraction(1, 6)),
                      ("_middle", f"t + {half}*h, q_middle, v_middle", Fraction(2, 3))]
            lines = [f"q_middle = {half}*(q + q_end) + {eighth}*h*(v - v_end)",
                     f"v_middle = {number(Fraction(3, 2))}*(q_end - q)/h - {quarter}*(v + v_end)"]
        for end, arguments, _ in places:
            lines.append(f"{', '.join(['_', *(f'{name}{end}' for name in names)])} = rates({arguments}{more})")
        for name in names:
            terms = " + ".join(f"{number(weight)}*{name}{end}" for end, _, weight in places)
            lines.append(f"sum_{name} = h*({terms})")
        return lines


def called_lines(notation: Notation) -> list[str]:
    """Return the lines of a step that calls the user's function; only Python can run them."""
    return [
        f"slope = lambda theta, omega=v, after=0: acceleration(t + after, theta, omega{notation.more})",
        f"q_end, v_end = {CALLED}(q, v, h, slope)",
    ]


def recorded_lines(function: StepFunction, notation: Notation) -> list[str]:
    """Return the lines of a step with the operations of a user's function, in their order.

    Raises UnrecordableError for a function whose course depends on its numbers, or that uses other functions than those
    of :mod:`integrators.steps.tracing`.
    """
    trace = Record()
    t, q, v, h = (trace.leaf(name) for name in "tqvh")

    def acceleration(theta: Any, omega: Any = v, after: Any = 0) -> Symbol:
        time = t if isinstance(after, (int, float)) and after == 0 else t + after
        return trace.apply("acceleration", *(_lifted(trace, x) for x in (time, theta, omega)))

    def value(constant: Any) -> tuple[str, int]:
        text = notation.number(Fraction(constant))
        return text, ATOM

    try:
        ends = [_lifted(trace, x) for x in function(q, v, h, acceleration)]
        for operation in trace.operations:
            if operation.name == "steady":
                float(operation.value)
                Fraction(operation.value)
    except Exception as fault:  # whatever a user's function does with a number that is none
        raise UnrecordableError(str(fault)) from fault
    names = {x.place: name for x, name in zip((t, q, v, h), "tqvh", strict=True)}
    forms = {"acceleration": f"acceleration({{}}{notation.more})"}
    writer = StraightLine(trace, names, "qv", {"acceleration": "a"}, value, forms)
    assignments = writer.assignments(dict(zip(("q_end", "v_end"), ends, strict=True)))
    return [f"{name} = {text}" for name, text in assignments]


def _lifted(trace: Record, value: Any) -> Symbol:
    """Return a number as a recorded one; UnrecordableError if it is not a number."""
    if getattr(value, "shape", None) == () and hasattr(value, "item"):
        value = value.item()
    lifted = trace.lift(value)
    if lifted is None:
        raise UnrecordableError(f"{value!r} is not a number")
    return lifted


__all__ = ["OwnStep", "StepFunction", "UnrecordableError"]
