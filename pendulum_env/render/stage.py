"""Panels of a frame by name, the style of frames, and the cached background of all frames of a pendulum."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from types import MappingProxyType
from typing import Protocol

import numpy as np

from pendulum_env.render.bars import Bars
from pendulum_env.render.layout import ENERGY_ROW, Box, lay_out
from pendulum_env.render.paint import Floats, Image
from pendulum_env.render.palette import THEMES, Theme, rgb
from pendulum_env.render.portrait import Portrait
from pendulum_env.render.stand import Stand
from pendulum_env.render.strip import History, Residual
from pendulum_env.render.view import Apparatus, View


class Painted(Protocol):
    """A panel (one drawing in a frame) that can be painted: its background once, its changing parts in every frame."""

    def still(self, image: Image) -> None:
        """Paint the parts of the panel that are equal in all frames into an image."""

    def moving(self, image: Image, view: View, tone: Floats) -> None:
        """Paint the parts of the panel that change from instant to instant; `tone` is the bob's colour."""


@dataclass(frozen=True)
class Place:
    """Arguments from which a panel of a frame is built: its area, font size, theme and others."""

    area: Box
    font: int
    theme: Theme
    shape: tuple[int, int]
    apparatus: Apparatus
    bars: tuple[str, ...]
    lettered: bool
    panels: tuple[str, ...]


@dataclass(frozen=True)
class Panel:
    """A kind of panel, one of the drawings of which a frame is composed, such as "energy".

    Attributes:
        what: description of the panel in one line.
        room: width and height in font sizes at which the panel is comfortable to read.
        made: function that builds the panel from a :class:`Place`.
        needs: data that the panel shows beside angle and velocity: "energies", "trail", "past" or "curves".
        per_bar: True if ``room`` has the height for one of the frame's energy bars.
    """

    what: str
    room: tuple[float, float]
    made: Callable[[Place], Painted]
    needs: frozenset[str] = frozenset()
    per_bar: bool = False

    def room_for(self, bars: int) -> tuple[float, float]:
        """Return the comfortable width and height in font sizes, in a frame with this number of energy bars."""
        wide, high = self.room
        return wide, high * bars if self.per_bar else high


PANELS: Mapping[str, Panel] = MappingProxyType({
    "apparatus": Panel(
        "arm, sensor wheel with degree scale, rod or wire, bob to scale, torque arrow, trail", (8.0, 8.0),
        lambda at: Stand(at.apparatus, at.area, at.font, at.theme, at.shape, at.lettered), frozenset({"trail"})),
    "energy": Panel(
        "a bar for each entry of the energy ledger, with its value", (10.0, ENERGY_ROW),
        lambda at: Bars(at.area, at.font, at.bars, at.theme), frozenset({"energies"}), per_bar=True),
    "history": Panel(
        "the energies of the last ten seconds, on the scale of the energy bars if it suits", (11.0, 4.5),
        lambda at: History(at.area, at.font, at.theme, at.lettered, at.bars, "energy" not in at.panels),
        frozenset({"past", "energies"})),
    "phase": Panel(
        "a phase portrait: the last seconds as a line, the present as a dot, with separatrix and exact orbit",
        (8.0, 7.0),
        lambda at: Portrait(at.area, at.font, at.theme, at.lettered), frozenset({"past", "curves"})),
    "residual": Panel(
        "the residual of the energy balance over the last ten seconds, on its own scale", (11.0, 4.0),
        lambda at: Residual(at.area, at.font, at.theme, at.lettered), frozenset({"past", "energies"})),
})
"""All kinds of panels by name."""

DEFAULT = ("apparatus", "energy")


@dataclass(frozen=True)
class FrameStyle:
    """The style of frames: a theme and a choice of panels.

    Attributes:
        theme: a name from THEMES.
        panels: different names from PANELS; the apparatus has the largest area, the others follow in their order.

    Raises ValueError for an unknown name, the same panel twice, or no panel.
    """

    theme: str = "light"
    panels: tuple[str, ...] = DEFAULT

    def __post_init__(self) -> None:
        _known("theme", self.theme, THEMES)
        if isinstance(self.panels, str) or not isinstance(self.panels, Iterable):
            raise ValueError(f"panels must be a sequence of names from {', '.join(PANELS)}, not {self.panels!r}")
        object.__setattr__(self, "panels", tuple(self.panels))
        for name in self.panels:
            _known("panel", name, PANELS)
        if not self.panels or len(set(self.panels)) < len(self.panels):
            given = "none" if not self.panels else "one of them twice"
            raise ValueError(f"panels must be one or more of {', '.join(PANELS)}, not {given}")

    @cached_property
    def needs(self) -> frozenset[str]:
        """Names of the data that the panels of this style show beside angle and velocity, for example "energies"."""
        return frozenset().union(*(PANELS[name].needs for name in self.panels))


def _known(kind: str, name: object, names: Iterable[str]) -> None:
    """Raise ValueError, with the nearest known name, for a name that is not one of ``names``."""
    known = list(names)
    if not isinstance(name, str) or name not in known:
        near = difflib.get_close_matches(str(name)[:80], known, n=1)
        meant = f"; did you mean {near[0]!r}?" if near else ""
        raise ValueError(f"a {kind} must be one of {', '.join(known)}, not {str(name)[:80]!r}{meant}")


class Stage:
    """Panels of a frame with their places, and the background that all frames share, uint8 of shape (H, W, 3)."""

    def __init__(self, apparatus: Apparatus, width: int, height: int, theme: Theme, panels: tuple[str, ...],
                 bars: tuple[str, ...]) -> None:
        rooms = {name: PANELS[name].room_for(len(bars)) for name in panels}
        self.layout = lay_out(width, height, rooms, len(bars))
        lettered, shown = self.layout.header is not None, tuple(self.layout.areas)
        self.panels: list[Painted] = [
            PANELS[name].made(Place(area, self.layout.font, theme, (height, width), apparatus, bars, lettered, shown))
            for name, area in self.layout.areas.items()]
        self.background: Image = np.empty((height, width, 3), dtype=np.uint8)
        self.background[...] = rgb(theme.paper)
        for panel in self.panels:
            panel.still(self.background)
        self.background.flags.writeable = False


@lru_cache(maxsize=16)
def stage(apparatus: Apparatus, width: int, height: int, theme: Theme, panels: tuple[str, ...],
          bars: tuple[str, ...]) -> Stage:
    """Return the stage of a pendulum's frames: the panels with their places, and the background.

    The last 16 stages are cached, because all frames of a run share one.
    """
    return Stage(apparatus, width, height, theme, panels, bars)
