"""Verdicts of an audit ("matters", "negligible", ...), from the simulated changes that each effect causes."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from pendulum_env.physics.effects import Effect
from pendulum_env.physics.effects.effect import OSCILLATIONS
from pendulum_env.physics.scene import Scene
from pendulum_env.study.audit.cases import METHOD, AuditCase, Swing
from pendulum_env.study.audit.verdicts import CALLED_FOR, NEGLIGIBLE, NOT_JUDGED, NOT_SIMULATED, OUTSIDE, AuditRow

Array = NDArray[np.float64]
T = TypeVar("T")

NAN = math.nan
STEEL = 2.0e11
"""Young's modulus of steel [Pa] (AISC 360-16, table of symbols: E = 200 000 MPa)."""


@dataclass(frozen=True)
class Change:
    """Relative changes that an effect causes, from a simulated swing without it (``lack``) to one with it (``have``).

    The changes are those of period and amplitude; where a swing has no period, that of the angle instead.
    """

    period: float
    amplitude: float
    angle: float
    have: Swing
    lack: Swing

    @property
    def values(self) -> Array:
        """The relative changes of period, amplitude and angle; nan where one is not known."""
        return np.array([self.period, self.amplitude, self.angle])

    @property
    def size(self) -> float:
        """Largest relative change, in absolute value, of period, amplitude or angle that the effect causes."""
        return float(np.nanmax(np.abs(self.values)))

    @property
    def diverged(self) -> bool:
        """True if the simulation with the effect or the one without it diverged."""
        return "diverged" in (self.have.stop_reason, self.lack.stop_reason)


def change_of(have: Swing, lack: Swing, amplitude: float) -> Change:
    """Return the relative changes from the swing ``lack``, simulated without an effect, to ``have``, with it."""
    if have.swings and lack.swings:
        period = (have.period - lack.period) / lack.period
        return Change(period, (have.amplitude - lack.amplitude) / amplitude, NAN, have, lack)
    shared = min(len(have.angle), len(lack.angle))
    gap = float(np.max(np.abs(have.angle[:shared] - lack.angle[:shared])))
    return Change(NAN, NAN, gap / amplitude, have, lack)


def moved_by(before: Change, after: Change) -> float:
    """Return by how much the measured changes of an effect differ between two step sizes.

    ``before`` and ``after`` are measured with a longer and a shorter step. The result is inf if the run at the shorter
    step diverged, or if only one of the two has a period.
    """
    if math.isnan(before.angle) != math.isnan(after.angle) or after.diverged:
        return math.inf
    return float(np.nanmax(np.abs(before.values - after.values)))


def row(case: AuditCase, change: Change, cost: float, amplitude: float, tolerance: float) -> AuditRow:
    """Return an effect's row in the table of verdicts, from its simulated changes and its computing time [ns/step]."""
    assert case.effect is not None
    verdict, remark = _verdict(case, change, tolerance)
    note = "; ".join(text for text in (case.note, remark) if text)
    effect, plain = case.effect, case.scene is case.without
    period, size, angle = (NAN, NAN, NAN) if plain else (change.period, change.amplitude, change.angle)
    expected = _predicted(case, amplitude) if math.isnan(angle) and not plain else (NAN, NAN)
    value = _or(NAN, effect.number, case.scene, amplitude)
    return AuditRow(
        case.name, case.present, effect.number_name, value, period, size, angle, *expected, cost, verdict, note
    )


def _verdict(case: AuditCase, change: Change, tolerance: float) -> tuple[str, str]:
    """Return the verdict on one effect, such as "matters" or "negligible", and a remark on the verdict, "" if none."""
    effect, have, lack = case.effect, change.have, change.lack
    assert effect is not None
    if change.diverged:
        return NOT_JUDGED, f"the simulation diverges at every step of {METHOD}, because the scene is too stiff"
    if have.stop_reason and have.stop_reason == lack.stop_reason and len(have.angle) <= 2:
        return NOT_JUDGED, f"the run ends at once with and without the effect: {have.stop_reason}"
    ends = have.stop_reason != lack.stop_reason
    matters = case.needed or ends or change.size > tolerance
    remarks = [text for text in (_ends(have, lack),) if text]
    speed = have.speed * case.scene.body.reach
    beyond = effect.outside(case.scene, speed) if speed else ""
    if beyond:
        remarks.append(f"{beyond}; by its formula it {CALLED_FOR if matters else f'is {NEGLIGIBLE}'}")
        return OUTSIDE, "; ".join(remarks)
    if not case.present and case.replaced:
        names = " and ".join(other.name for other in case.replaced)
        if not _closer(effect, case, lack.speed * case.scene.body.reach):
            remarks.append(f"{'too coarse' if matters else 'accurate enough'} in place of {names}")
            return OUTSIDE if matters else NEGLIGIBLE, "; ".join(remarks)
        remarks.append(f"in place of {names}")
    return CALLED_FOR if matters else NEGLIGIBLE, "; ".join(remarks)


