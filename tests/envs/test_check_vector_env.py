"""The checker of vector environments: right ones pass, and each of many defects is caught by the check for it.

Right vector environments are Gymnasium's own. A broken one is Gymnasium's SyncVectorEnv with one defect.
"""

from __future__ import annotations

import copy
import subprocess
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from beside import environment
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from readme_code import ROOT

from pendulum_env.tasks import TASKS
from pendulum_env.testing import VectorCheck, VectorReport, check_vector_env


class Walk(gym.Env[Any, Any]):
    """Single environment: a step to the left or right, until the place is beyond 1 or nine steps are taken."""

    def __init__(self) -> None:
        self.observation_space = gym.spaces.Box(-9.0, 9.0, (2,), np.float32)
        self.action_space = gym.spaces.Box(-1.0, 1.0, (1,), np.float32)
        self.place, self.taken = np.zeros(2), 0

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self.place, self.taken = self.np_random.uniform(-0.5, 0.5, 2), 0
        return self.place.astype(np.float32), {"place": float(self.place[0])}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.place, self.taken = self.place + 0.4 * np.asarray(action, dtype=np.float64), self.taken + 1
        far = bool(abs(self.place[0]) > 1.0)
        return (self.place.astype(np.float32), -abs(float(self.place[0])), far, self.taken >= 9,
                {"place": float(self.place[0]), "far": "far" if far else "near"})


class Right(SyncVectorEnv):
    """Gymnasium's vector of walks, which can be pickled."""

    def __init__(self, num_envs: int = 1, autoreset_mode: str | AutoresetMode = "NextStep", **more: Any) -> None:
        super().__init__([Walk] * num_envs, autoreset_mode=autoreset_mode, **more)


def outcomes(report: VectorReport, outcome: str) -> set[tuple[str, str]]:
    return {(check.level, check.name) for check in report.checks if check.outcome == outcome}


# --- right ones ------------------------------------------------------------------------------------------------------


def test_gymnasiums_vector_of_a_small_environment_passes_everything() -> None:
    report = check_vector_env(Right, Walk)
    assert not report.failed
    assert not report.skipped
    assert {check.level for check in report.checks} == {"contract", "NextStep", "SameStep", "Disabled", "equality"}


BEGUN = pytest.mark.filterwarnings("ignore:.*VectorEnv.__del__:pytest.PytestUnraisableExceptionWarning")
"""Gymnasium 1.1 fails to close vectors of cart poles that were refused for their keywords."""


def cart_poles(**given: Any) -> Any:
    return gym.make_vec("CartPole-v1", vectorization_mode="vector_entry_point", **given)


@BEGUN
def test_cart_pole_passes_the_contract() -> None:
    report = check_vector_env(cart_poles)
    assert {(check.level, check.said) for check in report.skipped} == {
        ("SameStep", "make_vec takes no autoreset_mode"), ("Disabled", "make_vec takes no autoreset_mode"),
        ("equality", "no make_single was given")}
    assert ("NextStep", "restarts") in outcomes(report, "passed")


@pytest.mark.slow
@BEGUN
def test_cart_pole_is_not_sync_vector_env() -> None:
    """Its environments share one random generator, so that only the spaces are those of SyncVectorEnv."""
    report = check_vector_env(cart_poles, partial(gym.make, "CartPole-v1"), raises=False)
    assert outcomes(report, "failed") == {("equality", "NextStep"), ("equality", "equal seeds")}
    assert ("equality", "spaces") in outcomes(report, "passed")
    with pytest.raises(AssertionError, match="2 failed") as error:
        check_vector_env(cart_poles, partial(gym.make, "CartPole-v1"))
    assert str(error.value) == str(report)


def pendulums(**options: Any) -> VectorReport:
    """Check LabPendulum's vector against its single environment, with short episodes of different ends."""
    settings = {"max_episode_steps": 13, "speed_limit": 1.5, **options}
    return check_vector_env(partial(gym.make_vec, "LabPendulum-v0", **settings),
                            partial(gym.make, "LabPendulum-v0", **settings))


