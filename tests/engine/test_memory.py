"""Tests of effects with a state (random numbers, gusts, a lagging motor), which changes once per control step."""

from __future__ import annotations

import copy
import math
import pickle
from typing import Any

import gymnasium as gym
import mpmath as mp
import numpy as np
import pytest
from numpy.typing import NDArray

import integrators
import pendulum_env  # noqa: F401
from pendulum_env import SCENES, Rollout, Scene, SceneError, rollout
from pendulum_env.engine import runs
from pendulum_env.engine.generate import batch_program, program
from pendulum_env.engine.layout import BLOCK
from pendulum_env.engine.machine import VELOCITY, Machine
from pendulum_env.engine.random_streams import Streams
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import BearingFriction, Gravity, Gusts, LinearDrag, Motor, Wind
from pendulum_env.physics.effects.motor import motor_advance
from pendulum_env.physics.medium import air
from pendulum_env.physics.random import MOST, next_uniform, normal, started
from pendulum_env.tasks import TASKS

# --- MRG32k3a -------------------------------------------------------------------------------------------------------

# Published numbers from the state (12345, ..., 12345) of L'Ecuyer's RngStreams: the first ten, and three later ones
# by their index.
FIRST = (
    0.12701112204657714, 0.3185275653967945, 0.3091860155832701, 0.8258468629271136, 0.2216299157820229,
    0.5333953879182788, 0.4807742033156181, 0.3555598794381262, 0.13598841039594017, 0.7558522371615436,
)
LATER = ((1000, 0.98607848680213228), (100_000, 0.69628910995743587), (1_000_000, 0.37578835621568801))


def test_random_numbers_are_the_published_ones() -> None:
    state = (12345.0,) * 6
    numbers = []
    for _ in FIRST:
        *state, number = next_uniform(*state)  # type: ignore[assignment]
        numbers.append(number)
    assert numbers == pytest.approx(FIRST, rel=1e-15)
    ones = next_uniform(*(1.0,) * 6)
    assert ones[-1] == pytest.approx(0.0003395772237870988, rel=1e-13)


@pytest.mark.parametrize("last", [100_000, pytest.param(1_000_000, marks=pytest.mark.slow)])
def test_random_numbers_later_on_are_the_published_ones(last: int) -> None:
    """Check later random numbers against published ones; their mean is 1/2 and their variance 1/12."""
    state, total, squares, seen = (12345.0,) * 6, 0.0, 0.0, {}
    wanted = dict(LATER)
    for i in range(1, last + 1):
        *state, number = next_uniform(*state)  # type: ignore[assignment]
        total, squares = total + number, squares + (number - 0.5) ** 2
        if i in wanted:
            seen[i] = number
    assert seen == pytest.approx({i: number for i, number in LATER if i <= last}, rel=1e-15)
    assert abs(total / last - 0.5) < 4.0 * math.sqrt(1.0 / 12.0 / last)
    assert abs(squares / last - 1.0 / 12.0) < 4.0 * math.sqrt(1.0 / 180.0 / last)
    assert all(1.0 <= number <= MOST + 2**15 and number % 1.0 == 0.0 for number in state)


def test_a_state_starts_within_what_both_recurrences_allow() -> None:
    assert started(0.0) == 1.0
    assert started(1.0 - 2.0**-53) == MOST == 4294944443 - 1
    assert started(np.array([0.0, 0.5])).tolist() == [1.0, 2147472222.0]


@pytest.mark.parametrize("first", [2.328306549295728e-10, 0.3, 1.0 - 2.4e-10])
def test_normal_numbers_are_box_and_mullers(first: float) -> None:
    for second in (1e-9, 0.125, 0.5, 0.9):
        wanted = math.sqrt(-2.0 * math.log(first)) * math.cos(2.0 * math.pi * second)
        assert normal(first, second) == pytest.approx(wanted, rel=1e-14)


# --- gusts ----------------------------------------------------------------------------------------------------------

