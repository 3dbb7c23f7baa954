"""Where a fit begins: the start, the zero and the length as measured, the damping from the envelope."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pendulum_env.lab.fitting.model import ANGLE, GRAVITY, LENGTH, SCALE, VELOCITY, ZERO, Model
from pendulum_env.lab.losses import NEXT
from pendulum_env.lab.measures import crossings
from pendulum_env.lab.recording import Recording, RecordingError
from pendulum_env.lab.turning import CLEAR, TurningPoints, turning_points
from pendulum_env.physics import exact
from pendulum_env.physics.effects import Effect
from pendulum_env.physics.flow import swing_loss
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError

Array = NDArray[np.float64]

SEEN = 1e-3
"""Loss of amplitude per half swing at which a damping is just seen."""
MISSED = 0.1
"""Relative error of the period beyond which no length gives it: a ball has a shortest period."""
HIGHEST = 3.1
"""Amplitude that higher ones count as where the period is corrected for it [rad]."""


@dataclass(frozen=True, eq=False)
class Measured:
    """A free swing as measured, ``recording.released()``: what fits of any model begin with.

    Attributes:
        points: turning points about the equilibrium.
        period: at small amplitude [s].
        angle, velocity: at the first reading [rad, rad/s].
        zero: the equilibrium as the sensor shows it [rad].
    """

    points: TurningPoints
    period: float
    angle: float
    velocity: float
    zero: float

    @classmethod
    def of(cls, recording: Recording) -> Measured:
        """Raises RecordingError if there is not one whole oscillation with three turning points, and for a bob that
        goes over the top."""
        swing = recording.centred()
        if float(np.max(np.abs(swing.angle))) >= math.pi:
            raise RecordingError(f"{recording.source}: a fit needs swings below half a turn, these go over the top")
        points = turning_points(swing)
        if len(points.amplitude) < 3:
            raise RecordingError(f"{recording.source}: a fit needs 3 turning points, found {len(points.amplitude)}")
        small = small_period(swing, points)
        return cls(points, small, *_beginning(swing, small), float(np.median(recording.angle - swing.angle)))

    def start(self, model: Model) -> Array:
        """Parameters of a model."""
        given = {ANGLE: self.angle, VELOCITY: self.velocity, ZERO: self.zero, SCALE: 1.0}
        place = with_period(model.scene, model.free, self.period)
        known = place.parameters()
        given |= {name: float(known[name] or 0.0) for name in model.free if name not in given}
        given |= dict(zip(model.numbers, self._decline(place, model.numbers), strict=True))
        return np.array([given[name] for name in model.names])

    def _decline(self, scene: Scene, names: Sequence[str]) -> list[float]:
        """Each damping's number from the losses per half swing, sums of the dampings' own, by non-negative least
        squares; what dampings without a number take is taken off."""
        from scipy.optimize import nnls

        if not names:
            return []
        size, spans = self.points.amplitude, np.diff(self.points.time)
        whole = spans < NEXT * np.median(spans)
        middle, losses = 0.5 * (size[1:] + size[:-1])[whole], (size[:-1] - size[1:])[whole]
        for effect in scene.of_kind("dissipative"):
            if not effect.fitted:
                losses = losses - np.array([swing_loss(effect, scene, float(a)) * a for a in middle])
        units = visible(scene, names, float(np.median(middle)))
        columns = []
        for name, unit in zip(names, units, strict=True):
            seen = scene.replace(**{name: unit})
            columns.append([swing_loss(_owner(seen, name), seen, float(a)) * a for a in middle])
        found, _ = nnls(np.array(columns).T, losses)
        return [max(float(x), 0.01) * unit for x, unit in zip(found, units, strict=True)]


def small_period(swing: Recording, points: TurningPoints) -> float:
    """Period at small amplitude [s]: the median over the oscillations, each corrected for its own amplitude.

    A gap in the recording makes one oscillation too long, and does no harm. Raises RecordingError without one.
    """
    times = crossings(swing.time, swing.angle, level=CLEAR * swing.noise)
    if len(times) < 2:
        raise RecordingError(f"{swing.source}: a fit needs a whole oscillation, the recording has none")
    sizes = np.interp(0.5 * (times[1:] + times[:-1]), points.time, np.minimum(points.amplitude, HIGHEST))
    return float(np.median(np.diff(times) / exact.period(sizes, math.tau)))


def growth(points: TurningPoints) -> tuple[float, float]:
    """By what share of the largest swing one grew over an earlier one, by more than 5 standard errors, and when [s]; a
    share of 0 where none did.

    A swing is two turning points, so that a zero that is off does no harm.
    """
    if len(points.amplitude) < 3:
        return 0.0, 0.0
    size = points.amplitude[1:] + points.amplitude[:-1]
    error = np.hypot(points.error[1:], points.error[:-1])
    least = np.maximum.accumulate(np.where(size <= np.minimum.accumulate(size), np.arange(len(size)), 0))
    gain = size - size[least]
    clear = gain > 5.0 * np.hypot(error, error[least])
    at = int(np.argmax(np.where(clear, gain, 0.0)))
    return (float(gain[at] / size.max()), float(points.time[at])) if clear[at] else (0.0, 0.0)


def with_period(scene: Scene, free: Sequence[str], period: float) -> Scene:
    """The scene with this small-angle period, as far as what is free can set it; SceneError where no length can."""
    for _ in range(4):  # the length of a bob with a size of its own takes more than one
        ratio = (period * scene.omega0 / math.tau) ** 2
        for name, factor in ((LENGTH, ratio), (GRAVITY, 1.0 / ratio)):
            if name in free:
                scene = scene.replace(**{name: float(scene.parameters()[name]) * factor})  # type: ignore[arg-type]
                break
    if LENGTH in free and abs(period * scene.omega0 / math.tau - 1.0) > MISSED:
        size = f"of radius {scene.body.radius:g} m"
        raise SceneError(f"No length gives a bob {size} the recorded period of {period:.3g} s.")
    return scene


def visible(scene: Scene, names: Sequence[str], amplitude: float) -> list[float]:
    """Each damping's number at which it takes the share SEEN of the amplitude [rad] in a half swing."""
    found = []
    for name in names:
        unit = scene.replace(**{name: 1.0})
        found.append(SEEN / swing_loss(_owner(unit, name), unit, amplitude))
    return found


def _owner(scene: Scene, name: str) -> Effect:
    """The effect that a full name's parameter belongs to."""
    return next(effect for effect in scene.effects if effect.name == name.split(".")[0])


def _beginning(swing: Recording, period: float) -> tuple[float, float]:
    """Angle and velocity at the first reading, by a parabola through a fifth of a period; the velocity is 0 where it
    is not clear of the readings' noise."""
    near = swing.time - swing.time[0] <= 0.2 * period
    time, angle = swing.time[near] - swing.time[0], swing.angle[near]
    if len(time) < 5:
        return float(swing.angle[0]), 0.0
    basis = np.stack([np.ones_like(time), time, time * time], axis=1)
    found = np.linalg.lstsq(basis, angle, rcond=None)[0]
    error = swing.noise * math.sqrt(float(np.linalg.pinv(basis.T @ basis)[1, 1]))
    clear = abs(found[1]) > max(3.0 * error, 0.1 * abs(found[0]) * math.tau / period)
    return float(found[0]), float(found[1]) if clear else 0.0
