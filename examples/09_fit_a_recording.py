"""Measure a sensor's recording as on the lab sheet, then fit a scene to its first 8 s.

The recording comes with the package. It is simulated, so the true parameters are known: a ball of 10 g and 4 cm at
0.353 m, linear and quadratic drag, and a sensor with a resolution of a quarter of a degree.
"""

import numpy as np

from pendulum_env import Recording, fit, measure, rollout
from pendulum_env.lab import simulated_recording
from pendulum_env.lab.simulated import true_scene

BALL = {"mass": 0.01, "radius": 0.02}
TRUTH = {"length": 0.353, "linear_drag.gamma": 0.03, "quadratic_drag.c": 0.0106311}

recording = simulated_recording()
print(recording)
sheet = measure(recording, **BALL)
print(sheet.text)
assert abs(sheet.omega0.value - true_scene().omega0) < 4.0 * sheet.omega0.error
assert sheet.cycles.spread < 3e-3

swing = recording.released()
early = swing.time < 8.0
result = fit(Recording(swing.time[early], swing.angle[early], "the first 8 s"), "linear+quadratic", **BALL)
for name, measured in result.parameters.items():
    print(f"{name:18s} {measured}")
for name, value in TRUTH.items():
    measured = result.parameters[name]
    assert abs(measured.value - value) < 4.0 * measured.error

run = rollout(result.scene, integrator="dop853", dt=0.01)
residuals = np.degrees(np.interp(result.recording.time, run.time, run.angle) - result.recording.angle)
print(f"{result.scene.equation()}: {np.sqrt(np.mean(residuals**2)):.3f} degrees from the recording (rms)")
assert np.sqrt(np.mean(residuals**2)) < 0.1
