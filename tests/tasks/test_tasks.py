"""Tests of tasks: the contract of all, one's own with the same bits everywhere, and everything invalid is refused."""

from __future__ import annotations

import copy
import json
import math
import pickle
import random
import warnings
from collections.abc import Callable
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from scipy.stats import binomtest, kstest, uniform

import integrators
import pendulum_env
from pendulum_env import SCENES, LabPendulumEnv, LabPendulumVectorEnv, SceneError, Task
from pendulum_env.controllers import swing_up
from pendulum_env.engine import kernels
from pendulum_env.engine.generate import batch_program
from pendulum_env.tasks import QUANTITIES, TASKS, TaskError, find_task, track
from pendulum_env.tasks.task import steps_of
from pendulum_env.tasks.translate import Translator
from pendulum_env.testing import check_vector_env

WEIGHT = 0.25


def hump(x: float, k: float = 3.0) -> float:
    if x > 0.0 and not x > 2.0:
        return k * x**2
    return math.cos(x)


def shaped(phi: float, velocity: float, action: float, phi_before: float, time: float, angle: float) -> float:
    """A reward with all allowed syntax."""
    reward = -phi**2 - WEIGHT * np.abs(velocity) + 1e-3 * np.sqrt(time) + math.exp(-abs(angle)) + (phi > 1)
    if abs(phi) < 0.1:
        reward += 1
    elif phi > 2 or action > 0.5:
        reward -= 0.5 * math.atan2(phi, 1 + abs(velocity)) ** 3 + (phi if 0 < phi < 1 else -phi)
    return reward + hump(phi_before) - abs(phi) ** 1.5 + math.log(1 + phi * phi) + min(phi, 1, np.tanh(2 * action))


MINE = Task("mine", shaped, lambda phi, time: abs(phi) < 0.02 or (time > 0.7 and phi > 3),
            lambda first, second, omega0: (3.0 + 0.2 * first, omega0 * second))
FOLLOW = track(lambda time: 0.4 * math.sin(2.0 * time) + 3.0)
OMEGA0 = math.sqrt(9.81 / 0.353)
OWN = {"mine": MINE, "follow": FOLLOW, **{name: name for name in TASKS}}


def played(make: Callable[..., Any], size: int, task: Any, backend: str, seed: int = 3, steps: int = 70,
           **more: Any) -> list[Any]:
    """Return all results of a vector, or of single environments, for the same actions."""
    options = {"task": task, "backend": backend, "duration": 0.8, **more}
    vector = make is LabPendulumVectorEnv
    envs = [make(size, autoreset_mode="NextStep", **options)] if vector else [make(**options) for _ in range(size)]
    source, over = np.random.default_rng(0), [False] * size
    if vector:
        rows = [(envs[0].reset(seed=seed)[0], *[np.zeros(size)] * 3)]
    else:
        rows = [(np.array([env.reset(seed=seed + i)[0] for i, env in enumerate(envs)]), *[np.zeros(size)] * 3)]
    for _ in range(steps):
        actions = source.uniform(-1.2, 1.2, (size, 1)).astype(np.float32)
        if vector:
            rows.append(envs[0].step(actions)[:4])
            continue
        row = [(env.reset()[0], 0.0, False, False) if done else env.step(action)[:4]
               for env, action, done in zip(envs, actions, over, strict=True)]
        over = [one[2] or one[3] for one in row]
        rows.append(tuple(np.array(part) for part in zip(*row, strict=True)))
    return rows


@pytest.mark.parametrize("name", [pytest.param(name, marks=[] if name == "mine" else pytest.mark.slow)
                                  for name in OWN])
def test_vector_single_compiled_and_interpreted_have_the_same_bits(name: str) -> None:
    wanted = played(LabPendulumEnv, 2, OWN[name], "python")
    for make, backend in ((LabPendulumVectorEnv, "python"), (LabPendulumVectorEnv, "compiled")):
        for got, want in zip(played(make, 2, OWN[name], backend), wanted, strict=True):
            for one, other in zip(got, want, strict=True):
                assert np.array_equal(one, other)
    assert any((row[2] + row[3]).any() for row in wanted), "episodes end"


