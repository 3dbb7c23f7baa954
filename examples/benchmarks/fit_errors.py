"""Errors of fits to disturbed recordings: pulls of the whole and of both halves, for every kind of disturbance.

A swing with linear, quadratic or both dampings is simulated by scipy's ``solve_ivp``, with an equation of motion of its
own, and read with white noise sigma. The kinds of disturbance are a zero that drifts, a length that drifts as by
temperature, jitter of the times, a second mode at 1.01 times the frequency of the swing, one at 5 Hz, rounding to a
quantum, and jumps of the zero. Each is taken in several sizes, from 0.3 to 30 times sigma in the readings. Lengths,
dampings, durations, rates, amplitudes and noise are drawn at random, from fixed seeds. "plain" has the noise alone.

Every recording is fitted whole and in halves, with the true model and the length free. A pull is (fitted - true) /
error of the whole and of both halves, or the difference of the halves / error of the difference. The true value of what
drifts is its mean over the part that is fitted; the true angle and velocity are those at its start, with the second
mode near the frequency of the swing, which moves with it.

    python examples/benchmarks/fit_errors.py [--sizes 18] [--plain 200] [--jobs 2] [--file rows.jsonl]
    python examples/benchmarks/fit_errors.py --recordings video_decay_65cm.txt   (halves of files, which have no truth)

For each kind the benchmark prints the root mean square of the pulls of every parameter, which should be 0.8 to 1.3 for
all kinds together, and for "plain" the share of 95 % intervals that contain the truth, which should be 93 to 97 %.
Pulls of dampings at their bound 0 do not count. With ``--file`` an interrupted study continues where it stopped.

No error can show a second mode near the swing's frequency in less than a quarter of a beat, because parameters
describe nearly all of it: halves have 25 cycles or more here, and in shorter ones a length may be 30 errors off.
"""

from __future__ import annotations

import argparse
import math
import time
import warnings
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import nullcontext
from datetime import datetime, timezone
from typing import Any

import numpy as np
from machine import describe
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from pendulum_env import Scene, sweep
from pendulum_env.lab.fitting.fit import fit
from pendulum_env.lab.fitting.result import Fit
from pendulum_env.lab.recording import Recording, RecordingError
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import Gravity
from pendulum_env.physics.medium import air

Array = NDArray[np.float64]

KINDS = ("zero drift", "length drift", "jitter", "second mode", "5 Hz", "quantum", "jumps")
PLAIN = "plain"
SMALLEST, LARGEST = 0.3, 30.0
"""Sizes of disturbances in the readings, in standard deviations of the noise."""
GRAVITY = 9.81
MODELS = ("linear", "quadratic", "linear+quadratic")
RANGES = {"length": (0.2, 1.2), "amplitude": (10.0, 60.0), "periods": (50.0, 150.0), "rate": (15.0, 30.0),
          "noise": (0.02, 0.2), "loss": (0.3, 1.5), "share": (0.3, 0.7)}
"""Ranges of the random settings: length [m], amplitude [degrees], number of periods, rate of readings [Hz], noise
[degrees], logarithmic loss of amplitude in the run, and the share of linear damping in it."""
GOAL, COVERED = (0.8, 1.3), (0.93, 0.97)
PARTS = {"whole": (0.0, 1.0), "first": (0.0, 0.5), "last": (0.5, 1.0)}
SHORT = {"linear_drag.gamma": "gamma", "quadratic_drag.c": "c"}


