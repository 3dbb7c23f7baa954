"""Names and codes shared by generated programs: state entries, parameters, diagnostics and stop reasons."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from integrators.steps.compensated import LOST as LOST_PARTS

Floats = tuple[float, ...]
"""A template's tuple: variables that only some scenes or methods have; see :mod:`pendulum_env.engine.specialise`."""
Function = Callable[..., Any]
"""A function of the program that a template calls."""

OK, DIVERGED, SPEED_LIMIT, SLACK, LOST, LATE, TOO_SHORT, PAUSED, UNSURE = range(9)
STOP_REASONS = {
    DIVERGED: "diverged", SPEED_LIMIT: "speed_limit", SLACK: "slack", LOST: "fell", TOO_SHORT: "step_too_short",
}
"""Stop code -> name of the stop reason, for the codes that end a run.

LATE (an episode's time is up) and PAUSED (an adaptive run has used up the step attempts of one call, see
:mod:`pendulum_env.engine.pieces`) do not end a run. Nor does UNSURE: the wire may go slack in the step, which is then
taken again with a search for the time of slack, see :mod:`pendulum_env.engine.slack`.
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
"""Further entry of the state with slack="warn": 1 plus the number of steps taken when the wire first went slack.

The number has a fraction if the wire went slack within a step. The entry is 0 as long as the wire is taut.
"""

WATCHED = {"tension": ("tension",), "flow": ("reynolds", "keulegan_carpenter", "quality_factor")}
"""Diagnostic -> its entries of ``info``: tension [N], and three pure numbers of the flow past the bob."""

CLIPPED = "heat_clip"
"""Entry of ``info`` for the energy that a clip of the velocity takes; part of the heat."""

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

LARGEST = 1e150
"""Largest |value| that counts as finite; its square is still a finite float."""
SINE_RANGE = 8e8
"""Largest angle [rad] for which the portable sine is accurate."""


def derived() -> Any:
    """Return a field that ``__post_init__`` computes from the others, and that is not compared."""
    return field(init=False, repr=False, compare=False)


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
        weighed: True if no radial forces but weight and centrifugal force pull on such a wire.
        lenient: True if a run continues after the wire went slack (slack="warn").
        ledger: True if the energy ledger is reported.
        by_effect: True if the heat of every effect is reported.
        adaptive: True if every step is divided as a tolerance requires.
        even: True if the parts of a step so divided have the same length.
        compensated: True if the state holds rounding remainders; see :mod:`integrators.steps.compensated`.
        watched: names of the further reported quantities; see WATCHED.
        remembered: names of the effects' state variables, advanced at the start of every control step.
        drawn: names of the effects' state variables that start as random whole numbers.
        clip: name of the coefficient that bounds the velocity after every step; "" without a clip.
        drift: fraction of the step by which the last sub-flow of a splitting, a drift, turns the rod with the clipped
            velocity; 0 if there is none.

    Attributes derived from these:
        sums: names of the sums of work and heat in the state: the quadratures, and the heat of a clip.
        ends_slack: True if a wire that goes slack ends the run.
        accounts: True if the program computes work and heat.
        lost: names of the rounding remainders of angle and velocity, which every step takes and returns.
        lost_sums: names of the rounding remainders of the sums.
        handed: names of the values beside the motion that a step takes and hands to the next one: a multistep method's
            history and the rounding remainders; in adaptive steps the acceleration and the rates of the quadratures.
        pull: names of the parameters in the formula for the pull on the suspension; none if no diagnostic or wire needs
            the pull.
        numbers: names of all numbers of a scene that the program takes as parameters.
        info: names of the entries of an environment's ``info``, computed at every control step.
        recorded: names of the recorded quantities: motion, energies, quadratures, rounding remainders, diagnostics.
        kept: names of the state's unrecorded entries: the initial energy, and the values from which a run continues.
            Those are the method's history and the control for which it was computed, rounding remainders, in adaptive
            runs ADAPTED (next step size and step counts), the effects' state variables, and the number of steps taken
            in the present control step.
        state: names of the entries of a machine's state vector: the recorded quantities, the kept ones, "phi", and the
            reported quantities.
        phi: index in the state of "phi", the angle from upright; the reported quantities follow it.
        paused: names of the values from which an adaptive run continues after a pause within a step.
        slackened: name of the state's entry of a wire that is slack, if the run continues with it; see SLACKENED.
        carried: names of the variables that the generated ``advance`` changes in one step, such as the angle "q": the
            motion, a multistep method's history, and the quadratures; not the step count and ADAPTED.
        forces: arguments after ``t, q, v`` of generated torque functions; dry friction adds ``direction``.
        step_results: names of a step's results: the motion, what a step hands to the next one, and the quadratures.
        params: names of the entries of ``params``, the array of a program's parameters for a single run. Adaptive runs
            also store in it the progress of a step in which they pause.
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
    weighed: bool = False
    watched: tuple[str, ...] = ()
    remembered: tuple[str, ...] = ()
    drawn: tuple[str, ...] = ()
    clip: str = ""
    drift: float = 0.0
    even: bool = False

    sums: tuple[str, ...] = derived()
    ends_slack: bool = derived()
    accounts: bool = derived()
    lost: tuple[str, ...] = derived()
    lost_sums: tuple[str, ...] = derived()
    handed: tuple[str, ...] = derived()
    pull: tuple[str, ...] = derived()
    numbers: tuple[str, ...] = derived()
    info: tuple[str, ...] = derived()
    recorded: tuple[str, ...] = derived()
    kept: tuple[str, ...] = derived()
    state: tuple[str, ...] = derived()
    phi: int = derived()
    paused: tuple[str, ...] = derived()
    params: tuple[str, ...] = derived()
    slackened: tuple[str, ...] = derived()
    carried: tuple[str, ...] = derived()
    forces: tuple[str, ...] = derived()
    step_results: tuple[str, ...] = derived()

    def __post_init__(self) -> None:
        """Derive the names of all values that a program takes, records, keeps and reports."""
        lost = LOST_PARTS if self.compensated else ()
        accounts = self.ledger or self.by_effect
        sums = (*self.quadratures, *((CLIPPED,) if self.clip and accounts else ()))
        lost_sums = tuple(f"lost_{name}" for name in sums) if self.compensated else ()
        rates = tuple(f"rate_{name}" for name in self.quadratures)
        handed = ("a", *rates) if self.adaptive else (*self.memory, *lost)
        step_results = ("q1", "v1", *(f"{name}1" for name in handed), *(f"d_{name}" for name in self.quadratures))
        slackened = SLACKENED if self.lenient else ()
        place = ("q", "turns", "side") if self.periodic else ("q",)
        carried = (*place, "v", *self.memory, *lost, *sums, *lost_sums, *slackened)

        pull = PULL if self.slack or "tension" in self.watched else ()
        flow = FLOW if set(WATCHED["flow"]) & set(self.watched) else ()
        numbers = (*self.parameters, *OWN, *pull, *flow)

        ledger = (*LEDGER, *(LEFT_OUT if self.compensated else ())) if self.ledger else ()
        heats = [name for name in sums if name.startswith("heat_") and (self.by_effect or name == CLIPPED)]
        info = (*ledger, *heats, *self.watched)

        recorded = (*STATE, *sums, *lost, *self.watched)
        memory = ("held", *self.memory) if self.memory else ()
        remembered = (*self.remembered, "phase") if self.remembered else ()
        kept = ("initial", *memory, *lost_sums, *(ADAPTED if self.adaptive else ()), *slackened, *remembered)

        loose = ("loose",) if self.lenient else ()
        paused = (*PART, *rates, *self.quadratures, *loose) if self.adaptive else ()
        progress = (*TOLERANCE, *BOUND, *(f"paused_{name}" for name in paused)) if self.adaptive else ()
        params = (*numbers, *(HOLD if self.remembered else ()), *progress)

        vars(self).update(
            ends_slack=self.slack and not self.lenient, accounts=accounts, sums=sums, lost=lost,
            lost_sums=lost_sums, handed=handed, pull=pull, numbers=numbers, info=info, recorded=recorded, kept=kept,
            state=(*recorded, *kept, "phi", *info), phi=len(recorded) + len(kept), paused=paused, params=params,
            slackened=slackened, carried=carried, step_results=step_results,
            forces=(*self.extra, "direction") if self.slides else self.extra,
        )

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


def indent(lines: Iterable[str], depth: int) -> list[str]:
    """Return the source lines, indented by ``depth`` levels."""
    return ["    " * depth + line for line in lines]


def joined(*groups: Sequence[str]) -> str:
    """Return the names of all groups as one comma-separated text."""
    return ", ".join(name for group in groups for name in group)
