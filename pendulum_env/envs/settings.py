"""Settings of single and vector environments, declared once; options of ``reset``; spaces."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from integrators import Method
from pendulum_env.common.texts import Table
from pendulum_env.engine.report import SEEN
from pendulum_env.engine.sensing import KINDS, Plan
from pendulum_env.engine.settings import RunSettings, SceneSettings, declared, meaning
from pendulum_env.engine.threads import MOST_THREADS
from pendulum_env.envs.limits import IDS, checked_steps
from pendulum_env.envs.randomize import check_parameters, plain_form
from pendulum_env.films.look import checked_size
from pendulum_env.physics.data import known
from pendulum_env.physics.presets import EPISODES, find_scene
from pendulum_env.physics.random import normal
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.sensor import Sensor
from pendulum_env.physics.units import Checked, SceneError, choice, count, flag, number, one_of, setting, shown, si
from pendulum_env.render import PANELS, THEMES
from pendulum_env.tasks import USUAL_TASK, Task, find_task

UNBOUNDED = float(np.finfo(np.float32).max)
"""Bound of the observed velocity by default: the largest float32, because checkers warn at inf [rad/s]."""
START = ("angle", "velocity")
"""Names of the options of ``reset``."""
USUAL_HISTORY, MOST_HISTORY = 4, 64
"""Usual and largest number of readings in an observation of the kind "history"."""
MOST_ENVS = 2**26
"""Largest number of environments in a vector."""
USUAL_EPISODE = "rk4", 0.02
"""Method and control step [s] of an environment that is made without them."""
RENDER_MODES = ("rgb_array", "human")
METADATA: dict[str, Any] = {"render_modes": list(RENDER_MODES), "render_fps": 50}
MANY: dict[str, Any] = {**METADATA, "render_modes": ["rgb_array", "rgb_array_list"]}
"""Metadata of a vector environment."""


def checked_bound(value: Any, name: str) -> float:
    """Return a bound of the observed velocity [rad/s], inf beyond float32's largest; SceneError for what is none."""
    value = UNBOUNDED if value is None else value
    if not (isinstance(value, float) and value == math.inf):
        try:
            value = number(value, name, above=0.0, unit="rad/s")
        except SceneError as error:
            raise SceneError(f"{str(error).rstrip('.')}; inf is for no bound.") from None
    return value if value <= UNBOUNDED else math.inf


def checked_sensor(value: Any, name: str) -> Any:
    """Return a sensor, which may be given as a dict; raises SceneError for anything else."""
    device = Sensor(**known(value, Sensor, "A sensor")) if isinstance(value, Mapping) else value
    if not isinstance(device, Sensor):
        raise SceneError(f"{name} must be a Sensor or a dict of its values, not {shown(value)}.")
    if getattr(device, "jitter", 0.0):
        raise SceneError(f"jitter={device.jitter:g} is for recordings; in an environment, a sensor reads "  # type: ignore[attr-defined]
                         "at whole steps, so make it with jitter=0.")
    return as_sensor(device)


def as_sensor(value: Any) -> Any:
    """Return the plain sensor with the values of one of a class derived from it; any other value unchanged."""
    if not isinstance(value, Sensor):
        return value
    return Sensor(**{entry.name: getattr(value, entry.name) for entry in fields(Sensor)})


def mode_of_many(value: Any, name: str) -> str:
    """Return the mode of rendering of a vector; raises SceneError for "human", and for unknown ones."""
    if one_of(value, name, ("rgb_array_list", *RENDER_MODES)) == "human":
        raise SceneError(
            "render_mode='human' is for a single environment; for a vector use render_mode='rgb_array', and "
            "render_tiles() for a picture of the first environments."
        )
    return str(value)


def noisy(share: float, size: float, first: float, second: float) -> float:
    """Return an action with Gaussian noise of the standard deviation ``size``."""
    return share + size * normal(1.0 - first, second)


def autoreset_mode_of(mode: Any, name: str = "autoreset_mode") -> AutoresetMode:
    """Return Gymnasium's autoreset mode for a mode or its name; raises SceneError for an unknown name."""
    names = [entry.value for entry in AutoresetMode]
    return mode if isinstance(mode, AutoresetMode) else AutoresetMode(one_of(mode, name, names))


