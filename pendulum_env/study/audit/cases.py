"""Cases of an audit: for each effect, the scene with it and the scene without it, and the simulated runs of both.

A run is a release at rest, with the measured period and amplitude of the swing and its sampled angles.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.polynomial.polynomial import polyval
from numpy.typing import NDArray

from pendulum_env.engine.kernels import Backend
from pendulum_env.engine.reading import arguments
from pendulum_env.engine.rollout import rollout
from pendulum_env.physics import exact
from pendulum_env.physics.effects import EFFECTS, Effect
from pendulum_env.physics.effects.effect import OSCILLATIONS
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, one_of, several


@dataclass(frozen=True)
class AuditCase:
    """Pair of scenes, with and without one effect, whose simulated runs are compared to judge the effect.

    Attributes:
        name: name of the effect.
        present: True if the audited scene has the effect.
        effect: the effect; None if its parameters cannot be computed from the scene's geometry and medium.
        scene, without: the two scenes that are compared, with and without the effect.
        replaced: effects that ``effect`` replaces in ``scene``, because they model the same
            phenomenon, for example drag.
        needed: True if nothing swings without the effect, or no valid scene is without it.
        control: constant control signal in the run of ``scene``, as a fraction of the motor's largest torque.
        note: remark on the comparison, printed in the audit's report.
        reason: why the effect cannot be simulated, else "".
    """

    name: str
    present: bool
    effect: Effect | None
    scene: Scene
    without: Scene
    replaced: tuple[Effect, ...] = ()
    needed: bool = False
    control: float = 0.0
    note: str = ""
    reason: str = ""


def cases(scene: Scene, only: Iterable[str] | None = None) -> list[AuditCase]:
    """Return the pairs of scenes to compare: one for each effect of the scene, then one for each effect not in it.

    ``only`` restricts the cases to the effects of these names. Raises SceneError for an unknown name.
    """
    known = {effect.name for effect in scene.effects} | set(EFFECTS)
    wanted = known if only is None else {
        one_of(name, "effect", known) for name in several(only, "effects", "names of effects")}
    here = [_present(scene, effect) for effect in scene.effects if effect.name in wanted]
    absent = [_absent(scene, kind) for name, kind in EFFECTS.items() if name in wanted and not scene.has(name)]
    return [*here, *absent]


def with_effect(scene: Scene, effect: Effect) -> Scene:
    """Return a scene with an effect added; it replaces other models of the same phenomenon, such as another drag law.

    Raises SceneError if the scene is not valid with the effect.
    """
    same = replaced_by(scene, effect)
    effects = [effect if other is same[0] else other for other in scene.effects if other not in same[1:]] if same else [
        *scene.effects, effect]
    return scene.with_effects(effects)


def without_effect(scene: Scene, effect: Effect | None) -> Scene:
    """Return a scene without one of its effects."""
    return scene.with_effects(other for other in scene.effects if other is not effect)


def bare(case: AuditCase) -> Scene:
    """Return ``case.scene`` without the effect of the case, or unchanged if no valid scene is without it."""
    try:
        return without_effect(case.scene, case.effect)
    except SceneError:
        return case.scene


def replaced_by(scene: Scene, effect: Effect) -> tuple[Effect, ...]:
    """Return the effects of a scene that model the same phenomenon as ``effect``, for example two laws of drag."""
    if not effect.models:
        return ()
    return tuple(other for other in scene.effects if other.models == effect.models and other.name != effect.name)


def _present(scene: Scene, effect: Effect) -> AuditCase:
    try:
        rest = without_effect(scene, effect)
    except SceneError as error:
        note = f"the scene is not valid without it: {error}".rstrip(".")
        return AuditCase(effect.name, True, effect, scene, scene, needed=True, note=note)
    if effect.kind == "conservative" and not rest.of_kind("conservative"):
        simpler = _simpler(scene, effect)
        note = "needed, as nothing swings without it"
        if simpler is None:
            return AuditCase(effect.name, True, effect, scene, scene, needed=True, note=note)
        other = with_effect(rest, simpler)
        note += f"; the changes in its row are those from {simpler.name} to {effect.name}"
        return AuditCase(effect.name, True, effect, scene, other, (simpler,), needed=True, note=note)
    if effect.controlled:
        still = "brakes" if effect.flow else "does nothing"
        note = f"at full control, towards the release side; without control it {still}"
        return AuditCase(effect.name, True, effect, scene, rest, control=1.0, note=note)
    return AuditCase(effect.name, True, effect, scene, rest)


def _simpler(scene: Scene, effect: Effect) -> Effect | None:
    """Return the next simpler model of the same phenomenon as ``effect``, or None.

    Only models with parameters that follow from the scene's geometry and medium are considered.
    """
    trials = [_trial(scene, kind) for kind in EFFECTS.values() if kind.detail < effect.detail]
    same = [trial for trial in trials if trial is not None and trial.models == effect.models]
    return max(same, key=lambda trial: trial.detail, default=None)


def _trial(scene: Scene, kind: type[Effect]) -> Effect | None:
    try:
        return kind.trial(scene)
    except SceneError:
        return None


def _absent(scene: Scene, kind: type[Effect]) -> AuditCase:
    empty = kind.needs_medium and scene.medium.empty
    effect = None if empty else _trial(scene, kind)
    if effect is None:
        reason = f"needs a medium, and the scene is in {scene.medium.name}" if empty else _numbers(kind)
        return AuditCase(kind.name, False, None, scene, scene, reason=reason)
    try:
        return AuditCase(kind.name, False, effect, with_effect(scene, effect), scene, replaced_by(scene, effect),
                         control=float(effect.controlled))
    except (SceneError, ArithmeticError) as error:
        return AuditCase(kind.name, False, None, scene, scene, reason=str(error))


def _numbers(kind: type[Effect]) -> str:
    found = [f for f in fields(kind) if "unit" in f.metadata and f.default != 0.0]  # type: ignore[arg-type]
    # Beside numbers with defaults, a number without one is an option, as the no-load speed of a motor.
    names = [f.name for f in found if f.default is not None] or [f.name for f in found]
    return f"needs {', '.join(names)}" if names else "the scene does not determine it"


Array = NDArray[np.float64]

METHOD = "rk4"
"""Integrator of all audits."""
POINTS = 6
"""Number of steps before a turning point whose polynomial locates it; points after it may lie beyond a jump."""
POWERS = np.arange(POINTS)
"""Powers in a polynomial through these points."""
COEFFICIENTS = np.linalg.inv(np.vander(np.arange(1.0 - POINTS, 1.0), increasing=True))
"""Matrix from the values at these points, a step apart and the last at 0, to the coefficients of the polynomial."""
SAMPLES = 128
"""Instants per period at which angles are compared, for every step."""


@dataclass(frozen=True)
class Swing:
    """Results measured on one simulated release from rest: period, amplitude, angles and others.

    Attributes:
        period: mean period of the first three oscillations [s]; nan if there are fewer.
        amplitude: size of the angle at the first turning point, on the side opposite to the release [rad]; nan if
            there is none.
        angle: angles at 128 instants per period [rad]; the instants do not depend on the step.
        speed: largest size of the velocity [rad/s].
        stop_reason: why the run ended early, else "".
        free: False if a force depends on time, on random numbers or on a control, so that the swing has no period.
    """

    period: float
    amplitude: float
    angle: Array
    speed: float
    stop_reason: str
    free: bool

    @property
    def swings(self) -> bool:
        """True if the swing's period and amplitude could be measured."""
        return math.isfinite(self.period) and math.isfinite(self.amplitude)


