"""The single environments within a vector: attributes, calls and saved states, beside Gymnasium's SyncVectorEnv."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from pendulum_env import SCENES, LabPendulumEnv, LabPendulumVectorEnv, SceneError, Sensor
from pendulum_env.envs.members import ATTRIBUTES, METHODS

pytestmark = [pytest.mark.usefixtures("interpreted"), pytest.mark.filterwarnings("ignore::UserWarning")]

SIZE = 3
LENGTHS = [0.3, 0.35, 0.4]
OWN = [[0.3, 0.02], [0.35, 0.03], [0.4, 0.04]]
"""Length [m] and mass [kg] of each environment."""
LIVES: dict[str, dict[str, Any]] = {
    "all that is reported": {"task": "balance", "diagnostics": ("energy", "heat_by_effect", "tension", "flow")},
    "dry friction": {"scene": "sticky_bearing", "integrator": "velocity_verlet", "substeps": 2},
    "gusts": {"scene": "windy", "integrator": "heun", "diagnostics": ("energy", "flow")},
    "history and lag": {"scene": "windy", "max_torque": 0.02, "lag": 0.1, "integrator": "ab3", "substeps": 5,
                        "task": "free"},
    "slack and remainders": {"scene": "exercise_large", "slack": "warn", "task": "free", "compensated": True},
}
"""Settings of environments, one for each kind of state."""
UNSEEN = ("action", "trail", "past", "seen")
"""Keys of a state that only frames show."""


def native(**options: Any) -> Any:
    return gym.make_vec("LabPendulum-v0", num_envs=SIZE, **{"max_episode_steps": 13, **options})


def sync(**options: Any) -> Any:
    """Gymnasium's vector of single environments, each with its own of the values of lists."""
    def one(place: int) -> Callable[[], Any]:
        own = {name: value[place] if isinstance(value, list) else value for name, value in options.items()}
        return lambda: gym.make("LabPendulum-v0", **{"max_episode_steps": 13, **own})

    return gym.vector.SyncVectorEnv([one(place) for place in range(SIZE)])


def actions(count: int) -> Any:
    return np.random.default_rng(1).uniform(-1.0, 1.0, (count, SIZE, 1)).astype(np.float32)


def same(one: Any, other: Any) -> bool:
    """True if two results of ``step`` or ``reset`` are equal in all but the infos."""
    return all(np.array_equal(mine, his) for mine, his in zip(one[:-1], other[:-1], strict=True))


# --- attributes and calls ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("options", [{}, {"length": LENGTHS, "mass": [0.02, 0.03, 0.04], "speed_limit": [9.0, 8.0, 7.0],
                                          "render_mode": "rgb_array", "render_size": 60, "task": "balance"}])
def test_every_attribute_is_that_of_gymnasiums_vector(options: dict[str, Any]) -> None:
    mine, theirs = native(**options), sync(**options)
    for vector in (mine, theirs):
        vector.reset(seed=2)
    for name in (*ATTRIBUTES, *SCENES["lab"].parameters(), "body", "medium", "effects", "gravity"):
        if hasattr(LabPendulumEnv, name) or name in ATTRIBUTES:
            found, wanted = mine.get_attr(name), theirs.get_attr(name)
            if name == "metadata":  # Gymnasium 1.1 writes the vector's mode into those of its single environments
                wanted = tuple({key: one[key] for key in one if key != "autoreset_mode"} for one in wanted)
            assert type(found) is tuple
            assert found == wanted, name
            assert [*map(type, found)] == [*map(type, wanted)], name
    for name, more in (("has_wrapper_attr", ("dt",)), ("has_wrapper_attr", ("render",)), ("get_wrapper_attr", ("dt",)),
                       ("has_wrapper_attr", ("nothing",))):
        assert mine.call(name, *more) == theirs.call(name, *more)
    assert mine.get_attr("length") == tuple(options.get("length", [0.353] * SIZE))


def test_frames_are_those_of_each() -> None:
    vector = native(render_mode="rgb_array", render_size=60)
    vector.reset(seed=0)
    frames = vector.call("render")
    assert all(np.array_equal(one, other) for one, other in zip(frames, vector.render(), strict=True))
    assert np.array_equal(vector.call_at(2, "render")[0], frames[2])


