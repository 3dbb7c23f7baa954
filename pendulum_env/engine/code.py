"""The function :func:`code`, which returns programs as text, and the plain program: a loop as a student would write it.

For the plain program of a scene with an explicit one-step method, the method's step and the torques of the effects run
once with numbers that record what is done with them; the records are written with the names of a textbook. So the
method's coefficients and the scene's equation are not written a second time, and the program computes the numbers of
:func:`pendulum_env.rollout` up to rounding.

An implicit method whose stages follow one another, such as backward Euler, has a plain program in a linear scene: each
stage solves two linear equations, ``(1 - a dt J) (theta, omega) = known``, with the method's coefficient ``a`` and the
matrix ``J`` of the motion ``(theta, omega)' = J (theta, omega)``.
"""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from types import FunctionType
from typing import Any

from integrators import METHODS, Method, MethodError
from integrators.analysis import leading_error
from integrators.steps import tracing
from integrators.steps.straight_line import ATOM, PRODUCT, Record, StraightLine
from integrators.steps.terms import combination, literal
from integrators.steps.tracing import Symbol, Trace
from integrators.steps.unroll import unroll
from pendulum_env.common.checks import printable
from pendulum_env.engine.generate import program
from pendulum_env.engine.javascript import javascript
from pendulum_env.engine.machine import check_diagnostics, find_method
from pendulum_env.engine.problem import by_flow, moving, slipping
from pendulum_env.engine.reading import arguments
from pendulum_env.engine.series import TorqueTracer
from pendulum_env.engine.source import (
    Plain,
    names_of,
    text_of,
    with_callees,
)
from pendulum_env.engine.starts import checked_steps
from pendulum_env.physics import elementary
from pendulum_env.physics.damping import Damping, build_scene
from pendulum_env.physics.effects import Effect
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, one_of

WIDTH = 110
"""Largest length of a line of a plain program."""
CALLED = frozenset({"acceleration", "force", "jacobian", "kick", "push", "drag", "gradient_kick"})
"""Functions of the problem that the step of a method with a plain program may call."""
INDENT = "    "
BASES = {"abs": "speed", "sin": "sine", "cos": "cosine"}
"""Operation -> name of its result in a plain program, where it has a line of its own."""
NUMPY = {name: f"np.{name}" for name in ("sin", "cos", "tanh", "exp", "log", "sqrt", "power")}
"""Elementary function -> its name in a plain program."""
STATE = ("t", "theta", "omega", "dt")
"""Names of time, angle, velocity and step in a plain program."""
FEW = 3
"""Largest number of a scene's numbers that have lines of their own."""
PLOTS = """
times = dt*np.arange(steps + 1)
energies = [energy(*state) for state in zip(angles, velocities)]
figure, axes = plt.subplots(2, 2, layout="constrained")
for at, x, y, below, left in (
        (axes[0, 0], times, np.degrees(angles), "time [s]", "angle [degrees]"),
        (axes[0, 1], times, velocities, "time [s]", "angular velocity [rad/s]"),
        (axes[1, 0], np.degrees(angles), velocities, "angle [degrees]", "angular velocity [rad/s]"),
        (axes[1, 1], times, energies, "time [s]", "energy [J]")):
    at.plot(x, y)
    at.set(xlabel=below, ylabel=left)
plt.show()
"""
"""End of a plain program, which draws angle, velocity, phase plot and energy."""
LOGARITHM = 'np.seterr(divide="ignore")  # a power is exp(exponent*log(speed)), also for a speed of 0'
INERTIA = "inertia"
"""Name of the moment of inertia [kg m²] in a plain program."""
SHORT = 12
"""Largest length of a coefficient that is written as a fraction."""


def is_plain(method: Method) -> bool:
    """Return True if a method has a plain program: it is explicit, takes one step at a time and only calls forces."""
    plain = method.one_step and not method.implicit and not method.python_functions
    return plain and CALLED.issuperset(method.calls(quadratures=False, adaptive=False))


def is_linear_solve(method: Method) -> bool:
    """Return True if a method has a plain program in linear scenes: it is implicit, and each stage that it solves
    depends on no later one, so that it is the solution of two linear equations."""
    if method.tableau is None or not (method.implicit and method.one_step):
        return False
    return not any(any(row[i + 1 :]) for i, row in enumerate(method.tableau[0]))


