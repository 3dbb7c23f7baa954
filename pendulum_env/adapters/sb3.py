"""Stable-Baselines3's vector of environments, made of the package's own: ``pip install 'lab-pendulum[sb3]'``."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from pendulum_env.adapters import missing
from pendulum_env.common.checks import SceneError, line, nearest, several, shown

try:
    from stable_baselines3.common.vec_env import VecEnv
except ImportError as error:
    raise missing("Stable-Baselines3", "sb3", error) from None

Info = dict[str, Any]
Indices = int | Iterable[int] | None


class RunningInfo(dict[str, Any]):
    """The info of an environment whose episode goes on: one for all of them, and so read-only."""

    def _refuse(self, *_: Any, **__: Any) -> Any:
        """Raise TypeError: a change would show in all environments."""
        raise TypeError("The infos of running episodes are one read-only dict, because a dict for each would take "
                        "longer than the steps; replace it, as in infos[i] = {**infos[i], 'mine': 1}.")

    __setitem__ = __delitem__ = __ior__ = update = setdefault = pop = popitem = clear = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the parts of a copy, which is a plain dict."""
        return dict, (dict(self),)


RUNNING = RunningInfo({"TimeLimit.truncated": False})
"""Info of an environment whose episode goes on, without ``info_names``."""


class LabPendulumVecEnv(VecEnv):  # type: ignore[misc]
    """Pendulums for the algorithms and wrappers of Stable-Baselines3, advanced together by compiled loops.

    ``PPO("MlpPolicy", LabPendulumVecEnv(64, task="balance")).learn(100_000)`` trains. Observations, rewards, ends and
    infos at the ends have the same bits as those of Stable-Baselines3's DummyVecEnv of as many single environments,
    seeded alike; rewards are rounded to float32, as there.

    At the end of an episode ``infos[i]`` has all that a single environment's info has, "terminal_observation" and
    "TimeLimit.truncated"; in other steps only the latter and ``info_names``, because dicts of all entries would take
    longer than the steps; without ``info_names`` it is one read-only dict for all. ``last_infos`` has all entries of
    the last step, as arrays.

    Args:
        num_envs: number of environments.
        info_names: names of entries, such as "energy", that ``infos[i]`` has in every step.
        keywords: those of ``gym.make_vec("LabPendulum-v0", ...)``, for example ``scene``, ``task``, ``length``.

    Attributes:
        vector: the vector environment, a LabPendulumVectorEnv.
        last_infos: its infos of the last step or reset.

    Raises SceneError, MethodError or EngineError for an invalid argument.
    """

    def __init__(self, num_envs: int = 1, *, info_names: Sequence[str] = (), **keywords: Any) -> None:
        for name in {"autoreset_mode", "copy"} & {*keywords}:
            raise SceneError(f"{name} cannot be chosen: Stable-Baselines3 resets in the same step, and keeps arrays.")
        self.vector: Any = gymnasium.make_vec(
            "pendulum_env:LabPendulum-v0", num_envs=num_envs, vectorization_mode="vector_entry_point",
            autoreset_mode="SameStep", **keywords)
        self._names = tuple(line(name, "An entry of info_names") for name in several(info_names, "info_names", "names"))
        self.last_infos: Info = {}
        self._actions: Any = None
        super().__init__(self.vector.num_envs, self.vector.single_observation_space, self.vector.single_action_space)

    def reset(self) -> NDArray[np.float32]:
        """Start episodes in all environments, with the seeds and options set before, and return the observations.

        Raises SceneError for invalid options, and for options that only some environments have.
        """
        seeds = None if all(seed is None for seed in self._seeds) else self._seeds
        seen, self.last_infos = self.vector.reset(seed=seeds, options=together(self._options))
        self._check_names()
        self._reset_seeds()
        self._reset_options()
        rows, masks = entries(self.last_infos)
        self.reset_infos = [row_of(rows, masks, place) for place in range(self.num_envs)]
        return np.asarray(seen)

    def step_async(self, actions: NDArray[Any]) -> None:
        """Keep the actions, of shape ``(num_envs, 1)``, for :meth:`step_wait`."""
        self._actions = actions

    def step_wait(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], list[Info]]:
        """Advance all environments by one control step; return observations, rewards, ends of episodes and infos.

        An environment whose episode has ended starts anew, and its observation is the first of the new episode. Raises
        ActionError for actions of another shape or that are not finite.
        """
        seen, rewards, terminated, truncated, told = self.vector.step(self._actions)
        self.last_infos, over = told, terminated | truncated
        infos: list[Info] = [RUNNING] * self.num_envs
        if self._names:
            names = (*RUNNING, *self._names)
            columns = ([False] * self.num_envs, *(told[name].tolist() for name in self._names))
            infos = [dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)]
        if (ended := np.flatnonzero(over)).size:
            rows, masks = entries(told["final_info"])
            last = told["final_obs"]
            for place in ended.tolist():
                infos[place] = {
                    **row_of(rows, masks, place), "terminal_observation": last[place],
                    "TimeLimit.truncated": bool(truncated[place] and not terminated[place])}
            rows, masks = entries({name: values for name, values in told.items() if "final_" not in name})
            for place in ended.tolist():
                self.reset_infos[place] = row_of(rows, masks, place)
        return seen, rewards.astype(np.float32), over, infos

    def close(self) -> None:
        """Close the vector environment."""
        self.vector.close()

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """Return one frame for each environment; None for each without ``render_mode="rgb_array"``."""
        frames = self.vector.render()
        return [None] * self.num_envs if frames is None else list(frames)

    def get_attr(self, attr_name: str, indices: Indices = None) -> list[Any]:
        """Return an attribute of the environments, such as ``length`` or ``omega0``; AttributeError for other names."""
        return list(self.vector.call_at(self._at(indices), "get_wrapper_attr", attr_name))

    def set_attr(self, attr_name: str, value: Any, indices: Indices = None) -> None:
        """Set an attribute of one's own in the environments; AttributeError for a setting, which cannot be changed."""
        self.vector.call_at(self._at(indices), "set_wrapper_attr", attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: Indices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Return the results of a method of the environments, such as ``get_state``; AttributeError for other names."""
        return list(self.vector.call_at(self._at(indices), method_name, *method_args, **method_kwargs))

    def env_is_wrapped(self, wrapper_class: type, indices: Indices = None) -> list[bool]:
        """Return False for each environment: there are no wrappers inside the vector."""
        return [False] * len(self._at(indices))

    def _at(self, indices: Indices) -> list[int]:
        """Return the indices of environments, None for all, as Stable-Baselines3 counts them: -1 is the last."""
        wanted = list(range(self.num_envs)) if indices is None else (
            [indices] if isinstance(indices, (int, np.integer)) else list(indices))
        return [place + self.num_envs if isinstance(place, (int, np.integer)) and place < 0 else place
                for place in wanted]

    def _check_names(self) -> None:
        """Raise SceneError if ``info_names`` has a name that the infos do not have."""
        for name in self._names:
            if not isinstance(self.last_infos.get(name), np.ndarray):
                known = [known for known, values in self.last_infos.items()
                         if not known.startswith("_") and isinstance(values, np.ndarray)]
                raise SceneError(f"info_names has {shown(name)}, which the infos of this environment have "
                                 f"not{nearest(name, known)}")


def together(options: Sequence[Info]) -> Info | None:
    """Return the options of all environments as those of a vector; SceneError if their names differ."""
    names = {*options[0]} if options else set()
    for place, one in enumerate(options):
        if {*one} != names:
            raise SceneError(f"Options of reset must have the same names in all environments, but environment {place} "
                             f"has {shown(sorted(map(str, one)))} and environment 0 {shown(sorted(map(str, names)))}.")
    return {name: np.array([one[name] for one in options]) for name in names} or None


def entries(infos: Info) -> tuple[Info, Info]:
    """Return a vector's infos as lists, and the masks that say which environments have them.

    Infos within infos, such as "parameters", are pairs of the same form.
    """
    rows = {name: entries(values) if isinstance(values, dict) else values.tolist()
            for name, values in infos.items() if not name.startswith("_")}
    return rows, {name: infos[f"_{name}"].tolist() for name in rows if f"_{name}" in infos}


def row_of(rows: Info, masks: Info, place: int) -> Info:
    """Return the infos of one environment."""
    return {name: row_of(values[0], values[1], place) if isinstance(values, tuple) else values[place]
            for name, values in rows.items() if name not in masks or masks[name][place]}
