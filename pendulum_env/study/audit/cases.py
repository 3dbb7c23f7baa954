"""Cases of an audit: for each effect, the scene with it and the scene without it, whose simulated runs are compared."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields

from pendulum_env.physics.effects import EFFECTS, Effect
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
        note = "without it nothing swings"
        if simpler is None:
            return AuditCase(effect.name, True, effect, scene, scene, needed=True, note=note)
        other = with_effect(rest, simpler)
        note += f"; compared with {simpler.name} in its place"
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
