"""The command ``lab-pendulum auto``, which chooses a method and substeps for an accuracy."""

from __future__ import annotations

from typing import Annotated

import typer

from pendulum_env.cli.console import bar, print_table, print_text
from pendulum_env.cli.options import Damping, SceneName, Settings, scene_of


def auto(
    scene: SceneName = "lab",
    accuracy: Annotated[float, typer.Option(help="Largest allowed error of the angle in an episode, in rad.")] = 1e-6,
    damping: Damping = "scene",
    dt: Annotated[float, typer.Option(help="Control step in s.")] = 0.02,
    steps: Annotated[int, typer.Option(help="Number of control steps in an episode.")] = 500,
    recalibrate: Annotated[
        bool, typer.Option("--recalibrate", help="Measure the time of steps on this computer, and store it.")
    ] = False,
    settings: Settings = None,
) -> None:
    """Choose the cheapest method and substeps for an accuracy, as integrator="auto" does, and give the reasons."""
    from pendulum_env.auto.choice import choose

    place = scene_of(scene, damping, settings)
    with bar("auto") as progress:
        choice = choose(place, accuracy, dt, steps, recalibrate=recalibrate, progress=progress)
    print_text(f"{place.name}: {place.equation()}\n{choice.why}")
    print_table(choice.ranking)
