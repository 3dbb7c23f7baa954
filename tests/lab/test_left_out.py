"""Readings that are left out, or count less: after a time, below an amplitude, beside a jump of the zero, far off."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bench_files import written
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from pendulum_env import VirtualSensor, rollout
from pendulum_env.lab import Recording, RecordingError, fit, measure
from pendulum_env.lab.fitting.shooting import CORNER
from pendulum_env.physics.units import SceneError

Array = NDArray[np.float64]
LENGTH, GAMMA, START = 0.5, 0.08, 0.4


def angles(time: Array, start: float = START, length: float = LENGTH, gamma: float = GAMMA) -> Array:
    """The angle [rad] of a pendulum with linear drag, released at rest, by scipy."""
    run = solve_ivp(lambda _t, y: [y[1], -9.81 / length * math.sin(y[0]) - gamma * y[1]], (0.0, float(time[-1])),
                    [start, 0.0], method="DOP853", t_eval=time, rtol=1e-9, atol=1e-11)
    return np.asarray(run.y[0])


def swing(seconds: float = 30.0, rate: float = 50.0, noise: float = 2e-3, seed: int = 0) -> tuple[Array, Array]:
    """Times [s] and noisy angles [rad]."""
    time = np.arange(round(seconds * rate)) / rate
    return time, angles(time) + noise * np.random.default_rng(seed).standard_normal(len(time))


def test_parts_are_left_out_by_time() -> None:
    recording = Recording(*swing(), "swing")
    part = recording.kept(until=20.0, drop=["12.5:13.1", "15:15.5"])
    assert part.time[-1] == 20.0
    assert not np.any(((part.time >= 12.5) & (part.time <= 13.1)) | ((part.time >= 15.0) & (part.time <= 15.5)))
    assert len(part.time) == 1001 - 31 - 26
    for drop in ("12.5:13.1,15:15.5", ((12.5, 13.1), (15.0, 15.5)), ("12.5:13.1", (15, 15.5))):
        np.testing.assert_array_equal(recording.kept(until=20.0, drop=drop).time, part.time)
    np.testing.assert_array_equal(recording.kept(drop=(12.5, 13.1)).time, recording.kept(drop="12.5:13.1").time)
    assert recording.kept() is recording


@pytest.mark.slow
def test_swings_below_a_share_of_the_first_are_left_out() -> None:
    """The amplitude is 0.4 exp(-0.04 t): below 50 % of the first after 17.3 s, by the small-angle decay."""
    recording = Recording(*swing(), "swing")
    for above in (0.5, "50%", " 50 %"):
        part = recording.kept(above=above)
        assert part.time[-1] == pytest.approx(math.log(2.0) / (0.5 * GAMMA), abs=0.75)  # a half swing
        assert "below 50 % of the first" in part.notes[-1]
    assert len(recording.kept(above="1%").time) == len(recording.time)
    sheet = measure(recording, above=0.5)
    assert sheet.recording.time[-1] == pytest.approx(part.time[-1], abs=0.05)
    found = fit(recording, "linear", mass=1.0, above=0.5, until=25.0)
    assert found.recording.time[-1] == pytest.approx(part.time[-1], abs=0.05)
    assert found.parameters["length"].value == pytest.approx(LENGTH, rel=1e-4)


@pytest.mark.quick("options0", "options3")
@pytest.mark.parametrize("options", [
    {"above": 0.0}, {"above": 1.0}, {"above": "5 degrees"}, {"above": True}, {"drop": "13:12"}, {"drop": "x"},
    {"drop": (1.0,)}, {"drop": 3.0}, {"until": -1.0}, {"until": "late"}])
def test_parts_that_make_no_sense_are_refused(options: dict[str, Any]) -> None:
    recording = Recording(*swing(), "swing")
    for call in (recording.kept, lambda **given: measure(recording, **given),
                 lambda **given: fit(recording, "linear", **given)):
        with pytest.raises((RecordingError, SceneError), match="|".join(options)):
            call(**options)


# --- robust ----------------------------------------------------------------------------------------------------------


def spoilt(seed: int, share: float = 0.03, run: int = 0, seconds: float = 20.0) -> Recording:
    """A swing with some readings that are off by 20 degrees or so, and with a run of equal readings."""
    time, seen = swing(seconds, 30.0, seed=seed)
    source = np.random.default_rng([seed, 1])
    bad = source.random(len(time)) < share
    bad[:10] = False
    seen = seen + bad * 0.4 * source.standard_normal(len(time))
    if run:
        seen[200:200 + run] = 0.7
    return Recording(time, seen, "spoilt")


@pytest.mark.slow
def test_a_robust_fit_is_that_of_scipy_with_soft_l1() -> None:
    """Compare with scipy's soft L1 loss, with the corner and model of the fit, and scipy's own solver."""
    recording = spoilt(1, run=12)
    found = fit(recording, "linear", mass=1.0, robust=True)
    assert any("soft L1" in note for note in found.recording.notes)

    def misses(x: Array) -> Array:
        start, zero, length, gamma = x
        return np.asarray((angles(recording.time, start, length, gamma) + zero - recording.angle) / sigma)

    known = [found.parameters[name].value for name in ("angle", "zero", "length", "linear_drag.gamma")]
    sigma = 1.0
    sigma = 1.4826 * float(np.median(np.abs(misses(np.array(known)))))
    theirs = least_squares(misses, np.array(known) * 1.001, loss="soft_l1", f_scale=CORNER,
                           x_scale=[0.1, 0.01, 1e-3, 0.01], diff_step=1e-5).x
    errors = [found.parameters[name].error for name in ("angle", "zero", "length", "linear_drag.gamma")]
    # They fit no first velocity, which is 1.2 of its errors off 0 here and moves the length with it.
    np.testing.assert_array_less(np.abs(theirs - known), np.array(errors))
    for name, value in (("angle", START), ("length", LENGTH), ("linear_drag.gamma", GAMMA)):
        assert abs(found.parameters[name].value - value) < 4.0 * found.parameters[name].error
        assert found.parameters[name].error < 2e-3 * value + 1e-3
    with pytest.warns(UserWarning, match="readings are up to .* off"):
        plain = fit(recording, "linear", mass=1.0)
    assert plain.rms > 10.0 * found.rms


@pytest.mark.slow
@pytest.mark.usefixtures("no_remedies")
def test_intervals_of_robust_fits_hold() -> None:
    """Of 3 x 40 intervals at 95 %, 90 to 99 % hold, with 3 % of the readings far off."""
    inside = []
    for seed in range(40):
        found = fit(spoilt(seed, run=10 * (seed % 2)), "linear", mass=1.0, robust=True)
        for name, value in (("zero", 0.0), ("length", LENGTH), ("linear_drag.gamma", GAMMA)):
            low, high = found.interval(name)
            inside.append(low <= value <= high)
    assert 0.90 <= np.mean(inside) <= 0.99


@pytest.mark.slow
def test_a_robust_fit_knows_the_sensors_steps() -> None:
    swing = rollout("lab", angle=0.6, velocity=0.0, duration=20.0, dt=0.002)
    sensor = VirtualSensor(quantum=math.radians(0.25), rate=50.0, zero="bottom", noise=0.0005)
    recording = sensor.record(swing, seed=1)
    plain, robust = (fit(recording, "linear+quadratic", mass=0.04, radius=0.0107, robust=robust).sensor
                     for robust in (False, True))
    assert robust.quantum == plain.quantum == pytest.approx(sensor.quantum, rel=1e-3)


@pytest.mark.slow
def test_a_robust_fit_of_good_readings_is_the_usual_one() -> None:
    recording = Recording(*swing(20.0), "swing")
    plain, robust = (fit(recording, "linear", mass=1.0, robust=robust) for robust in (False, True))
    for name, one in plain.parameters.items():
        other = robust.parameters[name]
        assert abs(other.value - one.value) < 1.0 * one.error, name
        assert other.error == pytest.approx(one.error, rel=0.15), name
    with pytest.raises(SceneError, match="robust"):
        fit(recording, "linear", robust=1)  # type: ignore[arg-type]


# --- a zero that jumps -----------------------------------------------------------------------------------------------


def read(folder: Path, time: Array, angle: Array) -> Recording:
    """Return the recording that Recording.read makes of these angles [rad]."""
    path = folder / "swing.csv"
    path.write_text("t (s),angle (rad)\n" + "".join(f"{t:.4f},{x:.6f}\n" for t, x in zip(time, angle, strict=True)))
    return Recording.read(path)


def test_jumps_of_the_zero_are_found_and_subtracted(tmp_path: Path) -> None:
    time, seen = swing(40.0, 30.0)
    moved = read(tmp_path, time, seen + 0.14 * (time > 11.31) - 0.25 * (time > 27.0))
    said = [note for note in moved.notes if note.startswith("zero: a jump of ")]
    assert sorted(float(note.split()[4]) for note in said) == pytest.approx([-14.3, 8.02], abs=0.15)
    assert any("after 11.3 s" in note for note in said)
    np.testing.assert_allclose(moved.angle, seen, atol=2.5e-3)
    assert fit(moved, "linear", mass=1.0).grade.word == "usable"


def test_jumps_stay_on_request(tmp_path: Path) -> None:
    time, seen = swing(40.0, 30.0)
    path = tmp_path / "swing.csv"
    np.savetxt(path, np.stack([time, seen + 0.14 * (time > 11.31)], axis=1), header="t (s),angle (rad)", comments="",
               delimiter=",")
    left = Recording.read(path, jumps=False)
    assert not any(note.startswith("zero:") for note in left.notes)
    np.testing.assert_allclose(left.angle - seen, 0.14 * (time > 11.31), atol=1e-12)
    with pytest.raises(RecordingError, match="jumps must be True or False, got 'no'"):
        Recording.read(path, jumps="no")  # type: ignore[arg-type]


@pytest.mark.quick("start", "gap")
@pytest.mark.parametrize("what", ["nothing", "spike", "run", "start", "gap"])
def test_other_faults_are_no_jumps(what: str, tmp_path: Path) -> None:
    time, seen = swing(40.0, 30.0)
    if what == "spike":
        seen[500] += 0.5
    elif what == "run":
        seen[500:520] = 0.6
    elif what == "start":
        seen[:60] = 0.9
    elif what == "gap":
        time, seen = np.delete(time, slice(500, 580)), np.delete(seen, slice(500, 580))
    assert not any(note.startswith("zero:") for note in read(tmp_path, time, seen).notes)


# --- displacements and tracks ----------------------------------------------------------------------------------------


@pytest.mark.quick("ultrasonic distance")
@pytest.mark.parametrize("name", ["sideways position", "ultrasonic distance"])
def test_a_displacement_is_fitted_with_scale_and_zero_free(name: str, tmp_path: Path) -> None:
    path, truth = written(name, tmp_path)
    recording = Recording.read(path)
    assert recording.displaced
    found = fit(recording, "linear", mass=1.0)
    assert {"zero", "scale", "length"} <= {*found.names}
    length, angle = found.parameters["length"], found.parameters["angle"]
    assert abs(length.value - truth["length"]) < 3.0 * length.error
    assert abs(abs(angle.value) - truth["amplitude"]) < 3.0 * angle.error + 0.02 * truth["amplitude"]


@pytest.mark.slow
def test_the_radius_of_a_track_is_set_against_the_fitted_length(tmp_path: Path) -> None:
    from pendulum_env.study.fit_report import against_track

    path, truth = written("pixel track", tmp_path)
    found = fit(Recording.read(path), "linear", mass=1.0)
    assert found.recording.radius is not None
    assert found.recording.radius.value == pytest.approx(truth["length"], rel=5e-3)
    assert "agrees with the fitted length" in against_track(found)
    text = path.read_text()
    scale = float(text.split()[2])
    path.write_text(text.replace(f"{scale:.1f}", f"{1.05 * scale:.1f}", 1))  # the film's scale is wrong by 5 %
    wrong = against_track(fit(Recording.read(path), "linear", mass=1.0))
    assert "contradicts the fitted length" in wrong
    assert "the scale of the film is " in wrong
    path.write_text("".join(text.splitlines(keepends=True)[1:]))  # no scale
    unknown = against_track(fit(Recording.read(path), "linear", mass=1.0))
    units = float(unknown.split("(")[1].split()[0])
    assert units == pytest.approx(truth["scale"], rel=5e-3)
    assert against_track(fit(Recording(*swing(20.0), "swing"), "linear", mass=1.0)) == ""
