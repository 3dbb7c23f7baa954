"""Starting values of a fit, from the recording alone.

They are the first angle and velocity, the sensor's zero, the length from the period, and the damping from the envelope.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pendulum_env.lab.checked import check_half_turn
from pendulum_env.lab.fitting.model import ANGLE, DISTANCE, GRAVITY, LENGTH, SCALE, SENSOR, TILT, VELOCITY, ZERO, Model
from pendulum_env.lab.measures import NEXT, crossings
from pendulum_env.lab.recording import Recording, RecordingError
from pendulum_env.lab.turning import CLEAR, TurningPoints, turning_points
from pendulum_env.physics import exact
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import Effect
from pendulum_env.physics.flow import swing_loss
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError

Array = NDArray[np.float64]

SEEN = 1e-3
"""Relative loss of amplitude per half swing at which a damping is just visible."""
MISSED = 0.1
"""Relative error of the period above which no length is accepted; a ball of finite size has a shortest period."""
SEARCHED = tuple(step**sign for step in (1.02, 1.1, 1.3, 2.0, 5.0, 30.0) for sign in (1, -1))
"""Factors up to which a parameter that gives the recorded period is searched, one after the other."""
SHORTEST = 1e-3
"""Shortest length in units of the bob's radius; a ball hung so near its centre swings far slower than at any longer."""
HIGHEST = 3.1
"""Upper limit of the amplitudes with which periods are corrected to small amplitude [rad]."""


@dataclass(frozen=True, eq=False)
class Measured:
    """Quantities measured on a free swing, ``recording.released()``, that give the starting values of any fit.

    Attributes:
        points: turning points about the equilibrium.
        period: period at small amplitude [s].
        angle, velocity: angle and velocity at the first reading [rad, rad/s].
        zero: reading of the sensor at the equilibrium [rad].
        bias: reading of a gyroscope at rest [rad/s]; 0 for other sensors.
    """

    points: TurningPoints
    period: float
    angle: float
    velocity: float
    zero: float
    bias: float = 0.0

    @classmethod
    def of(cls, recording: Recording) -> Measured:
        """Measure the turning points, the period, the first angle and velocity, and the sensor's zero of a recorded
        free swing.

        Raises RecordingError unless there is one full oscillation with three turning points, and if the bob goes over
        the top.
        """
        swing = recording.centred()
        check_half_turn(swing.angle, f"{recording.source}: a fit needs")
        points = turning_points(swing)
        if len(points.amplitude) < 3:
            raise RecordingError(f"{recording.source}: a fit needs 3 turning points, found {len(points.amplitude)}")
        small = small_period(swing, points)
        bias = 0.0 if swing.rate is None else float(np.mean(swing.rate - np.gradient(swing.angle, swing.time)))
        return cls(points, small, *_beginning(swing, small), float(np.median(recording.angle - swing.angle)), bias)

    def start(self, model: Model) -> Array:
        """Return the starting values of a model's parameters for a fit, in the order of ``model.names``."""
        zero = self.zero if not model.rate and model.mount is None else self.bias
        given = {ANGLE: self.angle, VELOCITY: self.velocity, ZERO: zero, SCALE: 1.0}
        place = with_period(model.scene, model.free, self.period)
        if model.mount is not None:
            given[TILT] = model.mount.tilt
            given[DISTANCE] = model.mount.ratio * place.gravity / place.omega0**2
        known = place.parameters()
        given |= {name: float(known[name] or 0.0) for name in model.free if name not in given}
        given |= dict(zip(model.numbers, self._decline(place, model.numbers), strict=True))
        return np.array([given[name] for name in model.names])

    def _decline(self, scene: Scene, names: Sequence[str]) -> list[float]:
        """Estimate the damping parameters from the amplitude losses per half swing, by non-negative least squares.

        The losses due to dampings without a fitted parameter are subtracted first.
        """
        from scipy.optimize import nnls

        if not names:
            return []
        size, spans = self.points.amplitude, np.diff(self.points.time)
        single = spans < NEXT * np.median(spans)
        middle, losses = 0.5 * (size[1:] + size[:-1])[single], (size[:-1] - size[1:])[single]
        for effect in scene.of_kind("dissipative"):
            if not effect.fitted:
                losses = losses - np.array([swing_loss(effect, scene, float(a)) * a for a in middle])
        units = visible(scene, names, float(np.median(middle)))
        columns = []
        for name, unit in zip(names, units, strict=True):
            seen = scene.replace(**{name: unit})
            columns.append([swing_loss(_owner(seen, name), seen, float(a)) * a for a in middle])
        multiples, _ = nnls(np.array(columns).T, losses)
        return [max(float(x), 0.01) * unit for x, unit in zip(multiples, units, strict=True)]


