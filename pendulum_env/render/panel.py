"""Pictures of one pendulum, or of several side by side, as RGB arrays; equal input gives equal pixels."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from pendulum_env.common.texts import clean
from pendulum_env.render.bars import rows
from pendulum_env.render.layout import LEAST, MOST, TEXT_FROM, Box, font_size, grid, spare
from pendulum_env.render.paint import Image
from pendulum_env.render.palette import THEMES, Theme, colour, rgb
from pendulum_env.render.stage import DEFAULT, FrameStyle, Stage, stage
from pendulum_env.render.strip import WINDOW, angles, shared_scale
from pendulum_env.render.text import fit, measure, write
from pendulum_env.render.view import Apparatus, View

PLAIN = FrameStyle()
STRIP = 0.4
"""Height of the strip with angles below several pendulums, over the height of one picture."""


def frame(apparatus: Apparatus, view: View, size: int | tuple[int, int] = 500, look: FrameStyle = PLAIN) -> Image:
    """Return the picture of one pendulum: a fresh, contiguous uint8 array of shape (H, W, 3).

    The pendulum's full circle fits into the picture. Positive angles are to the right of the vertical, and a positive
    torque turns the pendulum counter-clockwise.

    Args:
        apparatus: the pendulum and its dimensions.
        view: the :class:`View`, the state of the pendulum at the instant to draw.
        size: pixels along each side, or (width, height); 50 to 8192. Frames under 120 show one panel without text;
            those under 200 leave out panels that would be too small to read, but never the apparatus.
        look: theme and panels; by default light, the apparatus and energy bars.

    Raises ValueError or TypeError for another size.
    """
    return drawn(apparatus, view, frame_size(size, "size"), look)


def drawn(apparatus: Apparatus, view: View, size: tuple[int, int], look: FrameStyle) -> Image:
    """Return the picture of one pendulum for a size (width, height) [px] that is known to be valid; see :func:`frame`.
    """
    title = " · ".join(filter(None, (apparatus.title, view.caption)))
    return _draw(apparatus, view, size, look, None, True, title)


def side_by_side(
    panels: Sequence[tuple[Apparatus, View]],
    panel_size: int | tuple[int, int] = 360,
    columns: int | None = None,
    look: FrameStyle = PLAIN,
    own_clocks: bool = False,
    strip: float | None = None,
) -> Image:
    """Return a picture of several pendulums under a shared clock, row by row, each with its caption and bars.

    The picture is a uint8 array of shape (H, W, 3). A pendulum without an accent has ``colour(index)``, the colour that
    figures give to the index-th method. A title that all pendulums share is written beside the clock. Under a shared
    clock the panels "residual" share one scale, and empty places in the last row show the angles of all pendulums over
    the last ten seconds if every view has its past.

    Args:
        panels: (apparatus, view) of every pendulum.
        panel_size: size of the picture of every pendulum, as ``size`` of :func:`frame`.
        columns: number of pendulums in a row; None for a grid that is wider than high.
        look: theme and panels of all pendulums.
        own_clocks: True gives every pendulum its own clock, and allows different times.
        strip: time [s] up to 10 s over which the angles are shown, and in a picture without empty places a strip below
            is added for them; None for 10 s and no strip. The views need their past.

    Raises ValueError for no panels, an invalid size or columns, or times that differ under a shared clock, except
    those of stopped runs.
    """
    if not panels:
        raise ValueError("side_by_side needs at least one (apparatus, view) pair, not none")
    width, height = frame_size(panel_size, "panel_size")
    across, down = grid(len(panels), columns)
    time = max(view.time for _, view in panels)
    for _, view in panels:
        if not (own_clocks or view.stopped) and abs(view.time - time) > 1e-9 * max(1.0, abs(time)):
            raise ValueError(f"the panels share one clock, so a view at {view.time} s beside one at {time} s "
                             "must be marked stopped")
    if "residual" in look.panels and not own_clocks:
        scale = shared_scale([view for _, view in panels])
        panels = [(apparatus, replace(view, residual_scale=view.residual_scale or scale)) for apparatus, view in panels]
    theme, size = THEMES[look.theme], round(1.2 * font_size(width, height))
    top = round(1.7 * size) if min(width, height) >= TEXT_FROM else 0
    empty, font = spare(len(panels), columns), font_size(width, height)
    drawn = bool(top) and not own_clocks and all(view.past is not None for _, view in panels)
    below = round(STRIP * height) if strip is not None and drawn and not empty else 0
    image = _blank(top + down * height + below, across * width, theme.paper).copy()
    titles = {apparatus.title for apparatus, _ in panels}
    if top:
        margin = 0.5 * size
        _line(image[:top], size, margin, across * width - margin, titles.pop() if len(titles) == 1 else "",
              "" if own_clocks else f"t = {time:.2f} s", theme)
        titles.discard("")
    for index, (apparatus, view) in enumerate(panels):
        x, y = index % across * width, top + index // across * height
        title = " · ".join(part for part in (apparatus.title if titles else "", view.caption) if part)
        image[y:y + height, x:x + width] = _draw(
            apparatus, view, (width, height), look, colour(index), own_clocks, title)
    end = top + down * height
    if drawn and (empty or below):
        gap = 2.0 * font if empty else 0.7 * font
        area = (Box((across - empty) * width + gap, end - height + gap, across * width - gap, end - gap) if empty else
                Box(gap, end + gap, across * width - gap, end + below - gap))
        tones = [theme.accent(view.accent or colour(i)) for i, (_, view) in enumerate(panels)]
        angles(image, area, [view for _, view in panels], tones, font, theme, strip or WINDOW)
    image[top:end + 1:height] = image[top:end, width::width] = rgb(theme.hairline)
    return image


@lru_cache(maxsize=4)
def _blank(height: int, width: int, paper: str) -> Image:
    """Return an empty picture in the colour ``paper``; a copy of it is made twenty times as fast as it is filled."""
    image = np.empty((height, width, 3), dtype=np.uint8)
    image[...] = rgb(paper)
    image.flags.writeable = False
    return image


def frame_size(size: int | tuple[int, int], name: str) -> tuple[int, int]:
    """Return a frame's width and height [px] from one number or two; ValueError or TypeError if they are invalid."""
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


