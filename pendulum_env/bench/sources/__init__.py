"""All sources of live samples, in the order of lists."""

from __future__ import annotations

from collections.abc import Mapping

from pendulum_env.bench.source import Source
from pendulum_env.bench.sources.virtual import Virtual

SOURCES: Mapping[str, type[Source]] = {kind.name: kind for kind in (Virtual,)}
"""Name -> class of a source."""
