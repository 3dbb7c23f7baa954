"""The program of a scene with a method, as text to read or to translate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from integrators import Method
from pendulum_env.engine.generate import program
from pendulum_env.engine.machine import check_diagnostics, find_method, reported
from pendulum_env.physics.damping import Damping, build_scene
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import one_of

LANGUAGES = ("engine",)
"""Languages that a program can be had in; "engine" is the Python that the engine itself runs."""


def code(
    scene: str | Scene | Mapping[str, object] = "lab",
    integrator: str | Method = "rk4",
    language: str = "engine",
    *,
    damping: Damping = "scene",
    diagnostics: Sequence[str] = ("energy",),
) -> str:
    """Return the program that simulates a scene with a method, as text.

    It holds the functions of the scene's effects and of no others, one step of the method written out, the checks of a
    step (``advance``), and the loop around it (``run``). Values of parameters are arguments.

    Args:
        scene: preset name, dict, Scene, or a scene's JSON file.
        integrator: name of a method, or a Method.
        language: "engine": Python on floats, as it is interpreted or compiled. The decorators ``inline`` and ``entry``
            are left to whoever runs it; they may do nothing.
        damping: as in :func:`pendulum_env.physics.damping.with_damping`.
        diagnostics: "energy", "heat_by_effect", "tension", "flow": what is computed beside the motion; () for nothing.

    Raises SceneError or MethodError for arguments that are not possible, such as a method that does not fit the scene.
    """
    one_of(language, "language", LANGUAGES)
    place = build_scene(scene, damping, {})
    return program(place, find_method(integrator, place), reported(check_diagnostics(diagnostics))).text
