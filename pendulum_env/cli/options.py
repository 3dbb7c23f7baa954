"""Options that several commands share, and the conversion of their values."""

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
Duration = Annotated[float | None, typer.Option(help="Length of the run in s; if no default is shown, the scene's.")]
Out = Annotated[Path, typer.Option(help="Folder for the files.")]
Svg = Annotated[bool, typer.Option("--svg", help="Also write figures as SVG.")]
Theme = Annotated[str, typer.Option(help="Colours of the frames: light or dark.")]
Panels = Annotated[
    str, typer.Option(help="Parts of the frames: any of apparatus, energy, history, phase, residual, with commas.")
]
Rtol = Annotated[float | None, typer.Option(help="Relative tolerance; adaptive methods choose their steps within dt.")]
Atol = Annotated[float | None, typer.Option(help="Absolute tolerance; by default equal to --rtol.")]
Settings = Annotated[list[str] | None, typer.Option("--set", help="A scene's parameter, as in --set length=0.5.")]
Reading = Annotated[
    list[str] | None,
    typer.Option("--read", help="A keyword of Recording.read for the recording's file, as in --read scale=0.99."),
]
Columns = Annotated[
    str | None, typer.Option(help="Columns to read, by number from 1 or by name, as time=2,angle=5; angle may be rate "
                             "(angular velocity), acceleration, or x and y of a track.")
]
Until = Annotated[float | None, typer.Option(help="Time in the file, in s, after which readings are left out.")]
Above = Annotated[
    str | None, typer.Option(help="Share of the first amplitude, as 5%, below which swings are left out.")
]
Drop = Annotated[
    list[str] | None, typer.Option(help="Times in the file, in s, between which readings are left out, as 12.5:13.1.")
]


ROUND = 0.05
"""Largest distance from a multiple of 5 degrees of an angle that was rounded to two or more digits [degrees]."""


def radians(degrees: float | None) -> float | None:
    """Convert degrees to radians as :func:`angle_in_radians` does; None stays None."""
    return None if degrees is None else angle_in_radians(degrees)


def angle_in_radians(degrees: float) -> float:
    """Convert an angle of an option to radians.

    Warn if the number, taken as radians, is a multiple of 5 degrees, as 0.0873 is.
    """
    meant = math.degrees(degrees)
    if abs(degrees) < math.tau and abs(meant - 5.0 * round(meant / 5.0)) < ROUND and abs(meant) > 1.0:
        from pendulum_env.common.warn import warn

        warn(f"Angles on the command line are in degrees: {degrees:g} rad would be {5 * round(meant / 5.0)} degrees.")
    return math.radians(degrees)


def split(names: str) -> list[str]:
    """Return the names in a text, which are separated by commas, as a list."""
    return [name.strip() for name in names.split(",")]


def scene_of(scene: str, damping: str, settings: Sequence[str] | None) -> Scene:
    """Return the scene that the command-line options --scene, --damping and --set describe."""
    from pendulum_env.physics.damping import build_scene, parse_damping, parse_settings

    return build_scene(scene, parse_damping(damping), parse_settings(settings or ()))


def recording_of(file: Path | None, read: Sequence[str] | None, **options: Any) -> Recording:
    """Return the recording in a file, read with keywords of ``Recording.read`` from --read and from other options.

    Raises SceneError for options without a file, for unknown keywords, with the nearest, and for a keyword given twice.
    """
    from inspect import signature

    from pendulum_env.lab.recording import Recording
    from pendulum_env.physics.damping import typed_values
    from pendulum_env.physics.units import SceneError, nearest, shown

    more = typed_values(read or (), "--read", "scale=0.99")
    known = [name for name in signature(Recording.read).parameters if name != "path"]
    given = {name: value for name, value in options.items() if value is not None}
    for name, value in more.items():
        if name not in known:
            raise SceneError(f"--read has no keyword {shown(name)}{nearest(name, known)}")
        if name in given:
            raise SceneError(f"{name} is given twice, by --{name} and by --read.")
        given[name] = _marks().get(value, value)
    if isinstance(given.get("scale"), str):
        given["scale"] = quotient(given["scale"])
    given |= {name: _parts(given[name]) for name in LISTS if isinstance(given.get(name), str)}
    if file is None:
        raise SceneError("--read needs a recording; give a file.")
    return Recording.read(file, **given)


def given_by_user(context: typer.Context, *names: str) -> list[str]:
    """Return those of the options of a command that were given on the command line."""
    return [name for name in names if (source := context.get_parameter_source(name)) is not None
            and source.name == "COMMANDLINE"]


def quotient(text: str) -> float | str:
    """Return the number that a text such as "360/4096" or "0.99" stands for; any other text unchanged."""
    try:
        above, _, below = text.partition("/")
        return float(above) / float(below or 1.0)
    except (ValueError, ZeroDivisionError):
        return text


LISTS = ("columns", "pivot")
"""Keywords of Recording.read that take several values, separated by commas."""


def _marks() -> dict[Any, str]:
    """Return separators and decimal marks by their names, such as "tab", as a tab cannot be typed as a value."""
    from pendulum_env.lab.table import DECIMALS, SEPARATORS

    return {name: mark for marks in (SEPARATORS, DECIMALS) for mark, name in marks.items()}


def _parts(value: Any) -> Any:
    """Return numbers and names separated by commas as a list, whole numbers as ints; other texts, such as
    "time=2,angle=5", unchanged."""
    from pendulum_env.physics.damping import typed

    if isinstance(value, str) and ("," not in value or "=" in value):
        return value
    parts = [typed(part) for part in str(value).split(",")]
    return [int(part) if isinstance(part, float) and part.is_integer() else part for part in parts]
