"""The command ``lab-pendulum record``, which films runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pendulum_env.cli import options
from pendulum_env.cli.console import bar, printable
from pendulum_env.cli.options import scene_of
from pendulum_env.engine.starts import listed_methods


def record(
    scenes: options.SceneNames = ["lab"],
    integrators: options.Integrators = ["rk4"],
    damping: options.Damping = "scene",
    angle: options.AngleOrNone = None,
    velocity: options.Velocity = None,
    dt: options.Step = None,
    duration: options.Duration = 10.0,
    rtol: options.Rtol = None,
    atol: options.Atol = None,
    control: Annotated[float, options.number("Constant share of the motor's largest torque, -1 to 1.")] = 0.0,
    fps: Annotated[float, options.number("Frames per second; a gif allows 100/n: 50, 25, 20, 10, ...")] = 50.0,
    slow: Annotated[float, options.number("Slow-motion factor: 4 films at a quarter of the speed.")] = 1.0,
    size: Annotated[int, options.count("Side of each square frame in pixels.")] = 500,
    theme: options.Theme = "light",
    panels: options.Panels = ["apparatus", "energy"],
    out: options.OutFile = Path("out/pendulum.mp4"),
    settings: options.Settings = None,
) -> None:
    """Film a run, or several side by side under one clock, at true speed or in slow motion, as .mp4 or .gif.

    Each scene runs with each method. The film lasts the duration times the slow-motion factor; the factor changes no
    step. A run that ends early stays at its last frame.
    """
    from pendulum_env.engine.spec import RunSpec
    from pendulum_env.films.record import record as run

    machines = [RunSpec.of(scene_of(place, damping, settings), method, rtol=rtol, atol=atol).machine()
                for place in scenes for method in listed_methods(integrators)]
    with bar("record") as progress:
        path, stopped = run(machines, out, angle=angle, velocity=velocity, duration=duration, dt=dt,
                            control=control, fps=fps, slow=slow, size=size, theme=theme,
                            panels=panels, progress=progress)
    for label, why in stopped.items():
        print(printable(f"{label} stopped early: {why}."))
    print(printable(f"Wrote {path}"))