def plain_program(scene: Scene, method: Method) -> str:
    """Return the plain program of a scene with a method, for the scene's usual run.

    Raises MethodError for a method without a plain program, and for an implicit one in a scene that is not linear;
    SceneError for a scene with dry friction, gusts or a lagging motor, or with drag in moving air for a method that
    uses the exact flow of drag.
    """
    functions = _Functions(scene)
    begin, step = _loop(method, functions)
    functions.write_energy(INERTIA)
    run = scene.run
    steps = checked_steps(run.duration, run.dt)
    values = {**scene.coefficients, "control": 0.0, INERTIA: scene.inertia}
    lines = [
        *_head(scene, method), "import matplotlib.pyplot as plt", "import numpy as np", "",
        *functions.imports,
        *_numbers({name: values[name] for name in functions.numbers}),
        f"dt, steps = {run.dt!r}, {steps}  # length of a step [s], number of steps",
        f"theta, omega = {run.angle!r}, {run.velocity!r}  # angle [rad] and angular velocity [rad/s] at the start", "",
        *functions.lines, *begin, "angles, velocities = [theta], [omega]", *step,
    ]
    return "\n".join(lines) + "\n" + PLOTS


def loop_functions(scene: Scene, methods: Mapping[str, Method]) -> list[str]:
    """Return source lines of functions that integrate a scene: one for every method, and those that they need.

    ``name(theta, omega, dt, steps)`` returns arrays of angle and angular velocity after 0, 1, ... steps of the method
    with this name, and ``energy(theta, omega)`` is the energy over the moment of inertia [1/s²]. They need ``np`` and
    the scene's coefficients as global names. Errors are those of :func:`plain_program`.
    """
    functions, written = _Functions(scene), list[str]()
    for name, method in methods.items():
        begin, step = _loop(method, functions)
        title = f"Return arrays of angle and angular velocity after 0, 1, ..., steps of {method.name}."
        written += ["", "", f"def {name}(theta, omega, dt, steps):", f'{INDENT}"""{title}"""',
                    *textwrap.indent("\n".join([*begin, "angles, velocities = [theta], [omega]", *step,
                                                "return np.array(angles), np.array(velocities)"]), INDENT).split("\n")]
    functions.write_energy()
    needed = "\n".join(functions.lines).rstrip().replace("\n\n", "\n\n\n")
    return [*functions.imports, *needed.split("\n"), *written]


def _loop(method: Method, functions: _Functions) -> tuple[list[str], list[str]]:
    """Return the lines before a plain loop, and those of the loop. Raises the errors of :func:`plain_program`."""
    if not (is_plain(method) or is_linear_solve(method)):
        some = ", ".join(name for name in list(METHODS)[:12] if is_plain(METHODS[name]))
        raise MethodError(
            f"{method.name} has no plain loop, a short program to read; only explicit one-step methods that call only "
            f"forces have one, such as {some}, and in linear scenes backward_euler and its like; use language='engine' "
            "(--language engine) for the program that runs."
        )
    _check_scene(functions.scene)
    if is_plain(method):
        step, first = _step(method, functions)
        begin = [line for name, text in first for line in _assigned(name, text)]
    else:
        begin, step = _solved_step(method, functions)
    time = ["    t = n*dt"] if functions.timed else []
    return begin, ["for n in range(steps):", *time, *(line for name, text in step for line in _assigned(
        name, text, INDENT)), "    angles.append(theta)", "    velocities.append(omega)"]


def _check_scene(scene: Scene) -> None:
    """Raise SceneError for effects that a plain loop cannot hold: they stop within steps, or have a state."""
    for effect in scene.effects:
        reason = "dry friction, at whose stops steps must be cut" if effect.dry else (
            "a state of its own, which changes between steps" if effect.memory else
            "a bound, at which the velocity is cut after every step" if effect.limit else "")
        if reason:
            raise SceneError(
                f"The scene '{scene.name}' has no plain loop: its {effect.name} has {reason}. Leave it out, or use "
                "language='engine' (--language engine)."
            )


def _head(scene: Scene, method: Method) -> Iterator[str]:
    """Yield the comments above a plain program: equation, method, its leading error and source."""
    for text in (
        f"Scene {scene.name}: {scene.equation()}",
        f"Method {method.name}, order {method.order}: {method.summary}",
        f"Leading error at small angles (h = dt): {leading_error(method).text}. Source: {method.source}",
    ):
        yield from textwrap.wrap(printable(text), WIDTH, initial_indent="# ", subsequent_indent="#   ")


