"""``LabPendulumBench-v0``, the environment of a bench: a motor and an angle sensor in place of a simulation."""

from __future__ import annotations

import math
import sys
import tempfile
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from pendulum_env.bench.device import DeviceError, Reading, device_at
from pendulum_env.bench.journal import Journal, numbered
from pendulum_env.bench.protocol import FULL
from pendulum_env.common.checks import SceneError, file_path, shown, warn, whole_number
from pendulum_env.engine.machine import ANGLE, INDEX, TURNS, VELOCITY, motion_of
from pendulum_env.engine.settings import described, documented, taking
from pendulum_env.engine.shape import SPEED_LIMIT
from pendulum_env.engine.wrap import split_turns
from pendulum_env.envs.attributes import fix
from pendulum_env.envs.env import LabPendulumEnv
from pendulum_env.envs.limits import time_limit
from pendulum_env.envs.settings import METADATA, START, EnvSettings, checked_options
from pendulum_env.physics.sensor import Sensor
from pendulum_env.physics.units import choice, flag, setting, si
from pendulum_env.tasks import Task
from pendulum_env.tasks.action import torque_share

LONGEST_STEP = 0.05
"""Longest control step [s]: the watchdog, of some steps, has to stop the motor within 0.1 s."""
SHORTEST_STEP = 0.001
WATCHDOG, MOST_WATCHDOG = 3.0, 0.09
"""Time without an action after which the device stops its motor: in control steps, and at most [s]."""
SPEED = 4.0
"""Usual limit of the speed, in omega0; a bob that falls from the top has 2."""
WILD = 4.0
"""Speed between two readings, in limits of the speed, beyond which they are nonsense."""
JUMP = 2.0
"""Difference between the clocks of the device and of this computer that is nonsense [s]."""
NEAR, SLOW = 0.1, 0.05
"""Largest distance from hanging or upright [rad], and speed there [omega0], of a start that a bench can make."""
SAME = 0.05
"""Distance from the zero of the run before within which that zero stays [rad]."""
STILL = 0.01
"""Range of the angle over a period of small swings within which the bob hangs at rest [rad]."""
BRAKE = 0.3
"""Speed [omega0] from which the motor brakes with its full torque; below, with a share of it."""
SMOOTH = 0.05
"""Time [periods of small swings] over which the speed is measured that is braked."""
PATIENCE = 60.0
"""Time for which the bob is waited for to come to rest, or to be brought up [s]."""
OWN_METADATA: dict[str, Any] = {**METADATA, "render_modes": ["rgb_array"]}
GRID = 5
"""Random numbers on each axis with which a task's starts are looked at."""


@dataclass(frozen=True, kw_only=True, repr=False, eq=False)
class BenchSettings(EnvSettings):
    """Settings of ``gym.make("LabPendulumBench-v0", ...)``."""

    device: Any = setting("virtual", "the bench: virtual, virtual:SCENE, serial:PORT, or a Device")
    confirm: Any = setting(
        None, "leave for the first motion of a real device",
        note="None asks at the terminal, True is your leave; or a function that gets the question and returns True")
    log: Any = setting(None, "file of the runs' logs, numbered: swing.csv gives swing-run1.csv",
                       note="None: files in a new folder for temporary ones")
    twin: bool = flag(False, "True simulates the scene beside the bench, from the same actions")
    torque_limit: float | None = si(None, "N m", "largest torque that is asked of the motor", above=0.0, optional=True,
                                    note="None for the motor's own")
    turn_limit: float = si(10.0, "1", "turns from hanging that end an episode, before a cable is wound up", above=0.0)
    speed_limit: Any = setting(None, "speed that ends an episode", unit="rad/s", note="None for 4 omega0")
    render_mode: str | None = choice(None, ("rgb_array",), "what render gives: frames of the measured state")


