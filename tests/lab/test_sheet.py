"""Test the lab sheet against closed forms: damped oscillator, elliptic motion, losses to dry friction and drag."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad

from pendulum_env.lab import (
    LabSheet,
    Losses,
    Recording,
    RecordingError,
    TurningPoints,
    corrected_periods,
    decay_rate,
    losses,
    measure,
)
from pendulum_env.lab.measures import LAWS, powers
from pendulum_env.physics import exact
from pendulum_env.physics.units import SceneError

OMEGA0, GAMMA = 3.85, 0.03


def swing(angle: float, gamma: float = 0.0, *, linear: bool = False, noise: float = 0.0, duration: float = 40.0,
          zero: float = 0.02, seed: int = 0) -> Recording:
    """Return a recording of the exact undamped pendulum or of a damped oscillator, with a sensor that is off by
    ``zero``."""
    time = np.arange(0.0, duration, 0.02)
    if linear:
        angles, _ = exact.linear(time, angle, 0.0, OMEGA0, gamma)
    else:
        angles, _ = exact.pendulum(time, angle, 0.0, OMEGA0)
    return Recording(time, angles + zero + noise * np.random.default_rng(seed).standard_normal(len(time)), "exact")


def points(sizes: object, error: float = 1e-9, off: float = 0.0) -> TurningPoints:
    """Return turning points with given amplitudes at equal time steps, about an equilibrium that is off by ``off``."""
    size = np.asarray(sizes, dtype=np.float64)
    sign = np.power(-1.0, np.arange(len(size)))
    return TurningPoints(np.arange(len(size), dtype=np.float64), sign * size + off, np.full(len(size), error))


# --- period ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("degrees", "close"), [(5.0, 2e-6), (40.0, 2e-5), (90.0, 1e-4), (150.0, 3e-3)])
def test_an_undamped_pendulum_has_one_period_at_small_amplitude(degrees: float, close: float) -> None:
    """The accuracy is limited by the harmonic arc that is fitted to turning points."""
    sheet = measure(swing(math.radians(degrees)))
    assert sheet.period.value == pytest.approx(exact.period(math.radians(degrees), OMEGA0), rel=2e-5)
    assert sheet.omega0.value == pytest.approx(OMEGA0, rel=close)
    assert sheet.length.value == pytest.approx(9.81 / OMEGA0**2, rel=2.0 * close)
    assert sheet.cycles.spread < max(close, 2e-5)


def test_the_corrected_period_stays_while_the_period_falls() -> None:
    """Simulate an elliptic swing whose amplitude falls slowly, with the phase as the integral of omega(A)."""
    time = np.arange(0.0, 60.0, 0.005)
    size = 1.2 * np.exp(-0.01 * time)
    rate = 2.0 * math.pi / exact.period(size, OMEGA0)
    phase = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(time))])
    found = corrected_periods(Recording(time, size * np.cos(phase), "slow"))
    assert len(found.time) == 34
    np.testing.assert_allclose(found.period, 2.0 * math.pi / OMEGA0, rtol=1e-4)
    np.testing.assert_allclose(found.amplitude, 1.2 * np.exp(-0.01 * found.time), rtol=1e-3)
    assert abs(found.drift.value) < 1e-4
    assert found.left_out == 0


def test_a_missing_stretch_is_left_out() -> None:
    whole = swing(0.3, zero=0.0)
    keep = (whole.time < 10.0) | (whole.time > 12.2)
    found = corrected_periods(Recording(whole.time[keep], whole.angle[keep], "gap"))
    assert found.left_out == 1
    np.testing.assert_allclose(found.period, 2.0 * math.pi / OMEGA0, rtol=1e-4)
    sheet = measure(Recording(whole.time[keep], whole.angle[keep], "gap"))
    assert sheet.period.value == pytest.approx(exact.period(0.3, OMEGA0), rel=1e-5)
    assert sheet.oscillations == 23
    assert "T0 leaves out 1 of the cycles" in sheet.text


@pytest.mark.slow
def test_a_damped_oscillator_is_measured_within_its_errors() -> None:
    """The period of a damped oscillator does not depend on the amplitude, so only small angles agree with the
    correction."""
    pulls = []
    for seed in range(12):
        sheet = measure(swing(0.05, GAMMA, linear=True, noise=5e-4, seed=seed))
        true = math.tau / math.sqrt(OMEGA0**2 - GAMMA**2 / 4.0)
        pulls.append([(sheet.period.value - true) / sheet.period.error,
                      (sheet.decay.value - GAMMA) / sheet.decay.error,
                      (sheet.short_decay.value - GAMMA) / sheet.short_decay.error])
        assert sheet.quality.value == pytest.approx(OMEGA0 / GAMMA, abs=3.5 * sheet.quality.error)
    assert np.abs(pulls).max() < 3.5
    assert (np.sqrt(np.mean(np.square(pulls), axis=0)) < 1.4).all()


def test_the_first_oscillations_alone() -> None:
    few, every = (measure(swing(0.05, GAMMA, linear=True, noise=5e-4), n=n) for n in (5, None))
    assert (few.oscillations, every.oscillations) == (5, 23)
    assert few.period.error > 3.0 * every.period.error
    assert few.decay == decay_rate(few.recording)


def test_six_readings_are_spread_over_the_run() -> None:
    """Six exact amplitudes of exp(-gamma t/2), one in ten, give gamma; their error is that of a numpy line with errors
    of 1e-3 of the first amplitude. The first six alone have an error over five times as large."""
    sheet = measure(swing(0.05, GAMMA, linear=True, noise=5e-4))
    size, time, error = sheet.points.amplitude, sheet.points.time, sheet.points.error
    picked = np.round(np.linspace(0, len(time) - 1, 6)).astype(int)
    line = np.polyfit(time[picked], np.log(size[picked]), 1, w=size[picked] / error[picked])
    assert sheet.short_decay.value == pytest.approx(-2.0 * line[0], rel=1e-9)
    assert sheet.short_decay.error < 0.2 * decay_rate(sheet.recording, 6).error
    assert ("gamma, 6 readings", "ln(amplitude) of 6 spread over the run, A ~ exp(-gamma t/2)") in [
        (row[0], row[2]) for row in sheet.table.rows]


def test_a_decay_that_is_not_exponential_is_said_half_by_half() -> None:
    """Under dry friction the amplitude falls linearly, so ln(amplitude) falls faster and faster.

    The rates are those of numpy's lines through the exact amplitudes, whose errors are all of one size."""
    time = np.arange(0.0, 40.0, 0.02)
    size = 0.3 - 0.006 * time
    dry = measure(Recording(time, size * np.cos(OMEGA0 * time) + 5e-4 * np.random.default_rng(0).standard_normal(2000),
                            "dry"))
    assert dry.half_decays is not None
    first, last = dry.half_decays
    halves = ((time[:1000], size[:1000]), (time[1000:], size[1000:]))
    exact_rates = [-2.0 * np.polyfit(when, np.log(high), 1, w=high)[0] for when, high in halves]
    assert [first.value, last.value] == pytest.approx(exact_rates, rel=0.02)
    assert "The decay is not exponential" in dry.text
    assert "not exponential" not in measure(swing(0.05, GAMMA, linear=True, noise=5e-4)).text


