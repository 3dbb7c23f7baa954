"""Known corrections of the period that are not simulated: the support gives way, the wire bends at its clamp."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from pendulum_env.physics.scene import Scene

STEEL = 2.0e11
"""Young's modulus of steel [Pa] (AISC 360-16, table of symbols: E = 200 000 MPa)."""


@dataclass(frozen=True)
class Correction:
    """One correction.

    Attributes:
        name: as in the audit.
        number_name: the dimensionless number that says when it matters.
        number: of a scene; nan where it is not known.
        period: relative change of the period of small swings; nan where it is not known.
        note: what else is to be said, of a scene and a tolerance.
        source: where the formula is from.
    """

    name: str
    number_name: str
    number: Callable[[Scene], float]
    period: Callable[[Scene], float]
    note: Callable[[Scene, float], str]
    source: str


def weight(scene: Scene) -> float:
    """What pulls at the pivot when the bob hangs [N]."""
    return scene.gravity * scene.weight_moment / scene.body.length


def bending_length(scene: Scene) -> float:
    """``sqrt(E I/(m g))`` [m], ``I = pi d**4/64``: over about this length below its clamp a steel wire is bent."""
    body, load = scene.body, weight(scene)
    if body.suspension != "wire" or load <= 0.0:
        return math.nan
    return math.sqrt(STEEL * math.pi * body.diameter**4 / 64.0 / load)


def _compliance(scene: Scene, tolerance: float) -> str:
    stiffness = weight(scene) / (2.0 * scene.body.length * tolerance)
    return f"lengthens the period by m g/(2 K L): it matters if the support is softer than K = {stiffness:.3g} N/m"


def _flexure(scene: Scene, tolerance: float) -> str:
    if scene.body.suspension != "wire":
        return "a rod that turns with its shaft does not bend at the pivot"
    change = bending_length(scene) / (2.0 * scene.body.length)
    said = "matters" if change > tolerance else "is negligible at this tolerance"
    return f"a steel wire of {1e3 * scene.body.diameter:.3g} mm, clamped at the pivot: by the formula it {said}"


CORRECTIONS: tuple[Correction, ...] = (
    Correction(
        "support_compliance", "m g/(K L)", lambda scene: math.nan, lambda scene: math.nan, _compliance,
        "Nelson & Olsson 1986, Am. J. Phys. 54, 112",
    ),
    Correction(
        "wire_flexure", "bent length/L",
        lambda scene: bending_length(scene) / scene.body.length,
        lambda scene: -bending_length(scene) / (2.0 * scene.body.length), _flexure,
        "Nelson & Olsson 1986, Am. J. Phys. 54, 112",
    ),
)
"""Every correction that audits name beside the effects."""
