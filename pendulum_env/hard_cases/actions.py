"""Hard cases: extreme and invalid actions of an agent, processed as in the environment but without Gymnasium.

In a control step the environment calls :func:`pendulum_env.tasks.action.torque_share`, then takes the machine's steps.
The tests run these cases through the environment and the vector environment, too, as other agents.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from integrators import Method
from pendulum_env.engine.machine import ANGLE, VELOCITY, Machine
from pendulum_env.hard_cases.case import ACCURATE, Case, Finding, Try, always, demand, followed, foreseen, sooner
from pendulum_env.hard_cases.fast_drive import PUSHED, torqued
from pendulum_env.tasks.action import ActionError, torque_share

GROUP = "actions"
PHASE, STEPS, START = 2.0, 40, 0.2
"""omega0 times the control step, number of control steps of a run, and initial angle [rad]."""


Start = Callable[[Method, float], Any]
"""``start(method, phase)`` returns an agent at rest at START, with control steps of ``phase`` = omega0 dt.

An agent has the attributes of Motored: ``hold`` and ``act``. The tests also start environments.
"""

ACTIONS = {
    # Every tenth is 1.5 times as large, so that some lie beyond the bounds -1 and 1.
    "random actions": ((np.random.default_rng(20).uniform(-1.0, 1.0, STEPS) * np.where(np.arange(STEPS) % 10, 1.0, 1.5)
                        ).astype(np.float32).astype(np.float64), PHASE),
    # The amplitude of the swing grows by 2 ANSWER in each half period of the pendulum.
    "bang-bang": (np.where(np.arange(STEPS) % 2, 1.0, -1.0), math.pi),
}
"""Name of a case -> its actions, and omega0 times the control step."""
MOTIONS = {name: torqued(name, np.clip(shares, -1.0, 1.0), phase, START, 64)
           for name, (shares, phase) in ACTIONS.items()}


def hold(method: Method, phase: float) -> int:
    """Return the number of integration steps of a method in a control step of ``phase`` = omega0 dt."""
    name = next((name for name, (_, other) in ACTIONS.items() if other == phase), "random actions")
    return MOTIONS[name].steps_and_error(method)[0]


class Motored:
    """Agent that advances a pendulum with a motor by one control step per action, without Gymnasium.

    Attributes:
        hold: integration steps per control step.
    """

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


def obeyed(name: str, start: Start = Motored) -> Try:
    """Return a function that judges a method by its motion under the actions of a case, against the closed form."""
    shares, phase = ACTIONS[name]

    def attempt(method: Method) -> Finding:
        agent = start(method, phase)
        rows = [(START, 0.0), *(agent.act(np.array([share], dtype=np.float32)) for share in shares)]
        angle, speed = np.array(rows).T
        return followed(MOTIONS[name], method, angle, speed * PUSHED.omega0)

    return attempt


def refused(action: Any, start: Start = Motored) -> Try:
    """Return a function that judges a method's run in which an invalid action is sent.

    The action must raise ActionError and leave the state unchanged.
    """

    def attempt(method: Method) -> Finding:
        tried, plain = start(method, PHASE), start(method, PHASE)
        for _ in range(3):
            tried.act(np.array([0.5])), plain.act(np.array([0.5]))
            said = "it accepts an action that is not finite"
            try:
                tried.act(action)
            except ActionError as error:
                said = "" if "finite" in str(error) else f"the message does not state the reason: {error}"
            demand(not said, said)
            same = tried.act(np.array([-1.0])) == plain.act(np.array([-1.0]))
            demand(same, "the refused action has changed the state")
        return Finding(ACCURATE)

    return attempt


def clipped(action: Any, bound: float, start: Start = Motored) -> Try:
    """Return a function that judges a method's run in which an action beyond the bounds is sent.

    The action must act exactly like the action ``bound``.
    """

    def attempt(method: Method) -> Finding:
        tried, plain = start(method, PHASE), start(method, PHASE)
        for _ in range(5):
            demand(tried.act(action) == plain.act(np.array([bound])), "it is not clipped to the bound")
        return Finding(ACCURATE)

    return attempt


def attempts(start: Start = Motored) -> dict[str, Try]:
    """Return, by name of the hard case, the function that judges a method under valid or invalid actions.

    ``start`` creates the agent that takes the control steps.
    """
    return {
        **{name: obeyed(name, start) for name in ACTIONS},
        "NaN": refused(np.array([math.nan]), start),
        "infinity": refused(np.array([math.inf], dtype=np.float32), start),
        "minus infinity": refused(np.array([-math.inf]), start),
        "1e308": clipped(np.array([1e308]), 1.0, start),
        "minus 1e308": clipped(np.array([-1e308]), -1.0, start),
    }


_WHY = {
    "random actions": "The torque jumps at random, and some actions lie beyond the bounds -1 and 1.",
    "bang-bang": "Full torque in phase with the swing increases the amplitude and every phase error.",
    "NaN": "A single action of NaN would make the state NaN for the rest of the run.",
    "infinity": "An infinite action is beyond the action space and cannot be scaled to a torque.",
    "minus infinity": "An infinite action is beyond the action space and cannot be scaled to a torque.",
}


def _case(name: str, attempt: Try) -> Case:
    """Return the case of a name; those of no motion end in an error or as another action does."""
    if name in MOTIONS:
        return foreseen(GROUP, MOTIONS[name], _WHY[name], "a rotation about the equilibrium angle in each control "
                        "step; the error is that of the method's formula",
                        "the driven oscillator in closed form (Landau & Lifshitz 1976, section 22)", attempt)
    why = _WHY.get(name, "If such an action were scaled to a torque before it is clipped, it would overflow.")
    truth = ("ActionError, then exactly the motion without this action" if name in _WHY
             else f"exactly the motion of action {'-1' if 'minus' in name else '1'}")
    return Case(name, GROUP, why, truth, "the action space Box(-1, 1) and its clipping, as documented for gym.make",
                PUSHED, always(ACCURATE), attempt)


CASES = tuple(_case(name, attempt) for name, attempt in attempts().items())
