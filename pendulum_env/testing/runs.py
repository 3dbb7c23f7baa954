"""Runs of vector environments, recorded call by call, and their comparison."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from itertools import islice
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