def test_a_reward_is_what_its_function_returns() -> None:
    """Compare with numpy's and math's own functions, which differ from the package's by rounding."""
    env = LabPendulumEnv(task=MINE, backend="python")
    seen, info = env.reset(seed=1)
    for k in range(30):
        before = math.atan2(-seen[1], -seen[0])
        seen, reward, *_, info = env.step(np.array([math.sin(k)], dtype=np.float32))
        phi = math.remainder(info["angle"] - math.pi, 2.0 * math.pi)
        wanted = shaped(phi, info["velocity"], float(np.float32(math.sin(k))), before, info["time"], info["angle"])
        assert reward == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize("task", TASKS.values(), ids=TASKS)
def test_the_packages_own_tasks_obey_the_contract_of_yours(task: Task) -> None:
    """Check that the package's tasks return the same bits when they are translated like a user's."""
    source = random.Random(1)
    translator = Translator(task.name)
    for function in filter(None, (task.goal.reward, task.goal.lost, task.begin, task.goal.reference)):
        again = copy.copy(function)
        other = type(function)(function.__code__, {**function.__globals__, "__name__": "elsewhere"},
                               function.__name__)
        other.__module__ = "elsewhere"
        role = "start" if function is task.begin else "lost" if function is task.goal.lost else "reward"
        made = translator.plain(other, role)
        for _ in range(20):
            values = [source.uniform(-4.0, 4.0) for _ in range(made.__code__.co_argcount)]
            assert made(*values) == again(*values)


@pytest.mark.parametrize("name", OWN)
def test_episodes_start_within_their_ranges(name: str) -> None:
    task = find_task(OWN[name])
    env = LabPendulumVectorEnv(2000, task=task, backend="python")
    infos = env.reset(seed=0)[1]
    angle, speed = infos["angle"], infos["velocity"] / OMEGA0
    if name == "mine":
        assert (angle.min(), angle.max(), speed.min(), speed.max()) == pytest.approx((3.0, 3.2, 0.0, 1.0), abs=2e-3)
        assert np.mean(angle) == pytest.approx(3.1, abs=0.01)
    elif not task.draws:
        assert np.ptp(angle) == 0.0


def test_ranges_of_starts() -> None:
    task = Task("wide", lambda phi: phi, start={"angle": (-1.0, 2.0), "velocity": 0.5})
    infos = LabPendulumVectorEnv(4000, task=task, backend="python").reset(seed=0)[1]
    assert (infos["angle"].min(), infos["angle"].max()) == pytest.approx((-1.0, 2.0), abs=5e-3)
    assert np.mean(infos["angle"]) == pytest.approx(0.5, abs=0.05)
    assert set(infos["velocity"].tolist()) == {0.5}
    single = LabPendulumEnv(task=task, backend="python").reset(seed=7)[1]
    assert infos["angle"][7] == single["angle"]


def test_a_reference_is_observed_now_and_ahead() -> None:
    env = LabPendulumEnv(task=FOLLOW, backend="python")
    seen, info = env.reset(seed=0)
    for _ in range(5):
        now, ahead = (0.4 * math.sin(2.0 * t) + 3.0 for t in (info["time"], info["time"] + 0.02))
        assert seen[3:].tolist() == pytest.approx([math.cos(now), math.sin(now), math.cos(ahead), math.sin(ahead)])
        seen, reward, *_, info = env.step(np.array([0.5], dtype=np.float32))
        error = math.remainder(info["angle"] - (0.4 * math.sin(2.0 * info["time"]) + 3.0), 2.0 * math.pi)
        assert reward == pytest.approx(-(error**2 + 0.001 * 0.25))
    assert np.array_equal(track(amplitude=0.2, period=1.0).goal.reference(0.25), 0.2)  # type: ignore[misc]


