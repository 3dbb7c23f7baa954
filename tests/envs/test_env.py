"""Tests of ``LabPendulum-v0`` through Gymnasium's interface."""

from __future__ import annotations

import copy
import math
import pickle
import re
from itertools import product
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from choice import FAMILIAR, check_pairs, pairs
from gymnasium.utils.env_checker import check_env

import integrators
import pendulum_env
from pendulum_env import SCENES, LabPendulumEnv, LabPendulumVectorEnv, Scene, SceneError, rollout
from pendulum_env.engine.kernels import EngineError
from pendulum_env.engine.machine import DIAGNOSTICS
from pendulum_env.physics import exact
from pendulum_env.tasks import TASKS
from pendulum_env.tasks.action import ActionError

pytestmark = pytest.mark.usefixtures("all_interpreted")

AXES = (list(SCENES), list(integrators.METHODS), list(TASKS))
EVERY = [*product(SCENES, ["rk4"], TASKS), *(case for case in pairs(AXES) if case[1] != "rk4")]
"""Scenes, methods and tasks: rk4 in every combination; of other methods, enough for the pairs of values."""
RENDERED = [*product(["lab"], TASKS), *(pytest.param(scene, "free", marks=() if scene in FAMILIAR else pytest.mark.slow)
                                        for scene in SCENES if scene != "lab")]
COMPILED = ("lab", "windy")
"""Scenes in which Gymnasium's checker runs rk4 compiled."""
KEYS = {"time", "angle", "velocity", "kinetic_energy", "potential_energy", "energy", "work", "heat", "energy_residual"}


def make(**options: Any) -> LabPendulumEnv:
    env = gym.make("LabPendulum-v0", **options).unwrapped
    assert isinstance(env, LabPendulumEnv)
    return env


def act(value: float = 0.5) -> Any:
    return np.array([value], dtype=np.float32)


def test_how_many_combinations() -> None:
    """Every pair of values, but of methods in scenes every kind: LAB_PENDULUM_GRID=full takes each method in each."""
    print(f"\n{len(EVERY)} combinations of scene x method x task go through Gymnasium's checker")
    check_pairs(EVERY, AXES)


@pytest.mark.quick(
    "textbook-rk4-free", "lab-rk4-swing_up", "lab-rk4-balance", "lab-rk4-track", "sticky_bearing-rk4-swing_up",
    "windy-rk4-swing_up", "exercise-rk4-gymnasium", "kapitza-rk4-dm_control"
)
@pytest.mark.parametrize(("scene", "method", "task"), EVERY)
def test_gymnasiums_checker_warnings_as_errors(scene: str, method: str, task: str) -> None:
    backend = "compiled" if method == "rk4" and scene in COMPILED else "python"
    check_env(make(scene=scene, task=task, integrator=method, backend=backend), skip_render_check=True)


@pytest.mark.quick("lab-swing_up", "lab-track")
@pytest.mark.parametrize(("scene", "task"), RENDERED)
def test_gymnasiums_checker_of_frames(scene: str, task: str) -> None:
    """Every task, and every scene; quick tests take the familiar ones."""
    check_env(make(scene=scene, task=task))


# --- same bits -------------------------------------------------------------------------------------------------------


def episode(env: LabPendulumEnv, steps: int, seed: int) -> list[Any]:
    random = np.random.default_rng(seed)
    found = []
    for _ in range(steps):
        observation, reward, ended, _, info = env.step(act(random.uniform(-1, 1)))
        found.append((observation.tobytes(), reward, ended, info))
    return found


@pytest.mark.parametrize(("scene", "method"), [("lab", "rk4"), ("sticky_bearing", "velocity_verlet"),
                                               ("exercise_large", "implicit_midpoint")])
def test_same_seed_and_actions_same_bits(scene: str, method: str) -> None:
    first, second, slow = (make(scene=scene, integrator=method, task="swing_up", substeps=2, backend=backend)
                           for backend in ("compiled", "compiled", "python"))
    starts = [env.reset(seed=7) for env in (first, second, slow)]
    assert all(start[0].tobytes() == starts[0][0].tobytes() and start[1] == starts[0][1] for start in starts)
    assert episode(first, 60, 1) == episode(second, 60, 1) == episode(slow, 60, 1)


