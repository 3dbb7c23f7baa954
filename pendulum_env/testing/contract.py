"""Checks of one vector environment: what its runs return, when its episodes restart, its seeds and its pickles.

The runs are recorded call by call, and compared.
"""

from __future__ import annotations

import copy
import pickle
from collections.abc import Iterator
from itertools import combinations, islice, pairwise
from typing import Any, NamedTuple

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space, concatenate, create_empty_array, iterate
from numpy.typing import NDArray

from pendulum_env.common.checks import shown

Vector = VectorEnv[Any, Any, Any]
Mask = NDArray[np.bool_]

SEED = 11
"""Seed of the runs that are compared."""
ENDS = 3
"""Number of episodes that end in each environment before a run is over."""
EARLY = 3
"""Step after which, with autoreset disabled, environment 0 is reset in the middle of an episode."""
PARTS = ("observations", "rewards", "terminated", "truncated", "infos")
"""Names of what ``step`` returns."""


class FaultError(Exception):
    """A check failed; the text has what was wanted and what came instead."""


class SkippedError(Exception):
    """A check is not possible; the text has why."""


class Call(NamedTuple):
    """One call of ``reset`` or ``step``: its arguments, what it returned, and a copy of that made at once."""

    name: str
    given: Any
    kept: Any  # copy of the given arguments
    waiting: Mask  # environments whose episodes ended in the call before
    returned: tuple[Any, ...]
    copied: tuple[Any, ...]

    @property
    def ended(self) -> Mask:
        """Environments whose episodes ended in this step."""
        over: Mask = np.asarray(self.copied[2], dtype=bool) | np.asarray(self.copied[3], dtype=bool)
        return over

    def parts(self) -> tuple[str, ...]:
        """Return the names of what the call returned."""
        return PARTS if len(self.copied) == len(PARTS) else (PARTS[0], PARTS[-1])


Run = list[Call]
"""All calls of a run, in order."""


def drawn_actions(env: Vector, seed: int) -> Iterator[Any]:
    """Draw random actions for all environments of a vector, without end."""
    space = batch_space(env.single_action_space, env.num_envs)
    space.seed(seed)
    while True:
        yield space.sample()


def mixed_actions(env: Vector, actions: Any, others: Any, rows: Mask) -> Any:
    """Return actions in which some environments have those of ``others``."""
    space = batch_space(env.single_action_space, env.num_envs)
    chosen = [new if row else old for row, old, new in zip(
        rows, iterate(space, actions), iterate(space, others), strict=True)]
    blank: Any = create_empty_array(env.single_action_space, env.num_envs)
    return concatenate(env.single_action_space, chosen, blank)


def reset_call(env: Vector, name: str, waiting: Mask, given: Any = None, **arguments: Any) -> Call:
    """Reset a vector environment and return the call; ``given`` is its mask, and ``arguments`` are those of reset."""
    returned = env.reset(**arguments)
    if not isinstance(returned, tuple) or len(returned) != 2:
        raise FaultError(f"reset: wanted a tuple of observations and infos, got {shown(returned)}")
    return Call(name, given, copy.deepcopy(given), waiting, returned, copy.deepcopy(returned))


