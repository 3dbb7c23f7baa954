"""The ids of the environments, and the rule for the number of control steps after which an episode is truncated.

| given to ``gym.make`` or ``gym.make_vec`` | an episode ends after |
| --- | --- |
| ``max_episode_steps`` | this number of control steps, whatever the duration; -1 leaves the end to the duration |
| only ``duration``, or a task with one | the duration; refused if longer than the id's steps, warned of if shorter |
| neither | the id's steps |
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from gymnasium.wrappers import TimeLimit

from pendulum_env.common.checks import SceneError, whole_number

USUAL_ID = "LabPendulum-v0"
MOST_EPISODE_STEPS = 2**53


class Registered(int):
    """Number of control steps that an id is registered with.

    ``gym.make`` and ``gym.make_vec`` pass it on where the user gives no ``max_episode_steps``, so that its class tells
    it from an argument of the same value.
    """

    dtype = np.dtype(np.int64)  # Gymnasium 1.1 asks NumPy whether this class is one of whole numbers


REGISTERED = Registered(500)
"""Number of control steps of an episode of ``LabPendulum-v0``."""


class Id(NamedTuple):
    """What an id of the environment is registered with.

    Attributes:
        steps: number of control steps of an episode.
        keywords: the keywords that the id sets.
        reward_threshold: the mean return of 100 episodes from which the task counts as solved: 5 %, or two standard
            errors of such a mean where these are more, below what the controller ``swing_up`` earns in 1000 episodes
            or, of track, which it cannot play, the package's policy.
    """

    steps: Registered
    keywords: Mapping[str, Any]
    reward_threshold: float


# The velocity's bound of new ids is true: with float32's largest number, that of LabPendulum-v0, Gymnasium's
# RescaleObservation makes every velocity 0 without a word; at inf it refuses.
IDS: Mapping[str, Id] = MappingProxyType({
    USUAL_ID: Id(REGISTERED, {}, -580.0),
    "LabPendulumAnywhere-v0": Id(Registered(200), {
        "task": "swing_up_anywhere", "dt": 0.05, "substeps": 2, "velocity_bound": 10.0}, -78.0),
    "LabPendulumGymnasium-v0": Id(
        Registered(200), {"scene": "gymnasium", "task": "gymnasium", "velocity_bound": 8.0}, -168.0),
    "LabPendulumDmControl-v0": Id(Registered(1000), {
        "scene": "dm_control", "task": "dm_control", "velocity_bound": math.inf}, 790.0),
    "LabPendulumBalance-v0": Id(REGISTERED, {"task": "balance", "velocity_bound": math.inf}, 475.0),
    "LabPendulumTrack-v0": Id(REGISTERED, {"task": "track", "velocity_bound": math.inf}, -2.3),
    "LabPendulumMotorBench-v0": Id(REGISTERED, {"scene": "motor_bench", "velocity_bound": math.inf}, -693.0),
})
"""Id -> what it is registered with."""


BENCH_ID = "LabPendulumBench-v0"
"""Id of the environment of a bench, which is no simulation: it has no vector of its own, and repeats no run."""


def register() -> None:
    """Register all ids with Gymnasium."""
    gymnasium.register(
        id=BENCH_ID, entry_point="pendulum_env.bench.environment:LabPendulumBenchEnv", nondeterministic=True,
        max_episode_steps=REGISTERED)
    for name, (steps, keywords, threshold) in IDS.items():
        gymnasium.register(
            id=name, entry_point="pendulum_env.envs.env:LabPendulumEnv",
            vector_entry_point="pendulum_env.envs.vector_env:LabPendulumVectorEnv", max_episode_steps=steps,
            reward_threshold=threshold, kwargs=dict(keywords))


def checked_steps(steps: Any, name: str = "max_episode_steps") -> int | None:
    """Return the argument ``max_episode_steps`` of a vector of environments, None for -1, which is no limit.

    Raises SceneError for what is no number of steps.
    """
    if steps is None or isinstance(steps, Registered) or (type(steps) is int and steps == -1):
        return None if steps == -1 else steps
    return whole_number(steps, name, MOST_EPISODE_STEPS)


def episode_steps(own: int | None, limit: int | None) -> int | None:
    """Return the number of control steps of an episode, None for no end.

    ``own`` is the number in the duration, ``limit`` the registered number or the argument ``max_episode_steps``.
    """
    return own if limit is None or (own is not None and isinstance(limit, Registered)) else limit


def check_duration(
    tell: Callable[[Iterable[str]], None], spec: gymnasium.envs.registration.EnvSpec | None, own: int | None,
    limit: int | None, dt: float, task: str,
) -> None:
    """Compare the ``own`` number of control steps in a duration with the registered number ``limit``.

    Raises SceneError if the duration is longer, and lets ``tell`` emit a warning if it is shorter, because wrappers
    such as TimeAwareObservation read the id's number. Another limit is an argument, which sets the length by itself.
    """
    if own is None or own == limit or not isinstance(limit, Registered):
        return
    name = USUAL_ID if spec is None else spec.id
    others = [f", or make {other}, which has {own}" for other, (steps, keywords, _) in IDS.items()
              if other != name and steps == own and keywords.get("task") == task]
    remedy = f"give max_episode_steps={own}{''.join(others)}."
    if own > limit:
        raise SceneError(f"An episode of {own * dt:g} s has {own} control steps of dt={dt:g} s, but {name} ends it "
                         f"after {limit}; {remedy}")
    tell([f"Episodes of {own * dt:g} s end after {own} control steps, but wrappers read {limit}, the number of {name}; "
          f"{remedy}"])


def time_limit(env: gymnasium.Env[Any, Any]) -> int | None:
    """Return the limit of the TimeLimit wrapper that calls ``env.reset``, the smallest of several, None without one.

    ``gym.make`` adds the wrapper afterwards and tells the environment nothing, so that only the calls show it.
    """
    limits: list[int] = []
    frame = inspect.currentframe()
    while frame is not None:
        if frame.f_code is TimeLimit.reset.__code__ and frame.f_locals["self"].unwrapped is env:
            limits.append(frame.f_locals["self"].get_wrapper_attr("_max_episode_steps"))
        frame = frame.f_back
    return min(limits, default=None)
