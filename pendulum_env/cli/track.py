"""The command ``lab-pendulum track``, which follows the bob of a filmed pendulum."""

from __future__ import annotations

from pathlib import Path
from shlex import quote
from typing import Annotated, Any

import typer

from pendulum_env.cli import options
from pendulum_env.cli.console import bar, print_files, print_table, print_text, printable


def track(
    file: Annotated[Path, typer.Argument(help="Film of a swinging pendulum, such as swing.mp4 of a phone on a stand.")],
    pivot: Annotated[str | None, options.option("Place X,Y of the pivot in pixels from the top left; by default the "
                                                "centre of the circle through the bob's places.")] = None,
    bob: Annotated[str | None, options.option("Place X,Y on the bob's way in pixels, if several things swing.")] = None,
    length: options.Length = None,
    until: options.Until = None,
    drop: options.Drop = None,
    rate: Annotated[float | None, options.number("Frames per second of the camera, for slow motion; by default as the "
                                                 "file says.")] = None,
    page: Annotated[bool, options.flag("Open the film in the browser first: click bob and pivot, leave out bad "
                                       "stretches.", "--page")] = False,
    browser: options.Browser = True,
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

    given = {"length": length, "until": until, "drop": drop, "rate": rate, **{
        name: options.parts(text) for name, text in (("pivot", pivot), ("bob", bob)) if text is not None}}
    filmed, finding = not no_film, 0.0 if page else 1.0 if no_film else 0.7
    if page:
        from pendulum_env.bench.film_page import serve

        found, given = serve(file, open_browser=browser, **given)
        print(printable(f"Without the page: {_command(file, given)}"))  # in one line, to be copied
    with bar("track") as progress:
        if not page:
            found = follow(file, **given, progress=lambda done, text: progress(finding * done, text))
        paths = write(found, file, out, filmed=filmed,
                      progress=lambda done, text: progress(finding + (1.0 - finding) * done, text))
    print_table(found.table, f"the track in {found.source}")
    print_text(found.text)
    print_files(paths)
    print_text(f"lab-pendulum fit {paths[0]} fits it.")


def _command(file: Path, given: dict[str, Any]) -> str:
    """Return the command that tracks a film with settings that were made at the page."""
    words = [f"lab-pendulum track {quote(str(file))}"]
    for name, value in given.items():
        if name == "drop":
            words += [f"--drop {one if isinstance(one, str) else f'{one[0]:g}:{one[1]:g}'}" for one in value]
        else:
            parts = value if isinstance(value, list) else [value]
            words.append(f"--{name} {','.join(f'{part:g}' for part in parts)}")
    return " ".join(words)
