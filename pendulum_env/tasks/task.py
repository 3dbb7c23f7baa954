"""The class :class:`Task`: reward, loss, start and length of an episode, from plain functions."""

from __future__ import annotations

import difflib
import math
import random
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from types import FunctionType, MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.checks import boolean, line, nearest, number, shown
from pendulum_env.engine.goal import BEFORE, FOLLOWED, OFFERED, Goal, Judge, judge
from pendulum_env.engine.reading import Function, arguments
from pendulum_env.tasks.translate import TaskError, Translator, is_ours

Numbers = float | NDArray[np.float64]
"""A number, or an array of numbers."""
Range = tuple[float, float]

START: Mapping[str, str] = MappingProxyType({
    "angle": "angle from hanging [rad]", "velocity": "angular velocity [rad/s]", "speed": "velocity/omega0",
})
"""Ranges of a start, by name; "velocity" and "speed" exclude each other."""
BEGIN: Mapping[str, str] = MappingProxyType({
    "first": "a random number, uniform in [0, 1)", "second": "another one", "omega0": OFFERED["omega0"].meaning,
})
"""Quantities that a function for the start may take."""
REFERENCE: Mapping[str, str] = MappingProxyType({"time": OFFERED["time"].meaning})
"""Quantities that a reference may take."""
MOST_STEPS = 2**53
TRIALS = 60
"""Number of drawn states with which a task's functions are tried."""


def _never(phi: float) -> bool:
    return False


