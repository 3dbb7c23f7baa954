"""The command ``lab-pendulum web``, which writes the lab as one page for a browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pendulum_env.cli.console import bar, print_text
from pendulum_env.cli.options import split

ALL = "all"
"""Word for every scene, and for every method."""


def web(
    scenes: Annotated[
        str | None, typer.Option(help="Names of presets, with commas, or all; by default those of the course.")
    ] = None,
    integrators: Annotated[
        str | None, typer.Option(help="Names of methods, with commas, or all; by default eleven.")
    ] = None,
    out: Annotated[Path, typer.Option(help="The file, whose name ends in .html.")] = Path("lab.html"),
) -> None:
    """Write the lab as one page: pendulums side by side in a browser, by any integrators, with the same bits as Python.

    Open it with a double click: it needs no server and no network. In the page you choose scene, numbers, methods and
    steps, drag the bob, and see the energies, the errors and the accurate solution; a link holds the whole state.
    """
    import integrators as package
    from pendulum_env.physics.presets import SCENES
    from pendulum_env.web.document import write

    chosen = list(SCENES) if scenes == ALL else None if scenes is None else split(scenes)
    methods = list(package.METHODS) if integrators == ALL else None if integrators is None else split(integrators)
    with bar("web page") as progress:
        path = write(out, chosen, methods, progress=progress)
    print_text(f"Wrote {path}; open it in a browser.")