def test_a_length_gives_gravity_with_its_error() -> None:
    """``g = L omega0²`` of a point; a sphere of radius a on the same pivot has ``1 + 2 a²/(5 L²)`` times as much."""
    length = 9.81 / OMEGA0**2
    sheet = measure(swing(0.3, noise=1e-3), length=length, length_error=0.01 * length)
    assert sheet.gravity is not None
    assert sheet.gravity.value == pytest.approx(9.81, abs=3.0 * 9.81 * 2.0 * sheet.omega0.error / OMEGA0)
    assert sheet.gravity.error == pytest.approx(0.0981, rel=0.05)
    bare = measure(swing(0.3, noise=1e-3), length=length)
    assert bare.gravity is not None
    assert bare.gravity.error == pytest.approx(2.0 * 9.81 * bare.omega0.error / OMEGA0, rel=1e-2)
    assert "gravity" in [row[0] for row in sheet.table.rows]
    assert "gravity" in [row[0] for row in sheet.numbers.rows]
    assert "wrong" not in sheet.text
    sized = measure(swing(0.3, noise=1e-3), length=length, radius=0.2 * length).gravity
    assert sized is not None
    assert sized.value / sheet.gravity.value == pytest.approx(1.016, abs=1e-9)
    assert measure(swing(0.3)).gravity is None
    assert "without the error of the length" in measure(swing(0.3), length=length).text
    with pytest.raises(SceneError, match="length_error needs length"):
        measure(swing(0.3), length_error=0.01)


