"""What moves in the panel "apparatus": trail, torque arrow, rod or wire, bob and its readings."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pendulum_env.render.curves import fading
from pendulum_env.render.paint import Floats, Image, ball, disc, stroke
from pendulum_env.render.palette import rgb
from pendulum_env.render.text import MINUS, write
from pendulum_env.render.view import View

if TYPE_CHECKING:
    from pendulum_env.render.stand import Stand

TRAIL_STRENGTH = 0.6
PIECE, MOST_PIECES = 5.0, 200
"""Trails of a bob whose pivot moves are drawn in straight pieces of so many pixels, so many from place to place."""
TORQUE_SWEEP = math.radians(120)
HEAD_LENGTH = 3.2
"""Length of the torque arrow's head over the width of its shaft."""


def paint_swing(image: Image, at: Stand, view: View, tone: Floats) -> None:
    """Paint what moves over a stand that stands still; the image must be contiguous."""
    hub, (x, y) = at.places(view)
    if at.shaken:
        at.paint_wheel(image, *hub)
        _trail(image, at, view, tone)
    elif view.trail:
        at.path.trail(image, (*view.trail, view.angle), TRAIL_STRENGTH, tone)
    if view.torque_share:
        _torque(image, at, hub, view.angle, view.torque_share)
    stroke(image, *hub, x, y, at.rod, at.metal)
    if at.shaken:
        disc(image, *hub, at.hub, rgb(at.theme.sensor))
    else:
        at.cap.paint(image)
    ball(image, x, y, at.bob, tone)
    if at.readings:
        _readings(image, at, view)


def _trail(image: Image, at: Stand, view: View, tone: Floats) -> None:
    """The path of a bob whose pivot moves."""
    pivots = view.trail_pivots or (view.pivot,) * len(view.trail)
    angles = np.array([*view.trail, view.angle])
    hubs = np.array([at.pivot(away) for away in (*pivots, view.pivot)])
    steps = np.hypot(np.diff(angles) * at.arm, np.hypot(*np.diff(hubs, axis=0).T))
    counts = np.clip(np.ceil(steps / PIECE), 1, MOST_PIECES).astype(int)
    ages = np.append(np.repeat(np.arange(len(steps)), counts) + np.concatenate(
        [np.arange(count) / count for count in counts] or [np.empty(0)]), len(steps))
    spread = np.arange(len(angles))
    whole = np.interp(ages, spread, angles)
    x = np.interp(ages, spread, hubs[:, 0]) + at.arm * np.sin(whole)
    y = np.interp(ages, spread, hubs[:, 1]) + at.arm * np.cos(whole)
    strength = TRAIL_STRENGTH * (ages / max(1, len(steps))) ** 1.5
    fading(image, np.stack((x, y, strength), axis=1), at.path.width, tone)


def _torque(image: Image, at: Stand, hub: tuple[float, float], angle: float, share: float) -> None:
    """An arrow from the rod in the direction the torque turns it, as long as the torque is large."""
    ring = at.turning(*hub) if at.shaken else at.turn
    sweep = TORQUE_SWEEP * share
    ring.arrow(image, angle, sweep, min(HEAD_LENGTH * ring.width / ring.radius, 0.6 * abs(sweep)), rgb(at.theme.torque))


def _readings(image: Image, at: Stand, view: View) -> None:
    """Angle and velocity in the lower right corner, where they stay clear of the pendulum's circle."""
    assert at.readings
    right, bottom, high, _ = at.readings
    degrees = round(math.degrees(math.remainder(view.angle, 2 * math.pi)), 1) + 0.0
    size = abs(view.velocity)
    speed = f"{round(view.velocity, 2) + 0.0:{'.2f' if size < 100 else '.0f' if size < 1e5 else '.0e'}}"
    for line, text in enumerate((f"ω = {speed} rad/s", f"θ = {degrees:.1f}°")):
        write(image, text.replace("-", MINUS), right, bottom - line * high, at.font, at.theme.faint_ink, (1.0, 1.0),
              at.theme.paper)
