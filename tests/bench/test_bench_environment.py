"""``LabPendulumBench-v0`` on a board whose time is simulated: what it shares with LabPendulum-v0, starts, limits, logs.

Times to zero torque are those of the firmware's own log.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from simulated_board import SimulatedBoard

from pendulum_env import SCENES, Sensor
from pendulum_env.bench.device import DeviceError, device_at
from pendulum_env.bench.protocol import Frame, encoded
from pendulum_env.controllers import swing_up
from pendulum_env.lab import DrivenLog
from pendulum_env.physics.units import SceneError
from pendulum_env.testing import check_vector_env

QUICK: dict[str, Any] = {"backend": "python"}
FULL = np.ones(1, np.float32)


@pytest.fixture
def bench(tmp_path: Path) -> Any:
    """Function that makes an environment on a simulated board, with its log in a folder of the test."""
    made = []

    def make(board: SimulatedBoard | None = None, **keywords: Any) -> Any:
        device = board or SimulatedBoard()
        given = {"device": device, "log": tmp_path / "log.csv", **QUICK, **keywords}
        made.append(gym.make("LabPendulumBench-v0", **given))
        return made[-1]

    yield make
    for env in made:
        env.close()


def steps(env: Any, action: np.ndarray = FULL, most: int = 600) -> dict[str, Any]:
    """The last info of an episode under one action."""
    for _ in range(most):
        *_, terminated, truncated, info = env.step(action)
        if terminated or truncated:
            return {**info, "terminated": terminated, "truncated": truncated}
    raise AssertionError("the episode has not ended")


# --- what it shares ---------------------------------------------------------------------------------------------------


@pytest.mark.quick("swing_up-encoder", "track-history")
@pytest.mark.parametrize("kind", ["full", "angle", "encoder", "history"])
@pytest.mark.parametrize("task", ["swing_up", "track"])
def test_spaces_rewards_and_infos_are_those_of_the_simulation(bench: Any, kind: str, task: str) -> None:
    real = bench(task=task, observation=kind)
    simulated = gym.make("LabPendulum-v0", task=task, observation=kind, damping={"linear": {"gamma": 0.02}}, **QUICK)
    assert real.observation_space == simulated.observation_space
    assert real.action_space == simulated.action_space
    assert real.spec.nondeterministic
    assert real.spec.max_episode_steps == simulated.spec.max_episode_steps
    real.reset(seed=0)
    simulated.reset(seed=0, options={"angle": 0.0, "velocity": 0.0})
    for k in range(60):
        action = np.array([math.sin(0.3 * k)], np.float32)
        seen, reward, *_, info = real.step(action)
        wanted, other, *_, known = simulated.step(action)
        assert seen[:2] == pytest.approx(wanted[:2], abs=2e-3)
        assert reward == pytest.approx(other, abs=0.02)
        extra = {"time_late", "missed"}
        assert info.keys() - extra == known.keys() - {"work", "heat", "energy_residual", "observed_angle"} | (
            {"observed_angle"} & info.keys())
        assert info["time"] == pytest.approx(known["time"], abs=1e-3)
        assert info["angle"] == pytest.approx(known["angle"], abs=2e-3)
        assert info["velocity"] == pytest.approx(known["velocity"], abs=0.3)
        assert (info["missed"], info["time_late"]) == (0, 0.0)


def test_measured_energies_are_those_of_the_measured_state(bench: Any) -> None:
    env = bench()
    env.reset(seed=0)
    body = SCENES["lab"].body
    for _ in range(30):
        *_, info = env.step(FULL)
    inertia = body.mass * body.length**2  # a bob that counts as a point, in lab
    lifted = body.mass * 9.81 * body.length * (1.0 - math.cos(info["angle"]))
    assert info["potential_energy"] == pytest.approx(lifted, rel=1e-12)
    assert info["kinetic_energy"] == pytest.approx(0.5 * inertia * info["velocity"] ** 2, rel=1e-12)
    assert info["energy"] == pytest.approx(info["potential_energy"] + info["kinetic_energy"], rel=1e-12)


@pytest.mark.parametrize("sensor", [Sensor(window=3), Sensor(corner=8.0)])
def test_the_velocity_is_that_of_the_sensors_declaration(bench: Any, sensor: Sensor) -> None:
    """The same readings through the simulation's own encoder give the same velocities, up to its even times."""
    env = bench(SimulatedBoard(counts=10**8), sensor=sensor)
    other = gym.make("LabPendulum-v0", observation="encoder", sensor=sensor, substeps=20, **QUICK)
    env.reset(seed=0)
    other.reset(seed=0, options={"angle": 0.0, "velocity": 0.0})
    for k in range(40):
        seen, wanted = env.step(FULL)[0], other.step(FULL)[0]
        if k > 3:  # the simulation has no readings from before its start
            assert seen[2] == pytest.approx(wanted[2], abs=0.03)


