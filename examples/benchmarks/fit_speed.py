"""Time of a fit of 14 000 readings over 125 cycles, cold and warm, compared with scipy.

The recording is like a file of an encoder: 137 s at 10 ms from 94 degrees, 1200 counts per turn. This package fits one
model and all models of ``effects="auto"``, in new processes with an empty and a filled cache. scipy uses ``solve_ivp``
(DOP853, error 1e-6 rad at the end) and ``least_squares`` with the same data, the same model of six parameters and the
same start. All run one after the other with one thread. Times are processor seconds, which other processes affect
little. Then there is the posterior of the package's simulated recording, 32 walkers and 1500 steps, beside the same
number of evaluations of a density by ``solve_ivp``, of which 40 are timed. The last line is the recording of a phone's
accelerometer on a rod, 3 minutes at 500 Hz with three axes, which is read and fitted by all models.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("NUMBA_NUM_THREADS", "1")

import math
import subprocess
import sys
import tempfile
import time
from typing import Any

import numpy as np
from machine import describe

from pendulum_env import rollout
from pendulum_env.lab import Recording, VirtualSensor, simulated_recording
from pendulum_env.lab.fitting.fit import fit

LENGTH, MASS, GAMMA, DRAG = 0.3, 0.1, 0.015, 0.004
QUANTUM = math.radians(0.3)
PLACES: dict[str, Any] = {"length": 0.28, "mass": MASS}
MODELS = ("linear+quadratic", "linear+quadratic+coulomb", "auto")


def recorded() -> Recording:
    """Return a simulated recording of 13 701 readings, rounded to counts."""
    run = rollout("vacuum", integrator="rk4", damping={"linear": {"gamma": GAMMA}, "quadratic": {"c": DRAG}},
                  angle=math.radians(94.0), velocity=0.0, length=LENGTH, mass=MASS, dt=0.005, every=2, duration=137.0,
                  diagnostics=(), backend="python")
    return VirtualSensor(quantum=QUANTUM, rate=100.0, zero="bottom").record(run)


def scipys(recording: Recording, start: np.ndarray) -> tuple[float, np.ndarray]:
    """Fit with scipy; return the seconds and the values of angle, velocity, zero, length, gamma and c."""
    from scipy.integrate import solve_ivp
    from scipy.optimize import least_squares

    def residuals(x: np.ndarray) -> np.ndarray:
        def slope(_t: float, y: np.ndarray) -> list[float]:
            return [y[1], -9.81 / x[3] * math.sin(y[0]) - (x[4] + x[5] * abs(y[1])) * y[1]]

        run = solve_ivp(slope, (0.0, float(recording.time[-1])), x[:2], "DOP853", recording.time, rtol=1e-8, atol=1e-9)
        return np.asarray(x[2] + run.y[0] - recording.angle)

    begun = time.process_time()
    solution = least_squares(residuals, start, x_scale=[0.1, 0.1, 0.01, 1e-3, 0.01, 0.01], diff_step=1e-6)
    return time.process_time() - begun, solution.x


def own(model: str) -> None:
    """Print the seconds of a first and a second fit in this process, the fitted model and its values."""
    recording = recorded()
    spans = []
    for _ in range(2):
        begun = time.process_time()
        result = fit(recording, model, **PLACES)
        spans.append(time.process_time() - begun)
    print(*spans, result.damping, *result.values)


def sampled() -> str:
    """Return a sentence with the seconds of a posterior, and of as many evaluations of its density by scipy."""
    from scipy.integrate import solve_ivp

    found = fit(simulated_recording(), "linear+quadratic", mass=0.01, radius=0.02)
    found.posterior(steps=60)
    begun = time.process_time()
    sample = found.posterior()
    own = time.process_time() - begun
    recording, count = found.recording, 40
    begun = time.process_time()
    for x in sample.samples[:count]:
        run = solve_ivp(lambda _t, y, x=x: [y[1], -9.81 / x[3] * math.sin(y[0]) - (x[4] + x[5] * abs(y[1])) * y[1]],
                        (0.0, float(recording.time[-1])), x[:2], "DOP853", recording.time, rtol=1e-7, atol=1e-8)
        np.sum((recording.angle - x[2] - run.y[0]) ** 2)
    plain = (time.process_time() - begun) / count * sample.log_density.size
    return (f"posterior, {sample.log_density.size} evaluations: {own:.1f} s, {sample.independent:.0f} independent "
            f"samples; the evaluations by scipy: {plain:.0f} s, {plain / own:.0f} times as long")


def phone() -> str:
    """Return a sentence with the seconds in which a phone's accelerations are read and fitted by all models."""
    place, reach = {"length": 0.8, "mass": MASS}, 0.7
    run = rollout("vacuum", integrator="rk4", damping={"linear": {"gamma": 0.02}}, angle=0.4, velocity=0.0, dt=0.002,
                  duration=180.0, diagnostics=(), backend="python", **place)
    turn = np.gradient(run.velocity, run.time)
    along = 9.81 * np.cos(run.angle) + reach * run.velocity**2
    across = 9.81 * np.sin(run.angle) + reach * turn
    noise = 0.02 * np.random.default_rng(0).standard_normal((len(run.time), 3))
    table = np.column_stack([run.time, np.stack([across, along, 0.0 * along], axis=1) + noise])
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "phone.csv")
        titles = ",".join(["Time (s)", *(f"Acceleration {axis} (m/s^2)" for axis in "xyz")])
        np.savetxt(path, table, "%.6f", ",", header=titles, comments="")
        spans = []
        for _ in range(2):
            begun = time.process_time()
            recording = Recording.read(path)
            read = time.process_time() - begun
            found = fit(recording, mass=MASS)
            spans.append(time.process_time() - begun)
    return (f"a phone's accelerometer, {len(table)} readings, all models: {spans[0]:.1f} s, {spans[1]:.1f} s again, of "
            f"which reading takes {read:.1f} s; length {found.parameters['length']}, {found.damping}")


def main() -> None:
    """Print the machine, the seconds of each fit, and the ratio to scipy's time."""
    print(describe(("numpy", "scipy", "numba")))
    recording, values = recorded(), np.zeros(6)
    print(f"{len(recording.time)} readings, {recording.time[-1]:g} s")
    warm = math.nan
    for model in MODELS:
        with tempfile.TemporaryDirectory() as folder:
            surroundings = {**os.environ, "LAB_PENDULUM_CACHE": folder}
            outputs = [subprocess.run([sys.executable, __file__, model], env=surroundings, check=True,
                                      capture_output=True,
                                   text=True).stdout.split() for _ in range(2)]
        (cold, _, damping, *_), (cached, again, *_) = outputs
        print(f"{model}: {float(cold):.2f} s cold, {float(cached):.2f} s from the cache, {float(again):.2f} s again"
              f" ({damping})")
        if model == MODELS[0]:
            warm, values = float(again), np.array([float(x) for x in outputs[1][3:]])
    span, theirs = scipys(recording, values * [1.0001, 1.0, 1.0, 1.00001, 1.02, 0.98])
    print(f"scipy, {MODELS[0]}, started within 2 % of the result: {span:.1f} s, {span / warm:.0f} times as long;"
          f" length {theirs[3]:.7f} m instead of {values[3]:.7f} m")
    print(sampled())
    print(phone())


if __name__ == "__main__":
    own(sys.argv[1]) if len(sys.argv) > 1 else main()
