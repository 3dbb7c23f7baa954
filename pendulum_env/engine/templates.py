"""The names and the known values with which templates become the functions of a program."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import accumulate, pairwise
from types import FunctionType
from typing import Any

from integrators.solving.step_size import step_power
from integrators.steps.estimates import embedded_orders, order_of_estimate
from pendulum_env.engine import advance, loops, report, slack
from pendulum_env.engine.advance import EVEN_AIM, GAUSS, After, Clip, Progress, State
from pendulum_env.engine.equations import in_time
from pendulum_env.engine.loops import Arrays
from pendulum_env.engine.problem import Problem
from pendulum_env.engine.report import Numbers, Places, Watch
from pendulum_env.engine.shape import ADAPTED, BOUND, FLOW, HOLD, OWN, STATE, TOLERANCE
from pendulum_env.engine.source import taken_names
from pendulum_env.engine.specialise import (
    Names,
    SpecialiseError,
    Written,
    lines_of,
    name,
    specialised,
    variables_of,
)

NAMED: dict[str, str] = {"advance_adaptively": "advance", "adapt_evenly": "adapt"}
"""Templates -> the function of the program that they become, if it has another name."""

BARE = frozenset({"run", "stick_slip", "resting", "adapt", "adapt_evenly"})
"""Templates whose docstrings speak of more than a program has, and do not stand in it."""


def spans(start: int, *groups: Sequence[str]) -> tuple[tuple[int, int], ...]:
    """Return where groups of names begin and end that follow each other in an array."""
    ends = [*accumulate(map(len, groups), initial=start)]
    return tuple(pairwise(ends))


class Templates:
    """The templates of a Problem's program.

    Attributes:
        names: names of the variables in a template's tuples; see :mod:`pendulum_env.engine.advance`.
        known: what templates take after ``*``.
    """

    def __init__(self, problem: Problem) -> None:
        shape, method = problem.shape, problem.method
        extra, sums = shape.extra, shape.quadratures
        timed = shape.slides and in_time(problem)
        nodes = GAUSS if timed else ((0.0, 1.0),)
        pairs = embedded_orders(method) if shape.adaptive else ()
        one: dict[str, tuple[str, ...]] = {
            "winding": ("turns", "side") if shape.periodic else (), "memory": shape.memory, "lost": shape.lost,
            "given": tuple(x for x in shape.handed if x not in shape.memory), "rates": tuple(f"rate_{x}" for x in sums),
            "sums": shape.sums, "integrals": sums, "lost_sums": shape.lost_sums, "slackened": shape.slackened,
            "loose": ("loose",) if shape.lenient else (), "parts": tuple(f"d_{x}" for x in sums),
            "errors": tuple(f"error_{y}{i}" for i in range(len(pairs)) for y in "qv"),
        }
        flow = tuple(x for x in FLOW if x in shape.numbers)
        hold, held = HOLD if shape.remembered else (), ("held",) if shape.memory else ()
        tolerance, tries, adapted = (TOLERANCE, BOUND[:1], ADAPTED) if shape.adaptive else ((), (), ())
        told = [x for x in shape.info if x.startswith("heat_")]
        after = {f"{x}1": tuple(f"{y}1" for y in names) for x, names in one.items()}
        self.names = Names({
            **one, **after,
            "bob": State._make(one.get(x, x) for x in State._fields),
            "bob1": State._make(after.get(f"{x}1", f"{x}1") for x in State._fields),
            "after": After._make(("q1", "v1", after["memory1"], after["given1"], one["parts"], one["errors"])),
            "progress": Progress._make(one.get(x, x) for x in Progress._fields),
            "totals": tuple((f"{x}1", f"lost_{x}1") for x in shape.sums),
            "at_rest": tuple(("_", tuple(f"{x}{i}" for x in sums)) for i in range(len(nodes))),
            "parameters": shape.parameters, "extra": extra,
            "further": tuple(x for x in extra if x not in ("side", *shape.parameters)),
            "pull": shape.pull[:2] if shape.slack else (),
            "numbers": Numbers._make((shape.parameters, "inertia", "scale", shape.pull, flow, hold, tolerance, tries)),
            "pulls": shape.pull, "flow": flow, "hold": hold, "tolerance": tolerance, "attempts": tries,
            "own": ("inertia", "scale"), "held": held, "adapted": adapted, "phase": shape.remembered and ("phase",),
            "effects": shape.remembered, "effects1": tuple(f"{x}1" for x in shape.remembered),
            "r_watched": tuple(f"r_{x}" for x in shape.watched), "r_heats": tuple(f"r_{x}" for x in told),
            "portion": ("portion",) if shape.ends_slack else (),
            "found": ("loose",) if shape.lenient else ("portion",) if shape.ends_slack else (),
        })
        params = spans(0, shape.parameters, OWN, shape.pull, flow, hold, tolerance, tries)
        kept = spans(len(shape.recorded), ("initial",), held, shape.memory, shape.lost_sums, adapted, shape.slackened,
                     shape.remembered, shape.remembered[:1])
        paused = shape.params.index("under_way") if shape.adaptive else 0
        acting = tuple(i for i, x in enumerate(shape.remembered) if x in extra)
        arrays = Arrays(params, spans(len(STATE), shape.sums, shape.lost), kept, shape.phi, paused, "control" in extra,
                        acting)
        order = float(order_of_estimate(method)) if pairs else 1.0
        self.known: dict[str, Any] = {
            "clip": Clip._make((name(shape.clip), shape.drift, len(shape.sums) > len(sums))) if shape.clip else None,
            "take": name("stick_slip" if shape.slides else "step"), "slope": name("rates" if sums else "acceleration"),
            "power": name("step_power"), "limit": name(shape.dry), "slack": shape.slack,
            "lenient": shape.lenient, "ends_slack": shape.ends_slack, "weighed": shape.weighed,
            "side_at": extra.index("side") if shape.periodic else 0, "multistep": bool(shape.memory),
            "count": len(sums), "timed": timed, "nodes": nodes, "held": problem.held, "order": order,
            "aim": step_power(EVEN_AIM, 1.0 / order), "exponent": -0.5 / order,
            "paused": paused,
            "arrays": arrays,
            "places": Places._make(tuple(i for i, x in enumerate(shape.sums) if x in of) for of in (
                ("work",), [x for x in shape.sums if x.startswith("heat")], told)),
            "watch": Watch._make((shape.watched, *map(name, ("tension", "relative_speed", "bottom_speed", "quality")))),
            "periodic": shape.periodic, "remembers": bool(shape.remembered),
            "adaptive": shape.adaptive, "accounts": shape.accounts, "ledger": shape.ledger,
        }

    def __call__(self, template: Callable[..., Any], decorator: str = "@inline") -> Written:
        """Write the source of the function that a template becomes."""
        title = NAMED.get(template.__name__, template.__name__)
        try:
            return specialised(template, self.names, self.known, decorator, title, template.__name__ in BARE)
        except SpecialiseError as error:
            raise self._of_names(error) from error

    def lines(self, template: Callable[..., Any], **known: Any) -> list[str]:
        """Return the source lines of a spliced function, which set the variables that it returns."""
        try:
            return lines_of(template, self.names, {**self.known, **known})
        except SpecialiseError as error:
            raise self._of_names(error) from error

    def _of_names(self, error: SpecialiseError) -> Exception:
        """Return the error that coefficients have names of the templates' variables, if some have; else ``error``."""
        functions = (one for module in (advance, loops, report, slack) for one in vars(module).values()
                     if isinstance(one, FunctionType) and one.__module__ == module.__name__)
        taken = {one for function in functions for one in variables_of(function)}
        for one in self.names.texts.keys() - {"parameters", "extra", "numbers"}:
            taken |= self.names.texts[one]
        taken &= self.names.texts["parameters"]
        return taken_names(taken) if taken else error
