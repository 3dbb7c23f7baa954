"""Test period, amplitudes and decay rate against closed forms: a damped cosine and the pendulum's elliptic period."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest

from pendulum_env.lab import (
    Measurement,
    Recording,
    RecordingError,
    TurningPoints,
    crossings,
    decay_rate,
    noise_level,
    period,
    small_amplitude_period,
    turning_points,
)
from pendulum_env.lab.checked import FloatArray
from pendulum_env.lab.turning import equilibrium, extremes

PERIOD, GAMMA = 1.64, 0.05
OMEGA = 2 * math.pi / PERIOD
QUANTUM = math.radians(0.25)


@dataclass(frozen=True)
class Swing:
    time: FloatArray
    angle: FloatArray


def damped(
    *,
    amplitude: float = 0.5,
    noise: float = 0.0,
    quantum: float = 0.0,
    jitter: float = 0.0,
    step: float = 0.02,
    duration: float = 40.0,
    phase: float = 0.3,
    seed: int = 0,
) -> Swing:
    """Return A exp(-gamma t / 2) cos(omega t + phase), with uneven time stamps (``jitter`` in steps), noise and
    rounding."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, duration, step)
    time = time + jitter * step * rng.uniform(-0.5, 0.5, len(time))
    angle = amplitude * np.exp(-GAMMA * time / 2) * np.cos(OMEGA * time + phase)
    angle = angle + noise * rng.standard_normal(len(time))
    return Swing(time, np.round(angle / quantum) * quantum if quantum else angle)


DEFECTS = {
    "noise": {"noise": 0.005},
    "quantum": {"quantum": QUANTUM},
    "quantum, small swing": {"quantum": QUANTUM, "amplitude": math.radians(5), "duration": 25.0},
    "quantum, fine steps": {"quantum": QUANTUM, "step": 0.002, "duration": 25.0},
    "quantum, plateaux": {"quantum": QUANTUM, "step": 0.002, "duration": 8.0, "amplitude": math.radians(2)},
    "noise, quantum, jitter": {"noise": 0.003, "quantum": QUANTUM, "jitter": 0.8},
    "20 Hz": {"noise": 0.002, "step": 0.05},
}


def pulls(defect: str, runs: int = 24) -> dict[str, FloatArray]:
    """Return (measured - true) / error of every measure, over runs that differ in seed and phase."""
    found: dict[str, list[float]] = {"period": [], "decay": [], "amplitude": []}
    for seed in range(runs):
        swing = damped(seed=seed, phase=0.3 + 0.25 * seed, **DEFECTS[defect])
        for name, measured, true in (
            ("period", period(swing), PERIOD),
            ("decay", decay_rate(swing), GAMMA),
        ):
            found[name].append((measured.value - true) / measured.error)
        points = turning_points(swing)
        peak = DEFECTS[defect].get("amplitude", 0.5) * math.cos(math.atan(GAMMA / 2 / OMEGA))
        true_size = peak * np.exp(-GAMMA * points.time / 2)
        found["amplitude"] += ((points.amplitude - true_size) / points.error).tolist()
    return {name: np.array(values) for name, values in found.items()}


@pytest.mark.slow
@pytest.mark.parametrize("defect", DEFECTS)
def test_values_lie_within_honest_errors(defect: str) -> None:
    for name, pull in pulls(defect).items():
        inside = np.mean(np.abs(pull) < 3)
        assert inside >= 0.97, (name, inside)
        assert 0.1 < math.sqrt(np.mean(pull**2)) < 1.4, name


def test_a_clean_damped_cosine_is_measured_almost_exactly() -> None:
    swing = damped(step=0.01)
    assert period(swing).value == pytest.approx(PERIOD, rel=1e-6)
    assert decay_rate(swing).value == pytest.approx(GAMMA, rel=1e-4)
    points = turning_points(swing)
    lag = math.atan(GAMMA / 2 / OMEGA)
    true = (np.arange(1, len(points.time) + 1) * math.pi - 0.3 - lag) / OMEGA
    np.testing.assert_allclose(points.time, true, atol=1e-4)
    np.testing.assert_allclose(points.amplitude, 0.5 * np.exp(-GAMMA * true / 2) * math.cos(lag), rtol=1e-5)
    np.testing.assert_array_equal(np.sign(points.angle), np.resize([-1.0, 1.0], len(true)))


