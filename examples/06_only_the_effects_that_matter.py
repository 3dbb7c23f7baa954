"""Which effects the lab bench calls for at a wanted accuracy, and what leaving out the others does to 10 s of it."""

import math

from pendulum_env import audit, simplify

asked = {"amplitude": math.radians(30.0), "tolerance": 1e-3}

found = audit("lab", **asked)
print("effect                  period    amplitude   ns per step  verdict")
for row in found.rows:
    if not math.isnan(row.period_change):
        change = f"{row.period_change:+.1e}   {row.amplitude_change:+.1e}   {row.ns_per_step:9.1f}"
        print(f"{row.effect:20s}  {change}    {row.verdict}")

gravity = next(row for row in found.rows if row.effect == "gravity")
print(f"The textbook says {gravity.period_predicted:+.2e} for the period at full gravity, from small angles.")
assert abs(gravity.period_change / gravity.period_predicted - 1) < 0.05

scene, report = simplify("lab", **asked, duration=10.0)
print(report.text)
assert "quadratic_drag" in report.removed
assert not scene.has("quadratic_drag")
assert report.within == (report.error + report.integration_error <= 1e-3)
