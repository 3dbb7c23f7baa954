"""A page for the browser that computes the same bits as Python; see README.md beside this file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pendulum_env.engine.code import code
from pendulum_env.web.document import page, write
from pendulum_env.web.links import link_of, read_link
from pendulum_env.web.notebook import widget

if TYPE_CHECKING:
    from integrators import Method
    from pendulum_env.physics.scene import Scene

__all__ = ["javascript", "link_of", "page", "read_link", "widget", "write"]


def javascript(scene: str | Scene = "lab", integrator: str | Method = "rk4", **options: Any) -> str:
    """Return the program of a scene and a method as a JavaScript module; see :func:`pendulum_env.code`.

    ``options`` are ``damping`` and ``diagnostics``.
    """
    return code(scene, integrator, "javascript", **options)