def test_the_twin_of_a_bench_like_the_scene_follows_it_and_another_one_parts(bench: Any) -> None:
    for length, follows in ((0.353, True), (0.38, False)):
        env = bench(SimulatedBoard(length=length), twin=True, substeps=4)
        env.reset(seed=0)
        infos = [env.step(FULL * math.copysign(1.0, math.sin(5.0 * 0.02 * k)))[4] for k in range(100)]
        residuals = np.array([info["angle_residual"] for info in infos])
        largest = max(abs(info["energy"]) for info in infos)
        assert bool(np.abs(residuals).max() < 0.05) is follows
        for info in infos:
            assert info["angle_residual"] == pytest.approx(info["angle"] - info["twin_angle"])
            if follows:  # the velocity is half a step old, and rounded
                assert abs(info["energy_residual"]) < 0.15 * largest
        ends = infos[0]["energy"] - infos[0]["work"] + infos[0]["heat"] - infos[0]["energy_residual"]
        for info in infos:  # the ledger closes, with the energy before the first step on the other side
            assert info["energy"] - info["work"] + info["heat"] - info["energy_residual"] == pytest.approx(ends)


def test_gymnasiums_checker_passes(tmp_path: Path) -> None:
    make = partial(gym.make, "LabPendulumBench-v0", log=tmp_path / "log.csv", render_mode="rgb_array", render_size=60,
                   **QUICK)
    check_env(make(device=SimulatedBoard()).unwrapped, skip_render_check=True, skip_close_check=True)
    env = make(device=SimulatedBoard())
    env.reset(seed=0)
    env.step(FULL)
    assert env.render().shape == (60, 60, 3)
    env.close()
    env.close()


def test_our_checker_passes_and_says_what_no_bench_can_repeat(tmp_path: Path) -> None:
    def make(**keywords: Any) -> Any:
        return gym.make("LabPendulumBench-v0", device=SimulatedBoard(), log=tmp_path / "log.csv", max_episode_steps=5,
                        **QUICK, **keywords)

    def make_vec(num_envs: int, **keywords: Any) -> Any:
        vector = gym.vector.SyncVectorEnv([make] * num_envs, **keywords)
        vector.spec = gym.spec("LabPendulumBench-v0")
        return vector

    report = check_vector_env(make_vec, make, num_envs=2, steps=12)
    assert not report.failed
    said = {check.name: check.said for check in report.skipped}
    assert {"seeds", "starts", "pickling"} <= said.keys()
    assert "nondeterministic" in said["seeds"]


# --- starts -----------------------------------------------------------------------------------------------------------


def test_reset_brings_a_swinging_bob_to_rest_and_finds_the_zero(bench: Any) -> None:
    board = SimulatedBoard(angle=3.0, velocity=5.0, offset=1.25, noise=0.001)
    env = bench(board)
    _, info = env.reset(seed=0)
    angle, velocity = board.bob.angle, board.bob.velocity
    assert abs(math.remainder(angle, math.tau)) < 0.005
    assert abs(velocity) < 0.05
    assert info["angle"] == pytest.approx(math.remainder(angle, math.tau), abs=0.005)
    assert board.clock < 30.0


def test_runs_of_one_bench_have_one_zero(bench: Any) -> None:
    """Unless the bob hangs farther from it than dry friction explains; whole turns are no difference."""
    board = SimulatedBoard(counts=10**6)
    env = bench(board)
    env.reset()
    for moved, seen in ((0.02, 0.02), (math.tau, 0.02), (0.2, 0.0), (-0.01, -0.01)):
        board.bob.offset += moved
        assert env.reset()[1]["angle"] == pytest.approx(seen, abs=1e-3)