def small_period(swing: Recording, points: TurningPoints) -> float:
    """Return the period at small amplitude [s], the median of the oscillations' periods corrected for amplitude.

    A gap in the recording makes one oscillation too long, which hardly changes the median. Raises RecordingError if
    there is no full oscillation.
    """
    times = crossings(swing.time, swing.angle, level=CLEAR * swing.noise)
    if len(times) < 2:
        raise RecordingError(f"{swing.source}: a fit needs a full oscillation, the recording has none")
    sizes = np.interp(0.5 * (times[1:] + times[:-1]), points.time, np.minimum(points.amplitude, HIGHEST))
    return float(np.median(np.diff(times) / exact.period(sizes, math.tau)))


def with_period(scene: Scene, free: Sequence[str], period: float) -> Scene:
    """Return the scene with the length or the gravity, if it is in ``free``, adjusted to a small-angle period [s].

    Of other bodies than a bob, the first parameter in ``free`` that changes the period is adjusted. Raises SceneError
    if no length of a bob gives the period.
    """
    if not isinstance(scene.body, Body):
        return _tuned(scene, [name for name in free if name not in SENSOR], period)
    bob = f"a bob of radius {scene.body.radius:g} m"
    fault = SceneError(f"No length gives {bob} the recorded period of {period:.3g} s.")
    for _ in range(4):  # the period of a bob of finite size is not proportional to sqrt(length), so this iterates
        ratio = (period * scene.omega0 / math.tau) ** 2
        for name, factor in ((LENGTH, ratio), (GRAVITY, 1.0 / ratio)):
            if name in free:
                value = float(scene.parameters()[name]) * factor  # type: ignore[arg-type]
                if name == LENGTH and value < SHORTEST * scene.body.radius:
                    raise fault
                scene = scene.replace(**{name: value})
                break
    if LENGTH in free and abs(period * scene.omega0 / math.tau - 1.0) > MISSED:
        raise fault
    return scene


def _tuned(scene: Scene, names: Sequence[str], period: float) -> Scene:
    """Return the scene with the first named parameter that can give it a period [s]; unchanged if none can.

    Values are searched outwards from the scene's own, up to 30 times as large or small.
    """
    from scipy.optimize import brentq

    def excess(factor: float, name: str) -> float:
        try:
            return period * tuned(name, factor).omega0 / math.tau - 1.0
        except SceneError:
            return math.nan

    def tuned(name: str, factor: float) -> Scene:
        return scene.replace(**{name: float(scene.parameters()[name]) * factor})  # type: ignore[arg-type]

    for name in names:
        for step in SEARCHED:
            if excess(1.0, name) * excess(step, name) <= 0.0:
                return tuned(name, brentq(excess, 1.0, step, (name,), xtol=1e-15))
    return scene


def visible(scene: Scene, names: Sequence[str], amplitude: float) -> list[float]:
    """Return the value of every named damping parameter at which the damping is just visible.

    A half swing of the given amplitude [rad] then loses a thousandth (SEEN) of it.
    """
    values = []
    for name in names:
        unit = scene.replace(**{name: 1.0})
        values.append(SEEN / swing_loss(_owner(unit, name), unit, amplitude))
    return values


def _owner(scene: Scene, name: str) -> Effect:
    """Return the effect of a scene that a parameter with the full name "effect.parameter" belongs to."""
    return next(effect for effect in scene.effects if effect.name == name.split(".")[0])


def _beginning(swing: Recording, period: float) -> tuple[float, float]:
    """Return angle and velocity at the first reading, from a parabola fitted to a fifth of a period.

    The velocity is 0 unless it is well above the noise of the readings.
    """
    near = swing.time - swing.time[0] <= 0.2 * period
    time, angle = swing.time[near] - swing.time[0], swing.angle[near]
    if len(time) < 5:
        return float(swing.angle[0]), 0.0
    basis = np.stack([np.ones_like(time), time, time * time], axis=1)
    coefficients = np.linalg.lstsq(basis, angle, rcond=None)[0]
    error = swing.noise * math.sqrt(float(np.linalg.pinv(basis.T @ basis)[1, 1]))
    clear = abs(coefficients[1]) > max(3.0 * error, 0.1 * abs(coefficients[0]) * math.tau / period)
    return float(coefficients[0]), float(coefficients[1]) if clear else 0.0
