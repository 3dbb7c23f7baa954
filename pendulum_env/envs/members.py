"""The single environments within a vector: their attributes, method calls and saved states."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from threading import RLock
from typing import Any, Concatenate, ParamSpec, TypeVar, cast

import gymnasium
import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray

from pendulum_env.engine.batch import FIELD_OF, Batch
from pendulum_env.engine.each import Each
from pendulum_env.engine.machine import ANGLE, VELOCITY, Machine
from pendulum_env.engine.random_streams import Streams, generator_state, words_of
from pendulum_env.engine.sensing import Sensing
from pendulum_env.envs.attributes import Fixed, Portable, parameter
from pendulum_env.envs.cameras import Cameras, state_of
from pendulum_env.envs.env import LabPendulumEnv
from pendulum_env.envs.randomize import Bank
from pendulum_env.envs.saved import (
    by_name,
    check_form,
    check_made_for,
    check_numbers,
    checked_random,
    checked_state,
    identity,
)
from pendulum_env.envs.settings import METADATA
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, line, nearest, shown
from pendulum_env.tasks.task import earlier

Places = NDArray[np.intp]
P = ParamSpec("P")
T = TypeVar("T")
M = TypeVar("M", bound="Members")

KEYS = ("made_for", "numbers", "state", "random", "over")
"""Keys of a saved state of several environments; see :meth:`Members.get_state`."""
FIELDS = dict(zip(FIELD_OF, ("index", "q", "turns", "v"), strict=True))
"""Names of a single environment's state whose fields in a vector have other names."""
FIELD_NAMES = {field: name for name, field in FIELDS.items()}
SHARED = ("integrator", "dt", "substeps", "task", "render_mode", "render_size", "velocity_bound")
"""Attributes of a single environment that are those of the vector."""
ATTRIBUTES = (*SHARED, "scene", "metadata", "speed_limit", "omega0", "observation_space", "action_space",
              "np_random_seed")
"""Attributes of a single environment that a vector knows; with the parameters of its scene, such as ``length``."""
METHODS = ("get_state", "set_state", "render", "get_wrapper_attr", "has_wrapper_attr", "set_wrapper_attr")
"""Methods of a single environment that a vector can call for each."""


def alone(call: Callable[Concatenate[M, P], T]) -> Callable[Concatenate[M, P], T]:
    """Make a method of a vector refuse a call while another thread is in one, as both would write the same arrays.

    The method raises gymnasium's AlreadyPendingCallError then.
    """
    @wraps(call)
    def run(self: M, *args: P.args, **keywords: P.kwargs) -> T:
        if not self._turn.acquire(blocking=False):
            raise gymnasium.error.AlreadyPendingCallError(
                f"{call.__name__}() was called while another thread is in a call of this vector; use a vector from one "
                "thread at a time, or make one for each thread.", call.__name__)
        try:
            return call(self, *args, **keywords)
        finally:
            self._turn.release()

    return cast("Callable[Concatenate[M, P], T]", run)


