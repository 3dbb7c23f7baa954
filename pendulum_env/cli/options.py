"""Options that commands share, and what their words mean."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from pendulum_env.lab.recording import Recording
    from pendulum_env.physics.scene import Scene

SceneName = Annotated[str, typer.Option(help="Preset (lab-pendulum list scenes) or a scene's JSON file.")]
Damping = Annotated[str, typer.Option(help="scene, none, linear, linear+quadratic, linear:gamma=0.1, ...")]
Angle = Annotated[float | None, typer.Option(help="Release angle in degrees; by default the scene's.")]
Velocity = Annotated[float | None, typer.Option(help="Release velocity in rad/s; by default the scene's.")]
Step = Annotated[float | None, typer.Option(help="The integrator's step in s; by default the scene's.")]
Duration = Annotated[float | None, typer.Option(help="Length of the run in s; the scene's where none is shown.")]
Out = Annotated[Path, typer.Option(help="Folder for the files.")]
Svg = Annotated[bool, typer.Option("--svg", help="Write figures as SVG, too.")]
Theme = Annotated[str, typer.Option(help="Of the frames: light or dark.")]
Panels = Annotated[
    str, typer.Option(help="In the frames: any of apparatus, energy, history, phase, residual, with commas between.")
]
Rtol = Annotated[float | None, typer.Option(help="Tolerance; adaptive methods take dt in as many steps as it needs.")]
Atol = Annotated[float | None, typer.Option(help="Absolute tolerance beside --rtol; by default the same number.")]
Settings = Annotated[list[str] | None, typer.Option("--set", help="A scene's parameter, as in --set length=0.5.")]
Reading = Annotated[
    list[str] | None,
    typer.Option("--read", help="How a recording is to be read, as in --read scale=0.99: keywords of Recording.read."),
]


def radians(degrees: float | None) -> float | None:
    return None if degrees is None else math.radians(degrees)


def split(names: str) -> list[str]:
    """Names with commas between them."""
    return [name.strip() for name in names.split(",")]


def scene_of(scene: str, damping: str, settings: Sequence[str] | None) -> Scene:
    from pendulum_env.physics.damping import build_scene, parse_damping, parse_settings

    return build_scene(scene, parse_damping(damping), parse_settings(settings or ()))


def recording_of(file: Path | None, read: Sequence[str] | None, **told: Any) -> Recording:
    """The recording in a file, read as options say.

    Raises SceneError for options without a file, unknown ones, with the nearest, and what is told twice.
    """
    from inspect import signature

    from pendulum_env.lab.recording import Recording
    from pendulum_env.physics.damping import typed_values
    from pendulum_env.physics.units import SceneError, nearest, shown

    more = typed_values(read or (), "--read", "scale=0.99")
    known = [name for name in signature(Recording.read).parameters if name != "path"]
    given = {name: value for name, value in told.items() if value is not None}
    for name, value in more.items():
        if name not in known:
            raise SceneError(f"--read has no {shown(name)}{nearest(name, known)}")
        if name in given:
            raise SceneError(f"{name} is given twice, by --{name} and by --read.")
        given[name] = _parts(value) if name in LISTS else _marks().get(value, value)
    if file is None:
        raise SceneError("--read goes with a recording, which is missing.")
    return Recording.read(file, **given)


LISTS = ("columns", "pivot")
"""What is told of a recording as several values with commas between."""


def _marks() -> dict[Any, str]:
    """Marks between columns and in numbers, by their names, as nobody can type a tab."""
    from pendulum_env.lab.table import DECIMALS, SEPARATORS

    return {name: mark for marks in (SEPARATORS, DECIMALS) for mark, name in marks.items()}


def _parts(value: Any) -> Any:
    """Numbers and names with commas between them as a list, whole numbers as such; a single word as it is."""
    from pendulum_env.physics.damping import typed

    if isinstance(value, str) and "," not in value:
        return value
    parts = [typed(part) for part in str(value).split(",")]
    return [int(part) if isinstance(part, float) and part.is_integer() else part for part in parts]
