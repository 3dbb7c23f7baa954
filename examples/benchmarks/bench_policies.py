"""Policies for a real bench: controllers, PPO and SAC, trained with and without its sensor, delay and scatter.

The bench is the scene motor_bench, made from two real logs: swing up with 1.5 N m, an encoder of 0.0029 rad, and an
action that acts 5 ms late. ``ideal`` is that scene with perfect angles and velocities and no delay. ``bench`` has the
encoder, a velocity from its last 2 readings, the delay, and in every episode another pendulum: moment of inertia,
moment of the mass and both frictions are drawn with the errors of the fit. Held-out benches are episodes with seeds
that no training has used. "±" is the standard deviation over seeds.

    python examples/benchmarks/bench_policies.py --seeds 5

Results are kept in a folder, as those of baselines.py; ``--rows SAC`` runs some of them, ``--only-seed 3`` trains one
agent of each row, ``--share 0.001`` tries all in seconds. Training needs Stable-Baselines3 and torch in an environment
of their own. The last table says which difference between ``ideal`` and ``bench`` costs a policy how much.

With LAB_PENDULUM_DATA the command first checks the bench: it replays the recorded torques in the environment.
"""

from __future__ import annotations

import os
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from agents import Policy, can_train, kept, learnt, options_of, parser_of, ppo
from machine import describe

from pendulum_env import LabPendulumEnv, LabPendulumVectorEnv, Sensor, transfer
from pendulum_env.controllers import RandomPolicy, swing_up
from pendulum_env.envs.transfer import Transfer, mean
from pendulum_env.lab import DrivenLog

FIRST = 10**6
"""Seed of the first held-out bench, which no training uses."""
BUDGETS = {"PPO": 500_000, "SAC": 20_000}
LOGS = ("driven_bench_planned.csv", "driven_bench_energy_shaping.csv")
STARTS = (0.0, 1.0, 2.0, 3.0)
"""Starts of the replays of recorded torques [s]."""


def drawn(generator: np.random.Generator) -> dict[str, float]:
    """Draw a bench: I = 0.188 ± 0.005 kg m², M = 0.370 ± 0.005 kg m, b = 0.014 ± 0.006 N m s, F = 0.156 ± 0.011 N m."""
    inertia, moment, viscous, dry = generator.normal((0.188, 0.370, 0.014, 0.156), (0.005, 0.005, 0.006, 0.011))
    return {"length": inertia / moment, "mass": moment**2 / inertia, "bearing_viscosity": max(viscous, 0.0),
            "friction_torque": max(dry, 0.0)}


SHARED = {"scene": "motor_bench", "task": "swing_up", "dt": 0.02, "substeps": 4, "duration": 10.0}
IDEAL = SHARED
BENCH = {**SHARED, "observation": "encoder", "sensor": Sensor(quantum=0.0029, window=2), "action_delay": 0.005,
         "randomize": drawn}
PLACES = {"ideal": IDEAL, "bench": BENCH}


def trained(algorithm: str, place: str, budget: int, seed: int, path: Path) -> Policy:
    """Train an agent in one of the places; return its policy."""
    keywords = PLACES[place]
    if algorithm == "PPO":
        return ppo(budget=budget, seed=seed, warn=False, **keywords)
    return learnt(algorithm, budget, seed, path, {}, **keywords)


def tried(policy: Policy, episodes: int) -> Transfer:
    """Return a policy's returns in both places, on held-out benches, and the cost of the differences between them."""
    return transfer(policy, {**IDEAL, "warn": False}, {**BENCH, "warn": False}, episodes=episodes, seed=FIRST)


def as_data(found: Transfer) -> dict[str, Any]:
    """Return the means of a comparison, for JSON."""
    return {"ideal": mean(found.nominal).value, "bench": mean(found.real).value,
            "costs": {one.name: None if (cost := found.cost(one.name)) is None else cost.value
                      for one in found.differences}}


