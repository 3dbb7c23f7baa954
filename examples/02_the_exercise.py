"""The lab exercise: forward Euler gains energy, backward Euler loses it, symplectic Euler keeps it bounded."""

from pathlib import Path

from pendulum_env import plots, rollout

runs = {}
for integrator in ("forward_euler", "backward_euler", "symplectic_euler"):
    run = runs[integrator] = rollout("exercise", integrator=integrator, damping="none", dt=0.01, duration=10.0)
    growth = run.energy[-1] / run.energy[0]
    print(f"{integrator:18s} energy after 10 s: {growth:8.4f} times the initial energy")
    factor = 1.0 + (run.scene.omega0 * run.dt) ** 2
    steps = len(run.time) - 1
    exact = {"forward_euler": factor**steps, "backward_euler": factor**-steps, "symplectic_euler": 1.0}[integrator]
    assert abs(growth / exact - 1.0) < (0.05 if integrator == "symplectic_euler" else 1e-10)

folder = Path("out/exercise")
folder.mkdir(parents=True, exist_ok=True)
for draw in (plots.angle, plots.velocity, plots.phase, plots.energy, plots.energy_residual):
    plots.save(draw(runs).figure, folder / f"{draw.__name__}.png")
print("angle, velocity, phase portrait, energy and its residual are drawn in", folder)
print("The whole exercise as a report to fill in and print: lab-pendulum exercise --out", folder / "report")
