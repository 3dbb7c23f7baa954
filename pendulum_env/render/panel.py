"""One pendulum, or several next to each other, as an RGB picture. Pure: equal input, equal pixels."""

from __future__ import annotations

import math
import operator
from collections.abc import Sequence
from typing import Any

import numpy as np

from . import palette
from .bars import paint_bars, rows
from .layout import LEAST, MOST, TEXT_FROM, font_size, grid
from .paint import Floats, Image, ball, bar, disc, fading, polygon, stroke
from .palette import colour, gradient, rgb
from .ring import Ring
from .stand import Stage, paint_wheel, stage
from .text import MINUS, fit, measure, write
from .view import Apparatus, View

TRAIL_STRENGTH = 0.6
PIECE, MOST_PIECES = 5.0, 200
"""Trails of a bob whose pivot moves are drawn in straight pieces of so many pixels, so many from place to place."""
TORQUE_SWEEP = math.radians(120)
_ROD = gradient(palette.STEEL_DARK, palette.STEEL_LIGHT, palette.STEEL_DARK)
_WIRE = rgb(palette.WIRE)


def frame(apparatus: Apparatus, view: View, size: int | tuple[int, int] = 500) -> Image:
    """Return the picture of one pendulum: a fresh, contiguous uint8 array of shape (H, W, 3).

    size: pixels along each side, or (width, height); 50 to 8192. Frames under 120 show no text and no bars.
    The pendulum's full circle fits in; positive angles are to the right of the vertical, and positive torque
    turns counter-clockwise.

    Raises ValueError or TypeError for another size.
    """
    width, height = frame_size(size, "size")
    image = np.empty((height, width, 3), dtype=np.uint8)
    title = " · ".join(part for part in (apparatus.title, view.caption) if part)
    _draw(image, apparatus, view, view.accent or palette.BOB, title, clock=True)
    return image


def side_by_side(
    panels: Sequence[tuple[Apparatus, View]],
    panel_size: int | tuple[int, int] = 360,
    columns: int | None = None,
) -> Image:
    """Return a picture of several pendulums under a shared clock, row by row, each with its caption and bars.

    panel_size: as `frame`'s size, for each panel.  columns: None for a grid that is wider than high.
    A panel without an accent takes `colour(index)`, the colour that figures give to the index-th method.
    A title that all share stands beside the clock.

    Raises ValueError for no panels, views that are neither stopped nor at one time, or a bad size or columns.
    """
    if not panels:
        raise ValueError("side_by_side needs at least one (apparatus, view) pair, not none")
    width, height = frame_size(panel_size, "panel_size")
    across, down = grid(len(panels), columns)
    time = max(view.time for _, view in panels)
    for _, view in panels:
        if not view.stopped and abs(view.time - time) > 1e-9 * max(1.0, abs(time)):
            raise ValueError(f"the panels share one clock, so a view at {view.time} s beside one at {time} s "
                             "must be marked stopped")
    size = round(1.2 * font_size(width, height))
    top = round(1.7 * size) if min(width, height) >= TEXT_FROM else 0
    image = np.empty((top + down * height, across * width, 3), dtype=np.uint8)
    image[...] = rgb(palette.PAPER)
    titles = {apparatus.title for apparatus, _ in panels}
    if top:
        margin = 0.5 * size
        _line(image[:top], size, margin, across * width - margin, titles.pop() if len(titles) == 1 else "",
              f"t = {time:.2f} s", palette.INK)
        titles.discard("")
    for index, (apparatus, view) in enumerate(panels):
        x, y = index % across * width, top + index // across * height
        cell = image[y:y + height, x:x + width]
        title = " · ".join(part for part in (apparatus.title if titles else "", view.caption) if part)
        _draw(cell, apparatus, view, view.accent or colour(index), title, clock=False)
    image[top::height] = image[top:, width::width] = rgb(palette.HAIRLINE)
    return image


def frame_size(size: int | tuple[int, int], name: str) -> tuple[int, int]:
    """Width and height in pixels of what may be given as a size; ValueError or TypeError if it is none."""
    listed = isinstance(size, tuple | list) or (isinstance(size, np.ndarray) and size.ndim == 1)
    pair: Any = size if listed else (size, size)
    if len(pair) != 2 or any(isinstance(side, bool | np.bool_) for side in pair):
        raise ValueError(f"{name} must be one whole number of pixels or (width, height), not {size!r}")
    try:
        width, height = (operator.index(side) for side in pair)
    except TypeError:
        allowed = "one whole number of pixels or (width, height)"
        raise TypeError(f"{name} must be {allowed}, not {size!r}") from None
    if not (LEAST <= width <= MOST and LEAST <= height <= MOST):
        raise ValueError(f"{name} must be {LEAST} to {MOST} pixels along each side, not {size!r}")
    return width, height


