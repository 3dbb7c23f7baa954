"""How much of a policy's return is lost on a real pendulum, and which difference from the simulated one costs how much.

The real pendulum is an environment, too: parameters from a fit, another integrator, a sensor, delays. The two
environments run the same policy from the same seeds. Each difference between them is then tried by itself.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.progress import Progress, told_by, with_bar
from pendulum_env.common.results import Plotted, one_line
from pendulum_env.common.texts import Table
from pendulum_env.engine.random_streams import MOST_SEED
from pendulum_env.envs.limits import REGISTERED, checked_steps
from pendulum_env.envs.settings import MOST_ENVS
from pendulum_env.envs.vector_env import LabPendulumVectorEnv
from pendulum_env.physics.body import RigidBody
from pendulum_env.physics.effects import Effect
from pendulum_env.physics.presets import find_scene
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, shown, whole_number
from pendulum_env.tasks import USUAL_TASK, find_task

Array = NDArray[np.float64]
Keywords = dict[str, Any]

NUMERICS = ("integrator", "substeps", "accuracy", "compensated")
"""Keywords of method and step, which are one difference."""
ALIKE = ("task", "reward_rate", "duration", "max_episode_steps", "speed_penalty")
"""Keywords that decide what an episode's return means; both environments must share them."""
PRIVATE = ("num_envs", "autoreset_mode", "render_mode", "copy")
"""Keywords that the comparison sets by itself."""
SILENT = ("diagnostics", "num_threads", "backend", "warn", "careful", "render_size", "render_theme", "render_panels")
"""Keywords that change no return."""
PARTS = ("gravity", "medium", "body")
"""Parts of a scene beside its effects."""
WIDEST = 30
"""Largest number of characters of a value in a table."""


class Mean(NamedTuple):
    """A mean over episodes with its standard error."""

    value: float
    error: float

    def __str__(self) -> str:
        return f"{self.value:.4g} ± {self.error:.2g}"


def mean(values: Array) -> Mean:
    """Return the mean of values, one for each episode, and its standard error s/sqrt(n)."""
    return Mean(float(values.mean()), float(values.std(ddof=1) / np.sqrt(len(values))))


@dataclass(frozen=True, eq=False, repr=False)
class Difference:
    """One difference between the nominal and the real environment, and the returns where only it is changed.

    Attributes:
        name: keyword or parameter, such as "action_delay" or "body.length".
        values: its value in the nominal and in the real environment, as text; "-" where there is none.
        alone: returns in the nominal environment with the real value; None if there is no such environment.
        undone: returns in the real environment with the nominal value; None if there is no such environment.
        note: why an environment does not exist, or what else had to be changed.
    """

    name: str
    values: tuple[str, str]
    alone: Array | None
    undone: Array | None
    note: str = ""

    def __repr__(self) -> str:
        return one_line(self, f"{self.name}: {' -> '.join(self.values)}")


