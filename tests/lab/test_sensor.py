"""Test the virtual sensor on motions of known closed form, its files, and measurements on its recordings."""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pendulum_env import Rollout, SceneError, VirtualSensor, rollout
from pendulum_env.common.replacing import OutputError
from pendulum_env.controllers import POLICIES
from pendulum_env.lab import (
    Recording,
    RecordingError,
    crossings,
    period,
    simulated,
    simulated_recording,
    turning_points,
)
from pendulum_env.lab.sensor import text_of_recording

pytestmark = pytest.mark.usefixtures("all_interpreted")

Array = np.ndarray[Any, Any]


@dataclass(frozen=True)
class Swing:
    """A cosine swing with its exact velocity."""

    time: Array
    angle: Array
    velocity: Array


def swing(duration: float = 30.0, step: float = 0.01, amplitude: float = 0.5, begin: float = 0.0) -> Swing:
    time = np.arange(round(duration / step) + 1) * step
    return Swing(time + begin, amplitude * np.cos(4.0 * time), -4.0 * amplitude * np.sin(4.0 * time))


def cosine(time: Array, amplitude: float = 0.5) -> Array:
    return np.asarray(amplitude * np.cos(4.0 * time))


IDEAL = VirtualSensor(quantum=0.0, zero="bottom")


def test_an_ideal_sensor_reads_the_motion_itself() -> None:
    """Cubic interpolation is off by at most h^4/384 times the fourth derivative (Birkhoff & Priver 1967)."""
    for begin in (0.0, 7.0):
        found = VirtualSensor(quantum=0.0, zero="bottom", jitter=0.02).record(swing(begin=begin), seed=3)
        bound = 0.01**4 / 384 * 0.5 * 4.0**4
        assert 0.5 * bound < np.abs(found.angle - cosine(found.time)).max() < 1.05 * bound
    assert found.notes == ("simulated: not a recording of a real pendulum",)


@pytest.mark.parametrize("zero", ["at_start", "bottom"])
def test_readings_are_whole_quanta_of_the_angle_from_zero(zero: str) -> None:
    sensor = VirtualSensor(quantum=0.01, zero=zero)
    found = sensor.record(swing())
    off = 0.5 if zero == "at_start" else 0.0
    counts = found.angle / 0.01
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-9)
    error = found.angle + off - cosine(found.time)
    assert np.abs(error).max() <= 0.005 + 1e-9
    assert error.std() == pytest.approx(0.01 / math.sqrt(12), rel=0.05)
    assert found.quantum == pytest.approx(0.01)


def test_noise_and_jitter_are_as_large_as_told_and_repeat_with_the_seed() -> None:
    sensor = VirtualSensor(quantum=0.0, rate=100.0, jitter=0.004, noise=0.003, zero="bottom")
    found = sensor.record(swing(60.0), seed=5)
    off = found.time - np.arange(len(found.time)) / 100.0
    assert np.abs(off).max() <= 0.004
    assert off[1:-1].std() == pytest.approx(0.004 / math.sqrt(3), rel=0.03)
    assert (found.angle - cosine(found.time)).std() == pytest.approx(0.003, rel=0.03)
    assert found.noise == pytest.approx(0.003, rel=0.05)
    again, other = sensor.record(swing(60.0), seed=5), sensor.record(swing(60.0), seed=6)
    np.testing.assert_array_equal(again.time, found.time)
    np.testing.assert_array_equal(again.angle, found.angle)
    assert not np.array_equal(other.angle, found.angle)


def test_stamps_increase_at_the_widest_jitter() -> None:
    sensor = VirtualSensor(rate=20.0, jitter=math.nextafter(0.025, 0.0))
    for seed in range(50):
        found = sensor.record(swing(5.0), seed)
        assert (np.diff(found.time) > 0).all()
        assert found.time[0] == 0.0
        assert found.time[-1] <= 5.0
        assert len(found.time) == 101


