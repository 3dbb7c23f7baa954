"""Where a fit begins: the start, the zero and the length as measured, the damping from the envelope."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pendulum_env.lab.fitting.model import ANGLE, GRAVITY, LENGTH, VELOCITY, ZERO, Model
from pendulum_env.lab.measures import period, small_amplitude_period, turning_points
from pendulum_env.lab.recording import Recording, RecordingError
from pendulum_env.physics.scene import Scene

Array = NDArray[np.float64]

SMALL = 1e-3
"""Loss per half swing at which the textbook's prediction is linear in an effect's number."""


def measured_start(model: Model, recording: Recording) -> Array:
    """Parameters of the model as they are measured on a free swing, ``recording.released()``.

    Raises RecordingError if there is not one whole oscillation.
    """
    swing = recording.centred()
    points = turning_points(swing)
    if len(points.amplitude) < 3:
        raise RecordingError(f"{recording.source}: a fit needs 3 turning points, found {len(points.amplitude)}")
    small = small_amplitude_period(period(swing), np.minimum(points.amplitude, 3.1)).value
    first = swing.time <= swing.time[0] + 0.125 * small
    slope = np.polyfit(swing.time[first], swing.angle[first], 1)[0] if np.count_nonzero(first) > 3 else 0.0
    given = {ANGLE: float(swing.angle[0]), VELOCITY: float(slope) if abs(slope) * small > 0.5 else 0.0,
             ZERO: float(np.median(recording.angle - swing.angle))}
    place = _with_period(model.scene, model.free, small)
    known = place.parameters()
    given |= {name: float(known[name] or 0.0) for name in model.free}
    given |= dict(zip(model.numbers, _decline(place, model.numbers, points.amplitude), strict=True))
    return np.array([given[name] for name in model.names])


def _with_period(scene: Scene, free: tuple[str, ...], period: float) -> Scene:
    """The scene with this small-angle period, as far as what is free can set it."""
    for _ in range(4):  # the length of a bob with a size of its own takes more than one
        ratio = (period * scene.omega0 / math.tau) ** 2
        for name, factor in ((LENGTH, ratio), (GRAVITY, 1.0 / ratio)):
            if name in free:
                scene = scene.replace(**{name: float(scene.parameters()[name]) * factor})  # type: ignore[arg-type]
                break
    return scene


def _decline(scene: Scene, names: tuple[str, ...], amplitude: Array) -> list[float]:
    """Each effect's number from the losses per half swing, sums of the effects' own, by non-negative least squares."""
    from scipy.optimize import nnls

    if not names:
        return []
    middle, losses = 0.5 * (amplitude[1:] + amplitude[:-1]), amplitude[:-1] - amplitude[1:]
    size = float(np.median(middle))
    columns, units = [], []
    for name in names:
        unit = small_number(scene, name, size)
        changed = scene.replace(**{name: unit})
        effect = next(effect for effect in changed.effects if effect.name == name.split(".")[0])
        columns.append([-effect.predicted(changed, float(a))[1] * float(a) for a in middle])
        units.append(unit)
    found, _ = nnls(np.array(columns).T, losses)
    return [max(float(x), 0.01) * unit for x, unit in zip(found, units, strict=True)]


def small_number(scene: Scene, name: str, amplitude: float) -> float:
    """The damping's number at which its effect takes the share SMALL of an amplitude [rad] in a half swing."""
    unit = 1.0
    for _ in range(4):
        changed = scene.replace(**{name: unit})
        effect = next(effect for effect in changed.effects if effect.name == name.split(".")[0])
        unit *= SMALL / -effect.predicted(changed, amplitude)[1]
    return unit