@dataclass(frozen=True, eq=False, repr=False)
class Transfer(Plotted):
    """Returns of a policy in a nominal and in a real environment, and what each difference between them costs.

    Attributes:
        nominal, real: returns of the episodes, arrays; episode i has the same seed in both.
        differences: what is different, the most expensive difference first.
    """

    nominal: Array
    real: Array
    differences: tuple[Difference, ...]

    def __repr__(self) -> str:
        return one_line(self, f"{mean(self.nominal)} -> {mean(self.real)} in {len(self.real)} episodes")

    @property
    def gap(self) -> Mean:
        """Mean change of the return from the nominal to the real environment, below 0 if the real one earns less."""
        return mean(self.real - self.nominal)

    def cost(self, name: str) -> Mean | None:
        """Return the change of the nominal return by one difference alone; None if it cannot be tried alone.

        Raises SceneError for a name that is not among the differences.
        """
        one = next((one for one in self.differences if one.name == name), None)
        if one is None:
            raise SceneError(f"There is no difference {shown(name)}; there are "
                             f"{', '.join(one.name for one in self.differences) or 'none'}.")
        return self.changes(one)[0]

    @property
    def table(self) -> Table:
        """Table of the differences: both values, and the change of the return by each of them, alone and beside all
        others.
        """
        rows = []
        for one in self.differences:
            told = ("-" if change is None else str(change) for change in self.changes(one))
            rows.append((one.name, *one.values, *told))
        return Table(("difference", "nominal", "real", "change alone", "change beside the others"), tuple(rows))

    def changes(self, one: Difference) -> tuple[Mean | None, Mean | None]:
        """Return the mean change of the return by a difference: alone, in the nominal environment, and beside all
        others, in the real one. None where it was not tried.
        """
        return (None if one.alone is None else mean(one.alone - self.nominal),
                None if one.undone is None else mean(self.real - one.undone))

    @property
    def text(self) -> str:
        """Sentences on the returns, on the largest cost and on what could not be tried."""
        lines = [f"The return is {mean(self.nominal)} in the nominal environment and {mean(self.real)} in the real "
                 f"one, in {len(self.real)} episodes with the same seeds: a change of {self.gap}."]
        tried = [(one.name, change) for one in self.differences if (change := self.cost(one.name)) is not None]
        if tried and tried[0][1].value < -2.0 * tried[0][1].error:
            lines.append(f"Of all differences alone, {tried[0][0]} costs most: {tried[0][1]}.")
        elif tried:
            lines.append("No difference alone costs more than two standard errors.")
        lines += [f"{one.name}: {one.note}" for one in self.differences if one.note]
        return "\n".join(lines)

    def __str__(self) -> str:
        return self.text


@with_bar("transfer")
def transfer(
    policy: Any, nominal: Mapping[str, Any], real: Mapping[str, Any], episodes: int = 200, seed: int = 0,
    progress: Progress | bool | None = None,
) -> Transfer:
    """Compare a policy's return in a nominal and in a "real" environment, and try each difference between them alone.

    Every environment runs ``episodes`` episodes with the seeds ``seed``, ``seed + 1``, ...; only their differences are
    different. Each difference is tried twice: as the only one, and as the only one that is undone. Scenes are compared
    part by part, so that a fitted length and a fitted friction are two differences. Costs of single differences need
    not add up to the gap.

    Args:
        policy: a function from observations, an array ``(episodes, n)``, to actions ``(episodes, 1)``, such as
            ``pendulum_env.controllers.swing_up(env)``; or a model of Stable-Baselines3, by its ``predict``. Its method
            ``reset``, if there is one, is called before each environment.
        nominal, real: keywords for ``gym.make_vec("LabPendulum-v0", ...)``, such as ``{"scene": "lab"}`` and
            ``{"scene": found.scene, "action_delay": 0.02, "substeps": 4}``. A ``randomize`` draws another pendulum for
            every episode.
        episodes: number of episodes, 2 or more. They have 500 control steps, unless ``duration``,
            ``max_episode_steps`` or a task with a duration is given.
        seed: seed of the first episode.
        progress: True shows a progress bar; a function is called with the fraction done and a text.

    Raises SceneError for arguments out of range, keywords that the comparison sets by itself, environments that differ
    in task, length of the episodes or shape of the observation, different ``dt`` without ``reward_rate=True`` and
    ``duration``, and for all that environments refuse.
    """
    act, count = acting(policy), whole_number(episodes, "episodes", MOST_ENVS)
    if count < 2:
        raise SceneError(f"episodes must be 2 or more, for a standard error, not {count}.")
    first = whole_number(seed, "seed", MOST_SEED, least=0)
    sides = checked(nominal, "nominal"), checked(real, "real")
    sides = comparable(*sides, count)
    changes = [*different(*sides)]
    tell, done, total = told_by(progress), 0, 2 + 2 * len(changes)

    def returns(keywords: Keywords, what: str) -> Array:
        nonlocal done
        tell(done / total, what)
        env = made(keywords, count)
        if callable(begin := getattr(policy, "reset", None)):
            begin()
        found = total_rewards(act, env, first)
        done += 1
        return found

    base, other = returns(sides[0], "nominal"), returns(sides[1], "real")
    numerics = next((change for change in changes if change.name == NUMERICS[0]), None)
    found = []
    for change in changes:
        alone, one = tried(change, *sides, numerics, partial(returns, what=f"{change.name} alone"))
        undone, other_one = tried(change, *sides[::-1], numerics, partial(returns, what=f"{change.name} undone"))
        notes = [f"{word}, {note}" for word, note in (("alone", one), ("undone", other_one)) if note]
        found.append(Difference(change.name, change.values, alone, undone, "; ".join(notes)))
    tell(1.0, "")
    found.sort(key=lambda one: np.inf if one.alone is None else float(one.alone.mean()))
    return Transfer(base, other, tuple(found))


