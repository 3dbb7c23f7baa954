"""``LabPendulum-v0``, the Gymnasium environment of one pendulum."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from itertools import chain
from typing import Any

import gymnasium
import numpy as np
from numpy import empty
from numpy.typing import NDArray

from pendulum_env.common.results import one_line
from pendulum_env.engine.goal import looking_ahead
from pendulum_env.engine.machine import ANGLE, INDEX, NOWHERE, TURNS, UNSEEN, VELOCITY, Machine
from pendulum_env.engine.pieces import FEW
from pendulum_env.engine.sensing import MotionFields, copied
from pendulum_env.engine.settings import described, documented, taking
from pendulum_env.engine.shape import DIVERGED, HOLD, LOST, SLACK, STOP_REASONS, TOO_SHORT
from pendulum_env.engine.spec import RunSpec, coarse_steps, long_steps
from pendulum_env.engine.starts import checked_limit, frequency
from pendulum_env.envs.attributes import Fixed, Portable, fix
from pendulum_env.envs.limits import check_duration, episode_steps, time_limit
from pendulum_env.envs.saved import checked_parameters, checked_random, checked_state, identity
from pendulum_env.envs.sensing import OBSERVED, drawn_delays, readings
from pendulum_env.envs.settings import METADATA, START, EnvSettings, checked_options, spaces_of
from pendulum_env.envs.switch import carried, following
from pendulum_env.films.picture import Camera
from pendulum_env.films.reel import Reel, motion
from pendulum_env.physics.flow import regime_of_damping
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import boolean, line, number, shown, whole_number
from pendulum_env.render import View
from pendulum_env.tasks import TASKS, TaskError
from pendulum_env.tasks.action import SINGLE, torque_share
from pendulum_env.tasks.task import earlier
from pendulum_env.window import Shown, window_of


class LabPendulumEnv(Portable, gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    """
    ## Description

    A bob hangs from a rotary motion sensor. Its equation of motion, ``I theta'' = sum of torques``, is integrated by
    a method of your choice, and ``info`` gives its energy, work and heat. The default scene ``lab`` is a 40 g steel
    ball on a thin rod of 0.353 m in air, with a small motor on the shaft: too weak to lift the ball directly, so
    that ``swing_up`` has to build up a swing first. Angles are measured from the downward vertical, counter-clockwise
    positive.

    ## Action Space

    ``Box(-1, 1, (1,), float32)``: fraction of the motor's torque, clipped to the box. An action that is not finite,
    or of another shape, raises ActionError. In a scene without a motor the action has no effect.

    ## Observation Space

    ``Box(float32, (3,))``: cos(theta), sin(theta), angular velocity [rad/s]. With `observation="angle"` there is no
    velocity; with "encoder" it is computed from readings; with "history" there are the cosines and sines of several
    readings, the oldest first. In the task `track`, the reference's entries come after these.

    ## Rewards

    phi is the angle from upright in [-pi, pi], omega0 the angular frequency of small swings. Usual task: `swing_up`.

    {tasks}

    ## Starting State

    `free` starts with the scene's usual run. `balance` starts upright, and `swing_up`, `swing_up_sparse` and `track`
    hanging, at random: the angle uniform within ±0.1 rad, the velocity within ±0.05 omega0. `swing_up_anywhere`,
    `gymnasium` and `dm_control` start at any angle, `swing_up_mixed` in three of four episodes, and hanging in the
    others.
    ``reset(options={"angle": ..., "velocity": ...})`` sets the start in rad and rad/s, and
    ``options={"length": 0.5}`` a parameter of the scene for one episode.

    ## Episode End

    Terminated, with ``info["stop_reason"]``: "speed_limit", "diverged", "slack" (the wire), "fell" (`balance`) or
    "step_too_short" (`rtol`). Truncated after `max_episode_steps` control steps, by default after those of the id: 500
    in LabPendulum-v0.

    ## Info

    ``time`` [s], ``angle`` [rad, unwrapped], ``velocity`` [rad/s], and with "energy" ``kinetic_energy``,
    ``potential_energy``, ``energy``, ``work``, ``heat``, ``energy_residual`` [J], where
    ``energy - energy(0) = work - heat + energy_residual``. "heat_by_effect", "tension", "flow" and "error" add what
    the section Info of ``pendulum_env/envs/README.md`` explains, as it does settings that need more than a line.

    ## Arguments

    {arguments}
    - any parameter of the scene by its name: `length`, `mass`, `gravity`, `max_torque`, `gamma`, ...; and its parts
      `medium`, `effects`, ..., as in a scene's JSON file.

    Raises SceneError, MethodError or EngineError for an invalid argument; warns where an effect's formula does not
    hold. Attributes of `env.unwrapped`: the arguments, and of the present episode `episode_scene`, `omega0` [1/s] and
    `speed_limit` [rad/s].

    ## Version History

    * v0: Initial version. A change of physics or defaults that alters trajectories will make v1.
    """

    metadata: dict[str, Any] = METADATA
    speed_limit: float
    omega0: float

    @taking(EnvSettings)
    def __init__(self, given: EnvSettings) -> None:
        plan = self._set_up(given)
        self._machine = self._spec.machine()
        remembers = HOLD[0] in self._machine.numbers
        place = MotionFields(1, ANGLE, TURNS, VELOCITY, self._scene.periodic)
        self._sensing = readings(self._spec, plan, place, remembers, 1)
        if plan is not None and plan.changes and remembers:  # effects' state follows actions within control steps
            self._machine = replace(self._spec, hold=1).machine()
        self._observed = 0.0
        self._tell()
        self._speed_limit, self._omega0 = self._spec.speed_limit, frequency(self._scene)
        self.metadata = {**METADATA, "render_fps": 1.0 / self._dt}  # films run at true speed
        self._parameters: dict[str, float] = {}
        self.observation_space, self.action_space = spaces_of(self._velocity_bound, self._task, plan)
        self._before, self._upright = self._task.goal.before, self._task.goal.upright
        self._settled, self._last = self._own_steps is None, self._last_of(self._own_steps)
        self._make_judge()
        self._plain = self._sensing is None and self._ahead is None and not (
            self._bounded or self._upright or self._acts)
        self._state: Any = None
        self._share, self._explained = 0.0, False
        self._slackened = self._machine.kept.get("slackened", 0)  # its index in a state; 0 when no warning is due
        self._in_flow = "flow" in given.diagnostics
        self._reel = Reel(self._look, self._dt, "energy" in given.diagnostics)
        self._camera = (Camera(self._machine, self._h, self._substeps, given.render_size, self._look)
                        if given.render_mode else None)
        self.window = window_of(self.shown()) if given.render_mode == "human" else None

    def _make_judge(self) -> None:
        """Make the functions that judge a step and look ahead along a reference."""
        task, span = self._task, self._h * self._substeps
        self._judge = task.judge(self._omega0, self._h)
        self._ahead = looking_ahead(task.goal, self._h, span) if task.goal.reference else None

    def __repr__(self) -> str:
        return one_line(self, f"{self.scene.name}, {self.integrator}, task {self.task.name}, dt = {self.dt:g} s")

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start an episode; ``options`` may set "angle" [rad], "velocity" [rad/s] and, for this episode, parameters of
        the scene by name.

        Raises SceneError for other options, or values that are invalid, and then changes nothing.
        """
        asked, task, given = checked_options(options, self._scene, self._task)
        if given:
            given = {name: number(value, name) for name, value in given.items()}
            self._machine.check(self._scene.replace(**given))
        angle, velocity = one_start(self._spec, asked.get("angle", 0.0), asked.get("velocity", 0.0))
        self._settle_length()
        super().reset(seed=None if seed is None else whole_number(seed, "seed", least=0))
        if self._randomization:
            given = {**self._randomization.one(self.np_random), **given}
        self._take_parameters(given)
        if len(asked) < len(START):
            drawn = task.starts(self.np_random.random(), self.np_random.random(), self._omega0)
            angle = angle if "angle" in asked else float(drawn[0])
            velocity = velocity if "velocity" in asked else float(drawn[1])
        observation, info = self._start(angle, velocity)
        if self._parameters or self._delays:
            info["parameters"] = {**self._parameters, **self._delays}
        if self.window is not None:
            self.window.began(angle, velocity)
        return observation, info

    def _take_parameters(self, values: dict[str, float]) -> None:
        """Take values of the scene's parameters for the next episode; those that are left out are the scene's own."""
        if not values and not self._parameters:
            return
        scene = self._scene.replace(**values)
        self._machine.take(scene)
        self._parameters, self._omega0 = values, frequency(scene)
        self._speed_limit = checked_limit(self._settings.speed_limit, scene)
        self._make_judge()
        if self._camera is not None:
            self._camera = Camera(self._machine, self._h, self.substeps, self._camera.size, self._camera.look)
            if self.window is not None:
                self.window.show(self.shown())

    @property
    def episode_scene(self) -> Scene:
        """The scene of the present episode: ``scene`` with the parameters that were drawn, or set by options."""
        return self._machine.scene

    def _settle_length(self) -> None:
        """Decide between the duration and the time limit of ``gym.make``, once an episode starts with such a limit.

        Raises SceneError for a duration that is longer than the registered limit; warns once if it is shorter.
        """
        limit = None if self._settled or self.spec is None else time_limit(self)
        if limit is not None:
            check_duration(self._spec.tell, self.spec, self._own_steps, limit, self._dt, self._task.name)
            self._last, self._settled = self._last_of(episode_steps(self._own_steps, limit)), True

    def _last_of(self, steps: int | None) -> float:
        """Return the index of the last integration step before the control step that ends an episode of ``steps``."""
        return math.inf if steps is None else (steps - 1.0) * self._substeps

    def _start(self, angle: float, velocity: float) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start an episode from an angle [rad] and a velocity [rad/s]."""
        self._state = self._machine.state(angle, velocity, [self.np_random.random() for _ in self._machine.drawn])
        self._share = 0.0
        observation, _, values = self._run(0)
        if self._sensing is not None:
            drawn, steps = drawn_delays(self._sensing.plan, self._uniform)
            self._delays = {name: float(late[0]) * self._h for name, late in steps.items()}
            self._sensing.begin(self._row(), np.zeros(1, dtype=np.intp), *drawn)
        observation, info = self._seen(observation), self._info(values)
        self._reel.begin(motion(values, self._h), info)
        if self.window is not None:
            info["by_hand"] = ""
        return observation, info

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Advance the pendulum by one control step of ``dt`` with a constant action.

        Raises ActionError for an action that is not one finite number, ResetNeeded before the first reset. An
        interruption (Ctrl-C) leaves the state unchanged.
        """
        if self._state is None:
            raise gymnasium.error.ResetNeeded("Call reset() before the first step().")
        share = torque_share(action)
        if self.window is not None:
            self.window.attend()
        self._share = share
        before: dict[str, float] = {}
        if self._before:
            numbers = self._state[self._machine.phi], *self._state[ANGLE : VELOCITY + 1]
            before = earlier(self._before, *map(float, numbers))
        if self._plain:
            observation, code, values = self._run(self._substeps)
        else:
            if self._acts:
                self._share = share = float(self._acted(np.array([share]), self._uniform)[0])
            parts = self._sensing is not None
            observation, code, values = self._run_in_parts(share) if parts else self._run(self._substeps)
            observation, share = self._seen(observation), self._share
        index, angle, turns, velocity = values[:4]
        phi = values[self._machine.phi]
        if self._slackened and (steps := values[self._slackened]):
            self._slackened = 0
            self._spec.tell_of_slack(steps)
        if abs(velocity) > self._turning:
            self._turning = math.inf
            self._spec.tell_of_turns(abs(velocity))
        if self._checks:
            reward, lost = self._judged(index, angle, turns, velocity, phi, share, before)
        else:
            reward, lost = self._judge(index, angle, turns, velocity, phi, share, before)
        if self._rate != 1.0:
            reward *= self._rate
        late = index + (code == DIVERGED) > self._last
        if not code and lost:
            code = LOST
        info = self._info(values)
        if self._camera is not None:
            self._reel.keep(motion(values, self._h), info)
            if self.window is not None:
                self.window.present(info)
        if code:
            info["stop_reason"] = STOP_REASONS[code]
            self._explain(code, values)
            if code != LOST:
                reward -= self._penalty
        return observation, reward, code != 0, late, info

    def _uniform(self) -> NDArray[np.float64]:
        """Return the next random number in [0, 1) of the environment, as an array."""
        return np.array([self.np_random.random()])

    def _judged(self, *state: Any) -> tuple[float, bool]:
        """Return reward and loss of a step by a user's functions; TaskError if they fail or the reward is not finite.
        """
        try:
            reward, lost = self._judge(*state)
        except (ArithmeticError, ValueError) as error:
            raise TaskError(f"The task {shown(self._task.name)} raises {type(error).__name__} ({error}) at phi = "
                            f"{state[4]:.6g} rad, velocity = {state[3]:.6g} rad/s.") from None
        if not math.isfinite(reward):
            raise TaskError(f"The reward of the task {shown(self._task.name)} is {reward} at phi = {state[4]:.6g} rad, "
                            f"velocity = {state[3]:.6g} rad/s.")
        return reward, lost

    def _info(self, values: list[float]) -> dict[str, Any]:
        """Return Gymnasium's info dict for the numbers of a simulation's state."""
        info: dict[str, Any] = self._machine.info(values)
        info["stop_reason"] = ""
        if self._sensing is not None:
            info[OBSERVED] = self._observed
        if self._in_flow:
            info["damping_regime"] = regime_of_damping(info["quality_factor"])
        return info

    def _explain(self, code: int, values: list[float]) -> None:
        """Warn once if an episode ended because an implicit equation was not solved or a tolerance not met."""
        if not self._explained and code in (DIVERGED, TOO_SHORT):
            self._explained = True
            state = [values[INDEX], values[ANGLE], values[TURNS], values[VELOCITY]]
            spec = replace(self._spec, scene=self._machine.scene)
            spec.tell_of_stop(STOP_REASONS[code], state, self._share)

    def _run(self, steps: int) -> tuple[NDArray[np.float32], int, list[float]]:
        """Take integration steps; return the observation, the code of the stop reason, and the numbers in the state."""
        machine, state, seen = self._machine, self._state, empty(3, SINGLE)
        run = machine.direct if steps <= FEW else machine.run
        code = run(state, machine.parameters, self._share, self._h, 1, steps, self._speed_limit, NOWHERE, seen)
        return seen, code, state.tolist() if machine.compiled else state

    def _run_in_parts(self, share: float) -> tuple[NDArray[np.float32], int, list[float]]:
        """Take a control step in which actions arrive late and readings are taken; see :meth:`_run`.

        Afterwards ``_share`` is the last share of the motor's torque that acted.
        """
        sensing, state, code = self._sensing, self._state, 0
        assert sensing is not None
        before, kept = self._state.copy(), copied(sensing)
        try:
            sensing.act(np.array([share]))
            for begin, end, _, reads in sensing.parts:
                self._share = float(sensing.acting(begin)[0])
                if end == self._substeps:
                    seen, last, values = self._run(0 if code else end - begin)
                    code = last if last and code <= SLACK else code
                elif not code:
                    code = self._machine.run(state, self._machine.parameters, self._share, self._h, 1, end - begin,
                                             self._speed_limit, NOWHERE, UNSEEN[:0])
                if reads:
                    sensing.sample(self._row(), sensing.turn(end), end)
        except BaseException:
            state[:], self._sensing = before, kept
            raise
        return seen, code, values

    def _row(self) -> NDArray[np.float64]:
        """Return the state as an array with one row, as readings need it."""
        return np.asarray(self._state, dtype=np.float64).reshape(1, -1)

    def _seen(self, seen: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the observation: of the true motion, ``seen``, or of the sensor, with the entries of a reference."""
        turned = 2
        if self._sensing is not None:
            plan = self._sensing.plan
            given, angle = empty((1, plan.width), SINGLE), empty(1)
            self._sensing.give(given, angle)
            seen, self._observed, turned = given[0], float(angle[0]), plan.width - plan.swift
        if self._bounded:
            seen[2] = min(max(seen[2], -self._velocity_bound), self._velocity_bound)
        if self._upright:
            seen[:turned] = -seen[:turned]
        if self._ahead is not None:
            seen = np.concatenate([seen, np.array(self._ahead(float(self._state[INDEX])), SINGLE)])
        return seen

    def look(self) -> NDArray[np.float32]:
        """Return the observation of the present state, also after a person has changed it in a window.

        Raises ResetNeeded before the first reset.
        """
        if self._state is None:
            raise gymnasium.error.ResetNeeded("Call reset() before the first look().")
        return self._seen(self._run(0)[0])

    def render(self) -> NDArray[np.uint8] | None:
        """Return a frame of the present state, uint8 of shape (height, width, 3).

        Returns None without a render mode, and with "human", which shows the frame in the window. Raises ResetNeeded
        before the first reset.
        """
        if self._camera is None:
            gymnasium.logger.warn("render() draws nothing without render_mode='rgb_array' in gym.make.")
            return None
        if self._state is None:
            raise gymnasium.error.ResetNeeded("Call reset() before the first render().")
        if self.window is not None:
            self.window.look()
            return None
        return self._camera.frame(self._state, self._share, self._reel.trail or (), self._reel.past_of())

    def get_state(self) -> dict[str, Any]:
        """Return the complete state of the environment as a dict, from which ``set_state`` resumes bit for bit."""
        return {
            "made_for": self._identity(),
            "state": None if self._state is None else [float(value) for value in self._state],
            "action": self._share,
            **self._reel.saved(),
            "random": self.np_random.bit_generator.state,
            **({"parameters": dict(self._parameters)} if self._parameters else {}),
            **({} if self._sensing is None else {"sensing": self._sensing.saved()}),
        }

    def set_state(self, saved: Mapping[str, Any]) -> None:
        """Restore a state that ``get_state`` returned in an environment with equal scene, method and step.

        Raises SceneError, and changes nothing, for any other state.
        """
        before, parameters = self._parameters, checked_parameters(saved, self._scene)
        try:
            self._take_parameters(parameters)
            values, share, trail = checked_state(saved, self._identity(), self._machine)
            past, seen = self._reel.checked(saved)
            sensing = None if self._sensing is None else self._sensing.checked(saved.get("sensing"))
            self.np_random.bit_generator.state = checked_random(saved["random"], self.np_random.bit_generator)
        except BaseException:
            self._take_parameters(before)
            raise
        self._state = None if values is None else self._machine.array(values)
        self._share, self._sensing = share, sensing
        self._reel.restore(trail, past, seen)

    def _identity(self) -> dict[str, Any]:
        """Return the scene, method and step of the environment, which a state to be restored must have too."""
        sensing = {} if self._sensing is None else {"sensing": {
            name: list(value) if isinstance(value, tuple) else value
            for name, value in vars(self._sensing.plan).items()}}
        return {**identity(self._spec, self.scene, self._machine.tolerance), **sensing}

    def __getstate__(self) -> dict[str, Any]:
        """Return the attributes for a copy or a pickle, without the functions that are made from the task."""
        return {**super().__getstate__(), "_judge": None, "_ahead": None}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        """Set the attributes of a copied or unpickled environment, and let its window show this copy."""
        super().__setstate__(state)
        self._make_judge()
        if self.window is not None:
            self.window.show(self.shown())

    def set_wrapper_attr(self, name: str, value: Any, *, force: bool = True) -> bool:
        """Assign an attribute for a wrapper, ``SyncVectorEnv.set_attr`` or ``AsyncVectorEnv.set_attr``.

        Returns True if it was assigned; with ``force`` False only attributes that exist are. Refuses a setting such as
        the length, which would otherwise become an attribute of the wrapper, without effect.
        """
        setting = isinstance(getattr(type(self), line(name, "name"), None), Fixed)
        return super().set_wrapper_attr(name, value, force=boolean(force, "force") or setting)

    def close(self) -> None:
        """Close the environment's window, if there is one."""
        if self.window is not None:
            self.window.close()

    # --- functions for the window --------------------------------------------------------------------------

    def shown(self) -> Shown:
        """Return the interface through which a window shows and changes this environment.

        The environment needs a render mode.
        """
        assert self._camera is not None, "make the environment with render_mode='rgb_array' or 'human'"
        return Shown(self._camera.apparatus, self.dt, self._camera.size, self._camera.look, self._view,
                     self._start_by_hand, self._another, self._take, self._facts)

    def _view(self) -> View:
        """Return the numbers from which a frame of the present state is drawn."""
        assert self._camera is not None
        return self._camera.view(self._state, self._share, self._reel.trail or (), self._reel.past_of())

    def _start_by_hand(self, angle: float, velocity: float) -> None:
        """Start an episode at an angle [rad] and velocity [rad/s] set in the window; SceneError for invalid ones."""
        self._start(*one_start(self._spec, angle, velocity))

    def _another(self, to: str | int) -> Machine | None:
        """Return the simulation (machine) with another integrator, by its name or by places in the list of those that
        fit the scene; None if it already runs. Raises MethodError for a name that does not fit.
        """
        return following(self._machine, to, self._spec.backend, self._h)

    def _facts(self) -> dict[str, Any]:
        """Return the scene, the method and the step, for the provenance of a saved picture."""
        return {"scene": self.scene.to_dict(), "method": self._machine.label, "dt": self._h}

    def _take(self, machine: Machine) -> None:
        """Continue the simulation from the present state with the integrator of another machine (simulator)."""
        assert self._camera is not None
        other = self._spec.with_method(machine.method)
        other.tell(chain(coarse_steps(other), long_steps(other)))
        self._spec = other
        values = [float(value) for value in self._state]
        self._state = carried(self._machine, values, machine, self._share, self._h)
        self._machine, self._integrator = machine, machine.method.name
        self._slackened = self._slackened and machine.kept.get("slackened", 0)
        self._turning = other.turning_speed()
        self._camera = Camera(machine, self._h, self.substeps, self._camera.size, self._camera.look)


fix(LabPendulumEnv, ("omega0",))
documented(
    LabPendulumEnv, arguments=described(EnvSettings), tasks="\n".join([
        "| task | reward per step | ends |", "| --- | --- | --- |",
        *(f"| `{task.name}` | {task.equation} | {task.ends} |" for task in TASKS.values())]))


def one_start(spec: RunSpec, angle: Any, velocity: Any) -> tuple[float, float]:
    """Check the angle [rad] and velocity [rad/s] from which an episode starts; return them, or raise SceneError."""
    start = number(angle, "angle", unit="rad"), number(velocity, "velocity", unit="rad/s")
    spec.tell_of_start(*start)
    return start