TIME, SIZE, DT, MANY = 0.7, 1.6, 0.2, 20_000
AIRY = Scene(
    body=Body(length=0.5, mass=0.02), medium=air(20.0),
    effects=(Gravity(), LinearDrag(0.5), BearingFriction(bearing_viscosity=1e-4), Wind(2.0), Gusts(SIZE, TIME)),
)


def starts(machine: Machine, runs: int) -> NDArray[np.float64]:
    """Return the initial random numbers of runs with the seeds 0, 1, 2, ..."""
    streams = Streams(range(runs))
    return np.array([streams.uniform(np.arange(runs)) for _ in machine.drawn]).T


def path(machine: Machine, steps: int, h: float, uniform: Any, taken: int = 1) -> list[float]:
    """Return the gust speed divided by the length after every ``taken`` steps of h."""
    state, gusts = machine.state(0.1, 0.0, list(uniform)), []
    for _ in range(steps):
        assert machine.advance(state, 0.0, h, taken) == 0
        gusts.append(float(state[machine.names.index("gust")]))
    return gusts


@pytest.mark.slow
def test_gusts_are_an_ornstein_uhlenbeck_process() -> None:
    """Check that gusts are normal, with mean 0, standard deviation SIZE and correlation exp(-t/TIME)."""
    machine = Machine(AIRY, "velocity_verlet", diagnostics=())
    paths = [path(machine, 4, DT, uniform) for uniform in starts(machine, MANY)]
    gusts = np.array(paths) * AIRY.body.length / SIZE
    for values in gusts.T:
        assert abs(values.mean()) < 4.0 / math.sqrt(MANY)
        assert abs(values.var() - 1.0) < 4.0 * math.sqrt(2.0 / MANY)
        assert abs((values**3).mean()) < 4.0 * math.sqrt(15.0 / MANY)
        assert abs((values**4).mean() - 3.0) < 4.0 * math.sqrt(96.0 / MANY)
        assert np.max(np.abs(values)) < 5.5
    for i, j in ((0, 1), (0, 2), (1, 3), (2, 3)):
        wanted = math.exp(-(j - i) * DT / TIME)
        assert abs((gusts[:, i] * gusts[:, j]).mean() - wanted) < 4.0 * math.sqrt((1.0 + wanted**2) / MANY)


@pytest.mark.parametrize("options", [{}, {"rtol": 1e-9}, {"rtol": 1e-3}])
@pytest.mark.parametrize("method", ["velocity_verlet", "implicit_midpoint", "ab4", "abm4", "dopri5", "forward_euler"])
def test_gusts_do_not_depend_on_how_the_motion_is_integrated(method: str, options: dict[str, float]) -> None:
    """Check that gusts depend neither on the method nor on the number of steps in a control step."""
    if options and method != "dopri5":
        return
    reference = Machine(AIRY, "rk4", backend="python")
    uniform = starts(reference, 3)[2]
    wanted = path(reference, 6, DT, uniform)
    assert len(set(wanted)) == 6
    for hold in (1, 2, 4, 8):
        machine = Machine(AIRY, method, backend="python", hold=hold, **options)
        assert path(machine, 6, DT / hold, uniform, hold) == wanted
        assert path(machine, 6 * hold, DT / hold, uniform) == [gust for gust in wanted for _ in range(hold)]


def test_gusts_of_different_seeds_differ_and_of_equal_seeds_repeat() -> None:
    machine = Machine(AIRY, "velocity_verlet", backend="python")
    paths = [tuple(path(machine, 5, DT, uniform)) for uniform in starts(machine, 50)]
    assert len({gust for each in paths for gust in each}) == 250
    assert paths[7] == tuple(path(machine, 5, DT, starts(machine, 8)[7]))


def same(one: Rollout, other: Rollout, place: Any = (), other_place: Any = ()) -> bool:
    """Return True if two runs have equal bits in motion, ledger and diagnostics."""
    pairs = [(one.angle, other.angle), (one.velocity, other.velocity), (one.energy_residual, other.energy_residual),
             (one.ledger.work, other.ledger.work), (one.ledger.heat, other.ledger.heat),
             *((one.watched[name], other.watched[name]) for name in one.watched)]
    return all(np.array_equal(np.asarray(a)[place], np.asarray(b)[other_place]) for a, b in pairs)


