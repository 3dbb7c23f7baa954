"""Sources: the virtual pendulum beside closed forms, recordings played again, datagrams, and addresses."""

from __future__ import annotations

import json
import math
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bench_clock import BenchClock
from virtual_swings import MASS, even, recorded, swing

from pendulum_env import SCENES, Recording, fit, lab, rollout
from pendulum_env.bench import SOURCES, Chunk, Source, SourceError, acquire
from pendulum_env.bench.source import NOTHING
from pendulum_env.bench.sources import source_at
from pendulum_env.bench.sources.replay import Replay
from pendulum_env.bench.sources.udp import Udp
from pendulum_env.bench.sources.virtual import Virtual
from pendulum_env.lab.simulated import FILE, true_scene
from pendulum_env.physics.exact import pendulum

BARE: dict[str, Any] = {"noise": 0.0, "quantum": 0.0}


def read(source: Source, until: float) -> tuple[Any, Any]:
    """Read an open source up to a time of its own clock; return times and readings."""
    chunks = []
    while not chunks or not len(chunks[-1].time) or chunks[-1].time[-1] < until - 1e-9:
        chunk = source.read(0.1)
        if chunk is None:
            break
        assert chunk.time is not None
        chunks.append(chunk)
    return np.concatenate([c.time for c in chunks]), np.concatenate([c.values[:, 0] for c in chunks])


def test_the_virtual_pendulum_swings_as_jacobis_functions_say(bench_clock: BenchClock) -> None:
    """Held for a second at 60 degrees, then a free swing without losses, at even times, whatever the reads."""
    source = Virtual("vacuum", angle=1.0, **BARE)
    source.open()
    bench_clock.time += 0.37
    times, angles = read(source, 8.0)
    np.testing.assert_allclose(times, np.arange(len(times)) / 100.0, atol=1e-12)
    free = times >= 1.0
    true = pendulum(times[free] - 1.0, 1.0, 0.0, SCENES["vacuum"].omega0)[0]
    np.testing.assert_allclose(np.radians(angles[~free]), 1.0, rtol=1e-12)
    np.testing.assert_allclose(np.radians(angles[free]), true, atol=1e-7)  # rk4 in steps of at most 5 ms


@pytest.mark.slow
@pytest.mark.parametrize(("scene", "integrator"), [
    ("driven", "adams_bashforth4"), *(pytest.param(*more, marks=pytest.mark.slow) for more in (
        ("driven", "forward_euler"), ("lab", "forward_euler"), ("lab", "adams_bashforth4")))])
def test_reading_in_parts_is_one_motion(scene: str, integrator: str, bench_clock: BenchClock) -> None:
    """The drive's phase and a method's history go on from read to read."""
    source = Virtual(scene, integrator, angle=0.3, wait=0.0, **BARE)
    source.open()
    times, angles = read(source, 5.0)
    step = min(0.005, SCENES[scene].run.dt)
    steps = math.ceil(0.01 / step - 1e-9)
    whole = rollout(scene, integrator=integrator, angle=0.3, velocity=0.0, duration=times[-1], dt=0.01 / steps,
                    every=steps, diagnostics=(), warn=False)
    np.testing.assert_array_equal(np.radians(angles), np.radians(np.degrees(whole.angle)))


@pytest.mark.slow
def test_lift_and_let_go(bench_clock: BenchClock) -> None:
    source = Virtual("textbook", wait=None, angle=0.0, **BARE)
    source.open()
    assert np.abs(read(source, 2.0)[1]).max() == 0.0
    source.lift(-0.25)
    start, held = read(source, 3.0)
    np.testing.assert_allclose(np.radians(held), -0.25)
    source.release()
    times, angles = read(source, 6.0)
    since = times - times[0]
    assert math.isclose(times[0], start[-1] + 0.01, abs_tol=1e-9)
    np.testing.assert_allclose(np.radians(angles), -0.25 * np.cos(SCENES["textbook"].omega0 * since), atol=1e-8)
    source.release()  # of a bob that is free already: it swings on
    more = read(source, 7.0)
    np.testing.assert_allclose(np.radians(more[1]), -0.25 * np.cos(SCENES["textbook"].omega0 * (more[0] - times[0])),
                               atol=1e-8)
    source.lift(0.1)
    assert np.radians(read(source, 7.1)[1])[-1] == pytest.approx(0.1)


