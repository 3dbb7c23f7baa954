"""Times of devices beside the times that a second clock gives: units, overflow, restarts, damaged lines."""

from __future__ import annotations

import numpy as np
import pytest

from pendulum_env.bench.clock import COUNTER, DeviceClock

STEP = 0.01


def heard(clock: DeviceClock, raw: list[float], host: list[float]) -> tuple[np.ndarray, np.ndarray, int]:
    """Return the seconds, the numbers of the samples that are kept, and the number of lost ones, heard one by one."""
    seconds: list[float] = []
    kept: list[float] = []
    lost = 0
    for number, (time, at) in enumerate(zip(raw, host, strict=True)):
        more, values, missing = clock.take([time], [float(number)], at)
        seconds, kept, lost = seconds + more, kept + values, lost + missing
    return np.array(seconds), np.array(kept, dtype=int), lost


TRUE = (STEP * np.arange(300)).tolist()
"""True times of samples [s]."""


@pytest.mark.parametrize(("per_second", "word"), [(1.0, "seconds"), (1e3, "milliseconds"), (1e6, "microseconds")])
@pytest.mark.parametrize("start", [0.0, 1234.0])
def test_the_unit_is_that_of_growth_in_a_second(per_second: float, word: str, start: float) -> None:
    clock = DeviceClock()
    seconds, kept, lost = heard(clock, [per_second * (start + t) for t in TRUE], TRUE)
    assert kept.tolist() == list(range(300))
    assert lost == 0
    assert np.abs(seconds - TRUE).max() < 1e-9
    assert [note.endswith(f"read as {word}") for note in clock.notes] == [True]


def test_a_counter_that_overflows_goes_on() -> None:
    clock = DeviceClock("us")
    seconds, _, lost = heard(clock, [(COUNTER - 1_000_000 + 1e6 * t) % COUNTER for t in TRUE], TRUE)
    assert np.abs(seconds - TRUE).max() < 1e-9
    assert lost == 0
    assert clock.notes == []


def test_a_device_that_restarts_goes_on_by_the_hosts_clock() -> None:
    """It runs for a second from 5 s on, is gone for 2 s, and starts again at 0."""
    clock = DeviceClock("ms")
    host = TRUE[:100] + [t + 2.0 for t in TRUE[100:]]
    raw = [5000.0 + 1e3 * t for t in TRUE[:100]] + [1e3 * t for t in TRUE[:200]]
    seconds, kept, lost = heard(clock, raw, host)
    assert kept.tolist() == list(range(300))
    assert np.abs(seconds - host).max() < 1e-9
    assert lost == 200
    assert len(clock.notes) == 1
    assert clock.notes[0].startswith("the device restarted at 3.000 s: ")


@pytest.mark.parametrize(("first", "same"), [(8000.0, True), (30_000.0, False), (100.0, False)])
def test_after_an_interruption_the_clock_is_kept_if_it_agrees_with_the_hosts(first: float, same: bool) -> None:
    """Gone for 2 s after 1 s: a clock that shows 8 s went on; 30 s is one that restarted long ago, 0.1 s just now."""
    clock = DeviceClock("ms")
    before = heard(clock, [5000.0 + 1e3 * t for t in TRUE[:100]], TRUE[:100])
    clock.interrupt()
    seconds, _, lost = heard(clock, [first + 1e3 * t for t in TRUE[:100]], [2.99 + 0.05 + t for t in TRUE[:100]])
    assert before[0][-1] == pytest.approx(0.99)
    assert seconds[0] == pytest.approx(3.0 if same else 3.04)
    assert seconds[-1] == pytest.approx(seconds[0] + 0.99)
    assert lost == (200 if same else 204)
    assert ("restarted" in clock.notes[0]) is not same


@pytest.mark.parametrize("damaged", [3.0, 0.0, 1234567.0, 950.0])
def test_a_damaged_time_is_dropped(damaged: float) -> None:
    clock = DeviceClock("ms")
    raw = [1e3 * t for t in TRUE]
    raw[100] = damaged
    seconds, kept, lost = heard(clock, raw, TRUE)
    assert kept.tolist() == [n for n in range(300) if n != 100]
    assert np.abs(seconds - np.delete(TRUE, 100)).max() < 1e-9
    assert lost == 1
    assert clock.notes == []


def test_a_pause_is_told_and_its_samples_counted() -> None:
    clock = DeviceClock("s")
    times = TRUE[:100] + [t + 3.0 for t in TRUE[100:]]
    seconds, kept, lost = heard(clock, times, times)
    assert np.abs(seconds - times).max() < 1e-9
    assert kept.tolist() == list(range(300))
    assert lost == 300
    assert clock.notes == ["no lines for 3.01 s from 0.990 s on"]


def test_times_that_repeat_are_dropped_and_counted() -> None:
    clock = DeviceClock("ms")
    seconds, kept, lost = heard(clock, [float(round(400 * t)) for t in TRUE], [0.4 * t for t in TRUE])
    assert np.all(np.diff(seconds) > 0)
    assert lost == 0
    clock = DeviceClock("ms")
    seconds, kept, lost = heard(clock, [float(int(1e3 * 0.05 * t)) for t in TRUE], [0.05 * t for t in TRUE])
    assert np.all(np.diff(seconds) > 0)
    assert lost == 300 - len(kept) > 0
    assert len(clock.notes) == 1
