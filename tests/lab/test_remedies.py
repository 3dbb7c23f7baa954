"""Test that a fit names the one fault of a recording that explains its misfit; recordings are simulated by scipy alone.
"""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from virtual_swings import GRAVITY

from pendulum_env.lab import Recording, fit
from pendulum_env.lab.fitting import remedies
from pendulum_env.lab.fitting.result import Fit

Array = NDArray[np.float64]
NOISE = 0.15
"""Noise of a reading [deg]."""


def motion(time: Array, degrees: float, length: float = 0.62, stretch: float = 0.0, rate: bool = False) -> Array:
    """Return the angles [rad] of a pendulum with linear and quadratic drag whose length grows by the share ``stretch``,
    or its angular velocities [rad/s]."""
    def slope(t: float, y: Array) -> list[float]:
        long = length * (1.0 + stretch * t / time[-1])
        return [y[1], -GRAVITY / long * math.sin(y[0]) - (0.025 + 0.015 * abs(y[1])) * y[1]]

    run = solve_ivp(slope, (0.0, float(time[-1])), [math.radians(degrees), 0.0], "DOP853", time, rtol=1e-9, atol=1e-11)
    return np.asarray(run.y[int(rate)])


def fitted(time: Array, angle: Array, seed: int = 3, noise: float = NOISE, **options: Any) -> Fit:
    """Return the fit of angles [rad] with noise, without its warnings."""
    seen = angle + math.radians(noise) * np.random.default_rng(seed).standard_normal(len(time))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return fit(Recording(time, seen, "virtual"), **{"effects": "linear+quadratic", "mass": 0.1, **options})


TIME = np.arange(0.0, 32.0, 1.0 / 36.0)
SWING = motion(TIME, 37.0)


def check(found: Fit, name: str, size: float, errors: float = 3.0) -> None:
    """AssertionError unless the first remedy of a fit has this name and, within its errors, this size."""
    first = found.remedies[0]
    assert first.name == name, [one.sentence for one in found.remedies]
    assert not any(one.instead for one in found.remedies)
    assert abs(first.number.value - size) < errors * first.number.error, first.sentence
    assert found.grade.word != "usable"
    assert first.text[1:] in found.grade.text
    assert first.option in found.grade.text


# --- each fault is named with its size -------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("scale", [1.06, *(pytest.param(scale, marks=pytest.mark.slow) for scale in (0.71, 2.6))])
def test_a_wrong_scale_is_named(scale: float) -> None:
    found = fitted(TIME, scale * SWING)
    check(found, "scale", scale)
    assert found.remedies[0].option == "--free length,scale"
    again = fitted(TIME, scale * SWING, free=("length", "scale"))
    assert (again.remedies, again.grade.word) == ((), "usable")


@pytest.mark.slow
@pytest.mark.parametrize(("scale", "option"), [
    (math.pi / 180.0, "--unit rad"), pytest.param(0.5 / math.pi, "--scale 6.28319", marks=pytest.mark.slow),
    pytest.param(1.0 / 360.0, "--scale 360", marks=pytest.mark.slow)])
def test_a_mistaken_unit_is_named(scale: float, option: str) -> None:
    found = fitted(TIME, scale * SWING, noise=scale * NOISE)
    check(found, "unit", scale)
    assert found.remedies[0].option == option
    assert found.comparison is None


@pytest.mark.slow
def test_angular_velocities_that_are_read_as_angles_are_named() -> None:
    found = fitted(TIME, motion(TIME, 37.0, rate=True) / 2.0, noise=0.3)
    assert found.remedies[0].name == "scale"  # of half the velocities, nothing else is known
    found = fitted(TIME, motion(TIME, 37.0, rate=True), noise=0.3)
    assert (found.remedies[0].name, found.remedies[0].option) == ("column", "--columns time=1,rate=2 --unit rad")
    assert found.remedies[0].number.value == pytest.approx(0.3, rel=0.1)


