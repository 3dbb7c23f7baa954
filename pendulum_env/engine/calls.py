"""Generated source of the calls of a method's step, and of the start of a multistep method."""

from __future__ import annotations

from pendulum_env.engine.shape import Shape, joined


def stepped(shape: Shape, t: str = "t", h: str = "h") -> str:
    """Return the source of the call of the method's step of length ``h`` from the time ``t``."""
    step = "stick_slip" if shape.slides else "step"
    return f"{step}({joined((t, 'q', 'v'), shape.handed, (h,), shape.extra)})"


def potential(shape: Shape, q: str = "q", wrapped: bool = True) -> str:
    """Return the source of the call of ``potential``, the potential energy per moment of inertia at the angle ``q``.

    In periodic scenes it takes the sine of half the angle, too. The angle of a state is wrapped, so that its half needs
    no reduction, and the sine is the one that the observation takes.
    """
    sine = "sin_near_zero(0.5*{}, 0.0)" if wrapped else "sin(0.5*{})"
    return f"potential({joined((q, *([sine.format(q)] if shape.periodic else [])), shape.place)})"


def begin(shape: Shape, t: str = "index*h") -> str:
    """Return the source of the call of ``begin``, which computes the first history of a multistep method."""
    return f"begin({joined((t, 'q', 'v', 'h'), shape.extra)})"
