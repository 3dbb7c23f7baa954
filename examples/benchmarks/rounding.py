"""Growth of rounding errors of the energy: kahan_li8 at omega0 h = 0.05, plain and compensated, for many starts.

The mathematical pendulum (scene `vacuum` with gravity 1 m/s², so omega0 = 1/s) is released at rest from angles between
0.2 and 2.8 rad. The method's own energy error stays near 1e-16, so the error that grows is rounding. The energy is
computed in 40 digits from angle and velocity with their stored rounding errors. Goals: with compensated sums, the rms
error grows no faster than the square root of the number of steps and ends at least 10 times smaller than without.

    python examples/benchmarks/rounding.py [--steps 10000000] [--starts 64] [--figure rounding.png]
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import mpmath
import numpy as np
from machine import describe
from numpy.typing import NDArray

from pendulum_env import rollout
from pendulum_env.common.progress import progress_bar

METHOD, H, ROWS = "kahan_li8", 0.05, 1000
GOAL_SLOPE, GOAL_RATIO = 0.5, 10.0
Array = NDArray[np.float64]


def starts(count: int) -> Array:
    """Return random initial angles [rad]."""
    return np.random.default_rng(0).uniform(0.2, 2.8, count)


def energy_errors(compensated: bool, angles: Array, steps: int, rows: int = ROWS) -> tuple[Array, Array]:
    """Return numbers of steps, and the energy minus the initial energy, ``(starts, times)``, in units of m g L."""
    with progress_bar(f"{len(angles)} starts, {'compensated' if compensated else 'plain'}") as bar:
        run = rollout("vacuum", gravity=1.0, integrator=METHOD, angle=angles, velocity=0.0, dt=H, duration=steps * H,
                      every=steps // rows, compensated=compensated, backend="compiled", progress=bar)
        none = np.zeros(run.angle.shape)
        parts = [none if lost is None else lost for lost in (run.lost_angle, run.lost_velocity)]
        return run.time / H, errors_of(run.angle, run.velocity, *parts)


def errors_of(angle: Array, velocity: Array, lost_angle: Array, lost_velocity: Array) -> Array:
    """Return the energy ``v**2/2 + 2 sin(q/2)**2`` minus its first value, in 40 digits.

    The stored rounding errors are added to angle and velocity.
    """
    errors = np.empty(angle.shape)
    with mpmath.workdps(40):
        for row, *values in zip(errors, angle, velocity, lost_angle, lost_velocity, strict=True):
            first = None
            for i, (q, v, low_q, low_v) in enumerate(zip(*(value.tolist() for value in values), strict=True)):
                sine, speed = mpmath.sin((mpmath.mpf(q) + low_q) / 2), mpmath.mpf(v) + low_v
                energy = speed * speed / 2 + 2 * sine * sine
                first = energy if first is None else first
                row[i] = energy - first
    return errors


def rms(errors: Array) -> Array:
    """Return the root mean square over the starts."""
    return np.sqrt(np.mean(errors * errors, axis=0))


def slope(counts: Array, errors: Array) -> float:
    """Return the slope of log rms against log n, by least squares with equal weight for equal intervals of log n."""
    wanted = np.unique(np.searchsorted(counts, np.geomspace(counts[1], counts[-1], 60)))
    return float(np.polyfit(np.log(counts[wanted]), np.log(rms(errors[:, wanted])), 1)[0])


def scatter(counts: Array, errors: Array, draws: int = 200) -> float:
    """Return the standard error of the slope, by bootstrap over the starts."""
    random = np.random.default_rng(1)
    return float(np.std([slope(counts, errors[random.integers(0, len(errors), len(errors))]) for _ in range(draws)]))


def draw(file: Path, counts: Array, errors_by_sum: dict[str, Array]) -> None:
    """Draw both rms errors with square roots for comparison."""
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    colours = {"plain": "#b3261e", "compensated": "#1f5fa8"}
    figure, axes = plt.subplots(figsize=(7.2, 4.6), layout="constrained")
    for name, errors in errors_by_sum.items():
        sizes = rms(errors)[1:]
        axes.loglog(counts[1:], sizes, color=colours[name], linewidth=1.8)
        root = sizes[-1] * np.sqrt(counts[1:] / counts[-1])
        axes.loglog(counts[1:], root, color=colours[name], linewidth=0.9, linestyle=(0, (4, 3)), alpha=0.7)
        middle = len(sizes) // 12
        axes.annotate(f"{name}: grows as n$^{{{slope(counts, errors):.2f}}}$", (counts[1 + middle], sizes[middle]),
                      xytext=(0, 16), textcoords="offset points", ha="right", color=colours[name], fontsize=11)
    axes.set(xlabel="steps", ylabel="rms error of the energy [m g L]", xlim=(counts[1], counts[-1]))
    axes.set_title(f"{METHOD}, $\\omega_0 h$ = {H}, {len(errors_by_sum['plain'])} starts; dashed: $\\sqrt{{n}}$",
                   fontsize=11)
    axes.grid(which="major", color="0.88", linewidth=0.7)
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(file, dpi=160)
    plt.close(figure)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=10**7)
    parser.add_argument("--starts", type=int, default=64)
    parser.add_argument("--figure", type=Path)
    options = parser.parse_args()
    print(describe(("numpy", "numba", "mpmath")))
    angles = starts(options.starts)
    errors: dict[str, Array] = {}
    for name in ("plain", "compensated"):
        begun = time.perf_counter()
        counts, errors[name] = energy_errors(name == "compensated", angles, options.steps)
        taken = time.perf_counter() - begun
        print(f"{name:12s} rms {rms(errors[name])[-1]:.3g} m g L after {options.steps:.0e} steps, slope "
              f"{slope(counts, errors[name]):.2f} +- {scatter(counts, errors[name]):.2f}, {taken:.0f} s")
    ratio = rms(errors["plain"])[-1] / rms(errors["compensated"])[-1]
    print(f"plain/compensated at the end: {ratio:.0f} (goal: at least {GOAL_RATIO:.0f}); "
          f"goal for the compensated slope: at most {GOAL_SLOPE} within its scatter")
    if options.figure is not None:
        draw(options.figure, counts, errors)
        print(f"drawn to {options.figure}")
    assert ratio >= GOAL_RATIO
    assert slope(counts, errors["compensated"]) - 2.0 * scatter(counts, errors["compensated"]) <= GOAL_SLOPE


if __name__ == "__main__":
    main()
