"""Optimal control by direct shooting: the actions that swing the bob up in 6 s with the least work of the motor.

Needs ``pip install ".[jax]" optax``. Work is an entry of the energy ledger, which has derivatives as the motion has.
"""

import math

import jax
import jax.numpy as jnp
import optax

import pendulum_env.jax as twin
from pendulum_env import SCENES

jax.config.update("jax_enable_x64", True)
scene, controls, substeps = SCENES["lab"], 150, 4
weight = scene.restoring  # m g L


def motion(u):
    return twin.rollout(scene, integrator="rk4", angle=0.0, velocity=0.0, dt=0.01, substeps=substeps,
                        actions=jnp.tanh(u), every=controls * substeps)


def loss(u, strictness):  # at the end upright and at rest; among those that are, the one with the least work
    run = motion(u)
    miss = (run.angle[-1] - math.pi) ** 2 + (run.velocity[-1] / scene.omega0) ** 2
    return run.work[-1] / weight + strictness * miss


def solved(u, strictness, turns):
    solver, function = optax.lbfgs(), lambda u: loss(u, strictness)
    value_and_grad = optax.value_and_grad_from_state(function)

    def step(carry, _):
        u, state = carry
        value, slope = value_and_grad(u, state=state)
        change, state = solver.update(slope, state, u, value=value, grad=slope, value_fn=function)
        return (optax.apply_updates(u, change), state), None

    return jax.jit(lambda u: jax.lax.scan(step, (u, solver.init(u)), None, length=turns)[0][0])(u)


time = 0.04 * jnp.arange(controls)
u = 1.5 * jnp.sign(jnp.cos(scene.omega0 * time)) * (time < 4.0)  # pushes at the frequency of small swings
for strictness in (1.0, 10.0, 1000.0):
    u = solved(u, strictness, 150)
run = motion(u)
work, angle, velocity = (float(one[-1]) for one in (run.work, run.angle, run.velocity))
print(f"ends at {math.degrees(angle):.2f} degrees with {velocity:.3f} rad/s; work {work / weight:.4f} m g L")
print(f"of it {float(run.heat[-1]) / weight:.4f} m g L are heat")
assert abs(angle - math.pi) < 0.05
assert abs(velocity) < 0.3
assert 2.0 < work / weight < 2.5
