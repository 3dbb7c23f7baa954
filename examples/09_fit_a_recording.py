"""From a sensor's recording to the scene it calls for: measured as on the lab sheet, then fitted (here, 8 s of it).

The recording comes with the package and is simulated, so that the truth is known: a ball of 10 g and 4 cm at 0.353 m,
linear and quadratic drag, a sensor with steps of a quarter of a degree.
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
found = fit(Recording(swing.time[early], swing.angle[early], "the first 8 s"), "linear+quadratic", **BALL)
for name, measured in found.parameters.items():
    print(f"{name:18s} {measured}")
for name, value in TRUTH.items():
    measured = found.parameters[name]
    assert abs(measured.value - value) < 4.0 * measured.error

run = rollout(found.scene, integrator="dop853", dt=0.01)
left = np.degrees(np.interp(found.recording.time, run.time, run.angle) - found.recording.angle)
print(f"{found.scene.equation()}: {np.sqrt(np.mean(left**2)):.3f} degrees from the recording (rms)")
assert np.sqrt(np.mean(left**2)) < 0.1