def record(env: Vector, mode: AutoresetMode, steps: int, meddle: bool = False) -> Run:
    """Return the calls of a run with random actions, until each environment has ended some episodes.

    Args:
        env: the vector environment, which is reset first.
        mode: its autoreset mode; if it is disabled, ended environments are reset by ``reset_mask``.
        steps: largest number of steps.
        meddle: True gives other actions to environments in the step after their end.
    """
    nobody = np.zeros(env.num_envs, dtype=bool)
    calls = [reset_call(env, "reset", nobody, seed=SEED)]
    waiting, ends, others = nobody, np.zeros(env.num_envs, dtype=int), drawn_actions(env, SEED + 1)
    for place, actions in enumerate(islice(drawn_actions(env, SEED), steps), start=1):
        given = mixed_actions(env, actions, next(others), waiting) if meddle and waiting.any() else actions
        kept = copy.deepcopy(given)
        returned = env.step(given)
        if not isinstance(returned, tuple) or len(returned) != 5:
            raise FaultError("step: wanted a tuple of observations, rewards, terminated, truncated and infos, "
                             f"got {shown(returned)}")
        calls.append(Call(f"step {place}", given, kept, waiting, returned, copy.deepcopy(returned)))
        waiting = calls[-1].ended
        ends += waiting
        if (ends >= ENDS).all():
            break
        if mode is AutoresetMode.DISABLED:
            mask = waiting | (np.arange(env.num_envs) == 0) if place == EARLY else waiting
            if mask.any():
                name = f"reset_mask after step {place}"
                calls.append(reset_call(env, name, waiting, mask, options={"reset_mask": mask.copy()}))
            waiting = nobody
    return calls


def steps_of(run: Run) -> Run:
    """Return the calls of ``step`` in a run."""
    return [call for call in run if len(call.copied) == len(PARTS)]


def ends_of(run: Run) -> int:
    """Return the number of episodes that ended in a run."""
    return sum(int(call.ended.sum()) for call in steps_of(run))


def need_ends(run: Run) -> None:
    """Skip a check if no episode ended in a run."""
    if not ends_of(run):
        raise SkippedError(f"no episode ended in {len(steps_of(run))} steps; make shorter episodes or give more steps")


# --- comparisons -----------------------------------------------------------------------------------------------------


def difference(found: Any, wanted: Any, where: str, mask: Mask | None = None) -> str:
    """Return the first difference between two values as text, "" if there is none.

    In a dict, ``"key"`` is compared only in those environments for which its mask ``"_key"`` is True.
    """
    if isinstance(wanted, dict) and isinstance(found, dict):
        if found.keys() != wanted.keys():
            return f"{where}: wanted the keys {sorted(wanted)}, got {sorted(found)}"
        for key, value in wanted.items():
            rows = None if str(key).startswith("_") else wanted.get(f"_{key}", mask)
            if text := difference(found[key], value, f"{where}[{key!r}]", rows if is_mask(rows) else None):
                return text
        return ""
    if isinstance(wanted, (tuple, list, np.ndarray)) and isinstance(found, (tuple, list, np.ndarray)):
        if equal(found, wanted):
            return ""
        if np.ndim(wanted) and len(found) == len(wanted):
            for place, (mine, theirs) in enumerate(zip(found, wanted, strict=True)):
                row = mask is None or len(mask) != len(wanted) or mask[place]
                if row and not equal(mine, theirs):
                    return f"{where}, environment {place}: wanted {shown(theirs)}, got {shown(mine)}"
            return ""
    return "" if equal(found, wanted) else f"{where}: wanted {shown(wanted)}, got {shown(found)}"


def equal(found: Any, wanted: Any) -> bool:
    """Return True if two values are equal, where nan equals nan."""
    if isinstance(wanted, dict):
        return isinstance(found, dict) and found.keys() == wanted.keys() and all(
            equal(found[key], value) for key, value in wanted.items())
    if isinstance(wanted, (tuple, list)) or (isinstance(wanted, np.ndarray) and wanted.dtype == object):
        long = np.ndim(wanted) if isinstance(wanted, np.ndarray) else 1
        if not long or not isinstance(found, (tuple, list, np.ndarray)) or (
                isinstance(found, np.ndarray) and not found.ndim):
            return bool(np.all(found == wanted))
        return len(found) == len(wanted) and all(map(equal, found, wanted))
    if isinstance(wanted, (np.ndarray, np.generic, float)):
        numbers = np.asarray(wanted).dtype.kind in "fc" and np.asarray(found).dtype.kind in "fciu"
        return np.array_equal(found, wanted, equal_nan=numbers)
    return bool(np.all(found == wanted))


def is_mask(value: Any) -> bool:
    """Return True if a value is an array of booleans with one entry for each environment."""
    return isinstance(value, np.ndarray) and value.dtype == np.bool_ and value.ndim == 1


