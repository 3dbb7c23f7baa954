"""Options that commands share, and what their words mean."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from pendulum_env.physics.scene import Scene

SceneName = Annotated[str, typer.Option(help="Preset (lab-pendulum list scenes) or a scene's JSON file.")]
Integrator = Annotated[str, typer.Option(help="Name of a method (lab-pendulum list integrators).")]
Damping = Annotated[str, typer.Option(help="scene, none, linear, linear+quadratic, linear:gamma=0.1, ...")]
Angle = Annotated[float | None, typer.Option(help="Release angle in degrees; by default the scene's.")]
Velocity = Annotated[float | None, typer.Option(help="Release velocity in rad/s; by default the scene's.")]
Step = Annotated[float | None, typer.Option(help="The integrator's step in s; by default the scene's.")]
Duration = Annotated[float | None, typer.Option(help="Length of the run in s; the scene's where none is shown.")]
Out = Annotated[Path, typer.Option(help="Folder for the files.")]
Rtol = Annotated[float | None, typer.Option(help="Tolerance; adaptive methods take dt in as many steps as it needs.")]
Atol = Annotated[float | None, typer.Option(help="Absolute tolerance beside --rtol; by default the same number.")]
Settings = Annotated[list[str] | None, typer.Option("--set", help="A scene's parameter, as in --set length=0.5.")]


def radians(degrees: float | None) -> float | None:
    return None if degrees is None else math.radians(degrees)


def scene_of(scene: str, damping: str, settings: Sequence[str] | None) -> Scene:
    from pendulum_env.physics.damping import build_scene, parse_damping, parse_settings

    return build_scene(scene, parse_damping(damping), parse_settings(settings or ()))
