"""Generated source that computes the observation, the angle from upright and the energy ledger from a state.

The generated lines read the local names ``index``, ``q``, ``turns``, ``v``, ``h``, ``side`` (in periodic scenes), the
quadratures and, for the ledger, ``inertia``, ``scale`` and ``initial``, the energy at the start. They store the results
in local names, and serve single environments and blocks of environments.
"""

from __future__ import annotations

from pendulum_env.engine import watch, wrap
from pendulum_env.engine.calls import potential
from pendulum_env.engine.shape import DIVERGED, SLACK, Shape
from pendulum_env.engine.source import Plain
from pendulum_env.physics import elementary, energy

SEEN = ("cosine", "sine", "rate")
"""Local names of the entries of the observation."""

FASTEST = "3.4028234663852886e+38"
"""Largest float32, the bound of the observed velocity, as source."""

RESOLVED = "1.6"
"""Bound of the reduced angle [rad], as source: above pi/2.

Without it, the reduced angle of a huge angle, which has no fractional digits, could be anything.
"""


CALLED: tuple[Plain, ...] = (
    elementary.sin, elementary.cos, elementary.sin_near_zero, elementary.cos_near_zero, wrap.half_turns,
    wrap.without_half_turns, wrap.without_half_turns_kept, wrap.side_of, wrap.left_out,
    energy.residual_of, energy.beyond_sense,
)
"""Plain functions that the generated reports and the steps between them call."""


def motion(shape: Shape) -> list[str]:
    """Return the source lines that compute the observation and ``phi``, the angle from upright in [-pi, pi].

    The lines use the sine of half the angle, because the gravitational potential needs it too: the compiler computes it
    only once. Where the angle is wrapped, its half needs no reduction.
    """
    turned = ["tilt = q"] if shape.periodic else [
        "halves = half_turns(q)", "tilt = without_half_turns(q, halves)",
        f"tilt = tilt if tilt < {RESOLVED} else {RESOLVED}", f"tilt = tilt if tilt > -{RESOLVED} else -{RESOLVED}",
        "side = side_of(0.5*halves)"]
    sine, cosine = ("sin_near_zero(0.5*tilt, 0.0)", "cos_near_zero(0.5*tilt, 0.0)") if (
        shape.periodic) else ("sin(0.5*tilt)", "cos(0.5*tilt)")
    return [
        *turned,
        f"half = {sine}",
        "cosine = side*(1.0 - 2.0*half*half)",
        f"sine = side*(2.0*half*{cosine})",
        f"rate = v if v < {FASTEST} else {FASTEST}",
        f"rate = rate if rate > -{FASTEST} else -{FASTEST}",
        "phi = tilt if side < 0.0 else (tilt - 3.141592653589793 if tilt > 0.0 else tilt + 3.141592653589793)",
    ]


PLACE = {"r_angle": "q + 6.283185307179586*turns", "r_velocity": "v"}
"""Local names and formulas of the unwrapped angle [rad] and the velocity [rad/s]."""


REMAINDERS = {"r_lost_angle": "left_out(r_angle, q, lost_q, turns)", "r_lost_velocity": "lost_v"}
"""Local names and formulas of the rounding remainders of angle and velocity, with compensated summation."""


ENERGIES = {
    "r_kinetic_energy": "inertia*(0.5*v*v)",
    "r_potential_energy": "inertia*r_stored",
    "r_energy": "r_kinetic_energy + r_potential_energy",
}
"""Local names and formulas of the kinetic, potential and total energy [J]; before them stands :func:`stored`."""


def stored(shape: Shape) -> str:
    """Write the source line that computes the potential energy per moment of inertia, ``r_stored`` [1/s^2]."""
    return f"r_stored = {potential(shape)}"


def balance(shape: Shape) -> dict[str, str]:
    """Return the source formulas of energy, work, heat and the energy residual [J]."""
    heats = [f"inertia*{name}" for name in shape.sums if name.startswith("heat")]
    return {
        **ENERGIES,
        "r_work": "inertia*work" if "work" in shape.quadratures else "0.0",
        "r_heat": " + ".join(["0.0", *heats]),
        "r_energy_residual": "residual_of(r_energy, initial, r_work, r_heat)",
    }


def ledger(shape: Shape) -> dict[str, str]:
    """Return local names and source formulas of all entries of ``info``: energy ledger, heats, other diagnostics."""
    values: dict[str, str] = {}
    if shape.ledger:
        values = {"r_time": "index*h", **PLACE, **balance(shape), **(REMAINDERS if shape.compensated else {})}
    heats_of = {f"r_{name}": f"inertia*{name}" for name in shape.info if name.startswith("heat_")}
    return values | heats_of | {f"r_{name}": value for name, value in watch.values(shape).items()}


def recorded(shape: Shape) -> dict[str, str]:
    """Return local names and source formulas of the quantities that a run records: at least motion and energies."""
    if shape.ledger:
        return ledger(shape)
    return {**PLACE, **ENERGIES, **(REMAINDERS if shape.compensated else {}), **ledger(shape)}


FOLLOWING = ("time", "energy", "energy_residual")
"""Entries of an energy ledger that follow from the others and are therefore not recorded."""


def names_recorded(shape: Shape) -> tuple[str, ...]:
    """Return the names of the quantities that a run of a batch records, without those that follow from others."""
    named = [name.removeprefix("r_") for name in recorded(shape)]
    return tuple(name for name in named if name not in FOLLOWING)


def judged(stop: str) -> str:
    """Write the source line that stops a run as diverged if the energy residual is absurdly large, though finite.

    ``stop`` is the name of the variable with the stop code, which the line sets to DIVERGED.
    """
    nonsense = "beyond_sense(r_energy_residual, scale, initial, r_work)"
    return f"{stop} = {DIVERGED}.0 if {nonsense} & ({stop} <= {SLACK}.0) else {stop}"


def info(shape: Shape) -> str:
    """Write the source of ``info``, which returns the reported quantities in a state vector as a dict by name."""
    items = ", ".join(f'"{name}": values[{i}]' for i, name in enumerate(shape.state) if i > shape.phi)
    return f"def info(values):\n    return {{{items}}}\n"
