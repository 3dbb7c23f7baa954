"""Where frames write: the ink of every text, as boxes in pixels."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from pendulum_env.render import bars, panel, portrait, stage, stand, strip, text

ROOMS: tuple[ModuleType, ...] = (bars, panel, portrait, stand, strip)
Ink = tuple[str, int, int, int, int]


def inked(monkeypatch: pytest.MonkeyPatch, draw: Callable[[], Any]) -> list[Ink]:
    """Every text that a drawing writes, as (text, left, top, right, bottom) of its ink in the image's pixels.

    Fails where ink would be outside the image. Parts of an image that are written to begin at its top left.
    """
    found: list[Ink] = []

    def spy(image: Any, words: str, x: float, y: float, size: int, tone: str, anchor: Any = (0.0, 0.5),
            paper: Any = None) -> None:
        if not words.strip():
            return
        rows, columns = np.nonzero(text.mask(words, size))
        wide, high = text.measure(words, size)
        left, top = round(x - anchor[0] * wide), round(y - anchor[1] * high)
        found.append((words, left + columns.min(), top + rows.min(), left + columns.max() + 1, top + rows.max() + 1))
        assert min(found[-1][1:]) >= 0, words
        assert found[-1][3] <= image.shape[1], words
        assert found[-1][4] <= image.shape[0], words

    with monkeypatch.context() as patch:
        for room in ROOMS:
            patch.setattr(room, "write", spy)
        stage.stage.cache_clear()
        draw()
    stage.stage.cache_clear()
    return found


def overlaps(boxes: list[Ink]) -> list[tuple[str, str]]:
    """Pairs of texts whose ink shares a pixel's row and column."""
    return [(a[0], b[0]) for a, b in itertools.combinations(boxes, 2)
            if min(a[3], b[3]) > max(a[1], b[1]) and min(a[4], b[4]) > max(a[2], b[2])]
