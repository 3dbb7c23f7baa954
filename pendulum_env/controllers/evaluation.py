"""What a policy earns: the returns of whole episodes of a vector of environments, one of each."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pendulum_env.physics.units import SceneError, shown, whole_number

NEAR = 0.2
"""Angle from upright, or from the reference, up to which the bob counts as there [rad]."""


class Evaluation(NamedTuple):
    """Returns of a policy in episodes, one for each environment of a vector.

    Attributes:
        returns: the sum of rewards of each episode, an array ``(n,)``.
        steps: its number of control steps, an array ``(n,)``.
        reached: True where it ended within 0.2 rad of upright, or of the reference of a task that has one, and was not
            lost; an array ``(n,)``.
    """

    returns: NDArray[np.float64]
    steps: NDArray[np.intp]
    reached: NDArray[np.bool_]


def evaluate(policy: Callable[[Any], Any], env: Any, seed: int = 0) -> Evaluation:
    """Return what a policy earns in one episode of each environment of a vector::

        vector = gym.make_vec("LabPendulum-v0", 1000, diagnostics=())
        evaluate(pendulum_env.controllers.load("swing_up"), vector, seed=10**6).returns.mean()

    Args:
        policy: function of observations ``(n, k)`` that returns actions ``(n, 1)``.
        env: a vector of LabPendulum environments of ``gym.make_vec``, with an end of its episodes.
        seed: that of the first environment's episode; that of environment i is ``seed + i``.

    Raises SceneError for another policy, env or seed, and for a vector whose episodes never end.
    """
    inner: Any = getattr(env, "unwrapped", None)
    try:
        count, task, limit = env.num_envs, inner.task, inner.max_episode_steps
    except AttributeError:
        raise SceneError("env must be a vector of LabPendulum environments, as gym.make_vec makes it, not "
                         f"{shown(env)}.") from None
    if not callable(policy):
        raise SceneError(f"policy must be a function from observations to actions, not {shown(policy)}.")
    if limit in (None, -1):
        raise SceneError("Episodes of env never end; make it with a max_episode_steps.")
    seen, _ = env.reset(seed=whole_number(seed, "seed", least=0))
    returns, steps = np.zeros(count), np.zeros(count, np.intp)
    reached, running = np.zeros(count, np.bool_), np.ones(count, np.bool_)
    while running.any():
        seen, rewards, lost, late, infos = env.step(policy(seen))
        returns[running] += rewards[running]
        steps[running] += 1
        ends = running & (lost | late)
        if ends.any():
            final = infos.get("final_obs", seen)  # with SameStep, seen is already that of the next episodes
            last = np.stack([final[i] for i in np.flatnonzero(ends)])
            reached[ends] = ~lost[ends] & (_away(last, task) < NEAR)
            running &= ~ends
    return Evaluation(returns, steps, reached)


def _away(observation: Any, task: Any) -> Any:
    """Return the angles from upright, or from the reference, of observations ``(n, k)`` [rad]."""
    cosine, sine = observation[:, :2].T
    aim = observation[:, 3:5].T if task.goal.reference is not None else (1.0 if task.upright else -1.0, 0.0)
    return np.abs(np.arctan2(sine * aim[0] - cosine * aim[1], cosine * aim[0] + sine * aim[1]))