def time_scale(scene: Scene, amplitude: float) -> float:
    """Return the period [s] of a swing of ``amplitude`` [rad] without losses; 0 without a restoring torque."""
    if not (scene.of_kind("conservative") and scene.omega0):
        return 0.0
    return float(exact.period(amplitude, scene.omega0)) if scene.has("gravity") else 2.0 * math.pi / scene.omega0


def free(scene: Scene, control: float) -> bool:
    """Return True if no force in a scene depends on time, random numbers or a control, so that swings have a period.

    State variables of an effect's own change if it draws random numbers, as gusts do, or has a control that is not 0.
    """
    functions = (function for effect in scene.effects
                 for function in (effect.torque, effect.wind_x, effect.wind_y, effect.radial) if function)
    remembers = any(effect.memory and (effect.draws > 0 or control != 0.0) for effect in scene.effects)
    return not (remembers or any("time" in arguments(function) for function in functions))


def held_for(scene: Scene, steps: int) -> dict[str, Any]:
    """Return the keyword ``substeps`` for a rollout if an effect has state variables of its own, else an empty dict.

    Such effects are updated once per control step; the keyword keeps its length independent of the integration step.
    """
    return {"substeps": steps} if any(effect.memory for effect in scene.effects) else {}


def swing(
    scene: Scene, amplitude: float, period: float, steps: int, *, control: float = 0.0, backend: Backend = "auto"
) -> Swing:
    """Simulate a release at rest from ``amplitude`` [rad] for four times ``period`` [s], and measure the swing.

    ``steps``, a multiple of 128, is the number of steps of rk4 per period. ``control`` is the constant control signal.
    """
    every, undriven = steps // SAMPLES, free(scene, control)
    held: dict[str, Any] = {} if undriven else held_for(scene, every)
    run = rollout(
        scene, integrator=METHOD, angle=amplitude, velocity=0.0, dt=period / steps,
        duration=(OSCILLATIONS + 1) * period, every=1 if undriven else every, control=control, backend=backend,
        warn=False, **held,
    )
    whole = int(float(run.stop_time) / run.dt + 1e-6)  # a wire may go slack within a step
    turns = turning_points(*(one[: 1 + whole] for one in (run.time, run.angle, run.velocity))) if undriven else []
    last = 2 * OSCILLATIONS - 1
    samples = whole // every
    angle = run.angle[:: every if undriven else 1]
    return Swing(
        period=turns[last][0] / OSCILLATIONS if len(turns) > last else math.nan,
        amplitude=abs(turns[0][1]) if turns else math.nan,
        angle=angle[: 1 + min(samples, (OSCILLATIONS + 1) * SAMPLES)],
        speed=float(np.max(np.abs(run.velocity))),
        stop_reason=str(run.stop_reason),
        free=undriven,
    )


def turning_points(time: Array, angle: Array, velocity: Array) -> list[tuple[float, float]]:
    """Return time [s] and angle [rad] of each turning point after the start, interpolated between integration steps.

    The interpolation is of fifth order in the step. Times must be evenly spaced. Only states before the turning point
    are used, because with dry friction the acceleration jumps there.
    """
    before, after = velocity[:-1], velocity[1:]
    turns = []
    for i in np.flatnonzero((before != 0.0) & (before * after <= 0.0)):
        if i + 1 < POINTS:
            continue
        part = slice(i + 1 - POINTS, i + 1)
        speed, place = (COEFFICIENTS @ values[part] for values in (velocity, angle))
        slope = POWERS[1:] * speed[1:]
        x = float(before[i] / (before[i] - after[i]))
        for _ in range(6):
            x -= float(polyval(x, speed) / polyval(x, slope))
        turns.append((float(time[i] + x * (time[i + 1] - time[i])), float(polyval(x, place))))
    return turns
