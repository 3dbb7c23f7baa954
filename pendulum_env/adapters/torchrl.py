"""TorchRL's batch of environments, made of the package's own vector: ``pip install 'lab-pendulum[torchrl]'``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from pendulum_env.adapters import missing
from pendulum_env.common.checks import SceneError, line, nearest, several, shown, whole_number

try:
    import torch
    from tensordict import TensorDict
    from torchrl.data import Binary, Bounded, Composite, Unbounded
    from torchrl.envs import EnvBase
except ImportError as error:
    raise missing("TorchRL", "torchrl", error) from None

Infos = dict[str, Any]


class LabPendulumTorchEnv(EnvBase):  # type: ignore[misc]
    """Pendulums for TorchRL's collectors and losses, advanced together by compiled loops; ``batch_size`` (num_envs,).

    ``LabPendulumTorchEnv(64, task="balance").rollout(100)`` rolls out. "observation" is float32 of shape (num_envs, 3),
    or of the shape that ``observation=`` gives it, "action" float32 of (num_envs, 1) in [-1, 1], "reward" float32 of
    (num_envs, 1); "done", "terminated" and "truncated" are bool of (num_envs, 1). A reset with a mask "_reset" starts
    episodes in the marked environments. A step with a mask "_step" leaves the others unchanged; it needs a vector that
    ``get_state`` can save.

    Args:
        num_envs: number of environments.
        info_names: names of numbers of the infos, such as "energy" [J], that every step has, too: float64, shape
            (num_envs, 1).
        device: the device of the tensors; the pendulums are advanced on the processor.
        keywords: those of ``gym.make_vec("LabPendulum-v0", ...)``, for example ``scene``, ``task``, ``length``.

    Attributes:
        vector: the vector environment, a LabPendulumVectorEnv.

    Raises SceneError, MethodError or EngineError for an invalid argument.
    """

    def __init__(
        self, num_envs: int = 1, *, info_names: Sequence[str] = (), device: Any = "cpu", **keywords: Any
    ) -> None:
        for name in {"autoreset_mode", "copy"} & {*keywords}:
            raise SceneError(f"{name} cannot be chosen: TorchRL resets by masks, and keeps arrays.")
        self._names = tuple(line(name, "An entry of info_names") for name in several(info_names, "info_names", "names"))
        vector: Any = gymnasium.make_vec(
            "pendulum_env:LabPendulum-v0", num_envs=num_envs, vectorization_mode="vector_entry_point",
            autoreset_mode="Disabled", **keywords)
        super().__init__(device=device, batch_size=torch.Size([vector.num_envs]))
        self.vector = vector
        self._seed: int | None = None
        size, one = vector.num_envs, vector.single_observation_space
        shape = (size, *one.shape)
        low, high = (torch.as_tensor(np.broadcast_to(bound, shape).copy()) for bound in (one.low, one.high))
        column = torch.Size([size, 1])
        numbers = {name: Unbounded(column, dtype=torch.float64) for name in self._names}
        self.observation_spec = Composite(
            observation=Bounded(low, high, torch.Size(shape), dtype=torch.float32), **numbers,
            shape=self.batch_size, device=self.device)
        self.action_spec = Bounded(-1.0, 1.0, column, dtype=torch.float32, device=self.device)
        self.reward_spec = Unbounded(column, dtype=torch.float32, device=self.device)
        ends = {name: Binary(1, column, dtype=torch.bool) for name in ("done", "terminated", "truncated")}
        self.done_spec = Composite(**ends, shape=self.batch_size, device=self.device)

    def __repr__(self) -> str:
        return f"LabPendulumTorchEnv({self.vector!r})"

    def _reset(self, tensordict: Any = None, **options: Any) -> Any:
        """Start episodes in all environments, or in those that the mask "_reset" marks, and return their first data.

        ``options`` may have ``angle`` [rad] and ``velocity`` [rad/s]. Raises SceneError for other options.
        """
        mask = None if tensordict is None else tensordict.get("_reset", None)
        marked = None if mask is None else mask.reshape(self.batch_size[0]).cpu().numpy()
        some = {} if marked is None or marked.all() else {"reset_mask": marked}
        seed, self._seed = self._seed, None
        seen, infos = self.vector.reset(seed=seed, options={**options, **some} or None)
        never = np.zeros(self.batch_size[0], dtype=np.bool_)
        return self._data(seen, infos, never, never)

    def _step(self, tensordict: Any) -> Any:
        """Advance all environments, or those that the mask "_step" marks, by one control step, and return their data.

        Raises ActionError for actions that are not finite.
        """
        actions, mask = tensordict["action"].detach().cpu().numpy(), tensordict.get("_step", None)
        going = None if mask is None else mask.reshape(self.batch_size[0]).cpu().numpy()
        if going is None or going.all():
            seen, rewards, terminated, truncated, infos = self.vector.step(actions)
        else:
            # The waiting environments are reset for this step, and then restored to their states.
            waiting = np.flatnonzero(~going)
            state = self.vector.get_state(waiting)
            self.vector.reset(options={"reset_mask": ~going})
            seen, rewards, terminated, truncated, infos = self.vector.step(np.where(going[:, None], actions, 0.0))
            self.vector.set_state(state, waiting)
        data = self._data(seen, infos, terminated, truncated)
        return data.set("reward", self._column(rewards, torch.float32))

    def _set_seed(self, seed: int | None) -> None:
        """Seed the next reset: environment ``i`` of a batch seeded ``s`` is the single environment seeded ``s + i``.

        Raises SceneError for an invalid seed.
        """
        self._seed = None if seed is None else whole_number(seed, "seed", least=0)

    def close(self, **keywords: Any) -> None:
        """Close the vector environment."""
        self.vector.close()
        super().close(**keywords)

    def _data(
        self, seen: NDArray[np.float32], infos: Infos, terminated: NDArray[np.bool_], truncated: NDArray[np.bool_]
    ) -> Any:
        """Return observations, numbers of the infos, and ends of episodes as tensors."""
        for name in self._names:
            if not isinstance(infos.get(name), np.ndarray) or infos[name].dtype.kind != "f":
                known = [known for known, values in infos.items()
                         if isinstance(values, np.ndarray) and values.dtype.kind == "f"]
                raise SceneError(f"info_names has {shown(name)}, which is no number in the infos of this "
                                 f"environment{nearest(name, known)}")
        parts = {name: self._column(infos[name], torch.float64) for name in self._names}
        ends = {"terminated": terminated, "truncated": truncated, "done": terminated | truncated}
        parts |= {name: self._column(values, torch.bool) for name, values in ends.items()}
        parts["observation"] = torch.as_tensor(np.asarray(seen), device=self.device)
        return TensorDict(parts, batch_size=self.batch_size, device=self.device)

    def _column(self, values: NDArray[Any], kind: Any) -> Any:
        """Return one number for each environment as a tensor of the shape (num_envs, 1)."""
        return torch.as_tensor(np.array(values)[:, None], dtype=kind, device=self.device)
