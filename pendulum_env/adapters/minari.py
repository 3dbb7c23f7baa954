"""Data sets of Minari, collected from many environments at once: ``pip install 'lab-pendulum[minari]'``."""

from __future__ import annotations

import importlib.metadata
import os
import secrets
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from pendulum_env.adapters import missing
from pendulum_env.common.checks import (
    SceneError,
    function,
    line,
    nearest,
    several,
    shown,
    whole_number,
)
from pendulum_env.common.progress import Progress, told_by, with_bar
from pendulum_env.common.version import NAME, built, sources, version

try:
    import h5py  # noqa: F401  Minari's storage, which it imports when it writes
    from minari import MinariDataset, load_dataset
    from minari.data_collector import EpisodeBuffer
    from minari.dataset.minari_dataset import parse_dataset_id
    from minari.dataset.minari_storage import MinariStorage
    from minari.namespace import create_namespace, list_local_namespaces
    from minari.storage import get_dataset_path
except ImportError as error:
    raise missing("Minari", "minari", error) from None

Policy = Callable[[NDArray[np.float32]], Any]
ENV = "pendulum_env:LabPendulum-v0"
MOST_SEED = 2**63 - 1
"""Largest seed that Minari's files hold."""
MOST_STEPS = 2**53
AT_ONCE = 256
"""Number of episodes that are written to the file together."""


@with_bar("Collecting")
def collect(
    policy: Policy | None,
    dataset_id: str,
    *,
    episodes: int | None = None,
    steps: int | None = None,
    num_envs: int = 64,
    seed: int = 0,
    info_names: Sequence[str] = (),
    algorithm_name: str | None = None,
    author: str | None = None,
    description: str | None = None,
    progress: Progress | bool | None = None,
    **keywords: Any,
) -> MinariDataset:
    """Collect whole episodes of a policy in many environments at once, and write them as a Minari data set.

    Episode ``k`` starts with ``reset(seed=seed + k)``, so that ``dataset.recover_environment()``, reset with the
    episode's seed, which ``dataset.storage.get_episode_metadata([k])`` has, repeats its observations, rewards and ends
    bit for bit with its actions. With ``episodes`` the data do not depend on ``num_envs``, if an action depends on its
    own observation only. The data set appears once it is complete; an interruption (Ctrl-C) leaves none.

    Args:
        policy: a function from observations, float32 of shape (n, 3), to actions of shape (n, 1), which are clipped to
            [-1, 1]; None for random actions, uniform in [-1, 1].
        dataset_id: the name of the new data set, such as "pendulum/swing-up-v0".
        episodes: number of episodes. Either this or ``steps`` is needed.
        steps: control steps after which no episode begins any more; those that have begun are completed.
        num_envs: number of environments that run at once.
        seed: seed of the first episode, and of the random actions.
        info_names: names of numbers of the infos to record, such as "energy" [J].
        algorithm_name, author, description: texts for the data set's metadata.
        progress: True for a progress bar, or a function of the fraction done and a text.
        keywords: those of ``gym.make("LabPendulum-v0", ...)``, for example ``scene``, ``task``, ``max_episode_steps``.

    Raises SceneError for invalid arguments, for a name that exists, and for keywords that cannot be written as JSON,
    from which the environment could not be recovered.
    """
    tell, act = told_by(progress), None if policy is None else function(policy, "policy")
    if (episodes is None) == (steps is None):
        raise SceneError("Give either episodes or steps, the amount of data to collect.")
    amount, unit = (episodes, "episodes") if steps is None else (steps, "steps")
    goal = whole_number(amount, unit, MOST_STEPS)
    first = whole_number(seed, "seed", MOST_SEED - MOST_STEPS, least=0)
    names = tuple(line(name, "An entry of info_names") for name in several(info_names, "info_names", "names"))
    texts = {"algorithm_name": algorithm_name, "author": author, "description": description}
    metadata: dict[str, Any] = {name: line(text, name) for name, text in texts.items() if text is not None}
    if author is not None:
        metadata["author"] = {author}
    place = new_place(dataset_id)
    env = gymnasium.make(ENV, **keywords)
    timed = keywords.get("duration") is not None or env.unwrapped.task.duration is not None  # type: ignore[attr-defined]
    if timed and keywords.get("max_episode_steps") is None:  # the duration alone ends an episode
        env.close()
        keywords["max_episode_steps"] = -1
        env = gymnasium.make(ENV, **keywords)
    spec = env.spec
    assert spec is not None
    spec.to_json()
    if spec.max_episode_steps is None and not timed:
        raise SceneError("max_episode_steps must be a number, because only whole episodes are collected.")
    size = whole_number(num_envs, "num_envs", 2**20)
    vector: Any = gymnasium.make_vec(
        ENV, num_envs=size if episodes is None else min(size, goal), vectorization_mode="vector_entry_point",
        autoreset_mode="Disabled", **{**keywords, "warn": False})
    with complete(place) as folder:
        storage = MinariStorage.new(folder / "data", observation_space=env.observation_space,
                                    action_space=env.action_space, env_spec=spec)
        storage.update_metadata({
            "dataset_id": dataset_id, "minari_version": importlib.metadata.version("minari"),
            # Minari compares it with what is installed, which git may be ahead of in a checkout.
            "requirements": [f"{NAME}>={built().partition('+')[0]}"], "software": f"{NAME} {version()}",
            "sources": sources(), **metadata})
        ready: list[Any] = []
        for episode in episodes_of(vector, act, goal, steps is not None, first, names, tell):
            ready.append(episode)
            if len(ready) == AT_ONCE:
                storage.update_episodes(ready)
                ready = []
        storage.update_episodes(ready)
        vector.close()
        env.close()
    return load_dataset(dataset_id)


