"""Vector environment of many pendulums, each with the same bits as a single environment."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from threading import RLock
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from pendulum_env.common.results import one_line
from pendulum_env.engine.batch import Results
from pendulum_env.engine.layout import BLOCK
from pendulum_env.engine.random_streams import MOST_SEED, Streams, fresh_seeds, words_of_range
from pendulum_env.engine.report import SEEN
from pendulum_env.engine.sensing import MotionFields
from pendulum_env.engine.settings import described, documented, taking
from pendulum_env.engine.shape import LOST, STOP_REASONS
from pendulum_env.engine.spec import RunSpec
from pendulum_env.envs.attributes import fix
from pendulum_env.envs.cameras import Cameras
from pendulum_env.envs.limits import check_duration
from pendulum_env.envs.members import Members, alone
from pendulum_env.envs.randomize import Bank
from pendulum_env.envs.sensing import OBSERVED, drawn_delays, readings
from pendulum_env.envs.settings import (
    MANY,
    MOST_ENVS,
    START,
    EnvSettings,
    VectorSettings,
    batched,
    checked_options,
    spaces_of,
)
from pendulum_env.physics.flow import regime_of_damping
from pendulum_env.physics.units import SceneError, number, shown, whole_number
from pendulum_env.tasks import Task, TaskError
from pendulum_env.tasks.action import checked_actions

Array = NDArray[np.float64]
Places = NDArray[np.intp]
Infos = dict[str, Any]

LOOK = 16
"""Number of steps of a vector of environments between two looks at the speeds, for a warning."""
NOBODY: Places = np.empty(0, dtype=np.intp)
"""Empty array of environment indices."""


class LabPendulumVectorEnv(Members):
    """Vector environment of ``num_envs`` pendulums, advanced together by compiled loops.

    ``gym.make_vec("LabPendulum-v0", num_envs=4096, ...)`` creates one. Environment ``i`` of a vector seeded ``s`` gives
    the same bits as the single environment seeded ``s + i``, also after resets and for any number of threads.

    Keywords are those of :class:`pendulum_env.envs.env.LabPendulumEnv`, where any parameter of the scene may be an
    array with one value for each environment, and:

    {arguments}

    With ``integrator="auto"`` the accuracy holds for an episode of ``max_episode_steps`` (500 for None), tested in the
    environments with the smallest and the largest value of each array. With ``num_threads`` given and ``copy=False``
    the threads spin-wait for the next step for up to 1 ms before they sleep, which shortens steps.

    ``reset(options=...)`` takes "angle", "velocity" and parameters of the scene, numbers or arrays of ``num_envs``, and
    "reset_mask". When a parameter that ``randomize`` does not name is first set, another program is made.
    ``episode_parameters`` has the parameters of the present episodes that were drawn or set by options.

    Raises SceneError, MethodError or EngineError for an invalid argument, with the index of the environment.
    """

    MAKER = "gym.make_vec"
    metadata: dict[str, Any] = MANY
    num_threads: int
    _settings: VectorSettings

    @taking(VectorSettings)
    def __init__(self, given: VectorSettings) -> None:
        super().__init__()
        self._turn = RLock()
        self._num_envs, self.autoreset_mode = given.num_envs, AutoresetMode(given.autoreset_mode)
        plan = self._set_up(given, given.num_envs, given.max_episode_steps)
        spec, task, self._settled = self._spec, self._task, False
        self.metadata = {**MANY, "render_fps": 1.0 / self._dt, "autoreset_mode": self.autoreset_mode}
        most = np.inf if self._episode_steps is None else self._episode_steps
        self._batch = spec.batch(self._num_envs, task.goal, most, given.num_threads)
        self._bank = Bank(self._num_envs) if self._randomization else None
        fields, shape = self._batch.layout.fields, self._batch.layout.shape
        q, turns, v = map(fields.index, ("q", "turns", "v"))
        place = MotionFields(BLOCK, q, turns, v, spec.scene.periodic)
        self._sensing = readings(spec, plan, place, bool(shape.remembered), self._num_envs, self._batch.num_threads)
        if self._sensing is not None:
            self._batch.also(OBSERVED)
        self._plain = self._sensing is None and not self._acts
        self._seen_before: NDArray[np.float32] | None = None
        self._tell()
        self._names, self._masks = self._batch.names, tuple(f"_{name}" for name in self._batch.names)
        self._num_threads = self._batch.num_threads
        self.single_observation_space, self.single_action_space = spaces_of(self._velocity_bound, task, plan)
        self.observation_space = batched(self.single_observation_space, self._num_envs)
        self.action_space = batched(self.single_action_space, self._num_envs)
        self._reused = None if given.copy else self._batch.results(lasting=True)
        if self._reused is not None:
            self._batch.reuse(self._reused)
        self._camera = (Cameras(self._batch, spec, self._dt, given.render_size, self._look,
                                given.render_mode == "rgb_array_list")
                        if given.render_mode else None)
        self._streams: Streams | None = None
        self._members = {}
        self._seeds: NDArray[Any] | range = range(0)
        self._over, self._everyone = NOBODY, np.ones(self._num_envs, dtype=np.bool_)
        self._running = np.broadcast_to(np.array("", dtype=object), (self._num_envs,))
        shown = np.ones(self._num_envs, dtype=np.bool_)
        shown.flags.writeable = False
        self._marks: Infos = {**dict.fromkeys((*self._masks, "_stop_reason"), shown), "stop_reason": self._running}
        self._told: Infos | None = None
        self._begun = self._explained = False
        self._steps = 0
        self._slack = not shape.lenient  # True once no warning of a slack wire is due

    def __repr__(self) -> str:
        return one_line(self, f"{self._num_envs} x {self.scene.name}, {self.integrator}, task {self.task.name}, "
                        f"dt = {self.dt:g} s")

    # --- Gymnasium's interface ----------------------------------------------------------------------------------

    @alone
    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], Infos]:
        """Start episodes of all environments, or of those that ``options["reset_mask"]`` marks.

        Raises SceneError for invalid options or seeds, and then changes nothing; ClosedEnvironmentError after
        ``close()``, AlreadyPendingCallError while another thread is in a call of this vector.
        """
        size = self._num_envs
        rest = dict(options) if isinstance(options, Mapping) else options
        some = isinstance(rest, dict) and "reset_mask" in rest
        mask = checked_mask(rest.pop("reset_mask"), size) if isinstance(rest, dict) and some else self._everyone
        if self.closed or (some and not self._begun):
            raise self._unready("reset() with reset_mask" if some else "reset()")
        if not self._settled:
            check_duration(self._spec.tell, self.spec, self._own_steps, self._settings.max_episode_steps, self._dt,
                           self._task.name)
            self._settled = True
        which = np.flatnonzero(mask)
        asked, task, given = checked_options(rest, self.scene, self.task)
        own = {name: np.array([number(value, name) for value in checked_shape(name, values, which, size).tolist()])
               for name, values in given.items()}
        if own:
            self._each.numbers_with(which, own)
        starts = checked_starts(self._spec, asked, which, size)
        self._seed(checked_seeds(seed, size), which)
        results = self._batch.results() if self._reused is None else self._reused
        if some:
            self._batch.look(results)
        parameters = self._restart(which, results, own, starts, task)
        seen = self._seen(results)
        self._known = True
        self._over = np.setdiff1d(self._over, which, assume_unique=True)
        if self._camera is not None:
            self._camera.keep(None, which, results.info)
        rows = np.where(mask, results.info, 0.0) if some else results.info
        infos, none = {**self._infos(rows, mask.copy()), **parameters}, np.array(None)
        return seen, {**infos, "stop_reason": np.where(mask, self._running, none)} if some else infos

    @alone
    def step(
        self, actions: Any
    ) -> tuple[NDArray[np.float32], Array, NDArray[np.bool_], NDArray[np.bool_], Infos]:
        """Advance all environments by one control step of ``dt``, with one constant action each.

        ``actions`` has shape ``(num_envs, 1)``. Raises ActionError for another shape or values that are not finite,
        ResetNeeded before the first reset and, with autoreset disabled, while an ended episode has not been reset.
        After an interruption (Ctrl-C) some environments may be ahead of others, and all have to be reset. Raises
        ClosedEnvironmentError after ``close()``, AlreadyPendingCallError while another thread is in a call of this
        vector.
        """
        if not self._begun or self.closed:
            raise self._unready("the next step()" if self._known else "the first step()")
        waiting = self._over
        action = checked_actions(actions, self._num_envs, later=self._plain and not waiting.size)
        if waiting.size and self.autoreset_mode is AutoresetMode.DISABLED:
            raise gymnasium.error.ResetNeeded(
                f"Episodes that have ended: {waiting.size}, the first in environment {waiting[0]}; reset them with "
                "options={'reset_mask': ...} before the next step."
            )
        if self._acts:
            action = self._acted_by_all(action, waiting)
        results = self._batch.results() if self._reused is None else self._reused
        try:
            if self._sensing is None:
                given, taken = None, self._batch.step(action, results)
            else:
                given, taken = self._room(results), True
                self._batch.step_in_parts(self._sensing, action, results, given)
        except BaseException:
            self._begun = False
            raise
        if not taken:
            checked_actions(actions, self._num_envs)
        if self._checks and self._batch.wrong:
            self._refuse_rewards(results)
        if self._rate != 1.0:
            np.multiply(results.reward, self._rate, out=results.reward)
        if not self._slack and (slackened := self._batch.slackened):
            self._slack = True
            self._spec.tell_of_slack(slackened)
        if self._steps % LOOK == 0 and (speed := float(np.abs(results.observation[:, 2]).max())) > self._turning:
            self._turning = math.inf
            self._spec.tell_of_turns(speed)
        self._steps += 1
        extra: Infos = {}
        if waiting.size and self.autoreset_mode is AutoresetMode.NEXT_STEP:
            extra = self._restart(waiting, results, {}, {}, self._task)
            results.reward[waiting] = 0.0
            given = None
        seen = self._seen(results, given) if self._bounded or self._sensing is not None else results.observation
        over, self._over = NOBODY, NOBODY
        if self._batch.ended and (over := np.flatnonzero(results.terminated | results.truncated)).size:
            if self._penalty:
                stopped = over[results.terminated[over]]
                results.reward[stopped[self._batch.status(stopped) != LOST]] -= self._penalty
            reasons = self._reasons(over[results.terminated[over]], action)
            if self.autoreset_mode is AutoresetMode.SAME_STEP:
                extra = self._final(over, seen, results, reasons)
                ended, late = results.terminated[over], results.truncated[over]
                reward = results.reward[over]
                extra |= self._restart(over, results, {}, {}, self._task)
                results.terminated[over], results.truncated[over], results.reward[over] = ended, late, reward
                seen = self._seen(results)
            else:
                self._over, extra = over, {**extra, **reasons}
        if self._camera is not None:
            self._camera.keep(action, over if self.autoreset_mode is AutoresetMode.SAME_STEP else waiting, results.info)
        infos = self._infos_of_all(results)
        if extra:
            infos.update(extra)
        return seen, results.reward, results.terminated, results.truncated, infos

    def render(self) -> tuple[Any, ...] | None:
        """Return one frame for each environment, uint8 of shape (height, width, 3); None without a render mode.

        With "rgb_array_list" there is one list for each environment, of the frames of its episode since the last call.
        Raises ResetNeeded before the first reset.
        """
        cameras = self._ready_to_render()
        return None if cameras is None else cameras.render()

    def render_tiles(self, count: int = 9, columns: int | None = None) -> NDArray[np.uint8] | None:
        """Return one picture of the first ``count`` environments, row by row; None without a render mode.

        Each tile has ``render_size``. The picture has one clock, or one for each tile where their times differ. With
        ``columns`` None the grid is wider than high. Raises SceneError for invalid numbers, ResetNeeded before the
        first reset.
        """
        cameras, most = self._ready_to_render(), whole_number(count, "count", MOST_ENVS)
        across = None if columns is None else whole_number(columns, "columns", MOST_ENVS)
        return None if cameras is None else cameras.tiles(min(most, self._num_envs), across)

    def _acted_by_all(self, action: NDArray[Any], waiting: Places) -> Array:
        """Return the actions that settings make of those given, but for environments that only begin anew."""
        shares = np.clip(action.astype(np.float64), -1.0, 1.0)
        which = np.setdiff1d(np.arange(self._num_envs), waiting, assume_unique=True)
        shares[which] = self._acted(shares[which], lambda: self._seeded().uniform(which))
        return shares

    def __getstate__(self) -> dict[str, Any]:
        """Return the attributes for a copy or a pickle, without the cached infos, which share arrays with this object.
        """
        state = {**super().__getstate__(), "_told": None}
        return {name: value for name, value in state.items() if name not in ("_turn", "_known")}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        """Set the attributes of a copied or unpickled environment; shared arrays are read-only again."""
        super().__setstate__(state)
        self._turn, self._known = RLock(), self._begun
        for name in ("stop_reason", "_stop_reason"):
            self._marks[name].flags.writeable = False

    def _refuse_rewards(self, results: Results) -> None:
        """Raise TaskError if rewards by a user's function are not finite, with the first environment."""
        bad = np.flatnonzero(~np.isfinite(results.reward))
        if bad.size:
            self._begun = False
            place = int(bad[0])
            angle, velocity = (float(values[place]) for values in self._batch.motion()[1:])
            raise TaskError(f"The reward of the task {shown(self.task.name)} is {results.reward[place]} in environment "
                            f"{place}, at angle = {angle:.6g} rad, velocity = {velocity:.6g} rad/s; reset the "
                            "environments before the next step.")

    # --- parts --------------------------------------------------------------------------------------------------

    def _room(self, results: Results) -> NDArray[np.float32]:
        """Return the array into which the sensors write the observations."""
        assert self._sensing is not None
        shape = self._num_envs, self._sensing.plan.width + results.observation.shape[1] - len(SEEN)
        seen = np.empty(shape, np.float32) if self._seen_before is None else self._seen_before
        self._seen_before = None if self._reused is None else seen
        return seen

    def _seen(self, results: Results, seen: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
        """Return the observations: of the true motion or of the sensors, with the entries of the task's reference.

        Those of the sensors are ``seen``; None takes them anew, after new episodes have begun. Velocities are cut to
        ``velocity_bound``.
        """
        sensing = self._sensing
        if sensing is None:
            seen = results.observation
        else:
            if seen is None:
                seen = self._room(results)
                sensing.give(seen, results.info[-1])
            width = sensing.plan.width
            seen[:, width:] = results.observation[:, len(SEEN):]
            if self.task.goal.upright:
                turned = seen[:, : width - sensing.plan.swift]
                np.negative(turned, out=turned)
        if self._bounded:
            velocity, bound = seen[:, 2], self._velocity_bound
            np.clip(velocity, -bound, bound, out=velocity)
        return seen

    def _infos_of_all(self, results: Results) -> Infos:
        """Return the infos of a step in a new dict.

        The masks, which are True everywhere, are the same read-only array in every step. With ``copy=False`` the arrays
        of numbers, too, are reused by the next step.
        """
        if "quality_factor" in self._names:
            return self._infos(results.info, self._everyone.copy())
        if self._told is None:
            infos = self._marks.copy()
            infos.update(zip(self._names, results.info))  # noqa: B905  strict=True takes as long as three rows
            if self._reused is None:
                return infos
            self._told = infos
        return self._told.copy()

    def _infos(self, rows: Array, shown: NDArray[np.bool_]) -> Infos:
        infos: Infos = dict.fromkeys(self._masks, shown)
        infos.update(zip(self._names, rows))  # noqa: B905  strict=True takes as long as three rows
        infos["stop_reason"], infos["_stop_reason"] = self._running, shown
        if "quality_factor" in infos:
            regimes = np.full(self._num_envs, None, dtype=object)
            regimes[shown] = [regime_of_damping(quality) for quality in infos["quality_factor"][shown].tolist()]
            infos["damping_regime"], infos["_damping_regime"] = regimes, shown
        return infos

    def _reasons(self, ended: Places, action: NDArray[Any]) -> Infos:
        """Return the info "stop_reason": why episodes ended, and "" for the others; nothing if none ended.

        Warn once if an episode ended because an implicit equation was not solved.
        """
        if not ended.size:
            return {}
        names = [STOP_REASONS[code] for code in self._batch.status(ended).tolist()]
        if not self._explained and self._batch.method.implicit:
            self._explained = self._spec.tell_of_stops(
                zip(ended.tolist(), names, strict=True), self._batch.kept,
                lambda place: min(max(float(action[place]), -1.0), 1.0))
        reasons = self._running.copy()
        reasons[ended] = names
        return {"stop_reason": reasons}

    def _final(self, over: Places, seen: NDArray[np.float32], results: Results, reasons: Infos) -> Infos:
        """Return Gymnasium's infos with the last observations and infos of episodes that restart in the same step."""
        last_seen, shown = np.full(self._num_envs, None, dtype=object), np.zeros(self._num_envs, dtype=np.bool_)
        shown[over] = True
        for place in over.tolist():
            last_seen[place] = seen[place].copy()
        last = {**self._infos(np.where(shown, results.info, 0.0), shown), **reasons}
        last["stop_reason"] = np.where(shown, last["stop_reason"], None)
        return {"final_obs": last_seen, "_final_obs": shown, "final_info": last, "_final_info": shown.copy()}

    def _restart(
        self, which: Places, results: Results, own: Mapping[str, Array], starts: Mapping[str, Array], task: Task
    ) -> Infos:
        """Start new episodes with drawn parameters and starts, but for those given; return their parameters as infos.

        The ``task`` is the environments' own, or one with other ranges of starts.
        """
        self._begun = False  # until all have a state again, also after an interruption
        numbers = self._take_parameters(which, own)
        drawn = dict(zip(START, self._random(which, numbers, task), strict=True)) if len(starts) < len(START) else {}
        angle, velocity = ({**drawn, **starts}[name] for name in START)
        these = None if len(which) == self._num_envs else which
        gusts = self._batch.drawn(self._seeded(), which) if self._batch.layout.shape.drawn else {}
        self._batch.start(these, angle, velocity, gusts, results, numbers)
        if self._sensing is not None:
            drawn_late, late = drawn_delays(self._sensing.plan, lambda: self._seeded().uniform(which))
            self._batch.begin_readings(self._sensing, which, *drawn_late)
            for name, steps in late.items():
                self._delays.setdefault(name, np.zeros(self._num_envs))[which] = steps * self._batch.h
        self._begun = True
        return self._parameter_infos(which)

    def _take_parameters(self, which: Places, given: Mapping[str, Array]) -> dict[str, Array]:
        """Draw the parameters of new episodes in the environments ``which``, but for those that are ``given``.

        Return the program's numbers that follow from them; {} if all episodes have the environments' own parameters.
        """
        each, draws = self._each, self._randomization
        if draws is None or self._bank is None:
            return each.take(which, given) if given or each.episode else {}

        def draw(places: Places) -> tuple[dict[str, Array], dict[str, Array]]:
            values = draws.drawn(self._seeded(), places, self._spec.backend)
            return values, each.numbers_with(places, values)

        values, numbers = self._bank.take(which, draw)
        return each.take(which, {**values, **given}, None if given else numbers)

    def _parameter_infos(self, which: Places) -> Infos:
        """Return the infos with the drawn or given parameters of new episodes; {} if they have none."""
        rows: Infos = {}
        for name, column in self.episode_parameters.items():
            if (own := which[~np.isnan(column[which])]).size:
                values, mask = np.zeros(self._num_envs), np.zeros(self._num_envs, dtype=np.bool_)
                values[own], mask[own] = column[own], True
                rows |= {name: values, f"_{name}": mask}
        if not rows:
            return {}
        shown = np.logical_or.reduce([mask for name, mask in rows.items() if mask.dtype == np.bool_])
        return {"parameters": rows, "_parameters": shown}

    @property
    def own_parameters(self) -> dict[str, Array]:
        """Parameters that were given as one number for each environment: name -> array ``(num_envs,)``."""
        return self._each.given

    @property
    def episode_parameters(self) -> dict[str, Array]:
        """Parameters of the present episodes that were drawn, or set by options: name -> array ``(num_envs,)``.

        nan stands for the value of the environment's own scene. Random delays [s] are among them.
        """
        return {name: column.copy() for name, column in {**self._each.episode, **self._delays}.items()}

    def _random(self, which: Places, numbers: Mapping[str, Array], task: Task) -> tuple[Array, Array]:
        """Return start angles [rad] and velocities [rad/s] of new episodes in the environments ``which``.

        ``numbers`` are the program's numbers of these episodes, {} for those of the environments.
        """
        run, size = self.scene.run, len(which)
        if not task.draws:
            return np.full(size, run.angle), np.full(size, run.velocity)
        omega0, streams = self._spec.numbers["omega0"], self._seeded()
        first, second = streams.uniform(which), streams.uniform(which)
        omega = numbers.get("omega0", omega0[which] if isinstance(omega0, np.ndarray) else omega0)
        if task.goal.begin is not None:
            return self._batch.starts(first, second, np.broadcast_to(omega, size).astype(np.float64))
        angle, velocity = task.starts(first, second, omega)
        return np.asarray(angle), np.asarray(velocity)

    def _seed(self, seeds: range | list[int | None] | None, which: Places) -> None:
        """Seed the random streams of the environments ``which``, except where the seed is None."""
        if seeds is None:
            return
        if isinstance(seeds, range) and len(which) == self._num_envs:
            self._seeds, self._streams = seeds, Streams(seeds)
        else:
            streams = self._seeded()
            own = words_of_range(seeds) if isinstance(seeds, range) else np.array(seeds, dtype=object)
            which = which[own[which] != None]  # noqa: E711  of each entry
            self._seeds = np.array(self._seeds, dtype=object)  # a seed may be larger than 2**64
            self._seeds[which] = own[which]
            streams.seed(which, own[which] if own.dtype == np.uint64 else own[which].tolist())
        if self._bank is not None:
            self._bank.forget(which)

    def _seeded(self) -> Streams:
        """Return the random streams of all environments, created when first used."""
        if self._streams is None:
            fresh = fresh_seeds(self._num_envs)
            self._seeds, self._streams = fresh, Streams(fresh)
        return self._streams

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """The seed of every environment, as that of each single environment."""
        self._seeded()
        return tuple(map(int, self._seeds))


fix(LabPendulumVectorEnv, ("omega0",))
documented(LabPendulumVectorEnv, arguments=described(VectorSettings, EnvSettings))


def checked_mask(mask: Any, size: int) -> NDArray[np.bool_]:
    """Check ``reset_mask``, the array of booleans that marks environments to reset, and return it.

    Raises SceneError for another type or shape, or a mask without True.
    """
    if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_ or mask.shape != (size,):
        raise SceneError(f"reset_mask must be an array of {size} booleans, not {shown(mask)}.")
    if not mask.any():
        raise SceneError("reset_mask is False for all environments; mark at least one.")
    return mask


def checked_starts(spec: RunSpec, asked: Mapping[str, Any], which: Places, size: int) -> dict[str, Array]:
    """Return the asked ones of start angles [rad] and velocities [rad/s] of the environments ``which``, by name.

    Options of ``reset`` are one number, or an array with one for each environment. Raises SceneError for another shape,
    or values that are no valid start.
    """
    if not asked:
        return {}
    starts = {name: checked_shape(name, asked.get(name, 0.0), which, size) for name in START}
    found = zip(START, spec.tell_of_start(starts["angle"], starts["velocity"]), strict=True)
    return {name: values for name, values in found if name in asked}


def checked_shape(name: str, values: Any, which: Places, size: int) -> NDArray[Any]:
    """Return the values of an option of ``reset`` for the environments ``which``: one for all, or an array of ``size``.

    Raises SceneError for another shape.
    """
    wanted = f"{name} must be one number or one for each of {size} environments"
    try:
        shape = np.shape(values)
    except ValueError:
        raise SceneError(f"{wanted}, not {shown(values)}.") from None
    if shape not in ((), (size,)):
        raise SceneError(f"{wanted}, not {shape}.")
    return np.broadcast_to(np.asarray(values), (size,))[which]


def checked_seeds(seed: Any, size: int) -> range | list[int | None] | None:
    """Return the seeds of all environments, None without a seed; raises SceneError for an invalid seed.

    Those that follow from one number are a range, which takes no memory, if they are below 2**64.
    """
    if seed is None:
        return None
    seeds: list[int | None] = []
    if isinstance(seed, (int, np.integer)) and not isinstance(seed, bool):
        if 0 <= seed <= 2**64 - size:
            return range(int(seed), int(seed) + size)
        seeds = [int(seed) + place for place in range(size)]
    elif isinstance(seed, (list, tuple)) or (isinstance(seed, np.ndarray) and seed.ndim):
        seeds = [entry.item() if isinstance(entry, np.generic) else entry for entry in seed]
    if len(seeds) != size:
        raise SceneError(f"seed must be one whole number or one for each of {size} environments, not {shown(seed)}.")
    for place, entry in enumerate(seeds):
        whole = isinstance(entry, int) and not isinstance(entry, bool) and 0 <= entry <= MOST_SEED
        if entry is not None and not whole:
            raise SceneError(
                f"A seed must be a whole number from 0 to 2**128 - 1, but environment {place} has {shown(entry)}."
            )
    return seeds
