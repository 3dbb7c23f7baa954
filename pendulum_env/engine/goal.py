"""Functions of a task in generated programs, and the quantities that the names of their arguments choose.

A task's functions are plain functions of floats, whose argument names choose the quantities: ``reward(phi, speed,
action)`` gets the angle from upright, the velocity over omega0 and the action. Programs for blocks of environments copy
these functions; a single environment calls them in Python, from a judge with the same formulas, so that both have the
same bits.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from pendulum_env.common.sources import executed, parsed
from pendulum_env.engine.reading import Piece, arguments, built
from pendulum_env.engine.source import Plain, constants_text, copied, with_callees
from pendulum_env.engine.wrap import half_turns
from pendulum_env.physics.elementary import cos, sin


class Offered(NamedTuple):
    """A quantity that a task's functions may take: its meaning with its unit, and its source in a program."""

    meaning: str
    formula: str


OFFERED: Mapping[str, Offered] = {
    "phi": Offered("angle from upright, in [-pi, pi] [rad]", "phi"),
    "angle": Offered("angle from hanging, unwrapped [rad]", "q + 6.283185307179586*turns"),
    "velocity": Offered("angular velocity [rad/s]", "v"),
    "speed": Offered("velocity/omega0, a pure number", "v/omega0"),
    "action": Offered("the clipped action, the fraction of the motor's torque", "control"),
    "time": Offered("time since the start of the episode [s]", "index*h"),
    "omega0": Offered("angular frequency of small swings [1/s]", "omega0"),
    "phi_before": Offered("phi at the start of the control step [rad]", "phi_before"),
    "angle_before": Offered("angle at the start of the control step [rad]", "angle_before"),
    "velocity_before": Offered("velocity at the start of the control step [rad/s]", "velocity_before"),
    "reference": Offered("the angle to follow, for a task with a reference [rad]", "aim"),
    "error": Offered("angle less reference, in [-pi, pi], for a task with a reference [rad]", "aside(angle_now, aim)"),
}
"""Argument of a task's functions -> its meaning, and its source from the local names of a generated ``observe``."""

BEFORE: Mapping[str, str] = {
    "phi_before": "phi", "angle_before": OFFERED["angle"].formula, "velocity_before": "v",
}
"""Quantity of the state at the start of a control step -> source of the value that is stored for the next step."""

FOLLOWED = ("reference", "error")
"""Quantities of tasks with a reference."""

AHEAD = ("aim_cosine", "aim_sine", "next_cosine", "next_sine")
"""Further entries of the observation of a task with a reference.

They are cosine and sine of the reference now, and after the next control step, by which the next action is judged.
"""

SPAN = "control_span"
"""Further parameter of programs for a task with a reference: the control step [s]."""


def aside(angle: float, aim: float) -> float:
    """Return ``angle - aim`` [rad], less whole turns: in [-pi, pi]."""
    return angle - aim - 6.283185307179586 * half_turns(0.5 * (angle - aim))


@dataclass(frozen=True)
class Goal:
    """The functions of a task that a program copies, and the form of its observation.

    Attributes:
        reward, lost: functions of quantities in OFFERED; the reward of a step, and True where the task is lost.
        reference: function of "time" [s] that returns the angle to follow [rad]; None without one.
        begin: function of two random numbers in [0, 1), "first" and "second", and of "omega0" that returns the angle
            [rad] and velocity [rad/s] of a start; None for starts that are not drawn by a function.
        upright: True if cosine and sine in the observation are those of the angle from upright.
        pieces: texts of those functions that were translated, and of their helpers.
    """

    reward: Plain
    lost: Plain
    reference: Plain | None = None
    begin: Plain | None = None
    upright: bool = False
    pieces: tuple[Piece, ...] = ()

    def __reduce__(self) -> tuple[Callable[..., Goal], tuple[Any, ...]]:
        """Return the parts from which a copy is rebuilt: texts of translated functions, in place of the functions."""
        names = {piece.name for piece in self.pieces}
        functions = (self.reward, self.lost, self.reference, self.begin)
        named = [function.__name__ if function is not None and function.__name__ in names else function
                 for function in functions]
        return _rebuilt, (named, self.upright, self.pieces)

    @property
    def functions(self) -> tuple[Plain, ...]:
        """Return the functions that a program copies, with the helpers that it calls for them."""
        further = [function for function in (self.reference, self.begin) if function is not None]
        return (self.reward, self.lost, *further, *((aside,) if "error" in self.named else ()))

    @property
    def doubted(self) -> bool:
        """Return True if functions are a user's, so that programs count the rewards that are not finite."""
        return bool(self.pieces)

    @property
    def straight(self) -> bool:
        """Return True if a loop can compute the functions for several environments at once.

        A user's function with ``if``, or with a power whose exponent is a fraction, is computed for one after the
        other.
        """
        nodes = [node for piece in self.pieces for node in ast.walk(parsed(piece.text))]
        return not any(isinstance(node, ast.If) or (isinstance(node, ast.Name) and node.id == "power")
                       for node in nodes)

    @property
    def named(self) -> frozenset[str]:
        """Return the names of the quantities that reward and loss take."""
        return frozenset(arguments(self.reward)) | frozenset(arguments(self.lost))

    @property
    def before(self) -> tuple[str, ...]:
        """Return the names of the quantities at the start of the control step that reward and loss take."""
        return tuple(name for name in BEFORE if name in self.named)

    @property
    def seen(self) -> tuple[str, ...]:
        """Return the names of the observation's entries."""
        return ("cosine", "sine", "rate", *(AHEAD if self.reference else ()))

    def aimed(self) -> list[str]:
        """Return the source lines that compute the reference, and ``angle_now`` for the error; none without one."""
        if self.reference is None:
            return []
        return [*([f"angle_now = {OFFERED['angle'].formula}"] if "error" in self.named else []),
                f"aim = {self.reference.__name__}(index*h)"]

    def ahead(self) -> list[str]:
        """Return the source lines that compute the entries AHEAD of the observation; none without a reference."""
        if self.reference is None:
            return []
        return ["aim_cosine = cos(aim)", "aim_sine = sin(aim)",
                f"aim_next = {self.reference.__name__}(index*h + {SPAN})",
                "next_cosine = cos(aim_next)", "next_sine = sin(aim_next)"]

    def call(self, function: Plain) -> str:
        """Return the source of the call of a function of quantities."""
        return f"{function.__name__}({', '.join(OFFERED[name].formula for name in arguments(function))})"


