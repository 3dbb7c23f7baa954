"""The command ``lab-pendulum web``, which writes the lab as one page for a browser."""

from __future__ import annotations

from pathlib import Path

from pendulum_env.cli import options
from pendulum_env.cli.console import bar, print_text
from pendulum_env.physics.presets import SCENES

ALL = "all"
"""Word for every scene, and for every method."""


def web(
    scenes: options.SceneNamesOrNone = None,
    integrators: options.IntegratorsOrNone = None,
    out: options.OutFile = Path("lab.html"),
) -> None:
    """Write the lab as one page: pendulums side by side in a browser, by any integrators, with the same bits as Python.

    The word all stands for all presets, or all methods; by default there are those of the course. The file's name ends
    in .html: open it with a double click, it needs no server and no network. In the page you choose scene, numbers,
    methods and steps, drag the bob, and see the energies, the errors and the accurate solution; a link holds the whole
    state.
    """
    import integrators as package
    from pendulum_env.web.document import write

    chosen = list(SCENES) if scenes == [ALL] else scenes
    methods = list(package.METHODS) if integrators == [ALL] else integrators
    with bar("web page") as progress:
        path = write(out, chosen, methods, progress=progress)
    print_text(f"Wrote {path}; open it in a browser.")