def _numbers(values: Mapping[str, float]) -> Iterator[str]:
    """Yield the lines that set a scene's numbers: each on its own line or, if there are many, as many as fit."""
    named = [*values]
    while named:
        count = 1 if len(values) <= FEW else max(
            k for k in range(1, len(named) + 1) if k == 1 or len(_pair(values, named[:k])) <= WIDTH)
        yield _pair(values, named[:count])
        named = named[count:]


def _pair(values: Mapping[str, float], names: Sequence[str]) -> str:
    return f"{', '.join(names)} = {', '.join(repr(values[name]) for name in names)}"


def _assigned(name: str, text: str, indent: str = "") -> list[str]:
    """Return the lines of an assignment."""
    return _lines(f"{indent}{name} = ", text)


def _lines(start: str, text: str) -> list[str]:
    """Return the lines of a statement that begins with ``start``; an expression too long for one is in brackets."""
    if len(start) + len(text) <= WIDTH:
        return [f"{start}{text}"]
    room = WIDTH - len(start) - 2
    first, *parts = textwrap.wrap(text, room, break_long_words=False, break_on_hyphens=False)
    lines = [f"{start}({first}", *(" " * (len(start) + 1) + part for part in parts)]
    return [*lines[:-1], f"{lines[-1]})"]


# --- the method's step ------------------------------------------------------------------------------------------------


def _step(method: Method, functions: _Functions) -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    """Return the assignments of one step, and those before the first step for a method that passes on a force."""
    trace = Record()
    t, q, v, h = (trace.leaf(name) for name in STATE)
    memory = {name: trace.leaf(name) for name in method.memory}
    known: dict[str, Any] = {
        name: getattr(functions, name)(trace) for name in ("acceleration", "force", "drag", "jacobian")
    }
    known |= {name: getattr(tracing, name) for name in ("sin", "cos", "exp", "log", "sqrt")}

    def number(value: Fraction) -> str:
        name = f"c{value.numerator}_{value.denominator}".replace("-", "m")
        known[name] = trace.leaf("steady", value)
        return name

    drags = functions.drags
    exec(unroll(method, hooks={"drag": ()} if drags else {}, number=number, exact_drag=len(drags) < 2), known)
    names = {leaf.place: name for leaf, name in zip((t, q, v, h), STATE, strict=True)}
    names |= {leaf.place: name for name, leaf in memory.items()}

    def written(ends: Sequence[Any], targets: Iterable[str]) -> list[tuple[str, str]]:
        called = {"acceleration": "a", "force": "a", "drag": "omega", "slope": "s"}
        forms = {**{name: f"{np}({{}})" for name, np in NUMPY.items()}, "force": "acceleration({})"}
        writer = StraightLine(trace, names, ("theta", "omega", *memory), called, _value, forms)
        return writer.assignments(dict(zip(targets, ends, strict=True)))

    before: list[tuple[str, str]] = []
    if memory:
        first = known["begin"](trace.leaf("steady", 0.0), q, v, h)
        before = written(first if isinstance(first, tuple) else (first,), memory)
    return written(known["step"](t, q, v, *memory.values(), h), ("theta", "omega", *memory)), before


