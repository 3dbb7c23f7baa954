"""What one environment and a vector of them share: checked numbers, starts, spaces."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector.utils import batch_space

from integrators import Method
from pendulum_env.films.look import checked_look, checked_size
from pendulum_env.physics.scene import Run, Scene
from pendulum_env.physics.units import SceneError, nearest, number, one_of, shown, whole_number
from pendulum_env.render import FrameStyle
from pendulum_env.tasks import Task, find_task

START = ("angle", "velocity")
MOST_SUBSTEPS = 10**9
RENDER_MODES = ("rgb_array", "human")
METADATA: dict[str, Any] = {"render_modes": list(RENDER_MODES), "render_fps": 50}
MANY: dict[str, Any] = {**METADATA, "render_modes": ["rgb_array"]}
"""Metadata of a vector."""


@dataclass(frozen=True)
class Settings:
    """How an environment runs its scene.

    Attributes:
        dt: control step [s]; ``h``: the integrator's step [s].
        task: reward, start and endings.
        render_mode, render_size, look: what ``render`` draws.
        many: of a vector.
    """

    dt: float
    substeps: int
    task: Task
    render_mode: str | None
    render_size: tuple[int, int]
    look: FrameStyle
    many: bool = False

    @property
    def h(self) -> float:
        return self.dt / self.substeps

    @property
    def metadata(self) -> dict[str, Any]:
        """Of an instance: its films run at true speed."""
        return {**(MANY if self.many else METADATA), "render_fps": 1.0 / self.dt}


def checked_settings(
    dt: Any, substeps: Any, task: Any, render_mode: Any, render_size: Any, render_theme: Any, render_panels: Any,
    diagnostics: Sequence[str], many: bool = False,
) -> Settings:
    """The settings, of one environment or of a vector; SceneError for anything that cannot be."""
    step = number(dt, "dt", above=0.0, unit="s")
    count = whole_number(substeps, "substeps", MOST_SUBSTEPS)
    found = find_task(task)
    if render_mode is not None:
        one_of(render_mode, "render_mode", RENDER_MODES)
        if many and render_mode == "human":
            raise SceneError(
                "render_mode='human' is for one environment; of a vector, render_mode='rgb_array' and render_tiles() "
                "show the first ones in one picture."
            )
    size = checked_size(render_size, "render_size")
    look = checked_look(render_theme, render_panels, diagnostics)
    return Settings(step, count, found, render_mode, size, look, many)


def settled(
    made: Settings, scenes: Callable[[], Scene | Sequence[Scene]], integrator: Any, accuracy: Any, steps: int | None,
    compensated: bool, rtol: Any = None, atol: Any = None,
) -> tuple[str | Method, int, bool]:
    """Return the method and the substeps as asked for, or as ``integrator="auto"`` chose them; then also True.

    ``steps``: control steps of an episode, None for as many as are usual. Raises AccuracyError for what cannot be.
    """
    if accuracy is None and not (isinstance(integrator, str) and integrator == "auto"):
        return integrator, made.substeps, False
    from pendulum_env.auto.choice import settled as settle

    given = {"substeps": made.substeps != 1, "rtol": rtol is not None, "atol": atol is not None,
             "compensated": compensated}
    choice = settle(scenes(), integrator, accuracy, made.dt, steps, given)
    return choice.name, choice.substeps, True


def checked_options(options: Any, run: Run, task: Task) -> dict[str, Any] | None:
    """Angle and velocity that ``reset``'s options ask for, or the task without them; the rest from the usual run.

    None where the task draws them.

    Raises SceneError for other options.
    """
    if not (options is None or isinstance(options, Mapping)):
        raise SceneError(f"reset's options must be a dict with {' and '.join(START)}, not {shown(options)}.")
    if not options and task.centre is not None:
        return None
    asked = options or {}
    for name in asked:
        if name not in START:
            raise SceneError(f"reset has no option {shown(name)}{nearest(name, START)}")
    return {name: asked.get(name, getattr(run, name)) for name in START}


def observation_space() -> Any:
    """Cosine, sine and velocity."""
    high = np.array([1.0, 1.0, np.finfo(np.float32).max], dtype=np.float32)
    return spaces.Box(-high, high, dtype=np.float32)


def action_space() -> Any:
    """The share of the motor's torque."""
    return spaces.Box(-1.0, 1.0, (1,), dtype=np.float32)


def batched(space: Any, size: int) -> Any:
    """The space of ``size`` environments; its bounds are one environment's, repeated without taking memory."""
    found = batch_space(space, size)
    for name in ("low", "high", "bounded_below", "bounded_above"):
        setattr(found, name, np.broadcast_to(getattr(space, name), (size, *space.shape)))
    return found