def test_a_length_of_no_bench_is_asked_about() -> None:
    """Times that are 20 times too long make a pendulum of 265 m; its length, if given, answers the question."""
    fast = swing(0.3)
    slow = Recording(20.0 * fast.time, fast.angle, "slow")
    asked = measure(slow).text
    assert "is that of a pendulum of 265 m" in asked
    assert "--read rate=100 or time_unit=ms; if it is, say so by --length 265" in asked
    assert "is that of a pendulum" not in measure(slow, length=265.0).text
    assert "is that of a pendulum" not in measure(fast).text


def test_amplitudes_have_the_decimals_of_their_error() -> None:
    (row,) = (row for row in measure(swing(0.3, noise=1e-3)).table.rows if row[0].startswith("amplitude"))
    first, last, error = re.findall(r"\d+\.(\d+)°?", row[1].replace("(± ", ""))
    assert len(first) == len(last) == len(error)


@pytest.mark.parametrize(("factor", "said"), [(1.3, "30% above"), (0.01, "99% below"), (1.1, ""), (0.9, "")])
def test_a_gravity_that_cannot_be_is_said(factor: float, said: str) -> None:
    text = measure(swing(0.3), length=factor * 9.81 / OMEGA0**2).text
    assert ("the length or the time base is wrong" in text) == bool(said)
    assert said in text


@pytest.mark.slow
def test_errors_cover_the_truth_of_the_small_period() -> None:
    pulls = []
    for seed in range(12):
        sheet = measure(swing(0.5, noise=1e-3, seed=seed, duration=20.0))
        pulls.append((sheet.small_period.value - math.tau / OMEGA0) / sheet.small_period.error)
    assert np.abs(pulls).max() < 3.5
    assert 0.3 < math.sqrt(np.mean(np.square(pulls))) < 1.4


# --- the law of the damping ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("amplitude", [1e-3, 0.5, 1.5, 2.5])
def test_powers_are_the_work_along_half_a_swing(amplitude: float) -> None:
    def work(power: int) -> float:
        def integrand(x: float) -> float:
            return (4.0 * math.sin(0.5 * (amplitude + x)) * math.sin(0.5 * (amplitude - x))) ** (0.5 * power)

        return 2.0 * quad(integrand, 0.0, amplitude, epsabs=0.0, epsrel=1e-10)[0] / math.sin(amplitude)

    small = (2.0, math.pi / 2.0, 4.0 / 3.0)
    for k, (law, one) in enumerate(zip(powers(np.array([amplitude])), small, strict=True)):
        assert float(law[0]) == pytest.approx(work(k) / one, rel=1e-6)
        assert float(powers(np.array([1e-3]))[k][0]) == pytest.approx(1e-3**k, rel=1e-5)


