"""Generation of programs: the source text of one Python file that simulates one scene with one method.

The file contains only the needed functions. Python interprets the text, or numba compiles it: ``inline`` and ``entry``
are decorators that the caller provides (no operation, or njit), and ``U`` converts to an unsigned index. Torques and
energies are divided by the moment of inertia.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

from integrators import Method, unroll
from integrators.steps.compensated import added, scaled
from integrators.steps.terms import docstring
from pendulum_env.common.sources import ours
from pendulum_env.engine import advance, blocks, equations, report, series, slack
from pendulum_env.engine.equations import sub_flows
from pendulum_env.engine.goal import Goal
from pendulum_env.engine.layout import LIMITS, Layout
from pendulum_env.engine.loops import run
from pendulum_env.engine.problem import Problem, problem_of
from pendulum_env.engine.reading import float_text
from pendulum_env.engine.shape import Shape
from pendulum_env.engine.source import (
    Plain,
    called_in,
    check_names,
    constants_of,
    copied,
    decorated,
    with_callees,
)
from pendulum_env.engine.stages import BETWEEN, WHOLE, scheduled
from pendulum_env.engine.templates import Templates
from pendulum_env.physics import elementary
from pendulum_env.physics.effects import Effect
from pendulum_env.physics.effects.coulomb_friction import dry_glide
from pendulum_env.physics.equation import equation_text
from pendulum_env.physics.exact.flows import flow_of
from pendulum_env.physics.scene import Scene

WRITTEN: Mapping[str, Callable[[Problem], str]] = {
    "acceleration": equations.acceleration, "force": equations.force, "rates": equations.rates,
    "jacobian": equations.jacobian, "mean_acceleration": equations.mean_acceleration,
    "mean_jacobian": equations.mean_jacobian, "exact_flow": equations.exact_flow, "series": series.series,
}
"""Function that a step calls -> its writer; kicks and drag flows are in :mod:`pendulum_env.engine.equations`."""

HELPERS: tuple[Plain, ...] = (
    *report.CALLED, *advance.CALLED, elementary.exp, elementary.log, elementary.power, dry_glide, added, scaled)
"""Functions that do not belong to effects and are copied into a program that calls them."""


@dataclass(frozen=True)
class Program:
    """A generated program: its source and its interface.

    Attributes:
        text: the source.
        shape: names of the arguments, quadratures and reported quantities.
        title: a name for file names and messages.
        python_functions: functions by name that only an interpreted program can call; () for most methods.
        own: True if effects of the scene are a user's.
    """

    text: str
    shape: Shape
    title: str
    python_functions: tuple[tuple[str, Plain], ...] = field(default=(), kw_only=True)
    own: bool = field(default=False, kw_only=True)


@dataclass(frozen=True)
class BatchProgram(Program):
    """A generated program for blocks of environments; ``layout`` describes the fields and memory of a block."""

    layout: Layout


def program(
    scene: Scene, method: Method, diagnostics: tuple[str, ...] = ("energy",), adaptive: bool = False,
    compensated: bool = False, refines: bool = False, even: bool = False,
) -> Program:
    """Return the program for single runs of a scene with a method; values of parameters are arguments, not text.

    With ``refines`` it also has, for every implicit stage, the function of one step of Newton's method; see
    :data:`integrators.steps.newton.REFINING`. With ``even`` the parts of an adaptive step have the same length.
    """
    return _program(problem_of(scene, method, diagnostics, adaptive, compensated, refines, even))


def batch_program(
    scene: Scene, method: Method, diagnostics: tuple[str, ...], varying: frozenset[str], goal: Goal | None = None,
    compensated: bool = False, adaptive: bool = False,
) -> BatchProgram:
    """Return the program for blocks of environments with a task's Goal, or for blocks of runs without a task.

    ``varying`` holds the names of the parameters that differ between environments. See
    :mod:`pendulum_env.engine.blocks`.
    """
    return _batch_program(problem_of(scene, method, diagnostics, adaptive, compensated), varying, goal)


@lru_cache(maxsize=512)
def _program(problem: Problem) -> Program:
    """Return the program for single runs of a Problem, the equation of motion of a scene with a method."""
    shape = problem.shape
    write = Templates(problem)
    adapted = advance.adapt_evenly if shape.even else advance.adapt
    steps = [write(adapted), write(advance.advance_adaptively)] if shape.adaptive else []
    loops = [*steps, write(run, "@entry"), report.info(shape)]
    called_back = tuple(problem.method.python_functions.items())
    return Program(_text(problem, loops), shape, problem.title, python_functions=called_back, own=_own(problem))


@lru_cache(maxsize=512)
def _batch_program(problem: Problem, varying: frozenset[str], goal: Goal | None) -> BatchProgram:
    """Return the program for blocks of environments or runs of a Problem, a scene's equation of motion with a method.
    """
    shape = problem.shape
    schedule = WHOLE
    if blocks.in_stages(shape, problem.method):
        between = frozenset() if _own(problem) else BETWEEN
        schedule = scheduled(_text(problem, ()), shape.step_results, ("h", *shape.parameters), between)
    layout = Layout(shape, varying & {*shape.numbers, *LIMITS}, goal, schedule, _own(problem))
    text = _text(problem, blocks.loops(layout, problem.method, Templates(problem)), goal.functions if goal else ())
    return BatchProgram(text, shape, f"{problem.title}-{'runs' if goal is None else 'batch'}", layout,
                        python_functions=tuple(problem.method.python_functions.items()), own=_own(problem))


def _text(problem: Problem, loops: Sequence[str], functions: Sequence[Plain] = ()) -> str:
    """Write the whole text of a program for a Problem.

    It holds copied library functions, the problem's equations, one step of the method, and the loops over steps.
    """
    shape, method = problem.shape, problem.method
    pieces = [*_step(problem), *loops]
    flow = flow_of(problem.effects)
    known = [*_functions_of(problem), *([flow.function] if flow else []), *HELPERS]
    copies = with_callees([*called_in("\n".join(pieces), known), *functions])
    head = docstring(f"{equation_text(problem.effects)}\n\nMethod: {method.name} ({method.source}).\n") + "\n"
    numbers = {"NAN": "float('nan')", **{name: float_text(value) for name, value in constants_of(copies).items()}}
    constants = "".join(f"{name} = {value}\n" for name, value in numbers.items())
    pieces.insert(0, copied(copies))
    body = "\n\n".join(pieces)
    head += "from math import sqrt\n\n" if "sqrt(" in body else ""
    check_names(pieces, shape.parameters)
    return "\n\n".join([head + constants, body])


def _functions_of(problem: Problem) -> list[Plain]:
    """Return the functions of a Problem's effects."""
    roles = (getattr(effect, role, None) for effect in problem.effects for role in Effect.__annotations__)
    return [*filter(callable, roles)]


