"""The command ``lab-pendulum compare``: methods side by side on one scene, or their stability without a scene."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from pendulum_env.cli.console import bar, print_files, print_table, print_text
from pendulum_env.cli.options import (
    Angle,
    Atol,
    Damping,
    Duration,
    Panels,
    Reading,
    Rtol,
    SceneName,
    Settings,
    Step,
    Theme,
    Velocity,
    given_by_user,
    radians,
    recording_of,
    scene_of,
    split,
)
from pendulum_env.study import PLAIN


def compare(
    context: typer.Context,
    scene: SceneName = "exercise",
    integrators: Annotated[
        list[str], typer.Option("--integrators", "-i", help="Names of methods, with commas, or repeat the option.")
    ] = list(PLAIN),  # noqa: B006
    damping: Damping = "scene",
    angle: Angle = None,
    velocity: Velocity = None,
    dt: Step = None,
    duration: Duration = None,
    rtol: Rtol = None,
    atol: Atol = None,
    recording: Annotated[
        Path | None, typer.Option(help="File of a sensor's recording, to plot over the curves.")
    ] = None,
    film: Annotated[bool, typer.Option(help="Film the pendulums side by side.")] = True,
    theme: Theme = "light",
    panels: Panels = "apparatus,energy",
    stability: Annotated[
        bool, typer.Option("--stability", help="Show the methods' stability regions, growth and phase error; no scene.")
    ] = False,
    out: Annotated[
        Path | None, typer.Option(help="Folder for the files; by default out/compare, with --stability out/stability.")
    ] = None,
    settings: Settings = None,
    read: Reading = None,
) -> None:
    """Run several integrators on one scene: curves, phase portrait, energy, drift table, CSV and a film side by side.

    With --rtol all methods must be adaptive, and dt is the time between records. With --stability no scene is run.
    """
    names = ",".join(integrators)
    if stability:
        given = [name for name in context.params if name not in ("integrators", "stability", "out")]
        show_stability(names, given_by_user(context, *given), out or Path("out/stability"))
        return

    from pendulum_env.common.provenance import checked_folder
    from pendulum_env.films.look import checked_look
    from pendulum_env.physics.units import SceneError
    from pendulum_env.study.compare import compare as run
    from pendulum_env.study.compare import write
    from pendulum_env.study.compare.drift import LEADING_ERROR

    folder, look = out or Path("out/compare"), checked_look(theme, split(panels), ("energy",), "")
    if not film and (given := given_by_user(context, "theme", "panels")):
        raise SceneError(f"--{given[0]} is for the film, but --no-film makes no film; leave one of them out.")
    place = scene_of(scene, damping, settings)
    checked_folder(folder)
    measured = recording_of(recording, read) if recording is not None or read else None
    with bar("compare") as progress:
        comparison = run(place, names, angle=radians(angle), velocity=velocity, dt=dt, duration=duration, rtol=rtol,
                    atol=atol, recording=measured, progress=lambda done, text: progress(0.3 * done, text))
        paths = write(comparison, folder, film=film, theme=look.theme, panels=look.panels,
                      progress=lambda done, text: progress(0.3 + 0.7 * done, text))
    print_text(comparison.text)
    print_table(comparison.table, below=LEADING_ERROR)
    print_files(paths)


def show_stability(integrators: str, given: Sequence[str], out: Path) -> None:
    """Run ``lab-pendulum compare --stability``; raise SceneError if other options, named in ``given``, were used too.
    """
    from pendulum_env.common.provenance import checked_folder
    from pendulum_env.physics.units import SceneError
    from pendulum_env.study.stability import stability, write

    if given:
        option = {"settings": "set", "film": "film or --no-film"}.get(given[0], given[0])
        raise SceneError(f"--stability runs no scene, and takes only --integrators and --out; leave out --{option}.")
    checked_folder(out)
    result = stability(integrators)
    with bar("stability") as progress:
        paths = write(result, out, progress=progress)
    print_table(result.table, below="leading error")
    print_text(result.notes)
    print_files(paths)
