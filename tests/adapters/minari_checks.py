"""Data sets of Minari; run by test_adapters.py in an environment that has Minari."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import minari
import numpy as np
import pytest

import integrators
from integrators import METHODS
from pendulum_env import SCENES, SceneError
from pendulum_env.adapters.minari import collect
from pendulum_env.common.version import sources

COLUMNS = ("observations", "actions", "rewards", "terminations", "truncations")
LAB = SCENES["lab"].replace(length=0.4)
SETTINGS: dict[str, dict[str, Any]] = {
    "ends at random": {"scene": LAB, "task": "balance", "dt": 0.01, "max_episode_steps": 60},
    "all at once": {"scene": "windy", "max_torque": 0.02, "lag": 0.1, "integrator": METHODS["heun"],
                    "max_episode_steps": 15},
    "drawn": {"randomize": {"length": (0.3, 0.4)}, "observation_delay": 0.04, "max_episode_steps": 12},
    "by its duration": {"duration": 10.4},
    "arrays and numbers": {"length": np.float64(0.35), "render_size": np.array([60, 60]), "max_episode_steps": 12},
}


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    return tmp_path


def policy(seen: Any) -> Any:
    return -30.0 * seen[:, 1:2] - 0.3 * seen[:, 2:]  # beyond 1, too, so that actions are clipped


def episodes(dataset: Any) -> list[Any]:
    return list(dataset.iterate_episodes())


@pytest.mark.parametrize("how", SETTINGS)
def test_recovered_environments_repeat_the_data(how: str, folder: Path) -> None:
    """Check every bit, with the recorded seeds and actions, for any number of environments at once."""
    made = [collect(policy, f"pendulum/balance{size}-v0", episodes=20, num_envs=size, seed=5, info_names=("energy",),
                    **SETTINGS[how]) for size in (1, 7, 64)]
    data = minari.load_dataset("pendulum/balance7-v0")
    env = data.recover_environment()
    seeds = [info["seed"] for info in data.storage.get_episode_metadata(range(20))]
    assert seeds == list(range(5, 25))
    assert data.total_episodes == 20
    assert data.total_steps == sum(len(episode.rewards) for episode in episodes(data))
    assert env.spec.max_episode_steps == SETTINGS[how].get("max_episode_steps")
    for seed, *same in zip(seeds, *map(episodes, made), strict=True):
        one = same[0]
        for other in same[1:]:
            assert all(np.array_equal(getattr(one, name), getattr(other, name)) for name in COLUMNS)
        assert np.abs(one.actions).max() <= 1.0
        assert one.actions.dtype == one.observations.dtype == np.float32
        observation, info = env.reset(seed=int(seed))
        told = [info["energy"]]
        assert np.array_equal(observation, one.observations[0])
        for k, action in enumerate(one.actions):
            observation, reward, terminated, truncated, info = env.step(action)
            assert np.array_equal(observation, one.observations[k + 1])
            assert (reward, terminated, truncated) == (one.rewards[k], one.terminations[k], one.truncations[k])
            told.append(info["energy"])
        assert terminated or truncated
        assert np.array_equal(told, one.infos["energy"])
    if how == "ends at random":
        assert max(np.abs(episode.actions).max() for episode in episodes(data)) == 1.0
    assert (len({len(episode.rewards) for episode in episodes(data)}) > 3) is (how == "ends at random")
    assert {path.name for path in folder.iterdir()} == {"pendulum"}
    assert made[0].storage.metadata["dataset_id"] == "pendulum/balance1-v0"


def test_steps_end_with_whole_episodes_and_are_told_of() -> None:
    told: list[float] = []
    data = collect(None, "random-v0", steps=100, num_envs=4, max_episode_steps=15, algorithm_name="random",
                   author="a student", description="for a test", progress=lambda done, _: told.append(done))
    assert [len(episode.rewards) for episode in episodes(data)] == [15] * 8  # 4 more begin after 60 steps, and no more
    assert told == sorted(told)
    assert told[-1] == 1.0
    assert {data.storage.metadata[name] for name in ("algorithm_name", "description")} == {"random", "for a test"}
    assert data.storage.metadata["sources"] == sources()
    actions = np.concatenate([episode.actions for episode in episodes(data)])
    assert np.abs(actions).max() <= 1.0
    assert actions.std() == pytest.approx(3**-0.5, rel=0.2)  # uniform in [-1, 1]
    again = collect(None, "random-v1", steps=100, num_envs=4, max_episode_steps=15)
    assert all(np.array_equal(one.observations, other.observations)
               for one, other in zip(episodes(data), episodes(again), strict=True))


class Stop(BaseException):
    """An interruption like Ctrl-C."""


def test_an_interruption_leaves_nothing(folder: Path) -> None:
    calls = 0

    def tired(seen: Any) -> Any:
        nonlocal calls
        calls += 1
        if calls > 300:  # after the first episodes have been written
            raise Stop
        return np.zeros((len(seen), 1))

    with pytest.raises(Stop):
        collect(tired, "pendulum/part-v0", episodes=10_000, num_envs=64, max_episode_steps=20, diagnostics=())
    assert list(folder.iterdir()) == []
    assert collect(None, "pendulum/part-v0", episodes=1, max_episode_steps=3).total_steps == 3


OWN = integrators.from_step(
    lambda theta, omega, dt, a: (theta + omega * dt, omega + a(theta, omega) * dt))

BAD: dict[str, tuple[dict[str, Any], str]] = {
    "nothing to collect": ({}, "either episodes or steps"),
    "both": ({"episodes": 1, "steps": 1}, "either episodes or steps"),
    "half": ({"episodes": 0.5}, "episodes must be a whole number"),
    "seed": ({"episodes": 1, "seed": -1}, "seed must be a whole number"),
    "large seed": ({"episodes": 1, "seed": 2**63 - 2**53}, "seed must be a whole number"),
    "size": ({"episodes": 1, "num_envs": 0}, "num_envs must be a whole number"),
    "endless": ({"episodes": 1, "max_episode_steps": -1}, "max_episode_steps"),
    "keyword": ({"episodes": 1, "lenght": 1.0}, "did you mean length"),
    "array": ({"episodes": 1, "length": [0.3, 0.4]}, "length"),
    "name": ({"episodes": 1, "info_names": ("enrgy",)}, "did you mean energy"),
    "policy": ({"episodes": 1, "policy": 3}, "policy"),
    "shape": ({"episodes": 1, "policy": lambda seen: np.zeros(len(seen))}, "policy must return finite numbers"),
    "nan": ({"episodes": 1, "policy": lambda seen: np.full((len(seen), 1), np.nan)}, "must return finite numbers"),
    "no version": ({"episodes": 1, "dataset_id": "a b"}, "dataset_id must be a name with a version"),
    "not JSON": ({"episodes": 1, "integrator": OWN}, "integrator=.* cannot be written as JSON"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_refused_and_leaves_nothing(case: str, folder: Path) -> None:
    changes, said = BAD[case]
    given = {"policy": None, "dataset_id": "bad-v0", **changes}
    with pytest.raises(SceneError, match=said):
        collect(**given)
    assert list(folder.iterdir()) == []


def test_a_data_set_that_exists_is_not_touched(folder: Path) -> None:
    collect(None, "once-v0", episodes=2, max_episode_steps=3)
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    with pytest.raises(SceneError, match="The data set once-v0 exists"):
        collect(None, "once-v0", episodes=2, max_episode_steps=3)
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before
