"""Frames between two instants, for slow motion."""

from __future__ import annotations

from dataclasses import replace

from pendulum_env.render.view import View

LEDGER = ("kinetic", "potential", "heat", "work", "residual")


def between(first: View, last: View, share: float) -> View:
    """The view at a share, 0 to 1, of the time from one view to a later one.

    The angle is the cubic with both angles and velocities (Hermite), the velocity that of the cubic; the energies and
    the pivot's place change linearly. The trail, the past and what does not change are the first one's.
    """
    if share >= 1.0:
        return last
    h, s = last.time - first.time, share
    way = last.angle - first.angle
    angle = (first.angle + s * s * (3.0 - 2.0 * s) * way
             + h * s * (1.0 - s) * ((1.0 - s) * first.velocity - s * last.velocity))
    velocity = (6.0 * s * (1.0 - s) * way / h + (1.0 - s) * (1.0 - 3.0 * s) * first.velocity
                + s * (3.0 * s - 2.0) * last.velocity)
    energies = {name: a + s * (b - a) for name in LEDGER
                if (a := getattr(first, name)) is not None and (b := getattr(last, name)) is not None}
    x, y = (a + s * (b - a) for a, b in zip(first.pivot, last.pivot, strict=True))
    return replace(first, time=first.time + s * h, angle=angle, velocity=velocity, torque_share=last.torque_share,
                   pivot=(x, y), **energies)