def compare(found: Run, wanted: Run, what: str) -> None:
    """Raise the fault that one run is not another one; ``what`` says why it should be."""
    for mine, theirs in zip(found, wanted, strict=False):
        if mine.name != theirs.name:
            raise FaultError(f"{what}: wanted {theirs.name} next, got {mine.name}")
        for name, one, other in zip(theirs.parts(), mine.copied, theirs.copied, strict=True):
            if text := difference(one, other, f"{theirs.name}, {name}"):
                raise FaultError(f"{what}: {text}")
    if len(found) != len(wanted):
        raise FaultError(f"{what}: wanted {len(wanted)} calls until the episodes had ended, got {len(found)}")


AGAIN = 30
"""Number of steps after which a run that began like another one counts as the same."""
SEEDS = range(100, 110)
"""Seeds whose starts are compared; a start with few possible values may be the same for some of them."""

# --- what any vector environment returns -----------------------------------------------------------------------------


def check_observations(env: Vector, run: Run) -> None:
    """Check that observations have the form of the space's batch, and that each is in ``single_observation_space``."""
    blank = create_empty_array(env.single_observation_space, env.num_envs)
    for call in run:
        _check_form(call.copied[0], blank, f"{call.name}, observations")
        for place, row in enumerate(iterate(env.observation_space, call.copied[0])):
            if not env.single_observation_space.contains(row):
                raise FaultError(f"{call.name}, environment {place}: wanted an observation in "
                                 f"single_observation_space, got {shown(row)}")


def _check_form(found: Any, wanted: Any, where: str) -> None:
    """Check that a value has the types, dtypes and shapes of another one, entry by entry."""
    if isinstance(wanted, np.ndarray):
        form = f"an array {wanted.dtype} of shape {wanted.shape}"
        if not isinstance(found, np.ndarray):
            raise FaultError(f"{where}: wanted {form}, got {shown(found)}")
        if (found.dtype, found.shape) != (wanted.dtype, wanted.shape):
            raise FaultError(f"{where}: wanted {form}, got {found.dtype} of shape {found.shape}")
    elif isinstance(wanted, dict):
        if not isinstance(found, dict) or found.keys() != wanted.keys():
            raise FaultError(f"{where}: wanted a dict with the keys {list(wanted)}, got {shown(found)}")
        for key, value in wanted.items():
            _check_form(found[key], value, f"{where}[{key!r}]")
    else:
        if not isinstance(found, tuple) or len(found) != len(wanted):
            raise FaultError(f"{where}: wanted a tuple of {len(wanted)} entries, got {shown(found)}")
        for place, (one, other) in enumerate(zip(found, wanted, strict=True)):
            if isinstance(other, (np.ndarray, dict, tuple)):
                _check_form(one, other, f"{where}[{place}]")


def check_rewards(env: Vector, run: Run) -> None:
    """Check the types of rewards, ``terminated`` and ``truncated``, and that rewards are finite."""
    shape = (env.num_envs,)
    for call in steps_of(run):
        for name, value, kinds, text in zip(PARTS[1:4], call.copied[1:4], ("fiu", "b", "b"), (
                "real numbers", "booleans", "booleans"), strict=True):
            if not isinstance(value, np.ndarray) or value.dtype.kind not in kinds or value.shape != shape:
                got = f"{value.dtype} of shape {value.shape}" if isinstance(value, np.ndarray) else shown(value)
                raise FaultError(f"{call.name}, {name}: wanted an array of {shape[0]} {text}, got {got}")
        if not np.isfinite(call.copied[1]).all():
            raise FaultError(f"{call.name}, rewards: wanted finite numbers, got {shown(call.copied[1])}")