def test_the_hand_hangs_pulls_and_holds() -> None:
    found = IDEAL.record(swing(), hand=6.0)
    assert (found.angle[found.time <= 2.0] == 0.0).all()
    pulled = found.angle[(found.time >= 2.0) & (found.time <= 4.0)]
    assert (np.diff(pulled) > 0).all()
    assert (found.angle[(found.time >= 4.0) & (found.time < 6.0)] == 0.5).all()
    free = found.time >= 6.0
    np.testing.assert_allclose(found.angle[free], cosine(found.time[free] - 6.0), atol=1e-8)
    assert found.time[-1] == pytest.approx(36.0)


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "half a step": ({"jitter": 0.025},
                    "jitter must be below half a step, 0.025 s at 20 Hz, to keep readings in order, not 0.02"),
    "jitter of a fast one": ({"jitter": 0.001, "rate": 1000}, "jitter must be below half a step, 0.0005 s at 1000 Hz"),
    "negative jitter": ({"jitter": -0.001}, "jitter must be a finite number of at least 0 [s], not -0.001."),
    "no rate": ({"rate": 0.0}, "rate must be a finite number above 0 [Hz], not 0.0."),
    "negative quantum": ({"quantum": -1}, "quantum must be a finite number of at least 0 [rad], not -1.0."),
    "noise": ({"noise": math.nan}, "noise must be a finite number of at least 0 [rad], not nan."),
    "zero": ({"zero": "start"}, "There is no zero 'start'; did you mean at_start?"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_sensor_that_cannot_be_is_refused(case: str) -> None:
    options, message = REFUSED[case]
    with pytest.raises(SceneError) as raised:
        VirtualSensor(**options)
    assert str(raised.value).startswith(message)


def test_what_is_no_single_motion_is_refused() -> None:
    batch = rollout("vacuum", angle=[0.1, 0.2, 0.3], duration=1.0)
    with pytest.raises(RecordingError, match="a sensor records one motion, got a batch of 3: roll out a single start"):
        IDEAL.record(batch)
    whole = swing(2.0)
    for wrong, message in (
        (3.0, "a motion must have time, angle and velocity, like a rollout, got 3.0"),
        (Swing(whole.time, whole.angle[1:], whole.velocity), "arrays of one length"),
        (Swing(whole.time[:1], whole.angle[:1], whole.velocity[:1]), "arrays of one length from 2"),
        (Swing(whole.time[::-1], whole.angle, whole.velocity), "at times that increase"),
        (Swing(whole.time, whole.angle * math.nan, whole.velocity), "finite values"),
        (swing(0.05), "0.05 s at 20 Hz must give 3 to 100 million readings"),
    ):
        with pytest.raises(RecordingError, match=message):
            IDEAL.record(wrong)  # type: ignore[arg-type]
    for options, name in (({"seed": -1}, "seed"), ({"seed": 0.5}, "seed"), ({"hand": -1.0}, "hand")):
        with pytest.raises(SceneError, match=f"{name} must be"):
            IDEAL.record(whole, **options)  # type: ignore[arg-type]


SENSORS = {
    "sensor": VirtualSensor(jitter=0.02, noise=0.001),
    "csv": VirtualSensor(quantum=0.0, rate=50.0, jitter=0.009, noise=0.001, zero="bottom"),
    "encoder": VirtualSensor(quantum=math.tau / 1200, rate=100.0),
}


@pytest.mark.parametrize("form", SENSORS)
@pytest.mark.parametrize("amplitude", [0.05, 2.0])
def test_a_file_reads_back_to_the_printed_digits(tmp_path: Path, form: str, amplitude: float) -> None:
    """The comments at the head of the file mention "rad" and "rate" of other quantities, which must not mislead the
    reader."""
    motion = rollout("lab", angle=amplitude, duration=10.0, warn=False)
    sensor, path = SENSORS[form], tmp_path / "swing.txt"
    sensor.write(path, motion, form, seed=2, hand=3.0)
    made, found = sensor.record(motion, seed=2, hand=3.0), Recording.read(path)
    np.testing.assert_allclose(found.time, made.time, rtol=0, atol=0.5001e-6)
    np.testing.assert_allclose(found.angle, made.angle, rtol=0.5e-9, atol=1e-15)
    if sensor.quantum:
        counts = made.angle / sensor.quantum
        np.testing.assert_array_equal(np.round(found.angle / sensor.quantum), np.round(counts))
    text = path.read_text()
    assert text.startswith("# simulated: not a recording of a real pendulum\n# Software: lab-pendulum ")
    for line in (f"# sensor: {sensor!r}", f"# form: {form}", "# seed: 2", "# hand: 3.0", "# integrator: rk4"):
        assert f"\n{line}\n" in text
    assert '\n# scene: {"name": "lab", ' in text


def test_files_that_cannot_be_written(tmp_path: Path) -> None:
    path = tmp_path / "swing.txt"
    with pytest.raises(SceneError, match="jitter must be 0 for the form 'encoder', which has no time stamps"):
        VirtualSensor(jitter=0.01).write(path, swing(), "encoder")
    with pytest.raises(SceneError, match="There is no form 'encodr'; did you mean encoder"):
        VirtualSensor().write(path, swing(), "encodr")
    with pytest.raises(SceneError, match="path must be a path"):
        VirtualSensor().write("", swing())
    with pytest.raises(OutputError):
        VirtualSensor().write(tmp_path / "none" / "swing.txt", swing())
    assert not list(tmp_path.iterdir())


# --- recordings of real kinds, made with a known truth ---------------------------------------------------------------


def truth(motion: Rollout) -> tuple[Array, Array, Array]:
    """Return times and angles of a rollout's turning points and times of its upward crossings, by cubic interpolation.
    """
    from scipy.interpolate import CubicHermiteSpline, CubicSpline

    speed = CubicSpline(motion.time, motion.velocity)
    moving = motion.time[np.abs(motion.velocity) > 1e-9][-1]
    turns = speed.roots(extrapolate=False)
    curve = CubicHermiteSpline(motion.time, motion.angle, motion.velocity)
    zeros = curve.roots(extrapolate=False)
    turns = turns[(turns > 0.1) & (turns <= moving)]
    return turns, curve(turns), zeros[(speed(zeros) > 0) & (zeros <= moving)]


def coulomb(duration: float) -> Rollout:
    damping = {"linear": {"gamma": 0.012}, "coulomb": {"friction_torque": 2.45e-4}}
    start = {"angle": math.radians(94.0), "duration": duration, "dt": 0.01}
    return rollout("vacuum", length=0.268, mass=0.05, damping=damping, **start)  # type: ignore[arg-type]


KINDS: dict[str, tuple[VirtualSensor, str, float]] = {
    "0.25 degree, uneven, 70 s from 3 degrees": (VirtualSensor(jitter=0.015), "sensor", 70.0),
    "encoder, 137 s from 94 degrees to rest": (VirtualSensor(quantum=math.tau / 1200, rate=100.0), "encoder", 137.0),
    "48000 points at uneven 1.7 ms": (
        VirtualSensor(quantum=math.tau / 4096, rate=1 / 0.0017, jitter=0.0005, noise=0.0005), "csv", 81.6),
}


def motion_of(kind: str) -> Rollout:
    duration = KINDS[kind][2]
    if "rest" in kind:
        return coulomb(duration)
    angle = math.radians(3.0 if "3 deg" in kind else 60.0)
    return rollout("lab", angle=angle, duration=duration, dt=0.01, warn=False)


@pytest.fixture(scope="module", params=KINDS)
def kind(request: pytest.FixtureRequest, all_interpreted: None) -> tuple[str, Rollout]:
    return request.param, motion_of(request.param)


@pytest.mark.quick("0.25 degree, uneven, 70 s from 3 degrees-5.0")
@pytest.mark.parametrize("hand", [pytest.param(0.0, marks=pytest.mark.slow), 5.0])
def test_recordings_of_real_kinds_are_measured_right(tmp_path: Path, kind: tuple[str, Rollout], hand: float) -> None:
    name, motion = kind
    sensor, form, duration = KINDS[name]
    path = tmp_path / "swing.txt"
    sensor.write(path, motion, form, seed=11, hand=hand)
    raw = Recording.read(path)
    assert len(raw.time) == math.floor((duration + hand) * sensor.rate * (1 + 1e-12)) + 1
    assert raw.quantum == pytest.approx(sensor.quantum, rel=1e-3)
    assert raw.noise == pytest.approx(math.hypot(sensor.quantum / math.sqrt(12), sensor.noise), rel=0.25)
    assert any(note.startswith("unit: deg, as the header says") for note in raw.notes)
    free = raw.released()
    done = free.centred()
    start = free.release or 0.0
    turn_time, turn_angle, upward = truth(motion)
    assert start == 0.0 if not hand else -0.05 < start - hand < turn_time[0] + 0.05

    zero = 0.0 if hand else -motion.angle[0]
    assert raw.angle[-1] - done.angle[-1] == pytest.approx(zero, abs=0.15 * sensor.quantum)

    points = turning_points(done)
    expected = turn_time + hand - start
    nearest = np.array([np.argmin(np.abs(expected - time)) for time in points.time])
    np.testing.assert_array_equal(np.diff(nearest), 1)
    missed = int(np.count_nonzero(expected > 0.1)) - len(points.time)
    assert 0 <= missed <= (4 if "rest" in name else 1)
    pull = (points.amplitude - np.abs(turn_angle[nearest])) / points.error
    assert 0.4 < math.sqrt(np.mean(pull**2)) < 1.3
    assert np.abs(pull).max() < 4.5

    measured = period(done)
    mine = crossings(done.time, done.angle, level=5 * done.noise)
    first = int(np.argmin(np.abs(upward + hand - start - mine[0])))
    last = first + len(mine) - 1
    assert measured.value == pytest.approx((upward[last] - upward[first]) / (len(mine) - 1), abs=3 * measured.error)
    assert measured.error < (5e-4 if "rest" in name else 2e-4)


@pytest.mark.slow
def test_the_encoder_comes_to_rest_after_125_cycles() -> None:
    motion = coulomb(137.0)
    moving = motion.time[np.abs(motion.velocity) > 1e-9]
    assert 130.0 < moving[-1] < 137.0
    assert len(truth(motion)[0]) == pytest.approx(250, abs=2)


# --- the recording that comes with the package -----------------------------------------------------------------------


RUN = {"angle": math.radians(35.0), "duration": 54.0, "dt": 0.005}
SHOWN = ("quantum", "rate", "jitter", "noise", "zero")
"""Fields of the sensor that the recipe in the file shows."""
SENSOR = VirtualSensor(quantum=math.radians(0.25), rate=20.0, jitter=0.004, noise=math.radians(0.05))
SEED = 1
HAND = 6.0


def simulated_text() -> str:
    """Return the text of the packaged recording's file, simulated anew from the settings above."""
    scene = simulated.true_scene()
    motion = rollout(scene, **RUN)  # type: ignore[arg-type]
    effects = ", ".join(effect.name for effect in scene.effects)
    known = {"length": scene.body.reach, **simulated.SCENE, "c": scene.coefficients["quadratic_drag_rate"]}
    run, sensor = keywords(RUN), keywords({name: getattr(SENSOR, name) for name in SHOWN})
    facts = {"scene": f"lab with {effects}: {', '.join(f'{name} {value:.6g}' for name, value in known.items())}",
             "motion": f"rollout(true_scene(), {run})",
             "sensor": f"VirtualSensor({sensor}).write(path, motion, seed={SEED}, hand={HAND})"}
    return text_of_recording(SENSOR.record(motion, SEED, HAND), "sensor", SENSOR.rate, facts)


def keywords(values: Mapping[str, object]) -> str:
    """Return named values as the text of a call's keyword arguments, such as ``angle=0.6, dt=0.005``."""
    return ", ".join(f"{name}={value!r}" for name, value in values.items())


def test_the_shipped_recording_is_what_its_recipe_makes() -> None:
    text = simulated.FILE.read_text(encoding="utf-8")
    assert simulated_text() == text
    assert text.startswith("# simulated: not a recording of a real pendulum\n")
    assert simulated.FILE.stat().st_size < 40_000


def test_the_shipped_recording_is_read_and_measured() -> None:
    found = simulated_recording()
    assert found.source == "simulated_lab.txt"
    assert found.time[-1] == pytest.approx(60.0, abs=0.005)
    assert found.quantum == pytest.approx(math.radians(0.25), rel=1e-6)
    free = found.released().centred()
    assert 6.0 < free.release < 6.0 + 0.7  # type: ignore[operator]
    small = simulated.true_scene().omega0
    first = period(free, n=3)
    amplitude = turning_points(free).amplitude[:6]
    assert first.value == pytest.approx(math.tau / small * (1 + np.mean(amplitude**2) / 16), rel=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("target", ["wheel", "sdist"])
def test_what_is_published_carries_it(tmp_path: Path, target: str) -> None:
    builders = pytest.importorskip(f"hatchling.builders.{target}")
    root = Path(__file__).parents[2]
    builder = {"wheel": "WheelBuilder", "sdist": "SdistBuilder"}[target]
    (made,) = getattr(builders, builder)(str(root)).build(directory=str(tmp_path), versions=["standard"])
    listing = [sys.executable, "-m", "zipfile" if target == "wheel" else "tarfile", "-l", made]
    names = subprocess.run(listing, capture_output=True, text=True, check=True).stdout
    assert "pendulum_env/lab/data/simulated_lab.txt" in names
    assert all(f"pendulum_env/controllers/policies/{name}.npz" in names for name in POLICIES)