GUSTY: dict[str, Any] = {
    "scene": AIRY, "integrator": "rk4", "dt": 0.05, "duration": 3.0, "substeps": 3,
    "diagnostics": ("energy", "tension", "flow"),
}


def test_records_do_not_touch_the_gusts() -> None:
    whole = rollout(**GUSTY, seed=4, backend="python")
    for every in (2, 7, 60):
        part = rollout(**GUSTY, seed=4, every=every, backend="python")
        assert same(whole, part, -1, -1)
        assert same(whole, part, slice(0, 60, every), slice(0, -1))
    assert not same(whole, rollout(**GUSTY, seed=5, backend="python"))


@pytest.mark.slow
@pytest.mark.parametrize("method", ["rk4", "ab4"])
def test_a_batch_of_several_blocks_is_its_single_runs(method: str) -> None:
    options = {**GUSTY, "integrator": method}
    angles = np.linspace(-1.0, 1.0, 300)
    batch = rollout(**options, angle=angles, seed=10, num_threads=2)
    assert same(batch, rollout(**options, angle=angles, seed=10, num_threads=1))
    parts = rollout(**options, angle=angles, seed=10, every=7)
    assert same(batch, parts, (..., slice(0, 60, 7)), (..., slice(0, -1)))
    for i in (0, 1, BLOCK - 1, BLOCK, 299):
        for backend in ("python", "compiled"):
            assert same(batch, rollout(**options, angle=angles[i], seed=10 + i, backend=backend), i)


def test_the_pieces_in_which_a_batch_is_run_do_not_touch_the_gusts(monkeypatch: pytest.MonkeyPatch) -> None:
    options = {**GUSTY, "diagnostics": ("energy",), "angle": [0.1, 0.2], "every": 7, "backend": "python"}
    whole = rollout(**options)
    for name, most in (("CHUNK", 100), ("WORK", 40)):
        monkeypatch.setattr(runs, name, most)
        assert same(whole, rollout(**options))


def test_the_last_seed_is_the_largest() -> None:
    options = {**GUSTY, "duration": 0.1, "backend": "python"}
    last = rollout(**options, seed=2**128 - 1)
    assert same(rollout(**options, angle=[0.3, last.angle[0]], seed=2**128 - 2), last, 1)
    for seed in (2**128, -1, 0.5, True):
        with pytest.raises(SceneError, match="seed must be a whole number"):
            rollout(**options, seed=seed)


# --- in environments ------------------------------------------------------------------------------------------------

KEYWORDS: dict[str, Any] = {
    "scene": SCENES["windy"].replace(lag=0.05), "dt": 0.05, "substeps": 4, "diagnostics": ("energy", "tension", "flow"),
}
SIZE_OF_VECTOR, LONGEST, STEPS = 3, 4, 14


def action(k: int) -> NDArray[np.float32]:
    return np.array([math.sin(1.7 * k)], dtype=np.float32)


def singles(task: str, mode: str, place: int, backend: str) -> list[tuple[Any, ...]]:
    """Return observation and info after every step of one environment with the resets of a vector's autoreset mode."""
    env = gym.make("LabPendulum-v0", **KEYWORDS, task=task, backend=backend, max_episode_steps=LONGEST).unwrapped
    seen = [env.reset(seed=40 + place)]
    taken = 0
    for k in range(STEPS):
        if taken == LONGEST and mode == "NextStep":
            seen.append(env.reset())
            taken = 0
            continue
        if taken == LONGEST:
            seen.append(env.reset())
            taken = 0
        observation, _, over, _, info = env.step(action(k))
        assert not over
        taken += 1
        seen.append((observation, info))
        if taken == LONGEST and mode == "SameStep":
            seen[-1] = env.reset()
            taken = 0
    return seen