def copies(env: LabPendulumEnv) -> dict[str, LabPendulumEnv]:
    fresh = make(**env.spec.kwargs)  # type: ignore[union-attr]
    fresh.set_state(env.get_state())
    return {"pickle": pickle.loads(pickle.dumps(env)), "deepcopy": copy.deepcopy(env), "state": fresh}


@pytest.mark.parametrize("more", [
    {}, {"task": "track"}, {"task": "gymnasium", "velocity_bound": 1.0}, {"scene": "windy", "diagnostics": ("error",)},
    {"observation": "history", "observation_delay": 0.04, "action_noise": 0.1, "sensor": {"noise": 0.01}}],
    ids=["plain", "track", "bounded", "error", "sensor"])
def test_a_look_is_the_last_observation_and_changes_nothing(more: dict[str, Any]) -> None:
    env, other = make(**more), make(**more)
    seen, _ = env.reset(seed=3)
    other.reset(seed=3)
    for _ in range(8):
        assert env.look().tolist() == env.look().tolist() == seen.tolist()
        seen, *rest = env.step(act(0.7))
        wanted, *others = other.step(act(0.7))
        assert seen.tolist() == wanted.tolist()
        assert rest == others
    other.reset()
    other.set_state(env.get_state())
    assert other.look().tolist() == seen.tolist()
    with pytest.raises(gym.error.ResetNeeded):
        make(**more).look()


@pytest.mark.quick("after steps", "after the end")
@pytest.mark.parametrize("moment", ["before reset", "after reset", "after steps", "after rendering", "after the end"])
def test_the_whole_state_resumes_bit_for_bit(moment: str) -> None:
    env = make(scene="sticky_bearing", task="balance", render_mode="rgb_array", substeps=3)
    if moment != "before reset":
        env.reset(seed=3)
    if moment in ("after steps", "after rendering"):
        episode(env, 5, 0)
    if moment == "after rendering":
        env.render()
    if moment == "after the end":
        while not env.step(act(1.0))[2]:
            pass
    others = copies(env)

    def future(resumed: LabPendulumEnv) -> list[Any]:
        start = resumed.reset(seed=5)[1] if moment == "before reset" else None
        frames = [] if start else [resumed.render().tobytes()]  # type: ignore[union-attr]
        steps = episode(resumed, 20, 2)
        frames.append(resumed.render().tobytes())  # type: ignore[union-attr]
        observation, info = resumed.reset()
        return [start, *steps, *frames, observation.tobytes(), info]

    expected = future(env)
    for kind, other in others.items():
        for at, (wanted, found) in enumerate(zip(expected, future(other), strict=True)):
            assert wanted == found, f"{kind}: part {at} differs"


def test_rendering_changes_nothing() -> None:
    seen, unseen = make(render_mode="rgb_array"), make(render_mode="rgb_array")
    seen.reset(seed=0)
    unseen.reset(seed=0)
    for _ in range(10):
        seen.render()
        assert seen.step(act())[4] == unseen.step(act())[4]
    assert seen.get_state() == unseen.get_state()


def test_every_call_returns_objects_of_its_own() -> None:
    env = make()
    env.reset(seed=0)
    first = env.step(act())
    kept = (first[0].copy(), dict(first[4]))
    env.step(act())
    assert np.array_equal(first[0], kept[0])
    assert first[4] == kept[1]


# --- physics through the interface -----------------------------------------------------------------------------------


def test_it_moves_as_the_pendulum_does() -> None:
    """Compare a swing from 1 rad with elliptic functions, within the error of rk4 at this step."""
    env = make(scene="vacuum", task="free", dt=0.02, substeps=10)
    env.reset(options={"angle": 1.0, "velocity": 0.5})
    for k in range(1, 101):
        info = env.step(act())[4]
        angle, velocity = exact.pendulum(0.02 * k, 1.0, 0.5, env.omega0)
        assert info["angle"] == pytest.approx(angle, abs=1e-9)
        assert info["velocity"] == pytest.approx(velocity, abs=4e-9)
    assert info["time"] == pytest.approx(2.0, abs=1e-12)


