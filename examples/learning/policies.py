"""Train the policies of the package and write their cards: ``python examples/learning/policies.py out/policies``.

For each task, seeds are trained to the end by ``ppo.py``, beside this file; of each training the policy is kept that
earns most in 100 episodes. The best of all seeds in 1000 other episodes is evaluated in 1000 further ones, as are the
random policy and, where it can play the task, the controller ``swing_up``: its card says what they earn. Trainings
whose file is in the folder are not repeated. ``--out pendulum_env/controllers/policies`` replaces the package's own.
"""

import argparse
import dataclasses
from pathlib import Path

import gymnasium as gym
import numpy as np

import pendulum_env
from pendulum_env import controllers

IDS = {"swing_up": "LabPendulum-v0", "balance": "LabPendulumBalance-v0", "track": "LabPendulumTrack-v0"}
KEEPING, CHOOSING, JUDGING = 3 * 10**6, 4 * 10**6, 5 * 10**6
"""Seeds of the first of the episodes by which a policy of a training is kept, one of several is chosen, and judged."""


def earned(policy, episodes, seed):
    """Return the mean return of a policy in so many episodes of its card's id."""
    return controllers.evaluate(policy, gym.make_vec(policy.card["id"], episodes, diagnostics=()), seed).returns.mean()


def trained(task, seed, rounds, file):
    """Return the best policy of a training, from its file if it is there."""
    if file.exists():
        return controllers.load(file)
    from ppo import train

    best, most = None, -np.inf
    for policy in train(IDS[task], seed, rounds=rounds):
        if (mean := earned(policy, 100, KEEPING)) > most:
            best, most = policy, mean
        print(f"{task}, seed {seed}, {policy.card['training']['steps']:8d} steps: return {mean:9.3f}", flush=True)
    best.save(file)
    return best


def judged(policy, episodes=1000):
    """Return a policy whose card says what it earns in episodes that no training and no choice has used."""
    vector = gym.make_vec(policy.card["id"], episodes, diagnostics=())
    found = controllers.evaluate(policy, vector, JUDGING)
    card = {
        "episodes": episodes, "seeds": [JUDGING, JUDGING + episodes - 1],
        "integrator": str(vector.unwrapped.integrator), "dt": vector.unwrapped.dt,
        "return": {"mean": float(found.returns.mean()), "sd": float(found.returns.std(ddof=1)),
                   "worst": float(found.returns.min())},
        "reached": float(found.reached.mean()),
        "random": float(controllers.evaluate(controllers.RandomPolicy(), vector, JUDGING).returns.mean()),
        "versions": {"lab-pendulum": pendulum_env.__version__, "numpy": np.__version__},
    }
    if vector.unwrapped.task.goal.reference is None:
        reference = controllers.swing_up(vector)
        card["controller"] = float(controllers.evaluate(reference, vector, JUDGING).returns.mean())
    return dataclasses.replace(policy, card={**policy.card, "evaluation": card})


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path, help="folder of the trainings' policies")
    parser.add_argument("--tasks", nargs="*", choices=IDS, default=[*IDS])
    parser.add_argument("--seeds", type=int, nargs="*", default=[0, 1, 2])
    parser.add_argument("--rounds", type=int, default=200, help="of each training")
    parser.add_argument("--episodes", type=int, default=1000, help="of the choice, and of the card")
    parser.add_argument("--out", type=Path, help="folder for the best policies with their cards; by default none")
    options = parser.parse_args()

    for task in options.tasks:
        found = [trained(task, seed, options.rounds, options.folder / f"{task}_{seed}.npz") for seed in options.seeds]
        means = [earned(policy, options.episodes, CHOOSING) for policy in found]
        for policy, mean in zip(found, means, strict=True):
            print(f"{task}, seed {policy.card['training']['seed']}: return {mean:.5g}")
        best = judged(found[int(np.argmax(means))], options.episodes)
        print(best)
        if options.out:
            print(f"Wrote {best.save(options.out / f'{task}.npz')}")


if __name__ == "__main__":
    main()
