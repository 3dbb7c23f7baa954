"""The single environments within a vector: their attributes, method calls and saved states."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import wraps
from threading import RLock
from typing import Any, Concatenate, ParamSpec, TypeVar, cast

import gymnasium
import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray

from pendulum_env.engine.batch import FIELD_OF, Batch
from pendulum_env.engine.machine import NOWHERE, UNSEEN, Machine
from pendulum_env.engine.random_streams import Streams, generator_state, words_of
from pendulum_env.engine.sensing import Sensing
from pendulum_env.envs.attributes import Fixed, Portable, parameter
from pendulum_env.envs.cameras import Cameras
from pendulum_env.envs.env import LabPendulumEnv, earlier
from pendulum_env.envs.randomize import Bank
from pendulum_env.envs.saved import check_made_for, checked_random, checked_state, identity
from pendulum_env.envs.settings import METADATA
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, line, nearest, shown

Places = NDArray[np.intp]
P = ParamSpec("P")
T = TypeVar("T")
M = TypeVar("M", bound="Members")

KEYS = ("made_for", "numbers", "state", "random", "over")
"""Keys of a saved state of several environments; see :meth:`Members.get_state`."""
FIELDS = dict(zip(FIELD_OF, ("index", "q", "turns", "v"), strict=True))
"""Names of a single environment's state whose fields in a vector have other names."""
ATTRIBUTES = ("scene", "integrator", "dt", "substeps", "task", "render_mode", "render_size", "metadata", "speed_limit",
              "omega0", "velocity_bound", "observation_space", "action_space", "np_random_seed")
