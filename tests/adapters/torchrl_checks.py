"""TorchRL's batch of environments; run by test_adapters.py in an environment that has TorchRL."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch
from torchrl.envs import Compose, RewardSum, StepCounter, TransformedEnv
from torchrl.envs.utils import check_env_specs

from pendulum_env import SceneError
from pendulum_env.adapters.torchrl import LabPendulumTorchEnv
from pendulum_env.tasks.action import ActionError

torch.set_num_threads(1)
SIZE = 3
NAMES = ("time", "energy", "energy_residual")
TASKS: dict[str, dict[str, Any]] = {
    "balance": {"task": "balance", "length": [0.3, 0.35, 0.4]},
    "free": {"task": "free", "max_episode_steps": 17},
    "drawn": {"randomize": {"length": (0.3, 0.4)}, "observation_delay": 0.04, "max_episode_steps": 17},
    "stopped": {"speed_limit": 1.0, "max_episode_steps": 40, "velocity_bound": 20.0},
}


@pytest.mark.parametrize("task", TASKS)
def test_specs_are_right(task: str) -> None:
    env = LabPendulumTorchEnv(SIZE, info_names=NAMES, **TASKS[task])
    check_env_specs(env, seed=1)
    assert env.batch_size == torch.Size([SIZE])
    assert env.full_action_spec["action"].space.high.unique().tolist() == [1.0]
    bound = TASKS[task].get("velocity_bound", float(np.finfo(np.float32).max))
    assert env.observation_spec["observation"].space.high[0].tolist() == [1.0, 1.0, bound]


@pytest.mark.parametrize("task", TASKS)
def test_rollouts_are_those_of_the_vector(task: str) -> None:
    """Compare also across resets, which Gymnasium's vector makes in the same step."""
    env = LabPendulumTorchEnv(SIZE, info_names=NAMES, **TASKS[task])
    env.set_seed(7)
    rolled = env.rollout(120, break_when_any_done=False)
    vector = gym.make_vec("LabPendulum-v0", num_envs=SIZE, autoreset_mode="SameStep",
                          **{"max_episode_steps": 500, **TASKS[task]})
    (seen, infos), ends = vector.reset(seed=7), 0
    for time in range(120):
        row = rolled[:, time]
        assert np.array_equal(row["observation"].numpy(), seen)
        assert all(np.array_equal(row[name][:, 0].numpy(), infos[name]) for name in NAMES)
        seen, reward, terminated, truncated, infos = vector.step(row["action"].numpy())
        last, told, over = seen.copy(), {name: infos[name].copy() for name in NAMES}, terminated | truncated
        for place in np.flatnonzero(over):
            last[place] = infos["final_obs"][place]
            for name in NAMES:
                told[name][place] = infos["final_info"][name][place]
        after = row["next"]
        assert np.array_equal(after["observation"].numpy(), last)
        assert np.array_equal(after["reward"][:, 0].numpy(), reward.astype(np.float32))
        for name, wanted in (("terminated", terminated), ("truncated", truncated), ("done", over), *told.items()):
            assert np.array_equal(after[name][:, 0].numpy(), wanted), name
        ends += over.sum()
    assert ends > 5


def test_only_marked_environments_are_reset() -> None:
    env = LabPendulumTorchEnv(SIZE, info_names=("time",), task="balance")
    env.set_seed(1)
    data = env.reset()
    for _ in range(4):
        data = env.step(data.set("action", torch.zeros(SIZE, 1)))["next"]
    before = data.clone()
    marked = data.set("_reset", torch.tensor([[False], [True], [False]]))
    after = env.reset(marked)
    assert after["time"].flatten().tolist() == [before["time"][0].item(), 0.0, before["time"][2].item()]
    assert torch.equal(after["observation"][[0, 2]], before["observation"][[0, 2]])
    assert not torch.equal(after["observation"][1], before["observation"][1])


