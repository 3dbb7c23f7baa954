"""Define your own integrator: a three-stage Runge-Kutta method with chosen nodes; order conditions give its weights."""

from __future__ import annotations

import math
from fractions import Fraction

import gymnasium as gym

from integrators import RungeKutta
from integrators.analysis import principal_error, stability_limit
from pendulum_env import rollout


def three_stages(second: Fraction, third: Fraction) -> RungeKutta:
    """Return the method of order 3 with stages at 0, ``second`` and ``third`` of the step.

    The order conditions determine all its other coefficients.
    """
    last = (Fraction(1, 3) - second / 2) / (third * (third - second))
    middle = (Fraction(1, 2) - last * third) / second
    coupling = Fraction(1, 6) / (last * second)
    return RungeKutta(
        name=f"stages_{second.numerator}_{second.denominator}_{third.numerator}_{third.denominator}",
        order=3,
        source="Butcher 2016, Numerical Methods for Ordinary Differential Equations, section 233",
        summary=f"three stages, at 0, {second} and {third} of the step",
        a=((Fraction(0),) * 3, (second, Fraction(0), Fraction(0)), (third - coupling, coupling, Fraction(0))),
        b=(1 - middle - last, middle, last),
    )


twentieths = [Fraction(k, 20) for k in range(1, 21)]
methods = [three_stages(c2, c3) for c2 in twentieths for c3 in twentieths if c2 < c3]
best = min(methods, key=principal_error)
print(f"Least principal error of {len(methods)} methods, {principal_error(best):.4f}: {best.summary}.")
assert best.b == (Fraction(2, 9), Fraction(1, 3), Fraction(4, 9))  # found by hand by Ralston 1962, Math. Comp. 16, 431


def error(method: RungeKutta | str, dt: float) -> float:
    """Return the error of the angle after 2 s from 1 rad [rad]."""
    true = rollout("vacuum", integrator="exact", angle=1.0, duration=2.0, dt=dt).angle[-1]
    return float(abs(rollout("vacuum", integrator=method, angle=1.0, duration=2.0, dt=dt).angle[-1] - true))


order = math.log2(error(best, 0.01) / error(best, 0.005))
print(f"Half the step leaves 1/{2**order:.2f} of the error: order {order:.2f}.")
assert abs(order - 3.0) < 0.1
assert abs(stability_limit(best) - math.sqrt(3.0)) < 1e-6

env = gym.make("LabPendulum-v0", integrator=best)
env.reset(seed=0)
_, _, _, _, info = env.step(env.action_space.sample())
print(f"In the environment it is {env.unwrapped.integrator}, with a residual of {info['energy_residual']:.1e} J.")