@dataclass(frozen=True)
class Task:
    """A task: where an episode starts, the reward of a control step, and when the episode ends.

    ``reward``, ``lost``, ``reference`` and a function for ``start`` are plain Python functions, made with def or
    lambda, whose argument names choose the quantities that they get (:data:`QUANTITIES`)::

        Task("spin", reward=lambda velocity, action: velocity - 0.1*action**2)

    They may use assignments, if and else, ``+ - * / **``, comparisons, and, or, not, numbers of their module or of an
    outer function (their values when the task is made), arguments with a number as default, abs, min, max, and sin,
    cos, tanh, exp, log, sqrt, pow and atan2 of math or numpy. The package's own functions replace these, with equal
    bits on every machine, compiled or not. They may call other plain functions. Their source is copied into the
    generated program, so it must be in a file or a notebook.

    The quantities are those after the control step; those with names in _before are those at its start.

    Attributes:
        name: the task's name, for messages and tables.
        reward: function that returns the reward of a control step.
        lost: function that returns True where the task is lost, which ends the episode ("fell"); by default never.
        start: ranges of the start by name, as ``{"angle": (-0.1, 0.1), "speed": 0.0}``: "angle" from hanging [rad], and
            "velocity" [rad/s] or "speed" (velocity/omega0); a pair is a uniform distribution, and a quantity that is
            left out is 0. Or a function of "first" and "second", random numbers in [0, 1), and of "omega0" [1/s] that
            returns angle [rad] and velocity [rad/s]. None for the scene's usual run.
        reference: function of "time" [s] that returns the angle to follow [rad]; reward and lost may then take
            "reference" and "error", and the observation has four more entries: cosine and sine of the reference now
            and after the next control step.
        duration: length of an episode [s]; None for the number of steps that gym.make and make_vec count, 500.
        upright: True if the observation's cosine and sine are those of the angle from upright, as in Pendulum-v1.
        equation: the reward as text, for tables.
        ends: when the task is lost, as text; "-" for never.
        widths: names of two options of ``reset`` that set the half widths of the start's ranges of angle and velocity
            about their centres, such as Pendulum-v1's x_init and y_init.

    Raises TaskError for a function that cannot be copied, takes unknown quantities, or raises or returns anything but
    finite numbers at one of 60 drawn states, and for a range whose ends are reversed.
    """

    name: str
    reward: Function = field(compare=False)  # tasks are compared by the functions of their goals
    lost: Function | None = field(default=None, compare=False)
    start: Mapping[str, Any] | Function | None = field(default=None, compare=False)
    reference: Function | None = field(default=None, compare=False)
    duration: float | None = None
    upright: bool = False
    equation: str = field(default="", kw_only=True)
    ends: str = field(default="-", kw_only=True)
    widths: tuple[str, ...] = field(default=(), kw_only=True, compare=False)

    goal: Goal = field(init=False, repr=False)
    begin: Function | None = field(init=False, repr=False)
    ranges: Mapping[str, Range] = field(init=False, repr=False, hash=False)

    def __post_init__(self) -> None:
        """Check and translate the functions, and try them."""
        name = line(self.name, "The name of a task")
        ranges = self.start if isinstance(self.start, Mapping) else {}
        follows = self.reference is not None
        quantities = {name: one.meaning for name, one in OFFERED.items() if follows or name not in FOLLOWED}
        given: dict[str, tuple[Any, Mapping[str, str]]] = {
            "reward": (self.reward, quantities), "lost": (_never if self.lost is None else self.lost, quantities),
            "reference": (self.reference, REFERENCE),
            "start": (None if isinstance(self.start, Mapping) else self.start, BEGIN)}
        translator, made = Translator(name), dict[str, Any](reference=None, start=None)
        for role, (function, offered) in given.items():
            if function is not None or role not in made:
                made[role] = translator.plain(function, role)
                self._check_names(role, made[role], offered)
        begin = made["start"]  # the package's own takes arrays, and need not be copied into a program
        goal = Goal(made["reward"], made["lost"], made["reference"], None if begin is None or is_ours(begin) else begin,
                    boolean(self.upright, "upright"), tuple(translator.pieces))
        for name_of, text in (("equation", self.equation), ("ends", self.ends)):
            if not isinstance(text, str):
                raise TaskError(f"{name_of} of the task {shown(name)} must be text, not {shown(text)}.")
        two = isinstance(self.widths, tuple) and len(self.widths) in (0, 2)
        if not two or (self.widths and not {"angle", "velocity"} <= set(ranges)):
            raise TaskError(f"widths of the task {shown(name)} must be two names of options, for ranges of angle and "
                            f"velocity, not {shown(self.widths)}.")
        length = None if self.duration is None else number(self.duration, "duration", above=0.0, unit="s")
        ranges = _checked_ranges(name, ranges) if isinstance(self.start, Mapping) else {}
        vars(self).update(goal=goal, begin=begin, ranges=MappingProxyType(ranges), duration=length)
        self._try()

    def _check_names(self, role: str, function: FunctionType, offered: Mapping[str, str]) -> None:
        """Raise TaskError if a function takes a quantity that is not offered."""
        for name in arguments(function):
            if name not in offered:
                near = difflib.get_close_matches(name, offered, 1)
                more = f"; did you mean {near[0]}?" if near else "."
                if role in ("reward", "lost") and name in FOLLOWED:
                    raise TaskError(f"{role} of the task {shown(self.name)} takes {name}, which needs a reference.")
                raise TaskError(f"{role} of the task {shown(self.name)} has the argument {shown(name)}, and may have "
                                f"{', '.join(offered)}{more}")

    # --- what environments call -------------------------------------------------------------------------------------

    @property
    def draws(self) -> bool:
        """Return True if starts are drawn, False if episodes start with the scene's usual run."""
        return self.start is not None

    @property
    def own(self) -> bool:
        """Return True if a function is the user's, so that rewards are checked in every step."""
        return bool(self.goal.pieces)

    def starts(self, first: Numbers, second: Numbers, omega0: Numbers) -> tuple[Numbers, Numbers]:
        """Return the angle [rad] and velocity [rad/s] at which an episode starts, from two random numbers in [0, 1).

        ``omega0`` is the small-angle frequency [1/s]. With ranges all arguments may be arrays, for many episodes.
        """
        if self.begin is not None:
            values = {"first": first, "second": second, "omega0": omega0}
            angle, velocity = self.begin(*(values[name] for name in arguments(self.begin)))
            return angle, velocity
        low, high = self.ranges["angle"]
        angle = low + (high - low) * first
        if "speed" in self.ranges:
            low, high = self.ranges["speed"]
            return angle, omega0 * (low + (high - low) * second)
        low, high = self.ranges["velocity"]
        return angle, low + (high - low) * second

    def within(self, widths: Mapping[str, Any]) -> Task:
        """Return this task with other half widths of its start's ranges, from options of ``reset`` by name.

        Raises SceneError for a half width that is not a number of at least 0.
        """
        if not widths:
            return self
        ranges = dict(self.ranges)
        for option, name in zip(self.widths, ("angle", "velocity"), strict=True):
            if option in widths:
                half, centre = number(widths[option], option, least=0.0), 0.5 * sum(ranges[name])
                ranges[name] = (centre - half, centre + half)
        other = object.__new__(Task)
        vars(other).update(vars(self), ranges=MappingProxyType(ranges))
        return other

    def judge(self, omega0: float, h: float) -> Judge:
        """Return the function that computes reward and loss of a control step.

        See :func:`pendulum_env.engine.goal.judge`. ``omega0`` is the small-angle frequency [1/s], ``h`` the step [s].
        """
        return judge(self.goal, omega0, h)

    def steps(self, dt: float) -> int | None:
        """Return the number of control steps of ``dt`` [s] nearest to the task's duration, None without one."""
        return None if self.duration is None else max(1, min(round(min(self.duration / dt, MOST_STEPS)), MOST_STEPS))

    def __reduce__(self) -> tuple[Callable[..., Task], tuple[Any, ...]]:
        """Return the parts from which a copy is rebuilt: texts of functions in place of the functions."""
        mine = {**vars(self), "reward": None, "lost": None, "reference": None, "ranges": dict(self.ranges),
                "start": dict(self.start) if isinstance(self.start, Mapping) else None,
                "begin": self.begin if self.goal.begin is None else None}
        return _rebuilt, (mine,)

    # --- trials -----------------------------------------------------------------------------------------------------

    def _try(self) -> None:
        """Call the functions with drawn states; TaskError if one raises, or returns anything but finite numbers."""
        source = random.Random(0)
        judges: dict[float, Judge] = {}
        for state in _drawn_states(source):
            omega0 = state["omega0"]
            if omega0 not in judges:
                judges[omega0] = judge(self.goal, omega0, 1.0)
            before = {name: state[name] for name in BEFORE}
            near = state["phi"] + math.pi
            reward, lost = self._tried(
                "reward or lost", state, judges[omega0], state["time"], near, 0.0, state["velocity"], state["phi"],
                state["action"], before)
            if not (isinstance(reward, float) and math.isfinite(reward)):
                raise self._untrue("reward", reward, state, "a finite number")
            if not isinstance(lost, bool):
                raise self._untrue("lost", lost, state, "True or False")
            if self.goal.reference is not None:
                aim = self._tried("reference", state, self.goal.reference, state["time"])
                if not (isinstance(aim, float) and abs(aim) < 1e6):
                    raise self._untrue("reference", aim, state, "an angle [rad]")
            if self.begin is not None:
                pair = self._tried("start", state, self.starts, source.random(), source.random(), omega0)
                if not all(isinstance(one, float) and math.isfinite(one) for one in pair):
                    raise self._untrue("start", pair, state, "two finite numbers, angle and velocity")

    def _tried(self, role: str, state: Mapping[str, float], function: Callable[..., Any], *given: Any) -> Any:
        try:
            return function(*given)
        except (ArithmeticError, ValueError, TypeError) as error:
            raise TaskError(f"{role} of the task {shown(self.name)} raises {type(error).__name__} ({error}) at "
                            f"{_said(state)}.") from None

    def _untrue(self, role: str, value: Any, state: Mapping[str, float], wanted: str) -> TaskError:
        return TaskError(f"{role} of the task {shown(self.name)} returns {shown(value)} at {_said(state)}; it must "
                         f"return {wanted}.")


