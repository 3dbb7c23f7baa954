"""Live samples of sensors: :func:`acquire` and the sources it reads."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pendulum_env.bench.source import Chunk, Source, SourceError
from pendulum_env.bench.sources import SOURCES

if TYPE_CHECKING:
    from pendulum_env.bench.running import acquire

__all__ = ["SOURCES", "Chunk", "Source", "SourceError", "acquire"]


def __getattr__(name: str) -> Any:
    if name == "acquire":  # imported on first use, because it loads the readers of recordings
        from pendulum_env.bench.running import acquire

        return acquire
    raise AttributeError(f"module 'pendulum_env.bench' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
