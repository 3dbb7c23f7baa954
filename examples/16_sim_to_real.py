"""Train policies for a motor bench, with and without its sensor, delay and scatter, and try them on unseen benches.

The policy is the clipped sum of six terms, such as v cos(theta); their weights are learnt by the cross-entropy method
(Rubinstein 1999, Methodol. Comput. Appl. Probab. 1, 127): draw weights, keep the best sixth, draw near these again.
``python examples/benchmarks/bench_policies.py`` does the same with PPO, SAC and a controller.
"""

import numpy as np

from pendulum_env import LabPendulumVectorEnv, Sensor, transfer

IDEAL = {"scene": "motor_bench", "dt": 0.02, "substeps": 4, "duration": 6.0, "warn": False}
RANGES = {"length": (0.46, 0.56), "friction_torque": (0.1, 0.2), "max_torque": (1.2, 1.5)}
BENCH = {**IDEAL, "observation": "encoder", "sensor": Sensor(quantum=0.0029, window=2), "action_delay": 0.005,
         "randomize": RANGES}
SEEDS, ROUNDS, DRAWN, EACH = 5, 30, 48, 8


def terms(seen):
    cos, sin, v = seen[:, 0], seen[:, 1], 0.2 * seen[:, 2]
    return np.stack([sin, sin * cos, sin * cos * cos, v, v * cos, v**3], axis=1)


def learnt(keywords, seed):
    source, env = np.random.default_rng(seed), LabPendulumVectorEnv(DRAWN * EACH, diagnostics=(), **keywords)
    mean, spread, steps = np.zeros(6), np.full(6, 2.0), round(keywords["duration"] / keywords["dt"])
    for turn in range(ROUNDS):
        weights = mean + spread * source.standard_normal((DRAWN, 6))
        each, total = np.repeat(weights, EACH, axis=0), np.zeros(DRAWN * EACH)
        seen, _ = env.reset(seed=seed if turn == 0 else None)
        for _ in range(steps):
            actions = np.clip((terms(seen) * each).sum(axis=1, keepdims=True), -1.0, 1.0)
            seen, rewards, *_ = env.step(actions.astype(np.float32))
            total += rewards
        best = weights[np.argsort(total.reshape(DRAWN, EACH).mean(axis=1))[-DRAWN // 6 :]]
        mean, spread = best.mean(axis=0), best.std(axis=0) + 0.3 * 0.9**turn
    return lambda seen: np.clip(terms(seen) @ mean[:, None], -1.0, 1.0)


def main():
    results = {}
    for name, keywords in (("ideal", IDEAL), ("bench", BENCH)):
        found = [transfer(learnt(keywords, seed), IDEAL, BENCH, seed=10**6) for seed in range(SEEDS)]
        results[name] = [(one.nominal.mean(), one.real.mean()) for one in found]
        means, spreads = np.mean(results[name], axis=0), np.std(results[name], axis=0, ddof=1)
        ideal, bench = (f"{mean:.0f} ± {spread:.0f}" for mean, spread in zip(means, spreads, strict=True))
        print(f"trained in {name}, {SEEDS} seeds: return {ideal} in ideal, {bench} in unseen benches")
        print(found[0].text, found[0].table.markdown(), "", sep="\n")
    swung_up = np.median([ideal for ideal, _ in results["ideal"]])
    assert swung_up > -1000.0, swung_up
    assert np.median([bench - ideal for ideal, bench in results["ideal"]]) < 0.0


if __name__ == "__main__":
    main()