def test_it_is_the_rollout() -> None:
    env = make(scene="sticky_bearing", task="free", dt=0.01, diagnostics=("energy", "heat_by_effect"))
    env.reset()
    r = rollout("sticky_bearing", dt=0.01, duration=1.0, control=0.5, diagnostics=("energy", "heat_by_effect"))
    for k in range(1, 101):
        info = env.step(act(0.5))[4]
        assert (info["angle"], info["velocity"]) == (r.angle[k], r.velocity[k])
        assert info["energy_residual"] == pytest.approx(r.energy_residual[k], abs=1e-15)
        assert info["heat_coulomb_friction"] == r.heat_by_effect["coulomb_friction"][k]


def test_info_has_its_keys_always_as_floats() -> None:
    for diagnostics, keys in ((("energy",), KEYS), ((), set()),
                              (("energy", "heat_by_effect"), {*KEYS, "heat_linear_drag", "heat_quadratic_drag"})):
        env = make(diagnostics=diagnostics)
        for info in (env.reset(seed=0)[1], env.step(act())[4]):
            assert info.pop("stop_reason") == ""
            assert set(info) == keys
            assert all(type(value) is float and math.isfinite(value) for value in info.values())


def test_types_are_what_gymnasium_says() -> None:
    env = make(task="balance")
    observation, _ = env.reset(seed=0)
    assert observation.dtype == np.float32
    observation, reward, terminated, truncated, _ = env.step(act())
    assert (type(reward), terminated, truncated) == (float, False, False)
    assert observation in env.observation_space


def read(equation: str, **numbers: float) -> float:
    """Return the value of an equation in mathematical notation, where ² is a square and a space is a product.

    One that is 1 under a condition, else 0, has its parts joined by "and".
    """
    if found := re.fullmatch("1 if (.*), else 0", equation):
        return float(all(read(part, **numbers) for part in found[1].split(" and ")))
    typed = re.sub(r"(?<=[\w)]) (?=[\w(])", " * ", equation.replace("²", "**2"))
    return float(eval(typed, {"__builtins__": {"abs": abs}}, numbers))


def test_the_page_says_what_the_three_tasks_pay() -> None:
    page = LabPendulumEnv.__doc__ or ""
    for row in ("| `free` | 0 | - |", "| `swing_up` | -(phi² + 0.1 (velocity/omega0)² + 0.001 action²) | - |",
                '| `balance` | 1 - (phi/0.5)² - 0.001 action² | abs(phi) > 0.5: "fell" |'):
        assert row in page


@pytest.mark.parametrize("task", TASKS)
def test_rewards_are_those_of_the_page(task: str) -> None:
    """Compare rewards with the equations in the table of the class docstring, evaluated as mathematics."""
    env = make(task=task)
    env.reset(seed=0, options={"angle": 3.1, "velocity": 0.2})
    _, reward, _, _, info = env.step(act(0.5))
    phi = math.remainder(info["angle"] - math.pi, 2 * math.pi)
    error = info["angle"] - 0.5 * math.sin(2.0 * math.pi * info["time"] / 4.0)
    page = LabPendulumEnv.__doc__ or ""
    (equation,) = re.findall(rf"\| `{task}` \| (.*?) \|", page)
    equation, of_before, _ = equation.partition(" before the step")
    state = {"phi": 3.1 - math.pi, "velocity": 0.2} if of_before else {"phi": phi, "velocity": info["velocity"]}
    assert reward == pytest.approx(
        read(equation, **state, omega0=env.omega0, action=0.5, error=error, pi=math.pi), rel=1e-12)
    assert all(f'"{name}"' in page for name in DIAGNOSTICS)


@pytest.mark.parametrize(("task", "centre"), [("swing_up", 0.0), ("balance", math.pi)])
def test_starts_fill_their_box(task: str, centre: float) -> None:
    env = make(task=task)
    infos = [env.reset(seed=seed)[1] for seed in range(300)]
    angles = np.array([info["angle"] for info in infos]) - centre
    speeds = np.array([info["velocity"] for info in infos]) / env.omega0
    for values, bound in ((angles, 0.1), (speeds, 0.05)):
        assert np.max(np.abs(values)) <= bound * (1 + 1e-12)
        assert np.max(values) > 0.95 * bound
        assert np.min(values) < -0.95 * bound
    assert make(task="free").reset(seed=1)[1]["angle"] == pytest.approx(SCENES["lab"].run.angle)


