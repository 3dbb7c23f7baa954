"""Which damping a recording calls for, and what it cannot tell apart."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pendulum_env.lab.fitting.result import Fit


@dataclass(frozen=True, eq=False)
class Comparison:
    """Models of one recording, the best first."""

    fits: tuple[Fit, ...]
