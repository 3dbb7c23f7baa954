"""Hard cases: extreme and invalid actions of an agent, processed as in the environment but without Gymnasium.

In a control step the environment calls :func:`pendulum_env.tasks.action.torque_share`, then takes the machine's steps.
The tests run these cases through the environment and the vector environment, too, as other ``Agent`` classes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from integrators import Method
from pendulum_env.engine.machine import ANGLE, VELOCITY, Machine
from pendulum_env.hard_cases.case import ACCURATE, WRONG, Case, Finding, Try, always, sooner
from pendulum_env.hard_cases.fast_drive import PUSHED, pushed, torqued
from pendulum_env.hard_cases.predicted import expected, held, steps_and_error
from pendulum_env.tasks.action import ActionError, torque_share

Array = NDArray[np.float64]
GROUP = "actions"
PHASE, STEPS, START = 2.0, 40, 0.2
"""omega0 times the control step, number of control steps of a run, and initial angle [rad]."""


class Agent(Protocol):
    """Protocol of an object that takes control steps under actions.

    It is a machine (compiled program of a scene with a method) in the hard cases, and an environment in the tests.

    Attributes:
        hold: integration steps per control step.
    """

    hold: int

    def act(self, action: Any) -> tuple[float, float]:
        """Take a control step and return angle [rad] and velocity/omega0.

        Raises ActionError for an invalid action, without a step.
        """


Start = Callable[[Method, float], Agent]
"""``start(method, phase)`` returns an Agent at rest at START, with control steps of ``phase`` = omega0 dt."""


def hold(method: Method, phase: float) -> int:
    """Return the number of integration steps of a method in a control step of ``phase`` = omega0 dt."""
    name = next((name for name, (_, other) in ACTIONS.items() if other == phase), "random actions")
    return steps_and_error(name, MOTIONS[name], method)[0]


class Motored:
    """Agent that advances a pendulum with a motor by one control step per action, without Gymnasium."""

    def __init__(self, method: Method, phase: float) -> None:
        self.hold = hold(method, phase)
        self._machine = Machine(PUSHED, method, backend=sooner(method, self.hold * STEPS))
        self._state = self._machine.state(START, 0.0)
        self._h = phase / PUSHED.omega0 / self.hold

    def act(self, action: Any) -> tuple[float, float]:
        """Take a control step and return angle [rad] and velocity/omega0; raises ActionError for an invalid action."""
        share = torque_share(action)
        if self._machine.advance(self._state, share, self._h, self.hold):
            raise ArithmeticError(
                "The run stopped early (it diverged), although the torque is bounded; take shorter steps.")
        return float(self._state[ANGLE]), float(self._state[VELOCITY]) / PUSHED.omega0


def followed(name: str, start: Start = Motored) -> Try:
    """Return a function that judges a method by its motion under the actions of a case, against the closed form."""
    shares, phase = ACTIONS[name]

    def attempt(method: Method) -> Finding:
        agent = start(method, phase)
        rows = np.array([(START, 0.0), *(agent.act(np.array([share], dtype=np.float32)) for share in shares)])
        truth = np.stack(pushed(np.clip(shares, -1.0, 1.0), phase, START))
        return held(name, MOTIONS[name], method, (rows.T - truth) / MOTIONS[name].largest)

    return attempt


def random_shares() -> Array:
    """Return uniform random actions, rounded to float32.

    Every tenth is 1.5 times as large, so that some lie beyond the bounds -1 and 1 and must be clipped.
    """
    generator = np.random.default_rng(20)
    shares = generator.uniform(-1.0, 1.0, STEPS)
    shares[::10] *= 1.5
    return shares.astype(np.float32).astype(np.float64)


def resonant_shares() -> Array:
    """Return actions of full torque that change sign after every control step, which is half a period of the pendulum.

    The amplitude of the swing grows by 2 ANSWER in each half period.
    """
    return np.where(np.arange(STEPS) % 2, 1.0, -1.0)


def refused(action: Any, start: Start = Motored) -> Try:
    """Return a function that judges a method's run in which an invalid action is sent.

    The action must raise ActionError and leave the state unchanged.
    """

    def attempt(method: Method) -> Finding:
        tried, plain = start(method, PHASE), start(method, PHASE)
        for _ in range(3):
            tried.act(np.array([0.5])), plain.act(np.array([0.5]))
            try:
                tried.act(action)
            except ActionError as error:
                if "finite" not in str(error):
                    return Finding(WRONG, note=f"the message does not state the reason: {error}")
            else:
                return Finding(WRONG, note="it accepts an action that is not finite")
            if tried.act(np.array([-1.0])) != plain.act(np.array([-1.0])):
                return Finding(WRONG, note="the refused action has changed the state")
        return Finding(ACCURATE)

    return attempt


def clipped(action: Any, bound: float, start: Start = Motored) -> Try:
    """Return a function that judges a method's run in which an action beyond the bounds is sent.

    The action must act exactly like the action ``bound``.
    """

    def attempt(method: Method) -> Finding:
        tried, plain = start(method, PHASE), start(method, PHASE)
        equal = all(tried.act(action) == plain.act(np.array([bound])) for _ in range(5))
        return Finding(ACCURATE) if equal else Finding(WRONG, note="it is not clipped to the bound")

    return attempt


ACTIONS = {"random actions": (random_shares(), PHASE), "bang-bang": (resonant_shares(), math.pi)}
"""Name of a case -> its actions, and omega0 times the control step."""
MOTIONS = {name: torqued(np.clip(shares, -1.0, 1.0), phase, START, 64) for name, (shares, phase) in ACTIONS.items()}
"""Motions with predicted errors."""


def attempts(start: Start = Motored) -> dict[str, Try]:
    """Return, by name of the hard case, the function that judges a method under valid or invalid actions.

    ``start`` creates the agent that takes the control steps.
    """
    return {
        **{name: followed(name, start) for name in ACTIONS},
        "NaN": refused(np.array([math.nan]), start),
        "infinity": refused(np.array([math.inf], dtype=np.float32), start),
        "minus infinity": refused(np.array([-math.inf]), start),
        "1e308": clipped(np.array([1e308]), 1.0, start),
        "minus 1e308": clipped(np.array([-1e308]), -1.0, start),
    }


_CLOSED = "a rotation about the equilibrium angle in each control step; the error is that of the method's formula"
_ROTATIONS = "the driven oscillator in closed form (Landau & Lifshitz 1976, section 22)"
_BOX = "the action space Box(-1, 1) and its clipping, as documented for gym.make"
_REFUSED = "ActionError, then exactly the motion without this action"
_INFINITE = "An infinite action is beyond the action space and cannot be scaled to a torque."
_OVERFLOW = "If such an action were scaled to a torque before it is clipped, it would overflow."
_TEXTS = {
    "random actions": ("The torque jumps at random, and some actions lie beyond the bounds -1 and 1.", _CLOSED,
                       _ROTATIONS),
    "bang-bang": ("Full torque in phase with the swing increases the amplitude and every phase error.", _CLOSED,
                  _ROTATIONS),
    "NaN": ("A single action of NaN would make the state NaN for the rest of the run.", _REFUSED, _BOX),
    "infinity": (_INFINITE, _REFUSED, _BOX),
    "minus infinity": (_INFINITE, _REFUSED, _BOX),
    "1e308": (_OVERFLOW, "exactly the motion of action 1", _BOX),
    "minus 1e308": (_OVERFLOW, "exactly the motion of action -1", _BOX),
}

CASES = tuple(
    Case(name, GROUP, *_TEXTS[name], PUSHED,
         expected(name, MOTIONS[name]) if name in MOTIONS else always(ACCURATE), attempt,
         motion=name if name in MOTIONS else "")
    for name, attempt in attempts().items()
)
KNOWN: dict[tuple[str, str], str] = {}
"""(case, method) -> reason of a known failure."""