def test_swing_up_has_to_pump() -> None:
    """Check that full torque in one direction cannot lift the bob over the top, since the motor is weaker than m g L.
    """
    env = make(task="swing_up")
    env.reset(seed=0)
    assert max(abs(env.step(act(1.0))[4]["angle"]) for _ in range(500)) < 1.2
    env.reset(seed=0)
    info: dict[str, Any] = {"velocity": 1.0}
    highest = 0.0
    for _ in range(500):
        info = env.step(act(math.copysign(1.0, info["velocity"])))[4]
        highest = max(highest, abs(info["angle"]))
    assert highest > math.pi


# --- endings ---------------------------------------------------------------------------------------------------------


def run_to_the_end(env: LabPendulumEnv, options: dict[str, Any], action: float = 0.0) -> dict[str, Any]:
    env.reset(seed=0, options=options)
    for _ in range(5000):
        _, _, ended, truncated, info = env.step(act(action))
        assert truncated is False
        assert all(math.isfinite(value) for key, value in info.items() if key != "stop_reason")
        if ended:
            return info
        assert info["stop_reason"] == ""
    raise AssertionError("the episode did not end")


def test_every_ending_has_its_name() -> None:
    assert run_to_the_end(make(task="balance"), {"angle": 3.0})["stop_reason"] == "fell"
    assert run_to_the_end(make(speed_limit=5.0, task="free"), {"angle": 3.0})["stop_reason"] == "speed_limit"
    wire = make(scene="exercise_large", task="free")
    assert run_to_the_end(wire, {"angle": 0.0, "velocity": 10.0})["stop_reason"] == "slack"
    euler = make(scene="textbook", task="free", integrator="forward_euler", dt=0.5, speed_limit=math.inf)
    assert run_to_the_end(euler, {"angle": 0.5})["stop_reason"] == "diverged"


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_speed_limit_holds_both_ways_round(side: float) -> None:
    """Released 1 rad from the top, the bob passes the bottom at 2 omega0 cos(1/2) = 9.25 rad/s in either direction."""
    env = make(scene="lab", task="free", damping="none", speed_limit=9.0)
    ended = run_to_the_end(env, {"angle": -side * (math.pi - 1.0)})
    assert ended["stop_reason"] == "speed_limit"
    assert side * ended["velocity"] > 9.0
    assert 9.0 < 2.0 * env.omega0 * math.cos(0.5) < 9.3
    assert ended["time"] < 2.0


def test_make_truncates_after_500_steps() -> None:
    env = gym.make("LabPendulum-v0", scene="vacuum", task="free")
    env.reset(seed=0)
    ends = [env.step(act())[2:4] for _ in range(500)]
    assert ends == [(False, False)] * 499 + [(False, True)]


# --- wrappers, specs, films ------------------------------------------------------------------------------------------


def test_spec_survives_json_and_the_module_prefix_registers() -> None:
    env = gym.make("pendulum_env:LabPendulum-v0", damping={"linear": {"gamma": 0.1}}, length=0.5)
    spec = gym.envs.registration.EnvSpec.from_json(env.spec.to_json())  # type: ignore[union-attr]
    again = spec.make().unwrapped
    assert again.scene == env.unwrapped.scene  # type: ignore[attr-defined]
    assert again.scene.body.length == 0.5  # type: ignore[attr-defined]


def test_scene_as_name_dict_file_and_object(tmp_path: Path) -> None:
    SCENES["lab"].save(tmp_path / "scene.json")
    for scene in ("lab", SCENES["lab"].to_dict(), SCENES["lab"], str(tmp_path / "scene.json")):
        assert make(scene=scene).scene == SCENES["lab"]


@pytest.mark.slow
def test_record_video_is_playable_and_runs_at_true_speed(tmp_path: Path) -> None:
    import imageio_ffmpeg

    env = gym.make("LabPendulum-v0", render_mode="rgb_array", render_size=160, dt=0.04)
    env = gym.wrappers.RecordVideo(env, str(tmp_path / "films"), episode_trigger=lambda _: True, disable_logger=True)
    env.reset(seed=0)
    for _ in range(50):
        env.step(act(1.0))
    env.close()
    (film,) = (tmp_path / "films").glob("*.mp4")
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(str(film))
    assert seconds == pytest.approx(50 * 0.04, abs=0.08)
    assert frames == pytest.approx(51, abs=1)