def drawn(kind: str, size: float, seed: int) -> tuple[str, Recording, Any]:
    """Draw a disturbed recording; return its damping model, the recording, and a function that returns the true values
    of the fitted parameters between two times."""
    source = np.random.default_rng([seed, *kind.encode()])
    given = {name: float(source.uniform(*ends)) for name, ends in RANGES.items()}
    model = MODELS[int(source.integers(len(MODELS)))]
    length, amplitude = given["length"], math.radians(given["amplitude"])
    omega = math.sqrt(GRAVITY / length)
    span, sigma = given["periods"] * math.tau / omega, math.radians(given["noise"])
    linear = {"linear": 1.0, "quadratic": 0.0}.get(model, given["share"])
    gamma = 2.0 * given["loss"] * linear / span
    c = math.expm1(given["loss"] * (1.0 - linear)) * 3.0 * math.pi / (4.0 * amplitude * omega * span)
    shape = _course(source, span)
    grown = size * sigma * 16.0 / (amplitude * omega * span) if kind == "length drift" else 0.0

    def slope(t: float, y: Array) -> list[float]:
        now, rate = length * (1.0 + grown * shape(t)), length * grown * (shape(t + 1e-4) - shape(t - 1e-4)) / 2e-4
        return [y[1], -(GRAVITY * math.sin(y[0]) + 2.0 * rate * y[1]) / now - gamma * y[1] - c * abs(y[1]) * y[1]]

    nominal = np.arange(int(span * given["rate"])) / given["rate"]
    jitter = size * sigma / (amplitude * omega) * source.standard_normal(len(nominal)) if kind == "jitter" else 0.0
    run = solve_ivp(slope, (-0.5, span + 0.5), [amplitude, 0.0], "DOP853", rtol=1e-10, atol=1e-12, dense_output=True)
    angle = run.sol(np.clip(nominal + jitter, -0.5, span + 0.5))[0]
    zero = math.radians(source.uniform(-2.0, 2.0)) + np.zeros(len(nominal))
    mode, turn = {"second mode": 1.01 * omega, "5 Hz": 10.0 * math.pi}.get(kind, 0.0), source.uniform(0.0, math.tau)
    other = size * sigma * np.cos(mode * nominal + turn) if mode else np.zeros(len(nominal))
    near = size * sigma if kind == "second mode" else 0.0
    if kind == "zero drift":
        zero += size * sigma * np.array([shape(t) for t in nominal])
    if kind == "jumps":
        for at in source.uniform(0.0, span, 3):
            zero += np.where(nominal > at, size * sigma * source.choice([-1.0, 1.0]), 0.0)
    seen = angle + zero + other + sigma * source.standard_normal(len(nominal))
    if kind == "quantum":
        quantum = size * sigma
        seen = quantum * np.round(seen / quantum)
    recording = Recording(nominal, seen, f"{kind} {size:.2g}")

    def truth(begin: float, end: float) -> dict[str, float]:
        part = (nominal >= begin - 1e-9) & (nominal <= end + 1e-9)
        state, phase, mean = run.sol(begin), mode * begin + turn, float(np.mean([shape(t) for t in nominal[part]]))
        return {"angle": float(state[0]) + near * math.cos(phase), "zero": float(np.mean(zero[part])),
                "velocity": float(state[1]) - near * mode * math.sin(phase), "length": length * (1.0 + grown * mean),
                "gamma": gamma, "c": c}

    return model, recording, truth


def _course(source: np.random.Generator, span: float) -> Any:
    """Return a random course of a drift in time, of range 1 and odd about the middle: a line, warming up, or a wave."""
    sign, kind, quick = source.choice([-1.0, 1.0]), int(source.integers(3)), source.uniform(0.15, 0.6) * span
    turn, beat = source.uniform(0.0, math.tau), math.tau / (source.uniform(0.7, 2.5) * span)
    if kind == 0:
        return lambda t: sign * (t / span - 0.5)
    if kind == 1:
        return lambda t: sign * (1.0 - math.exp(-max(t, 0.0) / quick))
    return lambda t: 0.5 * sign * math.sin(beat * t + turn)


def fitted(recording: Recording, model: str, part: str) -> tuple[Fit, float, float]:
    """Fit a part of a recording; return the fit and the times of the recording at its start and its end."""
    low, high = (share * float(recording.time[-1]) for share in PARTS[part])
    keep = (recording.time >= low) & (recording.time <= high)
    time, angle = recording.time[keep], recording.angle[keep]
    scene = Scene("drawn", Body(length=0.6, mass=0.05, radius=0.015), air(20.0), (Gravity(),))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        found = fit(Recording(time - time[0], angle, part), model, scene=scene, free=("length",),
                    jumps=False)  # a jump that is subtracted would make the zero another number than the truth's mean
    end = float(time[-1])
    return found, end - float(found.recording.time[-1]), end


def one(point: Mapping[str, Any]) -> dict[str, Any]:
    """Fit one recording whole and in halves; return pulls, tests of intervals and relative errors."""
    row: dict[str, Any] = {}
    begun, halves = time.perf_counter(), []
    try:
        model, recording, truth = drawn(point["kind"], point["size"], point["seed"])
        for part in PARTS:
            found, first, last = fitted(recording, model, part)
            true = truth(first, last)
            halves += [found] if part != "whole" else []
            row[f"freedom {part}"] = found.errors.freedom
            for name, value, error in zip(found.names, found.values, np.sqrt(np.diag(found.covariance)), strict=True):
                short = SHORT.get(name, name)
                if name in found.at_bound or not math.isfinite(error):
                    continue
                row[f"{short} pull {part}"] = float((value - true[short]) / error)
                low, high = found.interval(name, 0.95)
                row[f"{short} held {part}"] = bool(low <= true[short] <= high)
    except RecordingError as error:
        return {"failed": str(error)}
    return {**row, **halves_of(*halves), "seconds": time.perf_counter() - begun}


