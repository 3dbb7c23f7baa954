"""Hard cases: what an agent may send to the motor. The environment's path of an action, without Gymnasium around it.

What a control step of the environment does to its state is :func:`pendulum_env.tasks.action.torque_share`, then the
machine's steps. The tests run the same cases through the environment and the vector of environments, as another
``Agent``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from integrators import Method
from pendulum_env.engine.machine import ANGLE, VELOCITY, Machine
from pendulum_env.engine.starts import fewest_substeps
from pendulum_env.hard_cases.case import ACCURATE, WRONG, Case, Finding, Try, always, resolved, sooner
from pendulum_env.hard_cases.fast_drive import PUSHED, answered, pushed
from pendulum_env.tasks.action import ActionError, torque_share

Array = NDArray[np.float64]
GROUP = "actions"
PHASE, STEPS, START = 0.1, 150, 0.2
"""omega0 times the control step, control steps of a run, and its start [rad]."""
HALF_SWING = 16
"""Control steps in half a swing of the resonant bang-bang."""


class Agent(Protocol):
    """What steps by actions: a machine here, an environment in the tests."""

    hold: int

    def act(self, action: Any) -> tuple[float, float]:
        """Angle [rad] and velocity/omega0 after a control step; ActionError, and no step, for what is no action."""


Start = Callable[[Method, float], Agent]
"""``start(method, phase)``: at rest at START, with control steps of ``phase`` = omega0 dt."""


class Motored:
    """A machine under actions."""

    def __init__(self, method: Method, phase: float) -> None:
        self.hold = max(8, fewest_substeps(method, PUSHED))
        self._machine = Machine(PUSHED, method, backend=sooner(method, self.hold * STEPS))
        self._state = self._machine.state(START, 0.0)
        self._h = phase / PUSHED.omega0 / self.hold

    def act(self, action: Any) -> tuple[float, float]:
        share = torque_share(action)
        if self._machine.advance(self._state, share, self._h, self.hold):
            raise ArithmeticError("The run stopped under bounded torque.")
        return float(self._state[ANGLE]), float(self._state[VELOCITY]) / PUSHED.omega0


def followed(shares: Array, phase: float, start: Start = Motored) -> Try:
    """Actions decided beforehand, against the closed form."""

    def attempt(method: Method) -> Finding:
        agent = start(method, phase)
        rows = np.array([(START, 0.0), *(agent.act(np.array([share], dtype=np.float32)) for share in shares)])
        truth = np.stack(pushed(np.clip(shares, -1.0, 1.0), phase, START))
        return answered(method, rows.T, truth, phase, agent.hold)

    return attempt


def random_shares() -> Array:
    """Uniform in the box of actions, as float32 holds them; one in ten beyond it by half, to be clipped."""
    generator = np.random.default_rng(20)
    found = generator.uniform(-1.0, 1.0, STEPS)
    found[::10] *= 1.5
    return found.astype(np.float32).astype(np.float64)


def resonant_shares() -> Array:
    """Full torque to one side and the other, half a swing each: the amplitude grows by 2 ANSWER each."""
    return np.where(np.arange(STEPS) // HALF_SWING % 2, 1.0, -1.0)


def refused(action: Any, start: Start = Motored) -> Try:
    """An action that is none: refused by name, and nothing has moved, so that the next steps give the same bits."""

    def attempt(method: Method) -> Finding:
        tried, plain = start(method, PHASE), start(method, PHASE)
        for _ in range(3):
            tried.act(np.array([0.5])), plain.act(np.array([0.5]))
            try:
                tried.act(action)
            except ActionError as error:
                if "finite" not in str(error):
                    return Finding(WRONG, note=f"the message does not say why: {error}")
            else:
                return Finding(WRONG, note="it takes what is not finite")
            if tried.act(np.array([-1.0])) != plain.act(np.array([-1.0])):
                return Finding(WRONG, note="the refused action has changed the state")
        return Finding(ACCURATE)

    return attempt


def clipped(action: Any, bound: float, start: Start = Motored) -> Try:
    """An action beyond the box: the bits of its bound."""

    def attempt(method: Method) -> Finding:
        tried, plain = start(method, PHASE), start(method, PHASE)
        same = all(tried.act(action) == plain.act(np.array([bound])) for _ in range(5))
        return Finding(ACCURATE) if same else Finding(WRONG, note="it is not clipped to the bound")

    return attempt


def attempts(start: Start = Motored) -> dict[str, Try]:
    """What is tried in each case, by its name."""
    return {
        "random actions": followed(random_shares(), PHASE, start),
        "bang-bang": followed(resonant_shares(), math.pi / HALF_SWING, start),
        "NaN": refused(np.array([math.nan]), start),
        "infinity": refused(np.array([math.inf], dtype=np.float32), start),
        "minus infinity": refused(np.array([-math.inf]), start),
        "1e308": clipped(np.array([1e308]), 1.0, start),
        "minus 1e308": clipped(np.array([-1e308]), -1.0, start),
    }


_CLOSED = "a rotation about the angle that the torque holds for each control step; allowed is (omega0 h)^p omega0 t"
_ROTATIONS = "the driven oscillator in closed form (Landau & Lifshitz 1976, section 22)"
_BOX = "the action space Box(-1, 1) and its clip, as documented for gym.make"
_TEXTS = {
    "random actions": ("The torque jumps at random, now and then from beyond the box.", _CLOSED, _ROTATIONS),
    "bang-bang": ("Full torque in time with the swing pumps it up, with every error in phase.", _CLOSED, _ROTATIONS),
    "NaN": ("One NaN would stay in the state for good.", "ActionError, and the bits of a run without it", _BOX),
    "infinity": ("It is beyond the box, and no share of a torque.", "ActionError, and the bits of a run without it",
                 _BOX),
    "minus infinity": ("It is beyond the box, and no share of a torque.",
                       "ActionError, and the bits of a run without it", _BOX),
    "1e308": ("Scaled before it is clipped it would overflow.", "the bits of action 1", _BOX),
    "minus 1e308": ("Scaled before it is clipped it would overflow.", "the bits of action -1", _BOX),
}

CASES = tuple(
    Case(name, GROUP, *_TEXTS[name], PUSHED, resolved if _TEXTS[name][2] == _ROTATIONS else always(ACCURATE), attempt)
    for name, attempt in attempts().items()
)
KNOWN: dict[tuple[str, str], str] = {}
"""(case, method) -> why it fails."""
