"""The checker of vector environments: which checks it makes, in which autoreset modes, and the table of their outcomes.
"""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from copy import deepcopy
from dataclasses import dataclass
from functools import partial
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv
from gymnasium.vector.utils import batch_space

from pendulum_env.common.checks import boolean, function, shown, whole_number
from pendulum_env.testing.contract import (
    AGAIN,
    SEED,
    FaultError,
    Run,
    SkippedError,
    Vector,
    check_arrays,
    check_final_info,
    check_infos,
    check_next_step,
    check_observations,
    check_pickle,
    check_reset_mask,
    check_rewards,
    check_same_step,
    check_starts,
    check_unseeded,
    compare,
    ends_of,
    need_ends,
    record,
    reset_call,
    steps_of,
    told,
)

WIDTH = 80
"""Number of columns of a report."""


@dataclass(frozen=True)
class VectorCheck:
    """One check of a vector environment.

    Attributes:
        level: "contract", "NextStep", "SameStep", "Disabled" or "equality".
        name: what was checked, such as "seeds".
        outcome: "passed", "failed" or "skipped".
        said: what was wanted and what came instead, or why the check was skipped.
    """

    level: str
    name: str
    outcome: str
    said: str = ""


@dataclass(frozen=True)
class VectorReport:
    """Outcomes of all checks of a vector environment; ``print`` shows them as a table of at most 80 columns.

    Attributes:
        title: text that names the vector environment.
        checks: all checks, in the order in which they were made.
    """

    title: str
    checks: tuple[VectorCheck, ...]

    @property
    def passed(self) -> tuple[VectorCheck, ...]:
        """Checks that the vector environment passed."""
        return self._with("passed")

    @property
    def failed(self) -> tuple[VectorCheck, ...]:
        """Checks that the vector environment failed; ``said`` has what was wanted and what came instead."""
        return self._with("failed")

    @property
    def skipped(self) -> tuple[VectorCheck, ...]:
        """Checks that were not possible; ``said`` has why."""
        return self._with("skipped")

    def _with(self, outcome: str) -> tuple[VectorCheck, ...]:
        return tuple(check for check in self.checks if check.outcome == outcome)

    def __str__(self) -> str:
        counts = ", ".join(f"{len(self._with(outcome))} {outcome}" for outcome in ("passed", "failed", "skipped"))
        lines = textwrap.wrap(f"{self.title}: {counts}", WIDTH)
        widths = [max((len(text) for text in column), default=0) for column in zip(
            *((check.level, check.name, check.outcome) for check in self.checks), strict=True)]
        for check in self.checks:
            cells = (check.level, check.name, check.outcome.upper() if check.outcome == "failed" else check.outcome)
            head = "  ".join(cell.ljust(width) for cell, width in zip(cells, widths, strict=True))
            lines += textwrap.wrap(f"{head}  {check.said}".rstrip(), WIDTH, subsequent_indent=" " * (len(head) + 2),
                                   replace_whitespace=False, drop_whitespace=True)
        return "\n".join(lines)


Single = gymnasium.Env[Any, Any]

MOST_ENVS, MOST_STEPS = 1024, 10**6
"""Largest number of environments in a vector that is checked, and of steps of a run, all of which are kept."""

OF_RUNS: tuple[tuple[str, Callable[[Vector, Run], None]], ...] = (
    ("observations", check_observations), ("rewards, endings", check_rewards), ("infos", check_infos),
    ("arrays", check_arrays),
)
"""Checks of what the calls of any run return."""
OF_RESTARTS: dict[AutoresetMode, tuple[tuple[str, Callable[[Vector, Run], None]], ...]] = {
    AutoresetMode.NEXT_STEP: (("restarts", check_next_step),),
    AutoresetMode.SAME_STEP: (("restarts", check_same_step), ("final_info", check_final_info)),
    AutoresetMode.DISABLED: (("reset_mask", check_reset_mask),),
}
"""Checks of when episodes restart, by the autoreset mode."""
OF_REPEATS = ("seeds", "starts", "pickling", "ignored action")
"""Checks that need an environment that can repeat a run, beside those of equality."""


