"""Sample the posterior of two drags that trade off in a short recording, and compare it with the fit's errors.

In the first 4 s of the simulated recording, linear and quadratic drag can hardly be told apart, and neither can be
below 0. The standard errors of least squares ignore this bound; the posterior respects it. Needs emcee and corner.
"""

import sys
import tempfile
from pathlib import Path

from pendulum_env import Recording, fit
from pendulum_env.lab import simulated_recording

TRUTH = {"length": 0.353, "linear_drag.gamma": 0.03, "quadratic_drag.c": 0.0106311}

swing = simulated_recording().released()
early = swing.time < 4.0
recording = Recording(swing.time[early], swing.angle[early], "the first 4 s")
result = fit(recording, "linear+quadratic", mass=0.01, radius=0.02)
posterior = result.posterior(walkers=32, steps=1500, seed=0)
print(posterior.text)
for name, value in TRUTH.items():
    low, high = posterior.interval(name)
    print(f"{name:18s} fit {result.parameters[name]}, posterior {low:.4g} to {high:.4g} (95 %), true {value:.4g}")
    assert low < value < high

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp())
posterior.plot().savefig(folder / "corner.png", dpi=80)
error = result.parameters["linear_drag.gamma"].error
print(f"gamma is known {error / posterior.parameters['linear_drag.gamma'].error:.1f} times better than its error says")
assert posterior.problem == ""
assert posterior.parameters["linear_drag.gamma"].error < 0.5 * error
