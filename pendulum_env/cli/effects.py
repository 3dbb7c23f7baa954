"""The command ``lab-pendulum effects``: which effects matter in a scene."""

from __future__ import annotations

import math
from typing import Annotated

from pendulum_env.cli import options
from pendulum_env.cli.console import bar, print_result
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
    as_json: options.Json = False,
    settings: options.Settings = None,
) -> None:
    """Show which of all known effects matter in a scene: how much each changes the motion, and how much time it costs.

    With --out, a bar chart and a CSV file are written.
    """
    from pendulum_env.common.results import write
    from pendulum_env.study.audit import simplify

    place = scene_of(scene, damping, settings)
    if svg and out is None:
        raise SceneError("--svg needs --out; give a folder.")
    with bar("effects") as progress:
        plain, report = simplify(place, amplitude=angle, tolerance=tolerance, duration=duration,
                                 complete=complete, progress=progress)
        paths = [] if out is None else write(report, out, svg)
    simpler = f"\nSimplified equation: {plain.equation()}" if plain.effects != place.effects else ""
    print_result(
        report, paths, as_json, simplification=report.numbers, after=f"{report.audit.text}\n\n{report.text}{simpler}",
        before=f"{place.name}: {place.equation()}, from {math.degrees(angle):g}°, tolerance {tolerance:g}")
