"""Hard cases: resonance of a method's steps with the pendulum, and of a drive at twice the pendulum's frequency."""

from __future__ import annotations

import math
from functools import lru_cache, partial

import numpy as np

from integrators import Method
from integrators.analysis import amplification
from pendulum_env.hard_cases.case import (
    ACCURATE,
    DIVERGED,
    LOOSE,
    STABLE,
    Case,
    Finding,
    bounded,
    demand,
    follows,
    foreseen,
    graded,
    known,
    named,
    ran,
    resolved,
    run_of,
    stopped,
    then,
    unit,
)
from pendulum_env.hard_cases.long_runs import conserving
from pendulum_env.hard_cases.predicted import Motion
from pendulum_env.hard_cases.step_limits import CEILING, LINEAR, START, grown, growth, growth_rule, in_time
from pendulum_env.physics.effects import Gravity, LinearDrag, PeriodicTorque, SmallAngleGravity, VerticalDrive
from pendulum_env.physics.energy import beyond_sense
from pendulum_env.truth.answer import Array
from pendulum_env.truth.bounds import UNIT, error_constant, order_bound, rounding_factor

GROUP = "resonance"
OUT_OF_TUNE = "a method out of resonance can only be said not to grow faster"


# --- steps of about half a period -----------------------------------------------------------------------------------


@lru_cache(maxsize=512)
def matrix_of(method: Method, z: float) -> tuple[Array, float] | None:
    """Return the matrix of a method's step on the oscillator, for (q, v/omega0), and its relative rounding error.

    ``z`` is omega0 h. None: the method has a memory, so that its step is no 2 x 2 matrix. The matrix is that of the
    package's method of this name.
    """
    matrix = amplification(named(method), z)
    if len(matrix) != 2:
        return None
    size = rounding_factor(method) * method.evaluations * (1.0 + z) ** 2 * (1.0 + float(np.linalg.norm(matrix)))
    return matrix, UNIT * size


def powers(matrix: Array, steps: int) -> Array:
    """Return the states (q, v/omega0) after 0, 1, ... steps from rest at START, until they exceed 1e100."""
    (a, b), (c, d) = matrix.tolist()
    q, v, states = START, 0.0, [(START, 0.0)]
    while len(states) <= steps and abs(q) + abs(v) < 1e100:
        q, v = a * q + b * v, c * q + d * v
        states.append((q, v))
    return np.array(states)


def absurd_from(states: Array) -> int | None:
    """Return the first step at which the energy residual of these states counts as divergence; None if there is none.

    Energies are in units of m g L.
    """
    energy = 0.5 * np.sum(states * states, axis=1)
    beyond = np.flatnonzero(beyond_sense(energy - energy[0], 1.0, energy[0], 0.0))
    return int(beyond[0]) if beyond.size else None


def _tuned_rule(z: float, steps: int, method: Method) -> frozenset[str]:
    """Return the allowed outcomes of a method in ``steps`` steps of ``z`` = omega0 h.

    Methods whose step is a 2 x 2 matrix must follow its powers, to the step at which they count as divergence. For
    others the rule follows from the spectral radius.
    """
    found = matrix_of(method, z)
    if found is not None:
        return frozenset({ACCURATE if absurd_from(powers(found[0], steps)) is None else DIVERGED})
    return growth_rule(growth(method, z, steps), STABLE)


