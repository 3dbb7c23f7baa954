"""Fit length and damping to a recording by gradients through the simulation, and find the minimum of ``fit``.

Needs ``pip install ".[jax]" optax``. With LAB_PENDULUM_DATA set it takes a recording of a real pendulum, filmed.
"""

import os
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import optax

import pendulum_env.jax as twin
from pendulum_env import Recording, fit
from pendulum_env.lab import simulated_recording

jax.config.update("jax_enable_x64", True)
folder = os.environ.get("LAB_PENDULUM_DATA")
whole = (Recording.read(Path(folder) / "video_decay_65cm.txt") if folder else simulated_recording()).released()
early = whole.time - whole.time[0] < 15.0
swings = Recording(whole.time[early] - whole.time[0], whole.angle[early], "15 s of swings")
found = fit(swings, "linear+quadratic", mass=0.0415 if folder else 0.01, radius=0.011 if folder else 0.02)
names = list(found.parameters)  # start, zero of the sensor, length, damping
errors, target = (np.array([getattr(found.parameters[name], part) for name in names]) for part in ("error", "value"))
guess = target + 2.0 * errors * (-1.0) ** np.arange(len(names))

readings, times = jnp.asarray(found.recording.angle), np.asarray(found.recording.time)
h = 2.0 * np.pi / found.scene.omega0 / 64.0  # the method and the steps of fit: 64 in a period
steps = int(times[-1] / h) + 1
i, s = (times // h).astype(int), times % h / h


def loss(u):  # of parameters in units of their errors; between the steps the motion is a cubic
    value = dict(zip(names, guess + u * errors, strict=True))
    start = {name: value.pop(name) for name in ("angle", "velocity")}
    zero = value.pop("zero")
    run = twin.rollout(found.scene, integrator="tsit5", dt=h, steps=steps, diagnostics=(), **start, parameters=value)
    q, v = run.angle, h * run.velocity
    rise, bend = q[i + 1] - q[i], v[i] + v[i + 1]
    angle = q[i] + s * (v[i] + s * (3 * rise - bend - v[i] + s * (bend - 2 * rise)))
    return jnp.sum((readings - zero - angle) ** 2) / found.noise**2


solver, value_and_grad = optax.lbfgs(), optax.value_and_grad_from_state(loss)
u = jnp.zeros(len(names))
state, slope, turns = solver.init(u), jnp.inf, 0


@jax.jit
def step(u, state):
    value, slope = value_and_grad(u, state=state)
    change, state = solver.update(slope, state, u, value=value, grad=slope, value_fn=loss)
    return optax.apply_updates(u, change), state, jnp.linalg.norm(slope)


while slope > 1e-6 and turns < 200:
    u, state, slope = step(u, state)
    turns += 1
apart = np.abs(guess + u * errors - target) / errors
for name, value, off in zip(names, target, apart, strict=True):
    print(f"{name} {value:.6g}: within {off:.1e} of its error")
print(f"{turns} steps of L-BFGS, with gradients of {steps} steps of tsit5; slope {slope:.1e}")
assert apart.max() < 1e-6