@pytest.mark.slow
def test_the_virtual_sensor_rounds_and_scatters_as_it_says(bench_clock: BenchClock) -> None:
    source = Virtual(wait=None, angle=0.2, rate=1000.0, quantum=1e-3, noise=0.01)
    source.open()
    angles = np.radians(read(source, 20.0)[1])
    np.testing.assert_allclose(angles / 1e-3, np.round(angles / 1e-3), atol=1e-9)
    assert math.isclose(float(angles.std()), 0.01, rel_tol=0.03)
    assert math.isclose(float(angles.mean()), 0.2, abs_tol=4.0 * 0.01 / math.sqrt(20_000))


@pytest.mark.slow
def test_readings_come_when_they_are_due() -> None:
    """In real time: a read ends with the first reading, or after its timeout."""
    source = Virtual(rate=20.0, wait=None)
    source.open()
    source.read(0.2)
    began, count = time.monotonic(), 0
    while time.monotonic() - began < 0.5:
        chunk = source.read(0.1)
        count += len(chunk.values)
    assert 9 <= count <= 11
    source.close()


@pytest.mark.slow
def test_a_motion_that_leaves_the_finite_range_ends_by_a_sentence(bench_clock: BenchClock) -> None:
    source = Virtual("overdamped", "forward_euler", wait=0.0, rate=1.0)
    source.__dict__["_bob"].clear()
    source.open()
    source.__dict__["_bob"]["steps"] = 1  # far too long a step
    with pytest.raises(SourceError, match="choose another integrator"):
        read(source, 2000.0)


def test_settings_are_the_repr_and_nothing_else() -> None:
    source = Virtual(angle=0.1)
    source.open()
    assert repr(source) == "Virtual(angle=0.1)"
    assert repr(source_at("udp:5005", {"columns": "angle=1"})) == "Udp(columns_of='angle=1', port='5005')"


@pytest.mark.parametrize("speed", [1.0, 4.0])
def test_a_recording_is_played_at_its_speed(speed: float, bench_clock: BenchClock) -> None:
    whole = lab.simulated_recording()
    source = Replay(str(FILE), speed)
    source.open()
    began, chunks = bench_clock.time, []
    while (chunk := source.read()) is not None:
        chunks.append(chunk)
        if len(chunk.values):
            assert chunk.time is not None
            due = (bench_clock.time - began) * speed
            assert due - 0.01 * speed < chunk.time[-1] - whole.time[0] <= due
    np.testing.assert_array_equal(np.concatenate([c.time for c in chunks if c.time is not None]), whole.time)
    np.testing.assert_allclose(np.radians(np.concatenate([c.values[:, 0] for c in chunks])), whole.angle, atol=1e-15)


def test_a_gyroscopes_recording_is_played_as_angular_velocity(tmp_path: Path, bench_clock: BenchClock) -> None:
    at = 0.01 * np.arange(1500)
    rate = -1.5 * np.sin(5.0 * at)
    path = tmp_path / "gyro.csv"
    path.write_text("Time (s),Gyroscope z (rad/s)\n" + "\n".join(f"{t},{w}" for t, w in zip(at, rate, strict=True)))
    played = acquire(f"replay:{path}", speed=50.0)
    assert played.rate is not None
    np.testing.assert_allclose(np.abs(played.rate), np.abs(rate), atol=1e-8)


# --- datagrams --------------------------------------------------------------------------------------------------------


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


def sent(port: int, lines: list[str], pause: float = 0.0, sender: str = "127.0.0.1") -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind((sender, 0))
        for line in lines:
            one.sendto(line.encode(), ("127.0.0.1", port))
            if pause:
                time.sleep(pause)


