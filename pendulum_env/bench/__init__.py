"""Live samples of sensors: :func:`acquire` and the sources it reads."""

from pendulum_env.bench.running import acquire
from pendulum_env.bench.source import Chunk, Source, SourceError
from pendulum_env.bench.sources import SOURCES

__all__ = ["SOURCES", "Chunk", "Source", "SourceError", "acquire"]