def test_attributes_of_ones_own_are_set_as_in_gymnasiums_vector() -> None:
    mine, theirs = native(), sync()
    for vector in (mine, theirs):
        vector.set_attr("level", [1, 2, 3])
        vector.set_attr("shared", "easy")
        vector.set_attr("double", lambda value: 2 * value)
        assert vector.get_attr("level") == (1, 2, 3)
        assert vector.get_attr("shared") == ("easy",) * SIZE
        assert vector.call("double", 3) == (6,) * SIZE
        assert vector.call("set_wrapper_attr", "level", 5) == (True,) * SIZE
        assert vector.get_attr("level") == (5,) * SIZE
    assert copy.deepcopy(mine).get_attr("level") == (5,) * SIZE
    mine.call_at([0, 2], "set_wrapper_attr", "level", 7)
    assert mine.get_attr("level") == (7, 5, 7)
    assert mine.call_at(1, "get_wrapper_attr", "level") == (5,)


@pytest.mark.parametrize("name", ["length", "dt", "task", "integrator", "omega0", "num_threads", "angle", "method",
                                  "observation_space", "metadata", "step", "np_random_seed"])
def test_what_all_share_cannot_be_set(name: str) -> None:
    vector = native()
    before = vector.get_attr("scene")
    with pytest.raises(AttributeError, match=f"{name} cannot be assigned"):
        vector.set_attr(name, 1.0)
    with pytest.raises(AttributeError, match=f"{name} cannot be assigned"):
        vector.set_attr(name, [1.0, 2.0, 3.0])
    assert vector.get_attr("scene") == before


def test_a_single_environment_reads_its_scenes_parameters() -> None:
    env = LabPendulumEnv(length=0.5)
    assert (env.length, env.mass, env.gravity) == (0.5, 0.04, 9.81)  # type: ignore[attr-defined]
    assert env.effects == env.scene.effects  # type: ignore[attr-defined]
    assert not hasattr(env, "wind_x")  # of a scene with wind