def check_complete(report: VectorReport, deterministic: bool) -> None:
    assert {(check.name, check.said) for check in report.skipped} == (
        {("starts", "all seeds give the same start")} if deterministic else set())
    assert {("equality", mode.value) for mode in AutoresetMode} <= outcomes(report, "passed")


@pytest.mark.slow
@pytest.mark.parametrize(("wrapper", "failed"), [("NormalizeObservation", {"seeds"}),
                                                 ("RecordEpisodeStatistics", {"seeds", "pickling", "ignored action"})])
def test_gymnasiums_wrappers_have_the_faults_that_the_page_names(wrapper: str, failed: set[str]) -> None:
    """A running mean that a seed does not reset, and times of the clock in infos."""
    def made(num_envs: int) -> Any:
        single = partial(gym.make, "Pendulum-v1", max_episode_steps=20)
        return getattr(gym.wrappers.vector, wrapper)(gym.vector.SyncVectorEnv([single] * num_envs))

    report = check_vector_env(made, raises=False)
    assert {check.name for check in report.failed} == failed


OTHERS = """
from functools import partial
from pathlib import Path
import gymnasium as gym
from pendulum_env.testing import check_vector_env

for name, wanted in {"CartPole-v1": ["observations", "rewards, endings", "seeds", "pickling", "restarts"],
                     "Pendulum-v0": ["attributes"]}.items():
    make = partial(gym.make_vec, f"phys2d/{name}", vectorization_mode="vector_entry_point", max_episode_steps=20)
    report = check_vector_env(make, raises=False)
    assert [check.name for check in report.failed] == wanted, report
print("as the page says")
"""