def test_ended_environments_wait_for_the_others() -> None:
    """A step with a mask leaves the others as they are, their random streams included."""
    env, twin = (LabPendulumTorchEnv(8, task="balance") for _ in range(2))
    for each in (env, twin):
        each.set_seed(3)
    torch.manual_seed(1)
    rolled = env.rollout(400, break_when_any_done=False, break_when_all_done=True)
    torch.manual_seed(1)
    first = twin.rollout(400)
    length = first.shape[1]
    assert rolled.shape[1] > length
    assert torch.equal(rolled["next", "observation"][:, :length], first["next", "observation"])
    over = rolled["next", "done"][..., 0]
    assert over[:, -1].all()
    for place, ends in enumerate(over):
        begun = int(ends.nonzero()[0])
        assert ends[begun:].all()
        waiting = rolled["next", "observation"][place, begun:]
        assert torch.equal(waiting, waiting[:1].expand_as(waiting))
    vector, direct = env.vector, gym.make_vec("LabPendulum-v0", num_envs=8, task="balance", autoreset_mode="SameStep")
    direct.reset(seed=3)
    for time in range(rolled.shape[1]):
        direct.step(rolled["action"][:, time].numpy())
        if (gone := direct.call_at(0, "get_state")[0])["state"][0] == 0.0:  # the first reset of environment 0
            assert vector.call_at(0, "get_state")[0]["state"][0] > 0.0
            vector.reset(options={"reset_mask": np.eye(8, dtype=bool)[0]})
            assert vector.call_at(0, "get_state")[0]["state"] == gone["state"]
            return
    pytest.fail("environment 0 has not been reset")


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of TorchRL's own, when its collectors are imported
def test_their_transforms_and_collector() -> None:
    from torchrl.collectors import Collector

    env = TransformedEnv(LabPendulumTorchEnv(4, max_episode_steps=20), Compose(RewardSum(), StepCounter()))
    check_env_specs(env)
    rolled = env.rollout(45, break_when_any_done=False)
    assert rolled["next", "step_count"].max() == 20
    assert torch.allclose(rolled["next", "episode_reward"][:, 19], rolled["next", "reward"][:, :20].sum(1))
    collector = Collector(LabPendulumTorchEnv(4, max_episode_steps=20), None, frames_per_batch=80, total_frames=160)
    assert [batch.shape for batch in collector] == [torch.Size([4, 20])] * 2
    collector.shutdown()


def test_observations_of_other_shapes() -> None:
    env = LabPendulumTorchEnv(SIZE, observation="history", history=3, max_episode_steps=9)
    check_env_specs(env)
    rolled = env.rollout(20, break_when_any_done=False)
    assert rolled["observation"].shape[2:] == env.vector.single_observation_space.shape


def test_options_seeds_and_bad_input() -> None:
    env = LabPendulumTorchEnv(2)
    assert env.reset(angle=0.5, velocity=0.0)["observation"][:, 0].tolist() == [np.float32(np.cos(0.5))] * 2
    with pytest.raises(SceneError, match="seed must be"):
        env.set_seed(-1)
    with pytest.raises(SceneError, match="did you mean angle"):
        env.reset(angel=0.5)
    with pytest.raises(ActionError, match="finite"):
        env.step(env.reset().set("action", torch.full((2, 1), torch.nan)))
    with pytest.raises(SceneError, match="autoreset_mode cannot be chosen"):
        LabPendulumTorchEnv(2, autoreset_mode="NextStep")
    with pytest.raises(SceneError, match="did you mean length"):
        LabPendulumTorchEnv(2, lenght=1.0)
    with pytest.raises(SceneError, match="did you mean energy"):
        LabPendulumTorchEnv(2, info_names=("enrgy",)).reset()
    with pytest.raises(SceneError, match="no number"):
        LabPendulumTorchEnv(2, info_names=("stop_reason",)).reset()
    env.close()
