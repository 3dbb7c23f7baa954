"""Evaluate a policy and write its card: ``python examples/learning/card.py out/policy.npz --out out/carded.npz``.

The policy plays 1000 episodes of its card's id, in the vector of ``gym.make_vec``, from seeds that no trainer of ours
uses; so do the random policy and, where its task allows, the controller ``swing_up``. The card says what they earn.
Several files are compared first, in 1000 other episodes, and the best of them is evaluated and written.
"""

import argparse
import dataclasses
from pathlib import Path

import gymnasium as gym
import numpy as np

from pendulum_env import controllers
from pendulum_env.common.version import __version__

CHOOSING, JUDGING = 4 * 10**6, 5 * 10**6
"""Seeds of the first of the episodes by which a policy is chosen, and of those that its card is about."""


def evaluated(policy: controllers.Policy, episodes: int) -> controllers.Policy:
    """Return a policy whose card has the returns of so many episodes."""
    vector = gym.make_vec(policy.card["id"], episodes, diagnostics=())
    found = controllers.evaluate(policy, vector, JUDGING)
    card = {
        "episodes": episodes, "seeds": [JUDGING, JUDGING + episodes - 1],
        "integrator": str(vector.unwrapped.integrator), "dt": vector.unwrapped.dt,
        "return": {"mean": float(found.returns.mean()), "sd": float(found.returns.std(ddof=1)),
                   "worst": float(found.returns.min())},
        "reached": float(found.reached.mean()),
        "random": float(controllers.evaluate(controllers.RandomPolicy(), vector, JUDGING).returns.mean()),
        "versions": {"lab-pendulum": __version__, "numpy": np.__version__},
    }
    if vector.unwrapped.task.goal.reference is None:
        reference = controllers.swing_up(vector)
        card["controller"] = float(controllers.evaluate(reference, vector, JUDGING).returns.mean())
    return dataclasses.replace(policy, card={**policy.card, "evaluation": card})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("files", type=Path, nargs="+", help="policies of one task, as trainers write them")
    parser.add_argument("--episodes", type=int, default=1000)
    parser.add_argument("--out", type=Path, help="file of the best policy with its card; by default none is written")
    options = parser.parse_args()

    policies = {file: controllers.load(file) for file in options.files}
    earned = {}
    for file, policy in policies.items():
        vector = gym.make_vec(policy.card["id"], options.episodes, diagnostics=())
        earned[file] = float(controllers.evaluate(policy, vector, CHOOSING).returns.mean())
        print(f"{file}: return {earned[file]:.5g}")
    best = evaluated(policies[max(earned, key=earned.__getitem__)], options.episodes)
    print(best)
    if options.out:
        print(f"Wrote {best.save(options.out)}")


if __name__ == "__main__":
    main()
