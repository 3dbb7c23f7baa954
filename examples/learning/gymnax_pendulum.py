"""Train PPO on gymnax's Pendulum-v1 with PureJaxRL's settings: ``python examples/learning/gymnax_pendulum.py 3000000``.

A peer of ``ppo.py``, in an environment of its own: ``pip install rejax "gymnax<0.1"``. The loop is that of rejax, the
settings are those that PureJaxRL (Lu et al. 2022, github.com/luchris429/purejaxrl) gives for continuous actions. Every
ten rounds a line says steps, seconds (compilation included) and the mean return of 100 episodes.
"""

import sys
import time

SETTINGS = {
    "learning_rate": 3e-4, "num_envs": 2048, "num_steps": 10, "num_epochs": 4, "num_minibatches": 32, "gamma": 0.99,
    "gae_lambda": 0.95, "clip_eps": 0.2, "ent_coef": 0.0, "vf_coef": 0.5, "max_grad_norm": 0.5,
    "agent_kwargs": {"activation": "tanh", "hidden_layer_sizes": (256, 256)}, "normalize_observations": True,
    "normalize_rewards": True}
ROUND = SETTINGS["num_envs"] * SETTINGS["num_steps"]


def main(steps, seed=0):
    import jax
    from rejax import PPO
    from rejax.evaluate import evaluate

    begun = time.perf_counter()

    def judged(learner, state, key):
        lengths, returns = evaluate(learner.make_act(state), key, learner.env, learner.env_params, 100, 200)
        jax.debug.callback(lambda count, mean: print(
            f"{count:9d} steps, {time.perf_counter() - begun:6.1f} s: return {mean:8.1f}", flush=True),
            state.global_step, returns.mean())
        return lengths, returns

    learner = PPO.create(env="Pendulum-v1", total_timesteps=steps, eval_freq=10 * ROUND, **SETTINGS)
    learner = learner.replace(eval_callback=judged)
    jax.block_until_ready(jax.jit(learner.train)(jax.random.key(seed)))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
