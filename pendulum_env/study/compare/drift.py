"""Drift of a run from the reference solution in energy, amplitude and phase, and the time of a step."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators.analysis import leading_error
from integrators.steps.estimates import evaluations_tried, has_estimates
from pendulum_env.engine.machine import Machine
from pendulum_env.engine.rollout import Rollout
from pendulum_env.engine.timing import step_times

FloatArray = NDArray[np.float64]

SAMPLES = 4
"""Fewest samples per half swing from which a turning point can be measured."""
TIMED_STEPS = {True: 10_000, False: 200}
"""Number of steps of one timing, for compiled (True) and interpreted (False) machines."""
REPEATS = 7
"""Number of timings, of which the shortest counts."""
LEADING_ERROR = "leading error at small angles"
"""Title of the table column of the methods' leading error terms."""


def _column(csv: str, title: str, form: str = "", unit: str = "") -> Any:
    """Return a field of the drift table: its name in files, its title, the format of its numbers, and its unit."""
    return field(metadata={"csv": csv, "title": title, "form": form, "unit": unit})


@dataclass(frozen=True)
class Drift:
    """Row of the drift table: the errors and the speed of one run. Missing numbers are None, "-" in the table.

    Attributes:
        method: name of the method, with its treatment of drag where it has a special one.
        energy_end: energy residual over the initial energy, at the end of the run. The residual is the energy's
            change less work plus heat; without drives and dissipation it is the energy error.
        energy_most: largest size of the energy residual during the run, over the initial energy.
        amplitude: relative error of the last turning point, see :func:`amplitude_and_phase`.
        phase: error of the phase, computed minus exact, at the last zero crossing [rad]; positive if the run is ahead.
        recording: root mean square distance of the angle from the recording [rad].
        leading_error: leading error term of the method on the small-angle scene, "" if it is unknown.
        steps, rejected, evaluations: for adaptive runs, steps taken and rejected, and force evaluations of both.
        ns_per_step: time of a step with its energies [ns], without compilation, the shortest of several timings; for
            adaptive runs the time of a step taken, rejected steps included.
        stop: why and when the run stopped, "" if it ran to its end.
    """

    method: str = _column("method", "method")
    energy_end: float | None = _column("{energy}_end", "{energy}, end", "+.3g")
    energy_most: float | None = _column("{energy}_most", "at most", ".3g")
    amplitude: float | None = _column("amplitude_error", "amplitude error", "+.3g")
    phase: float | None = _column("phase_error_rad", "phase error [rad]", "+.3g", "rad")
    recording: float | None = _column("recording_rms_rad", "from recording, rms [rad]", ".3g", "rad")
    leading_error: str = _column("leading_error", LEADING_ERROR)
    steps: int | None = _column("steps", "steps")
    rejected: int | None = _column("rejected_steps", "rejected")
    evaluations: int | None = _column("force_evaluations", "evaluations")
    ns_per_step: float | None = _column("ns_per_step", "ns/step", ".0f", "ns")
    stop: str = _column("stop", "stopped")


ADAPTIVE = ("steps", "rejected", "evaluations")
"""Columns of the drift table that only adaptive runs have."""


def evaluations(run: Rollout) -> int | None:
    """Return the number of force evaluations of an adaptive run, rejected steps included.

    One evaluation at the start of each interval ``dt`` counts too. The result is None for runs with constant steps, and
    for runs that stopped early.
    """
    if not run.tolerance or run.stop_reason or not has_estimates(run.method):
        return None
    return round(float(run.stop_time) / run.dt) + int(run.steps + run.rejected) * evaluations_tried(run.method)


def energy_drift(run: Rollout) -> tuple[float | None, float | None]:
    """Return the energy residual over the initial energy: at the end, and its largest size during the run.

    Both are None for a start without energy.
    """
    initial = abs(float(run.energy[0]))
    if initial == 0.0:
        return None, None
    relative = run.energy_residual / initial
    return float(relative[-1]), float(np.max(np.abs(relative)))


