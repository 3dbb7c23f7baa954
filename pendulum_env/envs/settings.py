"""Settings, start options and spaces that single and vector environments share."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector.utils import batch_space

from integrators import Method
from pendulum_env.engine.report import SEEN
from pendulum_env.engine.sensing import Plan
from pendulum_env.films.look import checked_look, checked_size
from pendulum_env.physics.presets import EPISODES, SCENES, find_scene
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, boolean, nearest, number, one_of, shown, whole_number
from pendulum_env.render import FrameStyle
from pendulum_env.tasks import USUAL_TASK, Task, find_task
from pendulum_env.tasks.task import steps_of

UNBOUNDED = float(np.finfo(np.float32).max)
"""Bound of the observed velocity by default: the largest float32, because checkers warn at inf [rad/s]."""
START = ("angle", "velocity")
"""Names of the options of ``reset``."""
MOST_SUBSTEPS = 10**9
USUAL_EPISODE = "rk4", 0.02
"""Method and control step [s] of an environment that is made without them."""
RENDER_MODES = ("rgb_array", "human")
METADATA: dict[str, Any] = {"render_modes": list(RENDER_MODES), "render_fps": 50}
MANY: dict[str, Any] = {**METADATA, "render_modes": ["rgb_array"]}
"""Metadata of a vector environment."""


@dataclass(frozen=True)
class Settings:
    """Checked settings of an environment.

    Attributes:
        dt: control step [s].
        substeps: number of integrator steps in a control step.
        task: the task, which defines reward, start and end of an episode.
        steps: number of control steps in an episode, None where the environment does not count them.
        rate: factor of the rewards.
        render_mode, render_size, look: mode of ``render``, its frame size [px], and its theme and panels.
    """

    dt: float
    substeps: int
    task: Task
    steps: int | None
    rate: float
    render_mode: str | None
    render_size: tuple[int, int]
    look: FrameStyle


def usual(scene: Any, integrator: Any, dt: Any) -> tuple[Any, Any]:
    """Return the method and the control step [s], with those of a scene's episodes where they are None.

    They are rk4 and 0.02 s, but for scenes that stand for another program's environment.
    """
    if integrator is not None and dt is not None:
        return integrator, dt
    if isinstance(scene, Mapping):
        name = scene.get("name")
    else:
        name = scene if isinstance(scene, str) and scene in SCENES else find_scene(scene).name
    method, step = EPISODES.get(name, USUAL_EPISODE) if isinstance(name, str) else USUAL_EPISODE
    return method if integrator is None else integrator, step if dt is None else dt


def checked_settings(
    dt: Any, substeps: Any, task: Any, render_mode: Any, render_size: Any, render_theme: Any, render_panels: Any,
    diagnostics: Sequence[str], duration: Any = None, reward_rate: Any = False, many: bool = False,
) -> Settings:
    """Check the settings of an environment, or with ``many`` of a vector of environments, and return them.

    Raises SceneError for an invalid setting.
    """
    step = number(dt, "dt", above=0.0, unit="s")
    count = whole_number(substeps, "substeps", MOST_SUBSTEPS)
    aim = find_task(USUAL_TASK if task is None else task)
    if render_mode is not None:
        one_of(render_mode, "render_mode", RENDER_MODES)
        if many and render_mode == "human":
            raise SceneError(
                "render_mode='human' is for a single environment; for a vector use render_mode='rgb_array', and "
                "render_tiles() for a picture of the first environments."
            )
    size = checked_size(render_size, "render_size")
    look = checked_look(render_theme, render_panels, diagnostics)
    steps = aim.steps(step) if duration is None else steps_of(duration, step)
    rate = step if boolean(reward_rate, "reward_rate") else 1.0
    return Settings(step, count, aim, steps, rate, render_mode, size, look)


def settled(
    made: Settings, scenes: Callable[[], Scene | Sequence[Scene]], integrator: Any, accuracy: Any, steps: int | None,
    compensated: bool, rtol: Any = None, atol: Any = None,
) -> tuple[str | Method, int, bool]:
    """Return an environment's method and substeps, and True if ``integrator="auto"`` has chosen them.

    ``steps`` is the number of control steps of an episode, None for the usual number. Raises AccuracyError if no
    method reaches the accuracy.
    """
    if accuracy is None and not (isinstance(integrator, str) and integrator == "auto"):
        return integrator, made.substeps, False
    from pendulum_env.auto.choice import settled as settle

    given = {"substeps": made.substeps != 1, "rtol": rtol is not None, "atol": atol is not None,
             "compensated": compensated}
    choice = settle(scenes(), integrator, accuracy, made.dt, steps, given)
    return choice.name, choice.substeps, True


def checked_options(options: Any, scene: Scene, task: Task) -> tuple[dict[str, Any], Task, dict[str, Any]]:
    """Return the start angle and velocity from the options of ``reset``, the task that draws the missing ones, and
    parameters of the scene for one episode.

    If the task draws no start, what the options leave out is taken from the scene's usual run. Options that set the
    half widths of the task's ranges give another task with these. Raises SceneError for unknown options.
    """
    if not (options is None or isinstance(options, Mapping)):
        raise SceneError(f"reset's options must be a dict with {' and '.join(START)}, not {shown(options)}.")
    given = dict(options or {})
    known = (*START, *task.widths)
    own = {name: given.pop(name) for name in [*given] if name not in known}
    if own:
        check_parameters(own, scene, "reset has no option", known)
    widths = {name: given.pop(name) for name in task.widths if name in given}
    start = given if task.draws else {name: given.get(name, getattr(scene.run, name)) for name in START}
    return start, task.within(widths), own


def check_parameters(names: Iterable[Any], scene: Scene, refusal: str, more: Iterable[str] = ()) -> None:
    """Raise SceneError for names that are not those of numbers among the scene's parameters.

    The message begins with ``refusal`` and names the nearest parameter, or the nearest of ``more`` names.
    """
    known: dict[str, Any] = scene.parameters()
    parts = {"body": scene.body, "medium": scene.medium, **{effect.name: effect for effect in scene.effects}}
    for name in names:
        owner, _, own = name.rpartition(".") if isinstance(name, str) else ("", "", "")
        if name not in known and not (owner in parts and own != "name" and hasattr(parts[owner], own)):
            raise SceneError(f"{refusal} {shown(name)}{nearest(name, (*more, *known))}")
        if isinstance(known[name] if name in known else getattr(parts[owner], own), (str, bool)):
            raise SceneError(f"{refusal} {shown(name)}, which is not a number; make an environment with it.")


def spaces_of(bound: Any, task: Task, plan: Plan | None = None) -> tuple[float, Any, Any]:
    """Return the checked bound of the observed velocity [rad/s], the observation space and the action space.

    The bound is the largest float32 if none is given; bounds beyond the largest float32 are infinite. An observation is
    cosine and sine of the angle, the velocity, and further cosines and sines of a task with a reference; an action is
    the fraction of the motor's torque, from -1 to 1. With a ``plan`` of readings, an observation begins with theirs.
    Raises SceneError for what is no bound.
    """
    most = UNBOUNDED if bound is None else bound
    if not (isinstance(most, float) and most == math.inf):
        try:
            most = number(most, "velocity_bound", above=0.0, unit="rad/s")
        except SceneError as error:
            raise SceneError(f"{str(error).rstrip('.')}; inf is for no bound.") from None
    most = most if most <= UNBOUNDED else math.inf
    width = len(task.goal.seen) - len(SEEN)
    high = np.ones(width + (len(SEEN) if plan is None else plan.width), dtype=np.float32)
    if plan is None or plan.swift:
        high[2] = most
    return most, spaces.Box(-high, high, dtype=np.float32), spaces.Box(-1.0, 1.0, (1,), dtype=np.float32)


def batched(space: Any, size: int) -> Any:
    """Return the space of ``size`` environments.

    Its bounds take no memory of their own, but are views of one environment's.
    """
    batch = batch_space(space, size)
    for name in ("low", "high", "bounded_below", "bounded_above"):
        setattr(batch, name, np.broadcast_to(getattr(space, name), (size, *space.shape)))
    return batch
