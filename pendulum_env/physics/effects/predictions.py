"""What the textbook predicts of a small effect's period and amplitude, shared by effects.

Nelson & Olsson 1986, Am. J. Phys. 54, 112. With amplitude A [rad] and n = OSCILLATIONS, a loss of amplitude dA per half
swing shortens the period at full gravity by ``(n A**2/8) dA/A`` in the mean of the first n.
"""

from __future__ import annotations

from pendulum_env.physics.surroundings import Surroundings

OSCILLATIONS = 3
"""Predicted and measured periods are the mean of so many, from the release on."""


def lossy(scene: Surroundings, amplitude: float, loss: float, period: float = 0.0) -> tuple[float, float]:
    """Relative changes of period and amplitude by what takes the share ``loss`` of the amplitude per half swing.

    ``period`` is its own change of the period of small oscillations.
    """
    fall = -(amplitude**2) / 8.0 * OSCILLATIONS * loss if scene.has("gravity") else 0.0
    return period + fall, -loss
