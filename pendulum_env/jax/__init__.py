"""The differentiable twin: the package's scenes and methods as pure functions of JAX arrays.

``import pendulum_env.jax as twin``. It needs the extra ``jax``.
"""

from pendulum_env.jax.run import Rollout, rollout

__all__ = ["Rollout", "rollout"]