def episodes_of(
    vector: Any, act: Policy | None, goal: int, by_steps: bool, seed: int, names: Sequence[str], tell: Progress
) -> Iterator[Any]:
    """Yield a policy's episodes, in the order of their seeds, from a vector whose environments are reset by masks.

    ``goal`` is the number of episodes or, with ``by_steps``, the number of steps after which none begins any more.
    """
    size = vector.num_envs
    random = np.random.default_rng(seed)
    numbers = np.arange(size)  # episode of each environment; -1 once no more are needed
    begun, taken, handed, offset = size, 0, 0, 0
    since = np.zeros(size, dtype=np.intp)
    rows: list[dict[str, Any]] = []
    done: dict[int, Any] = {}
    seen, infos = vector.reset(seed=[seed + k for k in range(size)])
    check_names(names, infos)
    starts = {name: infos[name].copy() for name in names}
    while (numbers >= 0).any():
        actions = checked_actions(random.uniform(-1.0, 1.0, (size, 1)) if act is None else act(seen.copy()), size)
        after, rewards, terminated, truncated, infos = vector.step(actions)
        rows.append({"observations": seen, "actions": actions, "rewards": rewards, "terminations": terminated,
                     "truncations": truncated, **{name: infos[name] for name in names}})
        seen, taken = after, taken + int((numbers >= 0).sum())
        over = terminated | truncated
        if not over.any():
            continue
        seeds: list[int | None] = [None] * size
        for place in np.flatnonzero(over).tolist():
            if (number := int(numbers[place])) >= 0:
                own = rows[since[place] - offset:]
                columns = {name: np.array([row[name][place] for row in own]) for name in own[0]}
                columns["observations"] = np.concatenate([columns["observations"], after[place][None]])
                told = {name: np.concatenate([[starts[name][place]], columns.pop(name)]) for name in names}
                done[number] = EpisodeBuffer(id=number, seed=seed + number, options=None, infos=told, **columns)
            more = taken < goal if by_steps else begun < goal
            numbers[place] = begun if more else -1
            seeds[place], begun = (seed + begun, begun + 1) if more else (None, begun)
            since[place] = offset + len(rows)
        seen, fresh = vector.reset(seed=seeds, options={"reset_mask": over})
        for name in names:
            starts[name] = np.where(over, fresh[name], starts[name])
        running = since[numbers >= 0]
        kept = int(running.min()) if running.size else offset + len(rows)
        del rows[: kept - offset]
        offset = kept
        while handed in done:
            yield done.pop(handed)
            handed += 1
            tell(min(1.0, taken / goal if by_steps else handed / goal), f"{handed} episodes")


def check_names(names: Sequence[str], infos: Mapping[str, Any]) -> None:
    """Raise SceneError for names that do not belong to numbers in a vector's infos."""
    known = [name for name, values in infos.items() if isinstance(values, np.ndarray) and values.dtype.kind == "f"]
    for name in names:
        if name not in known:
            raise SceneError(f"info_names has {shown(name)}, which is no number in the infos of this "
                             f"environment{nearest(name, known)}")


def checked_actions(actions: Any, size: int) -> NDArray[np.float32]:
    """Return a policy's actions as float32 in [-1, 1]; SceneError for another shape or numbers that are not finite."""
    try:
        array = np.asarray(actions)
        fine = array.shape == (size, 1) and array.dtype.kind in "fiu" and bool(np.isfinite(array).all())
    except ValueError:
        fine = False
    if not fine:
        raise SceneError(f"policy must return finite numbers of the shape ({size}, 1), not {shown(actions)}.")
    clipped: NDArray[np.float32] = np.clip(array, -1.0, 1.0).astype(np.float32)
    return clipped


def new_place(dataset_id: Any) -> Path:
    """Return the folder of a data set to be written; SceneError for an invalid name, or one that exists."""
    try:
        parse_dataset_id(line(dataset_id, "dataset_id"))
    except ValueError:
        raise SceneError(f"dataset_id must be a name with a version, such as 'pendulum/swing-up-v0', not "
                         f"{shown(dataset_id)}.") from None
    place = Path(get_dataset_path(dataset_id))
    if place.exists():
        raise SceneError(f"The data set {dataset_id} exists; take another name or version, or delete it by "
                         f"minari.delete_dataset({dataset_id!r}).")
    return place


@contextmanager
def complete(place: Path) -> Iterator[Path]:
    """Yield a hidden folder, which becomes ``place`` if the ``with`` block ends well, and is removed if not."""
    root = Path(get_dataset_path())
    folder = root / f".lab-pendulum-{secrets.token_hex(4)}"
    try:
        (folder / "data").mkdir(parents=True)
        yield folder
        namespace = place.parent.relative_to(root).as_posix()
        if namespace != "." and namespace not in list_local_namespaces():
            create_namespace(namespace)
        os.rename(folder, place)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
