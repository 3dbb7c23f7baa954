"""A billion steps of three methods, and the law by which each one's errors grow.

The mathematical pendulum (scene `vacuum` with gravity 1 m/s², so omega0 = 1/s) is released from 1 rad and takes steps
of omega0 h = 0.05, for 8 million periods. Laws (Hairer, Lubich & Wanner 2006, Geometric Numerical Integration, I.1,
IX.8 and X.3; Brouwer 1937, Astron. J. 46, 149), as powers of the number of steps n:

    method            energy                 angle
    velocity_verlet   n^0, bounded           n^1, a wrong period
    rk4               n^1, steady loss       n^2, a period that drifts with the energy
    kahan_li8         n^1/2 to n^1, rounding n^3/2 to n^2, rounding

The tables have the largest errors up to n: of the energy, relative, and of the angle; "lost" is an error above 1 rad.

    python examples/benchmarks/billion_steps.py [--steps 1000000000]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence

import numpy as np
from machine import describe
from numpy.typing import NDArray

from pendulum_env import Rollout, rollout
from pendulum_env.physics import exact

H, START = 0.05, 1.0
"""omega0 h, and initial angle [rad]."""
EARLY, OFTEN, EVERY = 1_000_000, 97, 9973
"""Steps of a first run, and steps between records of the first and of the long run: primes, so that records have all
phases of the swing."""
LAWS = {"velocity_verlet": ((0.0, 0.0), (1.0, 1.0)), "rk4": ((1.0, 1.0), (2.0, 2.0)),
        "kahan_li8": ((0.0, 1.0), (1.0, 2.0))}
"""Method -> least and largest exponent of the energy's error and of the angle's, while both are small."""
SCATTER, SMALL = 0.25, 0.1
"""Scatter of an exponent that one decade gives, and largest relative error that counts as small."""
Array = NDArray[np.float64]


def measured(name: str, steps: int, every: int) -> Rollout:
    """Return the run of a method, recorded every ``every`` steps."""
    return rollout("vacuum", gravity=1.0, integrator=name, angle=START, velocity=0.0, dt=H, duration=steps * H,
                   every=every, backend="compiled", warn=False)


def errors(runs: Sequence[Rollout]) -> tuple[Array, Array, Array]:
    """Return numbers of steps, and the largest errors so far: of the energy, relative, and of the angle [rad].

    Of each run after the first, only records after the end of the one before count.
    """
    energy = [np.abs(run.energy_residual) / run.energy[0] for run in runs]
    angle = [np.abs(run.angle - exact.pendulum(run.time, START, 0.0, 1.0)[0]) for run in runs]
    ends = (-1.0, *(run.time[-1] for run in runs))
    later = [run.time > end for run, end in zip(runs, ends, strict=False)]
    times, *sizes = (np.concatenate([rows[keep] for rows, keep in zip(parts, later, strict=True)])
                     for parts in ([run.time for run in runs], energy, angle))
    return times / H, np.maximum.accumulate(sizes[0]), np.maximum.accumulate(sizes[1])


def exponent(counts: Array, sizes: Array, limit: float) -> float:
    """Return the exponent of a power law, from the last tenfold growth of n with errors below ``limit``; nan: none.
    """
    small = np.flatnonzero((sizes < limit) & (counts > 0))
    if not small.size or counts[small[-1]] < 10.0 * counts[small[0]]:
        return float("nan")
    last = int(small[-1])
    first = int(np.searchsorted(counts, counts[last] / 10.0))
    return float(np.log(sizes[last] / sizes[first]) / np.log(counts[last] / counts[first]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=10**9)
    options = parser.parse_args()
    print(describe(("numpy", "numba")))
    for name, laws in LAWS.items():
        early = measured(name, EARLY, OFTEN)
        begun = time.perf_counter()
        late = measured(name, options.steps, EVERY)
        taken = time.perf_counter() - begun
        counts, *pair = errors((early, late))
        powers = [exponent(counts, sizes, SMALL) for sizes in pair]
        print(f"\n{name}: {options.steps:.0e} steps in {taken:.0f} s, {1e9 * taken / options.steps:.1f} ns each; "
              f"energy error ~ n^{powers[0]:.2f}, angle ~ n^{powers[1]:.2f}")
        for power in range(4, 12):
            if 10**power <= options.steps:
                row = int(np.searchsorted(counts, 10.0**power * (1.0 - 1e-3)))
                row = min(row, len(counts) - 1)
                angle = f"{pair[1][row]:.2e} rad" if pair[1][row] < 1.0 else "lost"
                print(f"  n = 1e{power}: energy {pair[0][row]:.2e}, angle {angle}")
        for what, power, (least, most) in zip(("energy", "angle"), powers, laws, strict=True):
            kept = np.isnan(power) or least - SCATTER <= power <= most + SCATTER
            print(f"  law of the {what}: n^{least:g} to n^{most:g}, {'as it says' if kept else 'NOT KEPT'}"
                  f"{' (too soon lost for a measurement)' if np.isnan(power) else ''}")


if __name__ == "__main__":
    main()