@pytest.mark.slow
def test_foreign_vectors_have_the_faults_that_the_page_names(
    tmp_path_factory: pytest.TempPathFactory, tmp_path: Path
) -> None:
    """EnvPool's by example 23, those of Gymnasium in JAX, in an environment that has both."""
    python = environment(tmp_path_factory, "vectors", "envpool==1.2.5", "gymnasium[jax]==1.4.0")
    ran = subprocess.run([python, ROOT / "examples" / "23_check_your_vector.py"], cwd=tmp_path, capture_output=True,
                         text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    assert "EnvPool's CartPole: 0 passed, 1 failed" in ran.stdout
    ran = subprocess.run([python, "-W", "ignore", "-c", OTHERS], cwd=tmp_path, capture_output=True, text=True,
                         check=False)
    assert ran.returncode == 0, ran.stderr
    assert "as the page says" in ran.stdout


def test_ours_passes_everything() -> None:
    check_complete(pendulums(task="balance", backend="python", diagnostics=()), False)


@pytest.mark.slow
@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("options", [
    {}, {"scene": "windy"}, {"scene": "sticky_bearing", "integrator": "velocity_verlet", "substeps": 3},
    {"diagnostics": ("energy", "heat_by_effect", "flow"), "velocity_bound": 1.0, "speed_penalty": 3.0},
], ids=["usual", "gusts", "sticking", "settings"])
def test_ours_passes_everything_in_every_task(task: str, options: dict[str, Any]) -> None:
    backend = "python" if options else "compiled"
    check_complete(pendulums(task=task, backend=backend, **options), task == "free")


def made(name: str, kind: str) -> Callable[..., Any]:
    return lambda num_envs, autoreset_mode="NextStep": gym.make_vec(
        name, num_envs, vectorization_mode=kind, vector_kwargs={"autoreset_mode": autoreset_mode})


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.parametrize(("name", "kind"), [
    ("CartPole-v1", "sync"), ("CartPole-v1", "async"), ("Pendulum-v1", "sync"), ("MountainCarContinuous-v0", "sync"),
    ("FrozenLake-v1", "sync"), ("Blackjack-v1", "sync"), ("CliffWalking-v1", "sync"),
])
def test_gymnasiums_vectors_pass(name: str, kind: str) -> None:
    """Check spaces of numbers, of whole numbers and of tuples, and starts without chance."""
    report = check_vector_env(made(name, kind), partial(gym.make, name), steps=250)
    assert {check.name for check in report.skipped} <= {
        "pickling", "starts", "restarts", "ignored action", "final_info"}


# --- broken ones -----------------------------------------------------------------------------------------------------


class OneSeedIgnored(Right):
    """The last environment draws at random, whatever the seed."""

    def reset(self, *, seed: Any = None, options: Any = None) -> Any:
        seeds = [seed + i for i in range(self.num_envs)] if isinstance(seed, int) else seed
        return super().reset(seed=None if seeds is None else [*seeds[:-1], None], options=options)


class OneSeedConstant(Right):
    """Environment 1 has seed 0, whatever it is given."""

    def reset(self, *, seed: Any = None, options: Any = None) -> Any:
        seeds = [seed + i for i in range(self.num_envs)] if isinstance(seed, int) else seed
        return super().reset(seed=None if seeds is None else [seeds[0], 0, *seeds[2:]], options=options)


class OneSeedForAll(Right):
    def reset(self, *, seed: Any = None, options: Any = None) -> Any:
        return super().reset(seed=[seed] * self.num_envs if isinstance(seed, int) else seed, options=options)


class Reseeded(Right):
    """A reset without a seed repeats the seed before."""

    last: Any = None

    def reset(self, *, seed: Any = None, options: Any = None) -> Any:
        self.last = self.last if seed is None else seed
        return super().reset(seed=self.last, options=options)


class SeedUpwards(Right):
    """Seeds are s, s + 2, s + 4."""

    def reset(self, *, seed: Any = None, options: Any = None) -> Any:
        return super().reset(
            seed=[seed + 2 * i for i in range(self.num_envs)] if isinstance(seed, int) else seed, options=options)


class OneStepLate(Right):
    """Environments restart in the second step after their end."""

    def step(self, actions: Any) -> Any:
        pending, self._autoreset_envs = self._autoreset_envs, getattr(self, "_late", np.zeros(self.num_envs, bool))
        result = super().step(actions)
        self._late = pending & ~self._autoreset_envs if self.autoreset_mode is AutoresetMode.NEXT_STEP else pending
        return result


class OneStepEarly(Right):
    """Environments restart in the step of their end, although NextStep is declared."""

    def step(self, actions: Any) -> Any:
        declared = self.autoreset_mode
        if declared is AutoresetMode.NEXT_STEP:
            self.autoreset_mode = AutoresetMode.SAME_STEP
        observations, *middle, infos = super().step(actions)
        self.autoreset_mode = declared
        if declared is AutoresetMode.NEXT_STEP:
            infos = {key: value for key, value in infos.items() if "final" not in key}
        return observations, *middle, infos


class RewardOfRestarts(Right):
    def step(self, actions: Any) -> Any:
        observations, rewards, *rest = super().step(actions)
        return observations, np.where(rewards == 0.0, -1.0, rewards), *rest


class PendingAfterReset(Right):
    """A reset of all environments does not forget which ones had ended."""

    def reset(self, *, seed: Any = None, options: Any = None) -> Any:
        pending = self._autoreset_envs
        result = super().reset(seed=seed, options=options)
        if self.autoreset_mode is AutoresetMode.NEXT_STEP:
            self._autoreset_envs = pending
        return result


class NoFinalMask(Right):
    def step(self, actions: Any) -> Any:
        *rest, infos = super().step(actions)
        return *rest, {key: value for key, value in infos.items() if key != "_final_info"}


class NoFinalObservation(Right):
    def step(self, actions: Any) -> Any:
        *rest, infos = super().step(actions)
        return *rest, {key: value for key, value in infos.items() if key not in ("final_obs", "_final_obs")}


class FinalOfTheNext(Right):
    """``final_obs`` has the first observation of the new episode."""

    def step(self, actions: Any) -> Any:
        observations, *rest, infos = super().step(actions)
        if "final_obs" in infos:
            for place in np.flatnonzero(infos["_final_obs"]):
                infos["final_obs"][place] = observations[place].copy()
        return observations, *rest, infos


class FinalForAll(Right):
    def step(self, actions: Any) -> Any:
        *rest, infos = super().step(actions)
        if "_final_info" in infos:
            infos["final_info"]["_place"][:] = True
        return *rest, infos


class DoublePrecision(Right):
    def step(self, actions: Any) -> Any:
        observations, *rest = super().step(actions)
        return observations.astype(np.float64), *rest


class OutOfTheSpace(Right):
    def reset(self, **given: Any) -> Any:
        observations, infos = super().reset(**given)
        return observations + np.array([[0.0], [99.0], [0.0]], np.float32), infos


class WholeNumbersForEnds(Right):
    def step(self, actions: Any) -> Any:
        observations, rewards, terminated, *rest = super().step(actions)
        return observations, rewards, terminated.astype(np.int8), *rest


class RewardsInAList(Right):
    def step(self, actions: Any) -> Any:
        observations, rewards, *rest = super().step(actions)
        return observations, rewards.tolist(), *rest


class FourResults(Right):
    def step(self, actions: Any) -> Any:
        observations, rewards, terminated, truncated, infos = super().step(actions)
        return observations, rewards, terminated | truncated, infos


class ReusedBuffer(Right):
    def __init__(self, **given: Any) -> None:
        super().__init__(**given, copy=False)


class ReusedInfos(Right):
    """The array of an info is that of the step before."""

    def step(self, actions: Any) -> Any:
        *rest, infos = super().step(actions)
        self._kept = vars(self).get("_kept", infos["place"])
        self._kept[:] = infos["place"]
        return *rest, {**infos, "place": self._kept}


class ActionsChanged(Right):
    def step(self, actions: Any) -> Any:
        actions *= 0.5
        return super().step(actions)


class InfoWithoutMask(Right):
    def reset(self, **given: Any) -> Any:
        observations, infos = super().reset(**given)
        return observations, {"place": infos["place"]}


class MaskIgnored(Right):
    """A reset with a mask restarts all environments."""

    def reset(self, *, seed: Any = None, options: Any = None) -> Any:
        return super().reset(seed=seed, options=None)


class MaskWithoutEffect(Right):
    """A reset with a mask restarts the right environments, but returns the observations from before."""

    def reset(self, *, seed: Any = None, options: Any = None) -> Any:
        before, some = copy.deepcopy(self._observations), bool(options)
        observations, infos = super().reset(seed=seed, options=options)
        return before if some else observations, infos


class MaskOfInfosForAll(Right):
    def reset(self, **given: Any) -> Any:
        observations, infos = super().reset(**given)
        return observations, {**infos, "_place": np.ones(self.num_envs, bool)}


class ForgottenInPickles(Right):
    def __reduce__(self) -> Any:
        return _fresh, (type(self), self.num_envs)


def _fresh(kind: Any, num_envs: int) -> Any:
    env = kind(num_envs)
    env.reset(seed=0)
    return env


class StepsForgottenInPickles(Right):
    """Forgets the steps since its reset, but keeps the reset: pickled directly after it, it goes on as the original."""

    stepped = False

    def step(self, actions: Any) -> Any:
        self.stepped = True
        return super().step(actions)

    def __reduce__(self) -> Any:
        return (_fresh, (type(self), self.num_envs)) if self.stepped else super().__reduce__()


class ClosedOnce(Right):
    def close(self, **given: Any) -> None:
        if self.closed:
            raise RuntimeError("It is closed already.")
        super().close(**given)


class ModeIgnored(Right):
    def __init__(self, num_envs: int = 1, autoreset_mode: Any = None) -> None:
        super().__init__(num_envs)


class NoMode(Right):
    def __init__(self, **given: Any) -> None:
        super().__init__(**given)
        self.metadata = {}


class OneMore(Right):
    def __init__(self, num_envs: int = 1, **given: Any) -> None:
        super().__init__(num_envs + 1, **given)


class SpaceOfOne(Right):
    def __init__(self, **given: Any) -> None:
        super().__init__(**given)
        self.observation_space = self.single_observation_space


class RewardsRounded(Right):
    """Rewards have the precision of float32: in the contract's limits, but not equal."""

    def step(self, actions: Any) -> Any:
        observations, rewards, *rest = super().step(actions)
        return observations, rewards.astype(np.float32), *rest


class InfosOfOthers(Right):
    """An info has the value of the next environment."""

    def step(self, actions: Any) -> Any:
        *rest, infos = super().step(actions)
        return *rest, {**infos, "place": np.roll(infos["place"], 1)}


class OwnSeed(Right):
    np_random_seed = 11  # type: ignore[assignment]


class Stuck(Right):
    def step(self, actions: Any) -> Any:
        raise ZeroDivisionError("float division by zero")


BROKEN: dict[Any, tuple[tuple[str, str], str]] = {
    OneSeedIgnored: (("contract", "seeds"), "reset, observations, environment 2: wanted"),
    OneSeedConstant: (("contract", "starts"), "got the same start in environment 1"),
    OneSeedForAll: (("contract", "starts"), "wanted different starts in environments 0 and 1, got the same ones"),
    Reseeded: (("contract", "starts"), "reset() without a seed: wanted new starts"),
    SeedUpwards: (("equality", "equal seeds"), "reset with seed=11, observations, environment 1: wanted"),
    OneStepLate: (("NextStep", "restarts"), "wanted the reward 0, got"),
    OneStepEarly: (("NextStep", "ignored action"), "the action in the step after an episode's end has no effect"),
    RewardOfRestarts: (("NextStep", "restarts"), "which restarts in this step: wanted the reward 0, got"),
    PendingAfterReset: (("contract", "seeds"), "reset(seed=...) after a run gives the same run again: step 1"),
    NoFinalMask: (("SameStep", "final_info"), "wanted 'final_info' and '_final_info' in infos, got"),
    NoFinalObservation: (("SameStep", "restarts"), "wanted 'final_obs' and '_final_obs' in infos, got"),
    FinalOfTheNext: (("SameStep", "restarts"), "wanted the first observation of the new episode beside final_obs"),
    FinalForAll: (("SameStep", "final_info"), "final_info['_place']: wanted True at most where an episode ended"),
    DoublePrecision: (("contract", "observations"), "step 1, observations: wanted an array float32 of shape (3, 2), "
                      "got float64 of shape (3, 2)"),
    OutOfTheSpace: (("contract", "observations"), "reset, environment 1: wanted an observation in "
                    "single_observation_space, got"),
    WholeNumbersForEnds: (("contract", "rewards, endings"), "step 1, terminated: wanted an array of 3 booleans, got "
                          "int8 of shape (3,)"),
    RewardsInAList: (("contract", "rewards, endings"), "step 1, rewards: wanted an array of 3 real numbers, got ["),
    FourResults: (("contract", "running"), "step: wanted a tuple of observations, rewards, terminated, truncated and"),
    ReusedBuffer: (("contract", "arrays"), "returned arrays stay as they were: reset, observations, environment 0"),
    ReusedInfos: (("contract", "arrays"), "returned arrays stay as they were: step 1, infos['place']"),
    ActionsChanged: (("contract", "arrays"), "given arrays stay as they were: step 1, actions"),
    InfoWithoutMask: (("contract", "infos"), "reset, infos: wanted a mask '_place' beside 'place', got ['place']"),
    MaskIgnored: (("Disabled", "reset_mask"), "which it leaves out: wanted the observation"),
    MaskWithoutEffect: (("Disabled", "reset_mask"), "wanted first observations of new episodes, got those of the"),
    MaskOfInfosForAll: (("Disabled", "reset_mask"), "infos['_place']: wanted True at most in"),
    StepsForgottenInPickles: (("contract", "pickling"), "a pickled copy goes on as the original: step 1 after"),
    ForgottenInPickles: (("contract", "pickling"), "a pickled copy goes on as the original: step 1 after pickling"),
    ClosedOnce: (("contract", "closing"), "wanted no error in the second close(), got RuntimeError: It is closed"),
    ModeIgnored: (("SameStep", "attributes"), "wanted AutoresetMode.SAME_STEP in metadata['autoreset_mode'], as given"),
    NoMode: (("contract", "attributes"), "wanted an AutoresetMode in metadata['autoreset_mode'], got None"),
    OneMore: (("contract", "attributes"), "wanted num_envs=3, got 4"),
    SpaceOfOne: (("contract", "attributes"), "the batch of single_observation_space, got Box("),
    RewardsRounded: (("equality", "SameStep"), "equal to SyncVectorEnv: step 1, rewards, environment 0: wanted"),
    InfosOfOthers: (("equality", "Disabled"), "equal to SyncVectorEnv: step 1, infos['place'], environment 0: wanted"),
    OwnSeed: (("equality", "equal seeds"), "np_random_seed after reset with seed=11: wanted (11, 12, 13), got 11"),
    Stuck: (("contract", "running"), "wanted no error, got ZeroDivisionError: float division by zero"),
}
"""Vector environment with one defect -> the check that catches it, and words of what the check says."""


def defects() -> list[Any]:
    """All broken ones; slow are all but the first that a check catches."""
    first = {which: broken for broken, (which, _) in reversed(BROKEN.items())}
    return [pytest.param(broken, id=broken.__name__, marks=[] if broken is first[which] else [pytest.mark.slow])
            for broken, (which, _) in BROKEN.items()]


@pytest.mark.quick(
    "OneStepLate", "NoFinalMask", "StepsForgottenInPickles", "MaskIgnored", "ReusedBuffer", "InfosOfOthers",
    "RewardsRounded"
)
@pytest.mark.parametrize("broken", defects())
def test_a_defect_is_caught_by_its_check(broken: Any) -> None:
    which, words = BROKEN[broken]
    report = check_vector_env(broken, Walk, raises=False)
    said = {(check.level, check.name): check.said for check in report.failed}
    assert which in said, str(report)
    assert words in said[which]
    assert all(len(line) <= 80 for line in str(report).splitlines())


SUBTLE = (SeedUpwards, RewardsRounded, InfosOfOthers, OwnSeed)


@pytest.mark.slow
@pytest.mark.parametrize("broken", SUBTLE, ids=lambda kind: kind.__name__)
def test_the_contract_alone_does_not_ask_for_equality(broken: Any) -> None:
    assert not check_vector_env(broken, raises=False).failed


def test_what_cannot_be_made_is_said() -> None:
    def without_keyword(count: int) -> Any:
        return Right(count)

    report = check_vector_env(without_keyword, raises=False)
    assert [(check.outcome, check.name) for check in report.checks] == [
        ("failed", "attributes"), ("skipped", "all else")]
    assert "make_vec(num_envs=3) raised TypeError" in report.failed[0].said
    assert outcomes(check_vector_env(lambda num_envs: 3, raises=False), "failed") == {  # type: ignore[arg-type]
        ("contract", "attributes")}


def test_episodes_that_do_not_end_are_said() -> None:
    report = check_vector_env(Right, Walk, steps=1)
    assert {(check.level, check.name) for check in report.skipped} == {
        ("NextStep", "restarts"), ("NextStep", "ignored action"), ("SameStep", "restarts"), ("SameStep", "final_info"),
        ("Disabled", "reset_mask")}
    assert "no episode ended in 1 steps; make shorter episodes or give more steps" in report.skipped[0].said


def test_the_table_of_a_report() -> None:
    report = VectorReport("Ours", (VectorCheck("contract", "seeds", "passed"),
                                   VectorCheck("SameStep", "all", "skipped", "make_vec takes no autoreset_mode"),
                                   VectorCheck("equality", "spaces", "failed", "wanted " + "a long box " * 6)))
    assert str(report).splitlines() == [
        "Ours: 1 passed, 1 failed, 1 skipped",
        "contract  seeds   passed",
        "SameStep  all     skipped  make_vec takes no autoreset_mode",
        "equality  spaces  FAILED   wanted a long box a long box a long box a long box a",
        "                           long box a long box",
    ]
    assert (len(report.passed), len(report.failed), len(report.skipped)) == (1, 1, 1)
