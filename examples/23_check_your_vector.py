"""Check vector environments of others: two of Gymnasium, and EnvPool's where it is installed (pip install envpool).

Each is made by a function of the number of environments and, where it knows other ways to restart, of the mode.
"""

import warnings
from functools import partial

import gymnasium as gym
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorWrapper
from gymnasium.vector.utils import batch_space

from pendulum_env.testing import check_vector_env

try:
    import envpool
except ImportError:
    envpool = None

cart_poles = partial(gym.make_vec, "CartPole-v1", vectorization_mode="vector_entry_point")
pendulum = partial(gym.make, "Pendulum-v1", max_episode_steps=20)  # restarts are checked if episodes end


def pendulums(num_envs, autoreset_mode=AutoresetMode.NEXT_STEP):
    return SyncVectorEnv([pendulum] * num_envs, autoreset_mode=autoreset_mode)


def pool(num_envs):
    return envpool.make("CartPole-v1", env_type="gymnasium", num_envs=num_envs, seed=1)


class Batched(VectorWrapper):
    """EnvPool's vector with the spaces of a vector, so that everything behind the first fault is checked, too."""

    def __init__(self, env):
        super().__init__(env)
        self.single_observation_space, self.single_action_space = env.observation_space, env.action_space
        self.observation_space = batch_space(env.observation_space, env.num_envs)
        self.action_space = batch_space(env.action_space, env.num_envs)


def faults(name, *given):
    """Print what failed, and return the names of these checks."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of EnvPool, that it ignores the seed
        report = check_vector_env(*given, raises=False)
    print(f"{name}: {len(report.passed)} passed, {len(report.failed)} failed, {len(report.skipped)} skipped")
    for check in report.failed:
        print(f"  {check.level}, {check.name}: {check.said.partition(': wanted')[0][:100]}")
    return [check.name for check in report.failed]


assert faults("Gymnasium's CartPole", cart_poles) == []
beside = partial(gym.make, "CartPole-v1")
assert faults("the same beside single ones", cart_poles, beside) == ["NextStep", "equal seeds"]
assert faults("Gymnasium's Pendulum", pendulums, pendulum) == []
if envpool is not None:
    assert faults("EnvPool's CartPole", pool) == ["attributes"]
    assert faults("the same with a vector's spaces", lambda num_envs: Batched(pool(num_envs))) == ["infos", "seeds"]
