"""The channels of an interface that measure a swing: an angle, an angular velocity or an acceleration."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from pendulum_env.bench.source import SourceError
from pendulum_env.common.texts import clean
from pendulum_env.lab.quantities import ANGLE, FORCE, NO_FORCE, RATE, Quantity
from pendulum_env.physics.units import nearest

_AXIS = re.compile(r"(?<![a-z])([xyz])(?![a-z])|(?:velocity|acceleration)([xyz])$", re.IGNORECASE)
_CAMEL = re.compile(r"(?<=[a-z])(?=[A-Z])")


class Kind(NamedTuple):
    """A quantity: its name in a Recording, the lab's entries that it is and is not, its title, the words of units."""

    name: str
    quantity: Quantity
    others: tuple[Quantity, ...]
    title: str
    units: Mapping[str, str]


KINDS = (
    Kind("angle", ANGLE, (RATE, FORCE), "Angle", {"rad": "rad", "deg": "deg", "°": "deg", "degrees": "deg"}),
    Kind("rate", RATE, (FORCE,), "Angular velocity",
         {"rad/s": "rad/s", "radps": "rad/s", "deg/s": "deg/s", "°/s": "deg/s", "degps": "deg/s"}),
    Kind("force", FORCE, (NO_FORCE,), "Acceleration",
         {"m/s²": "m/s^2", "m/s^2": "m/s^2", "m/s2": "m/s^2", "ms2": "m/s^2", "mps2": "m/s^2", "g": "g"}),
)
"""Quantities of a swing, the preferred one first."""


class Channel(NamedTuple):
    """A channel of a device: what identifies it there, its name and its unit."""

    key: Any
    name: str
    unit: str


class Chosen(NamedTuple):
    """Channels that are read: the quantity as in a Recording, the channels, and the titles of their columns."""

    quantity: str
    channels: tuple[Channel, ...]
    columns: tuple[str, ...]


def choose(device: str, channels: Sequence[Channel], wanted: str | None = None) -> Chosen:
    """Return the channels of a device that measure a swing: an angle, else the axes of a gyroscope, else of an
    accelerometer.

    ``wanted`` is the name of one channel, or a part of it. The angle of a device with an accelerometer is passed over
    unless it is wanted: it is the tilt that gravity shows, which is wrong while the device swings.

    Raises SourceError, with the names of all channels, if none measures a swing or is named as wanted.
    """
    names = ", ".join(f"{clean(one.name)} ({clean(one.unit)})" for one in channels) or "no channel"
    if wanted is not None:
        fitting = [one for one in channels if wanted.casefold() in one.name.casefold()]
        if not fitting:
            raise SourceError(f"{device} has no channel {wanted!r}{nearest(wanted, [one.name for one in channels])}")
        channels = fitting[:1]
    tilted = wanted is None and any(_is(KINDS[2], one) for one in channels)
    for kind in KINDS[1:] if tilted else KINDS:
        axes: dict[str, Channel] = {}
        for one in channels:
            if _is(kind, one) and one.unit.strip() in kind.units:
                axes.setdefault(_axis(one.name), one)
        if axes:
            named = {axis: one for axis, one in axes.items() if axis} or axes
            picked = dict(list(axes.items())[:1]) if kind.name == "angle" else named
            columns = [f"{kind.title}{axis and ' ' + axis} ({kind.units[one.unit.strip()]})"
                       for axis, one in picked.items()]
            return Chosen(kind.name, tuple(picked.values()), tuple(columns))
    raise SourceError(f"{device} measures no angle, angular velocity or acceleration in a known unit, but {names}; "
                      "connect a rotary motion sensor, or one with a gyroscope")


def _is(kind: Kind, channel: Channel) -> bool:
    """Return True if a channel's name has a word of the quantity and none of the others."""
    name = _CAMEL.sub(" ", channel.name)
    return kind.quantity.names(name) and not any(other.names(name) for other in kind.others)


def _axis(name: str) -> str:
    found = _AXIS.search(_CAMEL.sub(" ", name))
    return (found.group(1) or found.group(2)).lower() if found else ""
