"""Protocol of the sources of live samples: sensors, phones, recordings that are played again, and a simulation."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import Field, dataclass, fields
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.checks import SceneError, nearest, shown
from pendulum_env.physics.units import Checked

FloatArray = NDArray[np.float64]

ANGLE = ("Angle (deg)",)
"""Titles of the columns of a source that reads an angle."""
TWIN = "Twin (deg)"
"""Title of a column with the angle of a simulation of the same run, which the page draws beside it."""


class SourceError(SceneError):
    """A source that cannot be opened or read, in one sentence with the remedy."""


@dataclass(frozen=True)
class Chunk:
    """Samples that a source gives at once, perhaps none.

    Attributes:
        values: shape (samples, columns), in the units that the titles of the columns name.
        time: times [s] of the samples on the source's own clock, increasing, shape (samples,); None for a source
            without a clock, whose samples are stamped with the host's.
        lost: number of samples before these that are known to be lost.
    """

    values: FloatArray
    time: FloatArray | None = None
    lost: int = 0


NOTHING = Chunk(np.empty((0, 1)), np.empty(0))
"""Chunk without samples."""


@dataclass(frozen=True, repr=False, eq=False)
class Source(Checked, ABC):
    """A sensor, or what stands for one: open it, read chunks of samples again and again, close it.

    A source of your own is a dataclass of this kind, with its settings as fields; put it into a call:
    ``acquire(MySource(...), duration=10)``.

    Class attributes:
        name: word before the colon in ``serial:/dev/ttyUSB0``.
        about: one sentence for lists.
        address: field that the text behind the colon sets, "" if the source takes none.
        place: what that text is, for lists and refusals, as "PORT".
        extra: extra of the package that it needs, "" for none.
        tested: how it was tested.
        quantity: "angle", "rate" (angular velocity) or "force" (specific force), as in a Recording.
        own_clock: False if its times follow the computer's clock, so that comparing the two says nothing.
    """

    name: ClassVar[str]
    about: ClassVar[str]
    address: ClassVar[str] = ""
    place: ClassVar[str] = ""
    extra: ClassVar[str] = ""
    tested: ClassVar[str]
    quantity: ClassVar[str] = "angle"
    own_clock: ClassVar[bool] = True

    @property
    def columns(self) -> tuple[str, ...]:
        """Titles of the columns of values, with units, as a recording's file has them; known once it is open."""
        return ANGLE

    @property
    def notes(self) -> tuple[str, ...]:
        """One line for everything that was inferred, such as the unit of times; grows while samples come."""
        return ()

    @property
    def problem(self) -> str:
        """Sentence on why no sample comes, as far as it is known; "" otherwise."""
        return ""

    @abstractmethod
    def open(self) -> None:
        """Connect; SourceError says what is missing and the remedy."""

    def begin(self) -> None:
        """Hear that a run begins with the next sample; for sources that do something then. May raise SourceError."""

    def end(self) -> None:
        """Hear that the run has ended."""

    @abstractmethod
    def read(self, timeout: float = 0.1) -> Chunk | None:
        """Return the samples that have come since the last call, waiting up to ``timeout`` [s] for the first.

        A chunk may be empty. None: the source has ended. Raises SourceError if the source is lost for good.
        """

    @abstractmethod
    def close(self) -> None:
        """Disconnect, also after an error; closing twice is allowed."""

    @classmethod
    def form(cls) -> str:
        """Return the form of its address, such as "udp:PORT", or "vernier[:DEVICE]" where the place may be left out."""
        if not cls.address:
            return cls.name
        return f"{cls.name}:{cls.place}" if cls._needs_a_place() else f"{cls.name}[:{cls.place}]"

    @classmethod
    def _needs_a_place(cls) -> bool:
        return bool(cls.address) and cls.__dataclass_fields__[cls.address].default is None

    @classmethod
    def at(cls, address: str, options: Mapping[str, object]) -> Source:
        """Return the source at an address, the text behind the colon, with settings by their options' names.

        Raises SourceError for an address that is missing or not taken, for an option that the source does not have,
        and for a value that is not allowed.
        """
        if address and not cls.address:
            raise SourceError(f"{cls.name} takes no address, so leave out {shown(':' + address)}")
        if not address and cls._needs_a_place():
            raise SourceError(f"{cls.name} needs an address, as {cls.name}:{cls.place}")
        settings = settings_of(cls)
        for option in options:
            if option not in settings:
                have = nearest(option, settings) if settings else ", as it has no options"
                raise SourceError(f"{cls.name} has no option --{option.replace('_', '-')}{have}")
        given = {settings[option].name: value for option, value in options.items()}
        try:
            return cls(**({cls.address: address} if address else {}), **given)
        except SceneError as error:
            raise SourceError(str(error)) from None


def name_and_unit(title: str) -> tuple[str, str]:
    """Return the name and the unit of a column from its title, as in "Angle (deg)"; "" for a title without a unit."""
    parts = re.fullmatch(r"(.*?)\s*[(\[](.*)[)\]]", title)
    return (parts[1], parts[2]) if parts else (title, "")


def settings_of(kind: type[Source]) -> dict[str, Field[Any]]:
    """Return the settings of a source beside its address: name of the option (as a keyword) -> field."""
    return {entry.metadata.get("option", entry.name): entry for entry in fields(kind)
            if entry.init and entry.name != kind.address}
