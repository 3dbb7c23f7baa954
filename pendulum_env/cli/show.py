"""The command ``lab-pendulum show``, which opens an interactive window with one pendulum or several side by side."""

from __future__ import annotations

import random
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from inspect import cleandoc
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any

from integrators import METHODS
from pendulum_env.cli import options
from pendulum_env.cli.console import bar, print_text
from pendulum_env.engine.machine import find_method, fitting
from pendulum_env.engine.starts import checked_start, none_twice
from pendulum_env.physics.damping import build_scene, parse_damping, parse_settings
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, shown
from pendulum_env.render import View, palette
from pendulum_env.tasks import find_task
from pendulum_env.window import Shown
from pendulum_env.window.controls import METHOD_KEYS, keys_in_words

if TYPE_CHECKING:
    from pendulum_env.controllers import Policy
    from pendulum_env.envs.env import LabPendulumEnv
    from pendulum_env.window.live import Live


MOST = 6
"""Largest number of pendulums side by side."""
ONE, SEVERAL = "700x760", "1400x800"
"""Size of the window with one pendulum, and with several [px]."""
SMALLEST = 200
"""Shortest side of the window when it opens [px]."""
SHORTEST = 5e-5
"""Shortest step [s] with which a window keeps up with the clock."""
LONGEST = 1.0
"""Longest step [s] that the key D chooses."""


def show(
    scene: options.SceneName = "lab",
    integrators: options.Integrators = ["rk4"],
    damping: options.Damping = "scene",
    angle: options.AngleOrNone = None,
    velocity: options.Velocity = None,
    dt: options.Step = None,
    policy: Annotated[
        str | None, options.option("Who drives the motor: a policy (lab-pendulum list policies), or a file of one.",
                                   **options.completing("pendulum_env.controllers", "POLICIES"))
    ] = None,
    window: Annotated[
        str | None, options.option(f"Size of the window in pixels, as 1600x900; by default {ONE} or {SEVERAL}.")
    ] = None,
    theme: options.Theme = "light",
    panels: options.Panels = ["apparatus", "energy", "phase"],
    out: options.Out = Path("out/show"),
    settings: options.Settings = None,
) -> None:
    """Show up to 6 pendulums in a window: drag a bob, push it with the arrow keys, change method and step, stop times.

    {keys}

    A policy drives the motor of each pendulum, in steps of 0.02 s from a start of its task, until an arrow key is held.
    The methods of the keys 1 to 5 are compiled before the window opens, once for each scene. Here --set takes the
    settings of gym.make, too, as in --set action_noise=0.1.
    """
    from pendulum_env.controllers import load
    from pendulum_env.envs.settings import split_settings
    from pendulum_env.window.live import Live
    from pendulum_env.window.screen import WindowError, seen

    driver = load(policy) if policy is not None else None
    more, own = split_settings(parse_settings(settings or ()), Bench.CHOSEN)
    bench = Bench(build_scene(scene, parse_damping(damping), own), integrators, dt, theme, panels, more, driver)
    start = bench.start(angle, velocity)
    checked_start(bench.scene, *start)
    pixels = _window_size((ONE if len(bench.envs) == 1 else SEVERAL) if window is None else window)
    if not seen():
        raise WindowError("There is no display to show a window on; lab-pendulum record makes films without one.")
    bench.prepare()
    live = Live(*bench.shown(), size=pixels, new_step=bench.new_step)
    live.folder = out
    try:
        bench.play(live, *start)
    finally:
        live.close()


show.__doc__ = cleandoc(show.__doc__ or "").replace("{keys}", f"\b\n{keys_in_words()}")


def _window_size(text: str) -> tuple[int, int]:
    """Return width and height of a window [px] from text such as "1600x900", or "700" for a square."""
    from pendulum_env.render.layout import MOST as LARGEST

    found = re.fullmatch(r"\s*(\d{1,5})\s*(?:[xX]\s*(\d{1,5})\s*)?", text)
    width, height = (int(found[1]), int(found[2] or found[1])) if found else (0, 0)
    if not SMALLEST <= min(width, height) <= max(width, height) <= LARGEST:
        raise SceneError(f"--window must be {SMALLEST} to {LARGEST} pixels, as in 1600x900 or 700, not {shown(text)}.")
    return width, height


