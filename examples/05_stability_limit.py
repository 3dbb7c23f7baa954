"""How long a step may be: rk4's stability limit, computed from its table, then seen in runs on either side of it."""

from integrators.analysis import spectral_radius, stability_limit
from pendulum_env import SCENES, rollout

limit = stability_limit("rk4")
print(f"rk4 holds the oscillator up to omega0 h = {limit:.6f}")
assert abs(limit - 8**0.5) < 1e-15

for share in (0.99, 1.01):
    dt = share * limit / SCENES["textbook"].omega0
    run = rollout("textbook", integrator="rk4", angle=0.1, velocity=0.0, dt=dt, duration=400 * dt, warn=False)
    steps = len(run.time) - 1
    growth = (run.energy[-1] / run.energy[0]) ** (0.5 / steps)
    predicted = spectral_radius("rk4", share * limit)
    print(f"{share} of it: a step multiplies the amplitude by {growth:.5f}, predicted {predicted:.5f} ({steps} steps)")
    assert abs(growth - predicted) < 1e-2
    assert (growth > 1) == (share > 1)