def replayed(folder: Path) -> None:
    """Print how far off the environment is when it replays the recorded torques, from several starts in both logs."""
    for name in LOGS:
        log = DrivenLog.read(folder / name)
        off = []
        for start in STARTS:
            dt = 0.005
            env = LabPendulumEnv("motor_bench", dt=dt, task="free", warn=False)
            time = log.time[0] + start + dt * np.arange(round(1.0 / dt))
            near = np.abs(log.time - time[0]) <= 0.02
            curve = np.polynomial.Polynomial.fit(log.time[near] - time[0], log.angle[near], 2)
            env.reset(options={"angle": float(curve(0.0)), "velocity": float(curve.deriv()(0.0))})
            shares = np.interp(time + 0.5 * dt, log.time, log.drive) / env.scene.parameters()["max_torque"]
            for share in shares:
                *_, info = env.step(np.array([share], dtype=np.float32))
            off.append(abs(info["angle"] - np.interp(time[-1] + dt, log.time, log.angle)))
        print(f"{name}: the recorded torques, replayed for 1 s from {len(off)} starts, end within "
              f"{', '.join(f'{one:.3f}' for one in off)} rad of the recorded angle")


def main() -> None:
    options = options_of(parser_of(__doc__, "out/bench_policies"))
    print(describe(("gymnasium", "numpy", "numba", "scipy", *(("stable-baselines3", "torch") if can_train() else ()))))
    if folder := os.environ.get("LAB_PENDULUM_DATA"):
        replayed(Path(folder))
    print("\n| policy | trained in | ideal | held-out benches | of |\n|---|---|---|---|---|")
    costs: list[tuple[str, dict[str, float | None]]] = []
    env = LabPendulumVectorEnv(1, warn=False, **IDEAL)  # type: ignore[arg-type]
    for name, policy in (("random", RandomPolicy(0)), ("energy shaping, LQR", swing_up(env))):
        if options.rows in name:
            found = tried(policy, options.episodes)
            costs.append((name, as_data(found)["costs"]))
            print(f"| {name} | - | {mean(found.nominal)} | {mean(found.real)} | {options.episodes} episodes |")
    for algorithm, whole in BUDGETS.items():
        for place in PLACES:
            budget = max(1, int(options.share * whole))
            if options.rows not in f"{algorithm}, {place}":
                continue
            rows = []
            for seed in range(options.seeds):
                path = options.folder / f"{algorithm}-{place}-{budget}-{seed}"
                may = can_train() and options.only_seed in (None, seed)
                work = partial(work_of, algorithm, place, budget, seed, path, options.episodes)
                if (one := kept(path, may, work)) is not None:
                    rows.append(one)
            if len(rows) > 1:
                told = (np.array([row[side] for row in rows]) for side in ("ideal", "bench"))
                cells = " | ".join(f"{side.mean():.0f} ± {side.std(ddof=1):.0f}" for side in told)
                print(f"| {algorithm}, {budget} steps | {place} | {cells} | {len(rows)} seeds |")
                each = ", ".join(f"{row['bench']:.0f}" for row in rows)
                print(f"| | | | each: {each} | "
                      f"{np.mean([row['seconds'] for row in rows]):.0f} s each on one core |", flush=True)
                costs.append((f"{algorithm}, {place}", {
                    key: None if rows[0]["costs"][key] is None else float(np.mean([row["costs"][key] for row in rows]))
                    for key in rows[0]["costs"]}))
    names = list(dict.fromkeys(name for _, each in costs for name in each))
    print(f"\n| change of the return by | {' | '.join(name for name, _ in costs)} |\n|{'---|' * (len(costs) + 1)}")
    for name in names:
        cells = (each.get(name) for _, each in costs)
        print(f"| {name} | {' | '.join('-' if cell is None else f'{cell:.1f}' for cell in cells)} |")


def work_of(algorithm: str, place: str, budget: int, seed: int, path: Path, episodes: int) -> dict[str, Any]:
    """Train an agent, and return its results in both places."""
    path.parent.mkdir(parents=True, exist_ok=True)
    policy = trained(algorithm, place, budget, seed, path)
    return as_data(tried(policy, episodes))


if __name__ == "__main__":
    main()
