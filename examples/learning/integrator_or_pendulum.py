"""Has a policy learnt the pendulum, or the errors of its integrator?

    python examples/learning/integrator_or_pendulum.py out/agents.jsonl --figure out/integrator_or_pendulum.png

trains the swing-up by ``ppo.py``, beside this file, with four integrators at three steps and five seeds each, 60
trainings. Of each training the policy is kept that earns most there, as a user would keep it; then it plays in the
accurate pendulum, at the same control step. The policies of rk4 at the smallest step also play on a bench, with a
sensor, a delay and scattered parameters (``pendulum_env.transfer``). Each policy's line goes into the file at once, and
a policy that has a line is not trained again. Returns are sums of the rewards times the step, so that those of
different steps compare.
"""

import argparse
import json
import time
import warnings
from pathlib import Path

import gymnasium as gym
import numpy as np
from scipy import stats

from pendulum_env import Sensor, controllers, plots, transfer
from pendulum_env.common.provenance import provenance

for intended in ("Steps of .* are too long for ", "integrator='auto': In .* the bob lingers near the top"):
    warnings.filterwarnings("ignore", intended)
NAME, DURATION, EPISODES, FIRST = "LabPendulum-v0", 10.0, 200, 10**6
INTEGRATORS = {"forward_euler": {}, "symplectic_euler": {}, "rk4": {}, "auto": {"accuracy": 1e-4}}
STEPS = (0.02, 0.04, 0.08)
ACCURATE = {"integrator": "rk4", "substeps": 16}
BENCH = {"observation": "encoder", "sensor": Sensor(quantum=0.003, window=2), "action_delay": 0.02,
         "randomize": {"length": (0.343, 0.363), "mass": (0.038, 0.042), "gamma": (0.01, 0.04)}}
PARTS = {"encoder": "observation", "20 ms delay": "action_delay", "scatter": "randomize"}


def lasting(dt):
    """Return the keywords of episodes of DURATION."""
    return {"duration": DURATION, "max_episode_steps": round(DURATION / dt)}


def earned(policy, seed, **keywords):
    """Return the mean return of EPISODES episodes, and the fraction that ends upright."""
    env = gym.make_vec(NAME, EPISODES, diagnostics=(), **lasting(keywords["dt"]), **keywords)
    found = controllers.evaluate(policy, env, seed)
    return float(keywords["dt"] * found.returns.mean()), float(found.reached.mean())


def line_of(integrator, dt, seed, rounds, folder):
    """Train a policy, save it, and return what it earns in its own world and in the accurate one."""
    from ppo import VERSIONS, train

    world, begun = {"integrator": integrator, "dt": dt, **INTEGRATORS[integrator]}, time.time()
    best, most = None, -np.inf
    for policy in train(NAME, seed, rounds=rounds, often=max(1, rounds // 8), **lasting(dt), **world):
        if (now := earned(policy, 2 * FIRST, **world)[0]) > most:
            best, most = policy, now
    best.save(folder / f"{integrator}_{dt}_{seed}.npz")
    own, real = earned(best, FIRST, **world), earned(best, FIRST, **{**ACCURATE, "dt": dt})
    return {"integrator": integrator, "dt": dt, "seed": seed, "own": own[0], "real": real[0], "upright": own[1],
            "really_upright": real[1], "steps": best.card["training"]["steps"], "seconds": time.time() - begun,
            "versions": VERSIONS}


def bench_costs(file, dt):
    """Return what each part of a bench changes in the return of a saved policy, by the part's name."""
    nominal = {**ACCURATE, "dt": dt, **lasting(dt)}
    found = transfer(controllers.load(file), nominal, {**nominal, **BENCH}, episodes=EPISODES)
    alone = {said: found.cost(keyword).value for said, keyword in PARTS.items()}
    return {said: float(dt * value) for said, value in {**alone, "all three": found.gap.value}.items()}


def interval(values):
    """Return the geometric mean of a few seeds' values, and the ends of its 95 % interval (Student's t, of logarithms).
    """
    logs = np.log(values)
    half = stats.t.ppf(0.975, len(logs) - 1) * stats.sem(logs)
    return np.exp(logs.mean() + np.array([0.0, -half, half]))


def draw(lines, folder, file):
    """Draw by how much the return differs in the accurate pendulum, against the step, beside what a bench costs."""
    figure, (axes,) = plots.figure(size=(8.0, 5.5))
    for k, name in enumerate(INTEGRATORS):
        for dt in STEPS:
            x = 1e3 * dt * 1.04 ** (k - 1.5)  # side by side
            lost = [abs(one["own"] - one["real"]) for one in lines if (one["integrator"], one["dt"]) == (name, dt)]
            middle, low, high = interval(lost)
            print(f"{name}, {1e3 * dt:.0f} ms: {middle:.2g} ({low:.2g} to {high:.2g})")
            axes.plot([x] * len(lost), lost, ".", color=f"C{k}", alpha=0.4)
            axes.errorbar(x, middle, [[middle - low], [high - middle]], marker="_", ms=14, capsize=3, color=f"C{k}",
                          label=name if dt == STEPS[0] else None)
    rk4 = [one["seed"] for one in lines if (one["integrator"], one["dt"]) == ("rk4", STEPS[0])]
    bench = [bench_costs(folder / f"rk4_{STEPS[0]}_{seed}.npz", STEPS[0]) for seed in rk4]
    for part in bench[0]:
        middle, low, high = interval([abs(one[part]) for one in bench])
        print(f"bench, {part}: {middle:.2g} ({low:.2g} to {high:.2g})")
        axes.axhline(middle, color="0.5", ls="--", lw=1.0)
        axes.text(132.0, middle, f"bench: {part}", va="bottom" if part == "all three" else "top",
                  ha="right", color="0.3", fontsize="small")
    axes.set(xscale="log", yscale="log", xlabel="step of integration and of control [ms]",
             ylabel="difference of the return [reward s]", xlim=(800.0 * STEPS[0], 135.0),
             title="Return of swing-up policies: where they were trained, less in the accurate pendulum")
    axes.set_xticks([1e3 * dt for dt in STEPS], [f"{1e3 * dt:.0f}" for dt in STEPS])
    axes.minorticks_off()
    axes.legend(title="trained with")
    plots.save(figure, file, provenance())


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("file", type=Path, help="file of the policies' lines; the policies lie beside it")
    parser.add_argument("--seeds", type=int, nargs="*", default=[0, 1, 2, 3, 4])
    parser.add_argument("--rounds", type=int, default=80, help="of each training")
    parser.add_argument("--figure", type=Path, help="file of the figure; by default none is drawn")
    options = parser.parse_args()
    options.file.parent.mkdir(parents=True, exist_ok=True)
    lines = [json.loads(one) for one in options.file.read_text().splitlines()] if options.file.exists() else []
    done = {(one["integrator"], one["dt"], one["seed"]) for one in lines}
    for seed in options.seeds:
        for dt in STEPS:
            for integrator in INTEGRATORS:
                if (integrator, dt, seed) in done:
                    continue
                lines.append(line_of(integrator, dt, seed, options.rounds, options.file.parent))
                with options.file.open("a") as file:
                    file.write(json.dumps(lines[-1]) + "\n")
                print({key: value for key, value in lines[-1].items() if key != "versions"}, flush=True)
    if options.figure:
        draw(lines, options.file.parent, options.figure)


if __name__ == "__main__":
    main()
