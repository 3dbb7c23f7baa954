"""What a figure writes, where: every text that is drawn, as a polygon in pixels."""

from __future__ import annotations

import itertools
from typing import Any, NamedTuple

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.backend_bases import RendererBase
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.path import Path
from matplotlib.text import Text
from matplotlib.transforms import Affine2D

SLACK = 1.0
"""Pixels that boxes may share, or be outside: letters do not fill them."""


class Dashes(RendererBase):
    """A renderer that draws nothing and keeps the dashes of each path."""

    def __init__(self) -> None:
        super().__init__()
        self.seen: list[Any] = []

    def draw_path(self, gc: Any, path: Any, transform: Any, rgbFace: Any = None) -> None:
        self.seen.append(gc.get_dashes())


def dashes_of(line: Line2D) -> Any:
    """Return the dashes with which a line is drawn, in line widths."""
    renderer = Dashes()
    line.draw(renderer)
    _, lengths = renderer.seen[0]
    return None if lengths is None else np.round(np.array(lengths) / line.get_linewidth(), 6).tolist()


def left_title(axes: Axes) -> Text:
    """Return the text that is the title at the left of axes."""
    return next(child for child in axes.get_children()
                if isinstance(child, Text) and child.get_text() == axes.get_title("left"))


class Written(NamedTuple):
    """text, and the corners of its box, shape (4, 2) [pixels]."""

    text: str
    corners: Any


def written(made: Figure) -> list[Written]:
    """Every text of a figure that is drawn on its canvas, tick labels and legends included."""
    found: list[Text] = []
    plain = Text.draw

    def spy(text: Text, renderer: Any, *rest: Any, **more: Any) -> Any:
        if text.get_visible() and text.get_text().strip():
            found.append(text)
        return plain(text, renderer, *rest, **more)

    with pytest.MonkeyPatch.context() as patch:
        made.canvas.draw()  # the layout settles
        patch.setattr(Text, "draw", spy)
        made.canvas.draw()
    renderer: Any = made.canvas.get_renderer()  # type: ignore[attr-defined]
    return [Written(text.get_text(), _corners(text, renderer)) for text in dict.fromkeys(found)]


def _corners(text: Text, renderer: Any) -> Any:
    """Of a text that is turned about its anchor, the corners of its own box; of any other, of the upright one."""
    turned = text.get_rotation()
    if turned % 90.0 == 0.0:
        return _shrunk(text.get_window_extent(renderer).corners()[[0, 1, 3, 2]])
    assert text.get_rotation_mode() == "anchor"
    text.set_rotation(0.0)
    upright = text.get_window_extent(renderer).corners()[[0, 1, 3, 2]]
    text.set_rotation(turned)
    anchor = text.get_transform().transform(text.get_position())
    return Affine2D().rotate_deg_around(*anchor, turned).transform(_shrunk(upright))


def _shrunk(corners: Any) -> Any:
    middle = corners.mean(axis=0)
    return middle + np.sign(corners - middle) * np.maximum(np.abs(corners - middle) - SLACK, 0.1)


def cut_off(made: Figure, texts: list[Written]) -> list[str]:
    """Texts that reach beyond the figure's edges."""
    wide, high = made.bbox.width, made.bbox.height
    return [one.text for one in texts
            if (one.corners < 0.0).any() or (one.corners[:, 0] > wide).any() or (one.corners[:, 1] > high).any()]


def overlapping(texts: list[Written]) -> list[tuple[str, str]]:
    """Pairs of texts that lie on one another."""
    boxes = [Path(np.vstack((one.corners, one.corners[:1])), closed=True) for one in texts]
    return [(texts[i].text, texts[j].text) for i, j in itertools.combinations(range(len(texts)), 2)
            if boxes[i].get_extents().overlaps(boxes[j].get_extents()) and boxes[i].intersects_path(boxes[j])]