def test_n_takes_the_first_oscillations_and_amplitudes() -> None:
    time = np.arange(0.0, 20.0, 0.005)
    chirp = Swing(time, np.cos(2 * math.pi * (time - 0.005 * time**2) + 1.0))
    first = crossings(chirp.time, chirp.angle)[:4]
    assert period(chirp, n=3).value == pytest.approx((first[3] - first[0]) / 3, rel=1e-6)
    assert period(chirp, n=3).value < period(chirp).value - 0.02
    two_rates = np.where(time < 10, np.exp(-0.1 * time), np.exp(-1.0) * np.exp(-0.02 * (time - 10)))
    swing = Swing(time, two_rates * np.cos(OMEGA * time))
    assert decay_rate(swing, n=6).value == pytest.approx(0.2, rel=1e-3)
    assert decay_rate(swing).value < 0.18


def test_a_period_of_few_oscillations_has_the_larger_error() -> None:
    """The error of a crossing time is inversely proportional to the slope there, so it grows as the amplitude falls."""
    ratios = []
    for seed in range(20):
        swing = damped(noise=0.004, seed=seed)
        ratios.append(period(swing, n=2).error / period(swing, n=20).error)
    first, last = (math.hypot(1.0, math.exp(GAMMA * n * PERIOD / 2)) / n for n in (2, 20))
    assert np.mean(ratios) == pytest.approx(first / last, rel=0.15)


def test_a_decay_that_is_not_exponential_widens_the_error() -> None:
    time = np.arange(0.0, 40.0, 0.02)
    noise = 0.0005 * np.random.default_rng(1).standard_normal(len(time))
    shapes = {"exponential": np.exp(-0.02 * time), "linear": 1 - 0.02 * time}
    swings = {name: Swing(time, 0.5 * shape * np.cos(OMEGA * time) + noise) for name, shape in shapes.items()}
    errors = {name: decay_rate(swing).error for name, swing in swings.items()}
    assert errors["linear"] > 10 * errors["exponential"]


@pytest.mark.parametrize("step", [0.01, 0.05])
def test_crossings_are_upward_and_interpolated(step: float) -> None:
    time = np.arange(0.0, 8.0, step)
    true = np.arange(8) + 0.2
    np.testing.assert_allclose(crossings(time, np.sin(2 * math.pi * (time - 0.2))), true, atol=3 * step**3)
    assert crossings([0.0, 1.0, 2.0, 3.0], [-1.0, 3.0, -1.0, 1.0]).tolist() == [0.25, 2.5]
    assert crossings([0.0, 1.0, 2.0], [-1.0, 0.0, 1.0]).tolist() == [1.0]
    assert crossings([0.0, 1.0], [1.0, -1.0]).size == 0


def test_noise_makes_no_extra_crossings_or_extremes() -> None:
    swing = damped(noise=0.01, step=0.002, duration=20.0)
    sigma = noise_level(swing.time, swing.angle)
    assert sigma == pytest.approx(0.01, rel=0.05)
    assert len(crossings(swing.time, swing.angle)) > 20
    assert len(crossings(swing.time, swing.angle, level=5 * sigma)) == 12
    turns = (OMEGA * 20.0 + 0.3) / math.pi
    assert len(extremes(swing.time, swing.angle)) == 1 + int(turns)
    still = Swing(swing.time, 0.01 * np.random.default_rng(3).standard_normal(len(swing.time)))
    assert len(turning_points(still).time) == 0


@pytest.mark.parametrize(("step", "quantum"), [(0.02, QUANTUM), (0.001, QUANTUM), (0.001, QUANTUM / 4)])
def test_noise_level_of_a_quantised_swing_is_that_of_its_quantum(step: float, quantum: float) -> None:
    swing = damped(quantum=quantum, step=step, duration=20.0)
    assert noise_level(swing.time, swing.angle) == pytest.approx(quantum / math.sqrt(12), rel=0.25)


def test_plateaux_are_turned_at_their_middle() -> None:
    swing = damped(quantum=math.radians(1.0), step=0.002, amplitude=0.2, duration=10.0)
    points = turning_points(swing)
    true = (np.arange(1, len(points.time) + 1) * math.pi - 0.3 - GAMMA / 2 / OMEGA) / OMEGA
    assert np.abs(points.time - true).max() < 0.02
    time = np.arange(721.0)
    flat = np.clip(np.sin(np.radians(time)), -0.9, 0.9)
    assert extremes(time, flat).tolist() == [0, 90, 270, 450, 630]


@pytest.mark.parametrize("ratio", [0.97, 0.9, 0.8])
def test_equilibrium_of_turning_points(ratio: float) -> None:
    number = np.arange(12, dtype=np.float64)
    error = np.ones(12)
    geometric = TurningPoints(number, 0.02 + 0.5 * np.power(-ratio, number), error)
    assert abs(equilibrium(geometric) - 0.02) < 0.5 * (1 - ratio) ** 4 / 16
    coulomb = TurningPoints(number, 0.02 + np.power(-1.0, number) * (0.5 - 0.03 * number), error)
    assert equilibrium(coulomb) == pytest.approx(0.02, abs=1e-15)