class Member:
    """One environment of a vector, with the attributes and methods of a single environment that a vector knows.

    Attributes that a user sets are its own.
    """

    def __init__(self, vector: Members, place: int) -> None:
        self._vector, self._place = vector, place

    def __getattr__(self, name: str) -> Any:
        """Return what the user has not set; AttributeError for names that the vector does not know."""
        if name.startswith("_"):  # also while a copy is made, which has no vector yet
            raise AttributeError(f"The environments of a vector have no attribute {shown(name)}.")
        vector, place = self._vector, self._place
        if name in SHARED:
            return getattr(vector, name)
        if name in ("observation_space", "action_space"):
            return getattr(vector, f"single_{name}")
        if name == "np_random_seed":
            return getattr(vector, name)[place]
        if name == "metadata":
            return {**METADATA, "render_fps": 1.0 / vector.dt}
        if name in ("speed_limit", "omega0"):
            return vector._number_of(place, name)
        if name == "scene":
            return vector.scene if vector._each.alike else vector._each.own(place)
        if isinstance(getattr(LabPendulumEnv, name, None), Fixed):
            return parameter(self.scene, name)
        known = (*METHODS, *ATTRIBUTES)
        if hasattr(LabPendulumEnv, name):
            raise AttributeError(f"{shown(name)} cannot be called or read in the environments of a vector one by one; "
                                 f"these can: {', '.join(known)}, and the scene's parameters.")
        raise AttributeError(f"The environments of this vector have no attribute {shown(name)}{nearest(name, known)}")

    def get_wrapper_attr(self, name: str) -> Any:
        """Return an attribute or a method; AttributeError for other names."""
        return getattr(self, line(name, "name"))

    def has_wrapper_attr(self, name: str) -> bool:
        """Return True if there is an attribute or a method of this name."""
        return hasattr(self, line(name, "name"))

    def set_wrapper_attr(self, name: str, value: Any, *, force: bool = True) -> bool:
        """Set an attribute of the environment's own; with ``force`` False only one that was set before.

        Returns True if it was set. Raises AttributeError for a setting, and for what all environments share.
        """
        vector = self._vector
        if isinstance(getattr(type(vector), line(name, "name"), None), Fixed):
            setattr(vector, name, value)  # refuses, with its reason
        if name in ATTRIBUTES or hasattr(LabPendulumEnv, name) or hasattr(type(vector), name):
            raise AttributeError(f"{name} cannot be assigned in the environments of a vector, as all share it.")
        if not force and name not in vars(self):
            return False
        vars(self)[name] = value
        vector._members[self._place] = self
        return True

    def render(self) -> Any:
        """Return the environment's frame, or the list of its frames; None without a render mode."""
        cameras = self._vector._ready_to_render()
        return None if cameras is None else cameras.taken(self._place)

    def get_state(self) -> dict[str, Any]:
        """Return the environment's state as ``LabPendulumEnv.get_state`` returns it, without past actions."""
        return self._vector._state_of(self._place)

    def set_state(self, saved: Mapping[str, Any]) -> None:
        """Restore a state of a single environment."""
        self._vector.set_state([saved], [self._place])