@pytest.mark.parametrize("backend", ["python", pytest.param("compiled", marks=pytest.mark.slow)])
@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
@pytest.mark.parametrize("task", ["free", "swing_up"])
def test_a_vector_is_its_single_environments(task: str, mode: str, backend: str) -> None:
    """Check that a vector with gusts and a motor lag equals its single environments bit for bit, through autoresets."""
    env = gym.make_vec("LabPendulum-v0", num_envs=SIZE_OF_VECTOR, **KEYWORDS, task=task, backend=backend,
                       max_episode_steps=LONGEST, autoreset_mode=mode)
    seen = [env.reset(seed=40)]
    over = np.zeros(SIZE_OF_VECTOR, dtype=np.bool_)
    for k in range(STEPS):
        if mode == "Disabled" and over.any():
            seen.append(env.reset(options={"reset_mask": over}))
        observation, _, ended, late, info = env.step(np.tile(action(k), (SIZE_OF_VECTOR, 1)))
        over = ended | late
        seen.append((observation, info))
    for place in range(SIZE_OF_VECTOR):
        wanted = singles(task, mode, place, "python")
        assert len(wanted) == len(seen)
        for (observation, info), (one, own) in zip(seen, wanted, strict=True):
            assert np.array_equal(observation[place], one)
            assert {name: info[name][place] for name in own} == own
    assert len({float(info["work"][0]) for _, info in seen}) > 8


def test_environments_of_other_seeds_meet_other_gusts() -> None:
    env = gym.make_vec("LabPendulum-v0", num_envs=4, **KEYWORDS, task="free", backend="python")
    rows = []
    for seed in (0, 0, 1):
        env.reset(seed=seed)
        for k in range(3):
            info = env.step(np.tile(action(k), (4, 1)))[-1]
        rows.append(info["velocity"].tolist())
    assert rows[0] == rows[1]
    assert rows[2][:3] == rows[0][1:]
    assert len(set(rows[0] + rows[2])) == 5


@pytest.mark.parametrize("integrator", ["rk4", "ab4"])
@pytest.mark.parametrize("means", ["state", "pickle", "deepcopy"])
def test_an_episode_resumes_bit_for_bit(integrator: str, means: str) -> None:
    """Check that a restored episode continues bit for bit, also through a reset: the random state is restored, too."""
    keywords = {**KEYWORDS, "integrator": integrator, "backend": "python"}
    env = gym.make("LabPendulum-v0", **keywords).unwrapped
    env.reset(seed=3)
    for k in range(3):
        env.step(action(k))
    if means == "state":
        twin = gym.make("LabPendulum-v0", **keywords).unwrapped
        twin.set_state(pickle.loads(pickle.dumps(env.get_state())))
    else:
        twin = copy.deepcopy(env) if means == "deepcopy" else pickle.loads(pickle.dumps(env))
    for k in range(3, 9):
        if k == 6:
            assert env.reset()[1] == twin.reset()[1]
        one, other = env.step(action(k)), twin.step(action(k))
        assert np.array_equal(one[0], other[0])
        assert one[1:] == other[1:]


@pytest.mark.parametrize("means", ["pickle", "deepcopy"])
def test_a_vector_resumes_bit_for_bit(means: str) -> None:
    env = gym.make_vec("LabPendulum-v0", num_envs=3, **KEYWORDS, max_episode_steps=4, backend="python")
    env.reset(seed=3)
    for k in range(3):
        env.step(np.tile(action(k), (3, 1)))
    twin = copy.deepcopy(env) if means == "deepcopy" else pickle.loads(pickle.dumps(env))
    for k in range(3, 9):
        one, other = (each.step(np.tile(action(k), (3, 1))) for each in (env, twin))
        assert np.array_equal(one[0], other[0])
        assert all(np.array_equal(one[-1][name], other[-1][name]) for name in one[-1])


