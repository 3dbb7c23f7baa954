"""Find the effects that matter in the scene `lab` at a given accuracy, and simulate 10 s without the others."""

import math

from pendulum_env import audit, simplify

goal = {"amplitude": math.radians(30.0), "tolerance": 1e-3}

result = audit("lab", **goal)
print("effect                  period    amplitude   ns per step  verdict")
for row in result.rows:
    if not math.isnan(row.period_change):
        change = f"{row.period_change:+.1e}   {row.amplitude_change:+.1e}   {row.ns_per_step:9.1f}"
        print(f"{row.effect:20s}  {change}    {row.verdict}")

gravity = next(row for row in result.rows if row.effect == "gravity")
print(f"Theory predicts a change of {gravity.period_predicted:+.2e} in the period from small angles to full gravity.")
assert abs(gravity.period_change / gravity.period_predicted - 1) < 0.05

scene, report = simplify("lab", **goal, duration=10.0)
print(report.text)
assert "quadratic_drag" in report.removed
assert not scene.has("quadratic_drag")
assert report.within == (report.error + report.integration_error <= 1e-3)
