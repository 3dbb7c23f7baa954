"""The command ``lab-pendulum code``, which prints a program for a scene and a method."""

from __future__ import annotations

from typing import Annotated

import typer

from pendulum_env.cli.options import Damping, SceneName, Settings, scene_of


def code(
    scene: SceneName = "exercise_large",
    integrator: Annotated[
        str, typer.Option("--integrator", "-i", help="Name of a method (lab-pendulum list integrators).")
    ] = "symplectic_euler",
    language: Annotated[
        str, typer.Option(help="plain: a loop as a student would write it; engine: the program that the engine runs; "
                          "javascript: that program as a JavaScript module.")
    ] = "plain",
    damping: Damping = "scene",
    settings: Settings = None,
) -> None:
    """Print the program of a scene and an integrator: a plain loop with NumPy and Matplotlib that runs as it is.

    The plain loop is for explicit one-step methods; add > loop.py to store it in a file. With --language javascript
    it is a module for Node or a web page that computes the same bits as Python.
    """
    from pendulum_env.engine.code import code as program

    print(program(scene_of(scene, damping, settings), integrator, language), end="")
