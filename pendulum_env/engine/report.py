"""What a state says, as source: observation, angle from upright and ledger, of one environment or of a block of them.

The lines read ``index``, ``q``, ``turns``, ``v``, ``h``, ``side`` in periodic scenes, the quadratures and, for the
ledger, ``inertia``, ``scale`` and ``initial``, the energy at the start. Each sets local names.
"""

from __future__ import annotations

from pendulum_env.engine import watch, wrap
from pendulum_env.engine.shape import DIVERGED, SLACK, Shape, joined
from pendulum_env.engine.source import Plain
from pendulum_env.physics import elementary, energy

SEEN = ("cosine", "sine", "rate")
"""The observation."""

FASTEST = "3.4028234663852886e+38"
"""The largest float32, which bounds the observed velocity."""

RESOLVED = "1.6"
"""More than a tilt can be; what is left of angles that have no digits behind the point may be anything."""


CALLED: tuple[Plain, ...] = (
    elementary.sin, elementary.cos, wrap.half_turns, wrap.without_half_turns, wrap.without_half_turns_kept,
    wrap.side_of, wrap.left_out, energy.residual_of, energy.beyond_sense,
)
"""Plain functions that reports, and the steps between them, call."""


def motion(shape: Shape) -> list[str]:
    """Cosine, sine and rate as observed, and ``phi``, the angle from upright in [-pi, pi].

    From half the angle, whose sine gravity's potential takes too: computed once for both.
    """
    turned = ["tilt = q"] if shape.periodic else [
        "halves = half_turns(q)", f"tilt = max(-{RESOLVED}, min({RESOLVED}, without_half_turns(q, halves)))",
        "side = side_of(0.5*halves)"]
    return [
        *turned,
        "half = sin(0.5*tilt)",
        "cosine = side*(1.0 - 2.0*half*half)",
        "sine = side*(2.0*half*cos(0.5*tilt))",
        f"rate = max(-{FASTEST}, min({FASTEST}, v))",
        "phi = tilt if side < 0.0 else (tilt - 3.141592653589793 if tilt > 0.0 else tilt + 3.141592653589793)",
    ]


PLACE = {"r_angle": "q + 6.283185307179586*turns", "r_velocity": "v"}
"""Unwrapped angle and velocity."""


def left_out(shape: Shape) -> dict[str, str]:
    """What rounding left out of them, where that is kept."""
    if not shape.compensated:
        return {}
    return {"r_lost_angle": "left_out(r_angle, q, lost_q, turns)", "r_lost_velocity": "lost_v"}


def energy_of(shape: Shape) -> dict[str, str]:
    """Kinetic and potential energy [J]."""
    return {
        "r_kinetic_energy": "inertia*(0.5*v*v)",
        "r_potential_energy": f"inertia*potential({joined(('q',), shape.place)})",
        "r_energy": "r_kinetic_energy + r_potential_energy",
    }


def balance(shape: Shape) -> dict[str, str]:
    """Energy, work, heat, and the residual that they leave [J]."""
    heats = [f"inertia*{name}" for name in shape.quadratures if name.startswith("heat")]
    return {
        **energy_of(shape),
        "r_work": "inertia*work" if "work" in shape.quadratures else "0.0",
        "r_heat": " + ".join(["0.0", *heats]),
        "r_energy_residual": "residual_of(r_energy, initial, r_work, r_heat)",
    }


def ledger(shape: Shape) -> dict[str, str]:
    """Local names of what is reported beside the motion, in order, with their formulas."""
    values: dict[str, str] = {}
    if shape.ledger:
        values = {"r_time": "index*h", **PLACE, **balance(shape), **left_out(shape)}
    heats_of = {f"r_{name}": f"inertia*{name}" for name in shape.info if name.startswith("heat_")}
    return values | heats_of | {f"r_{name}": value for name, value in watch.values(shape).items()}


def recorded(shape: Shape) -> dict[str, str]:
    """The same for records of runs, which hold motion and energies also without a ledger."""
    return ledger(shape) if shape.ledger else {**PLACE, **energy_of(shape), **left_out(shape), **ledger(shape)}


FOLLOWING = ("time", "energy", "energy_residual")
"""Entries of a ledger that follow from the others, and stand in no record of a run."""


def names_recorded(shape: Shape) -> tuple[str, ...]:
    """What a record of a run holds."""
    named = [name.removeprefix("r_") for name in recorded(shape)]
    return tuple(name for name in named if name not in FOLLOWING)


def judged(stop: str) -> str:
    """Write the line that sets ``stop``, why a run ends, where the ledger shows finite nonsense."""
    nonsense = "beyond_sense(r_energy_residual, scale, initial, r_work)"
    return f"{stop} = {DIVERGED}.0 if {nonsense} & ({stop} <= {SLACK}.0) else {stop}"


def info(shape: Shape) -> str:
    """A plain function from a state's numbers to ``info``: a dict display, the fastest way to fill one."""
    items = ", ".join(f'"{name}": values[{i}]' for i, name in enumerate(shape.state) if i > shape.phi)
    return f"def info(values):\n    return {{{items}}}\n"
