"""The function :func:`code`: the program of a scene with a method, as text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from integrators import Method
from pendulum_env.engine.generate import program
from pendulum_env.engine.javascript import javascript
from pendulum_env.engine.machine import check_diagnostics, find_method
from pendulum_env.engine.plain import plain_program
from pendulum_env.physics.damping import Damping, build_scene
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import one_of

LANGUAGES = ("plain", "engine", "javascript")
"""Names of the languages of programs; :func:`code` explains them."""


def code(
    scene: str | Scene | Mapping[str, object] = "lab",
    integrator: str | Method = "rk4",
    language: str = "plain",
    *,
    damping: Damping = "scene",
    diagnostics: Sequence[str] = ("energy",),
) -> str:
    """Return a program that simulates a scene with a method, as text.

    The plain program is a loop as a student would write it, for the scene's usual run. It needs only NumPy and
    Matplotlib, runs as it is, and gives the numbers of :func:`pendulum_env.rollout` up to rounding.

    The engine's program holds only the functions of the scene's effects, one step of the method written out, the step
    with its checks (``advance``), and the loop over steps (``run``). The values of parameters are arguments. Define the
    decorators ``inline`` and ``entry`` before you run it; they may return the function unchanged.

    The JavaScript program is a module with the engine's functions under the same names. It exports ``run`` and
    ``info``, and computes the same bits as the engine in every browser and in Node: JavaScript rounds +, -, *, / and
    square roots of doubles as Python does, and sine and exponential are part of the program.

    Args:
        scene: preset name, dict, Scene, or a scene's JSON file.
        integrator: name of a method, or a Method.
        language: "plain" for a plain loop, which explicit one-step methods have; "engine" for the Python on floats that
            the engine interprets or compiles; "javascript" for the same program as a JavaScript module.
        damping: as in :func:`pendulum_env.physics.damping.with_damping`.
        diagnostics: quantities that the engine's program, in either language, computes beside the motion: "energy",
            "heat_by_effect", "tension", "flow"; () for none.

    Raises SceneError or MethodError for invalid arguments, such as a method that does not fit the scene, and for a
    method or a scene without a plain program; ProgramError for a function that cannot be copied into a program, and for
    a program that cannot be translated to JavaScript, such as one that calls a step of your own in Python.
    """
    one_of(language, "language", LANGUAGES)
    built = build_scene(scene, damping, {})
    method, names = find_method(integrator, built), check_diagnostics(diagnostics)
    if language == "plain":
        return plain_program(built, method)
    generated = program(built, method, names)
    return javascript(generated) if language == "javascript" else generated.text
