"""Tests of the returns of a policy in two environments, and of the cost of each difference between them."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from pendulum_env import SCENES, SceneError, Sensor, Task, transfer
from pendulum_env.envs.transfer import Transfer, mean
from pendulum_env.physics.effects import CoulombFriction, SmallAngleGravity

SHORT: dict[str, Any] = {"max_episode_steps": 20, "backend": "python", "warn": False}


def along(seen: Any) -> Any:
    """Push along the observed velocity, half as hard on the left side."""
    return np.sign(seen[:, 2:3]) * np.where(seen[:, 1:2] > 0.0, 1.0, 0.5)


def by_singles(keywords: dict[str, Any], episodes: int, seed: int) -> list[float]:
    """Return the returns of single environments made by gym.make, one after the other."""
    returns = []
    for i in range(episodes):
        env = gym.make("LabPendulum-v0", **keywords)
        seen, _ = env.reset(seed=seed + i)
        total, over = 0.0, False
        while not over:
            seen, reward, terminated, truncated, _ = env.step(along(seen[None])[0].astype(np.float32))
            total, over = total + float(reward), terminated or truncated
        returns.append(total)
    return returns


def compared(real: dict[str, Any], episodes: int = 3, **nominal: Any) -> Transfer:
    return transfer(along, {**SHORT, **nominal}, {**SHORT, **real}, episodes=episodes, seed=5)


def test_returns_are_those_of_single_environments() -> None:
    scene = SCENES["lab"].replace(length=0.4)
    real = {"scene": scene, "substeps": 4, "action_delay": 0.015, "sensor": Sensor(noise=0.05)}
    found = compared(real)
    assert found.nominal.tolist() == pytest.approx(by_singles(SHORT, 3, 5), rel=1e-12)
    assert found.real.tolist() == pytest.approx(by_singles({**SHORT, **real}, 3, 5), rel=1e-12)
    assert {one.name for one in found.differences} == {"body.length", "integrator", "action_delay", "sensor"}
    by_name = {one.name: one for one in found.differences}
    for name, alone, undone in (
        ("body.length", {"scene": scene}, {**real, "scene": "lab"}),
        ("sensor", {"sensor": real["sensor"]}, {**real, "sensor": None}),
        ("action_delay", {"action_delay": 0.015, "substeps": 4}, {**real, "action_delay": 0.0}),
    ):
        for returns, keywords in ((by_name[name].alone, alone), (by_name[name].undone, undone)):
            assert returns is not None
            assert returns.tolist() == pytest.approx(by_singles({**SHORT, **keywords}, 3, 5), rel=1e-12), name
    assert by_name["action_delay"].note == "alone, with integrator and substeps"
    assert by_name["integrator"].undone is None
    assert "must be a whole number of steps" in by_name["integrator"].note
    costs = [float(one.alone.mean()) for one in found.differences if one.alone is not None]
    assert costs == sorted(costs)


@pytest.mark.quick("real0-gravity-values0", "real5-observation-values5")
@pytest.mark.parametrize(("real", "name", "values"), [
    ({"gravity": 1.6}, "gravity", ("usual", "1.6")),
    ({"integrator": "symplectic_euler", "substeps": 2}, "integrator", ("rk4", "symplectic_euler, substeps 2")),
    ({"scene": SCENES["lab"].replace(mass=0.05)}, "body.mass", ("0.04", "0.05")),
    ({"scene": SCENES["lab"].replace(gravity=9.0)}, "gravity", ("9.81", "9")),
    ({"scene": SCENES["lab"].with_effects((*SCENES["lab"].effects, CoulombFriction(friction_torque=0.002)))},
     "coulomb_friction", ("-", "coulomb_friction")),
    ({"observation": "encoder"}, "observation", ("usual", "encoder")),
    ({"randomize": {"length": (0.3, 0.4)}}, "randomize", ("usual", "{'length': (0.3, 0.4)}")),
])
def test_a_single_difference_is_the_whole_gap(real: dict[str, Any], name: str, values: tuple[str, str]) -> None:
    found = compared(real)
    (one,) = found.differences
    assert (one.name, one.values) == (name, values)
    assert one.alone is not None
    assert one.undone is not None
    assert (one.alone == found.real).all()
    assert (one.undone == found.nominal).all()
    assert (found.real != found.nominal).all()
    assert found.cost(name) == found.gap


def test_another_kind_of_one_effect_is_one_difference() -> None:
    """A scene has one gravity: that of small angles stands in its place, and the number g is another difference."""
    lab = SCENES["lab"]
    others = [effect for effect in lab.effects if effect.name != "gravity"]
    found = compared({"scene": lab.with_effects((SmallAngleGravity(), *others)).replace(gravity=9.0)})
    assert {one.name: one.values for one in found.differences} == {
        "gravity": ("9.81", "9"), "gravity effect": ("gravity", "small_angle_gravity")}


def test_equal_environments_have_no_gap() -> None:
    found = compared({})
    assert found.differences == ()
    assert found.gap == (0.0, 0.0)
    assert "a change of 0 ± 0" in found.text
    with pytest.raises(SceneError, match="no difference 'dt'; there are none"):
        found.cost("dt")


def test_the_standard_error_is_that_of_paired_episodes() -> None:
    values = np.array([1.0, 2.0, 6.0])
    assert mean(values) == pytest.approx((3.0, np.sqrt((4.0 + 1.0 + 9.0) / 2.0 / 3.0)))
    found = Transfer(np.array([0.0, 10.0]), np.array([-1.0, 7.0]), ())
    assert found.gap == pytest.approx((-2.0, 1.0))


def test_models_and_policies_with_a_memory() -> None:
    """A model is asked by predict; a policy's reset is called before each of the 2 + 2 environments."""

    class Model:
        def predict(self, seen: Any, deterministic: bool = False) -> tuple[Any, None]:
            assert deterministic
            return along(seen), None

    class Remembering:
        begun = 0

        def reset(self) -> None:
            self.begun += 1

        def __call__(self, seen: Any) -> Any:
            return along(seen)

    policy, real, told = Remembering(), {**SHORT, "gravity": 5.0}, []
    expected = compared({"gravity": 5.0})
    for one in (Model(), policy):
        found = transfer(one, SHORT, real, episodes=3, seed=5, progress=lambda done, what: told.append(done))
        assert found.real.tolist() == expected.real.tolist()
    assert policy.begun == 4
    assert told[:5] == [0.0, 0.25, 0.5, 0.75, 1.0]


