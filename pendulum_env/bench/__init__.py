"""Hardware: :func:`acquire` and the sources it reads, and the devices of the environment ``LabPendulumBench-v0``."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from pendulum_env.bench.source import Chunk, Source, SourceError
from pendulum_env.bench.sources import SOURCES

if TYPE_CHECKING:
    from pendulum_env.bench.device import Device, DeviceError, Reading, VirtualBoard
    from pendulum_env.bench.environment import LabPendulumBenchEnv
    from pendulum_env.bench.running import acquire

_LAZY = {"acquire": "running", "LabPendulumBenchEnv": "environment",
         **dict.fromkeys(("Device", "DeviceError", "Reading", "VirtualBoard"), "device")}
"""Names that are imported on first use, because they load the readers of recordings or environments, and modules."""

__all__ = ["SOURCES", "Chunk", "Device", "DeviceError", "LabPendulumBenchEnv", "Reading", "Source", "SourceError",
           "VirtualBoard", "acquire"]


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        return getattr(import_module(f"pendulum_env.bench.{_LAZY[name]}"), name)
    raise AttributeError(f"module 'pendulum_env.bench' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
