"""Checker of vector environments, for anybody's: Gymnasium's contract, autoreset modes, equality with SyncVectorEnv.

Gymnasium checks single environments (``gymnasium.utils.env_checker``), and no vector environments. The contract here is
that of its pages https://gymnasium.farama.org/api/vector and https://farama.org/Vector-Autoreset-Mode, and what its
``SyncVectorEnv`` and ``CartPoleVectorEnv`` do where those pages say nothing. Nothing here knows of pendulums.
"""

from pendulum_env.testing.checker import VectorCheck, VectorReport, check_vector_env

__all__ = ["VectorCheck", "VectorReport", "check_vector_env"]