def test_a_bad_reading_makes_no_turning_point_beyond_the_readings() -> None:
    """A reading 20 degrees off near the bottom: the arc through the readings beside it could have any height."""
    time = np.arange(0.0, 20.0, 0.02)
    for at in (402, 777):
        angle = 0.5 * np.exp(-0.05 * time) * np.cos(4.4 * time)
        angle += 1.7e-3 * np.random.default_rng(0).standard_normal(len(time))
        angle[at] += 0.35
        assert turning_points(Recording(time, angle, "bad")).amplitude.max() < 1.0


def test_a_number_without_a_finite_error_can_be_printed() -> None:
    """The quality factor of a swing that does not decay is infinite, with an infinite error."""
    assert str(Measurement(math.inf, math.inf, "1")) == "inf ± inf 1"


@pytest.mark.parametrize(
    ("degrees", "ratio"), [(0.0, 1.0), (10.0, 1.00190718814), (30.0, 1.01740879760), (90.0, 1.18034059902)]
)
def test_small_amplitude_period_takes_out_the_published_ratio(degrees: float, ratio: float) -> None:
    amplitude = math.radians(degrees)
    assert small_amplitude_period(2.0 * ratio, amplitude) == pytest.approx(2.0, rel=1e-10)
    assert small_amplitude_period(Measurement(ratio, 0.1, "s"), amplitude).error == pytest.approx(0.1 / ratio)
    both = [0.0, amplitude]
    assert small_amplitude_period(1.0, both) == pytest.approx(1 / ((1 + ratio) / 2), rel=1e-10)


def test_a_large_free_swing_gives_back_omega0() -> None:
    from scipy.special import ellipj, ellipk

    k2 = math.sin(math.radians(94) / 2) ** 2
    time = np.arange(0.0, 40.0, 0.02)
    sn = ellipj(4.0 * time + 0.5, k2)[0]
    swing = Swing(time, 2 * np.arcsin(math.sqrt(k2) * sn))
    points = turning_points(swing)
    np.testing.assert_allclose(points.amplitude, math.radians(94), rtol=3e-4)
    assert period(swing).value == pytest.approx(ellipk(k2), rel=1e-5)
    corrected = small_amplitude_period(period(swing), points.amplitude)
    assert corrected.value == pytest.approx(math.pi / 2, rel=2e-4)


def test_what_can_not_be_measured_is_refused() -> None:
    short = damped(duration=2.0)
    with pytest.raises(ValueError, match="needs 1 full oscillations about zero, the series has 0"):
        period(short)
    with pytest.raises(ValueError, match="needs 99 full oscillations about zero, the series has 23"):
        period(damped(), n=99)
    with pytest.raises(ValueError, match="n must be a whole number of oscillations from 1, got 0"):
        period(damped(), n=0)
    with pytest.raises(ValueError, match="at least 3 amplitudes, the series gives 2"):
        decay_rate(short)
    for amplitudes in ([math.pi], [-0.1], [math.nan], []):
        with pytest.raises(ValueError, match="between 0 and pi"):
            small_amplitude_period(1.0, amplitudes)


def test_a_measurement_prints_two_digits_of_its_error() -> None:
    assert str(Measurement(1.640123, 0.00034, "s")) == "1.64012 ± 0.00034 s"
    assert str(Measurement(1.64, 0.0, "s")) == "1.6400000 ± 0.0000000 s"


def without(swing: Swing, *gaps: tuple[float, float]) -> Swing:
    keep = np.ones(len(swing.time), dtype=bool)
    for first, last in gaps:
        keep &= (swing.time <= first) | (swing.time >= last)
    return Swing(swing.time[keep], swing.angle[keep])


GAPS = {"a quarter": (5.0, 5.41), "at a turn": (9.7, 10.0), "at a crossing": (5.1, 5.5), "half a cycle": (5.0, 5.82),
        "a cycle": (7.1, 8.74), "four and a half": (6.0, 13.4), "eight": (9.9, 23.0)}


