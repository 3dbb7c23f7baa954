"""The differentiable twin: the package's scenes and methods as pure functions of JAX arrays.

``import pendulum_env.jax as twin``. It needs the extra ``jax``; importing it changes no setting of JAX.
"""

try:
    import jax as _jax  # noqa: F401
except ImportError as error:
    raise ImportError(f"pendulum_env.jax needs JAX, but {error.name} is missing: pip install 'lab-pendulum[jax]'.",
                      name=error.name) from None

from pendulum_env.jax.env import EnvParams, EnvState, LabPendulum
from pendulum_env.jax.gymnax import Gymnax
from pendulum_env.jax.run import TwinRollout, rollout

__all__ = ["EnvParams", "EnvState", "Gymnax", "LabPendulum", "TwinRollout", "rollout"]