FORMS: dict[str, Callable[[float, float], str]] = {
    "json": lambda t, a: json.dumps({"time": t, "angle": a}), "lines": lambda t, a: f"{t:.3f};{a:.4f}\n",
}


@pytest.mark.parametrize("form", FORMS)
def test_datagrams_of_this_machine(form: str) -> None:
    port = free_port()
    source = Udp(port=port, time_unit="s")
    source.open()
    try:
        times = 0.01 * np.arange(300)
        sent(port, [FORMS[form](t, math.sin(t)) for t in times])
        found, angles = read(source, times[-1])
        np.testing.assert_allclose(found, times, atol=1e-12)
        np.testing.assert_allclose(angles, np.sin(times), atol=1e-4)
        sent(port, [FORMS[form](3.1, 7.0)] * 3, sender="127.0.0.2")
        sent(port, [FORMS[form](3.2, 0.5)])  # from another port than the others, as of a script for each line
        chunk = source.read(0.2)
        assert chunk.time is not None
        assert (chunk.time.tolist(), chunk.values.tolist()) == ([3.2], [[0.5]])
        assert source.notes[-2:] == ("sender: 127.0.0.1",
                                     "left out: what 127.0.0.2 sends, as 127.0.0.1 was first")
    finally:
        source.close()
        source.close()


def test_a_port_that_cannot_be_used_is_refused_with_the_remedy() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        with pytest.raises(SourceError, match="used by another program; end it, or choose another port"):
            Udp(port=other.getsockname()[1]).open()
    with pytest.raises(SourceError, match=r"no address of this machine; 0\.0\.0\.0"):
        Udp(port=free_port(), bind="203.0.113.7").open()
    with pytest.raises(SourceError, match="--bind takes an address"):
        Udp(port=free_port(), bind="not an address").open()


def test_silence_ends_with_a_sentence(bench_clock: BenchClock) -> None:
    class Silent(Virtual):
        name = "silent"

        def read(self, timeout: float = 0.1) -> Chunk:
            bench_clock.time += timeout
            return NOTHING

    with pytest.raises(SourceError, match="no sample came from silent in 10 s; check that it is switched on"):
        acquire(Silent(), 5.0)


# --- addresses --------------------------------------------------------------------------------------------------------

REFUSED = {
    "udb:5": "There is no source 'udb:5'; did you mean udp?",
    "": "There is no source ''; there are virtual",
    "udp": "udp needs an address, as udp:PORT",
    "udp:": "udp needs an address, as udp:PORT",
    "replay:": "replay needs an address, as replay:FILE",
    "virtual:lab": "virtual takes no address, so leave out ':lab'",
    "stdin:x": "stdin takes no address",
}


@pytest.mark.parametrize("address", REFUSED)
def test_an_address_that_is_none_is_refused(address: str) -> None:
    with pytest.raises(SourceError, match=REFUSED[address].replace("(", r"\(").replace("?", r"\?")):
        source_at(address)


OPEN_REFUSED = {
    "udp:x": "needs the number of a port", "udp:0": "needs the number of a port", "udp:65536": "number of a port",
    "replay:nowhere.csv": "nowhere.csv",
}


@pytest.mark.parametrize("address", OPEN_REFUSED)
def test_an_address_where_nothing_is_is_refused(address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SourceError, match=OPEN_REFUSED[address]):
        source_at(address).open()


def test_a_file_or_a_setting_that_is_misplaced_is_named(tmp_path: Path) -> None:
    path = tmp_path / "swing.txt"
    path.write_text("1")
    with pytest.raises(SourceError, match="is a file; replay:"):
        source_at(str(path))
    with pytest.raises(SourceError, match="virtual has no option --speed; did you mean seed"):
        source_at("virtual", {"speed": 2.0})
    with pytest.raises(SourceError, match="replay has no option --time-unit; there are speed"):
        source_at("replay:x", {"time_unit": "s"})
    for option, value in (("rate", 0.0), ("angle", "high"), ("wait", -1.0), ("seed", 0.5), ("noise", math.nan)):
        with pytest.raises(SourceError, match=option):
            source_at("virtual", {option: value})
    with pytest.raises(SourceError, match="did you mean deg"):
        source_at("udp:5005", {"unit": "degree"})


