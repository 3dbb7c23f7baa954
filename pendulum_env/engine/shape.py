"""Names and codes shared by generated programs: state entries, parameters, diagnostics and stop reasons."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from integrators.steps.compensated import LOST as LOST_PARTS

OK, DIVERGED, SPEED_LIMIT, SLACK, LOST, LATE, TOO_SHORT, PAUSED = range(8)
STOP_REASONS = {
    DIVERGED: "diverged", SPEED_LIMIT: "speed_limit", SLACK: "slack", LOST: "fell", TOO_SHORT: "step_too_short"
}
"""Stop code -> name of the stop reason, for the codes that end a run.

LATE (an episode's time is up) and PAUSED (an adaptive run has used up the step attempts of one call, see
:mod:`pendulum_env.engine.pieces`) do not end a run.
"""

STATE = ("index", "angle", "turns", "velocity", "kinetic", "potential")
"""First entries of the state vector.

They are the steps taken, the angle from the nearer of bottom and top [rad], whole or half turns (see
:mod:`pendulum_env.engine.wrap`), the velocity [rad/s], and kinetic and potential energy per inertia. The quadratures
follow.
"""

LEDGER = (
    "time", "angle", "velocity", "kinetic_energy", "potential_energy", "energy", "work", "heat", "energy_residual"
)
"""Entries of ``info`` with the diagnostic "energy" [s, rad, rad/s, J]."""

LEFT_OUT = ("lost_angle", "lost_velocity")
"""Further entries of ``info`` with compensated summation: the rounding remainders of angle and velocity."""

OWN = ("inertia", "scale")
"""Parameters of every program beside the effects' coefficients: moment of inertia [kg m²] and ``m g L`` [J]."""

PULL = ("swing_pull", "gravity_pull", "pull_scale")
FLOW = ("reynolds_rate", "stroke_rate", "natural_rate")
"""Further parameters of programs that compute the pull on the suspension (PULL) or the flow past the bob (FLOW)."""

SLACKENED = ("slackened",)
"""Further entry of the state with slack="warn": steps taken when the wire first went slack, 0 if it never did."""

WATCHED = {"tension": ("tension",), "flow": ("reynolds", "keulegan_carpenter", "quality_factor")}
"""Diagnostic -> its entries of ``info``: tension [N], and three pure numbers of the flow past the bob."""

HOLD = ("hold",)
"""Further parameter in scenes whose effects have a state, such as gusts: the number of steps per control step."""

ADAPTED = ("size", "taken", "rejected")
"""Further entries of an adaptive run's state: next step size to try, numbers of steps taken and rejected."""

TOLERANCE = ("rtol", "atol")
"""Further parameters of adaptive programs: the tolerances."""
BOUND = ("tries", "under_way")
"""Parameters of adaptive programs after TOLERANCE.

``tries`` is the number of step attempts that one call may make. ``under_way`` is 1 if the call continues a step in
which the previous call paused, 0 if not, and -1 if runs never pause. The entries of ``Shape.paused`` follow.
"""
PART = ("done", "last", "most", *ADAPTED, "q", "v", "a")
"""Values from which a paused adaptive step continues.

They are the time done [s], the error of the last attempt, the largest growth of the next step, ADAPTED, and the motion.
Rates and increments of the quadratures follow.
"""

LARGEST = "1e150"
"""Largest |value| that counts as finite, as source; its square is still a finite float."""
SINE_RANGE = "8e8"
"""Largest angle [rad] for which the portable sine is accurate, as source."""