def check_infos(env: Vector, run: Run) -> None:
    """Check that each entry of the infos has one value for each environment, and a mask."""
    for call in run:
        infos = call.copied[-1]
        if not isinstance(infos, dict):
            raise FaultError(f"{call.name}, infos: wanted a dict, got {shown(infos)}")
        for key, value in infos.items():
            if key.startswith("_"):
                if not is_mask(value) or len(value) != env.num_envs:
                    raise FaultError(f"{call.name}, infos[{key!r}]: wanted a mask of {env.num_envs} booleans, "
                                     f"got {shown(value)}")
            elif f"_{key}" not in infos:
                raise FaultError(f"{call.name}, infos: wanted a mask '_{key}' beside {key!r}, got {sorted(infos)}")
            elif not isinstance(value, dict) and np.shape(value)[:1] != (env.num_envs,):
                raise FaultError(f"{call.name}, infos[{key!r}]: wanted one entry for each of {env.num_envs} "
                                 f"environments, got {shown(value)}")


def check_arrays(env: Vector, run: Run) -> None:
    """Check that returned arrays are not overwritten later, and that given actions are not changed."""
    for call in run:
        for name, now, then in zip(call.parts(), call.returned, call.copied, strict=True):
            if text := difference(now, then, f"{call.name}, {name}"):
                raise FaultError(f"returned arrays stay as they were: {text}")
        if text := difference(call.given, call.kept, f"{call.name}, actions"):
            raise FaultError(f"given arrays stay as they were: {text}")


# --- autoreset -------------------------------------------------------------------------------------------------------


def check_next_step(env: Vector, run: Run) -> None:
    """Check that the step after an episode's end has no reward and ends nothing."""
    need_ends(run)
    for call in steps_of(run):
        for place in np.flatnonzero(call.waiting):
            where = f"{call.name}, environment {place}, which restarts in this step"
            if (reward := call.copied[1][place]) != 0.0:
                raise FaultError(f"{where}: wanted the reward 0, got {reward!r}")
            if call.ended[place]:
                raise FaultError(f"{where}: wanted terminated and truncated False, got True")


def check_same_step(env: Vector, run: Run) -> None:
    """Check that a step that ends an episode has its last observation in ``final_obs``, and returns a new first one."""
    need_ends(run)
    alike = ends = 0
    for call in steps_of(run):
        _check_final(call, "final_obs")
        first = list(iterate(env.observation_space, call.copied[0]))
        for place in np.flatnonzero(call.ended):
            last = call.copied[4]["final_obs"][place]
            if not env.single_observation_space.contains(last):
                raise FaultError(f"{call.name}, final_obs of environment {place}: wanted an observation in "
                                 f"single_observation_space, got {shown(last)}")
            alike, ends = alike + equal(first[place], last), ends + 1
    if alike == ends:
        raise FaultError("wanted the first observation of the new episode beside final_obs, got the same one twice")


def check_final_info(env: Vector, run: Run) -> None:
    """Check that a step that ends an episode has its last infos in ``final_info``."""
    need_ends(run)
    for call in steps_of(run):
        _check_final(call, "final_info")
        final = call.copied[4].get("final_info", {})
        if not isinstance(final, dict):
            raise FaultError(f"{call.name}: wanted final_info as a dict, got {shown(final)}")
        for key, mask in final.items():
            if key.startswith("_") and is_mask(mask) and (mask & ~call.ended).any():
                raise FaultError(f"{call.name}, final_info[{key!r}]: wanted True at most where an episode ended, "
                                 f"{call.ended.tolist()}, got {mask.tolist()}")


def _check_final(call: Call, name: str) -> None:
    """Check that the infos of a step have the entry ``name``, with a mask of the episodes that ended in it."""
    infos, nobody = call.copied[4], np.zeros_like(call.ended)
    if call.ended.any() and (name not in infos or f"_{name}" not in infos):
        raise FaultError(f"{call.name}, in which episodes ended: wanted '{name}' and '_{name}' in infos, "
                         f"got {sorted(infos)}")
    if not np.array_equal(mask := infos.get(f"_{name}", nobody), call.ended):
        raise FaultError(f"{call.name}, infos['_{name}']: wanted True where an episode ended, {call.ended.tolist()}, "
                         f"got {shown(mask)}")


