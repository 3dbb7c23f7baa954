"""The command ``lab-pendulum record``, which films runs."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from pendulum_env.cli.console import bar, printable
from pendulum_env.cli.options import (
    Angle,
    Atol,
    Damping,
    Duration,
    Panels,
    Rtol,
    Settings,
    Step,
    Theme,
    Velocity,
    radians,
    scene_of,
    split,
)


def record(
    scene: Annotated[
        list[str],
        typer.Option(help="Presets (lab-pendulum list scenes) or JSON files, with commas, or repeat the option."),
    ] = ["lab"],  # noqa: B006
    integrators: Annotated[
        list[str],
        typer.Option("--integrators", "--integrator", "-i",
                     help="Names of methods, with commas, or repeat the option; each scene runs with each method."),
    ] = ["rk4"],  # noqa: B006
    damping: Damping = "scene",
    angle: Angle = None,
    velocity: Velocity = None,
    dt: Step = None,
    duration: Duration = 10.0,
    rtol: Rtol = None,
    atol: Atol = None,
    control: Annotated[float, typer.Option(help="Constant share of the motor's largest torque, -1 to 1.")] = 0.0,
    fps: Annotated[float, typer.Option(help="Frames per second; a gif allows 100/n: 50, 25, 20, 10, ...")] = 50.0,
    slow: Annotated[float, typer.Option(help="Slow-motion factor: 4 films at a quarter of the speed.")] = 1.0,
    size: Annotated[int, typer.Option(help="Side of each square frame in pixels.")] = 500,
    theme: Theme = "light",
    panels: Panels = "apparatus,energy",
    out: Annotated[Path, typer.Option(help="The film, ending in .mp4 or .gif.")] = Path("out/pendulum.mp4"),
    settings: Settings = None,
) -> None:
    """Film a run, or several side by side under one clock, at true speed or in slow motion.

    The film lasts the duration times the slow-motion factor; the factor changes no step. A run that ends early stays at
    its last frame.
    """
    from pendulum_env.engine.spec import RunSpec
    from pendulum_env.engine.starts import listed_methods
    from pendulum_env.films.record import record as run

    machines = [RunSpec.of(scene_of(place, damping, settings), method, rtol=rtol, atol=atol).machine()
                for place in _scenes(scene) for method in listed_methods(",".join(integrators))]
    with bar("record") as progress:
        path, stopped = run(machines, out, angle=radians(angle), velocity=velocity, duration=duration, dt=dt,
                            control=control, fps=fps, slow=slow, size=size, theme=theme,
                            panels=split(panels), progress=progress)
    for label, why in stopped.items():
        print(printable(f"{label} stopped early: {why}."))
    print(printable(f"Wrote {path}"))


def _scenes(given: Sequence[str]) -> list[str]:
    """Return names of scenes and files from texts with commas; a text that is itself the path of a file is not split.
    """
    return [part.strip() for text in given for part in ([text] if os.path.isfile(text) else text.split(","))]