def test_swing_up_anywhere_starts_at_any_angle_with_up_to_omega0() -> None:
    """Kolmogorov's test of 2000 starts, which refuses the true distribution once in a thousand seeds."""
    _, infos = LabPendulumVectorEnv(2000, task="swing_up_anywhere", backend="python").reset(seed=0)
    assert kstest(np.remainder(infos["angle"], 2.0 * math.pi), uniform(0.0, 2.0 * math.pi).cdf).pvalue > 1e-3
    assert kstest(infos["velocity"] / OMEGA0, uniform(-1.0, 2.0).cdf).pvalue > 1e-3


def test_swing_up_mixed_hangs_in_a_quarter_of_its_starts_and_has_any_angle_in_the_others() -> None:
    """Kolmogorov's test of each part, and the binomial distribution of their sizes; true ones fail in 0.5 %."""
    _, infos = LabPendulumVectorEnv(4000, task="swing_up_mixed", backend="python").reset(seed=0)
    angle, speed = infos["angle"], infos["velocity"] / OMEGA0
    hangs = (np.abs(angle) <= 0.1) & (np.abs(speed) <= 0.05)  # of the other starts 0.2 % look so, too
    assert binomtest(int(hangs.sum()), 4000, 0.25 + 0.75 * 0.2 / (2.0 * math.pi) * 0.05).pvalue > 1e-3
    assert kstest(angle[hangs], uniform(-0.1, 0.2).cdf).pvalue > 1e-3
    assert kstest(speed[hangs], uniform(-0.05, 0.1).cdf).pvalue > 1e-3
    assert kstest(np.remainder(angle[~hangs], 2.0 * math.pi), uniform(0.0, 2.0 * math.pi).cdf).pvalue > 1e-3
    assert kstest(speed[~hangs], uniform(-1.0, 2.0).cdf).pvalue > 1e-3


def test_holding_upright_fulfils_the_sparse_task() -> None:
    env = LabPendulumVectorEnv(3, task="swing_up_sparse", backend="python", duration=8.0)
    policy, total = swing_up(env), np.zeros(3)
    seen, _ = env.reset(seed=0)
    for k in range(400):
        seen, reward, _, truncated, infos = env.step(policy(seen))
        phi = np.abs(np.remainder(infos["angle"], 2.0 * math.pi) - math.pi)
        fine = (phi <= 0.1) & (np.abs(infos["velocity"]) <= 0.1 * OMEGA0)
        assert np.array_equal(reward, fine.astype(float))
        assert truncated.all() == (k == 399)
        total += reward
    assert (total > 150.0).all()


# --- length and rate --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("dt", "steps"), [
    (0.02, 500), (0.05, 200), pytest.param(0.002, 5000, marks=pytest.mark.slow)])
def test_an_episode_of_a_duration_has_its_steps(dt: float, steps: int) -> None:
    env = gym.make("LabPendulum-v0", dt=dt, duration=10.0, max_episode_steps=-1, backend="python", diagnostics=())
    vector = gym.make_vec("LabPendulum-v0", num_envs=1, dt=dt, duration=10.0, max_episode_steps=-1, backend="python",
                          diagnostics=())
    for made, action in ((env, np.zeros(1, np.float32)), (vector, np.zeros((1, 1), np.float32))):
        made.reset(seed=0)
        count, over = 0, False
        while not over:
            _, _, terminated, over, _ = made.step(action)
            assert not terminated
            count += 1
        assert count == steps


@pytest.mark.slow
def test_returns_of_a_rate_do_not_change_with_the_step() -> None:
    """Check that the controller's return in ten seconds is the same for every dt, with the rate only."""
    returns = {}
    for dt in (0.002, 0.01, 0.02, 0.05, 0.1):
        env = LabPendulumVectorEnv(8, dt=dt, substeps=max(1, round(dt / 0.02)), duration=10.0, reward_rate=True,
                                   diagnostics=(), warn=False)
        policy, total = swing_up(env), np.zeros(8)
        seen, _ = env.reset(seed=0)
        for _ in range(round(10.0 / dt)):
            seen, reward, *_ = env.step(policy(seen))
            total += reward
        returns[dt] = float(np.mean(total))
    assert all(value == pytest.approx(returns[0.002], rel=0.02) for value in returns.values()), returns