@pytest.mark.parametrize(("size", "at"), [(0.3, 14.3), pytest.param(-2.2, 21.0, marks=pytest.mark.slow)])
def test_a_jump_is_subtracted_and_said(size: float, at: float) -> None:
    moved = SWING + math.radians(size) * (at < TIME)
    found, plain = fitted(TIME, moved), fitted(TIME, SWING)
    (jump,) = found.subtracted
    assert abs(jump.number.value - size) < 3.0 * jump.number.error
    assert jump.at == pytest.approx(at, abs=0.5 if abs(size) < 1.0 else 0.05)
    when = f"{round(jump.at, 2):g} s"
    said = f"The zero jumps by {jump.number.value:.3g}° at {when}: subtracted (--no-jumps leaves it in)."
    assert said in found.grade.text
    assert any(note.startswith("the zero jumps by") for note in found.recording.notes)
    assert found.grade.word == "usable"
    assert found.rms == pytest.approx(plain.rms, rel=0.01)
    left = fitted(TIME, moved, jumps=False)
    assert (left.subtracted, left.rms > 1.05 * plain.rms) == ((), True)
    check(left, "jump", size)
    assert left.remedies[0].option == f"--until {round(left.remedies[0].at, 2):g}"


@pytest.mark.parametrize("size", [0.4, pytest.param(-3.0, marks=pytest.mark.slow)])
def test_a_drift_of_the_zero_is_named(size: float) -> None:
    check(fitted(TIME, SWING + math.radians(size) * TIME / TIME[-1]), "drift", size)


@pytest.mark.slow
@pytest.mark.parametrize("stretch", [-0.004, pytest.param(0.04, marks=pytest.mark.slow)])
def test_a_drift_of_the_period_is_named(stretch: float) -> None:
    """The period is proportional to the square root of the length; its change is relative to its mean."""
    last = math.sqrt(1.0 + stretch)
    check(fitted(TIME, motion(TIME, 37.0, stretch=stretch)), "period", 200.0 * (last - 1.0) / (last + 1.0), 4.0)


@pytest.mark.slow
@pytest.mark.parametrize(("size", "options"), [(2.0, {}), pytest.param(-25.0, {}, marks=pytest.mark.slow)])
def test_an_outlier_is_named(size: float, options: dict[str, Any]) -> None:
    seen = SWING.copy()
    seen[455] += math.radians(size)
    found = fitted(TIME, seen, **options)
    check(found, "outliers", size)
    assert found.remedies[0].at == pytest.approx(TIME[455])
    assert "grow" not in found.grade.text
    span = found.remedies[0].option.removeprefix("--robust or --drop ")
    assert fitted(TIME, seen, drop=span).grade.word == "usable"
    assert fitted(TIME, seen, robust=True).remedies == ()


def test_many_outliers_are_counted() -> None:
    seen = SWING.copy()
    places = np.random.default_rng(1).choice(len(seen) - 20, 17, replace=False) + 10
    seen[places] += math.radians(9.0) * np.where(np.arange(17) % 2, 1.0, -1.0)
    found = fitted(TIME, seen)
    assert found.remedies[0].text.startswith("17 readings are up to 9.")
    assert found.remedies[0].option == "--robust"


@pytest.mark.slow
@pytest.mark.parametrize("size", [1.2, pytest.param(3.0, marks=pytest.mark.slow)])
def test_a_second_swing_that_fades_is_named(size: float) -> None:
    wave = math.radians(size) * np.exp(-1.1 * TIME) * np.cos(math.tau * 5.3 * TIME + 0.4)
    found = fitted(TIME, SWING + wave)
    check(found, "swing", size)
    frequency, until = (float(part.split()[0]) for part in found.remedies[0].text.split(" at ")[1].split(" until "))
    assert frequency == pytest.approx(5.3, rel=0.01)
    assert until == pytest.approx(math.log(10.0) / 1.1, rel=0.4)
    assert found.remedies[0].option == f"--read release={until:g}"


@pytest.mark.slow
def test_a_second_swing_that_stays_is_named() -> None:
    wave = math.radians(0.5) * np.cos(1.4 * math.sqrt(GRAVITY / 0.62) * TIME)
    found = fitted(TIME, SWING + wave)
    check(found, "swing", 0.5)
    assert found.remedies[0].option == ""


