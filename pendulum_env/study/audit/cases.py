"""How each effect of the registry is judged in a scene: which two scenes are compared, or why it cannot be."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields

from pendulum_env.physics.effects import EFFECTS, Effect
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, one_of, several


@dataclass(frozen=True)
class Case:
    """One question.

    Attributes:
        name: of the effect.
        present: True if the scene has it.
        effect: itself; None where nothing determines it.
        scene, without: what is compared.
        replaced: effects in whose place ``scene`` has it, models of the same thing.
        needed: True if nothing swings without it, or there is no such scene.
        control: share of the motor's torque in ``scene``.
        note: what the comparison means.
        reason: why there is none, or "".
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


def cases(scene: Scene, only: Iterable[str] | None = None) -> list[Case]:
    """One case for each effect of the scene, then for each of the registry that it leaves out.

    ``only`` names those that are wanted; SceneError for a name that is not in the registry.
    """
    known = {effect.name for effect in scene.effects} | set(EFFECTS)
    wanted = known if only is None else {
        one_of(name, "effect", known) for name in several(only, "effects", "names of effects")}
    here = [_present(scene, effect) for effect in scene.effects if effect.name in wanted]
    absent = [_absent(scene, kind) for name, kind in EFFECTS.items() if name in wanted and not scene.has(name)]
    return [*here, *absent]


def with_effect(scene: Scene, effect: Effect) -> Scene:
    """The scene with one more effect, in place of those that model the same thing; SceneError if that cannot be."""
    same = replaced_by(scene, effect)
    kept = [effect if other is same[0] else other for other in scene.effects if other not in same[1:]] if same else [
        *scene.effects, effect]
    return scene.with_effects(kept)


def without_effect(scene: Scene, effect: Effect | None) -> Scene:
    """The scene without one of its effects."""
    return scene.with_effects(other for other in scene.effects if other is not effect)


def bare(case: Case) -> Scene:
    """The case's scene without its effect; the scene itself where it cannot be without, which costs nothing."""
    try:
        return without_effect(case.scene, case.effect)
    except SceneError:
        return case.scene


def replaced_by(scene: Scene, effect: Effect) -> tuple[Effect, ...]:
    """The scene's effects that model the same thing as this one."""
    if not effect.models:
        return ()
    return tuple(other for other in scene.effects if other.models == effect.models and other.name != effect.name)


def _present(scene: Scene, effect: Effect) -> Case:
    try:
        rest = without_effect(scene, effect)
    except SceneError as error:
        note = f"without it the scene cannot be: {error}".rstrip(".")
        return Case(effect.name, True, effect, scene, scene, needed=True, note=note)
    if effect.kind == "conservative" and not rest.of_kind("conservative"):
        simpler = _simpler(scene, effect)
        note = "without it nothing swings"
        if simpler is None:
            return Case(effect.name, True, effect, scene, scene, needed=True, note=note)
        other = with_effect(rest, simpler)
        note += f"; compared with {simpler.name} in its place"
        return Case(effect.name, True, effect, scene, other, (simpler,), needed=True, note=note)
    if effect.controlled:
        note = "at full control, towards the release side; without control it does nothing"
        return Case(effect.name, True, effect, scene, rest, control=1.0, note=note)
    return Case(effect.name, True, effect, scene, rest)


def _simpler(scene: Scene, effect: Effect) -> Effect | None:
    """The next simpler model of the same thing that geometry and medium determine."""
    trials = [_trial(scene, kind) for kind in EFFECTS.values() if kind.detail < effect.detail]
    same = [trial for trial in trials if trial is not None and trial.models == effect.models]
    return max(same, key=lambda trial: trial.detail, default=None)


def _trial(scene: Scene, kind: type[Effect]) -> Effect | None:
    try:
        return kind.trial(scene)
    except SceneError:
        return None


def _absent(scene: Scene, kind: type[Effect]) -> Case:
    reason = ""
    effect = None if kind.needs_medium and scene.medium.empty else _trial(scene, kind)
    if effect is not None:
        try:
            place, same = with_effect(scene, effect), replaced_by(scene, effect)
            return Case(kind.name, False, effect, place, scene, same, control=float(effect.controlled))
        except (SceneError, ArithmeticError) as error:
            reason = str(error)
    elif kind.needs_medium and scene.medium.empty:
        reason = f"there is none in {scene.medium.name}"
    else:
        reason = _numbers(kind)
    return Case(kind.name, False, None, scene, scene, reason=reason)


def _numbers(kind: type[Effect]) -> str:
    names = [f.name for f in fields(kind) if "unit" in f.metadata and f.default != 0.0]  # type: ignore[arg-type]
    return f"needs {', '.join(names)}" if names else "nothing here determines it"
