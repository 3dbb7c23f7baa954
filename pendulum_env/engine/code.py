"""The function :func:`code`: the generated program of a scene with a method, as text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from integrators import Method
from pendulum_env.engine.generate import program
from pendulum_env.engine.machine import check_diagnostics, find_method, reported
from pendulum_env.physics.damping import Damping, build_scene
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import one_of

LANGUAGES = ("engine",)
"""Names of the languages of programs; "engine" is the Python that the engine itself runs."""


def code(
    scene: str | Scene | Mapping[str, object] = "lab",
    integrator: str | Method = "rk4",
    language: str = "engine",
    *,
    damping: Damping = "scene",
    diagnostics: Sequence[str] = ("energy",),
) -> str:
    """Return the program that simulates a scene with a method, as text.

    The program holds only the functions of the scene's effects, one step of the method written out, the step with its
    checks (``advance``), and the loop over steps (``run``). The values of parameters are arguments.

    Args:
        scene: preset name, dict, Scene, or a scene's JSON file.
        integrator: name of a method, or a Method.
        language: "engine" for Python on floats, the text that the engine interprets or compiles. Define the decorators
            ``inline`` and ``entry`` before you run it; they may return the function unchanged.
        damping: as in :func:`pendulum_env.physics.damping.with_damping`.
        diagnostics: quantities computed beside the motion: "energy", "heat_by_effect", "tension", "flow"; () for none.

    Raises SceneError or MethodError for invalid arguments, such as a method that does not fit the scene.
    """
    one_of(language, "language", LANGUAGES)
    place = build_scene(scene, damping, {})
    return program(place, find_method(integrator, place), reported(check_diagnostics(diagnostics))).text