def total_rewards(act: Callable[[Any], Any], env: LabPendulumVectorEnv, seed: int) -> Array:
    """Return the sum of the rewards of each environment's first episode."""
    seen, _ = env.reset(seed=seed)
    total, going = np.zeros(env.num_envs), np.ones(env.num_envs, dtype=np.bool_)
    while going.any():
        seen, reward, terminated, truncated, _ = env.step(act(seen))
        total[going] += reward[going]
        going &= ~(terminated | truncated)
    env.close()
    return total


def acting(policy: Any) -> Callable[[Any], Any]:
    """Return a function from observations to actions; SceneError for what is no policy."""
    predict = getattr(policy, "predict", None)
    if callable(predict):
        return lambda seen: np.asarray(predict(seen, deterministic=True)[0])
    if callable(policy) and not isinstance(policy, type):
        return lambda seen: policy(seen)
    raise SceneError("policy must be a function from observations to actions, or a model with the method predict, not "
                     f"{shown(policy)}.")


# --- what is different ----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Swap:
    """A difference between two environments: of keywords, of a part of the scene, or of one of the part's parameters.

    Attributes:
        name: the first of the keywords, the part, or the parameter, such as "body.length".
        values: both values as text.
        keywords: the keywords, if any; then ``part`` is empty.
        part: the part of the scene, as :func:`parts_of` names it.
        field: the part's parameter; empty for the part as a whole.
    """

    name: str
    values: tuple[str, str]
    keywords: tuple[str, ...] = ()
    part: str = ""
    field: str = ""

    def apply(self, to: Keywords, source: Keywords) -> Keywords:
        """Return the keywords ``to`` with this one difference taken from ``source``."""
        if self.keywords:
            return {**{name: value for name, value in to.items() if name not in self.keywords},
                    **{name: source[name] for name in self.keywords if name in source}}
        scene, wanted = to["scene"], parts_of(source["scene"]).get(self.part)
        if self.field or self.part in PARTS:
            given = {self.name: getattr(wanted, self.field) if self.field else wanted}
            return {**to, "scene": scene.replace(**given)}
        others = [effect for effect in scene.effects if kind_of(effect) != self.part]
        return {**to, "scene": scene.with_effects(others + ([wanted] if wanted is not None else []))}


def checked(given: Any, label: str) -> Keywords:
    """Return keywords of an environment with its scene; SceneError for what is none or is not the caller's to set."""
    if not isinstance(given, Mapping) or not all(isinstance(name, str) for name in given):
        raise SceneError(f"{label} must be a dict of keywords for gym.make_vec, such as {{'scene': 'lab'}}, not "
                         f"{shown(given)}.")
    for name in PRIVATE:
        if name in given:
            raise SceneError(f"{label} must not have {name}, which the comparison sets by itself.")
    return {**given, "scene": find_scene(given.get("scene", "lab"))}


def comparable(nominal: Keywords, real: Keywords, count: int) -> tuple[Keywords, Keywords]:
    """Return the keywords, with the integrator and dt that the environments have.

    Raises SceneError if returns in the two environments do not mean the same, or if a policy for one of them cannot
    read the observations of the other.
    """
    for name in ALIKE:
        if not equal(nominal.get(name), real.get(name)):
            raise SceneError(f"nominal and real must have one {name}, because returns can only be compared in the same "
                             f"episodes of the same task, not {shown(nominal.get(name))} and {shown(real.get(name))}.")
    one, other = (made(side, count) for side in (nominal, real))
    rate = nominal.get("reward_rate") and nominal.get("duration") is not None
    if not rate and one.dt != other.dt:
        raise SceneError(f"nominal and real have different dt, {one.dt:g} and {other.dt:g} s, so that their episodes "
                         "have different lengths and rewards; give both reward_rate=True and one duration, or one dt.")
    shapes = [env.single_observation_space.shape for env in (one, other)]
    if shapes[0] != shapes[1]:
        raise SceneError(f"nominal and real must have observations of one shape, for one policy, not {shapes[0]} and "
                         f"{shapes[1]}.")
    first, second = ({"integrator": str(env.integrator), "dt": env.dt} for env in (one, other))
    return {**first, **nominal}, {**second, **real}