# --- saving -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", OWN)
def test_tasks_and_environments_are_pickled_with_their_functions(name: str) -> None:
    task = find_task(OWN[name])
    again = pickle.loads(pickle.dumps(task))
    assert again == task
    assert hash(again) == hash(task)
    assert copy.deepcopy(task) == task
    action = np.array([0.3], dtype=np.float32)
    env = LabPendulumEnv(task=task, backend="python")
    env.reset(seed=0)
    other = pickle.loads(pickle.dumps(env))
    assert all(np.array_equal(a, b) for a, b in zip(env.step(action)[:4], other.step(action)[:4], strict=True))
    saved = env.get_state()
    third = LabPendulumEnv(task=again, backend="python")
    third.reset(seed=9)
    third.set_state(saved)
    assert third.step(action)[1] == env.step(action)[1]
    vector = LabPendulumVectorEnv(2, task=task, backend="python")
    vector.reset(seed=0)
    both = [one.step(np.full((2, 1), 0.3, np.float32)) for one in (vector, pickle.loads(pickle.dumps(vector)))]
    assert np.array_equal(both[0][1], both[1][1])


def test_tasks_of_one_text_share_a_program() -> None:
    def made() -> Task:
        return Task("again", lambda phi: -phi * phi)

    assert made() == made()
    assert made() != Task("again", lambda phi: -phi)
    options: tuple[Any, ...] = (SCENES["lab"], integrators.get("rk4"), (), frozenset())
    assert batch_program(*options, made().goal) is batch_program(*options, made().goal)


def test_a_name_is_written_as_json_and_an_object_refused() -> None:
    env = gym.make("LabPendulum-v0", task="track", backend="python")
    assert env.spec is not None
    assert json.loads(env.spec.to_json())["kwargs"]["task"] == "track"
    env = gym.make("LabPendulum-v0", task=MINE, backend="python")
    assert env.spec is not None
    with pytest.raises(SceneError, match=r"^task=Task.*cannot be written as JSON"):
        env.spec.to_json()


# --- Gymnasium --------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("name", [pytest.param(name, marks=[] if name == "mine" else pytest.mark.slow)
                                  for name in OWN])
def test_gymnasium_and_the_vector_check_are_content(name: str) -> None:
    options: dict[str, Any] = {"task": OWN[name], "backend": "python", "duration": 0.4, "reward_rate": True,
                               "max_episode_steps": 20}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gym.make("LabPendulum-v0", render_mode="rgb_array", **options).unwrapped, skip_render_check=True)
        check_vector_env(partial(gym.make_vec, "LabPendulum-v0", **options), partial(gym.make, "LabPendulum-v0",
                                                                                     **options))


# --- refusals ---------------------------------------------------------------------------------------------------------


def doubled(function: Callable[..., float]) -> Callable[..., float]:
    def outer(phi: float) -> float:
        return 2.0 * function(phi)
    return outer


@doubled
def decorated(phi: float) -> float:
    return phi


def test_of_a_decorated_function_that_runs_which_the_decorator_returned() -> None:
    assert Task("t", decorated).goal.reward(0.3) == decorated(0.3) == 0.6


def looping(phi: float) -> float:
    for _ in range(3):
        phi = phi + 1.0
    return phi


def halfway(phi: float) -> float:
    if phi > 0:
        found = 1.0
    return found


def silent(phi: float) -> float:  # type: ignore[return]
    if phi > 0:
        return 1.0


def recursive(phi: float) -> float:
    return recursive(phi)


def mixed(phi: float) -> float:
    x = phi > 0
    x = phi  # type: ignore[assignment]
    return x


