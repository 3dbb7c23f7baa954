"""What the textbook's formulas of small effects share (Nelson & Olsson 1986, Am. J. Phys. 54, 112)."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pendulum_env.physics.scene import Scene

OSCILLATIONS = 3
"""Periods are means of so many, from the release on."""


def by_loss(scene: Scene, amplitude: float, loss: float, period: float = 0.0) -> tuple[float, float]:
    """Relative changes of period and amplitude by what takes the share ``loss`` of the amplitude in half a swing.

    At full gravity the period falls with the amplitude, by ``n A²/8`` times the loss in the mean of n = OSCILLATIONS;
    ``period`` is what the effect changes beside.
    """
    fall = -(amplitude**2) / 8.0 * OSCILLATIONS * loss if scene.has("gravity") else 0.0
    return period + fall, -loss
