"""``LabPendulum-v0``, the Gymnasium environment of one pendulum."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import chain
from typing import Any

import gymnasium
import numpy as np
from numpy import empty
from numpy.typing import NDArray

from integrators import Method
from pendulum_env.common.shown import one_line
from pendulum_env.common.version import REGISTERED
from pendulum_env.common.warn import warn
from pendulum_env.engine.each import checked_limit, frequency
from pendulum_env.engine.goal import looking_ahead
from pendulum_env.engine.kernels import Backend
from pendulum_env.engine.machine import (
    ANGLE,
    INDEX,
    NOWHERE,
    TURNS,
    TWO_PI,
    UNSEEN,
    VELOCITY,
    Machine,
    check_diagnostics,
)
from pendulum_env.engine.pieces import FEW
from pendulum_env.engine.sensing import copied
from pendulum_env.engine.shape import DIVERGED, LOST, SLACK, STOP_REASONS, TOO_SHORT
from pendulum_env.engine.spec import RunSpec, coarse_steps, long_steps
from pendulum_env.envs.attributes import Fixed, Portable, fix
from pendulum_env.envs.randomize import randomization
from pendulum_env.envs.saved import checked_parameters, checked_random, checked_sensing, checked_state
from pendulum_env.envs.sensing import OBSERVED, drawn_delays, plan_of, readings_of
from pendulum_env.envs.settings import (
    METADATA,
    START,
    UNBOUNDED,
    checked_options,
    checked_settings,
    settled,
    spaces_of,
    usual,
)
from pendulum_env.envs.switch import carried, following
from pendulum_env.films.picture import Camera
from pendulum_env.films.reel import Reel, motion
from pendulum_env.physics.damping import Damping
from pendulum_env.physics.flow import regime_of_damping
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.sensor import Sensor
from pendulum_env.physics.units import boolean, line, naming_keywords, number, shown, whole_number
from pendulum_env.render import View
from pendulum_env.tasks import TASKS, Task, TaskError
from pendulum_env.tasks.action import SINGLE, torque_share
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

    ``Box(float32, (3,))``:

    | Num | Observation             | Min           | Max          |
    |-----|-------------------------|---------------|--------------|
    | 0   | cos(theta)              | -1            | 1            |
    | 1   | sin(theta)              | -1            | 1            |
    | 2   | angular velocity, rad/s | float32's min | float32's max |

    With `observation="angle"` there is no velocity; with "encoder" it is computed from readings; with "history" there
    are the cosines and sines of several readings, the oldest first. Entries of a task's reference follow.

    ## Rewards

    phi is the angle from upright in [-pi, pi], omega0 the angular frequency of small swings.

    {the table of tasks, as `lab-pendulum list tasks` prints it}

    A task of your own is a :class:`pendulum_env.Task`: reward, loss and start as plain functions, which are compiled
    with the step. Its reward must stay finite; TaskError is raised where it does not.

    ## Starting State

    `free` starts with the scene's usual run. `balance` starts upright and the others hanging, at random: the angle
    uniform within ±0.1 rad, the velocity within ±0.05 omega0. ``reset(options={"angle": ..., "velocity": ...})`` sets
    the start in rad and rad/s; a number that is left out is drawn by the task, and with `free` is that of the scene's
    usual run. Parameters of the scene may be set for one episode, too: ``reset(options={"length": 0.5})``. With
    `randomize` they are drawn first, then the start, from the environment's random stream.

    ## Episode End

    Terminated, with ``info["stop_reason"]``: "speed_limit" (faster than ``speed_limit``), "diverged" (the numbers are
    no longer finite or, with the diagnostic "energy", the energy residual is absurdly large; the last finite state is
    returned), "slack" (the bob on a wire is no longer held by tension), "fell" (the task `balance` is lost),
    "step_too_short" (no step meets `rtol`). Truncated after 500 steps, or after `duration`.

    ## Info

    With the diagnostic "energy", every reset and step gives floats: ``time`` [s], ``angle`` [rad, unwrapped],
    ``velocity`` [rad/s], ``kinetic_energy``, ``potential_energy``, ``energy``, ``work``, ``heat`` and
    ``energy_residual`` [J], with ``energy - energy(0) = work - heat + energy_residual``. "heat_by_effect" adds
    ``heat_<effect>`` for each dissipative effect. "tension" adds ``tension``, the suspension's pull on the bob [N],
    below 0 where it pushes. "flow" adds the bob's ``reynolds`` number, the ``keulegan_carpenter`` number and the
    ``quality_factor`` of a swing with the present energy (inf without losses; both 0 without gravity), and the
    ``damping_regime``, a string: "underdamped", "critically damped" or "overdamped", by the quality factor. "error"
    adds ``error_estimate`` [rad], an estimate of the error of ``angle`` compared with the exact motion under the same
    actions. It takes a second run at half the step, so that a step takes some five times as long. It is inf once the
    error cannot be estimated any more (see :mod:`pendulum_env.engine.certificate`). The info of ``reset`` has
    ``parameters``, a dict of the parameters that were drawn by `randomize` or set by options, and of random delays [s],
    if there are any. With a sensor, a delay or another kind of observation ``observed_angle`` is the unwrapped angle in
    the observation [rad]; all other entries are the true motion.

    ## Arguments

    ```python
    gym.make("LabPendulum-v0", scene="lab", integrator=None, damping="scene", dt=None, substeps=1, task=None,
             diagnostics=("energy",), speed_limit=None, render_mode=None, render_size=500, backend="auto",
             rtol=None, atol=None, compensated=False, accuracy=None, render_theme="light",
             render_panels=("apparatus", "energy"), velocity_bound=None, speed_penalty=0.0, duration=None,
             reward_rate=False, randomize=None, observation="full", history=None, sensor=None, observation_delay=0.0,
             action_delay=0.0)
    ```

    - `scene`: preset name, dict, Scene, or a scene's JSON file.
    - `integrator`: name of a method (`lab-pendulum list`), or "auto" with `accuracy`; None for "rk4", in the scenes
      `gymnasium` and `dm_control` for "symplectic_euler".
    - `accuracy`: with "auto", the largest error of the angle at any of an episode's 500 control steps [rad], from the
      scene's usual start or a task's. The cheapest method and substeps with this accuracy are measured once per scene,
      in seconds, and stored in the cache folder.
      `env.unwrapped.integrator` is the method's name; its `.why` gives the reasons for the choice and the cases in
      which the accuracy is not guaranteed, and a warning names these cases, too. The accuracy holds for given
      sequences of actions: a policy that holds the bob upright hides errors that grow as exp(omega0 t). See
      :class:`pendulum_env.auto.choice.Choice`.
    - `damping`: "scene", "none", or names from `lab-pendulum list effects`, as in "linear+quadratic", or with numbers
      `{"linear": {"gamma": 0.1}}`; replaces the scene's dissipative effects.
    - `dt`: control step [s]; the integrator's step is `dt / substeps`. None for 0.02 s, in `gymnasium` for 0.05 s.
    - `diagnostics`: "energy", "heat_by_effect", "tension", "flow", "error"; `()` for none.
    - `task`: "swing_up" (the default), another name of the table above, or a :class:`pendulum_env.Task`; a scene
      without a motor needs "free". `pendulum_env.tasks.track(f)` makes the task of following the angle `f(time)`; its
      observation has four more entries: cosine and sine of the reference now, and after the next control step.
    - `duration`: length of an episode [s], a whole number of steps of `dt`; the environment then truncates by itself.
      `gym.make` still ends episodes after the registered 500 steps, unless it gets `max_episode_steps=-1`; a warning
      says if this has ended an episode early. In `gym.make_vec` the 500 steps give way to the duration.
    - `reward_rate`: True makes the reward a rate per second: each step gives the task's reward times `dt`, so that the
      return of an episode is its integral over time, and does not change with `dt`.
    - `speed_limit`: speed that ends the episode [rad/s], by default 100 omega0; the speed is never clipped.
    - `speed_penalty`: number that is subtracted from the reward in the step in which the episode ends early because of
      `speed_limit`, of diverging numbers or of a step that is too short; 0 by default. With a low limit, `swing_up`
      rewards giving up: its rewards are negative, and an episode that ends early collects fewer of them. In `lab` with
      `speed_limit=8`, full torque along the velocity ends after 78 steps with a return of -462, while
      :class:`pendulum_env.controllers.SwingUp` earns -555 in 500 steps without this limit (means of seeds 0 to 9).
      `speed_penalty=1000` makes the -462 a -1462. A bob that swings up passes the bottom at 2 omega0, 10.5 rad/s in
      `lab`, so choose a limit above that.
    - `velocity_bound`: bound of the velocity in the observation space [rad/s], `inf` for none; by default the largest
      float32, for which Gymnasium's wrappers `RescaleObservation` and `DiscretizeObservation` cannot be used: give a
      bound for them. The observed velocity is cut to the bound, the motion is not.
    - `render_mode`: "rgb_array", or "rgb_array_list" in `gym.make`: a list of the frames since the last `render()`; or
      "human": a window in real time. In it a person can pause (`step` waits then), take single steps, slow down, change
      the integrator, drag the bob or type a start; `info["by_hand"]` names such a change before the step, else it is
      "". The key H lists all keys; see :class:`pendulum_env.window.live.Live`.
    - `render_size`: pixels, one number or (width, height); `render_theme`: "light" or "dark".
    - `render_panels`: any of "apparatus", "energy" (bars), "history" (the energies of 10 s), "phase" (portrait with
      separatrix and exact orbit), "residual"; only drawn panels cost time. See :data:`pendulum_env.render.PANELS`.
    - `backend`: "auto", "compiled", "python"; all give the same bits.
    - `rtol`, `atol`: tolerances for a method that estimates its error, such as "dop853". Each step of `dt / substeps`
      is divided so that the error of each part is below `atol + rtol |y|` in angle and velocity; `atol` is `rtol` by
      default.
    - `compensated`: True for compensated summation of angle, velocity, work and heat, which carries the rounding error
      of each addition over to the next; `info` then has the present rounding errors, `lost_angle` and
      `lost_velocity`. Not with `rtol`.
    - `warn`: False for no warnings; `careful`: True raises a SceneError in place of a warning before a run.
    - `randomize`: parameters of the scene that are drawn anew for every episode: a dict from names to ranges,
      `(low, high)` uniform, `("log", low, high)` log-uniform, or a list of values with equal chances; or a fit, for
      draws from its covariance (`found.bootstrap(200)`: from its refits); or a function of a NumPy generator that
      returns a dict; or a list of these. See :mod:`pendulum_env.envs.randomize`.
    - `observation`: "full"; "angle": cosine and sine; "encoder": cosine, sine and a velocity computed from readings, as
      firmware does it; "history": cosines and sines of the last `history` readings (4), the oldest first.
    - `sensor`: a :class:`pendulum_env.Sensor`, or a dict of its values: quantum, noise, scale, offset, dropout, zero,
      rate, and how an encoder computes velocities. "full" shows the true velocity beside its angle.
    - `observation_delay`, `action_delay`: delays [s] in whole integration steps, `dt / substeps`; (low, high) for
      delays that are drawn with equal chances at every reset. Until the first action arrives, the action is 0; until a
      reading arrives, the first one is seen. The reward counts the action that acts.
    - any parameter of the scene by its name: `length`, `mass`, `gravity`, `max_torque`, `gamma`, ...; and its parts
      `medium`, `effects`, ..., as in a scene's JSON file.

    Raises SceneError, MethodError or EngineError for an invalid argument; warns where an effect's formula does not
    hold at the speed of the scene's usual run. Attributes of `env.unwrapped`: `scene`, `integrator`, `dt` [s],
    `substeps`, `task` and `window` (None without one), and of the present episode `episode_scene`, `omega0` [1/s] and
    `speed_limit` [rad/s].

    ## Version History

    * v0: Initial version. A change of physics or defaults that alters trajectories will make v1.
    """

    metadata: dict[str, Any] = METADATA
    scene: Scene
    integrator: str
    dt: float
    substeps: int
    task: Task
    speed_limit: float
    omega0: float
    render_size: tuple[int, int]

    def __init__(
        self,
        scene: str | Scene | Mapping[str, object] = "lab",
        integrator: str | Method | None = None,
        damping: Damping = "scene",
        dt: float | None = None,
        substeps: int = 1,
        task: str | Task | None = None,
        diagnostics: Sequence[str] = ("energy",),
        speed_limit: float | None = None,
        render_mode: str | None = None,
        render_size: int | tuple[int, int] = 500,
        backend: Backend = "auto",
        rtol: float | None = None,
        atol: float | None = None,
        compensated: bool = False,
        accuracy: float | None = None,
        render_theme: str = "light",
        render_panels: Sequence[str] = ("apparatus", "energy"),
        velocity_bound: float | None = None,
        speed_penalty: float = 0.0,
        duration: float | None = None,
        reward_rate: bool = False,
        randomize: Any = None,
        observation: str = "full",
        history: int | None = None,
        sensor: Sensor | Mapping[str, Any] | None = None,
        observation_delay: float | Sequence[float] = 0.0,
        action_delay: float | Sequence[float] = 0.0,
        **parameters: Any,
    ) -> None:
        names = check_diagnostics(diagnostics)
        integrator, dt = usual(scene, integrator, dt)
        setup = checked_settings(dt, substeps, task, render_mode, render_size, render_theme, render_panels, names,
                                 duration, reward_rate)
        self._randomize, self._randomization = randomize, randomization(randomize)
        with naming_keywords(type(self)):
            self._spec = RunSpec.of_episodes(
                scene, damping, parameters, dt=setup.dt, diagnostics=names, speed_limit=speed_limit, backend=backend,
                rtol=rtol, atol=atol, compensated=compensated,
                others=self._randomization.scenes if self._randomization else None,
                choose=lambda scene: settled(setup, scene, integrator, accuracy, setup.steps, compensated, rtol, atol),
            )
        self._observation, self._history, self._sensor = observation, history, sensor
        self._observation_delay, self._action_delay = observation_delay, action_delay
        plan = plan_of(observation, history, sensor, observation_delay, action_delay, self._spec.h, self._spec.hold)
        self._machine, self._sensing = readings_of(self._spec, plan)
        self._delays: dict[str, float] = {}
        self._observed = 0.0
        self._spec.tell()
        self._spec.tell_of_task(task)
        self._scene, self._integrator, self._task = self._spec.scene, self._spec.integrator, setup.task
        self._dt, self._substeps, self._speed_limit = setup.dt, self._spec.hold, self._spec.speed_limit
        self._render_mode, self._render_size = setup.render_mode, setup.render_size
        self.metadata = {**METADATA, "render_fps": 1.0 / setup.dt}  # films run at true speed
        self._omega0, self._asked_limit = frequency(self._scene), speed_limit
        self._parameters: dict[str, float] = {}
        self._penalty = number(speed_penalty, "speed_penalty", least=0.0)
        bound, self.observation_space, self.action_space = spaces_of(velocity_bound, setup.task, plan)
        self._velocity_bound = bound
        self._bounded = bound < UNBOUNDED

        self._h = self._spec.h
        self._checks, self._rate = setup.task.own, setup.rate
        self._before, self._upright = setup.task.goal.before, setup.task.goal.upright
        self._steps = setup.steps
        self._last = math.inf if setup.steps is None else (setup.steps - 1.0) * self._substeps
        self._make_judge()
        self._plain = self._sensing is None and self._ahead is None and not (self._bounded or self._upright)
        self._cut_told = False
        self._state: Any = None
        self._share, self._explained = 0.0, False
        self._slackened = self._machine.kept.get("slackened", 0)  # its index in a state; 0 when no warning is due
        self._turning = self._spec.turning_speed()
        self._in_flow = "flow" in names
        self._reel = Reel(setup.look, self.dt, "energy" in names)
        self._camera = (Camera(self._machine, self._h, self.substeps, setup.render_size, setup.look)
                        if setup.render_mode else None)
        self.window = window_of(self.shown()) if setup.render_mode == "human" else None

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
        super().reset(seed=None if seed is None else whole_number(seed, "seed", least=0))
        self._tell_of_cut()
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
        self._speed_limit = checked_limit(self._asked_limit, scene)
        self._make_judge()
        if self._camera is not None:
            self._camera = Camera(self._machine, self._h, self.substeps, self._camera.size, self._camera.look)
            if self.window is not None:
                self.window.show(self.shown())

    @property
    def episode_scene(self) -> Scene:
        """The scene of the present episode: ``scene`` with the parameters that were drawn, or set by options."""
        return self._machine.scene

    def _tell_of_cut(self) -> None:
        """Warn once if an episode was ended after the registered number of steps, before its duration."""
        steps, taken = self._steps or 0, 0.0 if self._state is None else float(self._state[INDEX])
        if steps > REGISTERED and taken == REGISTERED * self._substeps and self._spec.warn and not self._cut_told:
            self._cut_told = True
            warn(f"An episode of {steps} steps (duration={steps * self._dt:g} s) has ended after {REGISTERED} steps, "
                 "the number that LabPendulum-v0 is registered with; gym.make(..., max_episode_steps=-1) leaves the "
                 "end to the duration.")

    def _start(self, angle: float, velocity: float) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start an episode from an angle [rad] and a velocity [rad/s]."""
        self._state = self._machine.state(angle, velocity, [self.np_random.random() for _ in self._machine.drawn])
        self._share = 0.0
        observation, _, values = self._run(0)
        if self._sensing is not None:
            drawn, steps = drawn_delays(self._sensing.plan, lambda: np.array([self.np_random.random()]))
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
        before = earlier(self._state, self._machine.phi, self._before) if self._before else {}
        if self._plain:
            observation, code, values = self._run(self._substeps)
        else:
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
        if self._bounded and (self._sensing is None or self._sensing.plan.swift):
            seen[2] = min(max(seen[2], -self._velocity_bound), self._velocity_bound)
        if self._upright:
            seen[:turned] = -seen[:turned]
        if self._ahead is not None:
            seen = np.concatenate([seen, np.array(self._ahead(float(self._state[INDEX])), SINGLE)])
        return seen

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
            sensing = None if self._sensing is None else checked_sensing(saved, self._sensing)
            self.np_random.bit_generator.state = checked_random(saved["random"], self.np_random.bit_generator)
        except BaseException:
            self._take_parameters(before)
            raise
        self._state = None if values is None else self._machine.array(values)
        self._share, self._sensing = share, sensing
        self._reel.restore(trail, past, seen)

    def _identity(self) -> dict[str, Any]:
        """Return the scene, method and step of the environment, which a state to be restored must have too."""
        compensated: dict[str, Any] = {"compensated": True} if self._machine.compensated else {}
        if self._sensing is not None:
            compensated["sensing"] = {name: list(value) if isinstance(value, tuple) else value
                                      for name, value in vars(self._sensing.plan).items()}
        return {"scene": self.scene.to_dict(), "integrator": str(self.integrator), "step": self._h,
                "substeps": self.substeps, **self._machine.tolerance, **compensated}

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
LabPendulumEnv.__doc__ = (LabPendulumEnv.__doc__ or "").replace(
    "{the table of tasks, as `lab-pendulum list tasks` prints it}", "\n    ".join([
        "| task | reward per step | ends |", "| --- | --- | --- |",
        *(f"| `{task.name}` | {task.equation} | {task.ends} |" for task in TASKS.values()),
    ]))


def earlier(state: Any, phi: int, names: Sequence[str]) -> dict[str, float]:
    """Return the quantities of a state, at the start of a control step, that a task takes, by name [rad, rad/s]."""
    values = {"phi_before": state[phi], "velocity_before": state[VELOCITY],
              "angle_before": state[ANGLE] + TWO_PI * state[TURNS]}
    return {name: float(values[name]) for name in names}


def one_start(spec: RunSpec, angle: Any, velocity: Any) -> tuple[float, float]:
    """Check the angle [rad] and velocity [rad/s] from which an episode starts; return them, or raise SceneError."""
    start = number(angle, "angle", unit="rad"), number(velocity, "velocity", unit="rad/s")
    spec.tell_of_start(*start)
    return start