QUANTITIES: Mapping[str, str] = MappingProxyType({name: one.meaning for name, one in OFFERED.items()})
"""The quantities that a task's reward and lost may take, by the names of their arguments, with units."""


def steps_of(duration: Any, dt: float) -> int:
    """Return the number of control steps of ``dt`` [s] in an episode of ``duration`` [s].

    Raises TaskError for a duration below ``dt``, and for one that is not a whole number of steps.
    """
    length = number(duration, "duration", above=0.0, unit="s")
    if length < dt * (1.0 - 1e-9):
        raise TaskError(f"duration={length:g} s is shorter than a control step of dt={dt:g} s; take {dt:g} s or more.")
    count = length / dt
    if count > MOST_STEPS:
        raise TaskError(f"duration={length:g} s is more than {MOST_STEPS} control steps of dt={dt:g} s.")
    whole = round(count)
    if abs(count - whole) > 1e-6 * count:
        raise TaskError(f"duration={length:g} s is not a whole number of control steps of dt={dt:g} s; the nearest is "
                        f"{whole * dt:.10g} s.")
    return whole


def earlier(names: Sequence[str], phi: Any, angle: Any, turns: Any, velocity: Any) -> dict[str, Any]:
    """Return those of a task's quantities that are of the start of a control step, by name: ``goal.before``.

    ``angle`` [rad] and ``turns`` are those of the state, which is that at the start of the step; they may be arrays.
    """
    values = {"phi_before": phi, "angle_before": angle + 2.0 * math.pi * turns, "velocity_before": velocity}
    return {name: values[name] for name in names}


