"""All sources of live samples, in the order of lists."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping

from pendulum_env.bench.source import Source, SourceError
from pendulum_env.bench.sources.bench import Bench
from pendulum_env.bench.sources.nidaq import Nidaq
from pendulum_env.bench.sources.pasco import Pasco
from pendulum_env.bench.sources.phyphox import Phyphox
from pendulum_env.bench.sources.replay import Replay
from pendulum_env.bench.sources.serial_port import SerialPort
from pendulum_env.bench.sources.stdin import Stdin
from pendulum_env.bench.sources.udp import Udp
from pendulum_env.bench.sources.vernier import Vernier
from pendulum_env.bench.sources.virtual import Virtual
from pendulum_env.physics.units import nearest, shown

SOURCES: Mapping[str, type[Source]] = {kind.name: kind for kind in (
    Virtual, Replay, SerialPort, Phyphox, Vernier, Pasco, Nidaq, Udp, Stdin, Bench,
)}
"""Name -> class of a source."""


def source_at(address: str, options: Mapping[str, object] | None = None) -> Source:
    """Return the source at an address such as "virtual", "udp:5005" or "replay:swing.csv", not opened yet.

    ``options`` are its settings by their options' names. Raises SourceError for an unknown name, with the nearest, and
    for an address or a setting that the source does not take.
    """
    name, _, place = address.partition(":")
    kind = SOURCES.get(name.strip().lower())
    if kind is not None:
        return kind.at(place, options or {})
    if os.path.isfile(address):
        raise SourceError(f"{shown(address)} is a file; replay:{address} plays it again")
    if address.startswith("/dev/") or re.fullmatch(r"COM\d+", address, re.IGNORECASE):
        raise SourceError(f"{shown(address)} is a port; serial:{address} reads it")
    raise SourceError(f"There is no source {shown(address)}{nearest(name, SOURCES)}")