Judge = Callable[..., tuple[float, bool]]
"""Function of the state's numbers, of phi, the action and the numbers BEFORE that returns reward and loss."""


def judge(goal: Goal, omega0: float, h: float) -> Judge:
    """Return the function by which a single environment judges a control step, interpreted by Python.

    It is called with the steps taken, the angle from the nearer of bottom and top [rad], turns, velocity [rad/s], phi
    [rad], the action and a dict with the quantities BEFORE that the task takes, and returns the reward and True if the
    task is lost. ``omega0`` [1/s] and the integrator's step ``h`` [s] are constant.
    """
    taken = [f"{name} = before[{name!r}]" for name in goal.before]
    text = _judging(goal, "index, q, turns, v, phi, control, before", taken)
    made: Judge = _made(goal, text, omega0=omega0, h=h)["judge"]
    return made


def _judging(goal: Goal, arguments: str, taken: Sequence[str] = ()) -> str:
    """Write the source of ``judge``, which returns reward and loss; ``taken`` are its first lines."""
    lines = [*taken, *goal.aimed(), f"return {goal.call(goal.reward)}, {goal.call(goal.lost)}"]
    return f"def judge({arguments}):\n" + "".join(f"    {line}\n" for line in lines)


def looking_ahead(goal: Goal, h: float, span: float) -> Callable[[float], tuple[float, ...]]:
    """Return the function from the number of steps taken to the entries AHEAD of the observation.

    ``h`` is the integrator's step, ``span`` the control step [s].
    """
    text = _looking(goal, "index")
    made: Callable[[float], tuple[float, ...]] = _made(goal, text, **{"h": h, SPAN: span})["ahead"]
    return made


def _looking(goal: Goal, arguments: str) -> str:
    """Write the source of ``ahead``, which returns the entries AHEAD of the observation."""
    lines = [*goal.aimed()[-1:], *goal.ahead(), f"return {', '.join(AHEAD)}"]
    return f"def ahead({arguments}):\n" + "".join(f"    {line}\n" for line in lines)


MOTION = ("index", "q", "turns", "v", "phi", "control", "omega0", "h")
"""Arguments of ``judge`` in the text of a goal; those BEFORE that it takes follow."""


def goal_text(goal: Goal) -> str:
    """Return the text of a program with the functions of a goal, and with two that call them.

    ``judge(index, q, turns, v, phi, control, omega0, h, *before)`` returns reward and loss, where ``before`` are the
    quantities ``goal.before``; with a reference, ``ahead(index, h, control_span)`` returns the entries AHEAD.
    """
    copies = with_callees([*goal.functions, sin, cos])
    further = [_looking(goal, f"index, h, {SPAN}")] if goal.reference else []
    return "\n\n".join([constants_text(copies), copied(copies, ""),
                        _judging(goal, ", ".join((*MOTION, *goal.before))), *further])


def _rebuilt(named: Sequence[Any], upright: bool, pieces: tuple[Piece, ...]) -> Goal:
    """Return an unpickled goal."""
    made = built(pieces)
    reward, lost, reference, begin = (made[function] if isinstance(function, str) else function for function in named)
    return Goal(reward, lost, reference, begin, upright, pieces)


def _made(goal: Goal, text: str, **numbers: float) -> dict[str, Any]:
    """Return the names of a text that Python interprets, with a goal's functions and some numbers."""
    functions = {function.__name__: function for function in (*goal.functions, sin, cos)}
    return executed(text, "task", {**functions, **numbers})