def _closer(effect: Effect, case: AuditCase, speed: float) -> bool:
    """Return True if an effect should be preferred to the models of the same phenomenon that it would replace.

    This is so if each of them is less detailed than the effect, or does not hold at the bob's speed [m/s].
    """
    return all(other.detail < effect.detail or other.outside(case.without, speed) for other in case.replaced)


def _ends(have: Swing, lack: Swing) -> str:
    """Return a remark where the runs with and without an effect differ in how they end or oscillate, else ""."""
    if have.stop_reason or lack.stop_reason:
        return f"end of the run with the effect: {have.stop_reason or 'time'}, without: {lack.stop_reason or 'time'}"
    if have.free and lack.free and have.swings != lack.swings:
        one, other = ("makes", "does not") if have.swings else ("does not make", "does")
        return f"with the effect the bob {one} {OSCILLATIONS} oscillations, without the effect it {other}"
    return ""


def _predicted(case: AuditCase, amplitude: float) -> tuple[float, float]:
    """Return the changes of period and amplitude that textbook formulas predict for an effect.

    If the effect replaces other models of the same phenomenon, the changes predicted for these are subtracted.
    """
    assert case.effect is not None
    own = _or((NAN, NAN), case.effect.predicted, case.scene, amplitude)
    for other in case.replaced:
        less = _or((NAN, NAN), other.predicted, case.without, amplitude)
        own = (1.0 + own[0]) / (1.0 + less[0]) - 1.0, own[1] - less[1]
    return own


def _or(otherwise: T, formula: Callable[[Scene, float], T], scene: Scene, amplitude: float) -> T:
    """Return the value of a formula for a scene and an amplitude, or another one where it cannot be computed."""
    try:
        return formula(scene, amplitude)
    except ArithmeticError:
        return otherwise


# --- corrections known only as a formula ------------------------------------------------------------------------------


def weight(scene: Scene) -> float:
    """Return the tension at the pivot when the bob hangs at rest [N]."""
    return scene.gravity * scene.weight_moment / scene.body.reach


def bending_length(scene: Scene) -> float:
    """Return the length below its clamp over which a steel wire bends: ``sqrt(E I/(m g))`` [m], ``I = pi d**4/64``."""
    body, load = scene.body, weight(scene)
    if body.suspension != "wire" or load <= 0.0:
        return math.nan
    return math.sqrt(STEEL * math.pi * body.diameter**4 / 64.0 / load)


def _compliance(scene: Scene, tolerance: float) -> str:
    if scene.body.moment == 0.0:
        return "a body that turns about its centre of mass does not move its support"
    stiffness = weight(scene) / (2.0 * scene.body.reach * tolerance)
    return f"lengthens the period by m g/(2 K L): it matters if the support is softer than K = {stiffness:.3g} N/m"


def _flexure(scene: Scene, tolerance: float, change: float) -> str:
    if scene.body.suspension != "wire":
        return "a rod that turns with its shaft does not bend at the pivot"
    verdict = "matters" if change > tolerance else "is negligible at this tolerance"
    return f"bending of a steel wire of {1e3 * scene.body.diameter:.3g} mm at its clamp: by the formula it {verdict}"


def corrections(scene: Scene, tolerance: float) -> list[AuditRow]:
    """Return the last rows of every audit: corrections of the period that are known only as formulas, not simulated.

    They are the compliance of the support, ``m g/(2 K L)`` of the period with its stiffness K, which is not known, and
    the flexure of a wire, of which a length bends at its clamp: minus half of that length over L.

    Source: Nelson & Olsson 1986, Am. J. Phys. 54, 112.
    """
    bent = bending_length(scene) / scene.body.reach
    return [
        AuditRow("support_compliance", False, "m g/(K L)", verdict=NOT_SIMULATED, note=_compliance(scene, tolerance)),
        AuditRow("wire_flexure", False, "bent length/L", bent, period_predicted=-0.5 * bent, verdict=NOT_SIMULATED,
                 note=_flexure(scene, tolerance, 0.5 * bent)),
    ]
