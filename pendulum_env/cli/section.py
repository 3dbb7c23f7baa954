"""The command ``lab-pendulum section``: Poincaré sections, bifurcation diagrams and basins of driven scenes."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pendulum_env.cli import options
from pendulum_env.cli.console import bar, print_result, say
from pendulum_env.cli.options import given, one_method, scene_of
from pendulum_env.physics.units import SceneError, shown, whole_number

if TYPE_CHECKING:
    from pendulum_env.study.section import Section


def section(
    scene: options.SceneName = "chaotic",
    integrators: options.Integrators = ["rk4"],
    damping: options.Damping = "scene",
    event: Annotated[
        str | None, options.word("Where points are recorded: period (the default), bottom, top or turning.")] = None,
    phase: Annotated[
        float | None, options.degrees("Phase of the drive in degrees, for period; 0 by default.")] = None,
    over: Annotated[
        str | None, options.option("A bifurcation diagram over a parameter, as in drive_torque=1.06:1.087:600.")
    ] = None,
    basins: Annotated[
        int | None, options.count("Basins of attraction of this many starts along each side, as in 300.")] = None,
    velocities: Annotated[
        str | None, options.option("Lowest and highest starting velocity of --basins, as in -2:4; -3:3 by default.")
    ] = None,
    points: Annotated[int | None, options.count("Number of points, over all runs; 100000 by default.")] = None,
    transient: Annotated[
        int | None, options.count("Periods of the drive before the first point of a run: 100, with --over 500.")
    ] = None,
    steps_per_period: Annotated[int, options.count("Steps per period of the drive.")] = 200,
    angle: options.AngleOrNone = None,
    velocity: options.Velocity = None,
    svg: options.Svg = False,
    out: options.Out = Path("out/section"),
    as_json: options.Json = False,
    settings: options.Settings = None,
) -> None:
    """Draw a Poincaré section of a driven scene, a bifurcation diagram (--over), or basins of attraction (--basins).

    The section is that of many runs from angles spread over a turn; with --over one run for each value starts from
    --angle and --velocity. Writes a figure and a CSV table.
    """
    from pendulum_env.common.results import write
    from pendulum_env.study.basins import Basins
    from pendulum_env.study.basins import basins as run_basins
    from pendulum_env.study.section import section as run_section

    place = scene_of(scene, damping, settings)
    shared = given(integrator=one_method(integrators), steps=steps_per_period, transient=transient)
    of_points = given(event=event, phase=phase, points=points,
                      over=None if over is None else _values(over), angle=angle, velocity=velocity)
    of_starts = given(velocities=None if velocities is None else _numbers(
        velocities, 2, f"--velocities needs lowest:highest, as in -2:4, not {shown(velocities)}."))
    if basins is not None and of_points:
        raise SceneError(f"--{next(iter(of_points))} and --basins cannot be combined; leave one of them out.")
    if basins is None and of_starts:
        raise SceneError("--velocities is for --basins; give the number of starts along each side, as in --basins 300.")
    result: Section | Basins
    with bar("section") as progress:
        if basins is not None:
            result = run_basins(place, size=basins, progress=progress, **shared, **of_starts)
        else:
            result = run_section(place, progress=progress, **shared, **of_points)
        paths = write(result, out, svg)
    before, title = f"{place.name}: {place.equation()}", None
    if isinstance(result, Basins):
        title = "attractors, at phase 0 of the drive"
    else:
        before += f"\n{len(result.angle)} points"
        if result.stopped:
            say(f"Warning: {result.stopped} runs ended early and have fewer points.")
        if result.over and result.event == "period":
            title = "periods of the drive after which the motion repeats"
    print_result(result, paths, as_json, before=before, title=title)


def _values(text: str) -> dict[str, Any]:
    """Return the parameter and its values from a text of the form name=first:last:count.

    Raises SceneError for a text of another form.
    """
    import numpy as np

    name, _, span = text.partition("=")
    first, last, many = _numbers(span if name.strip() else "", 3, "--over needs name=first:last:count, as in "
                                 f"drive_torque=1.06:1.087:600, not {shown(text)}.")
    count = whole_number(int(many) if many.is_integer() else many, "The count of --over", 1_000_000)
    return {name.strip(): np.linspace(first, last, count)}


def _numbers(text: str, count: int, refusal: str) -> tuple[float, ...]:
    """Return ``count`` finite numbers separated by colons; SceneError for any other text."""
    try:
        numbers = tuple(float(part) for part in text.split(":"))
    except ValueError:
        numbers = ()
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        raise SceneError(refusal)
    return numbers