# --- a motor that lags ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ratio", [1e-300, 1e-12, 1e-6, 9.9e-6, 1.1e-5, 1e-3, 0.7, 1.99, 2.01, 30.0, 1e3])
def test_a_lagging_share_and_its_mean_are_exact(ratio: float) -> None:
    """Check a lagging motor's share c + (s - c) exp(-x) and its mean c + (s - c)(1 - exp(-x))/x, with x = time/lag."""
    with mp.workdps(340):
        x = mp.mpf(ratio)
        wanted = [float(1 - mp.exp(-x)), float(1 - (1 - mp.exp(-x)) / x)]
        kept = [float(mp.exp(-x)), float((1 - mp.exp(-x)) / x)]
    assert motor_advance(0.0, 1.0, ratio, 1.0) == pytest.approx(wanted, rel=1e-15, abs=3e-16)
    assert motor_advance(1.0, 0.0, ratio, 1.0) == pytest.approx(kept, rel=1e-15)


FREE = Scene(body=Body(length=0.5, mass=0.1), effects=(Motor(max_torque=0.3, lag=0.1),), gravity=0.0)
RATE = 0.3 / (0.1 * 0.5 * 0.5)


@pytest.mark.parametrize("dt", [1e-7, 0.004, 0.05, 0.7])
@pytest.mark.parametrize(("method", "hold"), [("rk4", 1), ("velocity_verlet", 1), ("velocity_verlet", 3), ("ab3", 4)])
def test_a_lagging_motor_turns_a_free_bob_as_the_closed_form_says(method: str, hold: int, dt: float) -> None:
    """Check a free bob with a lagging motor against v = rate (t - lag (1 - exp(-t/lag))) at control steps."""
    machine = Machine(FREE, method, backend="python", hold=hold)
    state = machine.state(0.1, 0.0)
    for n in range(1, 13):
        assert machine.advance(state, 1.0, dt / hold, hold) == 0
        with mp.workdps(40):
            left = 1 - mp.exp(-mp.mpf(n) * dt / mp.mpf(0.1))
            speed = RATE * (mp.mpf(n) * dt - mp.mpf(0.1) * left)
        assert state[machine.names.index("motor_state")] == pytest.approx(float(left), rel=1e-14)
        # Shares are of order 1, so that the relative rounding error of the mean grows as 2 lag/t below a lag.
        assert state[VELOCITY] == pytest.approx(float(speed), rel=2e-14 * (1.0 + 0.1 / dt))


def test_without_lag_a_motor_is_the_motor_that_never_had_one() -> None:
    """Check that a motor with lag 0 gives the program of a motor without lag, for single runs and batches."""
    plain, zero = SCENES["lab"], SCENES["lab"].replace(lag=0.3).replace(lag=0.0)
    method, task = integrators.get("rk4"), TASKS["swing_up"]
    assert program(zero, method).text == program(plain, method).text
    texts = [batch_program(scene, method, ("energy",), frozenset(), task.goal).text
             for scene in (zero, plain)]
    assert texts[0] == texts[1]
    assert "motor_state" not in texts[0]
    assert "motor_state" in program(plain.replace(lag=0.3), method).text


def test_a_shorter_lag_is_felt_sooner() -> None:
    env = gym.make_vec("LabPendulum-v0", num_envs=2, lag=[0.1, 0.2], backend="python")
    env.reset(seed=0, options={"angle": 0.0, "velocity": 0.0})
    velocity = env.step(np.ones((2, 1), dtype=np.float32))[-1]["velocity"]
    assert velocity[0] > 1.5 * velocity[1] > 0.0


@pytest.mark.parametrize("scene", [SCENES["lab"].replace(lag=0.2), SCENES["windy"]])
def test_scenes_that_remember_can_be_copied(scene: Scene) -> None:
    for twin in (copy.deepcopy(scene), pickle.loads(pickle.dumps(scene)), Scene.from_dict(scene.to_dict())):
        assert twin == scene
        assert hash(twin) == hash(scene)
        assert program(twin, integrators.get("rk4")).text == program(scene, integrators.get("rk4")).text
