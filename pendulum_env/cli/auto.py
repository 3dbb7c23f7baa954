"""``lab-pendulum auto``."""

from __future__ import annotations

from typing import Annotated

import typer

from pendulum_env.cli.console import bar, print_table, print_text
from pendulum_env.cli.options import Damping, SceneName, Settings, scene_of


def auto(
    scene: SceneName = "lab",
    accuracy: Annotated[float, typer.Option(help="The most that the angle may err over an episode, in rad.")] = 1e-6,
    damping: Damping = "scene",
    dt: Annotated[float, typer.Option(help="Control step in s.")] = 0.02,
    steps: Annotated[int, typer.Option(help="Control steps of an episode.")] = 500,
    recalibrate: Annotated[
        bool, typer.Option("--recalibrate", help="Measure what steps cost on this machine, and keep that.")
    ] = False,
    settings: Settings = None,
) -> None:
    """Which method and substeps integrator="auto" takes for an accuracy, and why."""
    from pendulum_env.auto.choice import choose

    place = scene_of(scene, damping, settings)
    with bar("auto") as progress:
        found = choose(place, accuracy, dt, steps, recalibrate=recalibrate, progress=progress)
    print_text(f"{place.name}: {place.equation()}\n{found.why}")
    print_table(found.ranking)
