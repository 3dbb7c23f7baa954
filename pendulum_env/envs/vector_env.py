"""Many pendulums at once behind Gymnasium's vector interface: environment ``i`` is the single one, bit for bit."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from numpy.typing import NDArray

from integrators import Method, MethodError
from pendulum_env.engine.batch import Results
from pendulum_env.engine.kernels import Backend
from pendulum_env.engine.machine import check_diagnostics
from pendulum_env.engine.shape import STOP_REASONS
from pendulum_env.engine.spec import RunSpec
from pendulum_env.engine.streams import MOST_SEED, Streams, fresh_seeds
from pendulum_env.engine.threads import MOST_THREADS
from pendulum_env.envs.cameras import Cameras
from pendulum_env.envs.settings import (
    MANY,
    action_space,
    batched,
    checked_options,
    checked_settings,
    observation_space,
    settled,
)
from pendulum_env.physics.damping import Damping
from pendulum_env.physics.flow import regime_of_damping
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, naming_keywords, one_of, shown, truth, whole_number
from pendulum_env.tasks.action import checked_actions

Array = NDArray[np.float64]
Places = NDArray[np.intp]
Infos = dict[str, Any]

MOST_ENVS = 2**26
NOBODY: Places = np.empty(0, dtype=np.intp)


class LabPendulumVectorEnv(VectorEnv[NDArray[np.float32], NDArray[np.float32], NDArray[Any]]):
    """``num_envs`` pendulums, advanced together by compiled loops over blocks of them.

    ``gym.make_vec("LabPendulum-v0", num_envs=4096, ...)`` makes one. Environment ``i`` of a vector seeded ``s`` gives
    the same bits as the single environment seeded ``s + i``, through resets and for every number of threads.

    Keywords are those of :class:`pendulum_env.envs.env.LabPendulumEnv`, and:

    - any parameter of the scene, and ``speed_limit``, may be an array of ``num_envs``: one value for each.
    - ``max_episode_steps``: control steps until an episode is truncated; None for never. With "auto" the accuracy holds
      over so many, or 500, in the environments with the smallest and the largest value of each array.
    - ``autoreset_mode``: "NextStep", "SameStep" or "Disabled" (https://farama.org/Vector-Autoreset-Mode).
    - ``num_threads``: by default every core for many environments, and one for few.
    - ``copy``: False reuses the arrays that ``step`` returned before.

    ``reset(options=...)`` takes "angle" and "velocity", numbers or arrays of ``num_envs``, and "reset_mask".

    Raises SceneError, MethodError or EngineError for anything that cannot be, with the index of the environment.
    """

    metadata: dict[str, Any] = MANY

    def __init__(
        self,
        num_envs: int = 1,
        scene: str | Scene | Mapping[str, object] = "lab",
        integrator: str | Method = "rk4",
        damping: Damping = "scene",
        dt: float = 0.02,
        substeps: int = 1,
        task: str = "swing_up",
        diagnostics: Sequence[str] = ("energy",),
        speed_limit: Any = None,
        render_mode: str | None = None,
        render_size: int | tuple[int, int] = 500,
        backend: Backend = "auto",
        max_episode_steps: int | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        num_threads: int | None = None,
        copy: bool = True,
        rtol: float | None = None,
        atol: float | None = None,
        compensated: bool = False,
        accuracy: float | None = None,
        render_theme: str = "light",
        render_panels: Sequence[str] = ("apparatus", "energy"),
        **parameters: Any,
    ) -> None:
        super().__init__()
        if rtol is not None or atol is not None:
            said = "those of a vector step together, dt / substeps at a time"
            raise MethodError(f"rtol and atol are for single environments: {said}.")
        self.num_envs = whole_number(num_envs, "num_envs", MOST_ENVS)
        asked = check_diagnostics(diagnostics)
        made = checked_settings(dt, substeps, task, render_mode, render_size, render_theme, render_panels, asked, True)
        self.render_mode, self.render_size = made.render_mode, made.render_size
        self.autoreset_mode = autoreset_mode_of(autoreset_mode)
        self.metadata = {**made.metadata, "autoreset_mode": self.autoreset_mode}
        most = np.inf if max_episode_steps is None else whole_number(max_episode_steps, "max_episode_steps", 2**53)
        wanted = None if num_threads is None else whole_number(num_threads, "num_threads", MOST_THREADS)
        with naming_keywords(type(self)):
            spec = self._spec = RunSpec.of_episodes(
                scene, damping, parameters, dt=made.dt, size=self.num_envs, diagnostics=asked, speed_limit=speed_limit,
                backend=backend, compensated=compensated,
                choose=lambda scenes: settled(made, scenes, integrator, accuracy, max_episode_steps, compensated),
            )
        self._batch = spec.batch(self.num_envs, (made.task.reward, made.task.lost), most, wanted)
        spec.tell()
        self.scene, self.dt, self.substeps, self.task = spec.scene, made.dt, spec.hold, made.task
        self._names, self._masks = self._batch.names, tuple(f"_{name}" for name in self._batch.names)
        self.integrator, self.num_threads = spec.integrator, self._batch.num_threads
        self.single_observation_space, self.single_action_space = observation_space(), action_space()
        self.observation_space = batched(self.single_observation_space, self.num_envs)
        self.action_space = batched(self.single_action_space, self.num_envs)
        self._reused = None if truth(copy, "copy") else self._batch.results()
        self._camera = Cameras(self._batch, spec, made) if made.render_mode else None
        self._streams: Streams | None = None
        self._over, self._everyone = NOBODY, np.ones(self.num_envs, dtype=np.bool_)
        self._told: Infos | None = None
        self._begun = self._explained = False
        self._slack = not self._batch.layout.shape.lenient  # True where no warning of it is due any more

    # --- Gymnasium's interface ----------------------------------------------------------------------------------

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], Infos]:
        """Start episodes of all environments, or of those that ``options["reset_mask"]`` marks.

        Raises SceneError for options or seeds that cannot be; nothing has changed then.
        """
        size = self.num_envs
        rest = dict(options) if isinstance(options, Mapping) else options
        some = isinstance(rest, dict) and "reset_mask" in rest
        mask = checked_mask(rest.pop("reset_mask"), size) if isinstance(rest, dict) and some else self._everyone
        if some and not self._begun:
            raise gymnasium.error.ResetNeeded("Reset all environments before some of them.")
        which = np.flatnonzero(mask)
        asked = checked_options(rest, self.scene.run, self.task)
        starts = None if asked is None else checked_starts(self._spec, asked, which, size)
        self._seed(checked_seeds(seed, size), which)
        angle, velocity = self._random(which) if starts is None else starts
        results = self._fresh()
        if some:
            self._batch.look(results)
        self._batch.start(which if some else None, angle, velocity, self._drawn_for(which), results)
        self._begun, self._over = True, np.setdiff1d(self._over, which, assume_unique=True)
        if self._camera is not None:
            self._camera.keep(None, which, results.info)
        rows = np.where(mask, results.info, 0.0) if some else results.info
        return results.observation, self._infos(rows, mask.copy())

    def step(
        self, actions: Any
    ) -> tuple[NDArray[np.float32], Array, NDArray[np.bool_], NDArray[np.bool_], Infos]:
        """Hold one action per environment, shape ``(num_envs, 1)``, for one control step of ``dt``.

        Raises ActionError for another shape or values that are not finite, ResetNeeded before the first reset and,
        where autoreset is disabled, while an episode that is over has not been reset. After an interruption, as by
        Ctrl-C, some environments may be ahead of others, and all have to be reset.
        """
        if not self._begun:
            raise gymnasium.error.ResetNeeded("Call reset() before the first step().")
        action = checked_actions(actions, self.num_envs)
        waiting = self._over
        if waiting.size and self.autoreset_mode is AutoresetMode.DISABLED:
            raise gymnasium.error.ResetNeeded(
                f"The episode of environment {waiting[0]} is over, as of {waiting.size} in all; reset them with "
                "options={'reset_mask': ...} before the next step."
            )
        results = self._fresh()
        try:
            self._batch.step(action, results)
        except BaseException:
            self._begun = False
            raise
        if not self._slack and (steps := self._batch.slackened):
            self._slack = True
            self._spec.tell_of_slack(steps)
        extra: Infos = {}
        if waiting.size and self.autoreset_mode is AutoresetMode.NEXT_STEP:
            self._batch.start(waiting, *self._random(waiting), self._drawn_for(waiting), results)
            results.reward[waiting] = 0.0
        over, self._over = NOBODY, NOBODY
        if results.some_over:
            over = np.flatnonzero(results.terminated | results.truncated)
            reasons = self._reasons(over[results.terminated[over]], action)
            if self.autoreset_mode is AutoresetMode.SAME_STEP:
                extra = self._final(over, results, reasons)
                ended, late = results.terminated[over], results.truncated[over]
                reward = results.reward[over]
                self._batch.start(over, *self._random(over), self._drawn_for(over), results)
                results.terminated[over], results.truncated[over], results.reward[over] = ended, late, reward
            else:
                self._over, extra = over, reasons
        if self._camera is not None:
            self._camera.keep(action, over if self.autoreset_mode is AutoresetMode.SAME_STEP else waiting, results.info)
        infos = self._infos_of_all(results)
        if extra:
            infos.update(extra)
        return results.observation, results.reward, results.terminated, results.truncated, infos

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """One frame for each environment, uint8 of shape (height, width, 3); None without a render mode.

        Raises ResetNeeded before the first reset.
        """
        cameras = self._ready_to_render()
        return None if cameras is None else tuple(map(cameras.frame, range(self.num_envs)))

    def render_tiles(self, count: int = 9, columns: int | None = None) -> NDArray[np.uint8] | None:
        """One picture of the first environments, up to ``count`` of them, row by row; None without a render mode.

        Each tile has ``render_size``. They stand under one clock, or have each its own where their times differ.
        ``columns``: None for a grid that is wider than high. Raises SceneError for numbers that cannot be, ResetNeeded
        before the first reset.
        """
        cameras, most = self._ready_to_render(), whole_number(count, "count", MOST_ENVS)
        across = None if columns is None else whole_number(columns, "columns", MOST_ENVS)
        return None if cameras is None else cameras.tiles(min(most, self.num_envs), across)

    def _ready_to_render(self) -> Cameras | None:
        if self._camera is None:
            gymnasium.logger.warn("render() draws nothing without render_mode='rgb_array' in gym.make_vec.")
        elif not self._begun:
            raise gymnasium.error.ResetNeeded("Call reset() before the first render().")
        return self._camera

    def __getstate__(self) -> dict[str, Any]:
        """Everything but the infos that are told again, whose arrays show those of this environment."""
        return {**vars(self), "_told": None}

    # --- parts --------------------------------------------------------------------------------------------------

    def _fresh(self) -> Results:
        return self._batch.results() if self._reused is None else self._reused

    def _infos_of_all(self, results: Results) -> Infos:
        """The infos of a step, in a dict of its own; with ``copy=False`` of arrays that are the same in each step."""
        if self._reused is None or "quality_factor" in self._names:
            return self._infos(results.info, self._everyone.copy())
        if self._told is None:
            self._told = self._infos(results.info, self._everyone.copy())
        return self._told.copy()

    def _infos(self, rows: Array, shown: NDArray[np.bool_]) -> Infos:
        infos: Infos = dict.fromkeys(self._masks, shown)
        infos.update(zip(self._names, rows))  # noqa: B905  strict=True takes as long as three rows
        if "quality_factor" in infos:
            regimes = np.full(self.num_envs, None, dtype=object)
            regimes[shown] = [regime_of_damping(quality) for quality in infos["quality_factor"][shown].tolist()]
            infos["damping_regime"], infos["_damping_regime"] = regimes, shown
        return infos

    def _reasons(self, ended: Places, action: NDArray[Any]) -> Infos:
        """Why episodes ended; a warning, once, where the equations of some were not solved."""
        if not ended.size:
            return {}
        names = [STOP_REASONS[code] for code in self._batch.status(ended).tolist()]
        if not self._explained and self._batch.method.implicit:
            self._explained = self._spec.tell_of_stops(
                zip(ended.tolist(), names, strict=True), self._batch.kept,
                lambda place: min(max(float(action[place]), -1.0), 1.0))
        return marked("stop_reason", ended, names, self.num_envs)

    def _final(self, over: Places, results: Results, reasons: Infos) -> Infos:
        """Last observations and infos of episodes whose environments start anew in the same step."""
        found: Infos = marked("final_obs", over, results.observation[over], self.num_envs)
        shown = found["_final_obs"]
        rows = np.where(shown, results.info, 0.0)
        return {**found, "final_info": {**self._infos(rows, shown), **reasons}, "_final_info": shown.copy()}

    def _random(self, which: Places) -> tuple[Array, Array]:
        """Angles and velocities of new episodes at these places."""
        run, size = self.scene.run, len(which)
        if self.task.centre is None:
            return np.full(size, run.angle), np.full(size, run.velocity)
        omega0, streams = self._spec.numbers["omega0"], self._seeded()
        first, second = streams.uniform(which), streams.uniform(which)
        angle, velocity = self.task.start(first, second, omega0[which] if isinstance(omega0, np.ndarray) else omega0)
        return np.asarray(angle), np.asarray(velocity)

    def _seed(self, seeds: NDArray[np.uint64] | list[int | None] | None, which: Places) -> None:
        """Start the random streams of those of these places that have a seed."""
        if seeds is None:
            return
        streams = self._seeded()
        if isinstance(seeds, np.ndarray):
            streams.seed(which, seeds[which])
            return
        places = [place for place in which.tolist() if seeds[place] is not None]
        wanted = [seed for place in places if (seed := seeds[place]) is not None]
        streams.seed(np.array(places, dtype=np.intp), wanted)

    def _seeded(self) -> Streams:
        """The random streams, made when first used."""
        if self._streams is None:
            self._streams = Streams(fresh_seeds(self.num_envs))
        return self._streams

    def _drawn_for(self, which: Places) -> dict[str, Array]:
        """What effects start from at random in new episodes at these places."""
        return self._batch.drawn(self._seeded(), which) if self._batch.layout.shape.drawn else {}


def autoreset_mode_of(mode: Any) -> AutoresetMode:
    """Return the autoreset mode of this value or name; SceneError for an unknown one."""
    names = [entry.value for entry in AutoresetMode]
    if isinstance(mode, AutoresetMode):
        return mode
    return AutoresetMode(one_of(mode, "autoreset_mode", names))


def checked_mask(mask: Any, size: int) -> NDArray[np.bool_]:
    """Return a mask of environments to reset; SceneError for another type or shape, or a mask that marks none."""
    if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_ or mask.shape != (size,):
        raise SceneError(f"reset_mask must be an array of {size} booleans, not {shown(mask)}.")
    if not mask.any():
        raise SceneError("reset_mask must mark at least one environment, not none.")
    return mask


def checked_starts(spec: RunSpec, asked: Mapping[str, Any], which: Places, size: int) -> tuple[Array, Array]:
    """Return angles [rad] and velocities [rad/s] of the environments at these places, from one number or one for each.

    Raises SceneError for another shape, or values that cannot be a start.
    """
    found = {}
    for name, values in asked.items():
        wanted = f"{name} must be one number or one for each of {size} environments"
        try:
            shape = np.shape(values)
        except ValueError:
            raise SceneError(f"{wanted}, not {shown(values)}.") from None
        if shape not in ((), (size,)):
            raise SceneError(f"{wanted}, not {shape}.")
        found[name] = np.broadcast_to(np.asarray(values), (size,))[which]
    return spec.tell_of_start(found["angle"], found["velocity"])


def checked_seeds(seed: Any, size: int) -> NDArray[np.uint64] | list[int | None] | None:
    """Return a seed for each environment, None where none is given; SceneError for an invalid seed."""
    if seed is None:
        return None
    seeds: list[int | None] = []
    if isinstance(seed, (int, np.integer)) and not isinstance(seed, bool):
        if 0 <= seed <= 2**64 - size:
            return np.arange(size, dtype=np.uint64) + np.uint64(seed)
        seeds = [int(seed) + place for place in range(size)]
    elif isinstance(seed, (list, tuple)) or (isinstance(seed, np.ndarray) and seed.ndim):
        seeds = [entry.item() if isinstance(entry, np.generic) else entry for entry in seed]
    if len(seeds) != size:
        raise SceneError(f"seed must be one whole number or one for each of {size} environments, not {shown(seed)}.")
    for place, entry in enumerate(seeds):
        whole = isinstance(entry, int) and not isinstance(entry, bool) and 0 <= entry <= MOST_SEED
        if entry is not None and not whole:
            raise SceneError(
                f"A seed must be a whole number from 0 to 2**128 - 1; that of environment {place} is {shown(entry)}."
            )
    return seeds


def marked(name: str, places: NDArray[np.intp], values: Iterable[Any], size: int) -> dict[str, NDArray[Any]]:
    """Return an entry of infos that some environments have, and its mask: objects, None at the other places."""
    found, mask = np.full(size, None, dtype=object), np.zeros(size, dtype=np.bool_)
    for place, value in zip(places.tolist(), values, strict=True):
        found[place] = value
    mask[places] = True
    return {name: found, f"_{name}": mask}