class Bench:
    """Pendulums of one scene with different methods, which start together, take the same steps and meet the same gusts.

    ``more`` are other settings of the environments, such as ``action_noise``. A ``policy`` of the package drives the
    motors; the task is then the policy's, and the usual step that of episodes. Raises SceneError or MethodError for
    invalid arguments.
    """

    CHOSEN = ("scene", "integrator", "damping", "dt", "task", "render_mode", "render_size", "render_theme",
              "render_panels")
    """Settings of the environments that the command's other options give."""

    def __init__(self, scene: Scene, integrators: Sequence[str], dt: float | None, theme: str, panels: Sequence[str],
                 more: Mapping[str, Any] = MappingProxyType({}), policy: Policy | None = None) -> None:
        from pendulum_env.envs.settings import USUAL_EPISODE

        self.scene, self.theme, self.panels, self.more, self.policy = scene, theme, panels, more, policy
        if policy is not None and not scene.has("motor"):
            raise SceneError(f"The scene '{scene.name}' has no motor that a policy could drive; leave --policy out.")
        self.task = find_task("free" if policy is None else policy.card.get("task", ""))
        self.dt = dt if dt is not None else scene.run.dt if policy is None else USUAL_EPISODE[1]
        if len(integrators) > MOST:
            raise SceneError(f"A window shows 1 to {MOST} integrators, not {len(integrators)}.")
        methods = none_twice([find_method(name, scene) for name in integrators])
        self.envs = [self._env(method.name) for method in methods]
        self.over = [False] * len(methods)
        shape = self.envs[0].observation_space.shape
        if policy is not None and shape != policy.scale.shape:
            raise SceneError(f"The policy reads observations of shape {policy.scale.shape}, but the environment gives "
                             f"{shape}; leave --set observation out.")
        self._seed = random.randrange(2**32)

    def _env(self, integrator: str) -> LabPendulumEnv:
        """Return the environment of one pendulum with the present step."""
        from pendulum_env.envs.env import LabPendulumEnv

        return LabPendulumEnv(self.scene, integrator=integrator, dt=self.dt, task=self.task, render_mode="rgb_array",
                              render_theme=self.theme, render_panels=self.panels, **self.more)

    def prepare(self) -> None:
        """Compile the methods of the keys 1 to 5 and those of the pendulums, with a progress bar.

        So no key makes the window wait for a compiler. Methods that do not fit the scene are left out.
        """

        running, fits = [env.integrator for env in self.envs], fitting(self.scene)
        keys = [name for name in METHOD_KEYS.values() if name in fits and name not in running]
        with bar("show") as progress:
            for place, env in enumerate([*self.envs, *map(self._env, keys)]):
                progress(place / len(running + keys), f"compiling {env.integrator}")
                env.reset(seed=self._seed)

    def shown(self) -> list[Shown]:
        """Return the interfaces of the pendulums for a window."""
        return [self._one(place) for place in range(len(self.envs))]

    def _one(self, place: int) -> Shown:
        """Return the interface of one pendulum, in the colour that a figure of all methods gives to its method.

        A pendulum whose run has ended shows this until it starts again.
        """

        env = self.envs[place]
        own = env.shown()

        def view() -> View:
            return replace(own.view(), accent=self._tone(place), stopped=self.over[place])

        def start(angle: float, velocity: float) -> None:
            own.start(angle, velocity)
            self.over[place] = False

        return replace(own, view=view, start=start)

    def _tone(self, place: int) -> str | None:
        """Return the colour of one pendulum beside the others; None is the default of a single one."""
        if len(self.envs) == 1:
            return None
        indices = [palette.place(env.integrator, list(METHODS)) for env in self.envs]
        return palette.colours(indices)[indices[place]]

    def new_step(self, factor: float) -> list[Shown]:
        """Return the interfaces of new pendulums with ``factor`` times the step; they have not started yet.

        Raises SceneError for a step that is too short for a window, or too long.
        """
        step = self.dt * factor
        if not SHORTEST <= step <= LONGEST:
            raise SceneError(f"dt stays {self.dt:g} s: here it can be {SHORTEST:g} to {LONGEST:g} s.")
        self.dt = step
        self.envs = [self._env(env.integrator) for env in self.envs]
        for env in self.envs:
            env.reset(seed=self._seed)
        return self.shown()

    def start(self, angle: float | None, velocity: float | None) -> tuple[float, float]:
        """Return the angle [rad] and velocity [rad/s] of the start.

        Where these are None, they are those of the scene's usual run or, with a policy, those that its task draws.
        """
        usual = (self.scene.run.angle, self.scene.run.velocity) if self.policy is None else map(
            float, self.task.starts(random.random(), random.random(), self.scene.omega0))
        first, second = usual
        return first if angle is None else angle, second if velocity is None else velocity

    def play(self, window: Live, angle: float, velocity: float) -> None:
        """Run a window until it is closed; when all runs have ended, they are reset to their start and paused.

        The start is at an angle [rad] and a velocity [rad/s].
        """
        import numpy as np

        window.restart(angle, velocity)
        while window.open:
            window.attend()
            push = np.array([window.push], dtype=np.float32)
            for place, env in enumerate(self.envs):
                if not self.over[place]:
                    action = push if self.policy is None or push else self.policy(env.look())
                    over, info = env.step(action)[2::2]
                    if over:
                        self.over[place] = True
                        why = f"{env.integrator} stopped at {info['time']:g} s: {info['stop_reason']}"
                        print_text(f"{why}.")
            window.present()
            if all(self.over):
                window.restart()
                window.controls.hold(f"{why}; reset to the start")
