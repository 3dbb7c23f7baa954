"""The command ``lab-pendulum track``, which follows the bob of a filmed pendulum."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pendulum_env.cli import options
from pendulum_env.cli.console import bar, print_files, print_table, print_text


def track(
    file: Annotated[Path, typer.Argument(help="Film of a swinging pendulum, such as swing.mp4 of a phone on a stand.")],
    pivot: Annotated[str | None, options.option("Place X,Y of the pivot in pixels from the top left; by default the "
                                                "centre of the circle through the bob's places.")] = None,
    bob: Annotated[str | None, options.option("Place X,Y on the bob's way in pixels, if several things swing.")] = None,
    length: Annotated[float | None, options.number("Distance of the bob from the pivot in m, for the scale of the "
                                                   "picture.")] = None,
    until: options.Until = None,
    rate: Annotated[float | None, options.number("Frames per second of the camera, for slow motion; by default as the "
                                                 "file says.")] = None,
    no_film: Annotated[bool, options.flag("Leave out track.mp4.", "--no-film")] = False,
    out: options.Out = Path("out/track"),
) -> None:
    """Track the bob in a film: its angle in each frame, with an error, for fit and measure.

    The bob is found by its motion to and fro. track.csv has time, angle, error and the place in the picture; track.mp4
    shows the track over the film, track.png the way and the angle. The camera must stand still. Ctrl-C keeps what was
    tracked. lab-pendulum fit FILE tracks and fits in one go.
    """
    from pendulum_env.lab.film import follow
    from pendulum_env.study.film_report import write

    place = {name: options.parts(text) for name, text in (("pivot", pivot), ("bob", bob)) if text is not None}
    with bar("track") as progress:
        found = follow(file, **place, length=length, until=until, rate=rate,
                       progress=lambda done, text: progress(done if no_film else 0.7 * done, text))
        paths = write(found, file, out, filmed=not no_film,
                      progress=lambda done, text: progress(0.7 + 0.3 * done, text))
    print_table(found.table, f"the track in {found.source}")
    print_text(found.text)
    print_files(paths)
    print_text(f"lab-pendulum fit {paths[0]} fits it.")