def _solved_step(method: Method, functions: _Functions) -> tuple[list[str], list[tuple[str, str]]]:
    """Return the lines before the loop, and the assignments of one step, of an implicit method in a linear scene."""
    assert method.tableau is not None
    (rows, b), stages = method.tableau, range(len(method.tableau[1]))
    nodes, last = [sum(row, Fraction(0)) for row in rows], len(b) - 1
    matrix, forced = functions.linear(method)
    diagonals = list(dict.fromkeys(rows[i][i] for i in stages if rows[i][i]))
    names = {share: "system" + (str(k + 1) if len(diagonals) > 1 else "") for k, share in enumerate(diagonals)}
    begin = [f"jacobian = {matrix}  # (theta, omega)' = jacobian (theta, omega){' + drive' if forced else ''}",
             *(f"{names[share]} = np.eye(2) - {_times_step(share)}*jacobian" for share in diagonals)]
    velocities: dict[int, str] = {}
    ends, step = rows[last] == b, list[tuple[str, str]]()  # the last stage of some methods is the new state
    for i in stages:
        first = not any(rows[i])
        q, v = ("theta", "omega") if first or (ends and i == last) else (f"theta{i + 1}", f"omega{i + 1}")
        own, time = rows[i][i], "t" + (f" + {_times_step(nodes[i])}" if nodes[i] else "")
        before = [j for j in stages if j < i and rows[i][j]]
        shares, speeds = [rows[i][j] for j in before], [velocities[j] for j in before]
        push = ([own], [functions.accelerated(time, "0.0", "0.0")]) if forced and own else ([], [])
        known = (_plus("theta", shares, speeds),
                 _plus("omega", [*shares, *push[0]], [*(f"a{j + 1}" for j in before), *push[1]]))
        if own:
            step.append((f"{q}, {v}", f"np.linalg.solve({names[own]}, ({', '.join(known)}))"))
        elif not first:
            step.append((f"{q}, {v}", ", ".join(known)))
        if any((*(row[i] for row in rows[i + 1 :]), *(() if ends else (b[i],)))):
            step.append((f"a{i + 1}", functions.accelerated(time, q, v)))
        velocities[i] = v
    if not ends:
        taken = [i for i in stages if b[i]]
        step.append(("theta, omega", ", ".join(
            _plus(start, [b[i] for i in taken], slopes) for start, slopes in (
                ("theta", [velocities[i] for i in taken]), ("omega", [f"a{i + 1}" for i in taken])))))
    return begin, step


def _times_step(share: Fraction) -> str:
    """Return the source text of a share of the step, such as ``0.5*dt``."""
    return "dt" if share == 1 else f"{_value(share)[0]}*dt"


def _plus(start: str, weights: Sequence[Fraction], names: Sequence[str]) -> str:
    """Return the source text of ``start + dt*(weighted sum of names)``, or ``start`` alone without names."""
    text = combination(weights, names, lambda weight: _value(weight)[0])
    simple = not text.startswith("-") and " + " not in text and " - " not in text
    return f"{start} + dt*{text if simple else f'({text})'}" if text else start


def _value(value: Any) -> tuple[str, int]:
    """Return a constant as source text: a name, a short fraction such as 1/6, or a float."""
    if isinstance(value, str):
        return value, ATOM
    exact = Fraction(value)
    fraction, decimal = f"{exact.numerator}/{exact.denominator}", literal(exact)
    if len(fraction) <= SHORT and len(decimal) > 6 and len(fraction) < len(decimal):
        return fraction, PRODUCT
    return decimal, ATOM


# --- the scene's functions --------------------------------------------------------------------------------------------


class _Shortened(Record):
    """A trace of a potential that leaves out the terms ``1.0 - 1.0``, which stand for a bob that starts at the bottom.
    """

    def apply(self, name: str, *operands: Symbol) -> Symbol:
        values = [str(self.operations[operand.place].value) for operand in operands]
        if (name, values) == ("sub", ["1.0", "1.0"]):
            return self.leaf("steady", 0.0)
        if name == "add" and "0.0" in values:
            return operands[1 - values.index("0.0")]
        return super().apply(name, *operands)