LIST = [1.0]
REFUSED: dict[str, tuple[Callable[[], Any], str]] = {
    "unknown": (lambda: Task("t", lambda ph: ph), "has the argument 'ph', and may have phi, angle.*did you mean phi"),
    "no reference": (lambda: Task("t", lambda error: error), "takes error, which needs a reference"),
    "reference of phi": (lambda: track(lambda phi: phi), "reference of the task 'track' has the argument 'phi', and "
                                                         "may have time"),
    "start of phi": (lambda: Task("t", lambda phi: phi, start=lambda phi: (phi, phi)), "and may have first, second"),
    "nan": (lambda: Task("t", lambda phi: 1e308 * 10 * phi * 0), "reward of the task 't' returns nan at phi="),
    "raises": (lambda: Task("t", lambda phi: 1 / phi), "raises ZeroDivisionError .* at phi=0"),
    "root": (lambda: Task("t", lambda phi: phi**0.5), r"raises ValueError \(.*\) at phi="),
    "loop": (lambda: Task("t", looping), r"looping of the task 't' \(line \d+\) uses a for loop; allowed are"),
    "halfway": (lambda: Task("t", halfway), "uses found where it may have no value"),
    "silent": (lambda: Task("t", silent), "does not return a value on every path"),
    "recursive": (lambda: Task("t", recursive), "recursive .*calls itself"),
    "mixed": (lambda: Task("t", mixed), "assigns a number and a condition to x"),
    "built-in": (lambda: Task("t", math.cos), "reward of the task 't' must be a plain function"),
    "bound": (lambda: Task("t", "x".join), "must be a plain function"),
    "list": (lambda: Task("t", lambda phi: LIST[0] * phi), r"uses LIST, which is \[1\.0\]; allowed"),
    "global list": (lambda: Task("t", lambda phi: LIST * phi), "uses LIST, which is"),
    "undefined": (lambda: Task("t", lambda phi: phy), "uses phy, which is not defined"),  # type: ignore[name-defined]  # noqa: F821
    "print": (lambda: Task("t", lambda phi: print(phi)), "calls print; allowed are"),  # type: ignore[func-returns-value]
    "modulo": (lambda: Task("t", lambda phi: phi % 2.0), "uses %"),
    "arguments": (lambda: Task("t", lambda *phi: 1.0), r"has \*"),
    "positional default": (lambda: Task("t", lambda phi, k=2.0, /: phi * k), r"has \*, / or \*\*"),
    "number lost": (lambda: Task("t", lambda phi: phi, lambda phi: phi), "a number where a condition is wanted"),
    "one number": (lambda: Task("t", lambda phi: phi, start=lambda first: first), "must return two numbers"),
    "typed": (lambda: Task("t", eval("lambda phi: phi")), "cannot be read"),
    "upside down": (lambda: Task("t", lambda phi: phi, start={"angle": (1.0, -1.0)}),
                    r"angle in start of the task 't' is upside down: \(1, -1\)"),
    "no range": (lambda: Task("t", lambda phi: phi, start={"angel": 0.0}), "has no 'angel'; did you mean angle"),
    "three": (lambda: Task("t", lambda phi: phi, start={"angle": (1.0, 2.0, 3.0)}), "a number or a pair of numbers"),
    "both": (lambda: Task("t", lambda phi: phi, start={"velocity": 0.0, "speed": 0.0}), "both velocity and speed"),
    "no task": (lambda: find_task("swingup"), "There is no task 'swingup'; did you mean swing_up"),
    "short": (lambda: LabPendulumEnv(duration=0.01), "duration=0.01 s is shorter than a control step of dt=0.02 s"),
    "part": (lambda: steps_of(0.05, 0.02), "not a whole number of control steps of dt=0.02 s; the nearest is 0.04 s"),
    "negative": (lambda: LabPendulumVectorEnv(2, duration=-1.0), "duration must be a finite number above 0"),
    "number": (lambda: LabPendulumEnv(task=3), "There is no task 3.*A task of your own is a pendulum_env.Task"),  # type: ignore[arg-type]
    "rate": (lambda: LabPendulumEnv(reward_rate=2), "reward_rate must be True or False"),  # type: ignore[arg-type]
}


@pytest.mark.parametrize("name", REFUSED)
def test_bad_tasks_are_refused_in_a_sentence_before_anything_is_compiled(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kernels, "compiled", lambda program: pytest.fail("something was compiled"))
    call, words = REFUSED[name]
    with pytest.raises(SceneError, match=words) as caught:
        call()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("backend", ["python", "compiled"])
