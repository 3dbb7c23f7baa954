"""``LabPendulum-v0``: the lab's pendulum behind Gymnasium's interface. A thin adapter around the engine."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from integrators import Method
from pendulum_env.action import torque_share
from pendulum_env.engine.kernels import Backend
from pendulum_env.engine.loops import DIVERGED, STOP_REASONS
from pendulum_env.engine.machine import ANGLE, INDEX, KINETIC, NOWHERE, POTENTIAL, TURNS, TWO_PI, VELOCITY, Machine
from pendulum_env.engine.rollout import checked_start
from pendulum_env.physics.damping import Damping, build_scene
from pendulum_env.physics.energy import ABSURD
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, nearest, number
from pendulum_env.picture import TRAIL_SECONDS
from pendulum_env.render.panel import frame_size
from pendulum_env.saved import checked_state
from pendulum_env.tasks import FELL, find_task

START = ("angle", "velocity")
MOST_SUBSTEPS = 10**9


class LabPendulumEnv(gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    """
    ## Description

    A bob hangs from a rotary motion sensor. Its equation of motion, ``I theta'' = sum of torques``, is integrated by
    a method of your choice, and ``info`` says where every joule went. The default scene ``lab`` is a 40 g steel ball
    on a thin rod of 0.353 m in air, with a small motor on the shaft: too weak to lift the ball directly, so that
    ``swing_up`` has to pump. Angles are measured from the downward vertical, counter-clockwise positive.

    ## Action Space

    ``Box(-1, 1, (1,), float32)``: the share of the motor's torque, clipped to the box. An action that is not finite,
    or of another shape, is refused with ActionError. In a scene without a motor it does nothing.

    ## Observation Space

    ``Box(float32, (3,))``:

    | Num | Observation             | Min           | Max          |
    |-----|-------------------------|---------------|--------------|
    | 0   | cos(theta)              | -1            | 1            |
    | 1   | sin(theta)              | -1            | 1            |
    | 2   | angular velocity, rad/s | float32's min | float32's max |

    ## Rewards

    phi is the angle from upright in [-pi, pi]; omega0 the small-angle angular frequency.

    | task       | reward per step                                | ends                  |
    |------------|------------------------------------------------|-----------------------|
    | `free`     | 0                                              | -                     |
    | `swing_up` | -(phi² + 0.1 (velocity/omega0)² + 0.001 action²) | -                   |
    | `balance`  | 1 - (phi/0.5)² - 0.001 action²                 | abs(phi) > 0.5: "fell" |

    ## Starting State

    `free` starts with the scene's usual run; `swing_up` hanging and `balance` upright, the angle within ±0.1 rad and
    the velocity within ±0.05 omega0, uniformly. ``reset(options={"angle": ..., "velocity": ...})`` sets the start in
    rad and rad/s; what is left out is then taken from the scene's usual run.

    ## Episode End

    Terminated, with ``info["stop_reason"]``: "speed_limit" (beyond ``speed_limit``), "diverged" (the integrator left
    the finite range or, with the diagnostic "energy", its residual is beyond all sense; the last finite state is
    kept), "slack" (a wire would have to push, so it cannot balance), "fell". Truncated after 500 steps.

    ## Info

    With the diagnostic "energy", every reset and step gives floats: ``time`` [s], ``angle`` [rad, unwrapped],
    ``velocity`` [rad/s], ``kinetic_energy``, ``potential_energy``, ``energy``, ``work``, ``heat`` and
    ``energy_residual`` [J], with ``energy - energy(0) = work - heat + energy_residual``. "heat_by_effect" adds
    ``heat_<effect>`` for each dissipative effect.

    ## Arguments

    ```python
    gym.make("LabPendulum-v0", scene="lab", integrator="rk4", damping="scene", dt=0.02, substeps=1, task="swing_up",
             diagnostics=("energy",), speed_limit=None, render_mode=None, render_size=500, backend="auto")
    ```

    - `scene`: preset name, dict, Scene, or a scene's JSON file.
    - `integrator`: name of a method (`lab-pendulum list`).
    - `damping`: "scene", "none", "linear", "quadratic", "linear+quadratic", "coulomb", or with numbers
      `{"linear": {"gamma": 0.1}}`; replaces the scene's dissipative effects.
    - `dt`: control step [s]; the integrator's step is `dt / substeps`.
    - `diagnostics`: "energy", "heat_by_effect"; `()` for none.
    - `speed_limit`: [rad/s]; 100 omega0 by default. An ending, never a clip.
    - `render_size`: pixels, one number or (width, height).
    - `backend`: "auto", "compiled", "python"; the same bits.
    - any parameter of the scene by its name: `length`, `mass`, `gravity`, `max_torque`, `gamma`, ...

    Raises SceneError, MethodError or EngineError for anything that cannot be.

    ## Version History

    * v0: Initial version. A change of physics or defaults that alters trajectories will make v1.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 50}  # noqa: RUF012

    def __init__(
        self,
        scene: str | Scene | Mapping[str, object] = "lab",
        integrator: str | Method = "rk4",
        damping: Damping = "scene",
        dt: float = 0.02,
        substeps: int = 1,
        task: str = "swing_up",
        diagnostics: Sequence[str] = ("energy",),
        speed_limit: float | None = None,
        render_mode: str | None = None,
        render_size: int | tuple[int, int] = 500,
        backend: Backend = "auto",
        **parameters: Any,
    ) -> None:
        self.scene = build_scene(scene, damping, parameters)
        self.dt = number(dt, "dt", above=0.0, unit="s")
        whole = isinstance(substeps, (int, np.integer)) and not isinstance(substeps, bool)
        if not (whole and 1 <= substeps <= MOST_SUBSTEPS):
            raise SceneError(f"substeps must be a whole number from 1 to {MOST_SUBSTEPS}, not {substeps!r}.")
        self.substeps = int(substeps)
        self.task = find_task(task)
        modes = self.metadata["render_modes"]
        if render_mode is not None and render_mode not in modes:
            raise SceneError(f"There is no render_mode {render_mode!r}{nearest(render_mode, modes)}")
        self.render_mode = render_mode
        self.render_size = frame_size(render_size, "render_size")
        self.metadata = {**self.metadata, "render_fps": 1.0 / self.dt}
        self._machine = Machine(self.scene, integrator, diagnostics, backend)
        self.integrator = self._machine.method.name
        self.omega0 = self.scene.omega0 or 1.0
        limit = 100.0 * self.omega0 if speed_limit is None else speed_limit
        self.speed_limit = math.inf if limit == math.inf else number(limit, "speed_limit", above=0.0, unit="rad/s")

        high = np.array([1.0, 1.0, np.finfo(np.float32).max], dtype=np.float32)
        self.observation_space = spaces.Box(-high, high, dtype=np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (1,), dtype=np.float32)

        self._h = self.dt / self.substeps
        self._state: Any = None
        self._initial = self._share = 0.0
        self._trail: deque[float] = deque(maxlen=max(2, math.ceil(TRAIL_SECONDS / self.dt)))
        self._inertia, names = self.scene.inertia, self._machine.sums
        self._work = names.get("work")
        self._heats = tuple((name, i) for name, i in names.items() if name.startswith("heat"))
        self._ledger = "energy" in self._machine.diagnostics
        self._by_effect = "heat_by_effect" in self._machine.diagnostics
        self._periodic = self.scene.periodic
        self._absurd = ABSURD * self._machine.scale
        self._made_for = {"scene": self.scene.to_dict(), "integrator": self.integrator, "step": self._h}

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start an episode; ``options`` may set "angle" [rad] and "velocity" [rad/s].

        Raises SceneError for other options, or values that are not finite.
        """
        super().reset(seed=seed)
        run = self.scene.run
        if options:
            if not isinstance(options, Mapping):
                raise SceneError(f"reset's options must be a dict with {' and '.join(START)}, not {options!r}.")
            for name in options:
                if name not in START:
                    raise SceneError(f"reset has no option {name!r}{nearest(name, START)}")
            angle = number(options.get("angle", run.angle), "angle", unit="rad")
            velocity = number(options.get("velocity", run.velocity), "velocity", unit="rad/s")
        else:
            angle, velocity = self.task.start(self.np_random, run.angle, run.velocity, self.omega0)
        checked_start(self.scene, angle, velocity)
        machine = self._machine
        self._state = machine.state(angle, velocity)
        machine.advance(self._state, 0.0, self._h, 0)
        values = list(self._state)
        self._initial = self._inertia * float(values[KINETIC] + values[POTENTIAL])
        self._share = 0.0
        self._trail.clear()
        return self._observed([float(value) for value in values], False)[0::3]

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Hold the action for one control step of ``dt``.

        Raises ActionError for an action that is not one finite number, ResetNeeded before the first reset.
        """
        state = self._state
        if state is None:
            raise gymnasium.error.ResetNeeded("Call reset() before the first step().")
        share = self._share = torque_share(action)
        machine = self._machine
        code = machine.run(state, machine.parameters, share, self._h, 1, self.substeps, self.speed_limit, NOWHERE)
        values = state.tolist() if machine.compiled else state
        if self.render_mode is not None:
            self._trail.append(values[ANGLE] + TWO_PI * values[TURNS])
        observation, reason, phi, info = self._observed(values, code)
        reward = self.task.reward(phi, values[VELOCITY] / self.omega0, share)
        if not reason and self.task.lost(phi):
            reason = FELL
        if reason:
            info["stop_reason"] = reason
        return observation, reward, reason != "", False, info

    def _observed(self, values: list[float], code: int) -> tuple[NDArray[np.float32], str, float, dict[str, Any]]:
        """Observation, reason to stop, angle from upright, and info, from the state's numbers."""
        q, v = values[ANGLE], values[VELOCITY]
        phi = q if values[TURNS] % 1.0 else q - math.pi if q > 0.0 else q + math.pi
        if not self._periodic:
            phi = math.remainder(phi, TWO_PI)
        observation = np.array((values[-2], values[-1], v), dtype=np.float32)
        reason = STOP_REASONS[code] if code else ""
        info: dict[str, Any] = {}
        if self._ledger:
            inertia = self._inertia
            kinetic, potential = inertia * values[KINETIC], inertia * values[POTENTIAL]
            energy = kinetic + potential
            work = 0.0 if self._work is None else inertia * values[self._work]
            heat = 0.0
            for _, i in self._heats:
                heat += inertia * values[i]
            residual = (energy - self._initial) - work + heat
            if abs(residual) > self._absurd + ABSURD * (abs(self._initial) + abs(work)):
                reason = STOP_REASONS[DIVERGED]
            info = {
                "time": values[INDEX] * self._h,
                "angle": q + TWO_PI * values[TURNS],
                "velocity": v,
                "kinetic_energy": kinetic,
                "potential_energy": potential,
                "energy": energy,
                "work": work,
                "heat": heat,
                "energy_residual": residual,
            }
        if self._by_effect:
            info.update({name: self._inertia * values[i] for name, i in self._heats})
        return observation, reason, phi, info

    def render(self) -> NDArray[np.uint8] | None:
        """The frame of this moment, uint8 of shape (height, width, 3); nothing is changed by drawing it.

        Returns None without a render mode. Raises ResetNeeded before the first reset.
        """
        if self.render_mode is None:
            gymnasium.logger.warn("render() draws nothing without render_mode='rgb_array' in gym.make.")
            return None
        if self._state is None:
            raise gymnasium.error.ResetNeeded("Call reset() before the first render().")
        from pendulum_env.picture import apparatus, view
        from pendulum_env.render import frame

        shown = view(self._machine, [float(value) for value in self._state], self._h, self._initial, self._share,
                     tuple(self._trail))
        return frame(apparatus(self.scene), shown, size=self.render_size)

    # --- the whole state ----------------------------------------------------------------------------------------

    def get_state(self) -> dict[str, Any]:
        """Everything that the future depends on, as a dict of its own; ``set_state`` resumes from it bit for bit."""
        return {
            "made_for": self._made_for,
            "state": None if self._state is None else [float(value) for value in self._state],
            "initial_energy": self._initial,
            "action": self._share,
            "trail": list(self._trail),
            "random": self.np_random.bit_generator.state,
        }

    def set_state(self, saved: Mapping[str, Any]) -> None:
        """Go back to what ``get_state`` returned, in an environment of the same scene, method and step.

        Raises SceneError, and changes nothing, if it is not such a state.
        """
        values, initial, share, trail = checked_state(saved, self._made_for, self._machine.width + 2)
        try:
            self.np_random.bit_generator.state = saved["random"]
        except (TypeError, ValueError, KeyError) as error:
            raise SceneError(f"The random state to restore is none of this environment's generator: {error}.") from None
        self._state = None if values is None else self._machine.array(values)
        self._initial, self._share = initial, share
        self._trail = deque(trail, maxlen=self._trail.maxlen)