class _Functions:
    """The functions of a scene that a step calls, written when a step first calls them.

    Attributes:
        drags: the effects that splitting methods solve exactly: see :func:`by_flow`.
        lines: source lines of the functions so far.
        signatures: name of a written function -> names of its arguments.
        numbers: names of the scene's coefficients that they use.
        imports: lines that give elementary functions the names by which copied functions use them, and the like.
        copied: names of the functions of effects that are copied.
        timed: True if the acceleration depends on the time.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.drags = [effect for effect in scene.effects if by_flow(effect)]
        self.windy = moving(scene.effects)
        self.lines: list[str] = []
        self.signatures: dict[str, tuple[str, ...]] = {}
        self.numbers: list[str] = []
        self.imports: list[str] = []
        self.timed = False
        self.copied: set[str] = set()

    def acceleration(self, trace: Record) -> Callable[..., Symbol]:
        """Return the recording function ``acceleration(t, q, v)`` of all torques."""
        return self._called(trace, "acceleration", lambda: self.scene.effects)

    def force(self, trace: Record) -> Callable[..., Symbol]:
        """Return the recording function ``force(t, q)`` of the torques, without drags, on a bob at rest."""
        return self._called(trace, "force", lambda: [e for e in self.scene.effects if e.kind != "dissipative"])

    def jacobian(self, trace: Record) -> Callable[..., tuple[Symbol, None]]:
        """Return the recording function ``jacobian(t, q, v)``, whose first result is the slope by the angle."""
        slope = self._called(trace, "slope", lambda: self.scene.effects, "by_angle")
        return lambda t, q, v: (slope(t, q, v), None)

    def drag(self, trace: Record) -> Callable[..., Symbol]:
        """Return the recording function ``drag(t, q, v, h)``: the exact solution for the drags alone.

        Several drags are composed symmetrically, as in :func:`pendulum_env.engine.equations.drag`.
        """

        def call(t: Symbol, q: Symbol, v: Symbol, h: Symbol) -> Symbol:
            if "drag" not in self.signatures:
                self._write_drag()
            return trace.apply("drag", v, h)

        return call

    def _called(
        self, trace: Record, name: str, effects: Callable[[], Iterable[Effect]], role: str = "torque"
    ) -> Callable[..., Symbol]:
        """Return a recording function that writes a sum over effects when it is first called."""

        def call(*values: Symbol) -> Symbol:
            if name not in self.signatures:
                self._write_sum(name, effects(), role)
            given = dict(zip(STATE, values, strict=False))
            return trace.apply(name, *(given[argument] for argument in self.signatures[name]))

        return call

    def _write_sum(self, name: str, effects: Iterable[Effect], role: str) -> None:
        """Append the source of a function of time, angle and velocity: a sum of the effects' torques or slopes."""
        tracer = TorqueTracer(periodic=False, trace=Record())
        if self.windy:
            self._move(tracer)
        chosen, start = [effect for effect in effects if getattr(effect, role)], tracer.get("velocity")
        if name == "force" and any(map(by_flow, chosen)):
            tracer.named["velocity"] = tracer.trace.leaf("steady", 0.0)
        terms = [self._recorded(tracer, getattr(effect, role)) for effect in chosen]
        tracer.named["velocity"] = start
        total = sum(terms[1:], terms[0]) if terms else tracer.trace.leaf("steady", 0.0)
        label = {"force": "acceleration"}.get(name, name)
        alone = name == "force" and bool(self.drags)
        self._define(name, label, tracer, total, "  # without drag" if alone else "")

    def accelerated(self, time: str, theta: str, omega: str) -> str:
        """Return the source of a call of ``acceleration``, which is written before, with sources of its arguments."""
        if "acceleration" not in self.signatures:
            self._write_sum("acceleration", self.scene.effects, "torque")
        given = {"t": time, "theta": theta, "omega": omega}
        return f"acceleration({', '.join(given[name] for name in self.signatures['acceleration'])})"

    def linear(self, method: Method) -> tuple[str, bool]:
        """Return the source of the matrix J of a linear scene, ``(theta, omega)' = J (theta, omega) + (0, drive)``, and
        True if there is such a drive. Raises MethodError, which names the method, for a scene that is not linear."""
        tracer, bent = TorqueTracer(periodic=False, trace=Record()), list[str]()
        slopes: dict[str, list[Symbol]] = {"by_angle": [], "by_velocity": []}
        moving_leaves = {tracer.get(name).place for name in ("time", "tilt", "velocity")}
        for effect in self.scene.effects:
            for role, terms in slopes.items():
                if getattr(effect, role):
                    try:
                        terms.append(tracer.call(getattr(effect, role)))
                    except (TypeError, AttributeError, ValueError):  # it branches, as no constant does
                        bent.append(effect.name)
                        continue
                    if moving_leaves.intersection(_used(tracer.trace, terms[-1])):
                        bent.append(effect.name)
        if bent or self.windy:
            what = ", ".join(dict.fromkeys(bent)) or "the wind"
            raise MethodError(
                f"{method.name} has a plain loop only in linear scenes, where a step solves two linear equations, and "
                f"{what} of the scene '{self.scene.name}' is not linear. Use a scene such as exercise, an explicit "
                "method such as symplectic_euler, or language='engine' (--language engine)."
            )
        entries = [self._one_line(tracer, sum(terms[1:], terms[0])) if terms else "0.0" for terms in slopes.values()]
        at_rest = {**self.scene.coefficients, "side": 1.0}
        drive = any(effect.torque and ("time" in arguments(effect.torque) or effect.torque(
            *(at_rest.get(name, 0.0) for name in arguments(effect.torque)))) for effect in self.scene.effects)
        return f"np.array([[0.0, 1.0], [{', '.join(entries)}]])", drive

    def write_energy(self, scale: str = "") -> None:
        """Append the source of ``energy(theta, omega)``, over the moment of inertia or times the number ``scale``."""
        tracer = TorqueTracer(periodic=False, trace=_Shortened())
        q, v = tracer.get("tilt"), tracer.get("velocity")
        tracer.named["half_sine"] = tracing.sin(0.5 * q)
        total: Any = 0.5 * v * v
        for effect in self.scene.effects:
            if effect.potential:
                total = total + self._recorded(tracer, effect.potential)
        if scale:
            total = tracer.get(scale) * total
        self._define("energy", "energy", tracer, total, "", signature=("theta", "omega"))

    def _move(self, tracer: TorqueTracer) -> None:
        """Set slip and speed of a medium that moves: see :mod:`pendulum_env.engine.equations` for the equations."""
        q, v = tracer.get("tilt"), tracer.get("velocity")
        sine, cosine = tracing.sin(q), tracing.cos(q)
        along: Any = 0.0
        across: Any = 0.0
        for role, to_along, to_across in (("wind_x", cosine, sine), ("wind_y", sine, -cosine)):
            winds = [self._recorded(tracer, getattr(e, role)) for e in self.scene.effects if getattr(e, role)]
            if winds:
                wind = sum(winds[1:], winds[0])
                along = wind * to_along if isinstance(along, float) else along + wind * to_along
                across = wind * to_across if isinstance(across, float) else across + wind * to_across
        slip = v - along
        tracer.named["slip"] = slip
        tracer.named["speed"] = tracing.sqrt(slip * slip + across * across)

    def _write_drag(self) -> None:
        """Append the source of ``drag(omega, dt)``, the exact solution for the drags alone."""
        if self.windy and any(map(slipping, self.drags)):
            raise SceneError(
                f"The scene '{self.scene.name}' has drag in moving air, where only methods that take drag as a force, "
                "such as rk4 and symplectic_euler, have a plain loop to read; for others use language='engine' "
                "(--language engine)."
            )
        tracer = TorqueTracer(periodic=False, trace=Record())
        h: Any = tracer.trace.leaf("dt")
        halves = [(effect, 0.5 * h) for effect in self.drags[:-1]]
        v: Any = tracer.get("velocity")
        start = v
        for effect, duration in (*halves, (self.drags[-1], h), *reversed(halves)):
            tracer.named |= {"velocity": v, "duration": duration}
            assert effect.flow is not None
            v = self._recorded(tracer, effect.flow)
        tracer.named["velocity"] = start
        self._define("drag", "drag", tracer, v, "  # the exact solution for the drag alone", h)

    def _recorded(self, tracer: TorqueTracer, function: Plain) -> Symbol:
        """Return the recorded result of an effect's function, or its recorded call if it cannot be recorded."""
        try:
            return tracer.call(function)
        except (TypeError, AttributeError, ValueError):
            self._copy(function)
            return tracer.trace.apply(function.__name__, *(tracer.get(name) for name in arguments(function)))

    def _copy(self, function: Plain) -> None:
        """Append the source of an effect's function and of the functions that it calls, each once."""
        for each in with_callees([function]):
            if each.__module__ == elementary.__name__ or each.__name__ in self.copied:
                continue
            self.copied.add(each.__name__)
            lines = [f"{name} = {NUMPY[name]}" for name in _elementary_names(each)]
            self.imports += [line for line in lines if line not in self.imports]
            self.lines += [*text_of(each).rstrip().split("\n"), ""]

    def _define(
        self, name: str, label: str, tracer: TorqueTracer, value: Symbol, comment: str, h: Symbol | None = None,
        signature: tuple[str, ...] = (),
    ) -> None:
        """Append to the program the source of a function that computes a value by the operations of a tracer.

        Its arguments are those that it uses, unless a ``signature`` names them.
        """
        leaves = {"t": tracer.get("time"), "theta": tracer.get("tilt"), "omega": tracer.get("velocity")}
        names = {leaf.place: text for text, leaf in leaves.items()}
        names |= {} if h is None else {h.place: "dt"}
        used = _used(tracer.trace, value)
        self.signatures[name] = signature or tuple(
            text for text in STATE if any(names.get(place) == text for place in used))
        self._note_numbers(tracer, used)
        self.timed |= "t" in self.signatures[name]
        if LOGARITHM not in self.imports and any(tracer.trace.operations[place].name == "log" for place in used):
            self.imports.append(LOGARITHM)
        before, result = self._writer(tracer, names).result(value)
        self.lines += [
            f"def {label}({', '.join(self.signatures[name])}):{comment}",
            *(line for text, source in before for line in _assigned(text, source, INDENT)),
            *_lines(f"{INDENT}return ", result), "",
        ]

    def _one_line(self, tracer: TorqueTracer, value: Symbol) -> str:
        """Return the source of a recorded value that depends on the scene's numbers alone."""
        self._note_numbers(tracer, _used(tracer.trace, value))
        return self._writer(tracer, {}).result(value)[1]

    def _note_numbers(self, tracer: TorqueTracer, used: Iterable[int]) -> None:
        """Add the names of the scene's numbers among recorded operations to those that the program sets."""
        for place in used:
            constant = tracer.trace.operations[place].value
            if isinstance(constant, str) and constant.isidentifier() and constant not in (*self.numbers, *STATE):
                self.numbers.append(constant)

    @staticmethod
    def _writer(tracer: TorqueTracer, names: Mapping[int, str]) -> StraightLine:
        forms = {text: f"{np}({{}})" for text, np in NUMPY.items()}
        return StraightLine(tracer.trace, names, ("theta", "omega"), {}, _value, forms, BASES)


