"""The command ``lab-pendulum code``, which prints a program for a scene and a method."""

from __future__ import annotations

from typing import Annotated

from pendulum_env.cli import options
from pendulum_env.cli.options import one_method, scene_of


def code(
    scene: options.SceneName = "exercise_large",
    integrators: options.Integrators = ["symplectic_euler"],
    language: Annotated[
        str, options.word("plain: a loop as a student would write it; engine: the program that the engine runs; "
                          "javascript: that program as a JavaScript module.")] = "plain",
    damping: options.Damping = "scene",
    settings: options.Settings = None,
) -> None:
    """Print the program of a scene and an integrator: a plain loop with NumPy and Matplotlib that runs as it is.

    The plain loop is for explicit one-step methods and, in linear scenes such as exercise, for backward_euler and its
    like, which solve two linear equations in a step; it draws angle, velocity, phase plot and energy. Add > loop.py to
    store it in a file. With --language javascript it is a module for Node or a web page that computes the same bits as
    Python.
    """
    from pendulum_env.engine.code import code as program

    print(program(scene_of(scene, damping, settings), one_method(integrators), language), end="")