def check_vector_env(
    make_vec: Callable[..., Vector], make_single: Callable[[], Single] | None = None, *, num_envs: int = 3,
    steps: int = 600, raises: bool = True,
) -> VectorReport:
    """Check that a vector environment keeps Gymnasium's contract, and that it equals SyncVectorEnv.

    There are three levels:

    - ``contract``, of any vector environment: attributes; shapes and dtypes of observations, rewards and endings; masks
      of infos; arrays that are not overwritten later; seeds; pickling; closing.
    - ``NextStep``, ``SameStep`` and ``Disabled``: the autoreset mode that the vector environment declares, and each
      other mode that ``make_vec`` takes: when episodes restart, ``final_obs`` and ``final_info``, ``reset_mask``.
    - ``equality`` with ``SyncVectorEnv`` of the single environment in each of these modes: spaces, seeds of every kind,
      all observations, rewards and endings, and infos where their masks are True.

    Environments that say of themselves, by ``spec.nondeterministic``, that no run repeats another one, as those of real
    machines, are not asked for seeds, starts that depend on them, pickles, and equality.

    Actions are drawn at random. A check that is not possible is skipped, and the report says why; for example,
    restarts need episodes that end within ``steps``. Clock times in infos, as of Gymnasium's
    ``RecordEpisodeStatistics``, fail the check of seeds, because no run repeats them.

    ```python
    from functools import partial
    import gymnasium as gym
    from pendulum_env.testing import check_vector_env

    print(check_vector_env(partial(gym.make_vec, "CartPole-v1", vectorization_mode="vector_entry_point")))
    ```

    Args:
        make_vec: function that makes the vector environment. It is called as ``make_vec(num_envs=3)`` and, for
            autoreset modes other than the one declared, as ``make_vec(num_envs=3, autoreset_mode=...)`` with an
            ``AutoresetMode``; these are skipped if it takes no such keyword.
        make_single: function without arguments that makes the single environment; None skips the level of equality.
        num_envs: number of environments in the vector, from 2 to 1024.
        steps: largest number of steps of a run, up to a million. A run is over sooner if each environment has ended
            three episodes.
        raises: False returns the report although checks have failed.

    Raises AssertionError, with the report as its text, if a check has failed; SceneError for an invalid argument.
    """
    function(make_vec, "make_vec")
    if make_single is not None:
        function(make_single, "make_single")
    several, longest = whole_number(num_envs, "num_envs", MOST_ENVS, 2), whole_number(steps, "steps", MOST_STEPS)
    stops = boolean(raises, "raises")
    report = Checker(make_vec, make_single, several, longest).report()
    if stops and report.failed:
        raise AssertionError(str(report))
    return report


