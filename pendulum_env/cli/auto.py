"""The command ``lab-pendulum auto``, which chooses a method and substeps for an accuracy."""

from __future__ import annotations

from typing import Annotated

from pendulum_env.cli import options
from pendulum_env.cli.console import bar, print_result
from pendulum_env.cli.options import scene_of
from pendulum_env.engine.starts import checked_steps
from pendulum_env.physics.units import number


def auto(
    scene: options.SceneName = "lab",
    accuracy: Annotated[float, options.number("Largest allowed error of the angle in an episode, in rad.")] = 1e-6,
    damping: options.Damping = "scene",
    control_step: Annotated[float, options.number("Control step in s.")] = 0.02,
    duration: options.Duration = 10.0,
    recalibrate: Annotated[
        bool, options.flag("Measure the time of steps on this computer, and store it.", "--recalibrate")] = False,
    as_json: options.Json = False,
    settings: options.Settings = None,
) -> None:
    """Choose the cheapest method and substeps for an accuracy, as integrator="auto" does, and give the reasons."""
    from pendulum_env.auto.choice import Ranking, choose

    place = scene_of(scene, damping, settings)
    steps = checked_steps(number(duration, "duration", above=0.0, unit="s"),
                          number(control_step, "--control-step", above=0.0, unit="s"))
    with bar("auto") as progress:
        choice = choose(place, accuracy, control_step, steps, recalibrate=recalibrate, progress=progress)
    print_result(Ranking(choice), [], as_json, before=f"{place.name}: {place.equation()}\n{choice.why}", after="")
