"""The colours of all frames and figures, as hex strings that matplotlib accepts, and the themes of frames.

Hues are the colour-blind-safe set of M. Okabe and K. Ito, "Color Universal Design" (2008). Everything except data is
neutral grey, so that a hue always has a meaning.

The light and the dark theme of frames differ in neutral colours only.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

OKABE_ITO = {
    "blue": "#0072B2",
    "vermillion": "#D55E00",
    "bluish_green": "#009E73",
    "reddish_purple": "#CC79A7",
    "orange": "#E69F00",
    "sky_blue": "#56B4E9",
    "yellow": "#F0E442",
    "black": "#000000",
}

METHOD_COLOURS = tuple(
    OKABE_ITO[name]
    for name in (
        "vermillion",
        "sky_blue",
        "bluish_green",
        "black",
        "orange",
        "reddish_purple",
        "blue",
        "yellow",
    )
)
"""Hues of the first eight methods; further methods use the hues again, see :func:`hue`.

The order gives yellow, which is hard to see on white, to none of the methods in most use.
"""

SHIFT = 3
"""Number of hues by which every further round through the hues is shifted, so that neighbours differ."""

ENERGY_COLOURS = {
    "kinetic": OKABE_ITO["orange"],
    "potential": OKABE_ITO["sky_blue"],
    "heat": OKABE_ITO["vermillion"],
    "work": OKABE_ITO["bluish_green"],
    "residual": OKABE_ITO["reddish_purple"],
}

PAPER = "#FFFFFF"
INK = "#222222"
FAINT_INK = "#707070"
HAIRLINE = "#D6D6D6"
TRACK = "#F1F1F1"


def place(name: str, known: Sequence[str]) -> int:
    """Return the index of a method's name among the known names, from which its colour in figures follows.

    An unknown name gets a larger index, computed from the name, so that its colour is always the same.
    """
    return known.index(name) if name in known else len(known) + crc32(name.encode()) % 997


def hue(index: int) -> tuple[int, int]:
    """Return the index in `METHOD_COLOURS` of the `index`-th method's colour, and how often it was used before.

    Methods that share a colour are told apart in figures by this second number.
    """
    turn, place = divmod(index, len(METHOD_COLOURS))
    return (place + SHIFT * turn) % len(METHOD_COLOURS), turn


def hues(indices: Iterable[int]) -> dict[int, tuple[int, int]]:
    """Return :func:`hue` of every method of one picture, by its index, with different colours for up to eight methods.

    A method whose colour an earlier one has takes the first colour that is free.
    """
    given: dict[int, tuple[int, int]] = {}
    for index in dict.fromkeys(indices):
        own, turn = hue(index)
        taken = [tone for tone, _ in given.values()]
        free = [tone for tone in range(len(METHOD_COLOURS)) if tone not in taken]
        given[index] = free[0] if own in taken and free else own, turn
    return given


def colour(index: int) -> str:
    """Return the hex colour that figures and films give to the `index`-th method, counted from 0."""
    return METHOD_COLOURS[hue(index)[0]]


def colours(indices: Iterable[int]) -> dict[int, str]:
    """Return the hex colour of every method of one picture, by its index; see :func:`hues`."""
    return {index: METHOD_COLOURS[tone] for index, (tone, _) in hues(indices).items()}


@cache
def rgb(hexadecimal: str) -> NDArray[np.float32]:
    """Return the colour "#RRGGBB" as a read-only float32 array of shape (3,), 0 to 255.

    Raises ValueError for any other string.
    """
    digits = hexadecimal.removeprefix("#")
    if len(digits) != 6 or len(hexadecimal) != 7 or set(digits) - set("0123456789abcdefABCDEF"):
        raise ValueError(f'a colour is a string like "#0072B2", not {hexadecimal!r}')
    values = np.array([int(digits[i : i + 2], 16) for i in (0, 2, 4)], dtype=np.float32)
    values.flags.writeable = False
    return values


@cache
def gradient(*colours: str) -> NDArray[np.float32]:
    """Return a read-only float32 table (65, 3) of RGB colours that change evenly from one hex colour to the next."""
    stops = np.linspace(0, 64, len(colours))
    channels = np.array([rgb(c) for c in colours]).T
    table = np.stack([np.interp(np.arange(65), stops, channel) for channel in channels], axis=1).astype(np.float32)
    table.flags.writeable = False
    return table


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
    "light", paper=PAPER, ink=INK, faint_ink=FAINT_INK, rule="#707070",
    hairline=HAIRLINE, track=TRACK, casing="#808080", dial="#F6F6F6", dial_edge="#BEBEBE",
    sensor="#4A4A4A", steel_dark="#6C6C6C", steel="#A6A6A6", steel_light="#E6E6E6", wire="#484848",
)
DARK = Theme(
    "dark", paper="#14171B", ink="#ECECEC", faint_ink="#A8A8A8", rule="#8C8C8C", hairline="#3A3E44", track="#22262C",
    casing="#14171B", dial="#1C2025", dial_edge="#555A61", sensor="#60656C", steel_dark="#7A7A7A", steel="#A6A6A6",
    steel_light="#E6E6E6", wire="#C4C4C4", bob="#2C8FCB", warning="#F08A3C", swaps=(("#000000", "#ECECEC"),),
)
THEMES: Mapping[str, Theme] = MappingProxyType({theme.name: theme for theme in (LIGHT, DARK)})
"""All themes of frames by name."""