def check_reset_mask(env: Vector, run: Run) -> None:
    """Check that ``reset_mask`` restarts the environments that it marks, and no others."""
    kept = resets = 0
    for before, call in pairwise(run):
        if len(call.copied) == len(PARTS):
            continue
        old_rows, new_rows = (iterate(env.observation_space, each.copied[0]) for each in (before, call))
        for place, (marked, old, new) in enumerate(zip(call.given, old_rows, new_rows, strict=True)):
            if marked:
                kept, resets = kept + equal(new, old), resets + 1
            elif not equal(new, old):
                raise FaultError(f"{call.name}, environment {place}, which it leaves out: wanted the observation "
                                 f"{shown(old)}, got {shown(new)}")
        for key, mask in call.copied[1].items():
            if key.startswith("_") and (mask & ~call.given).any():
                raise FaultError(f"{call.name}, infos[{key!r}]: wanted True at most in {call.given.tolist()}, "
                                 f"got {mask.tolist()}")
    if not resets:
        raise SkippedError(f"this cannot be checked, because no environment was reset in {len(steps_of(run))} steps")
    if kept == resets:
        raise FaultError("reset_mask: wanted first observations of new episodes, got those of the step before")


# --- seeds and pickles -----------------------------------------------------------------------------------------------


def check_starts(env: Vector) -> None:
    """Check that starts depend on the seed, differ between environments, and go on without a seed."""
    starts = [[copy.deepcopy(row) for row in iterate(env.observation_space, env.reset(seed=seed)[0])]
              for seed in SEEDS]
    vary = [not all(equal(start[place], starts[0][place]) for start in starts) for place in range(env.num_envs)]
    if not any(vary):
        raise SkippedError("all seeds give the same start")
    if not all(vary):
        raise FaultError(f"seeds {SEEDS[0]} to {SEEDS[-1]}: wanted starts that depend on the seed in all environments, "
                         f"got the same start in environment {vary.index(False)}")
    for one, other in combinations(range(env.num_envs), 2):
        if all(equal(start[one], start[other]) for start in starts):
            raise FaultError(f"seeds {SEEDS[0]} to {SEEDS[-1]}: wanted different starts in environments {one} and "
                             f"{other}, got the same ones")
    if all(equal(list(iterate(env.observation_space, env.reset()[0])), starts[-1]) for _ in SEEDS):
        raise FaultError("reset() without a seed: wanted new starts, got those of the seed before")


def check_unseeded(env: Vector) -> None:
    """Check that resets without a seed follow from the seed before."""
    twice = []
    for _ in range(2):
        env.reset(seed=SEED)
        twice.append(reset_call(env, "reset() after reset(seed=...)", np.zeros(env.num_envs, dtype=bool)))
    compare(twice[1:], twice[:1], "the same seed gives the same resets without a seed after it")


def check_pickle(env: Vector) -> None:
    """Check that a pickled copy goes on as the original does."""
    disabled = env.metadata["autoreset_mode"] is AutoresetMode.DISABLED
    actions = drawn_actions(env, SEED)
    env.reset(seed=SEED)
    for _ in range(0 if disabled else EARLY):
        env.step(next(actions))
    try:
        saved = pickle.dumps(env)
    except Exception as error:
        raise SkippedError(f"it cannot be pickled: {told(error)}") from None
    twin = pickle.loads(saved)
    try:
        for place in range(1, AGAIN + 1):
            given = next(actions)
            found, wanted = twin.step(copy.deepcopy(given)), env.step(given)
            for name, mine, theirs in zip(PARTS, found, wanted, strict=True):
                if text := difference(mine, theirs, f"step {place} after pickling, {name}"):
                    raise FaultError(f"a pickled copy goes on as the original: {text}")
            if disabled and (wanted[2] | wanted[3]).any():
                break
    finally:
        twin.close()


def told(error: BaseException) -> str:
    """Return an error's type and the first line of its text."""
    return f"{type(error).__name__}: {str(error).strip().partition(chr(10))[0]}"
