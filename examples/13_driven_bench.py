"""Fit two logs of a motor bench, decide between two published sets of its numbers, and predict each log by the other.

The bench is the torque-limited simple pendulum of Wiebe et al. 2022 (J. Open Source Softw. 7, 3884). Its geometry and
its published identification contradict each other. The free swing decides, as its frequency does not depend on the
scale of the torque column: omega0**2 is M g/I. The logs are in the folder that LAB_PENDULUM_DATA names.
"""

import os
from pathlib import Path

import numpy as np

from pendulum_env.lab import DrivenLog, fit_driven

NAMES = ("driven_bench_planned.csv", "driven_bench_energy_shaping.csv")
SETS = {"geometry": (0.1396, 0.304, None), "identification": (0.0626, 0.1022, (0.047, 0.184))}
"""Published moment of inertia [kg m²], moment of the mass [kg m], and viscous [N m s] and dry friction [N m]."""


def held(inertia, moment, friction, scaled):
    """Return the numbers of the equation of motion that a published set gives, without the torque's if it is scaled."""
    numbers = {"stiffness": 9.81 * moment / inertia, **({} if scaled else {"drive": 1.0 / inertia})}
    return numbers | ({} if friction is None else {"viscous": friction[0] / inertia, "dry": friction[1] / inertia})


def ahead(found, log, seconds, every=0.5):
    """Return the median error of the angle [rad] after open-loop predictions from starts every half second."""
    starts = np.arange(log.time[0], log.time[-1] - seconds - 0.1, every)
    return float(np.median([found.predict(log, start, seconds + 0.05).error_after(seconds) for start in starts]))


def main():
    folder = os.environ.get("LAB_PENDULUM_DATA")
    if not folder:
        print("This example needs 2 real logs; LAB_PENDULUM_DATA names no folder with them.")
        return
    logs = [DrivenLog.read(Path(folder) / name) for name in NAMES]
    both = fit_driven(logs)
    print(both.text, *(f"{name:18s} {one}" for name, one in both.parameters.items()), sep="\n")

    fits = {"this fit": both}
    for name, (inertia, moment, friction) in SETS.items():
        for scaled in (False, True):
            label = f"{name}, torque {'scaled' if scaled else 'as logged'}"
            fits[label] = fit_driven(logs, hold=held(inertia, moment, None, scaled))
            if friction and not scaled:
                fits[f"{label}, its friction"] = fit_driven(logs, hold=held(inertia, moment, friction, scaled))
    print(f"{'':42s}omega0²  rms of half swings  after 1 s")
    for label, found in fits.items():
        print(f"{label:42s}{found.solution.rates[0]:6.2f}{found.solution.rms:16.4f} rad"
              f"{np.mean([ahead(found, log, 1.0) for log in logs]):13.3f} rad")

    for one, other in (logs, logs[::-1]):
        found = fit_driven(one)
        first = found.predict(other, duration=3.1)
        print(f"{other.source} from the fit of {one.source}: off by {first.error_after(1.0):.3f} rad after 1 s, "
              f"{first.error_after(3.0):.3f} rad after 3 s; typically {ahead(found, other, 1.0):.3f} and "
              f"{ahead(found, other, 3.0):.3f} rad from other starts")
        assert first.error_after(1.0) < 0.1
    assert fits["geometry, torque scaled"].solution.rms < fits["identification, torque scaled"].solution.rms


if __name__ == "__main__":
    main()
