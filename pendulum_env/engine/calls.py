"""Generated source of the calls of a method's step, and of the start of a multistep method."""

from __future__ import annotations

from pendulum_env.engine.shape import Shape, joined


def stepped(shape: Shape, t: str = "t", h: str = "h") -> str:
    """Return the source of the call of the method's step of length ``h`` from the time ``t``."""
    step = "stick_slip" if shape.slides else "step"
    return f"{step}({joined((t, 'q', 'v'), shape.handed, (h,), shape.extra)})"


def begin(shape: Shape, t: str = "index*h") -> str:
    """Return the source of the call of ``begin``, which computes the first history of a multistep method."""
    return f"begin({joined((t, 'q', 'v', 'h'), shape.extra)})"
