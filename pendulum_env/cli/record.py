"""``lab-pendulum record``."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from pendulum_env.cli.console import bar
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
        typer.Option(help="Presets (lab-pendulum list scenes) or scenes' JSON files, with commas or one each time."),
    ] = ["lab"],  # noqa: B006
    integrators: Annotated[
        list[str],
        typer.Option("--integrators", "--integrator", "-i",
                     help="Names of methods, with commas between or one each time; every scene with each."),
    ] = ["rk4"],  # noqa: B006
    damping: Damping = "scene",
    angle: Angle = None,
    velocity: Velocity = None,
    dt: Step = None,
    duration: Duration = 10.0,
    rtol: Rtol = None,
    atol: Atol = None,
    control: Annotated[float, typer.Option(help="Constant share of the motor's torque, -1 to 1.")] = 0.0,
    fps: Annotated[float, typer.Option(help="Frames per second; a gif takes 50, 25, 20, 10, ...: 100/n.")] = 50.0,
    slow: Annotated[float, typer.Option(help="Slow-motion factor, as 4: motion between the steps is shown.")] = 1.0,
    size: Annotated[int, typer.Option(help="Side of the square frames in pixels; of several, of each.")] = 500,
    theme: Theme = "light",
    panels: Panels = "apparatus,energy",
    out: Annotated[Path, typer.Option(help="The film, ending in .mp4 or .gif.")] = Path("out/pendulum.mp4"),
    settings: Settings = None,
) -> None:
    """Film a run, or several side by side under one clock, at true speed or in slow motion.

    The film lasts the duration times the slow-motion factor, which changes no step. A run that ends early stands still
    from there on.
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
        print(f"{label} stopped early: {why}.")
    print(f"Wrote {path}")


def _scenes(given: Sequence[str]) -> list[str]:
    """Names and files: what is no file itself may be several with commas between."""
    return [part.strip() for text in given for part in ([text] if os.path.isfile(text) else text.split(","))]
