"""Fit a pendulum with a motor to logs of driven runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from pendulum_env.common.progress import Progress, telling_of
from pendulum_env.common.warn import warn
from pendulum_env.lab.checked import RecordingError
from pendulum_env.lab.driven.fitting import BOUNDS, solve
from pendulum_env.lab.driven.log import DRIVES, DrivenLog
from pendulum_env.lab.driven.result import DrivenFit
from pendulum_env.lab.driven.start import LAGS, TRIES
from pendulum_env.lab.driven.windows import DELAY, DRY, LAG, VISCOUS, ZERO
from pendulum_env.physics.units import SceneError, nearest, number, several, shown

FREE = {"bearing_viscosity": VISCOUS, "friction_torque": DRY, "delay": DELAY, "lag": LAG, "zero": ZERO}
"""Parameters that can be fitted beside the period and the motor -> their number of the equation of motion."""
USUAL = {"action": tuple(FREE), "torque": tuple(name for name in FREE if name != "lag"),
         "current": tuple(name for name in FREE if name != "lag")}
"""Kind of drive -> parameters that are fitted by default. What lags is the torque behind a command."""
EARLY = tuple(-share for share in TRIES[1:])


def fit_driven(
    logs: DrivenLog | Sequence[DrivenLog],
    *,
    inertia: float | None = None,
    moment: float | None = None,
    mass: float | None = None,
    gravity: float = 9.81,
    max_torque: float | None = None,
    free: Sequence[str] | None = None,
    delay: float = 0.0,
    lag: float = 0.0,
    progress: Progress | bool | None = None,
) -> DrivenFit:
    """Fit a pendulum and its motor to one or several logs of driven runs, by least squares of simulated motions.

    The model is ``I theta'' = -M g sin(theta - zero) - b theta' - F sign(theta') + K u``, with friction that also
    sticks; u is the drive of the log, held between readings, later by ``delay`` and smoothed by ``lag``. The motion is
    simulated by the package's engine in windows of half a swing or more, each with its own start, so that errors cannot
    grow near the top. Windows whose motion the drive cannot explain, as of a hand that pushes, are left out and named.

    Args:
        logs: a log or several, with the same kind of drive, of one pendulum with one sensor.
        inertia, moment, mass: the moment of inertia I [kg m²], the moment M of the mass [kg m], or the mass of a bob
            that counts as a point [kg]; give one of them to set the scale of all torques. Without one, torques in N m
            set the scale, and for actions and currents a mass of 1 kg is assumed.
        gravity: gravity [m/s²].
        max_torque: largest torque of the motor of the resulting scene [N m]; by default the largest one of the logs, or
            that of action 1.
        free: parameters to fit besides period and motor: any of "bearing_viscosity" (b), "friction_torque" (F),
            "delay", "lag" and "zero"; by default all, for measured torques and currents without the lag.
        delay, lag: values of the delay and the lag where they are not fitted [s].
        progress: True shows a progress bar, False none; a function is called with the fraction done and a text.

    Returns a DrivenFit. Warns if the fit is not usable, and if a mass is assumed. Raises RecordingError for logs that
    do not determine the parameters, with the reason, and SceneError for invalid values.
    """
    several_logs = (logs,) if isinstance(logs, DrivenLog) else tuple(several(logs, "logs", "logs"))
    if not several_logs or not all(isinstance(log, DrivenLog) for log in several_logs):
        raise RecordingError(f"logs must be one or several DrivenLogs, as from DrivenLog.read, got {shown(logs)}")
    kinds = list(dict.fromkeys(log.kind for log in several_logs))
    if len(kinds) > 1:
        raise RecordingError(f"logs must have one kind of drive, got {' and '.join(kinds)}")
    kind = kinds[0]
    given: dict[str, Any] = {name: number(value, name, above=0.0) for name, value in (
        ("inertia", inertia), ("moment", moment), ("mass", mass)) if value is not None}
    if len(given) > 1:
        raise SceneError(f"Give one of inertia, moment and mass, not {' and '.join(given)}: the motion shows the others.")
    known, value = next(iter(given.items()), ("torque", 1.0) if kind == "torque" else ("", 1.0))
    g = number(gravity, "gravity", above=0.0)
    peak = None if max_torque is None else number(max_torque, "max_torque", above=0.0)
    names = USUAL[kind] if free is None else tuple(several(free, "free", "names"))
    for name in names:
        if name not in FREE:
            raise SceneError(f"free has {shown(name)}, which is no parameter of a driven log{nearest(name, FREE)}")
    places = (0, *sorted({FREE[name] for name in names} | {3}))
    held = {DELAY: number(delay, "delay"), LAG: number(lag, "lag", least=0.0)}
    fixed = {place: held.get(place, 0.0) for place in FREE.values() if place not in places}
    measured = DELAY not in BOUNDS[kind]
    delays = (*EARLY, *TRIES) if measured and DELAY in places else TRIES if DELAY in places else (0.0,)
    lags = LAGS if LAG in places else (0.0,)
    with telling_of(progress, "fit") as telling:
        solution = solve(several_logs, places, fixed, delays, lags, telling)
    result = DrivenFit(several_logs, solution, g, known, value, peak)
    if not result.grade.usable:
        warn(result.grade.text)
    if not known:
        warn("A mass of 1 kg is assumed, as the motion shows torques only per moment of inertia; give mass=, inertia= "
             "or moment=.")
    errors = np.sqrt(np.diag(solution.covariance))
    assert np.isfinite(errors).all() or math.isnan(errors.sum())
    return result


__all__ = ["DRIVES", "fit_driven"]