class Checker:
    """All checks of the vector environments that ``make_vec`` makes, in order."""

    def __init__(self, make_vec: Callable[..., Vector], make_single: Callable[[], Single] | None,
                 num_envs: int, steps: int) -> None:
        self.make_vec, self.make_single, self.num_envs, self.steps = make_vec, make_single, num_envs, steps
        self.checks: list[VectorCheck] = []
        self.runs: dict[AutoresetMode, Run] = {}
        self.own: AutoresetMode | None = None
        self.unrepeated = False

    def report(self) -> VectorReport:
        """Make all checks and return their outcomes."""
        title = "The vector environment"
        try:
            with self._made(None) as env:
                title, self.unrepeated = shown(env), bool(getattr(env.spec, "nondeterministic", False))
                if self._tried("contract", "attributes", partial(self._check_attributes, env)):
                    self.own = env.metadata["autoreset_mode"]
                    self._contract(env, self.own)
        except Exception as error:
            self._note("contract", "attributes", "failed", f"make_vec(num_envs={self.num_envs}) raised {told(error)}")
        if self.own is None:
            self._note("contract", "all else", "skipped", "the attributes have to be right first")
        else:
            for mode in AutoresetMode:
                self._autoreset(mode)
            self._equality()
        return VectorReport(title, tuple(self.checks))

    def _note(self, level: str, name: str, outcome: str, said: str = "") -> None:
        self.checks.append(VectorCheck(level, name, outcome, said))

    def _tried(self, level: str, name: str, check: Callable[[], str | None]) -> bool:
        """Make a check and note its outcome; return True if it passed. An error of the environment is a failure."""
        if self.unrepeated and (name in OF_REPEATS or level == "equality"):
            self._note(level, name, "skipped", "its spec is nondeterministic: no run repeats another one")
            return False
        try:
            self._note(level, name, "passed", check() or "")
            return True
        except SkippedError as why:
            self._note(level, name, "skipped", str(why))
        except FaultError as fault:
            self._note(level, name, "failed", str(fault))
        except Exception as error:
            self._note(level, name, "failed", f"wanted no error, got {told(error)}")
        return False

    @contextmanager
    def _made(self, mode: AutoresetMode | None) -> Iterator[Vector]:
        """Make a vector environment, in the mode that it declares for None, and close it at the end."""
        more = {} if mode in (None, self.own) else {"autoreset_mode": mode}
        env = self.make_vec(num_envs=self.num_envs, **more)
        try:
            yield env
        finally:
            with suppress(Exception):  # errors of close have a check of their own
                env.close()

    def _check_attributes(self, env: Vector) -> None:
        if not isinstance(env, VectorEnv):
            raise FaultError(f"wanted a gymnasium.vector.VectorEnv, got {shown(env)}")
        if env.num_envs != self.num_envs:
            raise FaultError(f"wanted num_envs={self.num_envs}, got {shown(env.num_envs)}")
        if not isinstance(mode := env.metadata.get("autoreset_mode"), AutoresetMode):
            raise FaultError(f"wanted an AutoresetMode in metadata['autoreset_mode'], got {shown(mode)}")
        for name in ("observation_space", "action_space"):
            single, whole = getattr(env, f"single_{name}"), getattr(env, name)
            if whole != (wanted := batch_space(single, self.num_envs)):
                raise FaultError(f"{name}: wanted {shown(wanted)}, the batch of single_{name}, got {shown(whole)}")

    def _contract(self, env: Vector, mode: AutoresetMode) -> None:
        """Make the checks that any vector environment has to pass."""
        if self._recorded("contract", env, mode):
            self._tried("contract", "starts", partial(check_starts, env))
        self._tried("contract", "pickling", self._check_pickling)
        self._tried("contract", "closing", self._check_closing)

    def _autoreset(self, mode: AutoresetMode) -> None:
        """Make the checks of an autoreset mode, if there are environments with it."""
        level = mode.value
        try:
            with self._made(mode) as env:
                if (got := env.metadata.get("autoreset_mode")) is not mode:
                    self._note(level, "attributes", "failed",
                               f"wanted {mode} in metadata['autoreset_mode'], as given to make_vec, got {shown(got)}")
                elif mode in self.runs or (mode is not self.own and self._recorded(level, env, mode)):
                    for name, check in OF_RESTARTS[mode]:
                        self._tried(level, name, partial(check, env, self.runs[mode]))
                    if mode is AutoresetMode.NEXT_STEP:
                        self._tried(level, "ignored action", partial(self._check_ignored, env))
                else:
                    self._note(level, "restarts", "skipped", "it could not be run")
        except Exception as error:
            none = isinstance(error, TypeError) and "autoreset_mode" in str(error)
            self._note(level, "all", "skipped", "make_vec takes no autoreset_mode" if none else
                       f"make_vec(autoreset_mode={mode}) raised {told(error)}")

    def _recorded(self, level: str, env: Vector, mode: AutoresetMode) -> bool:
        """Run a vector environment, check what it returns, and keep the run; return False if it could not be run."""
        if not self._tried(level, "running", partial(self._record, env, mode)):
            return False
        for name, check in OF_RUNS:
            self._tried(level, name, partial(check, env, self.runs[mode]))
        self._tried(level, "seeds", partial(self._check_seeds, env, mode))
        return True

    def _record(self, env: Vector, mode: AutoresetMode) -> str:
        run = self.runs[mode] = record(env, mode, self.steps)
        return told_of_run(run)

    def _check_seeds(self, env: Vector, mode: AutoresetMode) -> None:
        """Check that a seed decides a run, in a new vector environment and in one that has been used."""
        run = self.runs[mode]
        with self._made(mode) as other:
            compare(record(other, mode, self.steps), run, "the same seed and actions give the same run")
        again = record(env, mode, min(AGAIN, len(steps_of(run))))
        compare(again, run[: len(again)], "reset(seed=...) after a run gives the same run again")
        check_unseeded(env)

    def _check_ignored(self, env: Vector) -> None:
        """Check that an action has no effect on an environment that restarts in that step."""
        run = self.runs[AutoresetMode.NEXT_STEP]
        need_ends(run)
        compare(record(env, AutoresetMode.NEXT_STEP, self.steps, meddle=True), run,
                 "the action in the step after an episode's end has no effect")

    def _check_pickling(self) -> None:
        with self._made(None) as env:
            check_pickle(env)

    def _check_closing(self) -> None:
        for used in (False, True):
            env = self.make_vec(num_envs=self.num_envs)
            if used:
                env.reset(seed=SEED)
            for which in ("first", "second"):
                try:
                    env.close()
                except Exception as error:
                    raise FaultError(f"wanted no error in the {which} close(), got {told(error)}") from None

    def _equality(self) -> None:
        """Compare with SyncVectorEnv in all modes that were run."""
        if self.make_single is None or not self.runs:
            self._note("equality", "all", "skipped", "it could not be run" if self.make_single else
                       "no make_single was given")
            return
        for mode in self.runs:
            self._tried("equality", mode.value, partial(self._check_equal, mode))
        mode = AutoresetMode.DISABLED if AutoresetMode.DISABLED in self.runs else next(iter(self.runs))
        for name, check in (("spaces", check_same_spaces), ("equal seeds", check_same_seeds)):
            self._tried("equality", name, partial(self._check_beside, mode, check))

    @contextmanager
    def _synchronous(self, mode: AutoresetMode) -> Iterator[Vector]:
        """Make a SyncVectorEnv of the single environment, and close it at the end."""
        assert self.make_single is not None
        with closing(SyncVectorEnv([self.make_single] * self.num_envs, autoreset_mode=mode)) as sync:
            yield sync

    def _check_equal(self, mode: AutoresetMode) -> str:
        with self._synchronous(mode) as sync:
            run = record(sync, mode, self.steps)
        compare(self.runs[mode], run, "equal to SyncVectorEnv")
        return told_of_run(run)

    def _check_beside(self, mode: AutoresetMode, check: Callable[[Vector, Vector], None]) -> None:
        with self._made(mode) as env, self._synchronous(mode) as sync:
            check(env, sync)