def test_steps_may_differ_where_rewards_are_rates() -> None:
    short = {"backend": "python", "warn": False, "reward_rate": True, "duration": 0.4}
    found = transfer(along, short, {**short, "dt": 0.01}, episodes=2)
    assert [one.name for one in found.differences] == ["dt"]
    assert found.gap.value == pytest.approx(0.0, abs=0.05 * abs(found.nominal.mean()))


@pytest.mark.quick("keywords1-2.0")
@pytest.mark.parametrize(("keywords", "seconds"), [
    ({}, 10.0), ({"duration": 2.0}, 2.0), ({"duration": 12.0}, 12.0), ({"max_episode_steps": 7}, 0.14)])
def test_episodes_end_without_a_limit_too(keywords: dict[str, Any], seconds: float) -> None:
    """Each step costs 1; -1 leaves an episode its duration, or 500 steps."""
    still: dict[str, Any] = {"max_episode_steps": -1, **keywords, "task": Task("still", lambda phi: -1.0),
                             "backend": "python", "warn": False}
    assert transfer(lambda seen: np.zeros((len(seen), 1)), still, still, episodes=2).nominal == pytest.approx(
        -seconds / 0.02)


def test_the_table_says_both_values_and_both_changes() -> None:
    found = compared({"gravity": 5.0})
    assert found.table.head == ("difference", "nominal", "real", "change alone", "change beside the others")
    (row,) = found.table.rows
    assert row == ("gravity", "usual", "5", str(found.gap), str(found.gap))


@pytest.mark.slow
def test_usual_methods_and_steps_of_scenes_are_differences_too() -> None:
    """The scene gymnasium has its own method and step: both are named, and the step is refused without rates."""
    task = {"task": "swing_up"}
    with pytest.raises(SceneError, match=r"different dt, 0\.02 and 0\.05 s"):
        compared({"scene": "gymnasium", **task}, **task)
    found = compared({"scene": "gymnasium", "dt": 0.02, **task}, **task)
    values = {one.name: one.values for one in found.differences}
    assert values["integrator"] == ("rk4", "symplectic_euler")
    assert values["body"][0].startswith("Body(")
    assert "dt" not in values


def test_a_value_for_each_episode() -> None:
    found = compared({"length": [0.3, 0.4, 0.5]}, length=np.array([0.3, 0.4, 0.4]))
    assert (found.nominal[:2] == found.real[:2]).all()
    assert found.nominal[2] != found.real[2]


@pytest.mark.parametrize(("given", "words"), [
    ({"nominal": "lab"}, "nominal must be a dict of keywords"),
    ({"real": {"num_envs": 3}}, "real must not have num_envs"),
    ({"real": {"task": "balance"}}, "must have one task"),
    ({"real": {"observation": "angle"}}, "observations of one shape, for one policy, not \\(3,\\) and \\(2,\\)"),
    ({"real": {"dt": 0.01}}, "give both reward_rate=True and one duration"),
    ({"real": {"action_delay": -1.0}}, "action_delay"),
    ({"real": {"lenght": 1.0}}, "did you mean length"),
    ({"policy": 3}, "policy must be a function"),
    ({"episodes": 1}, "episodes must be 2 or more"),
    ({"seed": -1}, "seed"),
])
def test_what_cannot_be_compared_is_refused(given: dict[str, Any], words: str) -> None:
    arguments: dict[str, Any] = {"policy": along, "nominal": SHORT, "real": SHORT, "episodes": 2, **given}
    if isinstance(arguments["real"], dict):
        arguments["real"] = {**SHORT, **arguments["real"]}
    with pytest.raises(SceneError, match=words):
        transfer(**arguments)