def _checked_ranges(task: str, given: Mapping[str, Any]) -> dict[str, Range]:
    """Return the ranges of a start, complete; TaskError for unknown names, and for reversed ends."""
    ranges: dict[str, Range] = {}
    for name, values in given.items():
        if name not in START:
            raise TaskError(f"start of the task {shown(task)} has no {shown(name)}{nearest(name, START)}")
        pair = values if isinstance(values, Sequence) and not isinstance(values, str) else (values, values)
        if len(pair) != 2:
            raise TaskError(f"{name} in start of the task {shown(task)} must be a number or a pair of numbers, not "
                            f"{shown(values)}.")
        low, high = (number(value, f"{name} in start") for value in pair)
        if low > high:
            raise TaskError(f"{name} in start of the task {shown(task)} is upside down: ({low:g}, {high:g}); the lower "
                            "end comes first.")
        ranges[name] = (low, high)
    if {"velocity", "speed"} <= set(ranges):
        raise TaskError(f"start of the task {shown(task)} has both velocity and speed, which is velocity/omega0; leave "
                        "one out.")
    ranges.setdefault("angle", (0.0, 0.0))
    if "speed" not in ranges:
        ranges.setdefault("velocity", (0.0, 0.0))
    return ranges


def _drawn_states(source: random.Random) -> Iterator[dict[str, float]]:
    """Yield states with which a task's functions are tried: at rest at top and bottom, and drawn at random."""
    for trial in range(TRIALS):
        phi, speed = source.uniform(-math.pi, math.pi), source.uniform(-3.0, 3.0)
        action, time = source.uniform(-1.0, 1.0), source.uniform(0.0, 20.0)
        if trial < 4:
            phi, speed = (0.0, math.pi)[trial % 2], 0.0
            action, time = (0.0, 1.0)[trial // 2], 0.0
        omega0 = (5.25, 1.0)[trial % 2]
        other = source.uniform(-math.pi, math.pi) if trial >= 4 else phi
        yield {"phi": phi, "velocity": speed * omega0, "action": action, "time": time, "omega0": omega0,
               "phi_before": other, "angle_before": other + math.pi, "velocity_before": source.uniform(-9.0, 9.0)}


def _said(state: Mapping[str, float]) -> str:
    """Return the numbers of a state in words, for messages."""
    return ", ".join(f"{name}={state[name]:.4g}" for name in ("phi", "velocity", "action", "time"))


def _rebuilt(saved: Mapping[str, Any]) -> Task:
    """Return an unpickled task, whose functions are those of its goal."""
    task, goal = object.__new__(Task), saved["goal"]
    begin = saved["begin"] if goal.begin is None else goal.begin
    start = begin if saved["start"] is None else saved["start"]
    vars(task).update(saved, reward=goal.reward, lost=goal.lost, reference=goal.reference, begin=begin, start=start,
                      ranges=MappingProxyType(saved["ranges"]))
    return task