@pytest.mark.parametrize(("given", "words"), [
    ({"duration": 0.0}, "duration"), ({"duration": "ten"}, "duration"), ({"sign": 2}, "sign must be 1 or -1"),
    ({"source": 7}, "source must be an address"), ({"zero": "yes"}, "zero must be True or False"),
    ({"force": 1}, "force must be"), ({"source": Virtual(), "rate": 5.0}, "given to the source itself"),
])
def test_arguments_are_checked_before_anything_is_opened(given: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        acquire(**given)


def test_every_source_says_what_a_list_needs() -> None:
    for name, kind in SOURCES.items():
        assert kind.name == name
        assert 0 < len(kind.about) <= 100
        assert kind.tested
        assert bool(kind.place) is bool(kind.address)
        assert kind.extra.isidentifier() or not kind.extra


# --- what was acquired fits the scene behind it -----------------------------------------------------------------------


SWUNG = even(40.0, 50.0)
PLAIN = {"length": 0.5, "gamma": 0.05, "c": 0.02}
NAMES = {"gamma": "linear_drag.gamma", "c": "quadratic_drag.c"}


def fits(recording: Recording, truth: dict[str, float], mass: float, **known: float) -> None:
    """AssertionError unless a fit finds every number within four of its standard errors, which are small."""
    found = fit(recording, "linear+quadratic", mass=mass, **known)
    for name, value in truth.items():
        own = found.parameters[NAMES.get(name, name)]
        assert abs(own.value - value) < 4.0 * own.error, (name, own)
        assert own.error < 0.2 * value


def lines() -> list[str]:
    """Lines of a swing with friction, integrated by SciPy, as a device with steps of 0.09 degrees prints it, in ms."""
    angles = np.degrees(recorded(SWUNG, swing(SWUNG, 0.6, **PLAIN), noise=4e-4, quantum=math.radians(0.09)).angle)
    return ["Time (ms),Angle (deg)\n", *(f"{1e3 * t:.1f},{a:.4f}\n" for t, a in zip(SWUNG, angles, strict=True))]


@pytest.mark.slow
def test_the_virtual_sensors_run_fits_its_scene(bench_clock: BenchClock, tmp_path: Path) -> None:
    scene = true_scene()
    recording = acquire("virtual", 40.0, scene=scene, angle=0.6, out=tmp_path / "swing.csv")
    assert len(recording.time) == 4001
    fits(recording, {"length": scene.body.reach, "gamma": 0.03, "c": scene.coefficients["quadratic_drag_rate"]},
         scene.body.mass, radius=scene.body.radius)


@pytest.mark.slow
def test_a_replayed_run_fits_its_scene(bench_clock: BenchClock, tmp_path: Path) -> None:
    path = tmp_path / "swing.csv"
    path.write_text("".join(lines()))
    fits(acquire(f"replay:{path}"), PLAIN, MASS)


@pytest.mark.slow
def test_datagrams_fit_the_scene_behind_them(tmp_path: Path) -> None:
    """Four times as fast as they were measured; the times are those in the lines."""
    port = free_port()
    sender = threading.Thread(target=lambda: (time.sleep(1.0), sent(port, lines()[1:], 0.005)))
    sender.start()
    recording = acquire(f"udp:{port}", SWUNG[-1], time_unit="ms")
    sender.join()
    assert len(recording.time) == len(SWUNG)
    fits(recording, PLAIN, MASS)


@pytest.mark.slow
def test_lines_of_a_pipe_fit_the_scene_behind_them(tmp_path: Path) -> None:
    """Through the command, in a process of its own."""
    path = tmp_path / "swing.csv"
    done = subprocess.run([sys.executable, "-m", "pendulum_env", "acquire", "--from", "stdin", "--headless", "--out",
                           str(path)], input="".join(lines()), capture_output=True, text=True, check=True)
    assert f"{len(SWUNG)} samples in 40 s, none lost" in done.stdout
    fits(Recording.read(path), PLAIN, MASS)