@pytest.mark.parametrize("angle", [0.4, 1.6])
def test_dry_friction_takes_the_same_from_each_half_swing(angle: float) -> None:
    """The exact turning points under dry friction follow cos A' - cos A = tau (A + A')."""
    ratio = 0.004 * angle
    found = losses(points(np.abs(exact.coulomb_turning_points(angle, ratio, 60))[1:]))
    assert found.terms[0] == pytest.approx(2.0 * ratio, rel=2e-3)
    assert shares(found) == pytest.approx([1.0, 0.0, 0.0], abs=5e-3)


@pytest.mark.parametrize("angle", [0.4, 2.0])
def test_quadratic_drag_takes_the_square(angle: float) -> None:
    sizes, c = [angle], 0.01
    for _ in range(40):
        sizes.append(abs(exact.quadratic_turning_point(sizes[-1], c)))
    found = losses(points(sizes))
    assert found.terms[2] == pytest.approx(4.0 * c / 3.0, rel=2e-3)
    assert shares(found) == pytest.approx([0.0, 0.0, 1.0], abs=5e-3)


def test_linear_drag_takes_a_share() -> None:
    """At small angles, linear drag reduces the amplitude by the factor exp(-gamma T/4) per half swing."""
    found = losses(points(0.05 * np.exp(-0.01 * np.arange(60.0))))
    assert found.terms[1] == pytest.approx(0.01, rel=1e-3)
    assert shares(found) == pytest.approx([0.0, 1.0, 0.0], abs=2e-3)


def test_an_equilibrium_that_is_off_changes_nothing() -> None:
    size = 0.3 - 0.001 * np.arange(80) - 0.05 * (1.0 - np.exp(-0.01 * np.arange(80)))
    right, off = losses(points(size)), losses(points(size, off=0.002))
    np.testing.assert_allclose(off.terms, right.terms, atol=1e-5)


def test_a_missing_stretch_is_no_loss() -> None:
    size = 0.3 * np.exp(-0.01 * np.arange(60.0))
    whole, keep = points(size), np.r_[0:20, 27:60]
    found = losses(TurningPoints(whole.time[keep], whole.angle[keep], whole.error[keep]))
    np.testing.assert_allclose(found.terms, losses(whole).terms, rtol=1e-3, atol=1e-6)


def test_the_errors_of_a_mixture_are_honest() -> None:
    """For losses s + l A + q A² and noisy amplitudes, check that every share is within its error."""
    size = [0.6]
    for _ in range(120):
        size.append(size[-1] - 0.0004 - 0.004 * size[-1] - 0.004 * size[-1] ** 2)
    true, pulls = losses(points(size)), []
    for seed in range(40):
        noisy = np.array(size) + 2e-4 * np.random.default_rng(seed).standard_normal(len(size))
        found = losses(points(noisy, error=2e-4))
        pulls.append([(found.shares[law].value - true.shares[law].value) / found.shares[law].error for law in LAWS])
        assert found.misfit == pytest.approx(1.0, abs=0.3)
        assert sum(shares(found)) == pytest.approx(1.0)
    sizes = np.sqrt(np.mean(np.square(pulls), axis=0))
    assert np.abs(pulls).max() < 3.5
    assert (sizes < 1.3).all()
    assert (sizes > 0.6).all()


def shares(found: Losses) -> list[float]:
    return [found.shares[law].value for law in LAWS]


# --- the sheet -------------------------------------------------------------------------------------------------------


def sheet_of(**known: object) -> LabSheet:
    return measure(swing(0.5, zero=0.01), **known)  # type: ignore[arg-type]


def test_the_reynolds_number_takes_a_radius() -> None:
    assert sheet_of().reynolds is None
    told = sheet_of(length=0.65, radius=0.011)
    speed = 2.0 * OMEGA0 * 0.65 * math.sin(0.25)
    assert told.reynolds is not None
    assert told.reynolds[0] == pytest.approx(1.2041 * speed * 0.022 / 1.81e-5, rel=2e-3)
    measured = sheet_of(radius=0.011).reynolds
    assert measured is not None
    assert measured[0] == pytest.approx(told.reynolds[0] * sheet_of().length.value / 0.65, rel=1e-6)
    of_scene = sheet_of(scene="lab").reynolds
    assert of_scene is not None
    assert of_scene[0] == pytest.approx(told.reynolds[0] * (0.353 * 0.0107) / (0.65 * 0.011), rel=1e-4)
    assert sheet_of(scene="vacuum", radius=0.011).reynolds is None


