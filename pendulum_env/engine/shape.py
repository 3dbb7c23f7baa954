"""What the loops around a step know of a program: its names, its limits, and how it can end."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from integrators.steps.compensated import LOST as LOST_PARTS

OK, DIVERGED, SPEED_LIMIT, SLACK, LOST, LATE, TOO_SHORT, PAUSED = range(8)
STOP_REASONS = {
    DIVERGED: "diverged", SPEED_LIMIT: "speed_limit", SLACK: "slack", LOST: "fell", TOO_SHORT: "step_too_short"
}
"""Why a run ended, and its name. Neither LATE nor PAUSED ends a run: an episode's time is up, or an adaptive run has
used up the tries of one call; see :mod:`pendulum_env.engine.pieces`."""

STATE = ("index", "angle", "turns", "velocity", "kinetic", "potential")
"""First entries of the state: steps taken, angle from the nearer of bottom and top, turns (whole or half ones; see
:mod:`pendulum_env.engine.wrap`), velocity [rad/s], kinetic and potential energy per inertia. Quadratures follow."""

LEDGER = (
    "time", "angle", "velocity", "kinetic_energy", "potential_energy", "energy", "work", "heat", "energy_residual"
)
"""What ``info`` holds with the diagnostic "energy" [s, rad, rad/s, J]."""

LEFT_OUT = ("lost_angle", "lost_velocity")
"""What ``info`` holds beside where summation is compensated: what rounding left out of angle and velocity."""

OWN = ("inertia", "scale")
"""What the loops take beside the effects' coefficients: moment of inertia [kg m²] and ``m g L`` [J]."""

PULL = ("swing_pull", "gravity_pull", "pull_scale")
FLOW = ("reynolds_rate", "stroke_rate", "natural_rate")
"""What they take where the pull on the suspension matters, and where the flow is watched."""

SLACKENED = ("slackened",)
"""What the state of a lenient run holds beside: steps taken when the wire first had to push, 0 if it never had to."""

WATCHED = {"tension": ("tension",), "flow": ("reynolds", "keulegan_carpenter", "quality_factor")}
"""Diagnostics beside the ledger, and what ``info`` holds with them: [N], [1], [1], [1]."""

HOLD = ("hold",)
"""What programs of scenes that remember take beside: steps in a control step, for which what they remember holds."""

ADAPTED = ("size", "taken", "rejected")
"""What the state of an adaptive run holds beside: the step to try next, how many were taken, how many tried in vain."""

TOLERANCE = ("rtol", "atol")
"""What adaptive programs take beside."""
BOUND = ("tries", "under_way")
"""And then: tries that a call may make, and 1 where it goes on with a step that the call before paused in, 0 where it
does not, -1 where nothing goes on after a pause. Behind them stands what ``Shape.paused`` names."""
PART = ("done", "last", "most", *ADAPTED, "q", "v", "a")
"""What a step goes on from after a pause: part of it that is done [s], error of the last try, largest growth of the
next, ADAPTED, and the motion. Rates and increments of the quadratures follow."""

LARGEST = "1e150"
"""Beyond this a value counts as out of range, while its square is still finite."""
SINE_RANGE = "8e8"
"""Angle per step up to which the portable sine is accurate."""


