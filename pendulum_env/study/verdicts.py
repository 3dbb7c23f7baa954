"""What an audit found: one row per effect, and what leaving effects out does."""

from __future__ import annotations

from dataclasses import dataclass

from pendulum_env.physics.scene import Scene

CALLED_FOR, NEGLIGIBLE = "called for", "negligible"


@dataclass(frozen=True)
class AuditRow:
    """One effect.

    Attributes:
        effect: its name.
        present: False for one that the scene leaves out.
        period_change: relative change of the period that it makes, by simulation; nan where nothing swings without it.
        amplitude_change: change of the amplitude in the first half swing, relative to the release angle, likewise.
        period_predicted, amplitude_predicted: the textbook's formula; nan where there is none.
        ns_per_step: what it adds to a step of rk4 [ns], measured.
        verdict: "called for" or "negligible".
        note: what else is to be said.
    """

    effect: str
    present: bool
    period_change: float
    amplitude_change: float
    period_predicted: float
    amplitude_predicted: float
    ns_per_step: float
    verdict: str
    note: str = ""


@dataclass(frozen=True)
class Audit:
    """The effects of a scene at one amplitude [rad] and relative tolerance.

    ``integration_error`` is how much the changes moved when the step was last halved, to ``steps`` per period.
    """

    scene: Scene
    amplitude: float
    tolerance: float
    rows: tuple[AuditRow, ...]
    integration_error: float
    steps: int

    @property
    def called_for(self) -> tuple[str, ...]:
        """Names of the effects, present or absent, that the scene calls for."""
        return tuple(row.effect for row in self.rows if row.verdict == CALLED_FOR)

    @property
    def negligible(self) -> tuple[str, ...]:
        """Names of the present effects that may go."""
        return tuple(row.effect for row in self.rows if row.present and row.verdict == NEGLIGIBLE)


@dataclass(frozen=True)
class Simplification:
    """What leaving effects out does over a whole run.

    Attributes:
        audit: the verdicts.
        removed: names of the effects that went.
        duration: of the comparison [s].
        error: largest difference of the angle between the two scenes, relative to the amplitude, by simulation.
        integration_error: share of it that is the integrator's, by halving the step.
        within: True if the error is at most the tolerance.
    """

    audit: Audit
    removed: tuple[str, ...]
    duration: float
    error: float
    integration_error: float
    within: bool

    @property
    def text(self) -> str:
        """The report in a sentence or two."""
        missing = [row.effect for row in self.audit.rows if not row.present and row.verdict == CALLED_FOR]
        warning = f" It still calls for {', '.join(missing)}, which the scene leaves out." if missing else ""
        if not self.removed:
            return f"Every effect of '{self.audit.scene.name}' is called for; nothing was left out.{warning}"
        verdict = "within" if self.within else "NOT within"
        return (
            f"Without {', '.join(self.removed)} the angle is off by at most {self.error:.2g} of the amplitude over "
            f"{self.duration:g} s: {verdict} the tolerance of {self.audit.tolerance:g}.{warning}"
        )