def told_of_run(run: Run) -> str:
    """Return the length of a run in words."""
    return f"{len(steps_of(run))} steps, in which {ends_of(run)} episodes ended"


def check_same_spaces(env: Vector, sync: Vector) -> None:
    """Check that the spaces of single environments are those of SyncVectorEnv."""
    for name in ("single_observation_space", "single_action_space"):
        if (found := getattr(env, name)) != (wanted := getattr(sync, name)):
            raise FaultError(f"{name}: wanted {shown(wanted)}, got {shown(found)}")


def check_same_seeds(env: Vector, sync: Vector) -> None:
    """Check that resets with seeds of every kind are those of SyncVectorEnv."""
    size = env.num_envs
    first = np.arange(size) == 0
    lists: list[int | None] = [SEED + 3 * place for place in range(size)]
    arguments: list[tuple[str, dict[str, Any]]] = [
        ("seed=11", {"seed": SEED}),
        ("no seed", {}),
        ("a list of seeds", {"seed": lists}),
        ("a list with None", {"seed": [None, *lists[1:]]}),
    ]
    if env.metadata["autoreset_mode"] is AutoresetMode.DISABLED:
        arguments += [("seed=11 and a reset_mask", {"seed": SEED, "options": {"reset_mask": first}}),
                      ("a reset_mask", {"options": {"reset_mask": ~first}})]
    nobody = np.zeros(size, dtype=bool)
    for name, given in arguments:
        found, wanted = (reset_call(each, f"reset with {name}", nobody, **deepcopy(given)) for each in (env, sync))
        compare([found], [wanted], "equal to SyncVectorEnv")
        if (mine := env.np_random_seed) != (theirs := sync.np_random_seed):
            raise FaultError(f"np_random_seed after reset with {name}: wanted {theirs}, got {shown(mine)}")
