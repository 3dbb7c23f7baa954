"""The virtual board: a process with a simulated firmware and pendulum, driven over a line, killed and cut.

Times to zero torque are those of the firmware's log, by its own clock, which no busy machine changes.
"""

from __future__ import annotations

import math
import os
import select
import signal
import subprocess
import sys
import textwrap
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from boards import Board
from simulated_board import Bob

from pendulum_env import SCENES, rollout
from pendulum_env.bench import DeviceError, VirtualBoard
from pendulum_env.bench.device import device_at
from pendulum_env.bench.firmware import Firmware, Plant
from pendulum_env.bench.protocol import DRIVING, STOPPED, TRIPPED, Frame, encoded
from pendulum_env.lab import DrivenLog


def changes(path: Path, *until: int) -> list[tuple[float, int, int]]:
    """What a firmware's log has, waiting until its last state is one of ``until``."""
    end = time.monotonic() + 60.0
    while True:
        rows = [line.split(",") for line in path.read_text().splitlines()[1:] if line.count(",") == 2]
        found = [(float(at), int(drive), int(state)) for at, drive, state in rows]
        if found and found[-1][2] in until:
            return found
        assert time.monotonic() < end, found
        time.sleep(0.02)


def test_the_plant_is_the_simulation_behind_its_sensor_and_delay() -> None:
    """A torque of 25 ms, 10 ms late, on the scene's own pendulum; then free motion as rollout has it."""
    plant = Plant({"scene": "lab", "sensor": {"quantum": math.tau / 4096}, "action_delay": 0.010, "backend": "python"})
    board = Firmware(plant)
    said = {10: Frame("H", 1, (1000,)), 20: Frame("D", 2, (1000,)), 45: Frame("D", 3, (0,))}
    assert plant.counts == 4096
    counts = []
    for k in range(600):
        board.receive(encoded(said[k]) if k in said else b"", 0.001 * k)
        counts.append(plant.count)
    assert not any(counts[:31])
    scene = SCENES["lab"]
    pushed = rollout(scene, angle=0.0, velocity=0.0, duration=0.025, dt=0.001, control=1.0, backend="python",
                     warn=False)
    free = rollout(scene, angle=float(pushed.angle[-1]), velocity=float(pushed.velocity[-1]), duration=0.5, dt=0.001,
                   backend="python", warn=False)
    wanted = free.angle * 4096 / math.tau
    assert np.abs(np.array(counts[55:555]) - wanted[:500]).max() < 0.6


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return tmp_path / "firmware.csv"


@pytest.mark.slow
def test_a_run_over_the_line(log: Path, tmp_path: Path) -> None:
    """From the address to the log; a hidden scene; and a process that ends with its line."""
    board = VirtualBoard(SCENES["lab"].replace(length=0.4), log=log)
    env = gym.make("LabPendulumBench-v0", device=board, scene="lab", dt=0.04, log=tmp_path / "run.csv", twin=True,
                   backend="python", warn=False)
    env.reset(seed=0)
    process = board.process
    assert process is not None
    infos: list[dict[str, Any]] = []
    while len(infos) < 40:
        *_, stopped, info = env.step(np.full(1, 1 - len(infos) % 2, np.float32))
        infos.append(info)
        if stopped:  # as this computer was held up
            infos.clear()
            env.reset()
    env.close()
    assert process.poll() == 0
    assert len(DrivenLog.read(env.unwrapped.log).time) == 41
    assert changes(log, STOPPED)[-1][1] == 0
    assert max(info["angle"] for info in infos) > 0.1
    assert max(abs(info["angle_residual"]) for info in infos) > 0.01  # the twin has another length


