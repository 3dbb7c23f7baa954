"""Textbook predictions of the change of period and amplitude by a small loss, shared by effects.

Nelson & Olsson 1986, Am. J. Phys. 54, 112. With amplitude A [rad] and n = 3 (OSCILLATIONS), a loss of amplitude dA per
half swing shortens the mean period of the first n oscillations at full gravity by the fraction ``(n A**2/8) dA/A``.
"""

from __future__ import annotations

from pendulum_env.physics.surroundings import Surroundings

OSCILLATIONS = 3
"""Number of oscillations, from the release on, over which predicted and measured periods are averaged."""


def lossy(scene: Surroundings, amplitude: float, loss: float, period: float = 0.0) -> tuple[float, float]:
    """Return the relative changes of period and amplitude that a loss of amplitude causes.

    ``loss`` is the share of the amplitude lost per half swing; ``period`` is a further relative change of the period of
    small oscillations.
    """
    fall = -(amplitude**2) / 8.0 * OSCILLATIONS * loss if scene.has("gravity") else 0.0
    return period + fall, -loss
