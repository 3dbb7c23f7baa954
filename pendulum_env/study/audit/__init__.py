"""Which effects matter in a scene."""

from pendulum_env.study.audit.simplification import simplify
from pendulum_env.study.audit.study import audit

__all__ = ["audit", "simplify"]