DRIVER = """
    import os, signal, sys, threading, time
    import gymnasium as gym, numpy as np
    import pendulum_env
    from pendulum_env.bench import VirtualBoard
    signal.signal(signal.SIGINT, signal.default_int_handler)  # shells start background jobs with SIGINT ignored
    board = VirtualBoard("lab", log=sys.argv[1])
    env = gym.make("LabPendulumBench-v0", device=board, dt=0.03, log=sys.argv[2], max_episode_steps=-1, warn=False)
    env.reset(seed=0)
    k = 0
    while True:
        *_, stopped, info = env.step(np.full(1, (-1) ** k, np.float32))  # each is a change, which the log has
        if stopped:  # as this computer was held up
            env.reset()
            k = 0
            continue
        print(k, flush=True)
        {fault}
        k += 1
"""
PROCESS_FAULTS: dict[str, tuple[str, int | None]] = {
    "kill -9": ("pass", signal.SIGKILL),
    "Ctrl-C": ("if k == 9: threading.Timer(0.01, os.kill, (os.getpid(), signal.SIGINT)).start()", None),
    "an exception in the policy": ("1 / (k < 9)", None),
    "a policy that hangs": ("time.sleep(60.0 * (k == 9))", None),
    "the end of the program": ("if k == 9: sys.exit()", None),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", PROCESS_FAULTS)
def test_a_program_that_ends_or_hangs_leaves_no_torque(name: str, log: Path, tmp_path: Path) -> None:
    fault, number = PROCESS_FAULTS[name]
    program = textwrap.dedent(DRIVER).replace("{fault}", fault)
    with subprocess.Popen([sys.executable, "-c", program, log, tmp_path / "run.csv"], stdout=subprocess.PIPE,
                          stderr=subprocess.DEVNULL, text=True) as run:
        assert run.stdout is not None
        try:
            assert "9" in (line.strip() for line in run.stdout)
            if number is not None:
                os.kill(run.pid, number)
            if "hangs" not in name:
                run.wait(30.0)
            told = changes(log, STOPPED, TRIPPED)
        finally:
            run.kill()
    (last, drive, _), (end, rest, state) = told[-2:]
    assert (abs(drive), rest) == (1000, 0)
    assert end - last <= 0.0911  # from the last action to zero torque
    if name == "kill -9":
        assert state == TRIPPED
        assert end - last == pytest.approx(0.090, abs=0.0011)
    newest = max(tmp_path.glob("run-run*.csv"), key=lambda path: int(path.stem.removeprefix("run-run")))
    kept = newest.read_text().splitlines()
    titles = kept.index("Time (s),Angle (rad),Action")
    rows = np.array([line.split(",") for line in kept[titles + 1:]], dtype=float)
    assert len(rows) >= 10
    assert rows[:10, 2].tolist() == [1.0, -1.0] * 5


@pytest.mark.slow
def test_a_line_that_is_cut_while_the_motor_is_on(log: Path) -> None:
    """The board goes on without its line, until its watchdog stops the motor 60 ms after the last drive."""
    board = VirtualBoard("lab", log=log)
    board.open(0.06)
    board.write(0.5)
    vars(board)["_line"].close()
    told = changes(log, TRIPPED)
    assert told[-2][1:] == (500, DRIVING)
    assert told[-1][0] - told[-2][0] == pytest.approx(0.060, abs=0.0011)
    with pytest.raises(DeviceError, match=r"The line to the board at virtual \(lab\) is cut"):
        board.read()
    board.close()


@pytest.mark.slow
def test_a_closed_board_starts_again(log: Path) -> None:
    board = VirtualBoard("lab", log=log)
    for _ in range(2):
        board.open(0.06)
        assert board.read().state == "driving"
        board.close()
        board.close()


class Terminal:
    """A board of boards.py whose bytes a firmware answers, with a bob on its shaft, in a thread."""

    def __init__(self, folder: Path) -> None:
        self.board, self.firmware = Board(folder), Firmware(Bob())
        self._over = threading.Event()
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.thread.start()

    def _run(self) -> None:
        began = time.monotonic()
        with suppress(OSError):
            while not self._over.is_set():
                if select.select([self.board.far], [], [], 0.005)[0]:
                    data = os.read(self.board.far, 4096)
                    os.write(self.board.far, self.firmware.receive(data, time.monotonic() - began))
                self.firmware.go_on(time.monotonic() - began)

    def end(self) -> None:
        self._over.set()
        self.thread.join()


def test_a_board_at_a_serial_port(tmp_path: Path) -> None:
    """Through pyserial and a pseudo-terminal: greeting, readings, drives, a stop, and the port that is gone."""
    pytest.importorskip("serial")
    terminal = Terminal(tmp_path)
    board = device_at(f"serial:{terminal.board.port}")
    board.open(1.0)
    board.write(0.25)
    assert board.read()[2:] == (0.25, "driving")
    assert terminal.board.baud == 500_000
    board.stop()
    assert board.read()[2:] == (0.0, "stopped")
    board.open(1.0)
    board.write(-1.0)
    assert board.read()[2:] == (-1.0, "driving")
    terminal.end()
    terminal.board.unplug()
    with pytest.raises(DeviceError, match=r"The line to the board at serial:.*ttyBOARD is cut"):
        board.read()
    board.close()


@pytest.mark.slow
def test_a_board_that_does_not_start_says_why() -> None:
    board = VirtualBoard("lab")
    vars(board)["scene"] = "nowhere"  # past the check
    with pytest.raises(DeviceError, match=r"The virtual board has not started: .*nowhere"):
        board.open(0.06)
    board.close()


@pytest.mark.slow
def test_a_motion_that_cannot_go_on_is_said() -> None:
    """Drag that forward Euler cannot integrate in steps of a millisecond, with a bob that is thrown."""
    scene = SCENES["lab"].replace(gamma=1e5)
    board = VirtualBoard(scene, integrator="forward_euler", velocity=1.0)

    def used() -> None:
        board.open(0.06)  # on a busy machine it has ended before it answers
        assert board.process is not None
        board.process.wait(60.0)
        board.read()

    with pytest.raises(DeviceError, match=r"The virtual board has ended: the simulated motion stopped \(diverged\)"):
        used()
    board.close()


def test_settings_that_no_other_process_can_have_are_refused() -> None:
    board = VirtualBoard("lab")
    vars(board)["scene"] = lambda: None  # as a function of a scene's own effect
    with pytest.raises(DeviceError, match="cannot be handed to its process"):
        board.open(0.06)


@pytest.mark.parametrize(("keywords", "said"), [
    ({"action_delay": 0.0005}, "action_delay must be a whole number of steps of 0.001 s"),
    ({"sensor": 3}, "sensor must be a Sensor"), ({"integrator": "rk5"}, "rk5"), ({"seed": -1}, "seed")])
def test_what_a_virtual_board_cannot_be_is_refused(keywords: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        VirtualBoard("lab", **keywords)