def test_gravity_is_the_scenes() -> None:
    assert sheet_of(gravity=1.62).length.value == pytest.approx(1.62 / OMEGA0**2, rel=1e-4)
    with pytest.raises(SceneError, match="length"):
        sheet_of(lenght=1.0)


def test_table_and_text_say_each_thing() -> None:
    sheet = sheet_of(radius=0.011)
    words = " ".join(" ".join(row) for row in sheet.table.rows)
    for word in ("small amplitude T0", "single cycles", "6 spread", "quality", "Reynolds", "constant part", "g T0²",
                 "point pendulum"):
        assert word in words
    assert all(len(row) == len(sheet.table.head) and all(row) for row in sheet.table.rows)
    assert f"{sheet.oscillations} oscillations" in sheet.text
    assert "nan" not in words + sheet.text


@pytest.mark.parametrize(("duration", "n", "said"), [(1.0, None, "free swing|turning points|oscillation"),
                                                     (8.0, 50, "50 full oscillations"), (8.0, 0, "whole number")])
def test_too_few_swings_are_said_in_one_sentence(duration: float, n: int | None, said: str) -> None:
    with pytest.raises(RecordingError, match=said) as error:
        measure(swing(0.3, duration=duration), n=n)
    assert "\n" not in str(error.value)


def test_what_is_no_recording_is_refused() -> None:
    with pytest.raises(RecordingError, match="must be a Recording"):
        measure("swing.txt")  # type: ignore[arg-type]
    with pytest.raises(RecordingError, match="at least 8 amplitudes"):
        losses(points([0.3, 0.2, 0.1]))


# --- real recordings -------------------------------------------------------------------------------------------------


def test_the_film(recordings: Path) -> None:
    """The film's string is 0.65 ± 0.01 m; the length to the centre of the bob is longer by its radius, which is
    unknown."""
    sheet = measure(Recording.read(recordings / "video_decay_65cm.txt"), length=0.65, mass=0.0415)
    assert sheet.oscillations == 69
    assert sheet.cycles.spread < 3e-3
    assert sheet.length.value == pytest.approx(0.663, abs=0.001)
    assert 2e-4 < sheet.length.error < 2e-3
    assert sheet.half_decays is not None
    assert sheet.half_decays[1].value < sheet.decay.value < sheet.half_decays[0].value
    assert sheet.short_decay.value == pytest.approx(sheet.decay.value, abs=3.0 * sheet.short_decay.error)
    assert sheet.losses is not None
    assert sheet.losses.shares["quadratic"].value > 0.6


def test_the_encoder_finds_dry_friction(recordings: Path) -> None:
    sheet = measure(Recording.read(recordings / "encoder_short_rod_45deg.txt", scale=0.99), length=0.124, mass=0.01225)
    assert sheet.losses is not None
    friction = sheet.losses.shares["constant"]
    assert friction.value > 0.5
    assert friction.value > 4.0 * friction.error


def test_shares_that_the_amplitudes_do_not_tell_are_said_in_words() -> None:
    """Ten amplitudes with errors of 1 % cannot tell the laws apart; 60 with small errors can."""
    few = losses(points(0.1 * np.exp(-0.01 * np.arange(10.0)), error=1e-3))
    assert few.told == {}
    assert few.text == "the recording does not tell constant, linear and quadratic loss apart"
    many = losses(points(0.5 * np.exp(-0.03 * np.arange(60.0)), error=1e-5))
    assert set(many.told) == set(LAWS)
    assert many.told["linear"].value > 0.95
    assert "does not tell" not in many.text
