"""The command ``lab-pendulum effects``: which effects matter in a scene."""

from __future__ import annotations

import math
from typing import Annotated

from pendulum_env.cli import options
from pendulum_env.cli.console import bar, print_files, print_table, print_text
from pendulum_env.cli.options import scene_of
from pendulum_env.physics.units import SceneError


def effects(
    scene: options.SceneName = "lab",
    angle: options.Angle = 30.0,
    tolerance: Annotated[
        float, options.number("Smallest relative change of period or amplitude that matters.")] = 1e-4,
    damping: options.Damping = "scene",
    duration: options.Duration = None,
    complete: Annotated[
        bool, options.flag("Add to the scene effects that matter but are missing.", "--complete")] = False,
    svg: options.Svg = False,
    out: options.OutOrNone = None,
    settings: options.Settings = None,
) -> None:
    """Show which of all known effects matter in a scene: how much each changes the motion, and how much time it costs.

    With --out, a bar chart and a CSV file are written.
    """
    from pendulum_env.study.audit.simplification import simplify
    from pendulum_env.study.audit.study import write
    from pendulum_env.study.audit.verdicts import remarks, verdicts

    place = scene_of(scene, damping, settings)
    if svg and out is None:
        raise SceneError("--svg needs --out; give a folder.")
    with bar("effects") as progress:
        plain, report = simplify(place, amplitude=angle, tolerance=tolerance, duration=duration,
                                 complete=complete, progress=progress)
        paths = [] if out is None else write(report.audit, out, svg)
    print_text(f"{place.name}: {place.equation()}, from {math.degrees(angle):g}°, tolerance {tolerance:g}")
    print_table(verdicts(report.audit))
    print_text(f"{remarks(report.audit)}\n\n{report.text}")
    if plain.effects != place.effects:
        print_text(f"Simplified equation: {plain.equation()}")
    if paths:
        print_files(paths)