def made(keywords: Keywords, count: int) -> LabPendulumVectorEnv:
    """Return a vector of environments with these keywords, and episodes of 500 steps unless they say otherwise."""
    lasting = keywords.get("duration") is not None or find_task(keywords.get("task") or USUAL_TASK).duration is not None
    steps = checked_steps(keywords.get("max_episode_steps")) or (None if lasting else REGISTERED)
    return LabPendulumVectorEnv(count, **{"diagnostics": (), **keywords, "max_episode_steps": steps})


def different(nominal: Keywords, real: Keywords) -> Iterator[Swap]:
    """Yield the differences of the scenes, and of all other keywords that can change a return."""
    yield from scene_changes(nominal["scene"], real["scene"])
    names = [name for name in dict.fromkeys((*nominal, *real)) if name not in (*ALIKE, *SILENT, *NUMERICS, "scene")]
    for group in (NUMERICS, *((name,) for name in names)):
        if not all(equal(nominal.get(name), real.get(name)) for name in group):
            one, other = (", ".join(f"{name} {side[name]}" if name in NUMERICS[1:] else value_text(side[name])
                                    for name in group if name in side) or "usual" for side in (nominal, real))
            yield Swap(group[0], (one, other), group)


def kind_of(effect: Effect) -> str:
    """Return the kind of an effect of which a scene has only one; "gravity effect" beside gravity, the number."""
    kind = effect.exclusive or effect.name
    return f"{kind} effect" if kind in PARTS else kind


def parts_of(scene: Scene) -> dict[str, Any]:
    """Return the parts of a scene, and its effects by their kinds."""
    return {**{name: getattr(scene, name) for name in PARTS}, **{kind_of(effect): effect for effect in scene.effects}}


def scene_changes(nominal: Scene, real: Scene) -> Iterator[Swap]:
    """Yield the differences of two scenes: single parameters where both have them, else whole parts and effects."""
    ours, theirs = parts_of(nominal), parts_of(real)
    for part in dict.fromkeys((*ours, *theirs)):
        one, other = ours.get(part), theirs.get(part)
        if one == other:
            continue
        if isinstance(one, (RigidBody, Effect)) and type(one) is type(other):
            owner = one.name if isinstance(one, Effect) else part
            for field in dataclasses.fields(one):  # type: ignore[arg-type]
                values = getattr(one, field.name), getattr(other, field.name)
                if values[0] != values[1]:
                    yield Swap(f"{owner}.{field.name}", (value_text(values[0]), value_text(values[1])),
                               part=part, field=field.name)
        else:
            yield Swap(part, (value_text(one), value_text(other)), part=part)


def tried(
    change: Swap, to: Keywords, source: Keywords, numerics: Swap | None, returns: Callable[[Keywords], Array],
) -> tuple[Array | None, str]:
    """Return the returns after one change, and a note.

    Where an environment refuses the change, as a delay without the substeps in which it is whole, method and step are
    changed with it; where it still refuses, there are no returns, and the note says why.
    """
    try:
        return returns(change.apply(to, source)), ""
    except SceneError as error:
        refused = str(error)
    if numerics is not None and change is not numerics:
        try:
            return returns(numerics.apply(change.apply(to, source), source)), f"with {' and '.join(NUMERICS[:2])}"
        except SceneError as error:
            refused = str(error)
    return None, f"it cannot be tried: {refused}"


def equal(one: Any, other: Any) -> bool:
    """Return True if two values of a keyword are equal, arrays and lists by their entries."""
    return np.array_equal(one, other)


def value_text(value: Any) -> str:
    """Return a value as short text: a scene's part by its name or class, a number in six digits."""
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.6g}"
    text = str(getattr(value, "name", "") or value) if not isinstance(value, np.ndarray) else f"{value.size} values"
    return text if len(text) <= WIDEST else f"{text[:WIDEST - 3]}..."
