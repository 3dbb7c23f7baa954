"""Light and dark themes of frames, which differ in neutral colours; colours with a meaning are the same in both."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from pendulum_env.render import palette
from pendulum_env.render.palette import OKABE_ITO


@dataclass(frozen=True)
class Theme:
    """The colours of a frame as hex strings; energies and methods have the same colours in every theme.

    Attributes:
        name: name of the theme.
        paper, ink, faint_ink: background, main text and secondary text.
        rule: lines with a meaning, such as the zero of an axis.
        hairline, track: lines that only separate, and the background of bars and plots.
        casing: rim of a line in a plot.
        dial, dial_edge, sensor, steel_dark, steel, steel_light, wire: parts of the apparatus.
        bob, torque, warning: the bob, the torque arrow, and warnings.
        swaps: pairs of an accent that would be invisible on this background, and its replacement.
    """

    name: str
    paper: str
    ink: str
    faint_ink: str
    rule: str
    hairline: str
    track: str
    casing: str
    dial: str
    dial_edge: str
    sensor: str
    steel_dark: str
    steel: str
    steel_light: str
    wire: str
    bob: str = OKABE_ITO["blue"]
    torque: str = OKABE_ITO["bluish_green"]
    warning: str = OKABE_ITO["vermillion"]
    swaps: tuple[tuple[str, str], ...] = ()

    def accent(self, tone: str | None) -> str:
        """Return a visible colour for a bob of the colour ``tone``, on this background; None gives the default."""
        return self.bob if tone is None else dict(self.swaps).get(tone.upper(), tone)


LIGHT = Theme(
    "light", paper=palette.PAPER, ink=palette.INK, faint_ink=palette.FAINT_INK, rule="#707070",
    hairline=palette.HAIRLINE, track=palette.TRACK, casing="#808080", dial="#F6F6F6", dial_edge="#BEBEBE",
    sensor="#4A4A4A", steel_dark="#6C6C6C", steel="#A6A6A6", steel_light="#E6E6E6", wire="#484848",
)
DARK = Theme(
    "dark", paper="#14171B", ink="#ECECEC", faint_ink="#A8A8A8", rule="#8C8C8C", hairline="#3A3E44", track="#22262C",
    casing="#14171B", dial="#1C2025", dial_edge="#555A61", sensor="#60656C", steel_dark="#7A7A7A", steel="#A6A6A6",
    steel_light="#E6E6E6", wire="#C4C4C4", bob="#2C8FCB", warning="#F08A3C", swaps=(("#000000", "#ECECEC"),),
)
THEMES: Mapping[str, Theme] = MappingProxyType({theme.name: theme for theme in (LIGHT, DARK)})
"""All themes of frames by name."""