@pytest.mark.slow
def test_rates_are_tried_only_if_a_scale_explains_some_of_the_misfit(monkeypatch: pytest.MonkeyPatch) -> None:
    """A second swing does not look like a wrong scale; rates that are taken for angles do."""
    tried = []
    monkeypatch.setattr(remedies, "_as_rates", lambda *given: tried.append(given))
    check(fitted(TIME, SWING + math.radians(0.5) * np.cos(13.0 * TIME)), "swing", 0.5)
    assert not tried
    fitted(TIME, motion(TIME, 10.0, rate=True))
    assert tried


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.97, pytest.param(1.04, marks=pytest.mark.slow)])
def test_a_push_is_named(share: float) -> None:
    """At 15 s the bob swings on as from another amplitude: the velocity is multiplied at once."""
    first = motion(TIME[TIME < 15.0], 37.0)
    speed = float(motion(TIME[TIME < 15.0], 37.0, rate=True)[-1])
    after = TIME[TIME >= 15.0]

    def slope(_t: float, y: Array) -> list[float]:
        return [y[1], -GRAVITY / 0.62 * math.sin(y[0]) - (0.025 + 0.015 * abs(y[1])) * y[1]]

    before = float(TIME[TIME < 15.0][-1])
    run = solve_ivp(slope, (before, float(TIME[-1])), [float(first[-1]), share * speed], "DOP853", after, rtol=1e-9,
                    atol=1e-11)
    found = fitted(TIME, np.concatenate([first, run.y[0]]))
    assert found.remedies[0].name == "push"
    assert found.remedies[0].at == pytest.approx(15.0, abs=1.0)
    assert found.remedies[0].option.startswith("--until 1")


@pytest.mark.slow
@pytest.mark.parametrize("one", ["coulomb", pytest.param("linear", marks=pytest.mark.slow)])
def test_a_damping_that_is_missing_is_named(one: str) -> None:
    found = fitted(TIME, motion(TIME, 60.0), effects=one)
    assert (found.remedies[0].name, found.remedies[0].option) == ("damping", "--effects auto")


# --- two faults, and none --------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_two_faults_are_named_one_after_the_other() -> None:
    seen = SWING + math.radians(0.9) * TIME / TIME[-1]
    seen[700] -= math.radians(12.0)
    found = fitted(TIME, seen)
    assert [one.name for one in found.remedies] == ["outliers", "drift"]
    assert found.grade.remedies[1].startswith("Besides, the zero drifts by 0.")
    jumps = SWING + math.radians(1.5) * (TIME > 9.0) - math.radians(2.5) * (TIME > 23.0)
    (both,) = fitted(TIME, jumps).subtracted
    first, second = (float(part.split("°")[0]) for part in both.text.removeprefix("the zero jumps by ").split(" by "))
    assert first == pytest.approx(1.5, abs=0.05)
    assert second == pytest.approx(-2.5, abs=0.05)


@pytest.mark.slow
def test_faults_that_the_recording_does_not_tell_apart_are_both_named() -> None:
    """At 20 degrees, a scale that is wrong by 5 % and a period that drifts shift the phase alike."""
    found = fitted(TIME, 1.05 * motion(TIME, 20.0))
    assert {one.name for one in found.remedies} == {"scale", "period"}
    assert [one.instead for one in found.remedies] == [False, True]
    assert found.grade.remedies[1].endswith("; the recording does not tell which.")


@pytest.mark.slow
def test_a_fault_says_nothing_about_damping() -> None:
    found = fitted(TIME, 1.5 * SWING, effects=["linear", "quadratic"])
    assert found.comparison is not None
    assert found.comparison.text == found.grade.text
    assert "verdict" not in found.comparison.table.head


@pytest.mark.parametrize(("name", "seen"), [
    ("scale", 1.002 * SWING), ("jump", SWING + math.radians(0.01) * (TIME > 12.0)),
    ("drift", SWING + math.radians(0.015) * TIME / TIME[-1]), ("period", motion(TIME, 37.0, stretch=2e-5)),
    ("outlier", SWING + math.radians(0.3) * (np.arange(len(TIME)) == 500)),
    ("swing", SWING + math.radians(0.02) * np.exp(-TIME) * np.cos(30.0 * TIME)),
])
def test_a_fault_that_cannot_be_seen_is_not_named(name: str, seen: Array) -> None:
    found = fitted(TIME, seen, seed=sum(map(ord, name)))
    assert (found.remedies, found.subtracted, found.grade.word) == ((), (), "usable")