def _tuned(z: float, steps: int, method: Method) -> Finding:
    """Judge a method by the powers of its own step's matrix, in steps of ``z`` = omega0 h.

    Near an eigenvalue -1 an error d of the matrix changes the eigenvalues by d/sqrt(|trace²/4 - 1|), at most by
    sqrt(d).
    """
    run = run_of(LINEAR, method, dt=z / LINEAR.omega0, steps=steps, angle=START, velocity=0.0)
    ended, found, count = stopped(run), matrix_of(method, z), len(run.time) - 1
    if found is None:
        if ended is not None:
            demand(in_time(method, z, count), f"it stopped after {count} steps, not when it has grown")
            return ended
        return bounded(*grown(method, z, run), "growth, bounded by the eigenvalues", CEILING)
    matrix, rounded = found
    states = powers(matrix, steps)
    last = absurd_from(states)
    if ended is not None:
        demand(last is not None and abs(count + 1 - last) <= 1, f"it stopped after {count} steps instead of {last}")
        return ended
    demand(last is None, f"it continues although its energy is absurd after {last} steps")
    apart = math.sqrt(abs(0.25 * float(np.trace(matrix)) ** 2 - 1.0))
    drift = rounded / max(apart, math.sqrt(rounded))
    envelope = np.maximum.accumulate(np.hypot(*states.T)) * (1.0 + 1.0 / max(apart, math.sqrt(rounded)))
    missed = np.hypot(run.angle - states[:, 0], run.velocity / LINEAR.omega0 - states[:, 1])
    allowed = 10.0 * drift * np.arange(1.0, steps + 2.0)
    return graded(missed / envelope / allowed, 1.0, "it differs from the powers of its own matrix",
                  size=1.0 / float(allowed[-1]), of="the largest motion until then")


# --- a drive at 2 omega0 for 100 000 periods ------------------------------------------------------------------------

CYCLES, PER_CYCLE = 100_000, 40
"""Periods of the drive, and steps in each; Omega = 2 omega0 = 2/s."""
STRIDE = math.pi / PER_CYCLE
"""Step [s], which is also omega0 h."""
PUSH, LOSS = 0.1, 0.2
"""Amplitude of the torque over m g L, and rate of the drag over omega0."""
FORCED = unit("a torque at 2 omega0", SmallAngleGravity(), LinearDrag(gamma=LOSS), PeriodicTorque(PUSH, 2.0),
              gravity=1.0)


def steady(time: Array) -> tuple[Array, Array]:
    """Return the exact angle and velocity of the forced oscillation after all transients."""
    answer = PUSH / complex(1.0 - 4.0, 2.0 * LOSS)
    wave = answer * np.exp(2.0j * time)
    return wave.real, (2.0j * wave).real


_BEGIN = [float(x) for x in steady(np.array(0.0))]
TWICE = Motion("a torque at 2 omega0 for 1e5 periods", FORCED, "a torque at 2 omega0 for 1e5 periods", _BEGIN[0],
               _BEGIN[1], 4.0 * math.pi, marks=16, largest=PUSH / 3.0, pace=2.0, most=64)
"""Four periods of the drive, whose error is predicted."""


def _forced(method: Method) -> Finding:
    """Judge a method by the forced oscillation under a torque at 2 omega0, after up to 100 000 periods.

    Errors of early steps decay in 2/LOSS, so that neither the amplitude nor the phase may become worse with time.
    """
    run = ran(FORCED, method, dt=STRIDE, steps=CYCLES * PER_CYCLE, every=4001, angle=0.0, velocity=0.0)
    late = run.time > 100.0 / LOSS
    angle, velocity = steady(run.time[late])
    size = float(np.max(np.abs(angle)))
    error = np.maximum(np.abs(run.angle[late] - angle), 0.5 * np.abs(run.velocity[late] - velocity)) / size
    grows = "" if np.max(np.abs(run.angle)) <= 4.0 * size else "it grows"
    return graded(error, order_bound(method, 2.0 * STRIDE, 4.0 / LOSS) + 1e-8, grows, of="the amplitude")


SHAKEN = 6e-5
"""Amplitude of the pivot over the length, and rate of growth over omega0, about."""
EXPONENT = 1.884955588973013394e-4
"""Logarithm of the growth of a small swing in a period of the pivot, to 16 digits; pi SHAKEN to first order."""
FAINT = 1e-12
"""Initial angle [rad]; it grows by exp(18.8) to 8e-5 rad."""
PARAMETRIC = unit("a pivot shaken at 2 omega0", Gravity(),
                  VerticalDrive(vertical_amplitude=SHAKEN, vertical_rate=2.0), gravity=1.0)


def detuned(method: Method) -> float:
    """Return a bound of the relative error of a method's frequency and rate of decay on the oscillator."""
    return 0.0 if method.exact else 2.0 * float(error_constant(method) * STRIDE**method.order)