@dataclass(frozen=True)
class Shape:
    """A program's arguments, what it sums, what can stop it, and what it reports.

    Attributes:
        parameters: coefficients of the effects.
        place: arguments of functions of the place; ``extra``: of the forces.
        quadratures: what rides along: work and heat per inertia.
        memory: names of what one step hands on to the next beside the state.
        dry: name of the dry friction's coefficient, "" without any; ``slides``: steps are cut at zeros of the velocity.
        periodic: the torques repeat after a whole turn; ``slack``: a wire may go slack; ``lenient``: and goes on then.
        ledger, by_effect: what is reported beside the motion.
        adaptive: each step is taken in as many as a tolerance asks for.
        compensated: the state keeps what rounding took from it; see :mod:`integrators.steps.compensated`.
        watched: what else is reported, of WATCHED.
        remembered: names of what effects remember, advanced at the start of each control step.
        drawn: those of them that start as random whole numbers.
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
        """True if work and heat are summed."""
        return self.ledger or self.by_effect

    @property
    def lost(self) -> tuple[str, ...]:
        """What rounding took from q and v, which every step takes and returns behind its memory."""
        return LOST_PARTS if self.compensated else ()

    @property
    def lost_sums(self) -> tuple[str, ...]:
        """What rounding took from the quadratures."""
        return tuple(f"lost_{name}" for name in self.quadratures) if self.compensated else ()

    @property
    def recorded(self) -> tuple[str, ...]:
        """What a recorded row holds: STATE, then the quadratures, what rounding took from q and v, what is watched."""
        return (*STATE, *self.quadratures, *self.lost, *self.watched)

    @property
    def pull(self) -> tuple[str, ...]:
        """What is taken to compute the pull on the suspension."""
        return PULL if self.slack or "tension" in self.watched else ()

    @property
    def numbers(self) -> tuple[str, ...]:
        """Every number of a scene that programs take."""
        flow = FLOW if set(WATCHED["flow"]) & set(self.watched) else ()
        return (*self.parameters, *OWN, *self.pull, *flow)

    @property
    def info(self) -> tuple[str, ...]:
        """What is reported beside observation and reward."""
        heats = [name for name in self.quadratures if name.startswith("heat_")] if self.by_effect else []
        left_out = LEFT_OUT if self.compensated else ()
        return (*((*LEDGER, *left_out) if self.ledger else ()), *heats, *self.watched)

    @property
    def state(self) -> tuple[str, ...]:
        """Names of the state's entries: what is recorded, what a run goes on from, then what is reported."""
        return (*self.recorded, *self.kept, "phi", *self.info)

    @property
    def kept(self) -> tuple[str, ...]:
        """What stands in the state behind what is recorded: the energy at the start, and what runs go on from.

        With a memory that is the control it was made under and itself; ADAPTED in adaptive runs; what effects
        remember, and how many steps of the control step are done.
        """
        memory = ("held", *self.memory) if self.memory else ()
        remembered = (*self.remembered, "phase") if self.remembered else ()
        slackened = SLACKENED if self.lenient else ()
        return ("initial", *memory, *self.lost_sums, *(ADAPTED if self.adaptive else ()), *slackened, *remembered)

    @property
    def paused(self) -> tuple[str, ...]:
        """What an adaptive run goes on from after a pause within a step."""
        rates = tuple(f"rate_{name}" for name in self.quadratures)
        return (*PART, *rates, *self.quadratures) if self.adaptive else ()

    @property
    def params(self) -> tuple[str, ...]:
        """Everything that a single run takes in ``params``, in order; adaptive ones put what they pause in there."""
        more = (*TOLERANCE, *BOUND, *(f"paused_{name}" for name in self.paused)) if self.adaptive else ()
        return (*self.numbers, *(HOLD if self.remembered else ()), *more)

    @property
    def stale(self) -> str:
        """Whether a memory has to begin anew: at the start, and where the control or what effects remember changed."""
        if self.remembered:
            return "True"
        return f"(index == 0.0){' | (held != control)' if 'control' in self.extra else ''}"

    def remember(self, span: str) -> str:
        """The line that advances what effects remember by a control step of ``span`` [s]."""
        arguments = joined(self.remembered, ("control", "first", span), self.parameters)
        return f"{joined(tuple(f'{name}1' for name in self.remembered))}, = remember({arguments})"

    @property
    def phi(self) -> int:
        """Place of "phi" in the state; what is reported follows."""
        return len(self.recorded) + len(self.kept)


def indent(lines: Iterable[str], depth: int) -> list[str]:
    """The lines, further right."""
    return ["    " * depth + line for line in lines]


def joined(*groups: Sequence[str]) -> str:
    """All names, separated by commas."""
    return ", ".join(name for group in groups for name in group)
