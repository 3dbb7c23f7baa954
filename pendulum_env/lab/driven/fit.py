"""Fit a pendulum with a motor to logs of driven runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pendulum_env.common.progress import Progress, telling_of
from pendulum_env.common.warn import warn
from pendulum_env.lab.checked import RecordingError
from pendulum_env.lab.driven.fitting import solve
from pendulum_env.lab.driven.log import DRIVES, DrivenLog
from pendulum_env.lab.driven.problem import BOUNDS
from pendulum_env.lab.driven.result import DrivenFit
from pendulum_env.lab.driven.start import LAGS, TRIES
from pendulum_env.lab.driven.windows import DELAY, DRIVE, LAG, RATES, STIFFNESS
from pendulum_env.physics.units import SceneError, number, one_of, several, shown

EARLY = tuple(-share for share in TRIES[1:])


def fit_driven(
    logs: DrivenLog | Sequence[DrivenLog],
    *,
    inertia: float | None = None,
    moment: float | None = None,
    mass: float | None = None,
    gravity: float = 9.81,
    max_torque: float | None = None,
    hold: Mapping[str, float] | None = None,
    progress: Progress | bool | None = None,
) -> DrivenFit:
    """Fit a pendulum and its motor to one or several logs of driven runs, by least squares of simulated motions.

    The model is ``I theta'' = -M g sin(theta - zero) - b theta' - F sign(theta') + K u``, with friction that also
    sticks; u is the drive of the log, held between readings, later by ``delay`` and smoothed by ``lag``. The motion is
    simulated by the package's engine in windows of half a swing or more, each with its own start, so that errors cannot
    grow near the top. Windows whose motion the drive cannot explain, for example because a hand pushes, are left out
    and listed.

    Args:
        logs: a log or several, with the same kind of drive, of one pendulum with one sensor.
        inertia, moment, mass: the moment of inertia I [kg m²], the moment M of the mass [kg m], or the mass of a bob
            that counts as a point [kg]; give one of them to set the scale of all torques. Without one, torques in N m
            set the scale, and for actions and currents a mass of 1 kg is assumed.
        gravity: gravity [m/s²].
        max_torque: largest torque of the motor of the resulting scene [N m]; by default the largest torque in the
            logs, for actions the torque at action 1.
        hold: values of numbers that are not fitted, such as ``{"viscous": 0.0, "delay": 0.01}``: numbers of the
            equation ``theta'' = -stiffness sin(theta - zero) - viscous theta' - dry sign(theta') + drive u``, which are
            torques per moment of inertia, and "delay" or "lag" [s]. By default all are fitted, but the lag of measured
            torques and currents is 0.
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
        raise SceneError(f"Give one of inertia, moment and mass, not {' and '.join(given)}; the fit gives the others.")
    known, value = next(iter(given.items()), ("torque", 1.0) if kind == "torque" else ("", 1.0))
    g = number(gravity, "gravity", above=0.0)
    peak = None if max_torque is None else number(max_torque, "max_torque", above=0.0)
    if hold is not None and not isinstance(hold, Mapping):
        raise SceneError(f"hold must be a dict of numbers, as {{'viscous': 0.0}}, not {shown(hold)}.")
    measured = DRIVES[kind].measured
    fixed = {LAG: 0.0} if measured else {}
    for name, number_held in (hold or {}).items():
        place = RATES.index(one_of(name, "hold", RATES))
        fixed[place] = number(number_held, f"hold[{name!r}]", least=0.0 if place in BOUNDS[kind] else None,
                              above=0.0 if place in (STIFFNESS, DRIVE) else None)
    places = tuple(place for place in range(len(RATES)) if place not in fixed)
    if not places:
        raise SceneError("hold leaves nothing to fit; leave one of its numbers out.")
    delays = (fixed[DELAY],) if DELAY in fixed else (*EARLY, *TRIES) if measured else TRIES
    lags = (fixed[LAG],) if LAG in fixed else LAGS
    with telling_of(progress, "fit") as telling:
        try:
            solution = solve(several_logs, places, fixed, delays, lags, telling)
        except RecordingError as error:
            raise RecordingError(f"{error}{_other_unit(several_logs)}") from None
    result = DrivenFit(several_logs, solution, g, known, value, peak)
    if not result.grade.usable:
        warn(result.grade.text)
    if not known:
        warn("A mass of 1 kg is assumed, as the motion shows torques only per moment of inertia; give mass=, inertia= "
             "or moment=.")
    return result


def _other_unit(logs: Sequence[DrivenLog]) -> str:
    """Return a clause that names the other unit of the angles if the unit of a log was inferred from them, else ""."""
    for unit, other in (("deg", "rad"), ("rad", "deg")):
        if any(note.startswith(f"unit: {unit}, inferred") for log in logs for note in log.notes):
            return f'; the angle is read in {unit}, which was inferred: give unit="{other}" if it is in {other}'
    return ""