WRONG: dict[str, tuple[Callable[[Any], Any], type[Exception], str]] = {
    "unknown": (lambda vector: vector.get_attr("lenght"), AttributeError, "have no attribute 'lenght'"),
    "of another scene": (lambda vector: vector.get_attr("wind_speed"), AttributeError, "wind_speed"),
    "step": (lambda vector: vector.call("step", 0.0), AttributeError, "'step' cannot be called or read"),
    "reset": (lambda vector: vector.call("reset"), AttributeError, "these can: get_state"),
    "no name": (lambda vector: vector.call(3), SceneError, "name"),
    "too few": (lambda vector: vector.set_attr("mine", [1.0]), SceneError, "one for each of 3 environments, not of 1"),
    "index": (lambda vector: vector.call_at(3, "dt"), SceneError, "indices from 0 to 2, not 3"),
    "twice": (lambda vector: vector.get_state([1, 1]), SceneError, "distinct indices"),
    "half": (lambda vector: vector.get_state(0.5), SceneError, "distinct indices"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_cannot_be_called_is_refused_in_a_sentence(case: str) -> None:
    call, kind, said = WRONG[case]
    vector = native()
    vector.reset(seed=0)
    with pytest.raises(kind) as caught:
        call(vector)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


# --- states -----------------------------------------------------------------------------------------------------------


@pytest.mark.quick("gusts", "slack and remainders")
@pytest.mark.parametrize("life", LIVES)
def test_states_are_those_of_gymnasiums_vector(life: str) -> None:
    """Compare also across ends of episodes, with a length and a mass for each environment."""
    options = {**LIVES[life], "length": LENGTHS}
    mine, theirs = native(**options), sync(**options)
    for vector in (mine, theirs):
        vector.reset(seed=4)
    for action in actions(16):
        assert same(mine.step(action), theirs.step(action))
        for found, wanted in zip(mine.call("get_state"), theirs.call("get_state"), strict=True):
            assert {**found, **dict.fromkeys(UNSEEN)} == {**wanted, **dict.fromkeys(UNSEEN)}


@pytest.mark.quick("dry friction")
@pytest.mark.parametrize("life", LIVES)
def test_a_state_resumes_bit_for_bit_in_all_and_in_some(life: str) -> None:
    options = {**LIVES[life], "length": LENGTHS}
    one, other, third = native(**options), native(**options), native(**options)
    one.reset(seed=4)
    third.reset(seed=9)
    for action in actions(7):
        one.step(action)
    saved = pickle.loads(pickle.dumps(one.get_state()))
    other.set_state(saved)
    third.set_state(one.get_state([2, 0]), [2, 0])
    for action in actions(20):
        after = one.step(action)
        assert same(after, other.step(action))
        some = third.step(action)
        assert np.array_equal(some[0][[0, 2]], after[0][[0, 2]])
        assert not np.array_equal(some[0][1], after[0][1])
    one.set_state(saved)
    assert np.array_equal(one.step(actions(1)[0])[0][0], replayed(saved, actions(1)[0], options))


def replayed(saved: Any, action: Any, options: dict[str, Any]) -> Any:
    """Restore a saved state in a third vector, and compare the first observation."""
    vector = native(**options)
    vector.set_state(saved)
    return vector.step(action)[0][0]


@pytest.mark.quick("history and lag")
@pytest.mark.parametrize("life", LIVES)
def test_states_go_between_vectors_and_single_environments(life: str) -> None:
    options = LIVES[life]
    vector, single = native(**options), gym.make("LabPendulum-v0", **options).unwrapped
    vector.reset(seed=4)
    for action in actions(5):
        vector.step(action)
    single.set_state(vector.call("get_state")[1])  # type: ignore[attr-defined]
    back = native(**options)
    back.set_state([single.get_state()] * SIZE)  # type: ignore[attr-defined]
    for action in actions(6):
        seen, reward, *_ = vector.step(np.repeat(action[:1], SIZE, axis=0))
        alone, mine = single.step(action[0]), back.step(np.repeat(action[:1], SIZE, axis=0))
        assert np.array_equal(seen[1], alone[0])
        assert reward[1] == alone[1]
        assert np.array_equal(mine[0], np.repeat(seen[1:2], SIZE, axis=0))
    for action in actions(20):  # through a new episode, whose start may be drawn
        together = np.repeat(action[:1], SIZE, axis=0)
        assert np.array_equal(back.step(together)[0], np.repeat(vector.step(together)[0][1:2], SIZE, axis=0))
    state = single.get_state()  # type: ignore[attr-defined]
    for each in (back, native(**options)):  # also before the first reset
        each.call("set_state", state)
        assert [one["state"] for one in each.call("get_state")] == [state["state"]] * SIZE


def test_an_ended_episode_is_still_ended() -> None:
    """Check all modes: the next step resets it, or it has to be reset, or it was reset before the state was saved."""
    for mode in ("NextStep", "SameStep", "Disabled"):
        one, other = (native(autoreset_mode=mode, max_episode_steps=3) for _ in range(2))
        one.reset(seed=1)
        for action in actions(3):
            one.step(action)
        other.set_state(one.get_state())
        for vector in (one, other):
            if mode == "Disabled":
                with pytest.raises(gym.error.ResetNeeded, match="Episodes that have ended: 3"):
                    vector.step(actions(1)[0])
                vector.reset(options={"reset_mask": np.array([True, True, True])})
        assert same(one.step(actions(1)[0]), other.step(actions(1)[0]))


def test_frames_after_a_state_begin_a_new_trail() -> None:
    vector = native(render_mode="rgb_array", render_size=60, render_panels=("apparatus", "history"))
    vector.reset(seed=1)
    saved = vector.get_state()
    first = vector.render()
    for action in actions(4):
        vector.step(action)
    vector.set_state(saved)
    assert all(np.array_equal(one, other) for one, other in zip(vector.render(), first, strict=True))


def spoilt(**changes: Any) -> Callable[[dict[str, Any]], Any]:
    return lambda saved: {**saved, **changes}


BAD: dict[str, tuple[Callable[[dict[str, Any]], Any], str]] = {
    "nothing": (lambda saved: None, "must be the dict that get_state returned"),
    "a key less": (lambda saved: {name: saved[name] for name in saved if name != "over"}, "over"),
    "method": (lambda saved: spoilt(made_for={**saved["made_for"], "integrator": "heun"})(saved), "another integrator"),
    "effects": (lambda saved: spoilt(made_for=3)(saved), "another effects"),
    "length": (lambda saved: spoilt(numbers={**saved["numbers"], "omega0": saved["numbers"]["omega0"] + 1.0})(saved),
               "another pendulum than that of environment 0: its omega0"),
    "numbers": (spoilt(numbers={}), "numbers in a state to restore must be a dict"),
    "shape": (lambda saved: spoilt(state={**saved["state"], "v": np.zeros(2)})(saved), "v in a state to"),
    "nan": (lambda saved: spoilt(state={**saved["state"], "v": np.full(SIZE, np.nan)})(saved), "v in a state"),
    "angle": (lambda saved: spoilt(state={**saved["state"], "q": np.full(SIZE, 4.0)})(saved), "angle in a state"),
    "steps": (lambda saved: spoilt(state={**saved["state"], "index": np.full(SIZE, -1.0)})(saved), "index in a state"),
    "half a step": (lambda saved: spoilt(state={**saved["state"], "index": np.full(SIZE, 0.5)})(saved),
                    "index in a state to restore must be a whole number"),
    "turns": (lambda saved: spoilt(state={**saved["state"], "turns": np.array([0.0, 0.5, 1.0 / 3.0])})(saved),
              "turns in a state to restore must be a multiple of 1/2, not 0.333"),
    "speed": (lambda saved: spoilt(state={**saved["state"], "v": np.array([0.0, -1e151, 0.0])})(saved),
              "velocity in a state to restore must be within"),
    "random": (spoilt(random=np.zeros((4, SIZE))), "random in a state to restore must be an array"),
    "increment": (spoilt(random=np.zeros((4, SIZE), dtype=np.uint64)), "odd increments"),
    "over": (spoilt(over=[False] * SIZE), "over in a state to restore must be an array"),
    "too few singles": (lambda saved: [], "one state for each of 3 environments, not 0"),
    "bad singles": (lambda saved: [saved] * SIZE, "must be the dict that get_state returned, with made_for, state"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_states_are_refused_and_change_nothing(case: str) -> None:
    spoil, said = BAD[case]
    vector, twin = native(), native()
    for each in (vector, twin):
        each.reset(seed=1)
    with pytest.raises(SceneError) as caught:
        vector.set_state(spoil(vector.get_state()))
    assert said in str(caught.value)
    assert same(vector.step(actions(1)[0]), twin.step(actions(1)[0]))


def test_states_of_other_vectors_are_refused() -> None:
    vector, other = native(length=LENGTHS), native(length=LENGTHS)
    for each in (vector, other):
        each.reset(seed=1)
    other.set_state(vector.get_state(1), 1)
    with pytest.raises(SceneError, match="another pendulum than that of environment 2"):
        other.set_state(vector.get_state(1), 2)
    with pytest.raises(SceneError, match="another scene"):
        other.call("set_state", vector.call("get_state")[1])
    with pytest.raises(SceneError, match="must be a dict with"):
        native(diagnostics=()).set_state(vector.get_state())
    with pytest.raises(gym.error.ResetNeeded, match="before the first set_state"):
        native(length=LENGTHS).set_state(vector.get_state(1), 1)
    estimating = LabPendulumVectorEnv(2, diagnostics=("energy", "error"))
    with pytest.raises(SceneError, match="cannot be saved"):
        estimating.get_state()


MORE: dict[str, dict[str, Any]] = {
    "ranges": {"randomize": {"length": (0.3, 0.4), "max_torque": [0.04, 0.05]}},
    "a delay": {"observation_delay": 0.04},
    "history": {"observation": "history", "history": 3},
    "a bench": {"randomize": {"length": ("log", 0.3, 0.4)}, "substeps": 4, "observation": "encoder",
                "sensor": Sensor(quantum=0.003, noise=0.01, dropout=0.1, rate=200.0, window=3),
                "observation_delay": (0.0, 0.03), "action_delay": (0.005, 0.045)},
    "a reference": {"task": "track"},
}
"""Options with more than the motion to save."""


@pytest.mark.quick("a delay-True", "history-False")
@pytest.mark.parametrize("fresh", [False, True])
@pytest.mark.parametrize("name", MORE)
def test_a_whole_vector_with_more_than_the_motion_goes_on_bit_for_bit(name: str, fresh: bool) -> None:
    """Episodes also end at different times afterwards, so that parameters, delays and noise are drawn anew."""
    vector = native(**MORE[name], max_episode_steps=7)
    vector.reset(seed=1)
    for action in actions(9):
        vector.step(action)
    vector.reset(options={"reset_mask": np.array([False, True, False])})  # others' parameters are drawn ahead then
    saved = pickle.loads(pickle.dumps(vector.get_state()))
    after = [vector.step(action) for action in actions(16)]
    other = native(**MORE[name], max_episode_steps=7) if fresh else vector
    other.set_state(saved)
    for one, action in zip(after, actions(16), strict=True):
        assert same(one, other.step(action))


@pytest.mark.parametrize("name", [name for name in MORE if name != "a reference"])
def test_a_vector_with_more_than_the_motion_is_saved_as_a_whole(name: str) -> None:
    vector = native(**MORE[name])
    vector.reset(seed=1)
    saved = vector.get_state()
    for part in (lambda: vector.get_state(1), lambda: vector.set_state(saved, [0, 1])):
        with pytest.raises(SceneError, match="is saved as a whole; leave out which"):
            part()
    with pytest.raises(SceneError, match="cannot be saved one by one"):
        vector.call("get_state")


def test_parameters_set_for_one_episode_are_part_of_the_state() -> None:
    vector, other = native(), native()
    vector.reset(seed=1, options={"length": np.array([0.3, 0.4, 0.5])})
    vector.step(actions(1)[0])
    saved = vector.get_state()
    other.set_state(saved)
    assert other.get_attr("omega0") == vector.get_attr("omega0")
    for action in actions(4):
        assert same(vector.step(action), other.step(action))
    third = native()
    third.reset(seed=1)
    with pytest.raises(SceneError, match="restored as a whole; leave out which"):
        third.set_state(saved, [0, 1])


BAD_MORE: dict[str, tuple[Callable[[dict[str, Any]], Any], str]] = {
    "none": (lambda more: None, "more in a state to restore must be a dict"),
    "other names": (lambda more: {**more, "episode": {"lenght": np.zeros(SIZE)}}, "with names among"),
    "shape": (lambda more: {**more, "delays": {"action_delay": np.zeros(2)}}, "action_delay in a state"),
    "ahead": (lambda more: {**more, "ahead": {}}, "ahead in a state"),
    "ready": (lambda more: {**more, "ahead": {**more["ahead"], "ready": np.zeros(SIZE)}}, "ready in a state"),
    "sensing": (lambda more: {**more, "sensing": None}, "sensing in a state"),
    "nan": (lambda more: {**more, "sensing": {**more["sensing"], "readings": more["sensing"]["readings"] * np.nan}},
            "sensing in a state"),
    "slot": (lambda more: {**more, "sensing": {**more["sensing"], "slot": 10**6}}, "sensing in a state"),
    "actions": (lambda more: {**more, "sensing": {**more["sensing"], "actions": more["sensing"]["actions"] + 3.0}},
                "sensing in a state"),
    "delay": (lambda more: {**more, "sensing": {**more["sensing"], "whole": more["sensing"]["whole"] + 9}},
              "sensing in a state"),
}


@pytest.mark.parametrize("case", BAD_MORE)
def test_bad_parts_of_a_whole_state_change_nothing(case: str) -> None:
    spoil, said = BAD_MORE[case]
    vector, twin = native(**MORE["a bench"]), native(**MORE["a bench"])
    for each in (vector, twin):
        each.reset(seed=1)
    saved = vector.get_state()
    with pytest.raises(SceneError, match=said):
        vector.set_state({**saved, "more": spoil(saved["more"])})
    with pytest.raises(SceneError, match="another sensing"):
        vector.set_state({**saved, "made_for": {**saved["made_for"], "sensing": "None"}})
    for action in actions(4):
        assert same(vector.step(action), twin.step(action))


def test_attributes_of_drawn_pendulums_are_those_of_gymnasiums_vector() -> None:
    options = {"randomize": {"length": (0.3, 0.4)}}
    mine, theirs = native(**options), sync(**options)
    for vector in (mine, theirs):
        vector.reset(seed=2)
    for name in ("omega0", "speed_limit", "scene", "length"):
        assert mine.get_attr(name) == theirs.get_attr(name)
    assert len({*mine.get_attr("omega0")}) == SIZE


def test_every_method_can_be_called() -> None:
    vector = native()
    vector.reset(seed=1)
    state = vector.call("get_state")[0]
    more = {"get_wrapper_attr": ("dt",), "has_wrapper_attr": ("dt",), "set_wrapper_attr": ("mine", 1),
            "set_state": (state,)}
    for name in METHODS:
        assert len(vector.call(name, *more.get(name, ()))) == SIZE


def test_restored_states_of_single_environments_know_what_was_before_the_step() -> None:
    """Pendulum-v1's reward is that of the state before the step."""
    vector = LabPendulumVectorEnv(2, "gymnasium", task="gymnasium", backend="python")
    vector.reset(seed=0)
    action = np.full((2, 1), 0.5, dtype=np.float32)
    for _ in range(3):
        vector.step(action)
    saved = vector.call("get_state")
    reward = vector.step(action)[1].copy()
    vector.set_state(list(saved))
    assert (vector.step(action)[1] == reward).all()


def test_there_is_no_state_before_the_first_reset() -> None:
    with pytest.raises(gym.error.ResetNeeded, match=r"reset\(\) before get_state"):
        LabPendulumVectorEnv(2, backend="python").get_state()


def test_attributes_are_those_of_the_environment_and_not_of_its_episode() -> None:
    for mass in (0.03, [0.03, 0.04]):
        vector = LabPendulumVectorEnv(2, mass=mass, randomize={"length": (0.3, 0.34)}, backend="python")
        vector.reset(seed=0)
        assert vector.get_attr("length") == (0.353, 0.353)