def _draw(apparatus: Apparatus, view: View, size: tuple[int, int], look: FrameStyle, accent: str | None, clock: bool,
          title: str) -> Image:
    """Draw the picture of one pendulum; ``accent`` is the colour of the bob if the view does not set one."""
    theme, at = THEMES[look.theme], staged(apparatus, view, size, look)
    image = at.background.copy()
    tone = theme.accent(view.accent or accent)
    for panel in at.panels:
        panel.moving(image, view, rgb(tone))
    if at.layout.header:
        _header(image, at.layout.header, at.layout.font, view, theme, tone, title, clock)
    return image


def staged(apparatus: Apparatus, view: View, size: tuple[int, int], look: FrameStyle) -> Stage:
    """Return a frame's stage: its panels with their places, and the background, which is equal in all frames."""
    bars = rows(view)
    panels = tuple(name for name in look.panels if name != "energy" or bars) or DEFAULT[:1]
    return stage(apparatus, *size, THEMES[look.theme], panels, bars)


def _header(image: Image, area: Box, font: int, view: View, theme: Theme, accent: str, title: str,
            clock: bool) -> None:
    """Paint a frame's header: a mark in the bob's colour, the title, and the time or the time of the run's end."""
    left = area.left
    if view.caption:
        side, first = round(0.6 * font), round(left)
        top = round((area.top + area.bottom - side) / 2)
        image[top:top + side, first:first + side] = rgb(accent)
        left += 0.95 * font
    right = f"stopped at {view.time:.2f} s" if view.stopped else f"t = {view.time:.2f} s" if clock else ""
    _line(image[:round(area.top + area.bottom)], font, left, area.right, title, right, theme, view.stopped)


def _line(strip: Image, font: int, left: float, right: float, title: str, clock: str, theme: Theme,
          stopped: bool = False) -> None:
    """Write a frame's header line: a clock at the right end, a title (shortened if necessary) in the rest."""
    y = strip.shape[0] / 2
    write(strip, clock, right, y, font, theme.warning if stopped else theme.ink, (1.0, 0.5), theme.paper)
    whole = right - left
    room = whole - (len(clock) + 1) * font if clock else whole  # no letter is wider than the font is high
    if _fitted(title, font, room) != _fitted(title, font, whole):
        room = whole - measure(clock, font)[0] - font
    write(strip, _fitted(title, font, room), left, y, font, theme.ink, (0.0, 0.5), theme.paper)


@lru_cache(maxsize=64)
def _fitted(title: str, font: int, room: float) -> str:
    """Return a title without unprintable characters, shortened to a width of ``room`` pixels."""
    return fit(clean(title, None), font, room)