def test_reset_brings_the_bob_upright_for_balance(bench: Any) -> None:
    board = SimulatedBoard()
    env = bench(board, task="balance")
    seen, info = env.reset(seed=0)
    assert seen[0] < -0.99
    assert abs(math.remainder(info["angle"] - math.pi, math.tau)) < 0.1
    control = swing_up(env)
    for _ in range(100):
        seen, reward, terminated, *_ = env.step(control(seen))
        assert not terminated
    assert reward > 0.9


@pytest.mark.parametrize(("task", "options"), [
    ("swing_up", {"angle": 0.5}), ("swing_up", {"velocity": 1.0}), ("balance", {"angle": 2.0}),
    ("free", {"angle": 1.0})])
def test_a_start_that_no_bench_can_make_is_refused(bench: Any, task: str, options: dict[str, float]) -> None:
    board = SimulatedBoard()
    with pytest.raises(DeviceError, match=r"A bench cannot start at .*it begins hanging at rest or"):
        bench(board, task=task).reset(options=options)
    assert board.clock == 0.0


@pytest.mark.parametrize("options", [None, {"angle": 0.05}, {"angle": math.tau, "velocity": 0.0}])
@pytest.mark.parametrize("task", ["free", "gymnasium", "track"])
def test_a_start_near_hanging_is_made(bench: Any, task: str, options: dict[str, float] | None) -> None:
    _, info = bench(task=task).reset(options=options)
    assert abs(info["angle"]) < 0.01


def test_parameters_of_a_bench_are_not_set(bench: Any) -> None:
    with pytest.raises(SceneError, match="length cannot be set on a bench"):
        bench().reset(options={"length": 0.4})


def test_a_bob_that_never_rests_is_refused(bench: Any) -> None:
    board = SimulatedBoard(torque=1e-9, angle=1.0)
    with pytest.raises(DeviceError, match=r"has not come to rest within 60 s: .* moved by .* rad; hold it"):
        bench(board).reset()
    assert board.drive_at(board.clock + 0.2) == 0


# --- the first motion -------------------------------------------------------------------------------------------------


class RealBoard(SimulatedBoard):
    real = True


def test_a_real_device_moves_after_leave_only(bench: Any) -> None:
    with pytest.raises(DeviceError, match="has to be confirmed, and nobody can be asked here; give confirm=True"):
        bench(RealBoard()).reset()
    questions: list[str] = []
    for leave in (False, True):
        def ask(question: str, leave: bool = leave) -> bool:
            questions.append(question)
            return leave

        board = RealBoard()
        env = bench(board, confirm=ask)
        if leave:
            env.reset()
            env.reset()
            assert board.told
        else:
            with pytest.raises(DeviceError, match="not confirmed, so that nothing moves"):
                env.reset()
            assert not board.told
    assert len(questions) == 2
    assert all(question.startswith("The motor of the bench at simulated will move now.") for question in questions)
    bench(RealBoard(), confirm=True).reset()


