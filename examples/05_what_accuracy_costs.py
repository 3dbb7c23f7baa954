"""Cost of accuracy: the force evaluations and the time that several methods need for a given angle error after 2 s.

A dash means that no step of the list is short enough.
"""

import numpy as np
from scipy.special import ellipj

import integrators
from pendulum_env import SCENES, cost, rollout

RUN = {"angle": 1.0, "velocity": 0.0, "duration": 2.0}
ERRORS = (1e-3, 1e-6, 1e-9)  # [rad]
MOST = {"symplectic_euler": 2**13, "velocity_verlet": 2**16, "rk4": 2**11, "dop853": 2**9}  # evaluations per second

print(f"{'error at most [rad]':19s}" + "".join(f"{error:>22.0e}" for error in ERRORS) + "   each further digit")
for name, most in MOST.items():
    method = integrators.get(name)
    steps = [method.evaluations * 2**k / most for k in range(14)]
    study = cost("vacuum", [name], steps=[step for step in steps if step <= 0.25], repeats=1, **RUN)
    row = f"{name:19s}"
    for error in ERRORS:
        good = [point for point in study.of(name) if point.angle_error <= error]
        cheapest = min(good, key=lambda point: point.evaluations, default=None)
        row += f"{cheapest.evaluations:9.0f} in {1e3 * cheapest.time:6.3f} ms" if cheapest else f"{'-':>22s}"
    digit = study.digit_cost(name)
    print(f"{row}{digit:13.2f} times")
    assert abs(digit / 10 ** (1 / method.order) - 1) < 0.02  # the error is C h**order

run = rollout("vacuum", integrator=name, dt=cheapest.dt, **RUN)
k = np.sin(0.5)  # sine of half the amplitude, for the closed form of the pendulum with scipy's elliptic functions
_, cn, dn, _ = ellipj(SCENES["vacuum"].omega0 * run.time, k**2)
off = np.max(np.abs(run.angle - 2.0 * np.arcsin(k * cn / dn)))
print(f"the last of these, {name} with steps of {cheapest.dt:.2g} s, is off by {off:.1e} rad at most")
assert off < 1e-9
assert off > 0.99 * cheapest.angle_error