@dataclass(frozen=True, kw_only=True, repr=False, eq=False)
class EpisodeSettings(SceneSettings):
    """Settings of the environments of the package and of its twin in JAX."""

    integrator: str | Method | None = setting(
        None, 'name of a method (lab-pendulum list), a Method, or in gym.make "auto" with accuracy',
        note='None for "rk4", in the scenes gymnasium and dm_control for "symplectic_euler"')
    dt: float | None = si(None, "s", "control step", above=0.0, optional=True,
                          note="the integrator's step is dt / substeps; None for 0.02 s, in gymnasium for 0.05 s")
    speed_limit: Any = setting(None, "speed that ends an episode", unit="rad/s",
                               note="None for 100 omega0; the speed is never clipped")
    task: str | Task | None = setting(
        None, "reward, start and end of an episode: a name (lab-pendulum list tasks), or a Task",
        lambda task, _: find_task(task), optional=True, note='None for "swing_up"; without a motor take "free"')
    duration: float | None = si(None, "s", "length of an episode", above=0.0, optional=True,
                                note="a whole number of steps of dt; None for the task's, or the id's steps; beyond "
                                     "these give max_episode_steps, too")
    reward_rate: bool = flag(False, "True gives rewards per second: the task's reward times dt in each step")
    speed_penalty: float = si(0.0, "1", "reward that is lost where an episode ends by its speed or by diverging",
                              least=0.0)
    velocity_bound: Any = setting(
        None, "bound of the velocity in the observation", checked_bound, unit="rad/s",
        note="the observed velocity is cut to it, the motion is not; None for the largest float32, inf for none")
    randomize: Any = setting(
        None, "parameters drawn for every episode: ranges by name, as {\"length\": (0.3, 0.4)}, a fit, a function of a "
        "NumPy generator, or a list of these", form=plain_form)
    observation: str = choice("full", KINDS, "what the agent sees")
    history: int | None = count(None, 'readings in the observation "history"', MOST_HISTORY, note="None for 4")
    sensor: Sensor | Mapping[str, Any] | None = setting(
        None, "how the angle is read: a Sensor, or a dict of its values", checked_sensor,
        optional=True, form=as_sensor)
    observation_delay: float | Sequence[float] = setting(
        0.0, "delay of readings", unit="s",
        note="a whole number of steps of the integrator; (low, high) for a delay that is drawn at every reset")
    action_delay: float | Sequence[float] = setting(
        0.0, "delay of actions", unit="s", note="as of readings; until the first one arrives, the action is 0")
    action_noise: float = si(0.0, "1", "standard deviation of noise that each control step adds to the action",
                             least=0.0, acts=noisy)


@dataclass(frozen=True, kw_only=True, repr=False, eq=False)
class EnvSettings(EpisodeSettings, RunSettings):
    """Settings of ``gym.make``."""

    accuracy: float | None = setting(
        None, 'with the integrator "auto", the largest error of the angle in an episode', unit="rad",
        note="method and substeps are measured once per scene")
    render_mode: str | None = choice(None, RENDER_MODES, "what render gives: frames, or a window in real time")
    render_size: Any = setting(500, "size of frames", checked_size, unit="px",
                               note="one number, or (width, height)")
    render_theme: str = choice("light", THEMES, "colours of frames")
    render_panels: Sequence[str] = setting(("apparatus", "energy"), "parts of frames", allowed=tuple(PANELS))


@dataclass(frozen=True)
class Counted(Checked):
    """Number of environments, which comes first."""

    num_envs: int = count(1, "number of environments", MOST_ENVS)


@dataclass(frozen=True, kw_only=True, repr=False, eq=False)
class VectorSettings(EnvSettings, Counted):
    """Settings of ``gym.make_vec``."""

    speed_limit: Any = setting(None, "speed that ends an episode, or one for each environment", unit="rad/s",
                               note="None for 100 omega0")
    render_mode: str | None = setting(None, "what render gives: a frame for each environment, or a list of frames",
                                      mode_of_many, optional=True, allowed=("rgb_array", "rgb_array_list"))
    max_episode_steps: int | None = setting(
        None, "control steps until an episode is truncated, whatever the duration", checked_steps, optional=True,
        note="-1 leaves the end to the duration; make_vec gives the id's steps, 500, where it is left out")
    autoreset_mode: str | AutoresetMode = setting(
        "NextStep", "when ended episodes begin anew (https://farama.org/Vector-Autoreset-Mode)",
        autoreset_mode_of, allowed=tuple(entry.value for entry in AutoresetMode))
    num_threads: int | None = count(None, "threads of the compiled loops", MOST_THREADS,
                                    note="None for one per core, and one for few environments")
    copy: bool = flag(True, "False makes step overwrite the arrays that it returned before, which is faster")


FORMS: Mapping[str, Callable[[Any], Any]] = {
    entry.name: entry.metadata["form"] for entry in declared(VectorSettings) if "form" in entry.metadata}