"""Attributes of a single environment that a vector knows; with the parameters of its scene, such as ``length``."""
EACH = {"get_wrapper_attr": "_attribute", "has_wrapper_attr": "_has", "set_wrapper_attr": "_assign"}
"""Methods of a single environment, and those of a vector that do the same for the environment with an index."""
METHODS = ("get_state", "set_state", "render", *EACH)
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
            self._assign(place, name, value)

    def call_at(self, which: Any, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Return what :meth:`call` returns, for the environments ``which`` only: an index, or a list of indices.

        Raises AttributeError for a name that is no method or attribute, SceneError for an index out of range.
        """
        places = self._places(which).tolist()
        if line(name, "name") in EACH:
            return tuple(getattr(self, EACH[name])(place, *args, **kwargs) for place in places)
        if name in METHODS:
            called: tuple[Any, ...] = getattr(self, f"_call_{name}")(places, *args, **kwargs)
            return called
        values = tuple(self._attribute(place, name) for place in places)
        return tuple(value(*args, **kwargs) if callable(value) else value for value in values)

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

    def _attribute(self, place: int, name: str) -> Any:
        """Return an attribute of the single environment with the index ``place``; AttributeError for other names."""
        line(name, "name")
        own: Any = vars(self).get("_attributes", {}).get(name, {})
        if place in own:
            return own[place]
        if name == "scene":
            return self._scene_of(place)
        if name in ("speed_limit", "omega0"):
            return self._number_of(place, name)
        if name in ("observation_space", "action_space"):
            return getattr(self, f"single_{name}")
        if name == "np_random_seed":
            return getattr(self, name)[place]
        if name == "metadata":
            return {**METADATA, "render_fps": 1.0 / self._dt}
        if name in ATTRIBUTES:
            return getattr(self, name)
        if isinstance(getattr(LabPendulumEnv, name, None), Fixed):
            return parameter(self._scene_of(place), name)
        if name in METHODS or hasattr(LabPendulumEnv, name):
            raise AttributeError(f"{shown(name)} cannot be called or read in the environments of a vector one by one; "
                                 f"these can: {', '.join((*METHODS, *ATTRIBUTES))}, and the scene's parameters.")
        raise AttributeError(f"The environments of this vector have no attribute {shown(name)}"
                             f"{nearest(name, (*METHODS, *ATTRIBUTES))}")

    def _call_render(self, places: Sequence[int]) -> tuple[Any, ...]:
        """Return the frames of some environments; None for each without a render mode."""
        frames = self.render()
        return tuple(None if frames is None else frames[place] for place in places)

    def _call_get_state(self, places: Sequence[int]) -> tuple[dict[str, Any], ...]:
        """Return the states of some environments in the form of single environments."""
        machine = self._machine()
        return tuple(self._state_of(machine, place) for place in places)

    def _call_set_state(self, places: Sequence[int], saved: Mapping[str, Any]) -> tuple[None, ...]:
        """Restore one state of a single environment in some environments."""
        self.set_state([saved] * len(places), places)
        return (None,) * len(places)

    def _has(self, place: int, name: str) -> bool:
        """Return True if the single environment with the index ``place`` has an attribute or method."""
        try:
            return name in METHODS or self._attribute(place, name) is not self
        except AttributeError:
            return False

    def _assign(self, place: int, name: str, value: Any, *, force: bool = True) -> bool:
        """Assign an attribute in one environment, as its ``set_wrapper_attr``; AttributeError for a setting."""
        line(name, "name")
        kept: dict[str, dict[int, Any]] = vars(self).get("_attributes", {})
        if isinstance(getattr(type(self), name, None), Fixed):
            setattr(self, name, value)  # refuses, with its reason
        if name in ATTRIBUTES or hasattr(LabPendulumEnv, name) or hasattr(type(self), name):
            raise AttributeError(f"{name} cannot be assigned in the environments of a vector, as all share it.")
        if not force and place not in kept.get(name, {}):
            return False
        vars(self).setdefault("_attributes", kept).setdefault(name, {})[place] = value
        return True

    def _scene_of(self, place: int) -> Scene:
        """Return the scene of one environment, with its own parameters."""
        each = self._spec.each
        return self._spec.scene if each is None or each.alike else each.own(place)

    def _number_of(self, place: int, name: str) -> float:
        """Return the program's parameter ``name`` in one environment, with the parameters of its present episode."""
        each = self._spec.each
        at = np.array([place])
        episode = {} if each is None else {key: column[at] for key, column in each.episode.items()
                                           if not math.isnan(column[place])}
        numbers = each.numbers_with(at, episode) if each is not None and episode else {}
        if name in numbers:
            return float(numbers[name][0])
        return float(np.broadcast_to(self._spec.numbers[name], (self._num_envs,))[place])

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
            machine = self._machine()
            rows = [self._checked_one(machine, place, one) for place, one in zip(places.tolist(), saved, strict=True)]
            self._restore(places, *joined(rows))
            return
        checked = self._checked(saved, places)
        if "more" in saved:
            self._restore_more(saved["more"], checked[0])
        self._restore(places, *checked)

    # --- what else vectors with drawn parameters, sensors or delays have -------------------------------------------

    def _extra(self) -> tuple[str, ...]:
        """Return what a state has beside the motion and the random streams, as words; () for nothing."""
        each = self._spec.each
        reasons = {"drawn parameters": self._randomization or (each is not None and each.episode),
                   "sensors, delays or a history": self._sensing is not None}
        return tuple(reason for reason, holds in reasons.items() if holds)

    def _more(self) -> dict[str, Any]:
        """Return the drawn parameters of present and next episodes, the drawn delays, and all readings and actions."""
        each, bank = self._spec.each, self._bank
        return {
            "episode": {} if each is None else {name: column.copy() for name, column in each.episode.items()},
            "delays": {name: column.copy() for name, column in self._delays.items()},
            "ahead": None if bank is None else bank.saved(),
            "sensing": None if self._sensing is None else self._sensing.saved_of_all(),
        }

    def _checked_more(self, more: Any) -> None:
        """Raise SceneError for what :meth:`_more` cannot have returned."""
        own, size = self._more(), self._num_envs
        checked_dict(more, "more", own)
        checked_columns(more["episode"], "episode", self._spec.scene.parameters(), size, some=True)
        checked_columns(more["delays"], "delays", ("observation_delay", "action_delay"), size, some=True)
        if self._randomization is not None:
            ahead = checked_dict(more["ahead"], "ahead", own["ahead"])
            array_of(ahead["ready"], "ready", (size,), "b")
            checked_columns(ahead["values"], "values", self._randomization.names, size, some=True)
            checked_columns(ahead["numbers"], "numbers", self._spec.numbers, size, some=True)
        if self._sensing is not None:
            self._sensing.checked_of_all(more["sensing"])

    def _restore_more(self, more: Mapping[str, Any], state: dict[str, NDArray[np.float64]]) -> None:
        """Write the checked part "more" of a state, and add to its motion the numbers that the vector lets vary."""
        batch, each = self._batch, self._spec.each
        if names := [name for name in state if name not in batch.layout.fields]:
            batch.vary(names)
        own = self._numbers(np.arange(self._num_envs))
        state.update((name, own[name]) for name in batch.layout.varying if name not in state)
        if each is not None:
            each.episode.clear()
            each.episode.update({name: column.copy() for name, column in more["episode"].items()})
        self._delays.clear()
        self._delays.update({name: column.copy() for name, column in more["delays"].items()})
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
        size, numbers, state = len(places), saved["numbers"], saved["state"]
        wanted = [*self._batch.layout.moving]
        if self._extra() or "more" in saved:
            if size < self._num_envs:
                raise SceneError("A state with more than the motion is restored as a whole; leave out which.")
            self._checked_more(saved.get("more"))
            wanted += [name for name in state if name in self._spec.numbers] if isinstance(state, Mapping) else []
        own = self._numbers(places)
        checked_columns(numbers, "numbers", own, size)
        checked_columns(state, "state", wanted, size)
        for name, values in own.items():
            if (differs := np.flatnonzero(numbers[name] != values)).size:
                raise SceneError(f"The state to restore is of another pendulum than that of environment "
                                 f"{places[differs[0]]}: its {name} is {numbers[name][differs[0]]:g}, not "
                                 f"{values[differs[0]]:g}.")
        for name in wanted:
            if not np.isfinite(state[name]).all():
                raise SceneError(f"{name} in a state to restore must be finite.")
        whole = [name for name in ("index", "status") if not (state[name] >= 0.0).all()]
        if whole or (self._spec.scene.periodic and (np.abs(state["q"]) > math.pi).any()):
            raise SceneError(f"{whole[0] if whole else 'q'} in a state to restore is out of range.")
        random = array_of(saved["random"], "random", (4, size), "u")
        over = array_of(saved["over"], "over", (size,), "b")
        if not (random[3] % 2 == 1).all():
            raise SceneError("random in a state to restore must have odd increments.")
        return {name: state[name] for name in wanted}, random, over

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

    def _machine(self) -> Machine:
        """Return a simulator of one pendulum of the vector; its parameters are those of environment 0."""
        known = {*self._batch.layout.numbers} <= {*self._spec.numbers, *self._batch.tolerance}
        if reasons := (*self._extra(), *(() if known else (f"the task {self._task.name}",))):
            raise SceneError(f"States of a vector with {' and '.join(reasons)} cannot be saved one by one, as they "
                             "have more than the motion; get_state() of the vector saves all.")
        return self._spec.one(0).machine()

    def _parameters(self, machine: Machine, place: int) -> Any:
        """Return a machine's parameters with the values of one environment."""
        numbers = self._spec.numbers
        return machine.array(
            np.broadcast_to(numbers[name], (self._num_envs,))[place] if name in numbers else value
            for name, value in zip(machine.numbers, machine.parameters, strict=True))

    def _identity(self, place: int) -> dict[str, Any]:
        """Return scene, method and step of one environment, as a single environment's states have them."""
        return identity(self._spec, self._scene_of(place), self._batch.tolerance)

    def _state_of(self, machine: Machine, place: int) -> dict[str, Any]:
        """Return the state of one environment as ``LabPendulumEnv.get_state`` returns it, without past actions."""
        values = None
        if self._begun:
            state = machine.array(self._batch.state(place, machine.names))
            machine.run(state, self._parameters(machine, place), 0.0, self._spec.h, 1, 0, math.inf, NOWHERE, UNSEEN)
            values = [float(value) for value in state]
        return {"made_for": self._identity(place), "state": values, "action": 0.0, "trail": [], "past": [], "seen": 0,
                "random": generator_state(self._seeded().words(np.array([place]))[:, 0])}

    def _checked_one(
        self, machine: Machine, place: int, saved: Any
    ) -> tuple[dict[str, float], NDArray[np.uint64]]:
        """Check the state of a single environment; return its numbers by field, and its random words."""
        values, _, _ = checked_state(saved, self._identity(place), machine)
        if values is None:
            raise SceneError("A state to restore in a vector must be that of an environment that has been reset.")
        random = checked_random(saved["random"], np.random.PCG64(0))
        # Reported quantities follow the state itself, partly under the same names: reversed, so that the state counts.
        by_field = {FIELDS.get(name, name): value
                    for name, value in reversed([*zip(machine.names, values, strict=True)])}
        by_field |= earlier(values, machine.phi, self._task.goal.before)
        return {name: by_field.get(name, 0.0) for name in self._batch.layout.moving}, words_of(random)


def joined(
    rows: Sequence[tuple[Mapping[str, float], NDArray[np.uint64]]]
) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.uint64], NDArray[np.bool_]]:
    """Return the checked states of single environments as columns, in the form of a vector's."""
    state = {name: np.array([numbers[name] for numbers, _ in rows]) for name in rows[0][0]} if rows else {}
    words = np.stack([word for _, word in rows], axis=1) if rows else np.empty((4, 0), dtype=np.uint64)
    return state, words, np.zeros(len(rows), dtype=np.bool_)


def checked_dict(saved: Any, what: str, names: Collection[str], some: bool = False) -> Mapping[str, Any]:
    """Return a part of a saved state; SceneError unless it is a dict with these names, or with ``some`` of them."""
    if not isinstance(saved, Mapping) or not {*saved} <= {*names} or (len(saved) < len(names) and not some):
        words = "of arrays, with names among" if some else "with"
        raise SceneError(f"{what} in a state to restore must be a dict {words} {', '.join(names)}.")
    return saved


def checked_columns(saved: Any, what: str, names: Collection[str], size: int, some: bool = False) -> None:
    """Raise SceneError unless a part of a saved state is a dict of arrays with a number for each environment."""
    for name, column in checked_dict(saved, what, names, some).items():
        array_of(column, name, (size,), "f")


def array_of(values: Any, name: str, shape: tuple[int, ...], kind: str) -> Any:
    """Return an array of a saved state; SceneError unless it has this shape and kind of number."""
    if not isinstance(values, np.ndarray) or values.shape != shape or values.dtype.kind != kind:
        raise SceneError(f"{name} in a state to restore must be an array of the shape {shape}, not {shown(values)}.")
    return values
