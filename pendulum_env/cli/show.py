"""The command ``lab-pendulum show``, which opens an interactive window."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from pendulum_env.cli.console import say
from pendulum_env.cli.options import (
    Angle,
    Damping,
    Panels,
    SceneName,
    Settings,
    Step,
    Theme,
    Velocity,
    radians,
    scene_of,
    split,
)

if TYPE_CHECKING:
    from pendulum_env.envs.env import LabPendulumEnv


def show(
    scene: SceneName = "lab",
    integrator: Annotated[str, typer.Option(help="Name of a method (lab-pendulum list integrators).")] = "rk4",
    damping: Damping = "scene",
    angle: Angle = None,
    velocity: Velocity = None,
    dt: Step = None,
    size: Annotated[int, typer.Option(help="Side of the square window in pixels.")] = 700,
    theme: Theme = "light",
    panels: Panels = "apparatus,energy,phase",
    settings: Settings = None,
) -> None:
    """Show a pendulum in a window: drag the bob, push it with the arrow keys, change the integrator; H lists the keys.
    """
    from pendulum_env.envs.env import LabPendulumEnv

    place = scene_of(scene, damping, settings)
    env = LabPendulumEnv(place, integrator, dt=place.run.dt if dt is None else dt, task="free", render_mode="human",
                         render_size=size, render_theme=theme, render_panels=split(panels))
    start = {"angle": radians(angle), "velocity": velocity}
    try:
        _play(env, {name: value for name, value in start.items() if value is not None})
    finally:
        env.close()


def _play(env: LabPendulumEnv, start: dict[str, float]) -> None:
    """Run the window of ``lab-pendulum show`` until it is closed; a run that ends is reset to its start and paused."""
    import numpy as np

    from pendulum_env.window.screen import WindowError, seen

    if not seen():
        raise WindowError("There is no display to show a window on; lab-pendulum record makes films without one.")
    env.reset(options=start)
    window = env.window
    assert window is not None
    while window.open:
        over, info = env.step(np.array([window.push], dtype=np.float32))[2::2]
        if over:
            say(f"The run stopped at {info['time']:g} s: {info['stop_reason']}; it is reset to its start.")
            env.reset(options=window.start)
            window.controls.hold(f"stopped: {info['stop_reason']}")