def test_frame_rate_is_one_over_dt() -> None:
    assert make(dt=0.05, render_mode="rgb_array").metadata["render_fps"] == 20.0
    assert LabPendulumEnv.metadata["render_fps"] == 50


def test_close_twice_and_render_without_a_mode() -> None:
    env = make(render_mode=None)
    env.reset(seed=0)
    with pytest.warns(UserWarning, match="draws nothing"):
        assert env.render() is None
    env.close()
    env.close()


# --- bad input -------------------------------------------------------------------------------------------------------

BAD: dict[str, tuple[dict[str, Any], type[Exception], str]] = {
    "scene": ({"scene": "labb"}, SceneError, "did you mean lab or lab_rod?"),
    "scene type": ({"scene": 3}, SceneError, "A scene is a preset's name"),
    "integrator": ({"integrator": "rk5"}, integrators.MethodError, "did you mean rk4"),
    "task": ({"task": "swingup"}, SceneError, "did you mean swing_up"),
    "damping": ({"damping": "quad"}, SceneError, "did you mean quadratic?"),
    "damping in vacuum": ({"scene": "vacuum", "damping": "linear"}, SceneError, "give a number"),
    "keyword": ({"lenght": 1.0}, SceneError, "did you mean length?"),
    "dt zero": ({"dt": 0}, SceneError, "dt must be a finite number above 0"),
    "dt negative": ({"dt": -0.1}, SceneError, "dt must be"),
    "dt nan": ({"dt": math.nan}, SceneError, "dt must be"),
    "dt inf": ({"dt": math.inf}, SceneError, "dt must be"),
    "dt text": ({"dt": "0.1"}, SceneError, "dt must be"),
    "substeps zero": ({"substeps": 0}, SceneError, "substeps must be a whole number"),
    "substeps fraction": ({"substeps": 1.5}, SceneError, "substeps must be a whole number"),
    "substeps nan": ({"substeps": math.nan}, SceneError, "substeps must be a whole number"),
    "substeps true": ({"substeps": True}, SceneError, "substeps must be a whole number"),
    "diagnostics": ({"diagnostics": ("heat",)}, SceneError, "no diagnostic"),
    "render mode": ({"render_mode": "humann"}, SceneError, "render_mode"),
    "render size": ({"render_mode": "rgb_array", "render_size": 10}, ValueError, "size"),
    "backend": ({"backend": "gpu"}, EngineError, "no backend"),
    "speed limit": ({"speed_limit": -1.0}, SceneError, "speed_limit must be"),
    "mass": ({"mass": -1.0}, SceneError, "mass must be"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_keywords_give_one_clear_error(case: str) -> None:
    options, kind, words = BAD[case]
    with pytest.raises(kind) as error:
        LabPendulumEnv(**options)
    assert words in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("action", [[math.nan], [math.inf], [0.0, 0.0], 0.5, [[0.5]], ["left"], [None]])
def test_bad_actions_are_refused_and_change_nothing(action: Any) -> None:
    env = make()
    env.reset(seed=0)
    before = env.get_state()
    with pytest.raises(ActionError, match="An action must"):
        env.step(np.array(action, dtype=object) if "left" in str(action) else np.array(action))
    assert env.get_state() == before


def test_actions_are_clipped() -> None:
    first, second = make(), make()
    first.reset(seed=0)
    second.reset(seed=0)
    assert first.step(np.array([1e308]))[4] == second.step(act(1.0))[4]


def test_step_and_render_before_reset() -> None:
    env = make(render_mode="rgb_array")
    for call in (lambda: env.step(act()), env.render):
        with pytest.raises(gym.error.ResetNeeded):
            call()


@pytest.mark.parametrize(("options", "words"), [({"angel": 1.0}, "did you mean angle?"),
                                                ({"angle": math.nan}, "angle must be"),
                                                ({"velocity": "fast"}, "velocity must be"),
                                                ({"angle": 1e300}, "angle must be between"),
                                                ({"velocity": 1e39}, "velocity must be between")])
def test_bad_reset_options(options: dict[str, Any], words: str) -> None:
    kept = dict(options)
    with pytest.raises(SceneError, match=words.replace("?", r"\?")):
        make().reset(options=options)
    assert repr(options) == repr(kept)


def test_a_foreign_state_is_refused() -> None:
    env, other = make(), make(scene="vacuum")
    env.reset(seed=0)
    with pytest.raises(SceneError, match="another scene"):
        other.set_state(env.get_state())
    with pytest.raises(SceneError, match="another step"):
        make(substeps=2).set_state(env.get_state())


@pytest.mark.parametrize("spoil", [{}, None, {"state": [1.0]}, {"state": [math.nan] * 10}, {"action": math.nan},
                                   {"trail": [math.inf]}, {"random": {}}, {"action": 5}, {"action": 1e308},
                                   {"action": True}, {"trail": None}, {"trail": 5}, {"trail": [[1.0]]}])
def test_a_spoilt_state_is_refused_and_changes_nothing(spoil: Any) -> None:
    env = make()
    env.reset(seed=0)
    before = env.get_state()
    with pytest.raises(SceneError):
        env.set_state({**before, **spoil} if spoil else spoil)
    assert env.get_state() == before


@pytest.mark.parametrize("entry", [1e300, True, np.True_, "1", "x", None, 10**400, [1], 1j, -math.inf])
def test_a_state_of_wrong_entries_is_refused(entry: Any) -> None:
    env = make(scene="windy", diagnostics=("energy", "flow", "error"))
    env.reset(seed=0)
    before = env.get_state()
    size = len(before["state"])
    wrong = [[entry] * size, (entry,) * size, *([*before["state"][:i], entry, *before["state"][i + 1:]]
                                                for i in range(4))]
    for state in (*wrong, 5, {}, dict.fromkeys(range(size), 1.0), set(range(size)), np.zeros((size, 2))):
        with pytest.raises(SceneError):
            env.set_state({**before, "state": state})
    assert env.get_state() == before


@pytest.mark.parametrize(("place", "value", "words"), [
    (0, 0.5, "index .* whole"), (0, -1.0, "index .* whole"), (1, 4.0, "angle .* within"), (2, 0.25, "turns .* 1/2"),
    (2, 1e300, "turns .* within"), (3, 1e151, "velocity .* within"), (3, -1e151, "velocity .* within")])
def test_numbers_that_no_run_reaches_are_refused(place: int, value: float, words: str) -> None:
    env = make(scene="lab")
    env.reset(seed=0)
    before = env.get_state()
    state = list(before["state"])
    state[place] = value
    with pytest.raises(SceneError, match=words):
        env.set_state({**before, "state": state})
    assert env.get_state() == before


@pytest.mark.parametrize("angle", [math.pi, -math.pi])
def test_the_edges_of_what_a_run_reaches_are_taken(angle: float) -> None:
    env = make(scene="lab", backend="python")
    env.reset(seed=0)
    before = env.get_state()
    env.set_state({**before, "state": [before["state"][0], angle, *before["state"][2:]]})
    assert env.get_state()["state"][1] == angle


def test_every_number_of_a_restored_state_leads_on_to_numbers() -> None:
    for given in ({"scene": "windy", "diagnostics": ("energy", "flow")}, {"integrator": "ab3", "compensated": False}):
        env = make(**given)
        env.reset(seed=0)
        env.step(act())
        before = env.get_state()
        for place in range(len(before["state"])):
            for value in (1e300, -1e300, 1.7e308):
                state = list(before["state"])
                state[place] = value
                try:
                    env.set_state({**before, "state": state})
                except SceneError:
                    continue
                observation, _, _, _, info = env.step(act())
                assert np.all(np.isfinite(observation))
                assert all(isinstance(said, str) or not math.isnan(said) for said in info.values()), place


@pytest.mark.parametrize("spoil", [
    {"state": {"state": 1.5, "inc": 1}}, {"state": {"state": -1, "inc": 1}}, {"state": {"state": 2**200, "inc": 1}},
    {"state": {"state": 1, "inc": 2}}, {"state": None}, {"state": {}}, {"has_uint32": 10**40},
    {"uinteger": -1}, {"uinteger": "1"}, {"bit_generator": "MT19937"}, {"bit_generator": np.zeros(3)}])
def test_random_states_that_are_none_are_refused(spoil: dict[str, Any]) -> None:
    env = make()
    env.reset(seed=0)
    before = env.get_state()
    with pytest.raises(SceneError, match="random"):
        env.set_state({**before, "random": {**before["random"], **spoil}})
    assert env.get_state() == before


def test_a_state_made_for_an_array_is_foreign() -> None:
    env = make()
    env.reset(seed=0)
    saved = env.get_state()
    with pytest.raises(SceneError, match="another step"):
        env.set_state({**saved, "made_for": {**saved["made_for"], "step": np.zeros(3)}})


def test_copies_do_not_depend_on_what_the_environment_was_made_from(tmp_path: Path) -> None:
    """Check that copies keep the scene of the environment when its scene file or dict changes."""
    SCENES["lab"].save(tmp_path / "scene.json")
    given = SCENES["lab"].to_dict()
    for env in (make(scene=str(tmp_path / "scene.json")), make(scene=given)):
        pickled = pickle.dumps(env)
        SCENES["lab"].replace(gravity=1.0).save(tmp_path / "scene.json")
        given["gravity"] = 1.0
        assert pickle.loads(pickled).scene == copy.deepcopy(env).scene == SCENES["lab"]
        (tmp_path / "scene.json").unlink()
        assert pickle.loads(pickled).scene == SCENES["lab"]


class Renamed(LabPendulumEnv):
    """Subclass of the environment with its own __init__ and attribute."""

    def __init__(self, nickname: str) -> None:
        super().__init__(scene="vacuum")
        self.nickname = nickname


def test_a_subclass_with_its_own_init_can_be_copied() -> None:
    env = Renamed("Leon")
    env.reset(seed=0)
    other = pickle.loads(pickle.dumps(env))
    assert other.nickname == "Leon"
    assert other.step(act())[4] == env.step(act())[4]


def test_public_names_are_there() -> None:
    for name in pendulum_env.__all__:
        assert getattr(pendulum_env, name) is not None
    assert isinstance(pendulum_env.SCENES["lab"], Scene)
    with pytest.raises(AttributeError, match="no attribute 'rolout'"):
        pendulum_env.rolout  # noqa: B018


def test_diagnostics_may_be_a_generator() -> None:
    """Check that diagnostics given as a generator, which can be read only once, are reported."""
    for names in (("tension",), ("tension", "error"), ("energy",)):
        for kind in (LabPendulumEnv, LabPendulumVectorEnv):
            given: Any = (name for name in names)
            wanted = kind(backend="python", diagnostics=names).reset(seed=0)[1].keys()
            assert kind(backend="python", diagnostics=given).reset(seed=0)[1].keys() == wanted


def test_switches_paths_and_sizes_of_other_kinds_are_taken(tmp_path: Path) -> None:
    """Check that NumPy's True, a Path to a scene file and an array as a size are accepted."""
    for kind in (LabPendulumEnv, LabPendulumVectorEnv):
        wanted = kind(backend="python", compensated=True).reset(seed=0)[1].keys()
        switch: Any = np.bool_(True)
        assert kind(backend="python", compensated=switch).reset(seed=0)[1].keys() == wanted
        size: Any = np.array([60, 50])
        env = kind(backend="python", render_mode="rgb_array", render_size=size)
        assert env.render_size == (60, 50)
        place: Any = tmp_path / "scene.json"
        SCENES["lab"].replace(gravity=1.5).save(place)
        assert kind(backend="python", scene=place).scene.gravity == 1.5
        with pytest.raises(SceneError, match="cannot be read"):
            kind(backend="python", scene=tmp_path / "none.json")  # type: ignore[arg-type]
        for wrong in (np.array([[60], [50]]), np.array([60.0, 50.0]), np.array([True, False]), np.array([60])):
            with pytest.raises(SceneError, match="render_size must be"):
                kind(backend="python", render_size=wrong)  # type: ignore[arg-type]


def test_a_ragged_action_is_refused_in_a_sentence() -> None:
    env = make()
    env.reset(seed=0)
    ragged: Any = [[1], [1, 2]]
    with pytest.raises(ActionError, match="An action must have the shape"):
        env.step(ragged)