def halves_of(first: Fit, last: Fit) -> dict[str, float]:
    """Return the differences of the halves' parameters, in errors; those of their starts differ by themselves."""
    row = {}
    for name in first.names:
        one, other = first.parameters[name], last.parameters[name]
        if name not in (*first.at_bound, *last.at_bound, "angle", "velocity"):
            row[f"{SHORT.get(name, name)} pull halves"] = (one.value - other.value) / math.hypot(one.error, other.error)
    return row


def spread(rows: Sequence[Mapping[str, Any]], name: str, parts: Sequence[str]) -> float:
    """Return the root mean square of all pulls of a parameter; nan without any."""
    pulls = [row[key] for row in rows for part in parts if row.get(key := f"{name} pull {part}") is not None]
    return float(np.sqrt(np.mean(np.square(pulls)))) if pulls else math.nan


def table(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the lines of the benchmark's table."""
    names = ("angle", "velocity", "zero", "length", "gamma", "c")
    groups = {"whole": ["whole"], "halves": ["halves"], "first and last": ["first", "last"],
              "all pulls": ["whole", "halves", "first", "last"]}
    kinds = [kind for kind in (*KINDS, PLAIN) if any(row["kind"] == kind for row in rows)]
    lines = [f"{'rms of pulls':16s}{'recordings':>11s}  {'of':15s}" + "".join(f"{name:>10s}" for name in names)]
    wanted = [(kind, [row for row in rows if row["kind"] == kind]) for kind in kinds]
    wanted.append(("all disturbed", [row for row in rows if row["kind"] != PLAIN]))
    for title, own in wanted:
        good = [row for row in own if not row.get("failed")]
        for part, of in groups.items():
            numbers = [spread(good, name, of) for name in names]
            off = [title == "all disturbed" and (x < GOAL[0] or x > GOAL[1]) for x in numbers]
            lines.append(f"{title:16s}{len(good):11d}  {part:15s}" + "".join(
                f"{format(x, '.2f') if math.isfinite(x) else '-':>9s}{'*' if far else ' '}"
                for x, far in zip(numbers, off, strict=True)))
    for title in (PLAIN, "disturbed"):
        own = [row for row in rows if (row["kind"] == PLAIN) == (title == PLAIN)]
        shares = []
        for name in names:
            held = [row[f"{name} held {part}"] for row in own for part in PARTS
                    if row.get(f"{name} held {part}") is not None]
            shares.append(f"{np.mean(held):9.1%} " if held else f"{'-':>9s} ")
        lines.append(f"{title + ', 95 % hold':29s}{'all parts':15s}" + "".join(shares))
    failed = [row["failed"] for row in rows if row.get("failed")]
    return [*lines, f"{len(failed)} recordings were refused{f', such as: {failed[0]}' if failed else ''}"]


def points_of(sizes: int, plain: int, kinds: Sequence[str] = KINDS) -> list[dict[str, Any]]:
    """Return the points of the study: every kind in ``sizes`` sizes, and ``plain`` recordings without disturbance."""
    steps = np.geomspace(SMALLEST, LARGEST, sizes)
    return [*({"kind": kind, "size": float(size), "seed": i} for kind in kinds for i, size in enumerate(steps)),
            *({"kind": PLAIN, "size": 0.0, "seed": i} for i in range(plain))]


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description="Measure whether errors of fits hold for disturbed recordings.")
    parser.add_argument("--sizes", type=int, default=18, help="sizes of every kind of disturbance")
    parser.add_argument("--plain", type=int, default=200, help="recordings without disturbance")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--file", default=None, help="file for results; an interrupted study continues from it")
    parser.add_argument("--recordings", nargs="+", default=[], help="compare the halves of files instead")
    parser.add_argument("--model", default="linear+quadratic", help="damping model for --recordings")
    options = parser.parse_args(arguments)
    print(datetime.now(timezone.utc).strftime("%Y-%m-%d"), describe(("numpy", "scipy", "numba")), flush=True)
    for path in options.recordings:
        whole = Recording.read(path).released()
        first, last = (fitted(whole, options.model, part)[0] for part in ("first", "last"))
        print(path, *(f"{name}: {pull:+.2f}" for name, pull in halves_of(first, last).items()), sep="\n    ")
    if options.recordings:
        return
    with ProcessPoolExecutor(options.jobs) if options.jobs > 1 else nullcontext() as executor:
        study = sweep(points_of(options.sizes, options.plain), executor, run=one, file=options.file, progress=True)
    print(*table(study.rows), sep="\n")
    if not study.complete:
        print("interrupted; only the finished runs are counted")


if __name__ == "__main__":
    main()