def test_a_reward_that_becomes_infinite_stops_the_episode_with_an_error(backend: str) -> None:
    task = Task("edge", lambda time: 1.0 / (0.02 - time) if time > 0.01 and time < 0.03 else 0.0)
    env = LabPendulumEnv(task=task, backend=backend)  # type: ignore[arg-type]
    env.reset(seed=0)
    with pytest.raises(TaskError, match="The task 'edge' raises ZeroDivisionError"):
        env.step(np.zeros(1, np.float32))
    for substeps in (1, 100):  # one call for a step, and several
        vector = LabPendulumVectorEnv(3, task=task, substeps=substeps, backend="compiled")
        vector.reset(seed=0)
        with pytest.raises(TaskError, match="reward of the task 'edge' is inf in environment 0, at angle"):
            vector.step(np.zeros((3, 1), np.float32))
        with pytest.raises(gym.error.ResetNeeded):
            vector.step(np.zeros((3, 1), np.float32))


def test_a_changed_source_is_noticed(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """A function whose file was edited after its import is not silently replaced by the new text."""
    file = tmp_path / "changing.py"
    file.write_text("def reward(phi):\n    return -phi\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    import changing  # type: ignore[import-not-found]

    assert Task("t", changing.reward).goal.reward(2.0) == -2.0
    file.write_text("def reward(phi):\n    return +phi*phi\n")
    with pytest.raises(TaskError, match="is not what runs: the file has changed"):
        Task("t", changing.reward)


def test_numbers_from_outside_keep_the_value_they_had() -> None:
    weight = 2.0
    task = Task("t", lambda phi: weight * phi)
    weight = 3.0
    assert task.goal.reward(1.0) == 2.0
    assert Task("t", lambda phi: weight * phi).goal.reward(1.0) == 3.0


def test_the_quantities_are_documented_with_units() -> None:
    assert all("[" in meaning or "number" in meaning or "fraction" in meaning for meaning in QUANTITIES.values())
    assert pendulum_env.tasks.Task is Task


def shadowing(phi: float, velocity: float) -> float:
    cos = math.cos(phi)
    power2 = cos - 0.1 * velocity
    return cos - power2**2


def test_defaults_may_have_the_names_of_functions_and_exponents_a_negative_base() -> None:
    task = Task("t", lambda phi, sin=2.0: sin * math.sin(phi) + phi**9 + (phi - 5.0)**-3 + phi**0)
    for phi in (-1.3, 0.7):
        assert task.goal.reward(phi) == pytest.approx(2.0 * math.sin(phi) + phi**9 + (phi - 5.0)**-3 + 1.0, rel=1e-14)


def test_variables_may_have_the_names_of_functions() -> None:
    env = LabPendulumEnv(task=Task("shadows", shadowing), backend="python")
    env.reset(seed=0)
    reward, info = env.step(np.array([0.3], dtype=np.float32))[1::3]
    phi = math.remainder(info["angle"] - math.pi, 2.0 * math.pi)
    assert reward == pytest.approx(shadowing(phi, info["velocity"]), rel=1e-12)


def test_a_condition_that_decides_spares_the_next() -> None:
    task = Task("late", lambda phi: 0.0, lost=lambda time: time > 0.05 and 0.01 / (time - 0.04) > 5.0)
    vector = LabPendulumVectorEnv(1, task=task, backend="python")
    env = LabPendulumEnv(task=task, backend="python")
    for one in (env, vector):
        one.reset(seed=0)
    for _ in range(3):
        still = np.zeros(1, dtype=np.float32)
        assert env.step(still)[2] == vector.step(still[None])[2][0]


def test_a_start_takes_its_numbers_by_name() -> None:
    turned = Task("turned", lambda phi: phi, start=lambda omega0, second, first: (first, omega0 * second))
    short = Task("short", lambda phi: phi, start=lambda first: (first, 0.0))
    for task in (turned, short):
        vector = LabPendulumVectorEnv(2, task=task, backend="python")
        seen, _ = vector.reset(seed=4)
        assert (seen[1] == LabPendulumEnv(task=task, backend="python").reset(seed=5)[0]).all()
