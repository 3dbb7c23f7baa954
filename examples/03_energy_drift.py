"""The error in the energy balance, separate from heat and work, in the default scene `lab`."""

import numpy as np

from pendulum_env import rollout

print("method               heat [J]     largest residual [J]")
for integrator in ("symplectic_euler", "velocity_verlet", "heun", "rk4"):
    run = rollout("lab", integrator=integrator, angle=1.0, dt=0.01, duration=20.0)
    worst = np.max(np.abs(run.energy_residual))
    print(f"{integrator:18s} {run.ledger.heat[-1]:10.6f}     {worst:.1e}")
    assert np.isclose(run.energy[-1] - run.energy[0], -run.ledger.heat[-1] + run.energy_residual[-1], rtol=1e-12)

finer = rollout("lab", integrator="rk4", angle=1.0, dt=0.005, duration=20.0)
ratio = worst / np.max(np.abs(finer.energy_residual))
print(f"rk4 with half the step: residual {ratio:.0f} times smaller")
assert ratio > 16
