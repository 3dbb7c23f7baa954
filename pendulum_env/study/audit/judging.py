"""Rows of an audit: what one effect changes and the verdict on it, and corrections known by formula alone."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pendulum_env.physics.effects import Effect
from pendulum_env.physics.effects.predictions import OSCILLATIONS
from pendulum_env.physics.scene import Scene
from pendulum_env.study.audit.cases import Case
from pendulum_env.study.audit.swing import METHOD, Swing
from pendulum_env.study.audit.verdicts import CALLED_FOR, NEGLIGIBLE, NOT_JUDGED, NOT_SIMULATED, OUTSIDE, AuditRow

NAN = math.nan
STEEL = 2.0e11
"""Young's modulus of steel [Pa] (AISC 360-16, table of symbols: E = 200 000 MPa)."""


@dataclass(frozen=True)
class Change:
    """What one effect changes: period and amplitude, or the angle, relative; and how the two runs went."""

    period: float
    amplitude: float
    angle: float
    have: Swing
    lack: Swing

    @property
    def size(self) -> float:
        """The larger one."""
        return max(abs(value) for value in (self.period, self.amplitude, self.angle) if not math.isnan(value))

    @property
    def diverged(self) -> bool:
        return "diverged" in (self.have.stop_reason, self.lack.stop_reason)


def change_of(have: Swing, lack: Swing, amplitude: float) -> Change:
    """What the difference of two runs is, relative to the release angle."""
    if have.swings and lack.swings:
        period = (have.period - lack.period) / lack.period
        return Change(period, (have.amplitude - lack.amplitude) / amplitude, NAN, have, lack)
    shared = min(len(have.angle), len(lack.angle))
    gap = float(np.max(np.abs(have.angle[:shared] - lack.angle[:shared])))
    return Change(NAN, NAN, gap / amplitude, have, lack)


def moved_by(before: Change, after: Change) -> float:
    """By how much a change still moved with the step; without end if a swing came or went."""
    if math.isnan(before.angle) != math.isnan(after.angle) or after.diverged:
        return math.inf
    pairs = ((before.period, after.period), (before.amplitude, after.amplitude), (before.angle, after.angle))
    return max(abs(a - b) for a, b in pairs if not math.isnan(a))


def row(case: Case, change: Change, cost: float, amplitude: float, tolerance: float) -> AuditRow:
    """The row of one effect, from what it changes and costs."""
    assert case.effect is not None
    verdict, said = _verdict(case, change, tolerance)
    note = "; ".join(text for text in (case.note, said) if text)
    effect, plain = case.effect, case.scene is case.without
    period, size, angle = (NAN, NAN, NAN) if plain else (change.period, change.amplitude, change.angle)
    expected = _predicted(case, amplitude) if math.isnan(angle) and not plain else (NAN, NAN)
    value = _or_nan(lambda: effect.number(case.scene, amplitude))
    return AuditRow(
        case.name, case.present, effect.number_name, value, period, size, angle, *expected, cost, verdict, note
    )


def _verdict(case: Case, change: Change, tolerance: float) -> tuple[str, str]:
    """The verdict, and what is to be said of it."""
    effect, have, lack = case.effect, change.have, change.lack
    assert effect is not None
    if change.diverged:
        return NOT_JUDGED, f"the simulation diverges however short the step of {METHOD}: too stiff"
    if have.stop_reason and have.stop_reason == lack.stop_reason and len(have.angle) <= 2:
        return NOT_JUDGED, f"the run ends at once, with it and without it, by {have.stop_reason}"
    ends = have.stop_reason != lack.stop_reason
    matters = case.needed or ends or change.size > tolerance
    said = [text for text in (_ends(have, lack),) if text]
    speed = have.speed * case.scene.body.length
    beyond = effect.outside(case.scene, speed) if speed else ""
    if beyond:
        said.append(f"{beyond}; by its formula it is {CALLED_FOR if matters else NEGLIGIBLE}")
        return OUTSIDE, "; ".join(said)
    if not case.present and case.replaced:
        names = " and ".join(other.name for other in case.replaced)
        if not _closer(effect, case, lack.speed * case.scene.body.length):
            said.append(f"{'too coarse' if matters else 'would do'} in place of {names}")
            return OUTSIDE if matters else NEGLIGIBLE, "; ".join(said)
        said.append(f"in place of {names}")
    return CALLED_FOR if matters else NEGLIGIBLE, "; ".join(said)


def _closer(effect: Effect, case: Case, speed: float) -> bool:
    """True if an effect is a closer model than those in whose place it was put, or these do not hold."""
    return all(other.detail < effect.detail or other.outside(case.without, speed) for other in case.replaced)


def _ends(have: Swing, lack: Swing) -> str:
    """What is odd about the two runs."""
    if have.stop_reason or lack.stop_reason:
        return f"the run ends with it by {have.stop_reason or 'time'}, without it by {lack.stop_reason or 'time'}"
    if have.free and lack.free and have.swings != lack.swings:
        one, other = ("makes", "does not") if have.swings else ("does not make", "does")
        return f"with it the bob {one} {OSCILLATIONS} oscillations, without it it {other}"
    return ""


def _predicted(case: Case, amplitude: float) -> tuple[float, float]:
    """The textbook's changes, against those of what is replaced."""
    own = _or_nans(case.effect, case.scene, amplitude)
    for other in case.replaced:
        less = _or_nans(other, case.without, amplitude)
        own = (1.0 + own[0]) / (1.0 + less[0]) - 1.0, own[1] - less[1]
    return own


def _or_nans(effect: Effect | None, scene: Scene, amplitude: float) -> tuple[float, float]:
    try:
        return effect.predicted(scene, amplitude) if effect else (NAN, NAN)
    except ArithmeticError:
        return NAN, NAN


def _or_nan(function: Callable[[], float]) -> float:
    try:
        return function()
    except ArithmeticError:
        return NAN


def unjudged(case: Case) -> AuditRow:
    """The row of an effect that nothing determines, or that contradicts the scene."""
    return AuditRow(case.name, case.present, verdict=NOT_JUDGED, note=case.reason)


# --- known by formula alone ------------------------------------------------------------------------------------------


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


def corrections(scene: Scene, tolerance: float) -> list[AuditRow]:
    """The rows of what is known by formula alone."""
    return [
        AuditRow(
            known.name, False, known.number_name, known.number(scene), period_predicted=known.period(scene),
            verdict=NOT_SIMULATED, note=known.note(scene, tolerance),
        )
        for known in CORRECTIONS
    ]
