"""The command ``lab-pendulum effects``: which effects matter in a scene."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pendulum_env.cli.console import bar, print_files, print_table, print_text
from pendulum_env.cli.options import Damping, Duration, SceneName, Settings, Svg, angle_in_radians, scene_of


def effects(
    scene: SceneName = "lab",
    amplitude: Annotated[float, typer.Option(help="Release angle in degrees.")] = 30.0,
    tolerance: Annotated[
        float, typer.Option(help="Smallest relative change of period or amplitude that matters.")
    ] = 1e-4,
    damping: Damping = "scene",
    duration: Duration = None,
    complete: Annotated[
        bool, typer.Option("--complete", help="Add to the scene effects that matter but are missing.")
    ] = False,
    svg: Svg = False,
    out: Annotated[Path | None, typer.Option(help="Folder for a bar chart and a CSV file; by default none.")] = None,
    settings: Settings = None,
) -> None:
    """Show which of all known effects matter in a scene: how much each changes the motion, and how much time it costs.
    """
    from pendulum_env.common.provenance import checked_folder
    from pendulum_env.physics.units import SceneError
    from pendulum_env.study.audit.simplification import simplify
    from pendulum_env.study.audit.study import write
    from pendulum_env.study.audit.verdicts import remarks, verdicts

    place = scene_of(scene, damping, settings)
    if svg and out is None:
        raise SceneError("--svg needs --out; give a folder.")
    if out is not None:
        checked_folder(out)
    with bar("effects") as progress:
        plain, report = simplify(place, amplitude=angle_in_radians(amplitude), tolerance=tolerance, duration=duration,
                                 complete=complete, progress=progress)
        paths = [] if out is None else write(report.audit, out, svg)
    print_text(f"{place.name}: {place.equation()}, from {amplitude:g}°, tolerance {tolerance:g}")
    print_table(verdicts(report.audit))
    print_text(f"{remarks(report.audit)}\n\n{report.text}")
    if plain.effects != place.effects:
        print_text(f"Simplified equation: {plain.equation()}")
    if paths:
        print_files(paths)