"""Functions that return the value of a setting in a form that JSON holds, by the names of settings that need one."""


def settings_table() -> Table:
    """Return a table of the settings of ``gym.make`` and, at its end, those that ``gym.make_vec`` has besides."""
    named = {entry.name: entry for settings in (EnvSettings, VectorSettings) for entry in declared(settings)}
    single = {entry.name: entry for entry in declared(EnvSettings)}
    entries = [*single.values(), *(entry for name, entry in named.items() if name not in single)]
    return Table(("keyword", "default", "meaning"), tuple(
        (entry.name, repr(entry.default), meaning(entry)) for entry in entries))


def ids_table() -> Table:
    """Return a table of the ids: control steps and solving return of an episode, and the keywords that the id sets."""
    return Table(("id", "steps", "solved from", "what it sets"), tuple(
        (name, str(steps), f"{threshold:g}",
         ", ".join(f"{word}={value!r}" for word, value in keywords.items()) or "nothing")
        for name, (steps, keywords, threshold) in IDS.items()))


def split_settings(given: Mapping[str, Any], others: Sequence[str] = ()) -> tuple[dict[str, Any], dict[str, Any]]:
    """Separate keywords of ``gym.make`` by name into settings, but for ``others``, and parameters of the scene."""
    names = {entry.name for entry in declared(EnvSettings)} - {*others}
    return ({name: value for name, value in given.items() if name in names},
            {name: value for name, value in given.items() if name not in names})


def acting(given: EpisodeSettings) -> tuple[tuple[Callable[..., float], Any], ...]:
    """Return the functions by which settings change actions, with their values, but for those that are off."""
    return tuple((entry.metadata["acts"], value) for entry in declared(EpisodeSettings)
                 if "acts" in entry.metadata and (value := getattr(given, entry.name)) != entry.default)


def usual(given: EpisodeSettings) -> tuple[Any, float]:
    """Return the method and the control step [s], with those of the scene's episodes where they are None.

    They are rk4 and 0.02 s, but for scenes that stand for another program's environment.
    """
    scene, integrator, dt = given.scene, given.integrator, given.dt
    if integrator is not None and dt is not None:
        return integrator, dt
    name = scene.get("name") if isinstance(scene, Mapping) else find_scene(scene).name
    method, step = EPISODES.get(name, USUAL_EPISODE) if isinstance(name, str) else USUAL_EPISODE
    return method if integrator is None else integrator, step if dt is None else dt


def task_of(given: EpisodeSettings) -> Task:
    """Return the task of an environment."""
    return find_task(USUAL_TASK if given.task is None else given.task)


def settled(
    given: EnvSettings, scenes: Callable[[], Scene | Sequence[Scene]], integrator: Any, dt: float, steps: int | None,
) -> tuple[str | Method, int, bool]:
    """Return an environment's method and substeps, and True if ``integrator="auto"`` has chosen them.

    ``steps`` is the number of control steps of an episode, None for the usual number. Raises AccuracyError if no
    method reaches the accuracy.
    """
    if given.accuracy is None and not (isinstance(integrator, str) and integrator == "auto"):
        return integrator, given.substeps, False
    from pendulum_env.auto.choice import settled as settle

    others = {"substeps": given.substeps != 1, "rtol": given.rtol is not None, "atol": given.atol is not None,
              "compensated": given.compensated}
    choice = settle(scenes(), integrator, given.accuracy, dt, steps, others)
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


def spaces_of(bound: float, task: Task, plan: Plan | None = None) -> tuple[Any, Any]:
    """Return the observation space and the action space, for a bound of the observed velocity [rad/s].

    An observation is cosine and sine of the angle, the velocity, and further cosines and sines of a task with a
    reference; an action is the fraction of the motor's torque, from -1 to 1. With a ``plan`` of readings, an
    observation begins with theirs.
    """
    width = len(task.goal.seen) - len(SEEN)
    high = np.ones(width + (len(SEEN) if plan is None else plan.width), dtype=np.float32)
    if plan is None or plan.swift:
        high[2] = bound
    return spaces.Box(-high, high, dtype=np.float32), spaces.Box(-1.0, 1.0, (1,), dtype=np.float32)


def batched(space: Any, size: int) -> Any:
    """Return the space of ``size`` environments.

    Its bounds take no memory of their own, but are views of one environment's.
    """
    batch = batch_space(space, size)
    for name in ("low", "high", "bounded_below", "bounded_above"):
        setattr(batch, name, np.broadcast_to(getattr(space, name), (size, *space.shape)))
    return batch