class LabPendulumBenchEnv(LabPendulumEnv):
    """
    ## Description

    The environment of LabPendulum-v0 on a bench: a motor and an angle sensor behind a board, in real time. Spaces,
    tasks, rewards and the keys of `info` are those of LabPendulum-v0, whose class this one derives from. The scene is
    what is known of the bench: it gives the motor's torque, omega0 in rewards, the energies, and the twin.

    ## Action Space

    As in LabPendulum-v0. An action is sent at once, and acts until the next one.

    ## Observation Space

    As in LabPendulum-v0, from the device's angle; the velocity is computed from readings, as a `sensor` with a `window`
    or a `corner` says, at the times of the device's clock.

    ## Starting State

    `reset` brakes with the motor, waits until the bob hangs at rest, and takes the angle there as 0, or keeps the zero
    of the run before if it is within 0.05 rad. For tasks that start upright the controller of
    `pendulum_env.controllers` then brings it there. Other starts raise DeviceError.

    ## Episode End

    Terminated, with `info["stop_reason"]`: "speed_limit", "turns" (`turn_limit`), or a task's "fell". Truncated, as the
    pendulum did not fail: "device" (it does not answer, or answers nonsense), "watchdog" (no step within three of `dt`,
    or 90 ms), and by the number of steps. The motor is then off; the next `reset` opens the device again.

    ## Info

    `time` (of the device's clock), `angle`, `velocity`, `kinetic_energy`, `potential_energy`, `energy` (of the measured
    state), and `time_late`, from the moment of a step's observation to the action that followed it [s], and `missed`,
    the number of control steps that were left out so far as actions came too late. With `twin=True` also `twin_angle`,
    `angle_residual`, the bench's angle less the twin's, and the twin's `work` and `heat`, with the `energy_residual`
    that the measured energy leaves. `reset` adds `log`, the file of the run.

    ## Arguments

    Those of LabPendulum-v0, but for `randomize`; a sensor's `window` and `corner` count on all devices, its other
    values, delays and noise are of the virtual one. And:

    {arguments}

    Raises DeviceError for a device that is not there, and SceneError as LabPendulum-v0. Attributes of `env.unwrapped`,
    beside those of LabPendulum-v0: `device`, and `log`, the file of the present run or the last one, which
    `pendulum_env.lab.DrivenLog.read` reads.
    """

    metadata: dict[str, Any] = OWN_METADATA
    _settings: BenchSettings

    @taking(BenchSettings)
    def __init__(self, given: BenchSettings) -> None:
        plain = _plain(given)
        self._beside: Any = None
        self._readings: deque[Reading] = deque(maxlen=1)
        self._journal: Journal | None = None
        LabPendulumEnv.__init__.__wrapped__(self, plain)  # type: ignore[attr-defined]
        self.metadata = {**OWN_METADATA, "render_fps": 1.0 / self._dt}
        self._settings = given
        if not SHORTEST_STEP <= self._dt <= LONGEST_STEP:
            raise SceneError(f"dt must be from {SHORTEST_STEP:g} to {LONGEST_STEP:g} s on a bench, not {self._dt:g} s, "
                             "so that its watchdog stops the motor within 0.1 s.")
        motor = self._machine.scene.coefficients.get("motor_rate", 0.0) * self._scene.inertia
        if motor <= 0.0 or self._omega0 <= 0.0:
            raise SceneError(f"The scene {shown(self._scene.name)} needs gravity and a motor to be a bench; take "
                             "lab or motor_bench, or add a Motor to your scene.")
        self._most = 1.0 if given.torque_limit is None else min(1.0, given.torque_limit / motor)
        if given.speed_limit is None:
            self._speed_limit = SPEED * self._omega0
        sensor = given.sensor if isinstance(given.sensor, Sensor) else Sensor()
        self._corner = sensor.corner
        self._readings = deque(maxlen=2 if sensor.corner else int(sensor.window) + 1)
        self._device = device_at(given.device, self._scene, sensor=_of_the_virtual(given.sensor),
                                 observation_delay=given.observation_delay, action_delay=given.action_delay)
        self._watchdog = min(WATCHDOG * self._dt, MOST_WATCHDOG)
        self._confirmed = given.confirm is True or not self._device.real
        self._zeroed = False
        self._ended, self._zero, self._due, self._swift = "", 0.0, -math.inf, 0.0
        self._late, self._missed, self._warned, self._began, self._asked_at = 0.0, 0, False, 0.0, 0.0
        self._first_energy: float | None = None
        self._steps, self._limit = 0, math.inf
        self._file = None if given.log is None else file_path(given.log, "log")
        self._log: Path | None = None

    # --- episodes ----------------------------------------------------------------------------------------------------

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Brake, wait until the bob hangs at rest, find the zero, bring the bob up if the task starts there, and begin.

        ``options`` may name a start, "angle" [rad] and "velocity" [rad/s], near hanging or upright at rest. Raises
        SceneError for other options, and DeviceError for another start, a device that is lost, and a bob that does not
        come to rest.
        """
        upright = self._is_upright(options)
        self._settle_length()
        self._steps, self._limit = 0, time_limit(self) or math.inf
        gymnasium.Env.reset(self, seed=None if seed is None else whole_number(seed, "seed", least=0))
        self._end_log()
        self._ask()
        with self._stopping():
            self._open()
            self._rest()
            if upright:
                self._bring_up()
            else:
                self._device.open(self._watchdog)  # the watchdog waits for the first step
                self._due = -math.inf
            last = self._readings[-1]
        self._began, self._ended, self._missed, self._late = last.time, "", 0, 0.0
        path = next(path for path in numbered(self._place(), "run") if not path.exists())
        self._journal, self._log = Journal(path, self._device), path
        observation, info = self._start(last.angle - self._zero, self._swift)
        info["log"] = str(path)
        return observation, info

    def _start(self, angle: float, velocity: float) -> tuple[NDArray[np.float32], dict[str, Any]]:
        if self._settings.twin:
            self._beside = self._machine.state(angle, velocity)
            self._machine.advance(self._beside, 0.0, self._h, 0)
        self._first_energy = None
        return super()._start(angle, velocity)

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Send an action, wait for the end of the control step, and read the device.

        Raises ActionError and ResetNeeded as LabPendulum-v0, and ResetNeeded after an episode's end, when the motor is
        off. Whatever is raised, also Ctrl-C, switches the motor off first.
        """
        if self._state is not None and self._ended:
            raise gymnasium.error.ResetNeeded(f"The motor is off, as the episode has ended ({self._ended}); call "
                                              "reset().")
        with self._stopping():
            share = min(max(torque_share(action), -self._most), self._most)
            observation, reward, terminated, truncated, info = super().step(np.array([share]))
            if self._ended:
                info["stop_reason"] = self._ended
                terminated = terminated or self._ended == "turns"
                truncated = truncated or self._ended != "turns"
            self._steps += 1
            if terminated or truncated or self._steps >= self._limit:
                self._ended = info["stop_reason"] or "time"
                with suppress(DeviceError):  # a lost one stops by its watchdog
                    self._device.stop()
                self._end_log()
        return observation, reward, terminated, truncated, info

    def close(self) -> None:
        """Switch the motor off, close the device, and end the log."""
        device = vars(self).get("_device")
        if device is not None:
            device.close()
            self._end_log()
        super().close()

    @contextmanager
    def _stopping(self) -> Iterator[None]:
        """Switch the motor off if anything is raised inside, and raise it then."""
        try:
            yield
        except BaseException:
            self._ended = self._ended or "stopped"
            with suppress(Exception):
                self._device.stop()
            raise

    # --- one control step --------------------------------------------------------------------------------------------

    def _run(self, steps: int) -> tuple[NDArray[np.float32], int, list[float]]:
        """Make a control step on the device in place of the simulation's; see :meth:`LabPendulumEnv._run`."""
        if not steps:
            return super()._run(0)
        skipped = self._exchange(self._share)
        state = self._state
        angle, turns = split_turns(self._readings[-1].angle - self._zero, self._scene.periodic)
        state[INDEX] += steps * (1.0 + skipped)
        state[ANGLE], state[TURNS], state[VELOCITY] = angle, turns, self._swift
        seen, _, values = super()._run(0)  # energies and observation of the measured state
        return seen, SPEED_LIMIT if abs(self._swift) > self._speed_limit else 0, values

    def _exchange(self, share: float) -> int:
        """Send a share of the torque, wait for the end of the step, and read; return the number of steps left out."""
        device, before, skipped = self._device, self._readings[-1], 0
        try:
            if self._due == -math.inf:  # the run begins with its first action, however late that comes
                self._accept(device.read())
                before = self._readings[-1]
                self._began, self._due = before.time, device.now()
            now = device.now()
            self._late = max(now - self._due, 0.0)
            skipped = int(self._late / self._dt)
            device.write(share)
            if self._journal is not None:
                self._write(self._journal, before, round(FULL * share) / FULL)
            self._due += (1 + skipped) * self._dt
            device.wait(self._due)
            self._accept(device.read())
        except DeviceError as error:
            self._fault("device", str(error))
        if skipped:
            self._missed += skipped
            self._tell_of_slowness()
        if self._beside is not None:
            self._go_beside(share, before.drive, skipped)
        if abs(self._readings[-1].angle - self._zero) > math.tau * self._settings.turn_limit and not self._ended:
            self._ended = "turns"
        return skipped

    def _accept(self, reading: Reading) -> None:
        """Take a reading, if it can be true, and compute the velocity with those before; DeviceError if it cannot."""
        now, kept = self._device.now(), self._readings
        if kept:
            before = kept[-1]
            passed, moved = reading.time - before.time, reading.angle - before.angle
            if reading.state == "watchdog":
                self._fault("watchdog", "")
            elif reading.state != "driving":
                raise DeviceError(f"The board at {self._device} has stopped by itself, as after a restart.")
            wild = WILD * self._speed_limit * max(passed, self._dt)
            if abs(passed - (now - self._asked_at)) > JUMP or passed < 0.0:
                raise DeviceError(f"The board at {self._device} says that {passed:.3g} s have passed, in "
                                  f"{now - self._asked_at:.3g} s.")
            if not abs(moved) <= wild:
                raise DeviceError(f"The board at {self._device} says that the bob has moved by {moved:.3g} rad in "
                                  f"{passed:.3g} s; look at the encoder and its wires.")
        self._asked_at = now
        if not kept or reading.time > kept[-1].time:
            kept.append(reading)
            self._swift = self._velocity()

    def _velocity(self) -> float:
        """Return the velocity of the readings [rad/s]; see :class:`pendulum_env.Sensor`."""
        first, last = self._readings[0], self._readings[-1]
        if last is first:
            return 0.0
        slope = (last.angle - first.angle) / (last.time - first.time)
        if self._corner is None:
            return slope
        gain = 1.0 - math.exp(-math.tau * self._corner * (last.time - first.time))
        return self._swift + gain * (slope - self._swift)

    def _fault(self, reason: str, why: str) -> None:
        """End the episode for a reason of the device."""
        self._ended = self._ended or reason
        if why and self._settings.warn:
            warn(f"The episode ends: {why}")

    def _tell_of_slowness(self) -> None:
        """Warn once that actions come too late."""
        if not self._warned and self._settings.warn:
            self._warned = True
            left_out = "a control step was" if self._missed == 1 else f"{self._missed} control steps were"
            warn(f"An action came {1e3 * self._late:.0f} ms after its observation, more than dt={1e3 * self._dt:g} ms, "
                 f"so that {left_out} left out: the policy is too slow, the computer busy, or the line bad; give a "
                 "longer dt (info['missed'] counts on).")

    def _go_beside(self, share: float, last: float, skipped: int) -> None:
        """Simulate the twin for the same control step; where steps were left out, under the action before."""
        machine = self._machine
        for action, count in ((last, skipped), (share, 1)):
            if count:
                machine.advance(self._beside, action, self._h, count * self._substeps)

    def _info(self, values: list[float]) -> dict[str, Any]:
        info = {name: value for name, value in super()._info(values).items()
                if not name.startswith(("work", "heat", "energy_residual"))}
        info["time"] = self._readings[-1].time - self._began
        info["time_late"], info["missed"] = self._late, self._missed
        if self._beside is not None:
            ahead = info["time"] - float(self._beside[INDEX]) * self._h
            angle, velocity = motion_of(self._beside)
            info["twin_angle"] = angle + ahead * velocity
            info["angle_residual"] = info["angle"] - info["twin_angle"]
            if "energy" in info:
                twin = self._machine.info(self._beside.tolist() if self._machine.compiled else self._beside)
                if self._first_energy is None:
                    self._first_energy = info["energy"]
                info["work"], info["heat"] = twin["work"], twin["heat"]
                info["energy_residual"] = info["energy"] - self._first_energy - twin["work"] + twin["heat"]
        return info

    # --- what reset does ---------------------------------------------------------------------------------------------

    def _is_upright(self, options: Any) -> bool:
        """Return True if an episode starts upright, False if hanging; DeviceError for a start that is neither."""
        _, task, given = checked_options(options, self._scene, self._task)
        if given:
            raise SceneError(f"{' and '.join(given)} cannot be set on a bench; the options of reset are "
                             f"{' and '.join(START)}.")
        asked = {name: float(value) for name, value in (options or {}).items() if name in START}
        near = [(angle, velocity) for angle, velocity in self._starts(task, asked)
                if abs(velocity) <= SLOW * self._omega0 * (1.0 + 1e-9)]
        for upright in (False, True):
            top = math.pi if upright else 0.0
            if any(abs(math.remainder(angle - top, math.tau)) <= NEAR * (1.0 + 1e-9) for angle, _ in near):
                return upright
        said = ", ".join(f"{name} {value:g}" for name, value in asked.items()) or f"the start of {shown(task.name)}"
        raise DeviceError(f"A bench cannot start at {said}: it begins hanging at rest or, by its controller, upright; "
                          "leave the options out, or take another task.")

    def _starts(self, task: Task, asked: Mapping[str, float]) -> Iterator[tuple[float, float]]:
        """Yield angles [rad] and velocities [rad/s] at which a task starts, over the whole range of both."""
        if not task.draws:
            yield asked.get("angle", 0.0), asked.get("velocity", 0.0)
            return
        shares = [k / (GRID - 1) for k in range(GRID)]
        for first in shares:
            for second in shares:
                angle, velocity = task.starts(first, second, self._omega0)
                yield asked.get("angle", float(angle)), asked.get("velocity", float(velocity))

    def _ask(self) -> None:
        """Let somebody confirm the first motion of a real device; DeviceError if nobody does."""
        if self._confirmed:
            return
        confirm = self._settings.confirm
        question = (f"The motor of the bench at {self._device} will move now. Is the pendulum free, and everybody out "
                    "of its reach? [yes/no] ")
        if callable(confirm):
            agreed = confirm(question) is True
        elif confirm is None and sys.stdin is not None and sys.stdin.isatty():
            agreed = input(question).strip().lower() in ("y", "yes")
        else:
            raise DeviceError("The first motion of a bench has to be confirmed, and nobody can be asked here; give "
                              "confirm=True once the pendulum is free and everybody out of its reach.")
        if not agreed:
            raise DeviceError("The motion was not confirmed, so that nothing moves; reset() asks again.")
        self._confirmed = True

    def _open(self) -> None:
        """Open the device, a lost one anew, and read it for the first time."""
        if self._ended == "device":
            self._device.close()
            self._zeroed = False  # a board that begins again counts from where the bob is then
        self._device.open(self._watchdog)
        self._readings.clear()
        self._swift, self._ended = 0.0, ""
        self._accept(self._device.read())
        self._due = self._device.now()

    def _pulse(self, share: float) -> Reading:
        """Give a share of the torque for a control step of ``reset``, and return the reading at its end."""
        device = self._device
        device.write(min(max(share, -self._most), self._most))
        self._due = max(self._due + self._dt, device.now())
        device.wait(self._due)
        self._accept(device.read())
        if self._ended == "watchdog":  # this computer was held up, which does no harm here
            self._ended = ""
            device.open(self._watchdog)
        if abs(self._swift) > self._speed_limit:
            raise DeviceError(f"The bob is faster than {self._speed_limit:.3g} rad/s; hold it, then call reset().")
        return self._readings[-1]

    def _rest(self) -> None:
        """Brake until the bob has hung at rest for a period, and take its mean angle as 0.

        The zero of the run before stays if the bob hangs near it, so that runs of one bench have one zero: dry friction
        lets a bob rest beside its equilibrium.
        """
        period = math.tau / self._omega0 / self._dt
        whole, short = max(2, math.ceil(period)), max(1, round(SMOOTH * period))
        past: deque[float] = deque([self._readings[-1].angle], maxlen=whole)
        until = self._device.now() + PATIENCE
        while len(past) < whole or max(past) - min(past) > STILL:
            back = min(short, len(past) - 1)
            speed = (past[-1] - past[-1 - back]) / (max(back, 1) * self._dt * self._omega0)
            past.append(self._pulse(-speed / BRAKE).angle)
            if self._device.now() > until:
                raise DeviceError(f"The bob has not come to rest within {PATIENCE:g} s: over the last period it moved "
                                  f"by {max(past) - min(past):.3g} rad; hold it until it hangs at rest, then reset().")
        mean = sum(past) / len(past)
        kept = self._zero + math.tau * round((mean - self._zero) / math.tau)
        self._zero = kept if self._zeroed and abs(mean - kept) <= SAME else mean
        self._zeroed = True

    def _bring_up(self) -> None:
        """Bring the bob near upright by the scene's controller; DeviceError if it cannot."""
        from pendulum_env.controllers import SwingUp

        control = SwingUp(self._scene, self._dt)
        until = self._device.now() + PATIENCE
        while True:
            angle = self._readings[-1].angle - self._zero
            if (abs(math.remainder(angle - math.pi, math.tau)) <= NEAR
                    and abs(self._swift) <= SLOW * self._omega0):
                return
            seen = np.array([math.cos(angle), math.sin(angle), self._swift], dtype=np.float32)
            self._pulse(float(control(seen)[0]))
            if self._device.now() > until:
                raise DeviceError(f"The controller has not brought the bob upright within {PATIENCE:g} s; compare the "
                                  "scene with the bench, as by fit_driven, or take a task that starts hanging.")

    # --- the log -----------------------------------------------------------------------------------------------------

    def _place(self) -> Path:
        """Return the file whose numbered neighbours are the logs."""
        if self._file is None:
            self._file = Path(tempfile.mkdtemp(prefix="lab-pendulum-bench-")) / "bench.csv"
        return self._file

    def _write(self, journal: Journal, reading: Reading, drive: float) -> None:
        """Write a reading and the drive that follows it, at once, so that a killed process keeps it."""
        journal.write(np.array([reading.time - self._began]), np.array([[reading.angle - self._zero, drive]]))

    def _end_log(self) -> None:
        journal = self._journal
        if journal is not None and self._readings:
            if journal.open:
                self._write(journal, self._readings[-1], 0.0)
            journal.close()

    # --- what a bench cannot do --------------------------------------------------------------------------------------

    def get_state(self) -> dict[str, Any]:
        """Refuse: the state of a bench cannot be saved. Raises SceneError."""
        raise SceneError("The state of a bench cannot be saved or restored; its log has the readings.")

    def set_state(self, saved: Mapping[str, Any]) -> None:
        """Refuse: a bench cannot be put into a state. Raises SceneError."""
        self.get_state()

    def __getstate__(self) -> dict[str, Any]:
        raise SceneError("A bench cannot be copied or pickled, as there is one of it; make another environment.")


def _of_the_virtual(sensor: Any) -> Sensor | None:
    """Return a sensor without window and corner, which compute a velocity here; None if it has nothing else."""
    plain = None if sensor is None else replace(sensor, window=1.0, corner=None)
    return None if plain == Sensor() else plain


def _plain(given: BenchSettings) -> BenchSettings:
    """Return the settings of the part that is shared with LabPendulum-v0; SceneError for what a bench has not."""
    if given.randomize is not None:
        raise SceneError("randomize draws parameters, but a bench has those that it has; train with it in "
                         "LabPendulum-v0.")
    if "error" in given.diagnostics or "heat_by_effect" in given.diagnostics:
        raise SceneError("The diagnostics error and heat_by_effect are of a simulation, and not of a bench.")
    if not (given.confirm is None or given.confirm is True or callable(given.confirm)):
        raise SceneError(f"confirm must be True, None or a function of the question, not {shown(given.confirm)}.")
    kind = "full" if given.observation == "encoder" else given.observation
    return replace(given, observation=kind, sensor=None, observation_delay=0.0, action_delay=0.0)


fix(LabPendulumBenchEnv, ())
documented(LabPendulumBenchEnv, arguments=described(BenchSettings, EnvSettings))