@pytest.mark.slow
def test_plain_recordings_have_no_fault() -> None:
    """At most one of 60 recordings of all kinds, whose readings have noise and steps alone."""
    false = 0
    for seed in range(60):
        source = np.random.default_rng(seed)
        time = np.arange(0.0, source.choice([15.0, 25.0, 40.0]), 1.0 / source.choice([15.0, 30.0, 60.0]))
        angle = motion(time, source.uniform(5.0, 60.0), source.uniform(0.2, 1.2)) + source.uniform(-0.03, 0.03)
        noise, step = source.choice([0.02, 0.1, 0.3]), math.radians(source.choice([0.0, 0.1, 0.25]))
        seen = angle + math.radians(noise) * source.standard_normal(len(time))
        found = fitted(time, step * np.round(seen / step) if step else seen, noise=0.0)
        false += bool(found.remedies or found.subtracted)
    assert false <= 1


@pytest.mark.slow
def test_two_jumps_are_subtracted_together() -> None:
    """One step alone fits neither of them, so that one step must not decide whether there are two."""
    moved = SWING + math.radians(1.2) * (TIME > 9.0) + math.radians(-0.9) * (TIME > 21.0)
    found = fitted(TIME, moved)
    assert found.grade.word == "usable"
    (jump,) = found.subtracted
    sizes, times = zip(*((float(part.split("°")[0].split()[-1]), float(part.split()[-2]))
                         for part in jump.text.split(" and ")), strict=True)
    assert sizes == pytest.approx((1.2, -0.9), abs=0.1)
    assert times == pytest.approx((9.0, 21.0), abs=0.2)
    assert found.rms == pytest.approx(fitted(TIME, SWING).rms, rel=0.02)


@pytest.mark.slow
def test_a_robust_fit_subtracts_the_jump_that_is_there() -> None:
    """The readings are pulled towards the model after the jump is gone, else they would hide a part of it."""
    moved = SWING + math.radians(1.5) * (TIME > 12.0)
    moved[300] += math.radians(15.0)
    found = fitted(TIME, moved, robust=True)
    (jump,) = found.subtracted
    assert abs(jump.number.value - 1.5) < 4.0 * jump.number.error
    assert found.remedies == ()
    assert abs(found.parameters["zero"].value) < 4.0 * found.parameters["zero"].error


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1004, 1009])
def test_steps_in_noise_that_wanders_are_not_subtracted(seed: int) -> None:
    """Noise of the correlation 0.9 between neighbours is fitted better with steps, which leave most of it."""
    time, source = np.arange(0.0, 30.0, 0.02), np.random.default_rng(seed).standard_normal(1550)
    wander = source.copy()
    for i in range(1, len(wander)):
        wander[i] = 0.9 * wander[i - 1] + math.sqrt(1.0 - 0.9**2) * source[i]
    swing = solve_ivp(lambda t, y: [y[1], -GRAVITY / 0.65 * math.sin(y[0]) - 0.02 * y[1]], (0.0, 30.0), [0.35, 0.0],
                      t_eval=time, rtol=1e-9, atol=1e-11).y[0]
    assert fitted(time, swing + math.radians(0.1) * wander[50:], noise=0.0, effects="linear").subtracted == ()


@pytest.mark.slow
def test_the_error_of_the_zero_counts_the_jump_as_fitted() -> None:
    """Only the readings before a jump tell the zero: its error grows by the root of all readings over these."""
    moved = fitted(TIME, SWING + math.radians(1.5) * (0.4 * TIME[-1] < TIME))
    plain = fitted(TIME, SWING)
    assert len(moved.subtracted) == 1
    ratio = moved.parameters["zero"].error / plain.parameters["zero"].error
    assert ratio == pytest.approx(math.sqrt(1.0 / 0.4), rel=0.1)