def test_the_terminal_is_asked(bench: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin", type("Terminal", (), {"isatty": lambda self: True})())
    for answer in ("no", "yes"):
        monkeypatch.setattr("builtins.input", lambda question, answer=answer: answer)
        env = bench(RealBoard())
        if answer == "yes":
            env.reset()
        else:
            with pytest.raises(DeviceError, match="not confirmed"):
                env.reset()


# --- faults -----------------------------------------------------------------------------------------------------------


def moving(bench: Any, **keywords: Any) -> tuple[Any, SimulatedBoard]:
    """An environment in motion, its motor on, and its board."""
    env = bench(**keywords)
    env.reset(seed=0)
    board = env.unwrapped.device
    for _ in range(3):
        env.step(FULL)
    assert board.drive_at(board.clock) > 0
    return env, board


def off_after(board: SimulatedBoard, since: float) -> float:
    """The time from a moment of the board's clock to zero torque [s], by the firmware's log."""
    board.firmware.go_on(since + 0.2)
    assert board.firmware.drive == 0
    return max(next(at for (_, before, _), (at, drive, _) in reversed([*pairwise(board.told)]) if before and not drive)
               - since, 0.0)


def test_torque_is_limited(bench: Any) -> None:
    env, board = moving(bench, torque_limit=0.02)
    assert board.drive_at(board.clock) == 400  # of 0.05 N m
    _, reward, *_, info = env.step(FULL)
    phi, speed = math.pi - abs(info["angle"]), info["velocity"] / SCENES["lab"].omega0
    assert reward == pytest.approx(-(phi**2 + 0.1 * speed**2 + 0.001 * 0.4**2), abs=1e-9)


@pytest.mark.parametrize(("keywords", "reason"), [
    ({"speed_limit": 2.0}, "speed_limit"), ({"turn_limit": 0.1, "speed_limit": 50.0}, "turns")])
def test_limits_end_an_episode_with_the_motor_off(bench: Any, keywords: dict[str, float], reason: str) -> None:
    board = SimulatedBoard(torque=0.2)
    env, _ = moving(bench, board=board, **keywords)
    info = steps(env)
    assert (info["stop_reason"], info["terminated"], info["truncated"]) == (reason, True, False)
    if reason == "speed_limit":
        assert abs(info["velocity"]) > 2.0
    else:
        assert abs(info["angle"]) > 0.1 * math.tau
    assert off_after(board, board.clock) == 0.0
    with pytest.raises(gym.error.ResetNeeded, match=rf"The motor is off, as the episode has ended \({reason}\)"):
        env.step(FULL)
    env.reset()


def test_no_step_within_three_dt_stops_the_motor(bench: Any) -> None:
    env, board = moving(bench)
    last = board.clock - 0.02  # when the last action was sent
    assert off_after(board, last) == pytest.approx(0.06, abs=0.0011)
    board.wait(board.clock + 1.0)
    with pytest.warns(UserWarning, match=r"An action came 1\d\d\d ms after its observation, more than dt=20 ms"):
        info = steps(env)
    assert (info["stop_reason"], info["terminated"], info["truncated"]) == ("watchdog", False, True)
    assert info["missed"] >= 50
    env.reset()
    assert steps(env, 0 * FULL)["stop_reason"] == ""


def test_a_policy_that_is_slower_than_dt_is_told_so_and_the_clock_goes_on(bench: Any) -> None:
    env, board = moving(bench, board=SimulatedBoard(counts=10**6), twin=True)
    before = env.step(FULL)[4]
    assert (before["missed"], before["time_late"]) == (0, 0.0)
    board.wait(board.clock + 0.035)
    with pytest.warns(UserWarning, match=r"An action came 35 ms after .* dt=20 ms, so that a control step was left"):
        late = env.step(FULL)[4]
    after = env.step(FULL)[4]  # said once
    assert late["time_late"] == pytest.approx(0.035)
    assert late["time"] == pytest.approx(before["time"] + 0.04, abs=0.0011)  # by the same even clock
    assert after["time"] == pytest.approx(before["time"] + 0.06, abs=0.0011)
    assert (late["missed"], after["missed"], after["time_late"]) == (1, 1, 0.0)
    for info in (before, late, after):  # the twin has gone through the same time
        assert abs(info["angle_residual"]) < 0.001
    board.wait(board.clock + 0.025)
    assert env.step(FULL)[4]["missed"] == 2


@pytest.mark.parametrize("fault", [KeyboardInterrupt, RuntimeError, MemoryError])
def test_whatever_is_raised_within_a_step_stops_the_motor_at_once(
    bench: Any, monkeypatch: pytest.MonkeyPatch, fault: type[BaseException]
) -> None:
    env, board = moving(bench)
    waited = board.wait

    def raising(until: float) -> None:
        waited(until - 0.005)
        raise fault

    monkeypatch.setattr(board, "wait", raising)
    with pytest.raises(fault):
        env.step(FULL)
    assert off_after(board, board.clock) == 0.0
    with pytest.raises(gym.error.ResetNeeded):
        env.step(FULL)


def test_an_invalid_action_stops_the_motor(bench: Any) -> None:
    env, board = moving(bench)
    with pytest.raises(ValueError, match="finite"):
        env.step(np.array([math.nan], np.float32))
    assert off_after(board, board.clock) == 0.0


def test_an_exception_between_steps_leaves_it_to_the_watchdog(bench: Any) -> None:
    _, board = moving(bench)
    assert off_after(board, board.clock - 0.02) < 0.1


def test_the_episodes_last_step_stops_the_motor(bench: Any) -> None:
    env, board = moving(bench, max_episode_steps=20)
    info = steps(env)
    assert (info["stop_reason"], info["truncated"]) == ("", True)
    assert off_after(board, board.clock) == 0.0


def test_closing_stops_the_motor(bench: Any) -> None:
    env, board = moving(bench)
    at = board.clock
    env.close()
    assert off_after(board, at) == 0.0


def cut(board: SimulatedBoard) -> None:
    board.cut = True


def silent(board: SimulatedBoard) -> None:
    board.garble = lambda data: b""


def garbled(board: SimulatedBoard) -> None:
    board.garble = lambda data: data.replace(b"R", b"P")


def noise(board: SimulatedBoard) -> None:
    source = np.random.default_rng(1)
    board.garble = lambda data: source.integers(0, 256, 200, dtype=np.uint8).tobytes()


def answer(change: Callable[[list[int]], Any]) -> Callable[[SimulatedBoard], None]:
    """Let the board answer other numbers, with a right check."""
    def fault(board: SimulatedBoard) -> None:
        def changed(data: bytes) -> bytes:
            if not data.startswith(b"R"):
                return data
            letter, sequence, *numbers = data.partition(b"*")[0].split()
            values = [int(number) for number in numbers]
            change(values)
            return encoded(Frame(letter.decode(), int(sequence), tuple(values)))

        board.garble = changed

    return fault


FAULTS: dict[str, tuple[Callable[[SimulatedBoard], None], str]] = {
    "cut line": (cut, "The line to the board at simulated is cut; its watchdog stops the motor"),
    "silence": (silent, "The board at simulated does not answer; its watchdog stops the motor"),
    "garbled lines": (garbled, "does not answer, and sent 3 garbled lines"),
    "noise": (noise, r"does not answer, and sent \d+ garbled lines"),
    "an angle that jumps": (
        answer(lambda v: v.__setitem__(1, v[1] + 5 * 10**5)), "says that the bob has moved by .* rad"),
    "a clock that jumps": (answer(lambda v: v.__setitem__(0, v[0] + 10**7)), "says that 10 s have passed, in 0.02 s"),
    "a clock that goes back": (answer(lambda v: v.__setitem__(0, 7)), "says that -.* s have passed"),
    "a state that is none": (answer(lambda v: v.__setitem__(3, 7)), "answers nonsense: R"),
    "a drive beyond all": (answer(lambda v: v.__setitem__(2, 1001)), "answers nonsense: R"),
    "too few numbers": (answer(lambda v: v.pop()), "answers nonsense: R"),
    "a restart": (answer(lambda v: v.__setitem__(3, 0)), "has stopped by itself, as after a restart"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_device_that_is_lost_or_answers_nonsense_ends_the_episode(bench: Any, name: str) -> None:
    env, board = moving(bench)
    fault, said = FAULTS[name]
    fault(board)
    sent = board.clock
    with pytest.warns(UserWarning, match=f"The episode ends: .*{said}"):
        seen, *_, terminated, truncated, info = env.step(FULL)
    assert (info["stop_reason"], terminated, truncated) == ("device", False, True)
    assert np.isfinite(seen).all()
    assert off_after(board, sent) < 0.1
    board.cut, board.garble = False, lambda data: data
    env.reset()  # opens it anew
    assert env.step(FULL)[4]["stop_reason"] == ""


def test_single_torn_lines_are_asked_for_again(bench: Any) -> None:
    env, board = moving(bench)
    torn = iter(range(10**6))
    board.garble = lambda data: data[:9] + b"\n" if data and next(torn) % 2 == 0 else data
    with pytest.warns(UserWarning, match="the policy is too slow, the computer busy, or the line bad"):
        reasons = {env.step(FULL)[4]["stop_reason"] for _ in range(20)}
    assert reasons == {""}
    assert board.bad >= 10


def test_a_lost_drive_does_not_go_unseen(bench: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Drives are not answered; one that is lost acts a step later, and three of them trip the watchdog."""
    env, board = moving(bench)
    send = board.send
    monkeypatch.setattr(board, "send", lambda data: None if data.startswith(b"D") else send(data))
    assert steps(env)["stop_reason"] == "watchdog"


# --- logs -------------------------------------------------------------------------------------------------------------


def test_every_run_is_a_driven_log_that_is_written_as_it_goes(bench: Any, tmp_path: Path) -> None:
    env = bench()
    _, info = env.reset(seed=0)
    assert info["log"] == str(tmp_path / "log-run1.csv") == str(env.unwrapped.log)
    source = np.random.default_rng(0)
    sent, seen = [], [info["angle"]]
    for _ in range(60):
        action = source.uniform(-1, 1, 1).astype(np.float32)
        *_, info = env.step(action)
        sent.append(round(1000 * float(action[0])) / 1000)
        seen.append(info["angle"])
    log = DrivenLog.read(info_path := env.unwrapped.log)  # while the run goes on
    assert log.kind == "action"
    assert log.drive.tolist() == sent
    assert log.angle == pytest.approx(np.array(seen[:-1]), abs=1e-9)
    assert np.diff(log.time) == pytest.approx(0.02, abs=1e-6)
    env.reset()
    assert len(DrivenLog.read(info_path).time) == 61
    assert env.unwrapped.log == tmp_path / "log-run2.csv"


def test_a_log_without_a_place_is_in_a_folder_for_temporary_files(bench: Any) -> None:
    env = bench(log=None)
    _, info = env.reset()
    assert Path(info["log"]).is_file()
    env.reset()
    assert Path(info["log"]).with_name("bench-run2.csv").is_file()


# --- refusals ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("keywords", "said"), [
    ({"dt": 0.1}, "dt must be from 0.001 to 0.05 s on a bench, not 0.1 s, so that its watchdog stops the motor"),
    ({"dt": 0.0005}, "dt must be from 0.001"), ({"scene": "vacuum"}, "needs gravity and a motor to be a bench"),
    ({"randomize": {"length": (0.3, 0.4)}}, "randomize draws parameters, but a bench has those that it has"),
    ({"diagnostics": ("error",)}, "of a simulation, and not of a bench"),
    ({"confirm": False}, "confirm must be True, None or a function of the question, not False"),
    ({"device": "virtuel"}, "There is no device 'virtuel'; did you mean virtual"),
    ({"device": 3}, "device must be an address, as virtual"), ({"device": "serial"}, "serial needs the name of a port"),
    ({"turn_limit": 0.0}, "turn_limit"), ({"action_delay": 0.02}, "action_delay cannot be chosen beside a device"),
    ({"device": "serial:/dev/ttyNONE", "sensor": {"noise": 0.1}}, "sensor cannot be chosen, as a real bench has its"),
])
def test_what_a_bench_cannot_be_is_refused(bench: Any, keywords: dict[str, Any], said: str) -> None:
    with pytest.raises(SceneError, match=said):
        bench(**keywords)


def test_a_bench_is_not_copied(bench: Any) -> None:
    import copy

    env = bench().unwrapped
    for call in (lambda: copy.deepcopy(env), env.get_state, lambda: env.set_state({})):
        with pytest.raises(SceneError, match="bench"):
            call()


def test_steps_before_the_first_reset_are_refused(bench: Any) -> None:
    with pytest.raises(gym.error.ResetNeeded):
        bench().step(FULL)


def test_a_serial_port_that_is_not_there_is_named() -> None:
    with pytest.raises(DeviceError, match="serial: there is no port /dev/ttyNONE"):
        device_at("serial:/dev/ttyNONE").open(0.06)


def test_time_of_a_run_begins_with_its_first_action(bench: Any) -> None:
    env = bench()
    env.reset()
    board = env.unwrapped.device
    board.wait(board.clock + 7.0)  # a policy that is loaded, with the motor off and no watchdog running
    infos = [env.step(FULL)[4] for _ in range(5)]
    assert [info["time"] for info in infos] == pytest.approx([0.02, 0.04, 0.06, 0.08, 0.10], abs=0.0011)
    assert infos[-1]["missed"] == 0
    assert all(late - early == pytest.approx(0.02, abs=0.0011) for early, late in pairwise(i["time"] for i in infos))