def _own(problem: Problem) -> bool:
    """Return True if a Problem has effects of a user, whose functions may have any form."""
    return not all(map(ours, _functions_of(problem)))


def _called(problem: Problem) -> tuple[str, ...]:
    """Return the names of the functions of an equation of motion that a step of its method calls."""
    shape = problem.shape
    called = problem.method.calls(bool(shape.quadratures), shape.adaptive)
    # Dry friction cuts steps at zeros of v: there the acceleration at rest decides, and moving air goes on working.
    at_rest = (*(("acceleration",) if shape.slides else ()), *(("rates",) if problem.held else ()))
    return (*(name for name in at_rest if name not in called), *called)


def _unrolled(problem: Problem) -> str:
    """Write the source of one step of a Problem's method, and of the start of its history."""
    shape, (_, hooks) = problem.shape, sub_flows(problem, _called(problem))
    return unroll(
        problem.method, quadratures=shape.quadratures, extra=shape.forces, hooks=hooks,
        exact_drag=len(problem.flows) < 2, estimates=shape.adaptive, compensated=shape.compensated,
        glides=bool(shape.dry), refines=problem.refines,
    )


def _step(problem: Problem) -> list[str]:
    """Write the source of the functions of an equation of motion, and of one step of its method.

    The step checks for divergence, the speed limit and a slack wire.
    """
    shape, held, called = problem.shape, problem.held, _called(problem)
    flows, _ = sub_flows(problem, called)
    write = Templates(problem)
    return [
        *(WRITTEN[name](problem) for name in called if name in WRITTEN),
        *flows,
        decorated(_unrolled(problem), "@inline"),
        *([write(advance.resting)] if held else []),
        *([write(advance.stick_slip)] if shape.slides else []),
        *([equations.remember(problem)] if shape.remembered else []),
        equations.potential(problem),
        *([equations.tension(problem)] if shape.pull else []),
        *([write(slack.taut), write(slack.pull_after), write(slack.slack_after)] if shape.slack else []),
        *([write(advance.land)] if shape.adaptive else []),
        *(equations.flow_functions(problem) if "quality_factor" in shape.watched else []),
        *([] if shape.adaptive else [write(advance.advance)]),
        *([write(slack.settle)] if shape.slack and not shape.adaptive else []),
    ]