def parametric_error(method: Method) -> float:
    """Return a bound of a method's relative error in the growth by a pivot shaken at 2 omega0.

    A frequency that is off by d omega0 changes the rate of growth from s to sqrt(s² - d²), and the phase by d/s; a
    method's own decay changes the rate by d.
    """
    off, time = detuned(method), CYCLES * math.pi
    own = off / SHAKEN + off * off / (2.0 * SHAKEN) * time + (0.0 if conserving(method) else off * time)
    return math.expm1(min(own, 700.0)) + 1e-4


def _parametric(method: Method) -> Finding:
    """Judge a method by the growth of a faint swing whose pivot is shaken at 2 omega0, over 100 000 periods.

    The growth is known after each period. Methods whose frequency is wrong by more than SHAKEN are out of resonance.
    """
    run = ran(PARAMETRIC, method, dt=STRIDE, steps=CYCLES * PER_CYCLE, every=100 * PER_CYCLE, angle=FAINT, velocity=0.0)
    periods = np.round(run.time / math.pi)
    truth = np.cosh(EXPONENT * periods) * (1.0 - 2.0 * (periods % 2.0))
    allowed, size = parametric_error(method), np.abs(run.angle) / FAINT
    if allowed <= LOOSE:
        return graded((run.angle / FAINT - truth) / np.abs(truth), allowed, "it grows at another rate", of="the growth")
    most = 4.0 * np.exp(np.minimum((SHAKEN + detuned(method)) * run.time, 700.0))
    return bounded(float(np.max(size / most)), 1.0, "its allowed error is not small, its growth bounded", OUT_OF_TUNE)


# --- the cases ------------------------------------------------------------------------------------------------------

POWERS = "the powers of the matrix of a step, whose determinant is 1 (Hairer, Lubich & Wanner 2006, I.5.2; McLachlan " \
         "& Gray 1997, Appl. Numer. Math. 25, 275)"
TUNED = (
    # omega0 h and the methods that are unstable there
    (3.1416, "sofroniou_spaletta10 and two Nyström splittings, whose trace/2 passes -1 by 7e-8 to 2e-7"),
    (3.12, "kahan_li8 and others, whose trace/2 passes -1 by 3e-4"),
    (3.166, "blanes_moan_srkn6b, whose trace/2 passes -1 by 3e-6"),
)
SOME, MANY = 1500, 100_000
"""Numbers of steps of short and long runs."""

CASES = (
    *(
        Case(f"omega0 h = {z:g}, steps of half a period", GROUP,
             f"A composition can be unstable in a narrow band far below its stability limit: {which}.",
             f"the powers of the step's own matrix over {SOME} steps. Stable: methods with a memory that grow no "
             "faster than their eigenvalues", POWERS, LINEAR, partial(_tuned_rule, z, SOME), partial(_tuned, z, SOME))
        for z, which in TUNED
    ),
    Case("omega0 h = 3.1416 for 1e5 steps", GROUP,
         "A growth of 4e-4 per step is hidden in few steps, but must be reported as divergence in many.",
         "the powers of the step's own matrix, to the step at which its energy is absurd", POWERS, LINEAR,
         partial(_tuned_rule, TUNED[0][0], MANY), partial(_tuned, TUNED[0][0], MANY), True),
    foreseen(GROUP, TWICE, "The phase of the drive must not lose digits, and no part of the motion may grow.",
             "the forced oscillation; the tolerance is (Omega h)^p 2 Omega/gamma of its amplitude, whatever the time; "
             "the error of the first periods is that of the formula",
             "the driven oscillator in closed form (Landau & Lifshitz 1976, section 26)",
             partial(then, partial(follows, TWICE), _forced), resolved, True),
    Case("a pivot shaken at 2 omega0 for 1e5 periods", GROUP,
         "A swing grows by parametric resonance only if the method's frequency is right to 6e-5.",
         "cosh(n mu) with Mathieu's exponent mu after n periods, if (omega0 h)^p is small enough; else no faster "
         "growth",
         "Mathieu's equation at a = 1 (Rayleigh 1883, Phil. Mag. 15, 229; Whittaker & Watson 1927, 19.4)", PARAMETRIC,
         known(parametric_error, LOOSE, STABLE, DIVERGED), _parametric, True),
)