@pytest.mark.parametrize("gap", GAPS)
def test_measures_do_not_mistake_a_gap(gap: str) -> None:
    swing = damped(noise=0.001)
    torn = without(swing, GAPS[gap])
    found = period(torn)
    assert found.value == pytest.approx(PERIOD, abs=3.5 * found.error)
    assert found.error < 3e-4
    points, first, last = turning_points(torn), *GAPS[gap]
    lag = math.atan(GAMMA / 2 / OMEGA)
    true = (np.arange(1, 60) * math.pi - 0.3 - lag) / OMEGA
    true = true[true < 39.9]
    arc = PERIOD / 2 / 6
    seen = true[(true < first - 1.3 * arc) | (true > last + 1.3 * arc)]
    whole = true[(true < first) | (true > last)]
    assert len(seen) <= len(points.time) <= len(whole)
    nearest = np.array([np.argmin(np.abs(true - time)) for time in points.time])
    np.testing.assert_allclose(points.time, true[nearest], atol=0.02)
    amplitude = 0.5 * np.exp(-GAMMA * true[nearest] / 2) * math.cos(lag)
    assert np.abs((points.amplitude - amplitude) / points.error).max() < 4.5
    assert equilibrium(points) == pytest.approx(0.0, abs=5e-4)
    assert decay_rate(torn).value == pytest.approx(GAMMA, rel=0.02)


def test_a_clean_swing_with_a_gap_is_measured_almost_exactly() -> None:
    points = turning_points(without(damped(step=0.01), GAPS["eight"]))
    lag = math.atan(GAMMA / 2 / OMEGA)
    np.testing.assert_allclose(points.amplitude, 0.5 * np.exp(-GAMMA * points.time / 2) * math.cos(lag), rtol=1e-5)


def test_the_equilibrium_is_not_taken_across_a_hidden_turn() -> None:
    """Use a swing of amplitude 1 about 0.1, in which the third of seven turning points is missing."""
    angle = np.array([1.1, -0.9, -0.9, 1.1, -0.9, 1.1, -0.9])
    assert equilibrium(TurningPoints(np.arange(7.0), angle, np.full(7, 0.01))) == pytest.approx(0.1)
    four = TurningPoints(np.arange(4.0), angle[1:5], np.full(4, 0.01))
    assert equilibrium(four) == pytest.approx(0.1)
    with pytest.raises(RecordingError, match="needs at least 3 turning points in a row, the series has 3"):
        equilibrium(TurningPoints(np.arange(3.0), angle[1:4], np.full(3, 0.01)))


def test_a_gap_with_no_clear_count_is_refused() -> None:
    """Successive oscillations are 1 % faster, so 20 hidden ones cannot be counted with the period of their neighbours.
    """
    time = np.arange(0.0, 60.0, 0.01)
    chirp = Swing(time, np.cos(4.0 * time + 0.02 * time**2))
    torn = without(chirp, (12.0, 41.0))
    with pytest.raises(RecordingError, match=r"a whole number of oscillations in the gap between .* give \d+\.\d+"):
        period(torn)
    assert period(torn, n=3).value == period(chirp, n=3).value


def test_n_ends_at_the_first_crossing_that_was_seen() -> None:
    torn = without(damped(), GAPS["four and a half"])
    assert period(torn, n=2).value == pytest.approx(PERIOD, rel=1e-4)
    assert period(torn, n=5).value == pytest.approx(PERIOD, rel=1e-4)


@pytest.mark.parametrize("amplitude", [0.1, 1.0])
def test_a_log_of_changes_has_no_gaps(amplitude: float) -> None:
    """An encoder that writes a line only at a new count is silent around turning points, which is not a gap."""
    fine = damped(amplitude=amplitude, quantum=math.tau / 1200, step=0.0005, duration=30.0)
    changes = np.flatnonzero(np.diff(fine.angle)) + 1
    log = Swing(fine.time[changes], fine.angle[changes])
    points, whole = turning_points(log), turning_points(fine)
    silence = np.sqrt(2 * math.tau / 1200 / whole.amplitude) / OMEGA
    assert (np.abs(points.time - whole.time) < silence).all()
    np.testing.assert_allclose(points.amplitude, whole.amplitude, atol=math.tau / 1200)
    assert period(log).value == pytest.approx(PERIOD, rel=1e-3)


@pytest.mark.quick("30-0.0146")
@pytest.mark.parametrize(("degrees", "more"), [(10, 0.0016), (30, 0.0146), (60, 0.0630), (90, 0.1636)])
def test_linear_drag_takes_more_of_large_swings(degrees: float, more: float) -> None:
    """Compare with the energy loss in an undamped half swing, from complete elliptic integrals; decay_rate's docstring
    has the values."""
    from scipy.integrate import solve_ivp

    gamma, time = 1e-3, np.arange(0.0, 20.0, 0.01)
    made = solve_ivp(lambda _, y: [y[1], -40.0 * math.sin(y[0]) - gamma * y[1]], (0.0, 20.0),
                     [math.radians(degrees), 0.0], t_eval=time, method="DOP853", rtol=1e-12, atol=1e-13)
    assert decay_rate(Recording(time, made.y[0], "made")).value / gamma - 1.0 == pytest.approx(more, rel=0.06)