def amplitude_and_phase(
    time: FloatArray, angle: FloatArray, true_angle: FloatArray
) -> tuple[float | None, float | None]:
    """Return the errors of amplitude (relative) and phase [rad] at the end of a run.

    Both are measured from the angle alone, as on a recording. Half swings are counted between zero crossings, each
    located by the cubic through four samples. With ``t_k`` the time of the run's k-th crossing, ``T_k`` the time of the
    reference solution's, and k the last crossing that both have::

        phase     = pi (T_k - t_k) / (T_k - T_(k-1))
        amplitude = |a_k| / |A_k| - 1

    with ``a_k``, ``A_k`` the turning points before it, each the crest of ``a cos(w t + p)`` through three samples.
    Reference and run are measured by the same formulas at the same times, so errors of the formulas cancel to first
    order. Phase differences of many turns are measured too, because crossings are matched by their number k.

    Both are None for less than one period, fewer than four samples per half swing, an unknown reference, or a motion
    that no longer swings through zero at its end (at rest, or rotating).

    Args:
        time: evenly spaced times [s].
        angle, true_angle: angles of the run and of the reference solution at these times [rad].
    """
    missing = (None, None)
    if len(time) < 2 * SAMPLES or not np.all(np.isfinite(true_angle)):
        return missing
    own, true = crossings(angle), crossings(true_angle)
    last = min(len(own), len(true)) - 1
    if last < 1:
        return missing
    swing, true_swing = own[last] - own[last - 1], true[last] - true[last - 1]
    end = len(time) - 1.0
    over = end - (own[-1] if len(own) <= len(true) else true[-1]) > 2.0 * max(swing, true_swing)
    if over or end < 2.0 * true_swing or min(swing, true_swing) < SAMPLES:
        return missing
    crest = _crest(angle, own[last - 1], own[last])
    true_crest = _crest(true_angle, true[last - 1], true[last])
    phase = math.pi * float(true[last] - own[last]) / float(true_swing)
    return (crest / true_crest - 1.0 if true_crest else None), phase


def crossings(angle: FloatArray) -> FloatArray:
    """Return where an angle crosses zero, as fractional sample indices: 2.5 is half-way between samples 2 and 3."""
    nonzero = np.flatnonzero(angle)
    changes = np.flatnonzero(np.signbit(angle[nonzero[:-1]]) != np.signbit(angle[nonzero[1:]]))
    first, after = nonzero[changes], nonzero[changes + 1]
    direct = after == first + 1
    padded = np.concatenate(([2.0 * angle[0] - angle[1]], angle, [2.0 * angle[-1] - angle[-2]]))
    y = [padded[first + shift] for shift in range(4)]
    linear = -y[0] / 3.0 - y[1] / 2.0 + y[2] - y[3] / 6.0
    square = y[0] / 2.0 - y[1] + y[2] / 2.0
    cube = (y[3] - y[0]) / 6.0 + (y[1] - y[2]) / 2.0
    with np.errstate(divide="ignore", invalid="ignore"):
        s = y[1] / (y[1] - y[2])
        for _ in range(6):
            value = y[1] + s * (linear + s * (square + s * cube))
            step = value / (linear + s * (2.0 * square + 3.0 * s * cube))
            s = np.clip(np.where(np.isfinite(step), s - step, s), 0.0, 1.0)
    return np.asarray(np.where(direct, first + s, 0.5 * (first + after)), dtype=np.float64)


def _crest(angle: FloatArray, start: float, end: float) -> float:
    """Return the largest |angle| between two zero crossings, given as fractional sample indices.

    The maximum is that of the cosine through the three samples around the largest one.
    """
    low, high = math.ceil(start), math.floor(end)
    top = low + int(np.argmax(np.abs(angle[low : high + 1])))
    if not 0 < top < len(angle) - 1:
        return abs(float(angle[top]))
    before, middle, after = (abs(float(x)) for x in angle[top - 1 : top + 2])
    cosine = (before + after) / (2.0 * middle)
    if not abs(cosine) < 1.0:
        return middle
    return math.hypot(middle, (after - before) / (2.0 * math.sqrt(1.0 - cosine * cosine)))


def row(
    run: Rollout, machine: Machine, true_angle: FloatArray, recorded: tuple[FloatArray, FloatArray] | None = None
) -> Drift:
    """Return the drift table's row of one run; ``recorded`` is (time [s], angle [rad]) of a recorded swing, if any."""
    regular = run.time[: len(true_angle)]
    if len(regular) > 2 and regular[-1] - regular[-2] < 0.999 * regular[1]:
        regular = regular[:-1]
    n = len(regular)
    amplitude, phase = amplitude_and_phase(regular, run.angle[:n], true_angle[:n])
    end, most = energy_drift(run)
    return Drift(
        method=machine.label,
        energy_end=end,
        energy_most=most,
        amplitude=amplitude,
        phase=phase,
        recording=None if recorded is None else _distance(run, *recorded),
        leading_error="" if run.method.python_functions else leading_error(run.method).text,
        steps=int(run.steps) if run.tolerance else None,
        rejected=int(run.rejected) if run.tolerance else None,
        evaluations=evaluations(run),
        ns_per_step=1e9 * step_times({"": machine}, float(run.angle[0]), float(run.velocity[0]), run.dt,
                                     TIMED_STEPS[machine.compiled], rounds=REPEATS)[""],
        stop=f"{run.stop_reason} at {run.time[-1]:.4g} s" if run.stop_reason else "",
    )


def _distance(run: Rollout, time: FloatArray, angle: FloatArray) -> float | None:
    """Return the root mean square difference [rad] between run and recording, over the time that both cover."""
    part = (time >= run.time[0]) & (time <= run.time[-1])
    if not part.any():
        return None
    return float(np.sqrt(np.mean((np.interp(time[part], run.time, run.angle) - angle[part]) ** 2)))