def _used(trace: Trace, value: Symbol) -> list[int]:
    """Return the places of all operations and leaves on which a recorded value depends, in their order."""
    seen, open_ = {value.place}, [value.place]
    while open_:
        new = set(trace.operations[open_.pop()].operands) - seen
        seen |= new
        open_ += new
    return sorted(seen)


def _elementary_names(function: FunctionType) -> Mapping[str, None]:
    """Return the names of elementary functions that a function calls."""
    return {name: None for name in names_of(function.__code__) if name in NUMPY}


LANGUAGES = ("plain", "engine", "javascript")
"""Names of the languages of programs; :func:`code` explains them."""


def code(
    scene: str | Scene | Mapping[str, object] = "lab",
    integrator: str | Method = "rk4",
    language: str = "plain",
    *,
    damping: Damping = "scene",
    diagnostics: Sequence[str] = ("energy",),
) -> str:
    """Return a program that simulates a scene with a method, as text.

    The plain program is a loop as a student would write it, for the scene's usual run. It needs only NumPy and
    Matplotlib, runs as it is, draws angle, velocity, phase plot and energy, and gives the numbers of
    :func:`pendulum_env.rollout` up to rounding. In linear scenes, backward Euler and other implicit methods whose
    stages follow one another solve two linear equations in each stage.

    The engine's program holds only the functions of the scene's effects, one step of the method written out, the step
    with its checks (``advance``), and the loop over steps (``run``). The values of parameters are arguments. Define the
    decorators ``inline`` and ``entry`` before you run it; they may return the function unchanged.

    The JavaScript program is a module with the engine's functions under the same names. It exports ``run`` and
    ``info``, and computes the same bits as the engine in every browser and in Node: JavaScript rounds +, -, *, / and
    square roots of doubles as Python does, and sine and exponential are part of the program.

    Args:
        scene: preset name, dict, Scene, or a scene's JSON file.
        integrator: name of a method, or a Method.
        language: "plain" for a plain loop, which explicit one-step methods have, and in linear scenes backward_euler
            and its like; "engine" for the Python on floats that the engine interprets or compiles; "javascript" for
            the same program as a JavaScript module.
        damping: as in :func:`pendulum_env.physics.damping.with_damping`.
        diagnostics: quantities that the engine's program, in either language, computes beside the motion: "energy",
            "heat_by_effect", "tension", "flow"; () for none.

    Raises SceneError or MethodError for invalid arguments, such as a method that does not fit the scene, and for a
    method or a scene without a plain program; ProgramError for a function that cannot be copied into a program, and for
    a program that cannot be translated to JavaScript, such as one that calls a step of your own in Python.
    """
    one_of(language, "language", LANGUAGES)
    built = build_scene(scene, damping, {})
    method, names = find_method(integrator, built), check_diagnostics(diagnostics)
    if language == "plain":
        return plain_program(built, method)
    generated = program(built, method, names)
    return javascript(generated) if language == "javascript" else generated.text