def _draw(image: Image, apparatus: Apparatus, view: View, accent: str, title: str, clock: bool) -> None:
    names = rows(view)
    at = stage(apparatus, image.shape[1], image.shape[0], names)
    np.copyto(image, at.background)
    tone = rgb(accent)
    hub = at.pivot(view.pivot)
    if at.shaken:
        paint_wheel(image, at, *hub)
        _trail(image, at, view, tone)
    elif view.trail:
        at.path.trail(image, np.array([*view.trail, view.angle]), TRAIL_STRENGTH, tone)
    if view.torque_share:
        _torque(image, at, hub, view.angle, view.torque_share)
    x, y = _from(hub, view.angle, at.arm)
    stroke(image, *hub, x, y, at.rod, _ROD if apparatus.suspension == "rod" else _WIRE)
    disc(image, *hub, max(0.22 * at.wheel, 0.8 * at.rod), rgb(palette.SENSOR))
    ball(image, x, y, at.bob, tone)
    if at.layout.header:
        _header(image, at, view, accent, title, clock)
        _readings(image, at, view)
    if at.axis:
        paint_bars(image, at.axis, view)


def _from(hub: tuple[float, float], angle: float, radius: float) -> tuple[float, float]:
    """The pixel (x, y) at an angle [rad] and a distance [px] from a pivot."""
    return hub[0] + radius * math.sin(angle), hub[1] + radius * math.cos(angle)


def _trail(image: Image, at: Stage, view: View, tone: Floats) -> None:
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


def _torque(image: Image, at: Stage, hub: tuple[float, float], angle: float, share: float) -> None:
    """An arc from the rod in the direction the torque turns it, as long as the torque is large."""
    ring, tone = at.turn, rgb(palette.TORQUE)
    if at.shaken:
        ring = Ring(*hub, ring.radius, ring.width, (image.shape[0], image.shape[1]))
    sweep = TORQUE_SWEEP * share
    head = math.copysign(min(3.2 * ring.width / ring.radius, 0.6 * abs(sweep)), share)
    ring.arc(image, angle, sweep - 0.9 * head, tone)
    x, y = _from(hub, angle + sweep - head, ring.radius)
    across = angle + sweep - head / 2
    dx, dy = (0.6 * abs(head) * ring.radius * unit for unit in (math.sin(across), math.cos(across)))
    polygon(image, [(x + dx, y + dy), _from(hub, angle + sweep, ring.radius), (x - dx, y - dy)], tone)


def _header(image: Image, at: Stage, view: View, accent: str, title: str, clock: bool) -> None:
    area, font = at.layout.header, at.layout.font
    assert area is not None
    left = area.left
    if view.caption:
        side = round(0.6 * font)
        top = round((area.top + area.bottom - side) / 2)
        bar(image, left, top, left + side, top + side, rgb(accent))
        left += 0.95 * font
    right = f"stopped at {view.time:.2f} s" if view.stopped else f"t = {view.time:.2f} s" if clock else ""
    _line(image[:round(area.top + area.bottom)], font, left, area.right, title, right,
          palette.WARNING if view.stopped else palette.INK)


def _line(strip: Image, font: int, left: float, right: float, title: str, clock: str, tone: str) -> None:
    """Write the clock at the right of a strip and, in what is left of its width, the title."""
    y = strip.shape[0] / 2
    write(strip, clock, right, y, font, tone, (1.0, 0.5))
    room = right - left - (measure(clock, font)[0] + font if clock else 0)
    plain = " ".join("".join(c if c.isprintable() else " " for c in title).split())
    write(strip, fit(plain, font, room), left, y, font, palette.INK)


def _readings(image: Image, at: Stage, view: View) -> None:
    """Angle and velocity in the body's lower right corner, where they stay clear of the pendulum's circle."""
    body, font = at.layout.body, at.layout.font
    wide, high = measure(f"ω = {MINUS}88.88 rad/s", font)
    if not at.corner(wide + 0.5 * font, 2.1 * high):
        return
    degrees = math.degrees(math.remainder(view.angle, 2 * math.pi))
    speed = f"{view.velocity:.2f}" if abs(view.velocity) < 100 else f"{view.velocity:.3g}"
    for line, text in enumerate((f"ω = {speed} rad/s", f"θ = {degrees:.1f}°")):
        write(image, text.replace("-", MINUS), body.right - 0.5 * font, body.bottom - line * high, font,
              palette.FAINT_INK, (1.0, 1.0))
