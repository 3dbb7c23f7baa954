"""Checks of the arguments size, theme and panels of frames; the error names the invalid argument."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pendulum_env.physics.units import SceneError, one_of, several, shown
from pendulum_env.render import PANELS, THEMES, FrameStyle
from pendulum_env.render.layout import LEAST, MOST
from pendulum_env.render.panel import frame_size


def checked_size(size: Any, name: str) -> tuple[int, int]:
    """Return the width and height of frames [px] from one number or two; SceneError for an invalid size."""
    try:
        return frame_size(size, name)
    except (TypeError, ValueError):
        raise SceneError(
            f"{name} must be {LEAST} to {MOST} pixels, one whole number or (width, height), not {shown(size)}."
        ) from None


def checked_look(theme: Any, panels: Any, diagnostics: Sequence[str], prefix: str = "render_") -> FrameStyle:
    """Return the style of frames, after a check of its theme and panels.

    Raises SceneError for an unknown theme or panel, and for a panel of energies if "energy" is not in ``diagnostics``.
    """
    name = one_of(theme, f"{prefix}theme", THEMES)
    names = tuple(one_of(panel, f"panel in {prefix}panels", PANELS) for panel in several(
        panels, f"{prefix}panels", f"panels ({', '.join(PANELS)})"))
    if not names or len(set(names)) < len(names):
        given = "none" if not names else "one of them twice"
        raise SceneError(f"{prefix}panels must be one or more of {', '.join(PANELS)}, not {given}.")
    for panel in names:
        if PANELS[panel].needs >= {"past", "energies"} and "energy" not in diagnostics:
            raise SceneError(f'The panel "{panel}" needs the diagnostic "energy"; add "energy" to diagnostics.')
    return FrameStyle(name, names)