class Members(Portable, VectorEnv[NDArray[np.float32], NDArray[np.float32], NDArray[Any]]):
    """The part of a vector environment that reads, calls, saves and restores its single environments."""

    _batch: Batch
    _camera: Cameras | None
    _num_envs: int
    _over: Places
    _begun: bool
    _known = False
    """True from the first reset on."""
    _turn: RLock
    _bank: Bank | None
    _sensing: Sensing | None
    _members: dict[int, Member]
    """The environments on which attributes have been set."""

    def _seeded(self) -> Streams:
        """Return the random streams of all environments."""
        raise NotImplementedError

    # --- Gymnasium's calls and attributes -----------------------------------------------------------------------

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Return the results of a single environment's method, or the values of its attribute, for all environments.

        As ``gymnasium.vector.SyncVectorEnv.call``. The methods are ``get_state``, ``set_state`` (one state, for all),
        ``render``, ``get_wrapper_attr``, ``has_wrapper_attr`` and ``set_wrapper_attr``; attributes are those of
        :meth:`get_attr`. Raises AttributeError for other names.
        """
        return self.call_at(None, name, *args, **kwargs)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """Return an attribute of the single environments, one value for each.

        The attributes are ``scene``, ``integrator``, ``dt`` [s], ``substeps``, ``task``, ``render_mode``,
        ``render_size``, ``metadata``, ``speed_limit`` [rad/s], ``omega0`` [1/s], ``velocity_bound`` [rad/s],
        ``observation_space``, ``action_space``, ``np_random_seed``, every parameter of the scene, such as ``length``
        [m], and attributes that :meth:`set_attr` has set. Raises AttributeError for other names.
        """
        return self.call(name)

    def set_attr(self, name: str, values: Any) -> None:
        """Set an attribute of all single environments: a list or tuple has one value for each, else one is for all.

        Settings are built into the program that all environments share, so that only new names can be set. Raises
        AttributeError for a setting, SceneError for a list of another length.
        """
        each = values if isinstance(values, (list, tuple)) else [values] * self._num_envs
        if len(each) != self._num_envs:
            raise SceneError(f"values must be one value or a list of one for each of {self._num_envs} environments, "
                             f"not of {len(each)}.")
        for place, value in enumerate(each):
            self._member(place).set_wrapper_attr(name, value)

    def call_at(self, which: Any, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Return what :meth:`call` returns, for the environments ``which`` only: an index, or a list of indices.

        Raises AttributeError for a name that is no method or attribute, SceneError for an index out of range.
        """
        places = self._places(which).tolist()
        if line(name, "name") == "set_state":  # of all at once, as before the first reset
            self.set_state([*args, *kwargs.values()] * len(places), places)
            return (None,) * len(places)
        values = [self._member(place).get_wrapper_attr(name) for place in places]
        return tuple(value(*args, **kwargs) if callable(value) else value for value in values)

    def _member(self, place: int) -> Member:
        """Return one environment."""
        return self._members.get(place) or Member(self, place)

    def _places(self, which: Any) -> Places:
        """Return the distinct indices of the environments ``which``, None for all, as an array."""
        size = self._num_envs
        if which is None:
            return np.arange(size)
        try:
            places = np.atleast_1d(np.asarray(which))
            if places.dtype.kind not in "iu" or places.ndim != 1 or not ((places >= 0) & (places < size)).all():
                raise ValueError
            if len(np.unique(places)) < len(places):
                raise ValueError
        except (ValueError, TypeError, OverflowError):
            raise SceneError(f"which must be None for all environments, an index, or a list of distinct indices from 0 "
                             f"to {size - 1}, not {shown(which)}.") from None
        return places.astype(np.intp)

    @property
    def _each(self) -> Each:
        """The scenes of the environments, with the parameters of their present episodes."""
        assert self._spec.each is not None
        return self._spec.each

    def _number_of(self, place: int, name: str) -> float:
        """Return the program's parameter ``name`` in one environment, with the parameters of its present episode."""
        at = np.array([place])
        episode = {key: column[at] for key, column in self._each.episode.items() if not math.isnan(column[place])}
        numbers = self._each.numbers_with(at, episode) if episode else {}
        if name in numbers:
            return float(numbers[name][0])
        return float(np.broadcast_to(self._spec.numbers[name], (self._num_envs,))[place])

    def _ready_to_render(self) -> Cameras | None:
        """Return the renderer, None without a render mode; ResetNeeded before the first reset."""
        if self._camera is None:
            gymnasium.logger.warn("render() draws nothing without render_mode='rgb_array' in gym.make_vec.")
        elif not self._begun:
            raise self._unready("the first render()")
        return self._camera

    def _unready(self, call: str) -> Exception:
        """Return the error of a call that needs a state of every environment: why there is none, and what to do."""
        if self.closed:
            return gymnasium.error.ClosedEnvironmentError(
                f"The vector was closed before {call}; make a new one by gym.make_vec.")
        if self._known:
            return gymnasium.error.ResetNeeded(
                "The last step or reset was interrupted or failed, so that some environments are ahead of others; call "
                f"reset() for all of them before {call}.")
        return gymnasium.error.ResetNeeded(f"Call reset() before {call}.")

    # --- states -------------------------------------------------------------------------------------------------

    @alone
    def get_state(self, which: Any = None) -> dict[str, Any]:
        """Return the complete state of the environments ``which``, from which :meth:`set_state` resumes bit for bit.

        ``which`` is an index, a list of indices, or None for all. The state is a dict of arrays, also for pickles:
        "state" has the numbers of the motion, "random" the random generators, "over" marks ended episodes, and
        "made_for" and "numbers" say which environments can take it. A vector with drawn parameters, sensors or delays
        is saved as a whole: "more" then has their values, readings and actions on their way. ``call("get_state")``
        returns the states in the form of single environments. Neither has the earlier angles and actions that only
        frames show.
        Raises SceneError for an index out of range, for some environments of a vector that is saved as a whole, and
        with the diagnostic "error"; ResetNeeded before the first reset.
        """
        self._check_saves(which)
        if not self._begun:
            raise self._unready("get_state()")
        places, batch = self._places(which), self._batch
        more = {"more": self._more()} if self._extra() else {}
        return {
            "made_for": self._made_for(),
            "numbers": self._numbers(places),
            "state": {name: batch.get(name, places) for name in (batch.layout.fields if more else batch.layout.moving)},
            "random": self._seeded().words(places),
            "over": np.isin(places, self._over),
            **more,
        }

    @alone
    def set_state(self, saved: Any, which: Any = None) -> None:
        """Restore a state of :meth:`get_state` in the environments ``which``: an index, a list of indices, or all.

        ``saved`` may also be a list of single environments' states, one for each. They must have the same scene,
        method and step. Raises SceneError, and changes nothing, for any other state; ResetNeeded if some environments
        would be left that have never been reset.
        """
        self._check_saves(which)
        places = self._places(which)
        if not self._begun and len(places) < self._num_envs:
            raise self._unready("the first set_state() of some environments")
        if isinstance(saved, (list, tuple)):
            if len(saved) != len(places):
                raise SceneError(f"saved must have one state for each of {len(places)} environments, not {len(saved)}.")
            self._check_alone()
            machine = self._spec.one(0).machine()
            rows = [self._checked_one(machine, place, one) for place, one in zip(places.tolist(), saved, strict=True)]
            self._restore(places, *self._joined(rows))
            return
        checked = self._checked(saved, places)
        if "more" in saved:
            self._restore_more(saved["more"], checked[0])
        self._restore(places, *checked)

    # --- what else vectors with drawn parameters, sensors or delays have -------------------------------------------

    def _extra(self) -> tuple[str, ...]:
        """Return what a state has beside the motion and the random streams, as words; () for nothing."""
        reasons = {"drawn parameters": self._randomization or self._each.episode,
                   "sensors, delays or a history": self._sensing is not None}
        return tuple(reason for reason, holds in reasons.items() if holds)

    def _more(self) -> dict[str, Any]:
        """Return the drawn parameters of present and next episodes, the drawn delays, and all readings and actions."""
        return {
            "episode": {name: column.copy() for name, column in self._each.episode.items()},
            "delays": {name: column.copy() for name, column in self._delays.items()},
            "ahead": None if self._bank is None else self._bank.saved(),
            "sensing": None if self._sensing is None else self._sensing.saved_of_all(),
        }

    def _restore_more(self, more: Mapping[str, Any], state: dict[str, NDArray[np.float64]]) -> None:
        """Write the checked part "more" of a state, and add to its motion the numbers that the vector lets vary."""
        batch = self._batch
        if names := [name for name in state if name not in batch.layout.fields]:
            batch.vary(names)
        own = self._numbers(np.arange(self._num_envs))
        state.update((name, own[name]) for name in batch.layout.varying if name not in state)
        self._each.episode = {name: column.copy() for name, column in more["episode"].items()}
        self._delays = {name: column.copy() for name, column in more["delays"].items()}
        if self._bank is not None:
            self._bank.restore(more["ahead"])
        if self._sensing is not None:
            self._sensing = self._sensing.checked_of_all(more["sensing"])

    def _restore(
        self, places: Places, state: Mapping[str, NDArray[np.float64]], words: NDArray[np.uint64],
        over: NDArray[np.bool_],
    ) -> None:
        """Write checked states, words of random generators and marks of ended episodes into environments."""
        for name, values in state.items():
            self._batch.put(name, places, values)
        self._seeded().restore(places, words)
        self._over = np.union1d(np.setdiff1d(self._over, places), places[over])
        self._begun = self._known = True
        if self._camera is not None:
            results = self._batch.results()
            self._batch.look(results)
            self._camera.keep(None, places, results.info)

    def _checked(
        self, saved: Any, places: Places
    ) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.uint64], NDArray[np.bool_]]:
        """Check a saved state of several environments, and return its motion, random words and ended episodes."""
        check_made_for(saved, KEYS, self._made_for(), "a vector")
        size, own = len(places), self._numbers(places)
        wanted = [*self._batch.layout.moving]
        more = bool(self._extra()) or "more" in saved
        if more:
            if size < self._num_envs:
                raise SceneError("A state with more than the motion is restored as a whole; leave out which.")
            state = saved["state"]
            wanted += [name for name in state if name in self._spec.numbers] if isinstance(state, Mapping) else []
        check_form({**saved, "more": saved.get("more")}, {
            **dict.fromkeys(saved), "numbers": dict.fromkeys(own, "f"), "state": dict.fromkeys(wanted, "f"),
            "random": "u", "over": "b", "more": self._form_of_more() if more else None}, "saved", size)
        if more and self._sensing is not None:
            self._sensing.checked_of_all(saved["more"]["sensing"])
        numbers, state, random = saved["numbers"], saved["state"], saved["random"]
        for name, values in own.items():
            if (differs := np.flatnonzero(numbers[name] != values)).size:
                raise SceneError(f"The state to restore is of another pendulum than that of environment "
                                 f"{places[differs[0]]}: its {name} is {numbers[name][differs[0]]:g}, not "
                                 f"{values[differs[0]]:g}.")
        for name in wanted:
            if not np.isfinite(state[name]).all():
                raise SceneError(f"{name} in a state to restore must be finite.")
        shape = self._batch.layout.shape
        check_numbers({FIELD_NAMES.get(name, name): state[name] for name in self._batch.layout.moving},
                      self._spec.scene, shape.drawn, self._spec.hold)
        if not (random[3] % 2 == 1).all():
            raise SceneError("random in a state to restore must have odd increments.")
        return {name: state[name] for name in wanted}, random, saved["over"]

    def _form_of_more(self) -> dict[str, Any]:
        """Return the form of what :meth:`_more` returns; see :func:`pendulum_env.envs.saved.check_form`."""
        draws = self._randomization
        return {
            "episode": {*self._spec.scene.parameters()}, "delays": {"observation_delay", "action_delay"},
            "ahead": None if draws is None else {
                "ready": "b", "values": {*draws.names}, "numbers": {*self._spec.numbers}}, "sensing": None}

    def _check_saves(self, which: Any) -> None:
        """Raise SceneError for a vector that saves no states, or that is saved as a whole and not in parts."""
        if self._spec.estimate_error:
            raise SceneError("States of a vector with the diagnostic 'error' cannot be saved, as the estimates have "
                             "more than the motion; pickle the vector.")
        if which is not None and (extra := self._extra()):
            raise SceneError(f"A vector with {' and '.join(extra)} is saved as a whole; leave out which.")

    def _made_for(self) -> dict[str, Any]:
        """Return the settings, apart from parameters, that a state must share with this vector to be restored here."""
        spec = self._spec
        made: dict[str, Any] = {
            "effects": [effect.name for effect in spec.scene.effects], "integrator": str(spec.integrator),
            "step": spec.h, "substeps": spec.hold, "compensated": spec.compensated, **self._batch.tolerance}
        if self._randomization or self._sensing is not None:
            made |= {"drawn": [] if self._randomization is None else [*self._randomization.names],
                     "sensing": str(None if self._sensing is None else self._sensing.plan)}
        return made

    def _numbers(self, places: Places) -> dict[str, NDArray[np.float64]]:
        """Return the program's parameters in some environments, by name."""
        numbers = self._spec.numbers
        return {name: np.broadcast_to(np.asarray(numbers[name], dtype=np.float64), (self._num_envs,))[places]
                for name in self._batch.layout.numbers if name in numbers}

    # --- states in the form of single environments --------------------------------------------------------------

    def _check_alone(self) -> None:
        """Raise SceneError for a vector whose environments have more than the motion of a single one."""
        known = {*self._batch.layout.numbers} <= {*self._spec.numbers, *self._batch.tolerance}
        if reasons := (*self._extra(), *(() if known else (f"the task {self._task.name}",))):
            raise SceneError(f"States of a vector with {' and '.join(reasons)} cannot be saved one by one, as they "
                             "have more than the motion; get_state() of the vector saves all.")

    def _state_of(self, place: int) -> dict[str, Any]:
        """Return the state of one environment as ``LabPendulumEnv.get_state`` returns it, without past actions."""
        self._check_alone()
        machine = self._spec.one(place).machine()
        values = [float(value) for value in state_of(self._batch, machine, place)] if self._begun else None
        return {"made_for": identity(self._spec, machine.scene, machine.tolerance), "state": values, "action": 0.0,
                "trail": [], "past": [], "seen": 0,
                "random": generator_state(self._seeded().words(np.array([place]))[:, 0])}

    def _checked_one(
        self, machine: Machine, place: int, saved: Any
    ) -> tuple[dict[str, float], NDArray[np.uint64]]:
        """Check the state of a single environment; return its numbers by field, and its random words.

        The ``machine`` may be that of another environment, as the numbers are checked for being finite only.
        """
        scene: Scene = self._member(place).scene
        values, _, _ = checked_state(saved, identity(self._spec, scene, machine.tolerance), machine)
        if values is None:
            raise SceneError("A state to restore in a vector must be that of an environment that has been reset.")
        numbers = by_name(values, machine.names)
        fields = {FIELDS.get(name, name): value for name, value in numbers.items()}
        fields |= earlier(self._task.goal.before, values[machine.phi], *values[ANGLE : VELOCITY + 1])
        return fields, words_of(checked_random(saved["random"], np.random.PCG64(0)))

    def _joined(
        self, rows: Sequence[tuple[Mapping[str, float], NDArray[np.uint64]]]
    ) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.uint64], NDArray[np.bool_]]:
        """Return the checked states of single environments as columns, in the form of a vector's."""
        state = {name: np.array([fields.get(name, 0.0) for fields, _ in rows]) for name in self._batch.layout.moving}
        words = np.array([word for _, word in rows], dtype=np.uint64).reshape(-1, 4).T
        return state, words, np.zeros(len(rows), dtype=np.bool_)