@dataclass(frozen=True)
class Shape:
    """Interface of a generated program: its arguments, quadratures, possible stops and reported quantities.

    Attributes:
        parameters: names of the effects' coefficients.
        place: further arguments of functions of the angle, such as the potential.
        extra: further arguments of functions of time, angle and velocity, such as the torques.
        quadratures: names of the integrals carried along a step: work and heat per inertia.
        memory: names of the method's history, the values that a step hands to the next one beside the state.
        dry: name of the dry friction's coefficient, "" without dry friction.
        slides: True if steps are divided at zeros of the velocity, because of dry friction.
        periodic: True if the torques repeat after a whole turn.
        slack: True if a wire may go slack.
        lenient: True if a run continues after the wire went slack (slack="warn").
        ledger: True if the energy ledger is reported.
        by_effect: True if the heat of every effect is reported.
        adaptive: True if every step is divided as a tolerance requires.
        compensated: True if the state holds rounding remainders; see :mod:`integrators.steps.compensated`.
        watched: names of the further reported quantities; see WATCHED.
        remembered: names of the effects' state variables, advanced at the start of every control step.
        drawn: names of the effects' state variables that start as random whole numbers.
    """

    parameters: tuple[str, ...]
    place: tuple[str, ...]
    extra: tuple[str, ...]
    quadratures: tuple[str, ...]
    memory: tuple[str, ...]
    dry: str
    slides: bool
    periodic: bool
    slack: bool
    ledger: bool
    by_effect: bool
    adaptive: bool = False
    compensated: bool = False
    lenient: bool = False
    watched: tuple[str, ...] = ()
    remembered: tuple[str, ...] = ()
    drawn: tuple[str, ...] = ()

    @property
    def accounts(self) -> bool:
        """Return True if the program computes work and heat."""
        return self.ledger or self.by_effect

    @property
    def lost(self) -> tuple[str, ...]:
        """Return the names of the rounding remainders of angle and velocity; every step takes and returns them."""
        return LOST_PARTS if self.compensated else ()

    @property
    def lost_sums(self) -> tuple[str, ...]:
        """Return the names of the rounding remainders of the quadratures."""
        return tuple(f"lost_{name}" for name in self.quadratures) if self.compensated else ()

    @property
    def recorded(self) -> tuple[str, ...]:
        """Return the names of the recorded quantities: motion, energies, quadratures, rounding remainders, diagnostics.
        """
        return (*STATE, *self.quadratures, *self.lost, *self.watched)

    @property
    def pull(self) -> tuple[str, ...]:
        """Return the names of the parameters in the formula for the pull on the suspension.

        There are none if no diagnostic or wire needs the pull.
        """
        return PULL if self.slack or "tension" in self.watched else ()

    @property
    def numbers(self) -> tuple[str, ...]:
        """Return the names of all numbers of a scene that the generated program takes as parameters."""
        flow = FLOW if set(WATCHED["flow"]) & set(self.watched) else ()
        return (*self.parameters, *OWN, *self.pull, *flow)

    @property
    def info(self) -> tuple[str, ...]:
        """Return the names of the entries of an environment's ``info``, which a program computes at every control step.
        """
        heats = [name for name in self.quadratures if name.startswith("heat_")] if self.by_effect else []
        left_out = LEFT_OUT if self.compensated else ()
        return (*((*LEDGER, *left_out) if self.ledger else ()), *heats, *self.watched)

    @property
    def state(self) -> tuple[str, ...]:
        """Return the names of the entries of a machine's state vector.

        First are the recorded quantities, then the values from which a run continues, then the reported quantities.
        """
        return (*self.recorded, *self.kept, "phi", *self.info)

    @property
    def kept(self) -> tuple[str, ...]:
        """Return the names of the state's unrecorded entries: initial energy, and values from which a run continues.

        The values are the method's history and the control for which it was computed, rounding remainders, in adaptive
        runs ADAPTED (next step size and step counts), the effects' state variables, and the number of steps taken in
        the present control step.
        """
        memory = ("held", *self.memory) if self.memory else ()
        remembered = (*self.remembered, "phase") if self.remembered else ()
        slackened = SLACKENED if self.lenient else ()
        return ("initial", *memory, *self.lost_sums, *(ADAPTED if self.adaptive else ()), *slackened, *remembered)

    @property
    def paused(self) -> tuple[str, ...]:
        """Return the names of the values from which an adaptive run continues after a pause within a step."""
        rates = tuple(f"rate_{name}" for name in self.quadratures)
        return (*PART, *rates, *self.quadratures) if self.adaptive else ()

    @property
    def params(self) -> tuple[str, ...]:
        """Return the names of the entries of ``params``, the array of a program's parameters for a single run.

        Adaptive runs also store in it the progress of a step in which they pause.
        """
        more = (*TOLERANCE, *BOUND, *(f"paused_{name}" for name in self.paused)) if self.adaptive else ()
        return (*self.numbers, *(HOLD if self.remembered else ()), *more)

    @property
    def stale(self) -> str:
        """Return the source of the condition under which a multistep method's history is computed anew.

        That is at the start of a run, and after a change of the control or of an effect's state.
        """
        if self.remembered:
            return "True"
        return f"(index == 0.0){' | (held != control)' if 'control' in self.extra else ''}"

    def remember(self, span: str) -> str:
        """Return the source line that advances the state variables of effects by a control step of ``span`` [s]."""
        arguments = joined(self.remembered, ("control", "first", span), self.parameters)
        return f"{joined(tuple(f'{name}1' for name in self.remembered))}, = remember({arguments})"

    @property
    def phi(self) -> int:
        """Return the index in the state of "phi", the angle from upright; the reported quantities follow it."""
        return len(self.recorded) + len(self.kept)


def indent(lines: Iterable[str], depth: int) -> list[str]:
    """Return the source lines, indented by ``depth`` levels."""
    return ["    " * depth + line for line in lines]


def joined(*groups: Sequence[str]) -> str:
    """Return the names of all groups as one comma-separated text."""
    return ", ".join(name for group in groups for name in group)
